/* Timers 1 to 3 on the instruction clock: the counts are worked out when somebody looks, the matches are events. */
#include "chip.h"

enum { TON = 0x8000, TGATE = 0x0040, T32 = 0x0008, TCS = 0x0002 };

static const struct {
    uint16_t tmr, pr, con;
    unsigned irq;
} place[CHIP_TIMERS] = {
    {SFR_TMR1, SFR_PR1, SFR_T1CON, CHIP_IRQ_T1},
    {SFR_TMR2, SFR_PR2, SFR_T2CON, CHIP_IRQ_T2},
    {SFR_TMR3, SFR_PR3, SFR_T3CON, CHIP_IRQ_T3},
};

static unsigned timer_of(uint16_t address)
{
    for (unsigned n = 0; n < CHIP_TIMERS; n++) {
        if (address == place[n].tmr || address == place[n].pr || address == place[n].con) {
            return n;
        }
    }
    return 0;
}

static uint32_t prescale(const chip_t *chip, unsigned n)
{
    static const uint32_t cycles[4] = {1, 8, 64, 256};
    return cycles[(chip_get(chip, place[n].con) >> 4) & 3u];
}

/* Counts from the present one to the next match. Beyond the period register the timer goes round through 0xFFFF. */
static uint32_t counts_to_match(const chip_t *chip, unsigned n)
{
    uint32_t period = chip_get(chip, place[n].pr);
    uint32_t count = chip->timer[n].base_count;
    return count <= period ? period - count + 1u : 0x10000u - count + period + 1u;
}

static uint32_t count_at(const chip_t *chip, unsigned n, uint64_t cycle)
{
    const chip_timer_t *t = &chip->timer[n];
    if (!t->counts || cycle <= t->base_cycle) {
        return t->base_count;
    }
    uint64_t passed = (cycle - t->base_cycle) / prescale(chip, n);
    uint32_t match = counts_to_match(chip, n);
    return passed < match ? (t->base_count + (uint32_t)passed) & 0xFFFFu : (uint32_t)((passed - match) % (chip_get(chip, place[n].pr) + 1u));
}

static uint32_t count_now(const chip_t *chip, unsigned n)
{
    return count_at(chip, n, chip_now(chip));
}

uint16_t chip_timer_count(const chip_t *chip, unsigned n, uint64_t cycle)
{
    return (uint16_t)count_at(chip, n, cycle);
}

static void schedule(chip_t *chip, unsigned n)
{
    const chip_timer_t *t = &chip->timer[n];
    bool matches = t->counts && chip_get(chip, place[n].pr) != 0;
    uint64_t cycle = t->base_cycle + (uint64_t)counts_to_match(chip, n) * prescale(chip, n);
    chip_schedule(chip, (chip_event_t)(CHIP_EVENT_TIMER1 + (int)n), matches ? cycle : CHIP_NEVER);
}

static void match(chip_t *chip, unsigned n)
{
    chip_timer_t *t = &chip->timer[n];
    t->base_cycle += (uint64_t)counts_to_match(chip, n) * prescale(chip, n);
    t->base_count = 0;
    schedule(chip, n);
    (void)chip_irq_raise(chip, place[n].irq);
}

#define MATCH(name, n) \
    void name(chip_t *chip) { match(chip, n); }
MATCH(chip_timer_1, 0)
MATCH(chip_timer_2, 1)
MATCH(chip_timer_3, 2)

static uint16_t read_timer(void *context, uint16_t address)
{
    chip_t *chip = context;
    chip_put(chip, address, count_now(chip, timer_of(address)));
    return chip_get(chip, address);
}

static void warn(chip_t *chip, unsigned con)
{
    if ((con & TON) != 0 && (con & (TCS | TGATE)) != 0) {
        chip_warn(chip, "TxCON: an external clock or gate is not modelled, the timer stands still");
    }
}

/* Any write starts the bookkeeping anew with the present count. */
static void write_timer(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    unsigned n = timer_of(address);
    chip_timer_t *t = &chip->timer[n];
    t->base_count = count_now(chip, n);
    t->base_cycle = chip_now(chip);
    chip_put(chip, place[n].tmr, t->base_count);
    chip_put(chip, address, chip_merged(chip, address, value, mask));
    if (address == place[n].tmr) {
        t->base_count = chip_get(chip, address);
    }
    unsigned con = chip_get(chip, place[n].con);
    t->counts = (con & TON) != 0 && (con & (TCS | TGATE)) == 0;
    warn(chip, con);
    if (n == 1 && (con & T32) != 0) {
        chip_warn(chip, "T2CON: the 32-bit pair of timers 2 and 3 is not modelled");
    }
    schedule(chip, n);
}

void chip_timer_hooks(chip_t *chip)
{
    for (unsigned n = 0; n < CHIP_TIMERS; n++) {
        chip_hook(chip, place[n].tmr, read_timer, write_timer);
        chip_hook(chip, place[n].pr, NULL, write_timer);
        chip_hook(chip, place[n].con, NULL, write_timer);
    }
}

void chip_timer_reset(chip_t *chip)
{
    for (unsigned n = 0; n < CHIP_TIMERS; n++) {
        chip->timer[n] = (chip_timer_t){chip_now(chip), 0, false};
    }
}
