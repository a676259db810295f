/* The core's registers outside data memory, what follows from registers for the fast paths, and resets. */
#include "iss_state.h"

#include <string.h>

/* The loop's last instruction, where a DO loop is active. */
void iss_refresh_do(iss_t *m)
{
    uint32_t end = ((uint32_t)m->data[R_DOENDH] << 16 | m->data[R_DOENDL]) / 2u;
    bool active = (m->data[R_SR] & SR_DA) != 0 && end < ISS_PROGRAM_WORDS;
    m->do_end = active ? &m->code[end] : NULL;
}

void iss_refresh(iss_t *m)
{
    m->bent = (m->data[R_MODCON] & 0xC000u) != 0 || (m->data[R_XBREV] & 0x8000u) != 0;
    iss_refresh_do(m);
}

/* What instructions leave behind in the core besides registers. */
static void forget_pipeline(iss_t *m)
{
    m->current = NULL;
    m->written = 0;
    m->edt = false;
    m->repeat_edge = true;
    m->power = ISS_POWER_RUN;
    m->disi_end = 0;
    m->trap_at = 0;
    m->wake_at = ISS_NEVER;
    m->nested = 0;
    iss_watch_forget(m);
}

void iss_reset(iss_t *m, chip_reset_t cause)
{
    memset(m->data, 0, R_CORE_END * sizeof m->data[0]);
    memset(&m->data[R_INTCON1], 0, (R_INT_END - R_INTCON1) * sizeof m->data[0]);
    m->data[15] = ISS_RAM_START;
    m->data[R_CORCON] = ASSUME_CORCON_RESET;
    m->acc[0] = 0;
    m->acc[1] = 0;
    m->unknown_w = 0x7FFF;
    m->pc = 0;
    m->stack_base = ISS_RAM_START;
    m->stack_top = ISS_RAM_START;
    if (cause == CHIP_RESET_POR || cause == CHIP_RESET_BOR) {
        memset(m->known, 0, sizeof m->known);
    }
    forget_pipeline(m);
    iss_refresh(m);
    iss_attend(m);
}

void iss_restart(iss_t *m, uint32_t pc)
{
    forget_pipeline(m);
    m->cycle = 0;
    m->profile_mark = 0;
    jump(m, pc);
}

/* The core demands a reset: the hook does it later; without one it happens here. */
void iss_demand_reset(iss_t *m, chip_reset_t cause)
{
    if (m->on_reset != NULL) {
        m->on_reset(m->reset_context, cause);
        return;
    }
    iss_reset(m, cause);
    m->data[R_RCON] = (uint16_t)(m->data[R_RCON] | chip_reset_rcon(cause));
}

uint32_t iss_pc(const iss_t *m)
{
    return m->pc == CODE_OUTSIDE ? m->lost_pc : 2u * m->pc;
}

int64_t iss_acc(const iss_t *m, unsigned which)
{
    return m->acc[which & 1u];
}

void iss_set_acc(iss_t *m, unsigned which, int64_t value)
{
    uint64_t sign = (uint64_t)1 << 39, low = (uint64_t)value & (2u * sign - 1u);
    m->acc[which & 1u] = (int64_t)(low ^ sign) - (int64_t)sign;
}

void iss_set_w_known(iss_t *m, uint16_t mask)
{
    m->unknown_w = (uint16_t)(~mask & 0x7FFFu);
}

void iss_raise_trap(iss_t *m, unsigned intcon1_bits)
{
    m->data[R_INTCON1] = (uint16_t)(m->data[R_INTCON1] | intcon1_bits);
    m->trap_at = m->cycle + ASSUME_SOFT_TRAP_DELAY_CYCLES;
    iss_attend(m);
}
