/* Shifts, rotations, single bits, bit searches. */
#include "iss_access.h"

/* ---- shifts and rotations by one ---- */

static inline unsigned shifted(iss_t *m, unsigned result, unsigned out, unsigned bits)
{
    m->data[R_SR] = (uint16_t)((m->data[R_SR] & ~(unsigned)SR_C) | (out & 1u));
    return logic(m, result, bits);
}

ALU1(sl, shifted(m, a << 1, a >> (bits - 1u), bits))
ALU1(lsr, shifted(m, a >> 1, a, bits))
ALU1(asr, shifted(m, a >> 1 | (a & 1u << (bits - 1u)), a, bits))
ALU1(rlc, shifted(m, a << 1 | carry_of(m), a >> (bits - 1u), bits))
ALU1(rrc, shifted(m, a >> 1 | carry_of(m) << (bits - 1u), a, bits))
ALU1(rlnc, logic(m, a << 1 | a >> (bits - 1u), bits))
ALU1(rrnc, logic(m, a >> 1 | (a & 1u) << (bits - 1u), bits))

/* ---- shifts by many: Wb by a literal or by the low five bits of Ws ---- */

static inline unsigned sl_value(unsigned value, unsigned count)
{
    return value << count & 0xFFFFu;
}

static inline unsigned lsr_value(unsigned value, unsigned count)
{
    return value >> count;
}

/* count is at most 31: the word with its sign on 48 bits is enough. */
static inline unsigned asr_value(unsigned value, unsigned count)
{
    uint64_t wide = (value & 0x8000u) != 0 ? value | 0xFFFFFFFF0000u : value;
    return (unsigned)(wide >> count) & 0xFFFFu;
}

#define SHIFT_MANY(name) \
    static void name##_many(iss_t *m, const insn_t *i, unsigned count) \
    { \
        set_w(m, i->d, logic(m, name##_value(m->data[i->w], count), 16)); \
    } \
    static void name##_by_k(iss_t *m, const insn_t *i) { name##_many(m, i, i->k); } \
    static void name##_by_w(iss_t *m, const insn_t *i) { name##_many(m, i, m->data[i->s] & 31u); }
SHIFT_MANY(sl)
SHIFT_MANY(lsr)
SHIFT_MANY(asr)

/* ---- single bits: what becomes of a value, given the mask of the bit ---- */

#define BIT_CHANGE(name, expression) \
    static inline unsigned bit_##name(iss_t *m, unsigned old, unsigned bit) { (void)m; return (expression); }

/* Z is the complement of the bit. */
static inline void bit_to_z(iss_t *m, unsigned bit)
{
    flag(m, SR_Z, bit == 0);
}

static inline void bit_to_c(iss_t *m, unsigned bit)
{
    flag(m, SR_C, bit != 0);
}

static inline unsigned with_flag(unsigned old, unsigned bit, bool set)
{
    return set ? old | bit : old & ~bit;
}

BIT_CHANGE(bset, old | bit)
BIT_CHANGE(bclr, old & ~bit)
BIT_CHANGE(btg, old ^ bit)
BIT_CHANGE(bsw_c, with_flag(old, bit, (m->data[R_SR] & SR_C) != 0))
BIT_CHANGE(bsw_z, with_flag(old, bit, (m->data[R_SR] & SR_Z) == 0))
BIT_CHANGE(btsts_c, (bit_to_c(m, old & bit), old | bit))
BIT_CHANGE(btsts_z, (bit_to_z(m, old & bit), old | bit))

/* Ws or memory, read, changed and written back. */
#define CHANGE_W(name, suffix, bits, number) \
    static void name##_##suffix(iss_t *m, const insn_t *i) \
    { \
        unsigned bit = 1u << (number); \
        if (i->p == 0) { \
            to_register(m, i->s, bit_##name(m, m->data[i->s], bit), bits); \
        } else { \
            unsigned address = indirect(m, i->s, i->p, i->w, bits / 8u, false); \
            store(m, address, bit_##name(m, load(m, address, bits), bit), bits); \
        } \
    }
/* A file register is looked at bytewise; its address tells the byte. */
#define CHANGE_F(name) OP(name##_f, store8(m, i->k, bit_##name(m, load8(m, i->k), 1u << i->b)))

#define CHANGE_BIT(name, suffix, bits) CHANGE_W(name, suffix, bits, i->b)
BOTH(CHANGE_BIT, bset)
BOTH(CHANGE_BIT, bclr)
BOTH(CHANGE_BIT, btg)
CHANGE_BIT(btsts_c, w, 16)
CHANGE_BIT(btsts_z, w, 16)
CHANGE_W(bsw_c, w, 16, m->data[i->w] & 15u)
CHANGE_W(bsw_z, w, 16, m->data[i->w] & 15u)
CHANGE_F(bset)
CHANGE_F(bclr)
CHANGE_F(btg)
CHANGE_F(btsts_z)

OP(btst_f, bit_to_z(m, load8(m, i->k) >> i->b & 1u))
OP(btst_c, bit_to_c(m, source(m, i, 16) >> i->b & 1u))
OP(btst_z, bit_to_z(m, source(m, i, 16) >> i->b & 1u))

/* Wb is read before the pointer of Ws moves. */
static inline unsigned bit_by_w(iss_t *m, const insn_t *i)
{
    unsigned number = m->data[i->w] & 15u;
    return source(m, i, 16) >> number & 1u;
}

OP(btst_c_by_w, bit_to_c(m, bit_by_w(m, i)))
OP(btst_z_by_w, bit_to_z(m, bit_by_w(m, i)))

/* ---- searches; C tells that nothing was found ---- */

static inline unsigned length_of(unsigned value)
{
    unsigned length = 0;
    while (value != 0) {
        value >>= 1;
        length++;
    }
    return length;
}

static void found(iss_t *m, const insn_t *i, unsigned result, bool none)
{
    set_w(m, i->d, result);
    flag(m, SR_C, none);
}

static void ff1l(iss_t *m, const insn_t *i)
{
    unsigned value = source(m, i, 16);
    found(m, i, value == 0 ? 0u : 17u - length_of(value), value == 0);
}

static void ff1r(iss_t *m, const insn_t *i)
{
    unsigned value = source(m, i, 16);
    found(m, i, length_of(value & (0u - value)), value == 0);
}

/* The first bit that differs from the sign, as the shift that normalises: 0 to -15. */
static void fbcl(iss_t *m, const insn_t *i)
{
    unsigned value = source(m, i, 16);
    unsigned other = (value & 0x8000u) != 0 ? value ^ 0xFFFFu : value;
    found(m, i, length_of(other) - 15u, other == 0);
}

const row_t iss_rows_bit[] = {
    ALU1_ROWS(sl, 0xD40000, 0xD00000),
    {"sl", {WC, K4, WD}, 0xDD0040, 0xFF8070, sl_by_k, NULL, .cycles = 1},
    {"sl", {WC, WS, WD}, 0xDD0000, 0xFF8070, sl_by_w, NULL, .cycles = 1},
    ALU1_ROWS(lsr, 0xD50000, 0xD10000),
    {"lsr", {WC, K4, WD}, 0xDE0040, 0xFF8070, lsr_by_k, NULL, .cycles = 1},
    {"lsr", {WC, WS, WD}, 0xDE0000, 0xFF8070, lsr_by_w, NULL, .cycles = 1},
    ALU1_ROWS(asr, 0xD58000, 0xD18000),
    {"asr", {WC, K4, WD}, 0xDE8040, 0xFF8070, asr_by_k, NULL, .cycles = 1},
    {"asr", {WC, WS, WD}, 0xDE8000, 0xFF8070, asr_by_w, NULL, .cycles = 1},
    ALU1_ROWS(rlc, 0xD68000, 0xD28000),
    ALU1_ROWS(rlnc, 0xD60000, 0xD20000),
    ALU1_ROWS(rrc, 0xD78000, 0xD38000),
    ALU1_ROWS(rrnc, 0xD70000, 0xD30000),
    {"bset", {MC, BIT_NUMBER}, 0xA00000, 0xFF0B80, W_B(bset), .cycles = 1, .byte_bit = 0x400},
    {"bset.b", {FILE_BIT}, 0xA80000, 0xFF0000, bset_f, NULL, .cycles = 1},
    {"bclr", {MC, BIT_NUMBER}, 0xA10000, 0xFF0B80, W_B(bclr), .cycles = 1, .byte_bit = 0x400},
    {"bclr.b", {FILE_BIT}, 0xA90000, 0xFF0000, bclr_f, NULL, .cycles = 1},
    {"btg", {MC, BIT_NUMBER}, 0xA20000, 0xFF0B80, W_B(btg), .cycles = 1, .byte_bit = 0x400},
    {"btg.b", {FILE_BIT}, 0xAA0000, 0xFF0000, btg_f, NULL, .cycles = 1},
    {"bsw.c", {MC, WC}, 0xAD0000, 0xFF8780, bsw_c_w, NULL, .cycles = 1},
    {"bsw.z", {MC, WC}, 0xAD8000, 0xFF8780, bsw_z_w, NULL, .cycles = 1},
    {"btst.b", {FILE_BIT}, 0xAB0000, 0xFF0000, btst_f, NULL, .cycles = 1},
    {"btst.c", {MS, BIT_NUMBER}, 0xA30000, 0xFF0F80, btst_c, NULL, .cycles = 1},
    {"btst.z", {MS, BIT_NUMBER}, 0xA30800, 0xFF0F80, btst_z, NULL, .cycles = 1},
    {"btst.c", {MS, WC}, 0xA50000, 0xFF8780, btst_c_by_w, NULL, .cycles = 1},
    {"btst.z", {MS, WC}, 0xA58000, 0xFF8780, btst_z_by_w, NULL, .cycles = 1},
    {"btsts.b", {FILE_BIT}, 0xAC0000, 0xFF0000, btsts_z_f, NULL, .cycles = 1},
    {"btsts.c", {MC, BIT_NUMBER}, 0xA40000, 0xFF0F80, btsts_c_w, NULL, .cycles = 1},
    {"btsts.z", {MC, BIT_NUMBER}, 0xA40800, 0xFF0F80, btsts_z_w, NULL, .cycles = 1},
    {"ff1l", {MS, WD}, 0xCF8000, 0xFFF800, ff1l, NULL, .cycles = 1},
    {"ff1r", {MS, WD}, 0xCF0000, 0xFFF800, ff1r, NULL, .cycles = 1},
    {"fbcl", {MS, WD}, 0xDF0000, 0xFFF800, fbcl, NULL, .cycles = 1},
    {0},
};
