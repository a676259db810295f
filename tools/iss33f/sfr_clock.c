/* Oscillator: sources, PLL with its lock time, clock switching, and the two unlock sequences of OSCCON; the lock of the pin selection. */
#include "sfr_internal.h"

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

static unsigned source_now(const soc_t *soc)
{
    return (soc_get(soc, SFR_OSCCON) >> 12) & 7u;
}

static unsigned source_wanted(const soc_t *soc)
{
    return (soc_get(soc, SFR_OSCCON) >> 8) & 7u;
}

static bool has_pll(unsigned source)
{
    return source == 1 || source == 3;
}

static double pll_hz(const soc_t *soc, double input_hz)
{
    unsigned clkdiv = soc_get(soc, SFR_CLKDIV);
    double n1 = (double)(clkdiv & 0x1Fu) + 2.0;
    double n2 = 2.0 * (double)(((clkdiv >> 6) & 3u) + 1u);
    double m = (double)(soc_get(soc, SFR_PLLFBD) & 0x1FFu) + 2.0;
    return input_hz / n1 * m / n2;
}

/* FRCDIV: powers of two, but the last is 256. */
static double frc_divisor(const soc_t *soc)
{
    unsigned frcdiv = (soc_get(soc, SFR_CLKDIV) >> 8) & 7u;
    return frcdiv == 7 ? 256.0 : (double)(1u << frcdiv);
}

static double source_hz(const soc_t *soc, unsigned source)
{
    switch (source) {
    case 0: return soc->times.frc_hz;
    case 1: return pll_hz(soc, soc->times.frc_hz);
    case 2: return soc->times.crystal_hz;
    case 3: return pll_hz(soc, soc->times.crystal_hz);
    case 4: return ASSUME_SECONDARY_HZ;
    case 5: return soc->times.lprc_hz;
    case 6: return soc->times.frc_hz / 16.0;
    default: return soc->times.frc_hz / frc_divisor(soc);
    }
}

/* The clock may have another frequency now: time goes on from here with it. */
static void follow_clock(soc_t *soc)
{
    double fcy_hz = 0.5 * source_hz(soc, source_now(soc));
    if (fcy_hz == soc->fcy_hz) {
        return;
    }
    uint64_t now = soc_now(soc);
    soc->base_s = soc_time_at(soc, now);
    soc->base_cycle = now;
    soc->fcy_hz = fcy_hz;
    soc_watchdog_reschedule(soc);
    if (soc->board.clock != NULL) {
        soc->board.clock(soc->board.context);
    }
}

static bool can_switch(soc_t *soc, unsigned source)
{
    unsigned fosc = soc->config[IMAGE_FOSC];
    if ((fosc & FCKSM_FIXED) != 0) {
        soc_note(soc, "OSCCON: FCKSM in the configuration words forbids clock switching");
        return false;
    }
    if ((source == 2 || source == 3) && (fosc & POSCMD) == POSCMD_OFF) {
        soc_note(soc, "OSCCON: POSCMD in the configuration words has the crystal oscillator off, the clock switch never completes");
        return false;
    }
    return true;
}

/* Time until a source is ready: its start-up timer, then the PLL. */
static double ready_s(const soc_t *soc, unsigned source)
{
    bool crystal = source == 2 || source == 3;
    bool external = (soc->config[IMAGE_FOSC] & POSCMD) == 0;
    double start_s = crystal && !external ? soc->times.crystal_start / soc->times.crystal_hz : 0.0;
    return start_s + (has_pll(source) ? soc->times.pll_lock_s : 0.0);
}

static void request_switch(soc_t *soc, uint16_t osccon)
{
    unsigned source = source_wanted(soc);
    if (source == source_now(soc)) {
        soc_put(soc, SFR_OSCCON, osccon & ~(unsigned)OSWEN); /* nothing to do */
        return;
    }
    if (can_switch(soc, source)) {
        soc_put(soc, SFR_OSCCON, osccon & ~(unsigned)LOCK);
        soc_schedule(soc, SOC_CLOCK, soc_cycle_at(soc, soc_seconds(soc) + ready_s(soc, source)));
    }
}

/* The new source is ready. */
void soc_clock_event(soc_t *soc)
{
    unsigned osccon = soc_get(soc, SFR_OSCCON);
    unsigned source = source_wanted(soc);
    if ((osccon & OSWEN) != 0) {
        osccon = (osccon & 0x0FFFu & ~(unsigned)OSWEN) | source << 12;
    }
    osccon = has_pll(source_wanted(soc)) ? osccon | LOCK : osccon & ~(unsigned)LOCK;
    soc_put(soc, SFR_OSCCON, osccon);
    follow_clock(soc);
}

static void write_low(soc_t *soc, unsigned value)
{
    unsigned before = soc_get(soc, SFR_OSCCON);
    unsigned osccon = (before & 0xFF20u) | (value & (LPOSCEN | IOLOCK | CLKLOCK | OSWEN)) | (before & value & CF) | (before & CLKLOCK);
    bool one_way = (soc->config[IMAGE_FOSC] & IOL1WAY) != 0;
    if ((before & CLKLOCK) != 0) {
        osccon = (osccon & ~(unsigned)OSWEN) | (before & OSWEN);
    }
    if (one_way && soc->clock.locked_once) {
        osccon |= IOLOCK;
    }
    soc->clock.locked_once = soc->clock.locked_once || (osccon & IOLOCK) != 0;
    soc_put(soc, SFR_OSCCON, osccon);
    if ((osccon & OSWEN) == 0) {
        soc->event[SOC_CLOCK] = SOC_NEVER;
    } else if ((before & OSWEN) == 0) {
        request_switch(soc, (uint16_t)osccon);
    }
}

static void write_high(soc_t *soc, unsigned value)
{
    unsigned osccon = soc_get(soc, SFR_OSCCON);
    if ((osccon & (OSWEN | CLKLOCK)) == 0) {
        soc_put(soc, SFR_OSCCON, (osccon & 0xF8FFu) | (value & 7u) << 8);
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
    soc_t *soc = context;
    soc_clock_t *c = &soc->clock;
    uint64_t now = soc_now(soc);
    (void)address;
    if (mask == 0x00FFu) {
        if (unlocked(&c->low_step, &c->low_cycle, now, value & 0xFFu, 0x46, 0x57)) {
            write_low(soc, value & 0xFFu);
        }
    } else if (mask == 0xFF00u) {
        if (unlocked(&c->high_step, &c->high_cycle, now, (unsigned)value >> 8, 0x78, 0x9A)) {
            write_high(soc, (unsigned)value >> 8);
        }
    } else {
        soc_note(soc, "OSCCON: written without the unlock sequence of its bytes, nothing happens");
    }
}

static void write_divider(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    unsigned before = soc_get(soc, address), after = soc_merged(soc, address, value, mask);
    soc_put(soc, address, after);
    if (has_pll(source_now(soc)) && ((before ^ after) & (address == SFR_CLKDIV ? PLLPRE_PLLPOST : 0xFFFFu)) != 0) {
        soc_note(soc, "PLLFBD, CLKDIV: the PLL is changed while it is the clock; switch to FRC first");
    }
    if ((soc_get(soc, SFR_CLKDIV) & DOZEN) != 0) {
        soc_note(soc, "CLKDIV: DOZEN is set, a slowed core is not modelled");
    }
    follow_clock(soc);
}

bool soc_pins_locked(const soc_t *soc)
{
    return (soc_get(soc, SFR_OSCCON) & IOLOCK) != 0;
}

void soc_clock_hooks(soc_t *soc)
{
    iss_sfr_hook(soc->iss, SFR_OSCCON, NULL, write_osccon, soc);
    iss_sfr_hook(soc->iss, SFR_CLKDIV, NULL, write_divider, soc);
    iss_sfr_hook(soc->iss, SFR_PLLFBD, NULL, write_divider, soc);
}

/* Power-on takes the source of the configuration words; other resets keep the running one. */
void soc_clock_reset(soc_t *soc, iss_reset_cause_t cause)
{
    soc->clock = (soc_clock_t){0};
    if (cause == ISS_RESET_POR) {
        unsigned source = soc->config[IMAGE_FOSCSEL] & FNOSC;
        soc_put(soc, SFR_OSCCON, source << 12 | source << 8);
        soc->fcy_hz = 0.5 * source_hz(soc, source);
        soc->base_s = 0.0;
        soc->base_cycle = soc_now(soc);
        if (has_pll(source)) {
            soc_schedule(soc, SOC_CLOCK, soc_cycle_at(soc, soc->times.pll_lock_s));
        }
        return;
    }
    unsigned source = source_now(soc);
    soc_put(soc, SFR_OSCCON, source << 12 | source << 8 | (soc_get(soc, SFR_OSCCON) & LOCK));
    follow_clock(soc);
}
