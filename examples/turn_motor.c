/* Your own harness: the firmware as a PC library (`make lib`) turns a motor of fifteen lines. Run it: make examples
 *
 * Every 50 us: write the four samples, call the control interrupt and the background, read duties and override. */
#include <math.h>
#include <stdio.h>
#include <xc.h>

#include "board/firmware.h"

#define BUS_V 24.0
#define STEP_S 25e-6     /* half a PWM period */
#define PAIRS 5.0        /* the motor of userparams.h, a Hurst DMB0224C10002 */
#define FLUX_VS 0.007984 /* Kphi 7.24 V/krpm */

static double i_alpha, i_beta, angle, speed; /* A, electrical rad and rad/s */

/* Mean voltage of a leg: the dead time of 2 us (80 counts) takes what the firmware's compensation adds. */
static double leg(uint16_t duty, double i)
{
    return BUS_V * (duty - 80.0 * fmax(-1.0, fmin(1.0, i / 0.047))) / 2000.0;
}

static void motor_step(const uint16_t duty[3])
{
    double e = FLUX_VS * speed, i_b = -0.5 * i_alpha + 0.866 * i_beta, torque;
    double a = leg(duty[0], i_alpha), b = leg(duty[1], i_b), c = leg(duty[2], -i_alpha - i_b);
    int on = P1OVDCON == 0x3F00; /* else all legs are off or charge the drivers */

    i_alpha = on ? i_alpha + ((2.0 * a - b - c) / 3.0 - 2.67 * i_alpha + e * sin(angle)) * STEP_S / 1.92e-3 : 0.0;
    i_beta = on ? i_beta + ((b - c) / 1.732 - 2.67 * i_beta - e * cos(angle)) * STEP_S / 1.92e-3 : 0.0;
    torque = 1.5 * PAIRS * FLUX_VS * (i_beta * cos(angle) - i_alpha * sin(angle)) - 0.004 * tanh(speed / 10.0) - 3e-6 * speed;
    speed += PAIRS * torque / 5.5e-6 * STEP_S;
    angle = fmod(angle + speed * STEP_S, 6.283185307);
}

/* Signed fractional result of the converter for 0 .. 1 of its range. */
static uint16_t converter(double part)
{
    return (uint16_t)((uint16_t)(part * 65535.0) ^ 0x8000u);
}

int main(void)
{
    uint16_t acting[3] = { 0, 0, 0 };
    double rpm = 0.0;

    firmware_init();
    for (int n = 0; n <= 80000; n++) { /* four seconds */
        double s = n * 50e-6;
        PORTAbits.RA8 = !(s > 0.2 && s < 0.3);     /* S2 pressed for 0.1 s */
        ADC1BUF0 = converter(0.5);                 /* potentiometer: between 150 and 2800 rpm */
        ADC1BUF1 = converter(0.5 - i_alpha / 8.8); /* shunts in the low legs: inverted, 4.4 A full scale */
        ADC1BUF2 = converter(0.5 - (-0.5 * i_alpha + 0.866 * i_beta) / 8.8);
        ADC1BUF3 = converter(BUS_V / 52.8);
        _ADC1Interrupt();
        if (IFS0bits.T2IF) { /* the slow work, which the control interrupt raises */
            _T2Interrupt();
        }
        firmware_background();
        motor_step(acting); /* the old duties act until the counter is at zero, */
        acting[0] = P1DC1;  /* then the new ones load */
        acting[1] = P1DC2;
        acting[2] = P1DC3;
        motor_step(acting);
        rpm = speed * 60.0 / 6.283185307 / PAIRS;
        if (n % 8000 == 0) {
            printf("%.1f s  %6.1f rpm  %5.2f A  duties %4u %4u %4u\n", s, rpm, hypot(i_alpha, i_beta), acting[0], acting[1], acting[2]);
        }
    }
    return fabs(rpm - 1475.0) < 10.0 ? 0 : 1; /* the middle of 150 .. 2800 rpm */
}
