/* The core as a whole: creation, reset, program memory, and the loop that runs instructions. */
#include "iss_state.h"

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

static void erase(iss_t *m)
{
    for (uint32_t n = 0; n < ISS_PROGRAM_WORDS; n++) {
        m->program[n] = ISS_ERASED;
    }
    for (uint32_t n = 0; n < ISS_CONFIG_WORDS; n++) {
        m->config[n] = ISS_ERASED;
    }
    for (unsigned n = 0; n < ISS_LATCHES; n++) {
        m->latch[n] = ISS_ERASED;
    }
    iss_program_changed(m);
}

iss_t *iss_create(void)
{
    iss_t *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return NULL;
    }
    mark_core_registers(m);
    m->stop_mask = ISS_STOP_DEFAULT;
    erase(m);
    iss_reset(m, CHIP_RESET_POR);
    return m;
}

void iss_destroy(iss_t *m)
{
    if (m != NULL) {
        free(m->profile_counts);
        free(m->profile_cycles);
        free(m->watch);
        free(m);
    }
}

/* ---- program memory ---- */

uint32_t *iss_program(iss_t *m)
{
    return m->program;
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

/* ---- registers and memory from outside ---- */

uint16_t *iss_data(iss_t *m)
{
    return m->data;
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

/* @param handlers how many were entered before the instruction: RETFIE belongs to the one that it ends */
static void count_instruction(iss_t *m, uint32_t pc, unsigned handlers)
{
    if (m->profiling == ISS_PROFILE_OFF) {
        return;
    }
    if (m->profiling == ISS_PROFILE_ALL || handlers != 0) {
        m->profile_counts[pc]++;
        m->profile_cycles[pc] += m->cycle - m->profile_mark;
    }
    m->profile_mark = m->cycle;
    if (m->watch != NULL) {
        iss_watch_instruction(m, pc, handlers);
    }
}

/* The same with the profile. */
static void run_profiled(iss_t *m)
{
    while (m->cycle < m->limit) {
        uint32_t pc = m->pc;
        unsigned handlers = m->nested;
        const insn_t *i = &m->code[pc];
        step(m, i);
        if (i == m->do_end) {
            end_turn(m);
        }
        count_instruction(m, pc, handlers);
    }
}

static void hold_stuck(iss_t *m)
{
    if (m->stuck) {
        uint16_t *word = &m->data[m->stuck_address / 2u];
        *word = (uint16_t)((*word | m->stuck_at_1) & ~m->stuck_at_0);
    }
}

void iss_stick(iss_t *m, uint16_t address, uint16_t at_1, uint16_t at_0)
{
    m->stuck = (at_1 | at_0) != 0;
    m->stuck_address = address;
    m->stuck_at_1 = at_1;
    m->stuck_at_0 = at_0;
    hold_stuck(m);
}

/* The same with a word that is damaged. */
static void run_damaged(iss_t *m)
{
    while (m->cycle < m->limit) {
        const insn_t *i = &m->code[m->pc];
        step(m, i);
        hold_stuck(m);
        if (i == m->do_end) {
            end_turn(m);
        }
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
        hold_stuck(m);
        count_instruction(m, pc, m->nested);
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
    } else if (m->profiling != ISS_PROFILE_OFF) {
        run_profiled(m);
    } else if (m->stuck) {
        run_damaged(m);
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
