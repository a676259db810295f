/* Input capture 1, 2, 7 and 8: edges at a remappable pin put a timer's count into a FIFO of four. Sleep (ICM 7) is not modelled. */
#include "chip.h"
#include "chip_assumptions.h"

#include <string.h>

enum {
    ICM = 0x0007, /* ICxCON */
    ICBNE = 0x0008,
    ICOV = 0x0010,
    ICTMR = 0x0080,
    WRITABLE = 0x20E7, /* ICSIDL, ICTMR, ICI, ICM */
    RP_VSS = 31        /* RPINR7, RPINR10 */
};
enum { EVERY_EDGE = 1, FALLING, RISING, FOURTH_RISING, SIXTEENTH_RISING };

static const struct {
    const char *name, *select_name;
    uint16_t buf, con, select;
    unsigned shift, irq;
} place[CHIP_CAPTURES] = {
    {"IC1", "RPINR7", SFR_IC1BUF, SFR_IC1CON, SFR_RPINR7, 0, CHIP_IRQ_IC1},
    {"IC2", "RPINR7", SFR_IC2BUF, SFR_IC2CON, SFR_RPINR7, 8, CHIP_IRQ_IC2},
    {"IC7", "RPINR10", SFR_IC7BUF, SFR_IC7CON, SFR_RPINR10, 0, CHIP_IRQ_IC7},
    {"IC8", "RPINR10", SFR_IC8BUF, SFR_IC8CON, SFR_RPINR10, 8, CHIP_IRQ_IC8},
};

static unsigned channel_of(uint16_t address)
{
    unsigned n = 0;
    while (n < CHIP_CAPTURES - 1u && address != place[n].buf && address != place[n].con) {
        n++;
    }
    return n;
}

bool chip_capture_is_control(uint16_t address)
{
    return address == place[channel_of(address)].con;
}

static unsigned mode_of(const chip_t *chip, unsigned n)
{
    return chip_get(chip, place[n].con) & ICM;
}

static unsigned rp_of(const chip_t *chip, unsigned n)
{
    return (unsigned)chip_get(chip, place[n].select) >> place[n].shift & 0x1Fu;
}

static void show_state(chip_t *chip, unsigned n)
{
    unsigned con = chip_get(chip, place[n].con);
    chip_put(chip, place[n].con, chip->capture[n].count > 0 ? con | ICBNE : con & ~(unsigned)ICBNE);
}

/* ---- edges ---- */

/* A count goes into the FIFO; the interrupt comes with every ICI + 1st, with every edge at ICM 1. */
static void capture(chip_t *chip, unsigned n, uint64_t cycle)
{
    chip_capture_t *c = &chip->capture[n];
    unsigned con = chip_get(chip, place[n].con), mode = con & ICM;
    unsigned timer = ((con & ICTMR) != 0) == (ASSUME_CAPTURE_TIMER_3 == 0) ? 1u : 2u;
    if (!chip->timer[timer].counts) {
        chip_warn(chip, "T%uCON: %s captures timer %u, which stands still", timer + 1u, place[n].name, timer + 1u);
    }
    if (c->count >= CHIP_FIFO) {
        chip_put(chip, place[n].con, mode == EVERY_EDGE ? con : con | ICOV);
        return;
    }
    c->fifo[c->count++] = chip_timer_count(chip, timer, cycle + ASSUME_CAPTURE_DELAY_CYCLES);
    show_state(chip, n);
    if (++c->captures > (mode == EVERY_EDGE ? 0u : con >> 5 & 3u)) {
        c->captures = 0;
        (void)chip_irq_raise(chip, place[n].irq);
    }
}

/* Whether an edge to this level is one that the mode captures. */
static bool counts(chip_capture_t *c, unsigned mode)
{
    unsigned every = mode == SIXTEENTH_RISING ? 16u : mode == FOURTH_RISING ? 4u : 1u;
    if (c->level ? mode == FALLING : mode >= RISING) {
        return false;
    }
    c->edges = (c->edges + 1u) % every;
    return c->edges == 0;
}

static void look(chip_t *chip, uint64_t cycle)
{
    for (unsigned n = 0; n < CHIP_CAPTURES; n++) {
        unsigned mode = mode_of(chip, n);
        if (mode < EVERY_EDGE || mode > SIXTEENTH_RISING) {
            continue;
        }
        bool level = chip_ports_rp(chip, rp_of(chip, n));
        if (level != chip->capture[n].level) {
            chip->capture[n].level = level;
            if (counts(&chip->capture[n], mode)) {
                capture(chip, n, cycle);
            }
        }
    }
}

/* The board's levels as they are at a cycle, and the event of their next change. */
static void follow(chip_t *chip, uint64_t cycle)
{
    double next_s = chip->board.signals != NULL ? chip->board.signals(chip->board.context, chip_time_at(chip, cycle)) : PLANT_NEVER;
    look(chip, cycle);
    chip->signals_cycle = next_s < PLANT_NEVER ? chip_cycle_at(chip, next_s) : CHIP_NEVER;
    chip_schedule(chip, CHIP_EVENT_SIGNALS, chip->signals_cycle);
}

/* The processor may be past the change. */
void chip_capture_signals(chip_t *chip)
{
    follow(chip, chip->signals_cycle);
}

void chip_capture_follow(chip_t *chip)
{
    follow(chip, chip_now(chip));
}

/* ---- registers ---- */

unsigned chip_capture_show(chip_t *chip)
{
    unsigned offered = 0;
    for (unsigned n = 0; n < CHIP_CAPTURES; n++) {
        if (chip->capture[n].count > 0) {
            chip_put(chip, place[n].buf, chip->capture[n].fifo[0]);
            offered |= 1u << n;
        }
    }
    return offered;
}

void chip_capture_drop(chip_t *chip, unsigned n)
{
    chip_capture_t *c = &chip->capture[n];
    if (c->count > 0) {
        memmove(c->fifo, c->fifo + 1, sizeof c->fifo - sizeof c->fifo[0]);
        c->count--;
    }
    if (c->count == 0 && ASSUME_CAPTURE_OVERFLOW_ENDS != 0) {
        chip_put(chip, place[n].con, chip_get(chip, place[n].con) & ~(unsigned)ICOV);
    }
    show_state(chip, n);
}

static uint16_t read_buffer(void *context, uint16_t address)
{
    chip_t *chip = context;
    (void)chip_capture_show(chip);
    chip_capture_drop(chip, channel_of(address));
    return chip_get(chip, address);
}

static void write_buffer(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    (void)context, (void)address, (void)value, (void)mask; /* can only be read */
}

static void check(chip_t *chip, unsigned n)
{
    unsigned rp = rp_of(chip, n), mode = mode_of(chip, n);
    if (mode > SIXTEENTH_RISING) {
        chip_warn(chip, "%sCON: mode %u captures nothing, or wakes from sleep, which is not modelled", place[n].name, mode);
    }
    if (rp == RP_VSS) {
        chip_warn(chip, "%s: %s has no pin, it captures nothing", place[n].select_name, place[n].name);
    } else if (n < 2 && rp != chip->board.capture_rp && chip->board.signals != NULL) {
        chip_warn(chip, "%s: %sR is %u, the board's pulses are on RP%u", place[n].select_name, place[n].name, rp, chip->board.capture_rp);
    } else { /* as the board is wired */
    }
}

/* Another mode begins anew; ICM 0 empties the FIFO. */
static void write_control(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    unsigned n = channel_of(address), before = chip_get(chip, address), after = chip_merged(chip, address, value, mask);
    chip_capture_t *c = &chip->capture[n];
    after = (after & WRITABLE) | (before & (ICBNE | ICOV));
    if ((after & ICM) == 0) {
        *c = (chip_capture_t){.count = 0};
        after &= WRITABLE;
    }
    chip_put(chip, address, after);
    if ((after & ICM) != 0 && ((before ^ after) & ICM) != 0) {
        c->edges = c->captures = 0;
        c->level = chip_ports_rp(chip, rp_of(chip, n));
        check(chip, n);
    }
}

void chip_capture_hooks(chip_t *chip)
{
    for (unsigned n = 0; n < CHIP_CAPTURES; n++) {
        chip_hook(chip, place[n].buf, read_buffer, write_buffer);
        chip_hook(chip, place[n].con, NULL, write_control);
    }
}

void chip_capture_reset(chip_t *chip)
{
    memset(chip->capture, 0, sizeof chip->capture);
}
