/* The core as a whole: creation, reset, program memory, and the loop that runs instructions. */
#include "iss_core.h"

#include <stdlib.h>
#include <string.h>

/* ---- life ---- */

static void mark_core_registers(iss_t *m)
{
    for (unsigned n = 0; n < SFR_WORDS; n++) {
        bool core = n < R_CORE_END || (n >= R_INTCON1 && n < R_INT_END);
        m->sfr_kind[n] = core ? SFR_CORE : SFR_PLAIN;
    }
}

iss_t *iss_create(void)
{
    iss_t *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return NULL;
    }
    mark_core_registers(m);
    m->stop_mask = ISS_STOP_DEFAULT;
    m->break_pc = UINT32_MAX;
    iss_erase(m);
    iss_reset(m, CHIP_RESET_POR);
    return m;
}

void iss_destroy(iss_t *m)
{
    if (m != NULL) {
        free(m->profile_counts);
        free(m->profile_cycles);
        free(m);
    }
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
    m->break_pc = UINT32_MAX;
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
    iss_set_pc(m, pc);
}

/* The core demands a reset: the hook does it later; without one it happens here. */
void iss_demand_reset(iss_t *m, chip_reset_t cause)
{
    static const uint16_t rcon_bits[] = {0x0003, 0x0002, 0x0080, 0x0040, 0x0010, 0x8000, 0x4000};
    if (m->on_reset != NULL) {
        m->on_reset(m->reset_context, cause);
        return;
    }
    iss_reset(m, cause);
    m->data[R_RCON] = (uint16_t)(m->data[R_RCON] | rcon_bits[cause]);
}

/* ---- program memory ---- */

uint32_t *iss_program(iss_t *m)
{
    return m->program;
}

void iss_program_changed(iss_t *m)
{
    for (uint32_t n = 0; n < ISS_PROGRAM_WORDS; n++) {
        m->program[n] &= 0xFFFFFFu;
        m->programmed[n] = m->program[n] != ISS_ERASED;
    }
    for (uint32_t n = 0; n <= ISS_PROGRAM_WORDS; n++) {
        iss_decode(m, n);
    }
    iss_refresh_do(m);
}

void iss_erase(iss_t *m)
{
    for (uint32_t n = 0; n < ISS_PROGRAM_WORDS; n++) {
        m->program[n] = ISS_ERASED;
    }
    for (uint32_t n = 0; n < ISS_CONFIG_WORDS; n++) {
        m->config[n] = ISS_ERASED;
    }
    iss_program_changed(m);
}

bool iss_write_program(iss_t *m, uint32_t pc, uint32_t word)
{
    uint32_t index = pc / 2u;
    if (pc >= ISS_CONFIG_START && (pc - ISS_CONFIG_START) / 2u < ISS_CONFIG_WORDS) {
        m->config[(pc - ISS_CONFIG_START) / 2u] = word & 0xFFFFFFu;
        return true;
    }
    if (index >= ISS_PROGRAM_WORDS) {
        return false;
    }
    m->program[index] = word & 0xFFFFFFu;
    m->programmed[index] = m->program[index] != ISS_ERASED;
    iss_decode(m, index);
    if (index > 0) {
        iss_decode(m, index - 1u); /* it may have two words */
    }
    return true;
}

uint32_t iss_read_program(const iss_t *m, uint32_t pc)
{
    if (pc >= ISS_CONFIG_START && (pc - ISS_CONFIG_START) / 2u < ISS_CONFIG_WORDS) {
        return m->config[(pc - ISS_CONFIG_START) / 2u];
    }
    return pc / 2u < ISS_PROGRAM_WORDS ? m->program[pc / 2u] : ISS_ERASED;
}

bool iss_is_programmed(const iss_t *m, uint32_t pc)
{
    return pc / 2u < ISS_PROGRAM_WORDS && m->programmed[pc / 2u] != 0;
}

/* ---- registers and memory from outside ---- */

uint16_t *iss_data(iss_t *m)
{
    return m->data;
}

uint32_t iss_pc(const iss_t *m)
{
    return m->pc == CODE_OUTSIDE ? m->lost_pc : 2u * m->pc;
}

void iss_set_pc(iss_t *m, uint32_t pc)
{
    jump(m, pc);
    m->break_pc = UINT32_MAX;
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

void iss_sync(iss_t *m)
{
    for (unsigned index = R_ACCAL; index <= R_PCH; index++) {
        m->data[index] = iss_core_read(m, index);
    }
    m->data[R_DISICNT] = iss_core_read(m, R_DISICNT);
    m->data[R_INTCON2] = iss_core_read(m, R_INTCON2);
}

void iss_sfr_hook(iss_t *m, uint16_t address, uint16_t (*read)(void *, uint16_t), void (*write)(void *, uint16_t, uint16_t, uint16_t), void *context)
{
    unsigned index = address / 2u;
    if (index < SFR_WORDS && m->sfr_kind[index] != SFR_CORE) {
        m->hook[index] = (sfr_hook_t){read, write, context};
        m->sfr_kind[index] = SFR_HOOKED;
    }
}

/* ---- what follows from registers, for the fast paths ---- */

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

/* ---- instructions that are none ---- */

void iss_op_illegal(iss_t *m, const insn_t *i)
{
    (void)i;
    iss_report(m, ISS_ERROR_OPCODE, "illegal opcode 0x%06X: the chip resets", (unsigned)m->program[iss_here(m) / 2u]);
    iss_demand_reset(m, CHIP_RESET_ILLEGAL);
}

void iss_op_erased(iss_t *m, const insn_t *i)
{
    (void)i;
    iss_report(m, ISS_ERROR_FETCH, "erased flash is executed");
}

void iss_op_outside(iss_t *m, const insn_t *i)
{
    (void)i;
    m->pc = CODE_OUTSIDE;
    iss_report(m, ISS_ERROR_FETCH, "an instruction is fetched where there is no flash: address error trap");
    iss_raise_trap(m, INTCON1_ADDRERR);
}

/* ---- the loop ---- */

/* A source address needs a register that is just being written, or an address register was never written. */
static void hazard(iss_t *m, const insn_t *i)
{
    unsigned unknown = m->unknown_w & i->points;
    if ((m->written & i->stall) != 0) {
        m->cycle += ASSUME_RAW_STALL_CYCLES;
    }
    if (unknown != 0) {
        unsigned reg = 0;
        while ((unknown >> reg & 1u) == 0) {
            reg++;
        }
        m->unknown_w &= (uint16_t)~unknown; /* told once */
        iss_report(m, ISS_ERROR_UNKNOWN_W, "W%u is used as an address but was never written: the chip resets", reg);
        iss_demand_reset(m, CHIP_RESET_ILLEGAL);
    }
}

/* The end of a DO loop's turn. */
static void end_turn(iss_t *m)
{
    uint16_t *r = m->data;
    if (r[R_DCOUNT] != 0 && !m->edt) {
        r[R_DCOUNT]--;
        jump(m, (uint32_t)r[R_DOSTARTH] << 16 | r[R_DOSTARTL]);
        return;
    }
    unsigned depth = ((r[R_CORCON] & CORCON_DL) - CORCON_DL1) & CORCON_DL;
    r[R_CORCON] = (uint16_t)((r[R_CORCON] & ~(unsigned)CORCON_DL) | depth);
    r[R_DCOUNT] = m->do_shadow.dcount;
    r[R_DOSTARTL] = (uint16_t)m->do_shadow.start;
    r[R_DOSTARTH] = (uint16_t)(m->do_shadow.start >> 16);
    r[R_DOENDL] = (uint16_t)m->do_shadow.end;
    r[R_DOENDH] = (uint16_t)(m->do_shadow.end >> 16);
    if (depth == 0) {
        r[R_SR] &= (uint16_t)~(unsigned)SR_DA;
    }
    m->edt = false;
    iss_refresh_do(m);
}

static inline void step(iss_t *m, const insn_t *i)
{
    m->current = i;
    if (((m->written & i->stall) | (m->unknown_w & i->points)) != 0) {
        hazard(m, i);
        if (m->current != i || m->stop == ISS_STOP_ERROR) {
            return; /* reset */
        }
    }
    m->written = i->writes;
    m->unknown_w &= (uint16_t)~i->writes;
    m->pc += i->words;
    m->cycle += i->cycles;
    m->count++;
    i->run(m, i);
}

static void run_fast(iss_t *m)
{
    while (m->cycle < m->limit) {
        const insn_t *i = &m->code[m->pc];
        step(m, i);
        if (i == m->do_end) {
            end_turn(m);
        }
    }
}

static void count_instruction(iss_t *m, uint32_t pc)
{
    if (m->profiling) {
        m->profile_counts[pc]++;
        m->profile_cycles[pc] += m->cycle - m->profile_mark;
        m->profile_mark = m->cycle;
    }
}

/* The same with profile and breakpoints. */
static void run_observed(iss_t *m)
{
    while (m->cycle < m->limit) {
        uint32_t pc = m->pc;
        const insn_t *i = &m->code[pc];
        if (m->breakpoint[pc] != 0 && m->break_pc != pc) {
            m->break_pc = pc;
            m->stop = ISS_STOP_BREAKPOINT;
            return;
        }
        m->break_pc = UINT32_MAX;
        step(m, i);
        if (i == m->do_end) {
            end_turn(m);
        }
        count_instruction(m, pc);
    }
}

/* The turns of the instruction behind REPEAT. */
static void run_repeated(iss_t *m)
{
    uint32_t pc = m->pc;
    const insn_t *i = &m->code[pc];
    while (m->cycle < m->limit) {
        m->pc = pc;
        step(m, i);
        count_instruction(m, pc);
        if (m->data[R_RCOUNT] == 0 || (m->data[R_SR] & SR_RA) == 0) {
            m->data[R_SR] &= (uint16_t)~(unsigned)SR_RA;
            if (i == m->do_end) {
                end_turn(m);
            }
            return;
        }
        m->data[R_RCOUNT]--;
        m->repeat_edge = false;
        m->pc = pc;
    }
}

/* Nothing happens until something outside does. */
static void run_asleep(iss_t *m)
{
    if (m->cycle < m->limit) {
        m->idle_cycles += m->limit - m->cycle;
        m->cycle = m->limit;
        m->profile_mark = m->cycle;
    }
}

static void run_on(iss_t *m)
{
    m->limit = m->until < m->wake_at ? m->until : m->wake_at;
    if (m->power != ISS_POWER_RUN) {
        run_asleep(m);
    } else if ((m->data[R_SR] & SR_RA) != 0) {
        run_repeated(m);
    } else if (m->profiling || m->breaks != 0) {
        run_observed(m);
    } else {
        run_fast(m);
    }
}

iss_stop_t iss_run(iss_t *m, uint64_t until_cycle)
{
    m->until = until_cycle;
    m->stop = ISS_STOP_NONE;
    iss_refresh(m);
    m->attention = true;
    while (m->cycle < until_cycle && m->stop == ISS_STOP_NONE) {
        if (m->attention || m->cycle >= m->wake_at) {
            iss_serve(m);
        }
        if (!m->attention && m->stop == ISS_STOP_NONE) {
            run_on(m);
        }
    }
    iss_sync(m);
    return m->stop;
}

void iss_request_stop(iss_t *m)
{
    if (m->stop == ISS_STOP_NONE) {
        m->stop = ISS_STOP_REQUEST;
    }
    m->limit = 0;
}

uint64_t iss_cycles(const iss_t *m)
{
    return m->cycle;
}

uint64_t iss_instructions(const iss_t *m)
{
    return m->count;
}

iss_power_t iss_power(const iss_t *m)
{
    return m->power;
}

void iss_wake(iss_t *m)
{
    m->power = ISS_POWER_RUN;
    m->limit = 0;
}

void iss_breakpoint(iss_t *m, uint32_t pc, bool on)
{
    uint32_t index = pc / 2u;
    if (index < ISS_PROGRAM_WORDS && (m->breakpoint[index] != 0) != on) {
        m->breakpoint[index] = on;
        m->breaks += on ? 1u : UINT32_MAX;
    }
}
