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

static inline unsigned logic(iss_t *m, unsigned result, unsigned bits)
{
    flags_nz(m, result, bits);
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

/* One operand. */
#define ALU1(name, expression) \
    static inline unsigned alu_##name(iss_t *m, unsigned a, unsigned bits) { return (expression); }
ALU1(inc, sum(m, a, 1, 0, bits, false))
ALU1(inc2, sum(m, a, 2, 0, bits, false))
ALU1(dec, sum(m, a, 1 ^ ones(bits), 1, bits, false))
ALU1(dec2, sum(m, a, 2 ^ ones(bits), 1, bits, false))
ALU1(neg, sum(m, 0, a ^ ones(bits), 1, bits, false))
ALU1(com, logic(m, a ^ ones(bits), bits))

/* ---- where operands come from and results go ---- */

#define FORM_F(name, suffix, bits) \
    static void name##_f_##suffix(iss_t *m, const insn_t *i) \
    { \
        to_file_or_wreg(m, i, alu_##name(m, load(m, i->k, bits), m->data[0] & ones(bits), bits), bits); \
    }
#define FORM_LITERAL(name, suffix, bits) \
    static void name##_k_##suffix(iss_t *m, const insn_t *i) \
    { \
        to_register(m, i->d, alu_##name(m, m->data[i->d] & ones(bits), i->k & ones(bits), bits), bits); \
    }
#define FORM_SHORT(name, suffix, bits) \
    static void name##_short_##suffix(iss_t *m, const insn_t *i) \
    { \
        destination(m, i, alu_##name(m, m->data[i->w] & ones(bits), i->k, bits), bits); \
    }
#define FORM_W(name, suffix, bits) \
    static void name##_w_##suffix(iss_t *m, const insn_t *i) \
    { \
        unsigned a = m->data[i->w] & ones(bits); \
        destination(m, i, alu_##name(m, a, source(m, i, bits), bits), bits); \
    }
#define BOTH(form, name) form(name, w, 16) form(name, b, 8)
#define FORMS2(name) BOTH(FORM_F, name) BOTH(FORM_SHORT, name) BOTH(FORM_W, name)
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

#define FORM_F1(name, suffix, bits) \
    static void name##_f_##suffix(iss_t *m, const insn_t *i) { to_file_or_wreg(m, i, alu_##name(m, load(m, i->k, bits), bits), bits); }
#define FORM_W1(name, suffix, bits) \
    static void name##_w_##suffix(iss_t *m, const insn_t *i) { destination(m, i, alu_##name(m, source(m, i, bits), bits), bits); }
#define FORMS1(name) BOTH(FORM_F1, name) BOTH(FORM_W1, name)

FORMS1(inc)
FORMS1(inc2)
FORMS1(dec)
FORMS1(dec2)
FORMS1(neg)
FORMS1(com)

/* Comparisons: flags only. */
#define COMPARE(name, operation, suffix, bits) \
    static void name##_f_##suffix(iss_t *m, const insn_t *i) { (void)alu_##operation(m, load(m, i->k, bits), m->data[0] & ones(bits), bits); } \
    static void name##_short_##suffix(iss_t *m, const insn_t *i) { (void)alu_##operation(m, m->data[i->w] & ones(bits), i->k, bits); } \
    static void name##_w_##suffix(iss_t *m, const insn_t *i) \
    { \
        unsigned a = m->data[i->w] & ones(bits); \
        (void)alu_##operation(m, a, source(m, i, bits), bits); \
    }
COMPARE(cp, sub, w, 16)
COMPARE(cp, sub, b, 8)
COMPARE(cpb, subb, w, 16)
COMPARE(cpb, subb, b, 8)

#define COMPARE0(suffix, bits) \
    static void cp0_f_##suffix(iss_t *m, const insn_t *i) { (void)alu_sub(m, load(m, i->k, bits), 0, bits); } \
    static void cp0_w_##suffix(iss_t *m, const insn_t *i) { (void)alu_sub(m, source(m, i, bits), 0, bits); }
COMPARE0(w, 16)
COMPARE0(b, 8)

/* CLR and SETM read nothing and change no flag. */
#define CONSTANT(name, value, suffix, bits) \
    static void name##_f_##suffix(iss_t *m, const insn_t *i) { store(m, i->k, value, bits); } \
    static void name##_wreg_##suffix(iss_t *m, const insn_t *i) { (void)i; to_register(m, 0, value, bits); } \
    static void name##_w_##suffix(iss_t *m, const insn_t *i) { destination(m, i, value, bits); }
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
    unsigned value = source(m, i, 8), result = (value ^ 0x80u) - 0x80u;
    set_w(m, i->d, result);
    flags_nz(m, result, 16);
    flag(m, SR_C, (value & 0x80u) == 0);
}

static void ze(iss_t *m, const insn_t *i)
{
    unsigned value = source(m, i, 8);
    set_w(m, i->d, value);
    flags_nz(m, value, 16);
    flag(m, SR_C, true);
}

#define W_B(name) name##_w, name##_b

const row_t iss_rows_alu[] = {
    {"add", {FILE_WREG}, 0xB40000, 0xFF8000, W_B(add_f), .cycles = 1},
    {"add", {K10, WN}, 0xB00000, 0xFF8000, W_B(add_k), .cycles = 1},
    {"add", {WB, K5, MD}, 0x400060, 0xF80060, W_B(add_short), .cycles = 1},
    {"add", {WB, MS, MD}, 0x400000, 0xF80000, W_B(add_w), .cycles = 1},
    {"addc", {FILE_WREG}, 0xB48000, 0xFF8000, W_B(addc_f), .cycles = 1},
    {"addc", {K10, WN}, 0xB08000, 0xFF8000, W_B(addc_k), .cycles = 1},
    {"addc", {WB, K5, MD}, 0x480060, 0xF80060, W_B(addc_short), .cycles = 1},
    {"addc", {WB, MS, MD}, 0x480000, 0xF80000, W_B(addc_w), .cycles = 1},
    {"sub", {FILE_WREG}, 0xB50000, 0xFF8000, W_B(sub_f), .cycles = 1},
    {"sub", {K10, WN}, 0xB10000, 0xFF8000, W_B(sub_k), .cycles = 1},
    {"sub", {WB, K5, MD}, 0x500060, 0xF80060, W_B(sub_short), .cycles = 1},
    {"sub", {WB, MS, MD}, 0x500000, 0xF80000, W_B(sub_w), .cycles = 1},
    {"subb", {FILE_WREG}, 0xB58000, 0xFF8000, W_B(subb_f), .cycles = 1},
    {"subb", {K10, WN}, 0xB18000, 0xFF8000, W_B(subb_k), .cycles = 1},
    {"subb", {WB, K5, MD}, 0x580060, 0xF80060, W_B(subb_short), .cycles = 1},
    {"subb", {WB, MS, MD}, 0x580000, 0xF80000, W_B(subb_w), .cycles = 1},
    {"subr", {FILE_WREG}, 0xBD0000, 0xFF8000, W_B(subr_f), .cycles = 1},
    {"subr", {WB, K5, MD}, 0x100060, 0xF80060, W_B(subr_short), .cycles = 1},
    {"subr", {WB, MS, MD}, 0x100000, 0xF80000, W_B(subr_w), .cycles = 1},
    {"subbr", {FILE_WREG}, 0xBD8000, 0xFF8000, W_B(subbr_f), .cycles = 1},
    {"subbr", {WB, K5, MD}, 0x180060, 0xF80060, W_B(subbr_short), .cycles = 1},
    {"subbr", {WB, MS, MD}, 0x180000, 0xF80000, W_B(subbr_w), .cycles = 1},
    {"and", {FILE_WREG}, 0xB60000, 0xFF8000, W_B(and_f), .cycles = 1},
    {"and", {K10, WN}, 0xB20000, 0xFF8000, W_B(and_k), .cycles = 1},
    {"and", {WB, K5, MD}, 0x600060, 0xF80060, W_B(and_short), .cycles = 1},
    {"and", {WB, MS, MD}, 0x600000, 0xF80000, W_B(and_w), .cycles = 1},
    {"ior", {FILE_WREG}, 0xB70000, 0xFF8000, W_B(ior_f), .cycles = 1},
    {"ior", {K10, WN}, 0xB30000, 0xFF8000, W_B(ior_k), .cycles = 1},
    {"ior", {WB, K5, MD}, 0x700060, 0xF80060, W_B(ior_short), .cycles = 1},
    {"ior", {WB, MS, MD}, 0x700000, 0xF80000, W_B(ior_w), .cycles = 1},
    {"xor", {FILE_WREG}, 0xB68000, 0xFF8000, W_B(xor_f), .cycles = 1},
    {"xor", {K10, WN}, 0xB28000, 0xFF8000, W_B(xor_k), .cycles = 1},
    {"xor", {WB, K5, MD}, 0x680060, 0xF80060, W_B(xor_short), .cycles = 1},
    {"xor", {WB, MS, MD}, 0x680000, 0xF80000, W_B(xor_w), .cycles = 1},
    {"cp", {FILE_ONLY}, 0xE30000, 0xFFA000, W_B(cp_f), .cycles = 1},
    {"cp", {WC, K5}, 0xE10060, 0xFF83E0, W_B(cp_short), .cycles = 1, .byte_bit = 0x400},
    {"cp", {WC, MS}, 0xE10000, 0xFF8380, W_B(cp_w), .cycles = 1, .byte_bit = 0x400},
    {"cpb", {FILE_ONLY}, 0xE38000, 0xFFA000, W_B(cpb_f), .cycles = 1},
    {"cpb", {WC, K5}, 0xE18060, 0xFF83E0, W_B(cpb_short), .cycles = 1, .byte_bit = 0x400},
    {"cpb", {WC, MS}, 0xE18000, 0xFF8380, W_B(cpb_w), .cycles = 1, .byte_bit = 0x400},
    {"cp0", {FILE_ONLY}, 0xE20000, 0xFFA000, W_B(cp0_f), .cycles = 1},
    {"cp0", {MS}, 0xE00000, 0xFFFB80, W_B(cp0_w), .cycles = 1, .byte_bit = 0x400},
    {"inc", {FILE_WREG}, 0xEC0000, 0xFF8000, W_B(inc_f), .cycles = 1},
    {"inc", {MS, MD}, 0xE80000, 0xFF8000, W_B(inc_w), .cycles = 1},
    {"inc2", {FILE_WREG}, 0xEC8000, 0xFF8000, W_B(inc2_f), .cycles = 1},
    {"inc2", {MS, MD}, 0xE88000, 0xFF8000, W_B(inc2_w), .cycles = 1},
    {"dec", {FILE_WREG}, 0xED0000, 0xFF8000, W_B(dec_f), .cycles = 1},
    {"dec", {MS, MD}, 0xE90000, 0xFF8000, W_B(dec_w), .cycles = 1},
    {"dec2", {FILE_WREG}, 0xED8000, 0xFF8000, W_B(dec2_f), .cycles = 1},
    {"dec2", {MS, MD}, 0xE98000, 0xFF8000, W_B(dec2_w), .cycles = 1},
    {"neg", {FILE_WREG}, 0xEE0000, 0xFF8000, W_B(neg_f), .cycles = 1},
    {"neg", {MS, MD}, 0xEA0000, 0xFF8000, W_B(neg_w), .cycles = 1},
    {"com", {FILE_WREG}, 0xEE8000, 0xFF8000, W_B(com_f), .cycles = 1},
    {"com", {MS, MD}, 0xEA8000, 0xFF8000, W_B(com_w), .cycles = 1},
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
