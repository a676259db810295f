/* Multiplication and division of integers. */
#include "iss_access.h"

/* ---- MUL: no flags ---- */

static inline void product_to_pair(iss_t *m, unsigned n, uint32_t product)
{
    set_w(m, n, product & 0xFFFFu);
    set_w(m, n | 1u, product >> 16);
}

static inline uint32_t signed_word(unsigned value)
{
    return (uint32_t)as_int16(value);
}

#define MULTIPLY(name, first, second) \
    static void name(iss_t *m, const insn_t *i) \
    { \
        unsigned a = m->data[i->w], b = source(m, i, 16); \
        product_to_pair(m, i->d, first(a) * second(b)); \
    }
MULTIPLY(mul_ss, signed_word, signed_word)
MULTIPLY(mul_su, signed_word, (uint32_t))
MULTIPLY(mul_us, (uint32_t), signed_word)
MULTIPLY(mul_uu, (uint32_t), (uint32_t))

OP(mul_su_short, product_to_pair(m, i->d, signed_word(m->data[i->w]) * i->k))
OP(mul_uu_short, product_to_pair(m, i->d, (uint32_t)m->data[i->w] * i->k))
OP(mul_f_w, product_to_pair(m, 2, (uint32_t)load16(m, i->k) * m->data[0]))
OP(mul_f_b, set_w(m, 2, load8(m, i->k) * (m->data[0] & 0xFFu)))

/* ---- DIV: 18 turns of REPEAT. The quotient appears with the last one (ASSUME_DIVIDE_LAST_TURN); a divisor of 0 traps in the first. ---- */

static bool in_last_turn(iss_t *m, unsigned divisor)
{
    bool repeated = (m->data[R_SR] & SR_RA) != 0;
    if (!repeated) {
        iss_report(m, ISS_ERROR_DIVIDE, "a division outside REPEAT #17 gives no quotient");
    }
    if (divisor == 0 && (!repeated || m->data[R_RCOUNT] == 17)) {
        iss_report(m, ISS_ERROR_TRAP, "division by zero: math error trap");
        iss_raise_trap(m, INTCON1_MATHERR | INTCON1_DIV0ERR);
    }
    return !repeated || m->data[R_RCOUNT] == 0;
}

/* Flags and results of dividend / divisor; quotients from low to high fit. C stays. */
static void divide(iss_t *m, int64_t dividend, int64_t divisor, int64_t low, int64_t high)
{
    if (divisor == 0) {
        return;
    }
    int64_t quotient = dividend / divisor, rest = dividend % divisor;
    set_w(m, 0, (unsigned)quotient & 0xFFFFu);
    set_w(m, 1, (unsigned)rest & 0xFFFFu);
    flag(m, SR_OV, quotient < low || quotient > high);
    flag(m, SR_Z, rest == 0);
    flag(m, SR_N, rest < 0);
}

static inline uint32_t dividend_pair(const iss_t *m, const insn_t *i)
{
    return (uint32_t)m->data[i->w] << 16 | m->data[i->d];
}

#define DIVIDE(name, dividend, divisor, low, high) \
    static void name(iss_t *m, const insn_t *i) \
    { \
        if (in_last_turn(m, m->data[i->s])) { \
            divide(m, dividend, divisor, low, high); \
        } \
    }
DIVIDE(div_s, as_int16(m->data[i->d]), as_int16(m->data[i->s]), -32768, 32767)
DIVIDE(div_sd, (int32_t)dividend_pair(m, i), as_int16(m->data[i->s]), -32768, 32767)
DIVIDE(div_u, m->data[i->d], m->data[i->s], 0, 65535)
DIVIDE(div_ud, dividend_pair(m, i), m->data[i->s], 0, 65535)
DIVIDE(divf, (int64_t)as_int16(m->data[i->w]) * 32768, as_int16(m->data[i->s]), -32768, 32767)

bool iss_is_divide(const insn_t *i)
{
    return i->run == div_s || i->run == div_sd || i->run == div_u || i->run == div_ud || i->run == divf;
}

const row_t iss_rows_multiply[] = {
    {"mul.ss", {WC, MS, WD_PAIR}, 0xB98000, 0xFF8000, mul_ss, NULL, .cycles = 1},
    {"mul.su", {WC, K5, WD_PAIR}, 0xB90060, 0xFF8060, mul_su_short, NULL, .cycles = 1},
    {"mul.su", {WC, MS, WD_PAIR}, 0xB90000, 0xFF8000, mul_su, NULL, .cycles = 1},
    {"mul.us", {WC, MS, WD_PAIR}, 0xB88000, 0xFF8000, mul_us, NULL, .cycles = 1},
    {"mul.uu", {WC, K5, WD_PAIR}, 0xB80060, 0xFF8060, mul_uu_short, NULL, .cycles = 1},
    {"mul.uu", {WC, MS, WD_PAIR}, 0xB80000, 0xFF8000, mul_uu, NULL, .cycles = 1},
    {"mul", {FILE_ONLY}, 0xBC0000, 0xFFA000, W_B(mul_f), .writes = 0x000C, .cycles = 1},
    {"div.s", {WM, WS}, 0xD80000, 0xFFF870, div_s, NULL, .writes = 3, .cycles = 1},
    {"div.sd", {WM_PAIR, WS}, 0xD80040, 0xFF8070, div_sd, NULL, .writes = 3, .cycles = 1},
    {"div.u", {WM, WS}, 0xD88000, 0xFFF870, div_u, NULL, .writes = 3, .cycles = 1},
    {"div.ud", {WM_PAIR, WS}, 0xD88040, 0xFF8070, div_ud, NULL, .writes = 3, .cycles = 1},
    {"divf", {WM_HIGH, WS}, 0xD90000, 0xFF87F0, divf, NULL, .writes = 3, .cycles = 1},
    {0},
};
