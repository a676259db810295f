/* Arithmetic and logic: ADD to XOR, comparisons, INC to SETM, in their file-register, literal and register forms. */
#include "iss_access.h"

/* ---- what the operations do: value and flags ---- */

/* a + b + carry with all flags. A subtraction is the sum with the complement; then C set means "no borrow". */
static inline unsigned sum(iss_t *m, unsigned a, unsigned b, unsigned carry, unsigned bits, bool sticky)
{
    unsigned total = a + b + carry, result = total & ones(bits), sr = m->data[R_SR];
    unsigned zero = (unsigned)(result == 0) << 1;
    unsigned flags = sr & ~(unsigned)SR_ALU;
    flags |= (total >> bits) & 1u;
    flags |= sticky ? zero & sr : zero;
    flags |= ((((a ^ result) & (b ^ result)) >> (bits - 1u)) & 1u) << 2;
    flags |= (result >> (bits - 1u)) << 3;
    flags |= (((a ^ b ^ total) >> (bits / 2u)) & 1u) << 8;
    m->data[R_SR] = (uint16_t)flags;
    return result;
}

/* Two operands: a is Wb, f or Wn, b is Ws, WREG or the literal. */
#define ALU2(name, expression) \
    static inline unsigned alu_##name(iss_t *m, unsigned a, unsigned b, unsigned bits) { return (expression); }
ALU2(add, sum(m, a, b, 0, bits, false))
ALU2(addc, sum(m, a, b, carry_of(m), bits, true))
ALU2(sub, sum(m, a, b ^ ones(bits), 1, bits, false))
ALU2(subb, sum(m, a, b ^ ones(bits), carry_of(m), bits, true))
ALU2(subr, sum(m, b, a ^ ones(bits), 1, bits, false))
ALU2(subbr, sum(m, b, a ^ ones(bits), carry_of(m), bits, true))
ALU2(and, logic(m, a & b, bits))
ALU2(ior, logic(m, a | b, bits))
ALU2(xor, logic(m, a ^ b, bits))

/* ---- where operands come from and results go ---- */

#define FORM_LITERAL(name, suffix, bits) \
    OP(name##_k_##suffix, to_register(m, i->d, alu_##name(m, m->data[i->d] & ones(bits), i->k & ones(bits), bits), bits))
#define FORM_SHORT_AND_FILE(name, suffix, bits) \
    OP(name##_f_##suffix, to_file_or_wreg(m, i, alu_##name(m, load(m, i->k, bits), m->data[0] & ones(bits), bits), bits)) \
    OP(name##_short_##suffix, destination(m, i, alu_##name(m, m->data[i->w] & ones(bits), i->k, bits), bits))
#define FORM_W(name, suffix, bits) \
    static void name##_w_##suffix(iss_t *m, const insn_t *i) \
    { \
        unsigned a = m->data[i->w] & ones(bits); \
        destination(m, i, alu_##name(m, a, source(m, i, bits), bits), bits); \
    }
#define FORMS2(name) BOTH(FORM_SHORT_AND_FILE, name) BOTH(FORM_W, name)
#define FORMS3(name) FORMS2(name) BOTH(FORM_LITERAL, name)

FORMS3(add)
FORMS3(addc)
FORMS3(sub)
FORMS3(subb)
FORMS2(subr)
FORMS2(subbr)
FORMS3(and)
FORMS3(ior)
FORMS3(xor)

/* One operand. */
ALU1(inc, sum(m, a, 1, 0, bits, false))
ALU1(inc2, sum(m, a, 2, 0, bits, false))
ALU1(dec, sum(m, a, 1 ^ ones(bits), 1, bits, false))
ALU1(dec2, sum(m, a, 2 ^ ones(bits), 1, bits, false))
ALU1(neg, sum(m, 0, a ^ ones(bits), 1, bits, false))
ALU1(com, logic(m, a ^ ones(bits), bits))

/* Comparisons: flags only. */
#define COMPARE(name, operation, suffix, bits) \
    OP(name##_f_##suffix, (void)alu_##operation(m, load(m, i->k, bits), m->data[0] & ones(bits), bits)) \
    OP(name##_short_##suffix, (void)alu_##operation(m, m->data[i->w] & ones(bits), i->k, bits)) \
    static void name##_w_##suffix(iss_t *m, const insn_t *i) \
    { \
        unsigned a = m->data[i->w] & ones(bits); \
        (void)alu_##operation(m, a, source(m, i, bits), bits); \
    }
#define COMPARE_PREVIOUS(name, suffix, bits) COMPARE(name, subb, suffix, bits)
#define COMPARE_BOTH(name, suffix, bits) COMPARE(name, sub, suffix, bits)
BOTH(COMPARE_BOTH, cp)
BOTH(COMPARE_PREVIOUS, cpb)

#define COMPARE0(name, suffix, bits) \
    OP(name##_f_##suffix, (void)alu_sub(m, load(m, i->k, bits), 0, bits)) \
    OP(name##_w_##suffix, (void)alu_sub(m, source(m, i, bits), 0, bits))
BOTH(COMPARE0, cp0)

/* CLR and SETM read nothing and change no flag. */
#define CONSTANT(name, value, suffix, bits) \
    OP(name##_f_##suffix, store(m, i->k, value, bits)) \
    OP(name##_wreg_##suffix, to_register(m, 0, value, bits)) \
    OP(name##_w_##suffix, destination(m, i, value, bits))
CONSTANT(clr, 0, w, 16)
CONSTANT(clr, 0, b, 8)
CONSTANT(setm, 0xFFFFu, w, 16)
CONSTANT(setm, 0xFFu, b, 8)

/* ---- single ones ---- */

static void daw(iss_t *m, const insn_t *i)
{
    unsigned value = m->data[i->d] & 0xFFu, sr = m->data[R_SR];
    unsigned total = value + ((value & 0xFu) > 9 || (sr & SR_DC) != 0 ? 6u : 0u);
    if (total >> 4 > 9 || (sr & SR_C) != 0) {
        total += 0x60u;
    }
    set_w8(m, i->d, total);
    flag(m, SR_C, (sr & SR_C) != 0 || total > 0xFFu);
}

static void se(iss_t *m, const insn_t *i)
{
    unsigned value = source(m, i, 8);
    set_w(m, i->d, logic(m, (value ^ 0x80u) - 0x80u, 16));
    flag(m, SR_C, (value & 0x80u) == 0);
}

static void ze(iss_t *m, const insn_t *i)
{
    set_w(m, i->d, logic(m, source(m, i, 8), 16));
    flag(m, SR_C, true);
}

/* f and WREG, Wb and a literal, Wb and Ws; the same with a literal for Wn; comparisons. */
#define ALU2_ROWS(name, f, w) \
    {#name, {FILE_WREG}, f, 0xFF8000, W_B(name##_f), .cycles = 1}, \
    {#name, {WB, K5, MD}, w | 0x60, 0xF80060, W_B(name##_short), .cycles = 1}, \
    {#name, {WB, MS, MD}, w, 0xF80000, W_B(name##_w), .cycles = 1}
#define ALU3_ROWS(name, f, w, k) ALU2_ROWS(name, f, w), {#name, {K10, WN}, k, 0xFF8000, W_B(name##_k), .cycles = 1}
#define COMPARE_ROWS(name, f, w) \
    {#name, {FILE_ONLY}, f, 0xFFA000, W_B(name##_f), .cycles = 1}, \
    {#name, {WC, K5}, w | 0x60, 0xFF83E0, W_B(name##_short), .cycles = 1, .byte_bit = 0x400}, \
    {#name, {WC, MS}, w, 0xFF8380, W_B(name##_w), .cycles = 1, .byte_bit = 0x400}

const row_t iss_rows_alu[] = {
    ALU3_ROWS(add, 0xB40000, 0x400000, 0xB00000), ALU3_ROWS(addc, 0xB48000, 0x480000, 0xB08000),
    ALU3_ROWS(sub, 0xB50000, 0x500000, 0xB10000), ALU3_ROWS(subb, 0xB58000, 0x580000, 0xB18000),
    ALU2_ROWS(subr, 0xBD0000, 0x100000), ALU2_ROWS(subbr, 0xBD8000, 0x180000),
    ALU3_ROWS(and, 0xB60000, 0x600000, 0xB20000), ALU3_ROWS(ior, 0xB70000, 0x700000, 0xB30000),
    ALU3_ROWS(xor, 0xB68000, 0x680000, 0xB28000),
    COMPARE_ROWS(cp, 0xE30000, 0xE10000), COMPARE_ROWS(cpb, 0xE38000, 0xE18000),
    {"cp0", {FILE_ONLY}, 0xE20000, 0xFFA000, W_B(cp0_f), .cycles = 1},
    {"cp0", {MS}, 0xE00000, 0xFFFB80, W_B(cp0_w), .cycles = 1, .byte_bit = 0x400},
    ALU1_ROWS(inc, 0xEC0000, 0xE80000), ALU1_ROWS(inc2, 0xEC8000, 0xE88000),
    ALU1_ROWS(dec, 0xED0000, 0xE90000), ALU1_ROWS(dec2, 0xED8000, 0xE98000),
    ALU1_ROWS(neg, 0xEE0000, 0xEA0000), ALU1_ROWS(com, 0xEE8000, 0xEA8000),
    {"clr", {FILE_ONLY}, 0xEF2000, 0xFFA000, W_B(clr_f), .cycles = 1},
    {"clr", {WREG}, 0xEF0000, 0xFFBFFF, W_B(clr_wreg), .writes = 1, .cycles = 1},
    {"clr", {MD}, 0xEB0000, 0xFF807F, W_B(clr_w), .cycles = 1},
    {"setm", {FILE_ONLY}, 0xEFA000, 0xFFA000, W_B(setm_f), .cycles = 1},
    {"setm", {WREG}, 0xEF8000, 0xFFBFFF, W_B(setm_wreg), .writes = 1, .cycles = 1},
    {"setm", {MD}, 0xEB8000, 0xFF807F, W_B(setm_w), .cycles = 1},
    {"daw.b", {WN}, 0xFD4000, 0xFFFFF0, daw, NULL, .cycles = 1},
    {"se", {MS, WD}, 0xFB0000, 0xFFF800, se, NULL, .cycles = 1},
    {"ze", {MS, WD}, 0xFB8000, 0xFFF800, ze, NULL, .cycles = 1},
    {0},
};
