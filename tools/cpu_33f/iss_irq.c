/* Interrupts and traps: what is pending, entry, return, DISI, waking up. */
#include "iss_access.h"

enum { IVT = 0x04, AIVT = 0x104, FIRST_INTERRUPT = 8, LEVEL_STACK = 12, LEVEL_ADDRESS = 13, LEVEL_OSCILLATOR = 14 };

/* Traps from the highest level down; `vector` is the place in the table. Those up to LEVEL_STACK are soft: they come a little later. */
static const struct { uint16_t flag; uint8_t vector, level; } traps[] = {
    {INTCON1_OSCFAIL, 1, LEVEL_OSCILLATOR},
    {INTCON1_ADDRERR, 2, LEVEL_ADDRESS},
    {INTCON1_STKERR, 3, LEVEL_STACK},
    {INTCON1_MATHERR, 4, 11},
};
enum { TRAPS = (int)(sizeof traps / sizeof traps[0]) };

typedef struct {
    unsigned level, vector; /* level 0: none */
} exception_t;

void iss_irq_changed(iss_t *m)
{
    iss_attend(m);
}

/* ---- what is pending ---- */

static exception_t pending_trap(const iss_t *m)
{
    for (unsigned n = 0; n < TRAPS; n++) {
        if ((m->data[R_INTCON1] & traps[n].flag) != 0) {
            return (exception_t){traps[n].level, traps[n].vector};
        }
    }
    return (exception_t){0, 0};
}

static exception_t pending_interrupt(const iss_t *m)
{
    chip_irq_t irq = chip_irq_pending(&m->data[R_IFS0], &m->data[R_IEC0], &m->data[R_IPC0]);
    return (exception_t){irq.priority, FIRST_INTERRUPT + irq.number};
}

static bool held_by_disi(const iss_t *m, exception_t e)
{
    return e.level < 7 && m->disi_end > m->cycle;
}

/* An exception that would be taken at the next boundary of instructions. */
bool iss_exception_pending(const iss_t *m)
{
    exception_t trap = pending_trap(m), interrupt = pending_interrupt(m);
    return trap.level > iss_level(m) || (interrupt.level > iss_level(m) && !held_by_disi(m, interrupt));
}

/* ---- entry and return ---- */

static unsigned level_in_handler(const iss_t *m, exception_t e)
{
    return e.level < 8 && (m->data[R_INTCON1] & INTCON1_NSTDIS) != 0 ? 7u : e.level;
}

static void enter_exception(iss_t *m, exception_t e)
{
    uint16_t *r = m->data;
    uint32_t pc = iss_pc(m);
    unsigned ipl3 = (r[R_CORCON] & CORCON_IPL3) != 0 ? 0x80u : 0u, level = level_in_handler(m, e);
    uint32_t table = (r[R_INTCON2] & INTCON2_ALTIVT) != 0 ? AIVT : IVT;
    if (m->on_enter != NULL) {
        m->on_enter(m->interrupt_context, e.vector, m->cycle);
    }
    if (m->watch != NULL) {
        iss_watch_enter(m, e.vector);
    }
    m->current = NULL;
    r[R_CORCON] = (uint16_t)((r[R_CORCON] & ~(unsigned)CORCON_IPL3) | (level >= 8 ? CORCON_IPL3 : 0u));
    push16(m, pc & 0xFFFFu);
    push16(m, (r[R_SR] & 0xFFu) << 8 | ipl3 | pc >> 16);
    r[R_SR] = (uint16_t)((r[R_SR] & ~(unsigned)(SR_IPL | SR_RA)) | (level & 7u) << 5);
    r[R_INTTREG] = (uint16_t)(e.level << 8 | ((e.vector - ASSUME_VECNUM_OFFSET) & 0x7Fu));
    m->nest[m->nested % NESTING] = (uint8_t)e.vector;
    m->nested++;
    m->written = 0;
    m->cycle += ASSUME_INTERRUPT_ENTRY_CYCLES;
    uint32_t handler = m->program[(table + 2u * e.vector) / 2u];
    if (handler == ISS_ERASED) {
        iss_report(m, ISS_ERROR_FETCH, "vector %u of the table at 0x%04X is empty", e.vector, (unsigned)table);
    }
    jump(m, handler);
    iss_attend(m);
}

/* RETFIE has been executed. */
void iss_left_exception(iss_t *m)
{
    if (m->nested > 0) {
        m->nested--;
        if (m->watch != NULL) {
            iss_watch_leave(m, m->nest[m->nested % NESTING]);
        }
        if (m->on_leave != NULL) {
            m->on_leave(m->interrupt_context, m->nest[m->nested % NESTING], m->cycle);
        }
    }
}

/* ---- at a boundary between instructions ---- */

/* A hard trap in the handler of a higher one. */
static bool is_conflict(const iss_t *m)
{
    return (m->data[R_INTCON1] & INTCON1_ADDRERR) != 0 && iss_level(m) > LEVEL_ADDRESS;
}

/* True if the trap has been taken. */
static bool serve_trap(iss_t *m, exception_t trap)
{
    if (trap.level < iss_level(m) + (unsigned)(ASSUME_SAME_TRAP_NESTS == 0)) {
        return false;
    }
    if (trap.level <= LEVEL_STACK && m->trap_at > m->cycle) {
        m->wake_at = m->trap_at;
        return false;
    }
    m->power = ISS_POWER_RUN;
    if (trap.level == LEVEL_OSCILLATOR) {
        iss_report(m, ISS_ERROR_TRAP, "oscillator failure trap");
    }
    enter_exception(m, trap);
    return true;
}

static void serve_interrupt(iss_t *m, exception_t e)
{
    if (e.level <= iss_level(m)) {
        return;
    }
    if (held_by_disi(m, e)) {
        m->wake_at = m->disi_end < m->wake_at ? m->disi_end : m->wake_at;
        return;
    }
    enter_exception(m, e);
}

/* An enabled interrupt ends IDLE and SLEEP, whether the CPU's priority lets it in or not. */
static bool wakes(const iss_t *m)
{
    unsigned active = 0;
    for (unsigned word = 0; word < IFS_WORDS; word++) {
        active |= m->data[R_IFS0 + word] & m->data[R_IEC0 + word];
    }
    return active != 0;
}

void iss_serve(iss_t *m)
{
    m->attention = false;
    m->wake_at = ISS_NEVER;
    if (m->power != ISS_POWER_RUN && wakes(m)) {
        m->power = ISS_POWER_RUN;
    }
    if (is_conflict(m)) {
        iss_report(m, ISS_ERROR_TRAP_CONFLICT, "address error in the handler of an oscillator failure: trap conflict, the chip resets");
        iss_demand_reset(m, CHIP_RESET_TRAP);
        return;
    }
    exception_t trap = pending_trap(m);
    if (trap.level == 0 || !serve_trap(m, trap)) {
        serve_interrupt(m, pending_interrupt(m));
    }
}
