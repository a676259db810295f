/* Branches, calls, returns, skips, REPEAT and DO, and what acts on the core as a whole. */
#include "iss_access.h"

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

/* ---- branches; one that is taken costs more ---- */

static inline void take(iss_t *m, const insn_t *i)
{
    m->pc = i->k;
    m->cycle += i->taken;
    if (i->k == CODE_OUTSIDE) {
        m->lost_pc = iss_here(m) + 2u + 2u * (uint32_t)as_int16(m->program[iss_here(m) / 2u] & 0xFFFFu);
    }
}

#define BRANCH(name, condition) \
    static void bra_##name(iss_t *m, const insn_t *i) \
    { \
        unsigned sr = m->data[R_SR]; \
        (void)sr; \
        if (condition) { \
            take(m, i); \
        } \
    }

static inline bool less(unsigned sr) /* N differs from OV */
{
    return ((sr >> 3 ^ sr >> 2) & 1u) != 0;
}

BRANCH(always, true)
BRANCH(ov, (sr & SR_OV) != 0)
BRANCH(c, (sr & SR_C) != 0)
BRANCH(z, (sr & SR_Z) != 0)
BRANCH(n, (sr & SR_N) != 0)
BRANCH(le, (sr & SR_Z) != 0 || less(sr))
BRANCH(lt, less(sr))
BRANCH(leu, (sr & SR_C) == 0 || (sr & SR_Z) != 0)
BRANCH(nov, (sr & SR_OV) == 0)
BRANCH(nc, (sr & SR_C) == 0)
BRANCH(nz, (sr & SR_Z) == 0)
BRANCH(nn, (sr & SR_N) == 0)
BRANCH(gt, (sr & SR_Z) == 0 && !less(sr))
BRANCH(ge, !less(sr))
BRANCH(gtu, (sr & SR_C) != 0 && (sr & SR_Z) == 0)
BRANCH(oa, (sr & SR_OA) != 0)
BRANCH(ob, (sr & SR_OB) != 0)
BRANCH(sa, (sr & SR_SA) != 0)
BRANCH(sb, (sr & SR_SB) != 0)

OP(bra_w, jump(m, 2u * m->pc + 2u * (uint32_t)as_int16(m->data[i->s])))

/* The target's 23 bits are in both words of the instruction. */
static uint32_t far_target(const iss_t *m)
{
    uint32_t here = iss_here(m) / 2u;
    uint32_t high = here + 1u < ISS_PROGRAM_WORDS ? m->program[here + 1u] : 0u;
    return (m->program[here] & 0xFFFEu) | (high & 0x7Fu) << 16;
}

static void goto_far(iss_t *m, const insn_t *i)
{
    m->pc = i->k;
    if (i->k == CODE_OUTSIDE) {
        m->lost_pc = far_target(m);
    }
}

OP(goto_w, jump(m, m->data[i->s]))

/* ---- calls ---- */

static inline void push_pc(iss_t *m)
{
    uint32_t pc = 2u * m->pc;
    push16(m, pc & 0xFFFFu);
    push16(m, pc >> 16);
}

static void call_far(iss_t *m, const insn_t *i)
{
    push_pc(m);
    goto_far(m, i);
}

static void call_w(iss_t *m, const insn_t *i)
{
    unsigned target = m->data[i->s];
    push_pc(m);
    jump(m, target);
}

static void rcall(iss_t *m, const insn_t *i)
{
    push_pc(m);
    take(m, i);
}

static void rcall_w(iss_t *m, const insn_t *i)
{
    uint32_t target = 2u * m->pc + 2u * (uint32_t)as_int16(m->data[i->s]);
    push_pc(m);
    jump(m, target);
}

static void return_plain(iss_t *m, const insn_t *i)
{
    (void)i;
    uint32_t high = pop16(m), low = pop16(m);
    jump(m, (high & 0x7Fu) << 16 | (low & 0xFFFEu));
}

static void retlw_w(iss_t *m, const insn_t *i)
{
    return_plain(m, i);
    set_w(m, i->d, i->k);
}

static void retlw_b(iss_t *m, const insn_t *i)
{
    return_plain(m, i);
    set_w8(m, i->d, i->k);
}

static void retfie(iss_t *m, const insn_t *i)
{
    (void)i;
    unsigned high = pop16(m), low = pop16(m);
    m->data[R_SR] = (uint16_t)((m->data[R_SR] & 0xFF00u) | high >> 8);
    m->data[R_CORCON] = (uint16_t)((m->data[R_CORCON] & ~(unsigned)CORCON_IPL3) | ((high & 0x80u) != 0 ? CORCON_IPL3 : 0u));
    jump(m, (uint32_t)(high & 0x7Fu) << 16 | (low & 0xFFFEu));
    m->repeat_edge = true;
    iss_attend(m);
    if (iss_exception_pending(m)) {
        m->cycle -= (uint64_t)(3 - ASSUME_RETFIE_PENDING_CYCLES);
    }
    iss_left_exception(m);
}

/* ---- skips: each word skipped costs more ---- */

static inline void skip(iss_t *m, const insn_t *i, bool condition)
{
    if (condition && m->pc < CODE_OUTSIDE) {
        unsigned words = m->code[m->pc].words;
        m->pc += words;
        m->cycle += (uint64_t)words * i->taken;
        if (m->pc >= CODE_OUTSIDE) {
            jump(m, 2u * m->pc);
        }
    }
}

OP(btsc, skip(m, i, (source(m, i, 16) >> i->b & 1u) == 0))
OP(btss, skip(m, i, (source(m, i, 16) >> i->b & 1u) != 0))
OP(btsc_f, skip(m, i, (load8(m, i->k) >> i->b & 1u) == 0))
OP(btss_f, skip(m, i, (load8(m, i->k) >> i->b & 1u) != 0))

/* Signed comparisons. */
#define COMPARE_SKIP(name, relation) \
    OP(name##_w, skip(m, i, as_int16(m->data[i->w]) relation as_int16(m->data[i->s]))) \
    OP(name##_b, skip(m, i, as_int8(m->data[i->w]) relation as_int8(m->data[i->s])))

static inline int as_int8(unsigned value)
{
    return (int)(int8_t)(uint8_t)value;
}

COMPARE_SKIP(cpseq, ==)
COMPARE_SKIP(cpsne, !=)
COMPARE_SKIP(cpsgt, >)
COMPARE_SKIP(cpslt, <)

/* ---- REPEAT ---- */

static void start_repeat(iss_t *m, unsigned count)
{
    m->data[R_RCOUNT] = (uint16_t)count;
    if (count != 0) {
        m->data[R_SR] |= SR_RA;
        m->repeat_edge = true;
        m->limit = 0; /* the turns are run by their own loop */
    }
    if (count != 17 && m->pc < CODE_OUTSIDE && iss_is_divide(&m->code[m->pc])) {
        iss_report(m, ISS_ERROR_DIVIDE, "a division is repeated %u times, not 18: its quotient is wrong", count + 1u);
    }
}

OP(repeat_k, start_repeat(m, i->k))
OP(repeat_w, start_repeat(m, m->data[i->s] & 0x3FFFu))

/* ---- DO ---- */

static void start_do(iss_t *m, unsigned count, unsigned words)
{
    uint16_t *r = m->data;
    uint32_t start = 2u * m->pc, end = (start + 2u * (uint32_t)as_int16(words)) & 0x7FFFFEu;
    m->do_shadow.dcount = r[R_DCOUNT];
    m->do_shadow.start = (uint32_t)r[R_DOSTARTH] << 16 | r[R_DOSTARTL];
    m->do_shadow.end = (uint32_t)r[R_DOENDH] << 16 | r[R_DOENDL];
    r[R_DCOUNT] = (uint16_t)count;
    r[R_DOSTARTL] = (uint16_t)start;
    r[R_DOSTARTH] = (uint16_t)(start >> 16);
    r[R_DOENDL] = (uint16_t)end;
    r[R_DOENDH] = (uint16_t)(end >> 16);
    r[R_CORCON] = (uint16_t)((r[R_CORCON] & ~(unsigned)CORCON_DL) | ((r[R_CORCON] + CORCON_DL1) & CORCON_DL));
    r[R_SR] |= SR_DA;
    iss_refresh_do(m);
}

OP(do_k, start_do(m, i->k, m->program[m->pc - 1u] & 0xFFFFu))
OP(do_w, start_do(m, m->data[i->s] & 0x3FFFu, m->program[m->pc - 1u] & 0xFFFFu))

/* ---- the core as a whole ---- */

OP(nop, (void)0)

static void clrwdt(iss_t *m, const insn_t *i)
{
    (void)i;
    if (m->on_clrwdt != NULL) {
        m->on_clrwdt(m->clrwdt_context);
    }
}

static void pwrsav(iss_t *m, const insn_t *i)
{
    clrwdt(m, i);
    m->power = i->k == 0 ? ISS_POWER_SLEEP : ISS_POWER_IDLE;
    iss_attend(m);
}

OP(reset, iss_demand_reset(m, CHIP_RESET_SOFTWARE))

static void disi(iss_t *m, const insn_t *i)
{
    m->disi_end = m->cycle + i->k;
    iss_attend(m);
}

#define SP (1u << 15)
#define BRA(name, code) {"bra " #name, {RELATIVE}, (uint32_t)(code) << 16, 0xFF0000, bra_##name, NULL, .cycles = 1, .taken = 1, .flow = ISS_FLOW_BRANCH}
#define COMPARE_SKIP_ROW(name, value) {#name, {WC, WS}, value, 0xFF83F0, W_B(name), .cycles = 1, .taken = 1, .flow = ISS_FLOW_SKIP, .byte_bit = 0x400}

const row_t iss_rows_flow[] = {
    {"bra", {RELATIVE}, 0x370000, 0xFF0000, bra_always, NULL, .cycles = 1, .taken = 1, .flow = ISS_FLOW_JUMP},
    BRA(ov, 0x30), BRA(c, 0x31), BRA(z, 0x32), BRA(n, 0x33), BRA(le, 0x34), BRA(lt, 0x35), BRA(leu, 0x36),
    BRA(nov, 0x38), BRA(nc, 0x39), BRA(nz, 0x3A), BRA(nn, 0x3B), BRA(gt, 0x3C), BRA(ge, 0x3D), BRA(gtu, 0x3E),
    BRA(oa, 0x0C), BRA(ob, 0x0D), BRA(sa, 0x0E), BRA(sb, 0x0F),
    {"bra", {WS}, 0x016000, 0xFFFFF0, bra_w, NULL, .cycles = 2, .flow = ISS_FLOW_COMPUTED},
    {"goto", {TARGET}, 0x040000, 0xFF0001, goto_far, NULL, .cycles = 2, .flow = ISS_FLOW_JUMP},
    {"goto", {WS}, 0x014000, 0xFFFFF0, goto_w, NULL, .cycles = 2, .flow = ISS_FLOW_COMPUTED},
    {"call", {TARGET}, 0x020000, 0xFF0001, call_far, NULL, .points = SP, .cycles = 2, .flow = ISS_FLOW_CALL},
    {"call", {WS}, 0x010000, 0xFFFFF0, call_w, NULL, .points = SP, .cycles = 2, .flow = ISS_FLOW_COMPUTED},
    {"rcall", {RELATIVE}, 0x070000, 0xFF0000, rcall, NULL, .points = SP, .cycles = 1, .taken = 1, .flow = ISS_FLOW_CALL},
    {"rcall", {WS}, 0x012000, 0xFFFFF0, rcall_w, NULL, .points = SP, .cycles = 2, .flow = ISS_FLOW_COMPUTED},
    {"return", {NO_OPERAND}, 0x060000, 0xFFFFFF, return_plain, NULL, .reads = ASSUME_RAW_STALL_RETURN != 0 ? SP : 0, .cycles = 3, .flow = ISS_FLOW_RETURN},
    {"retlw", {K10, WN}, 0x050000, 0xFF8000, W_B(retlw), .reads = ASSUME_RAW_STALL_RETURN != 0 ? SP : 0, .cycles = 3, .flow = ISS_FLOW_RETURN},
    {"retfie", {NO_OPERAND}, 0x064000, 0xFFFFFF, retfie, NULL, .reads = ASSUME_RAW_STALL_RETURN != 0 ? SP : 0, .cycles = 3, .flow = ISS_FLOW_RETURN},
    {"btsc", {MS, BIT_NUMBER}, 0xA70000, 0xFF0F80, btsc, NULL, .cycles = 1, .taken = 1, .flow = ISS_FLOW_SKIP},
    {"btss", {MS, BIT_NUMBER}, 0xA60000, 0xFF0F80, btss, NULL, .cycles = 1, .taken = 1, .flow = ISS_FLOW_SKIP},
    {"btsc.b", {FILE_BIT}, 0xAF0000, 0xFF0000, btsc_f, NULL, .cycles = 1, .taken = 1, .flow = ISS_FLOW_SKIP},
    {"btss.b", {FILE_BIT}, 0xAE0000, 0xFF0000, btss_f, NULL, .cycles = 1, .taken = 1, .flow = ISS_FLOW_SKIP},
    COMPARE_SKIP_ROW(cpseq, 0xE78000), COMPARE_SKIP_ROW(cpsne, 0xE70000),
    COMPARE_SKIP_ROW(cpsgt, 0xE60000), COMPARE_SKIP_ROW(cpslt, 0xE68000),
    {"repeat", {K14}, 0x090000, 0xFFC000, repeat_k, NULL, .cycles = 1, .flow = ISS_FLOW_REPEAT},
    {"repeat", {WS}, 0x098000, 0xFFFFF0, repeat_w, NULL, .cycles = 1, .flow = ISS_FLOW_REPEAT},
    {"do", {K14, RELATIVE_2}, 0x080000, 0xFFC000, do_k, NULL, .cycles = 2, .flow = ISS_FLOW_DO},
    {"do", {WS, RELATIVE_2}, 0x088000, 0xFFFFF0, do_w, NULL, .cycles = 2, .flow = ISS_FLOW_DO},
    {"nop", {NO_OPERAND}, 0x000000, 0xFF0000, nop, NULL, .cycles = 1},
    {"nopr", {NO_OPERAND}, 0xFF0000, 0xFF0000, nop, NULL, .cycles = 1},
    {"clrwdt", {NO_OPERAND}, 0xFE6000, 0xFFFFFF, clrwdt, NULL, .cycles = 1},
    {"pwrsav", {K1}, 0xFE4000, 0xFFFFFE, pwrsav, NULL, .cycles = 1, .flow = ISS_FLOW_STOP},
    {"reset", {NO_OPERAND}, 0xFE0000, 0xFFFFFF, reset, NULL, .cycles = 1, .flow = ISS_FLOW_STOP},
    {"disi", {K14}, 0xFC0000, 0xFFC000, disi, NULL, .cycles = 1},
    {0},
};
