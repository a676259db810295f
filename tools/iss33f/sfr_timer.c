/* Timers 1 to 3 on the instruction clock: the counts are worked out when somebody looks, the matches are events. */
#include "sfr_internal.h"

enum { TON = 0x8000, TGATE = 0x0040, T32 = 0x0008, TCS = 0x0002 };

static const struct {
    uint16_t tmr, pr, con;
    unsigned flag; /* bit in IFS0 */
} place[SOC_TIMERS] = {
    {SFR_TMR1, SFR_PR1, SFR_T1CON, 3},
    {SFR_TMR2, SFR_PR2, SFR_T2CON, 7},
    {SFR_TMR3, SFR_PR3, SFR_T3CON, 8},
};

static unsigned timer_of(uint16_t address)
{
    for (unsigned n = 0; n < SOC_TIMERS; n++) {
        if (address == place[n].tmr || address == place[n].pr || address == place[n].con) {
            return n;
        }
    }
    return 0;
}

static uint32_t prescale(const soc_t *soc, unsigned n)
{
    static const uint32_t cycles[4] = {1, 8, 64, 256};
    return cycles[(soc_get(soc, place[n].con) >> 4) & 3u];
}

/* Counts from the present one to the next match. Beyond the period register the timer goes round through 0xFFFF. */
static uint32_t counts_to_match(const soc_t *soc, unsigned n)
{
    uint32_t period = soc_get(soc, place[n].pr);
    uint32_t count = soc->timer[n].base_count;
    return count <= period ? period - count + 1u : 0x10000u - count + period + 1u;
}

static uint32_t count_now(const soc_t *soc, unsigned n)
{
    const soc_timer_t *t = &soc->timer[n];
    if (!t->counts) {
        return t->base_count;
    }
    uint64_t passed = (soc_now(soc) - t->base_cycle) / prescale(soc, n);
    uint32_t match = counts_to_match(soc, n);
    return passed < match ? (t->base_count + (uint32_t)passed) & 0xFFFFu : (uint32_t)((passed - match) % (soc_get(soc, place[n].pr) + 1u));
}

static void schedule(soc_t *soc, unsigned n)
{
    const soc_timer_t *t = &soc->timer[n];
    bool matches = t->counts && soc_get(soc, place[n].pr) != 0;
    uint64_t cycle = t->base_cycle + (uint64_t)counts_to_match(soc, n) * prescale(soc, n);
    soc_schedule(soc, (soc_event_t)(SOC_TIMER1 + (int)n), matches ? cycle : SOC_NEVER);
}

void soc_timer_event(soc_t *soc, unsigned n)
{
    soc_timer_t *t = &soc->timer[n];
    t->base_cycle += (uint64_t)counts_to_match(soc, n) * prescale(soc, n);
    t->base_count = 0;
    soc_flag(soc, SFR_IFS0, place[n].flag);
    schedule(soc, n);
}

static uint16_t read_timer(void *context, uint16_t address)
{
    soc_t *soc = context;
    soc_put(soc, address, count_now(soc, timer_of(address)));
    return soc_get(soc, address);
}

static void warn(soc_t *soc, unsigned con)
{
    if ((con & TON) != 0 && (con & (TCS | TGATE)) != 0) {
        soc_note(soc, "TxCON: an external clock or gate is not modelled, the timer stands still");
    }
}

/* Any write starts the bookkeeping anew with the present count. */
static void write_timer(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    unsigned n = timer_of(address);
    soc_timer_t *t = &soc->timer[n];
    t->base_count = count_now(soc, n);
    t->base_cycle = soc_now(soc);
    soc_put(soc, place[n].tmr, t->base_count);
    soc_put(soc, address, soc_merged(soc, address, value, mask));
    if (address == place[n].tmr) {
        t->base_count = soc_get(soc, address);
    }
    unsigned con = soc_get(soc, place[n].con);
    t->counts = (con & TON) != 0 && (con & (TCS | TGATE)) == 0;
    warn(soc, con);
    if (n == 1 && (con & T32) != 0) {
        soc_note(soc, "T2CON: the 32-bit pair of timers 2 and 3 is not modelled");
    }
    schedule(soc, n);
}

void soc_timer_hooks(soc_t *soc)
{
    for (unsigned n = 0; n < SOC_TIMERS; n++) {
        iss_sfr_hook(soc->iss, place[n].tmr, read_timer, write_timer, soc);
        iss_sfr_hook(soc->iss, place[n].pr, NULL, write_timer, soc);
        iss_sfr_hook(soc->iss, place[n].con, NULL, write_timer, soc);
    }
}

void soc_timer_reset(soc_t *soc)
{
    for (unsigned n = 0; n < SOC_TIMERS; n++) {
        soc->timer[n] = (soc_timer_t){soc_now(soc), 0, false};
    }
}
