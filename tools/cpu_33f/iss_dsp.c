/* DSP engine: 40-bit accumulators, products, saturation, rounding, prefetch and write-back. */
#include "iss_access.h"

#define BIT31 ((int64_t)1 << 31)
#define BIT39 ((int64_t)1 << 39)

/* ---- accumulators ---- */

static inline int64_t wrap40(int64_t value)
{
    uint64_t low = (uint64_t)value & 0xFFFFFFFFFFu;
    return (int64_t)(low ^ (uint64_t)BIT39) - BIT39;
}

/* value * 2^-shift for shifts from -16 to 16, without leaving the range of int64_t. */
static inline int64_t shifted(int64_t value, int shift)
{
    if (shift < 0) {
        return value * ((int64_t)1 << -shift);
    }
    return value >= 0 ? value >> shift : ~(~value >> shift);
}

/* Overflow of an accumulator may be an error that traps. */
static void check_overflow_traps(iss_t *m, unsigned which, bool guard, bool catastrophic)
{
    unsigned enabled = m->data[R_INTCON1];
    unsigned error = 0;
    if (guard && (enabled & (which == 0 ? INTCON1_OVATE : INTCON1_OVBTE)) != 0) {
        error |= which == 0 ? INTCON1_OVAERR : INTCON1_OVBERR;
    }
    if (catastrophic && (enabled & INTCON1_COVTE) != 0) {
        error |= which == 0 ? INTCON1_COVAERR : INTCON1_COVBERR;
    }
    if (error != 0) {
        iss_report(m, ISS_ERROR_TRAP, "accumulator %c overflows: math error trap", which == 0 ? 'A' : 'B');
        iss_raise_trap(m, INTCON1_MATHERR | error);
    }
}

/* An exact result goes into an accumulator: it saturates or wraps, SA (SB) tells that it did, OA (OB) that the guard bits are in use. */
static inline void result(iss_t *m, unsigned which, int64_t exact)
{
    unsigned corcon = m->data[R_CORCON], sr = m->data[R_SR];
    unsigned s_flag = which == 0 ? SR_SA : SR_SB, o_flag = which == 0 ? SR_OA : SR_OB;
    bool saturates = (corcon & (which == 0 ? CORCON_SATA : CORCON_SATB)) != 0;
    int64_t limit = saturates && (corcon & CORCON_ACCSAT) == 0 ? BIT31 : BIT39;
    bool overflow = exact < -limit || exact >= limit;
    int64_t value = exact;
    if (overflow) {
        value = !saturates ? wrap40(exact) : exact < 0 ? -limit : limit - 1;
        sr |= s_flag | SR_SAB;
    }
    bool guard = value < -BIT31 || value >= BIT31;
    sr = guard ? sr | o_flag : sr & ~o_flag;
    sr = (sr & (SR_OA | SR_OB)) != 0 ? sr | SR_OAB : sr & ~(unsigned)SR_OAB;
    m->acc[which] = value;
    m->data[R_SR] = (uint16_t)sr;
    if (guard || overflow) {
        check_overflow_traps(m, which, guard, overflow && limit == BIT39);
    }
}

/* What leaves an accumulator's value for memory: bits 31..16, rounded if asked for, saturated if SATDW is set. */
static unsigned out(const iss_t *m, int64_t value, bool rounds)
{
    unsigned corcon = m->data[R_CORCON];
    if (rounds) {
        unsigned low = (unsigned)value & 0xFFFFu, odd = (unsigned)(value >> 16) & 1u;
        bool up = (corcon & CORCON_RND) != 0 ? low >= 0x8000u : low > 0x8000u || (low == 0x8000u && odd != 0);
        value += up ? 0x10000 : 0;
    }
    int64_t high = shifted(value, 16);
    if ((corcon & CORCON_SATDW) != 0) {
        high = high > 32767 ? 32767 : high < -32768 ? -32768 : high;
    }
    return (unsigned)high & 0xFFFFu;
}

static inline int64_t product(const iss_t *m, unsigned a, unsigned b)
{
    unsigned corcon = m->data[R_CORCON];
    int64_t exact = (corcon & CORCON_US) != 0 ? (int64_t)a * (int64_t)b : (int64_t)as_int16(a) * as_int16(b);
    return (corcon & CORCON_IF) != 0 ? exact : exact * 2;
}

/* ---- prefetch and write-back ---- */

enum { CODE_NONE = 4, CODE_INDEXED = 12 };

__attribute__((noinline)) static unsigned wrong_space(iss_t *m, unsigned address, char space)
{
    iss_report(m, ISS_ERROR_SPACE, "%c prefetch from 0x%04X, which is not in %c space", space, address, space);
    return ASSUME_WRONG_SPACE_VALUE;
}

/* A word from one space. What lies in the other is not seen. */
static inline unsigned fetch(iss_t *m, unsigned address, bool y_space)
{
    bool in_y = address - ISS_Y_START < ISS_RAM_END - ISS_Y_START;
    return in_y == y_space ? load16(m, address) : wrong_space(m, address, y_space ? 'Y' : 'X');
}

/* Address of a prefetch, with its pointer's change. Codes: bit 3 chooses the second register, bits 2..0 the step. */
static inline unsigned prefetch_address(iss_t *m, unsigned code, unsigned first, bool y_space)
{
    static const int8_t steps[8] = {0, 2, 4, 6, 0, -6, -4, -2};
    unsigned reg = first + (code >> 3), address = m->data[reg];
    if (code == CODE_INDEXED) {
        return m->bent ? iss_step_modulo(m, reg, as_int16(m->data[12]), y_space) : (address + m->data[12]) & 0xFFFFu;
    }
    int step = steps[code & 7u];
    m->data[reg] = (uint16_t)(m->bent && step != 0 ? iss_step_modulo(m, reg, step, y_space) : (unsigned)((int)address + step));
    return address;
}

static inline void prefetch(iss_t *m, const insn_t *i)
{
    if (i->i != CODE_NONE) {
        unsigned value = fetch(m, prefetch_address(m, i->i, 8, false), false);
        m->data[i->x] = (uint16_t)value;
    }
    if (i->j != CODE_NONE) {
        unsigned value = fetch(m, prefetch_address(m, i->j, 10, true), true);
        m->data[i->y] = (uint16_t)value;
    }
}

/* The other accumulator, rounded, goes to W13 or through it. */
static inline void write_back(iss_t *m, const insn_t *i, unsigned value)
{
    if (i->a == 0) {
        set_w(m, 13, value);
    } else if (i->a == 1) {
        unsigned address = m->data[13];
        set_w(m, 13, address + 2u);
        store16(m, address, value);
    }
}

static void clear(iss_t *m, unsigned which)
{
    unsigned sr = m->data[R_SR] & ~(unsigned)(which == 0 ? SR_SA | SR_OA : SR_SB | SR_OB);
    sr = (sr & (SR_OA | SR_OB)) != 0 ? sr | SR_OAB : sr & ~(unsigned)SR_OAB;
    sr = (sr & (SR_SA | SR_SB)) != 0 ? sr | SR_SAB : sr & ~(unsigned)SR_SAB;
    m->data[R_SR] = (uint16_t)sr;
    m->acc[which] = 0;
}

/* The MAC class: `change` is done with the product of the registers as they were, then come prefetch and write-back. */
#define MAC_CLASS(name, change) \
    static void name(iss_t *m, const insn_t *i) \
    { \
        unsigned which = i->b, other = i->a < 2 ? out(m, m->acc[which ^ 1u], true) : 0; \
        change; \
        prefetch(m, i); \
        write_back(m, i, other); \
    }
#define PRODUCT_OF(m, i) product(m, (m)->data[(i)->s], (m)->data[(i)->d])

MAC_CLASS(mac, result(m, which, m->acc[which] + PRODUCT_OF(m, i)))
MAC_CLASS(msc, result(m, which, m->acc[which] - PRODUCT_OF(m, i)))
MAC_CLASS(mpy, result(m, which, PRODUCT_OF(m, i)))
MAC_CLASS(mpy_n, result(m, which, -PRODUCT_OF(m, i)))
MAC_CLASS(movsac, (void)which)
MAC_CLASS(clr_acc, clear(m, which))

static void distance(iss_t *m, const insn_t *i, int64_t before)
{
    result(m, i->b, before + PRODUCT_OF(m, i));
    unsigned a = fetch(m, prefetch_address(m, i->i, 8, false), false);
    unsigned b = fetch(m, prefetch_address(m, i->j, 10, true), true);
    m->data[i->x] = (uint16_t)(a - b);
}

OP(ed, distance(m, i, 0))
OP(edac, distance(m, i, m->acc[i->b]))

/* ---- accumulator and shifter; k is the shift, positive to the right ---- */

static inline int64_t shifted_source(iss_t *m, const insn_t *i)
{
    return shifted((int64_t)as_int16(source(m, i, 16)) * 65536, as_int16(i->k));
}

OP(lac, result(m, i->b, shifted_source(m, i)))

static void add_source(iss_t *m, const insn_t *i)
{
    int64_t value = shifted_source(m, i);
    result(m, i->b, m->acc[i->b] + value);
}

OP(add_acc, result(m, i->b, m->acc[0] + m->acc[1]))
OP(sub_acc, result(m, i->b, m->acc[i->b] - m->acc[i->b ^ 1u]))
OP(neg_acc, result(m, i->b, -m->acc[i->b]))

static void shift_acc(iss_t *m, unsigned which, int shift)
{
    if (shift < -16 || shift > 16) {
        iss_report(m, ISS_ERROR_TRAP, "an accumulator is shifted by %d: math error trap", shift);
        iss_raise_trap(m, INTCON1_MATHERR | INTCON1_SFTACERR);
        return;
    }
    result(m, which, shifted(m->acc[which], shift));
}

OP(sftac_k, shift_acc(m, i->b, as_int16(i->k)))
OP(sftac_w, shift_acc(m, i->b, as_int16(m->data[i->s])))

static inline int64_t shifted_acc(const iss_t *m, const insn_t *i)
{
    return wrap40(shifted(m->acc[i->b], as_int16(i->k)));
}

OP(sac, destination(m, i, out(m, shifted_acc(m, i), false), 16))
OP(sac_r, destination(m, i, out(m, shifted_acc(m, i), true), 16))

const row_t iss_rows_dsp[] = {
    {"clr", {ACC, PREFETCH_AWB}, 0xC30000, 0xFF4000, clr_acc, NULL, .cycles = 1},
    {"movsac", {ACC, PREFETCH_AWB}, 0xC70000, 0xFF4000, movsac, NULL, .cycles = 1},
    {"mpy", {PRODUCT, ACC, PREFETCH}, 0xC00003, 0xF84003, mpy, NULL, .cycles = 1},
    {"mpy.n", {PRODUCT, ACC, PREFETCH}, 0xC04003, 0xF84003, mpy_n, NULL, .cycles = 1},
    {"mac", {PRODUCT, ACC, PREFETCH_AWB}, 0xC00000, 0xF84000, mac, NULL, .cycles = 1},
    {"msc", {PRODUCT, ACC, PREFETCH_AWB}, 0xC04000, 0xF84000, msc, NULL, .cycles = 1},
    {"mac", {SQUARE, ACC, PREFETCH}, 0xF00000, 0xFC4003, mac, NULL, .cycles = 1},
    {"mpy", {SQUARE, ACC, PREFETCH}, 0xF00001, 0xFC4003, mpy, NULL, .cycles = 1},
    {"edac", {SQUARE, ACC, DISTANCE}, 0xF04002, 0xFC4C03, edac, NULL, .cycles = 1},
    {"ed", {SQUARE, ACC, DISTANCE}, 0xF04003, 0xFC4C03, ed, NULL, .cycles = 1},
    {"add", {ACC}, 0xCB0000, 0xFF7FFF, add_acc, NULL, .cycles = 1},
    {"neg", {ACC}, 0xCB1000, 0xFF7FFF, neg_acc, NULL, .cycles = 1},
    {"sub", {ACC}, 0xCB3000, 0xFF7FFF, sub_acc, NULL, .cycles = 1},
    {"add", {XS_ACC, SHIFT_ACC, ACC}, 0xC90000, 0xFF0000, add_source, NULL, .cycles = 1},
    {"lac", {XS_ACC, SHIFT_ACC, ACC}, 0xCA0000, 0xFF0000, lac, NULL, .cycles = 1},
    {"sac", {ACC, SHIFT_ACC, XD_ACC}, 0xCC0000, 0xFF0000, sac, NULL, .cycles = 1},
    {"sac.r", {ACC, SHIFT_ACC, XD_ACC}, 0xCD0000, 0xFF0000, sac_r, NULL, .cycles = 1},
    {"sftac", {ACC, K6_SIGNED}, 0xC80040, 0xFF7FC0, sftac_k, NULL, .cycles = 1},
    {"sftac", {ACC, WS}, 0xC80000, 0xFF7FF0, sftac_w, NULL, .cycles = 1},
    {0},
};
