/* Oscillator: sources, PLL with its lock time, clock switching, and the two unlock sequences of OSCCON; the lock of the pin selection. */
#include "chip.h"
#include "chip_assumptions.h"

#include <math.h>

enum {
    OSWEN = 0x0001,
    LPOSCEN = 0x0002,
    CF = 0x0008,
    LOCK = 0x0020,
    IOLOCK = 0x0040,
    CLKLOCK = 0x0080,
    POSCMD = 0x03,      /* FOSC: 0 EC, 1 XT, 2 HS, 3 off */
    POSCMD_OFF = 3,
    IOL1WAY = 0x20,     /* FOSC */
    FCKSM_FIXED = 0x80, /* FOSC: no clock switching */
    FNOSC = 0x07,       /* FOSCSEL */
    PLLPRE_PLLPOST = 0x00DF, /* CLKDIV */
    DOZEN = 0x0800
};

static unsigned source_now(const chip_t *chip)
{
    return (chip_get(chip, SFR_OSCCON) >> 12) & 7u;
}

static unsigned source_wanted(const chip_t *chip)
{
    return (chip_get(chip, SFR_OSCCON) >> 8) & 7u;
}

static bool has_pll(unsigned source)
{
    return source == 1 || source == 3;
}

/* Frequencies within the PLL: after its first divider, of its own oscillator, behind its second divider. */
typedef struct {
    double detector_hz, vco_hz, out_hz;
} pll_t;

static pll_t pll_of(const chip_t *chip, double input_hz)
{
    unsigned clkdiv = chip_get(chip, SFR_CLKDIV);
    double n1 = (double)(clkdiv & 0x1Fu) + 2.0;
    double n2 = 2.0 * (double)(((clkdiv >> 6) & 3u) + 1u);
    double m = (double)(chip_get(chip, SFR_PLLFBD) & 0x1FFu) + 2.0;
    pll_t pll = {.detector_hz = input_hz / n1};
    pll.vco_hz = pll.detector_hz * m;
    pll.out_hz = pll.vco_hz / n2;
    return pll;
}

/* FRCDIV: powers of two, but the last is 256. */
static double frc_divisor(const chip_t *chip)
{
    unsigned frcdiv = (chip_get(chip, SFR_CLKDIV) >> 8) & 7u;
    return frcdiv == 7 ? 256.0 : (double)(1u << frcdiv);
}

static double source_hz(const chip_t *chip, unsigned source)
{
    switch (source) {
    case 0: return chip->clock.frc_hz;
    case 1: return pll_of(chip, chip->clock.frc_hz).out_hz;
    case 2: return chip->clock.crystal_hz;
    case 3: return pll_of(chip, chip->clock.crystal_hz).out_hz;
    case 4: return ASSUME_SECONDARY_HZ;
    case 5: return chip->clock.lprc_hz;
    case 6: return chip->clock.frc_hz / 16.0;
    default: return chip->clock.frc_hz / frc_divisor(chip);
    }
}

/* The clock may have another frequency now: time goes on from here with it. */
void chip_clock_follow(chip_t *chip)
{
    double fcy_hz = 0.5 * source_hz(chip, source_now(chip));
    if (fcy_hz == chip->clock.fcy_hz) {
        return;
    }
    uint64_t now = chip_now(chip);
    chip->clock.base_s = chip_time_at(chip, now);
    chip->clock.base_cycle = now;
    chip->clock.fcy_hz = fcy_hz;
    chip_watchdog_reschedule(chip);
    if (chip->cpu.clock != NULL) {
        chip->cpu.clock(chip->cpu.context);
    }
}

/* What is wrong with the clock that the PWM runs on: a PLL out of range, more than 40 MHz, another clock than expected. */
void chip_clock_check(chip_t *chip)
{
    const chip_clock_t *c = &chip->clock;
    unsigned source = source_now(chip);
    if ((chip_get(chip, SFR_P1TCON) & 0x8000u) == 0) {
        return; /* on the way to its clock; nothing depends on it before the PWM runs */
    }
    if (has_pll(source)) {
        pll_t pll = pll_of(chip, source == 1 ? c->frc_hz : c->crystal_hz);
        if (pll.detector_hz < 0.8e6 || pll.detector_hz > 8e6) {
            chip_warn(chip, "CLKDIV: PLLPRE gives the phase detector %.2f MHz, the range is 0.8 to 8 MHz", pll.detector_hz * 1e-6);
        }
        if (pll.vco_hz < 100e6 || pll.vco_hz > 200e6) {
            chip_warn(chip, "PLLFBD: the PLL's oscillator would run at %.0f MHz, the range is 100 to 200 MHz", pll.vco_hz * 1e-6);
        }
    }
    if (source != 3) {
        chip_warn(chip, "OSCCON: the clock source is %u, the crystal with PLL is 3", source);
    }
    if (c->fcy_hz > 40.2e6) {
        chip_warn(chip, "PLLFBD: the instruction clock would be %.1f MHz, the device is specified up to 40 MHz", c->fcy_hz * 1e-6);
    }
    if (c->expected_fcy_hz > 0.0 && fabs(c->fcy_hz / c->expected_fcy_hz - 1.0) > 0.01) {
        chip_warn(chip, "%s: the instruction clock is %.2f MHz, expected %.2f MHz; every time scales with it",
                  source == 3 ? "PLLFBD" : "OSCCON", c->fcy_hz * 1e-6, c->expected_fcy_hz * 1e-6);
    }
}

static bool can_switch(chip_t *chip, unsigned source)
{
    unsigned fosc = chip->config[CHIP_FOSC];
    if ((fosc & FCKSM_FIXED) != 0) {
        chip_warn(chip, "OSCCON: FCKSM in the configuration words forbids clock switching");
        return false;
    }
    if ((source == 2 || source == 3) && (fosc & POSCMD) == POSCMD_OFF) {
        chip_warn(chip, "OSCCON: POSCMD in the configuration words has the crystal oscillator off, the clock switch never completes");
        return false;
    }
    return true;
}

/* Time until a source is ready: its start-up timer, then the PLL. */
static double ready_s(const chip_t *chip, unsigned source)
{
    bool crystal = source == 2 || source == 3;
    bool external = (chip->config[CHIP_FOSC] & POSCMD) == 0;
    double start_s = crystal && !external ? chip->clock.crystal_start / chip->clock.crystal_hz : 0.0;
    return start_s + (has_pll(source) ? chip->clock.pll_lock_s : 0.0);
}

static void request_switch(chip_t *chip, uint16_t osccon)
{
    unsigned source = source_wanted(chip);
    if (source == source_now(chip)) {
        chip_put(chip, SFR_OSCCON, osccon & ~(unsigned)OSWEN); /* nothing to do */
        return;
    }
    if (can_switch(chip, source)) {
        chip_put(chip, SFR_OSCCON, osccon & ~(unsigned)LOCK);
        chip_schedule(chip, CHIP_EVENT_CLOCK, chip_cycle_at(chip, chip_seconds(chip) + ready_s(chip, source)));
    }
}

/* The new source is ready. */
void chip_clock_event(chip_t *chip)
{
    unsigned osccon = chip_get(chip, SFR_OSCCON);
    unsigned source = source_wanted(chip);
    if ((osccon & OSWEN) != 0) {
        osccon = (osccon & 0x0FFFu & ~(unsigned)OSWEN) | source << 12;
    }
    osccon = has_pll(source_wanted(chip)) ? osccon | LOCK : osccon & ~(unsigned)LOCK;
    chip_put(chip, SFR_OSCCON, osccon);
    chip_clock_follow(chip);
}

static void write_low(chip_t *chip, unsigned value)
{
    unsigned before = chip_get(chip, SFR_OSCCON);
    unsigned osccon = (before & 0xFF20u) | (value & (LPOSCEN | IOLOCK | CLKLOCK | OSWEN)) | (before & value & CF) | (before & CLKLOCK);
    bool one_way = (chip->config[CHIP_FOSC] & IOL1WAY) != 0;
    if ((before & CLKLOCK) != 0) {
        osccon = (osccon & ~(unsigned)OSWEN) | (before & OSWEN);
    }
    if (one_way && chip->clock.locked_once) {
        osccon |= IOLOCK;
    }
    chip->clock.locked_once = chip->clock.locked_once || (osccon & IOLOCK) != 0;
    chip_put(chip, SFR_OSCCON, osccon);
    if ((osccon & OSWEN) == 0) {
        chip->event[CHIP_EVENT_CLOCK] = CHIP_NEVER;
    } else if ((before & OSWEN) == 0) {
        request_switch(chip, (uint16_t)osccon);
    }
}

static void write_high(chip_t *chip, unsigned value)
{
    unsigned osccon = chip_get(chip, SFR_OSCCON);
    if ((osccon & (OSWEN | CLKLOCK)) == 0) {
        chip_put(chip, SFR_OSCCON, (osccon & 0xF8FFu) | (value & 7u) << 8);
    }
}

/* One write of an unlock sequence. True if it comes right after both keys and therefore goes through. */
static bool unlocked(unsigned *step, uint64_t *last, uint64_t now, unsigned value, unsigned key1, unsigned key2)
{
    bool follows = now - *last <= ASSUME_UNLOCK_CYCLES;
    *last = now;
    if (*step == 2 && follows) {
        *step = 0;
        return true;
    }
    if (*step == 1 && follows && value == key2) {
        *step = 2;
    } else {
        *step = value == key1 ? 1u : 0u;
    }
    return false;
}

static void write_osccon(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    chip_clock_t *c = &chip->clock;
    uint64_t now = chip_now(chip);
    (void)address;
    if (mask == 0x00FFu) {
        if (unlocked(&c->low_step, &c->low_cycle, now, value & 0xFFu, 0x46, 0x57)) {
            write_low(chip, value & 0xFFu);
        }
    } else if (mask == 0xFF00u) {
        if (unlocked(&c->high_step, &c->high_cycle, now, (unsigned)value >> 8, 0x78, 0x9A)) {
            write_high(chip, (unsigned)value >> 8);
        }
    } else {
        chip_warn(chip, "OSCCON: written without the unlock sequence of its bytes, nothing happens");
    }
}

static void write_divider(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    unsigned before = chip_get(chip, address), after = chip_merged(chip, address, value, mask);
    chip_put(chip, address, after);
    if (has_pll(source_now(chip)) && ((before ^ after) & (address == SFR_CLKDIV ? PLLPRE_PLLPOST : 0xFFFFu)) != 0) {
        chip_warn(chip, "PLLFBD, CLKDIV: the PLL is changed while it is the clock; switch to FRC first");
    }
    if ((chip_get(chip, SFR_CLKDIV) & DOZEN) != 0) {
        chip_warn(chip, "CLKDIV: DOZEN is set, a slowed core is not modelled");
    }
    chip_clock_follow(chip);
}

bool chip_clock_pins_locked(const chip_t *chip)
{
    return (chip_get(chip, SFR_OSCCON) & IOLOCK) != 0;
}

void chip_clock_hooks(chip_t *chip)
{
    chip_hook(chip, SFR_OSCCON, NULL, write_osccon);
    chip_hook(chip, SFR_CLKDIV, NULL, write_divider);
    chip_hook(chip, SFR_PLLFBD, NULL, write_divider);
}

/* Power-on takes the source of the configuration words; other resets keep the running one. */
void chip_clock_reset(chip_t *chip, chip_reset_t cause)
{
    chip_clock_t *c = &chip->clock;
    c->low_step = c->high_step = 0;
    c->low_cycle = c->high_cycle = 0;
    c->locked_once = false;
    if (cause == CHIP_RESET_POR) {
        unsigned source = chip->config[CHIP_FOSCSEL] & FNOSC;
        chip_put(chip, SFR_OSCCON, source << 12 | source << 8);
        c->fcy_hz = 0.5 * source_hz(chip, source);
        c->base_s = 0.0;
        c->base_cycle = chip_now(chip);
        if (has_pll(source)) {
            chip_schedule(chip, CHIP_EVENT_CLOCK, chip_cycle_at(chip, c->pll_lock_s));
        }
        return;
    }
    unsigned source = source_now(chip);
    chip_put(chip, SFR_OSCCON, source << 12 | source << 8 | (chip_get(chip, SFR_OSCCON) & LOCK));
    chip_clock_follow(chip);
}
