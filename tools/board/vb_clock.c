/* The oscillator: instruction clock from OSCCON, CLKDIV and PLLFBD. */
#include "vb_internal.h"

#include <math.h>

#define FRC_HZ 7.37e6

static double pll_hz(vb_t *vb, double input_hz)
{
    unsigned clkdiv = *vb->reg.clkdiv;
    double n1 = (double)(clkdiv & 0x1Fu) + 2.0;
    double n2 = 2.0 * (double)(((clkdiv >> 6) & 3u) + 1u);
    double m = (double)(*vb->reg.pllfbd & 0x1FFu) + 2.0;
    double detector_hz = input_hz / n1;
    double vco_hz = detector_hz * m;
    if (detector_hz < 0.8e6 || detector_hz > 8e6) {
        vb_warn(vb, "CLKDIV: PLLPRE gives the phase detector %.2f MHz, the range is 0.8 to 8 MHz", detector_hz * 1e-6);
    }
    if (vco_hz < 100e6 || vco_hz > 200e6) {
        vb_warn(vb, "PLLFBD: the PLL's oscillator would run at %.0f MHz, the range is 100 to 200 MHz", vco_hz * 1e-6);
    }
    return vco_hz / n2;
}

/* FRCDIV: powers of two, but the last is 256. */
static double frc_divisor(unsigned clkdiv)
{
    unsigned frcdiv = (clkdiv >> 8) & 7u;
    return frcdiv == 7 ? 256.0 : (double)(1u << frcdiv);
}

/* Instruction clock. Warns about a PLL out of range, more than 40 MHz, and a clock that is not the expected one. */
double vb_clock_fcy_hz(vb_t *vb)
{
    unsigned source = (*vb->reg.osccon >> 12) & 7u;
    double fosc_hz;
    switch (source) {
    case 0: fosc_hz = FRC_HZ; break;
    case 1: fosc_hz = pll_hz(vb, FRC_HZ); break;
    case 2: fosc_hz = vb->crystal_hz; break;
    case 3: fosc_hz = pll_hz(vb, vb->crystal_hz); break;
    case 4: fosc_hz = 32768.0; break;
    case 5: fosc_hz = 32000.0; break;
    case 6: fosc_hz = FRC_HZ / 16.0; break;
    default: fosc_hz = FRC_HZ / frc_divisor(*vb->reg.clkdiv); break;
    }
    double fcy_hz = 0.5 * fosc_hz;
    if (vb->live != NULL && (*vb->reg.p1tcon & 0x8000u) == 0) {
        return fcy_hz; /* on the way to its clock; nothing depends on it before the PWM runs */
    }
    if (source != 3) {
        vb_warn(vb, "OSCCON: the clock source is %u, the crystal with PLL is 3", source);
    }
    if (fcy_hz > 40.2e6) {
        vb_warn(vb, "PLLFBD: the instruction clock would be %.1f MHz, the device is specified up to 40 MHz", fcy_hz * 1e-6);
    }
    if (vb->expected_fcy_hz > 0.0 && fabs(fcy_hz / vb->expected_fcy_hz - 1.0) > 0.01) {
        vb_warn(vb, "%s: the instruction clock is %.2f MHz, expected %.2f MHz; every time scales with it",
                source == 3 ? "PLLFBD" : "OSCCON", fcy_hz * 1e-6, vb->expected_fcy_hz * 1e-6);
    }
    return fcy_hz;
}
