/* Fixed-point arithmetic of the control law: one interface, the target's built-ins or exact C behind it. */
#ifndef CONTROL_QMATH_H
#define CONTROL_QMATH_H

#include <stdint.h>

/** A part of the PWM period, composed in place: a call costs 18 cycles of saved registers. In the image every file is one unit. */
#define INLINE inline __attribute__((always_inline))
#define QM_INLINE static INLINE
/** Of a function that an application calls: the image's one unit keeps it for another. */
#ifdef __clang__
#define APP_CALLS
#else
#define APP_CALLS __attribute__((externally_visible))
#endif
/** Called, so that it takes no registers from the main path. */
#define NOINLINE __attribute__((noinline))
/** Of a parameter that some builds do not use. */
#define UNUSED __attribute__((unused))

/** Number formats. A name such as i_q13 means 2^13 counts for full scale; full scale is NORM_CURRENT's I0*32768 for a
 *  current, and U0*32768 = Vbus_nominal/sqrt(3)*(1-dead time) for a voltage. Guard bits make saturation unnecessary. */
typedef int16_t current_q13_t; /**< phase, d and q currents: 8192 = full-scale current */
typedef int16_t current_q14_t; /**< alpha and beta currents: 16384 = full-scale current */
typedef int16_t voltage_q14_t; /**< d and q voltages: 16384 = full-scale voltage */
typedef int16_t voltage_q13_t; /**< alpha and beta voltages and back-EMF: 8192 = full-scale voltage */
typedef int16_t voltage_q12_t; /**< d and q back-EMF: 4096 = full-scale voltage (4 times the range of Q14) */
typedef int16_t speed_erpm_t;  /**< counts of electrical revolutions per minute, AN1292's speed unit: 1, or SPEED_UNIT (drive/scaling/current_voltage.h) of a quick motor */
typedef uint16_t angle_t;      /**< 65536 = one electrical turn; wraps on purpose */
typedef int16_t q15_t;         /**< fraction, 32768 = 1 */
typedef uint16_t duty_t;       /**< PWM on-time of the high side, 2000 = 100 % at 20 kHz */

/** Exact products: one instruction each on the dsPIC (mul.ss, mul.su, mul.uu), independent of CORCON. */
QM_INLINE int32_t qm_mulss(int16_t a, int16_t b)
{
#ifdef __XC16__
    return __builtin_mulss(a, b);
#else
    return (int32_t)a * b;
#endif
}

QM_INLINE int32_t qm_mulsu(int16_t a, uint16_t b)
{
#ifdef __XC16__
    return __builtin_mulsu(a, b);
#else
    return (int32_t)a * (int32_t)b;
#endif
}

QM_INLINE uint32_t qm_muluu(uint16_t a, uint16_t b)
{
#ifdef __XC16__
    return __builtin_muluu(a, b);
#else
    return (uint32_t)a * b;
#endif
}

/** Upper word of a 32-bit number: free on the target, rounds toward minus infinity. */
QM_INLINE int16_t qm_hi(int32_t x)
{
    return (int16_t)(x >> 16);
}

/** The same, rounded to the nearest, half upwards. */
QM_INLINE int16_t qm_hi_rounded(int32_t x)
{
    return (int16_t)(qm_hi(x) + (int16_t)((uint16_t)x >> 15));
}

/** Upper word of the signed product: a*b/65536. */
QM_INLINE int16_t qm_mulhi(int16_t a, int16_t b)
{
    return qm_hi(qm_mulss(a, b));
}

/** Upper word of signed times unsigned: a*b/65536. */
QM_INLINE int16_t qm_mulhi_su(int16_t a, uint16_t b)
{
    return qm_hi(qm_mulsu(a, b));
}

/** Upper word of the unsigned product. */
QM_INLINE uint16_t qm_mulhi_uu(uint16_t a, uint16_t b)
{
    return (uint16_t)(qm_muluu(a, b) >> 16);
}

/** Unsigned 32/16 division. The caller proves denominator > numerator >> 16, as the core's DIV needs. @return quotient, truncated. */
QM_INLINE uint16_t qm_divud(uint32_t numerator, uint16_t denominator)
{
#ifdef __XC16__
    return __builtin_divud(numerator, denominator);
#else
    return (uint16_t)(numerator / denominator);
#endif
}

/** part / whole, for part < whole. @return Q15 */
QM_INLINE q15_t qm_share(uint16_t part, uint16_t whole)
{
    return (q15_t)(qm_divud((uint32_t)part << 16, whole) >> 1);
}

#ifdef __clang__
#define QM_WRAPS __attribute__((no_sanitize("unsigned-integer-overflow", "unsigned-shift-base")))
#else
#define QM_WRAPS
#endif

/** a + b and a - b of 32-bit angles (2^32 = one turn): they wrap on purpose. */
QM_INLINE QM_WRAPS uint32_t qm_turn_add(uint32_t a, uint32_t b)
{
    return a + b;
}

QM_INLINE QM_WRAPS uint32_t qm_turn_sub(uint32_t a, uint32_t b)
{
    return a - b;
}

/** x limited to low..high. */
QM_INLINE int16_t qm_clamp(int16_t x, int16_t low, int16_t high)
{
    if (x > high) {
        return high;
    }
    return (x < low) ? low : x;
}

/** A sum limited to low..high, and so to a word. */
QM_INLINE int16_t qm_within(int32_t x, int16_t low, int16_t high)
{
    return (int16_t)((x > high) ? high : (x < low) ? low
                                                   : x);
}

/** x limited to low..high, its upper word. */
QM_INLINE int32_t qm_clamp_hi(int32_t x, int16_t low, int16_t high)
{
    const int32_t least = (int32_t)low * 65536, most = (int32_t)high * 65536;
    if (x > most) {
        return most;
    }
    return (x < least) ? least : x;
}

/** Magnitude; -32768 gives 32767. */
QM_INLINE int16_t qm_abs(int16_t x)
{
    uint16_t size;
    if (x >= 0) {
        return x;
    }
    size = (uint16_t)((uint16_t) ~(uint16_t)x + 1u);
    return (int16_t)(size - ((size > (uint16_t)INT16_MAX) ? 1u : 0u)); /* no choice between two values: XC16 would branch on neg's flags, wrong at -32768 */
}

/** most with the sign of x. @param most not negative */
QM_INLINE int16_t qm_with_sign(int16_t most, int16_t x)
{
    return (int16_t)((x < 0) ? -most : most);
}

/** 1 where |x| > most. @param most not negative */
QM_INLINE uint16_t qm_beyond(int16_t x, int16_t most)
{
    /* one compare: x + most is a word, and negative ones are beyond all others */
    return (uint16_t)((uint16_t)((uint16_t)x + (uint16_t)most) > 2u * (uint16_t)most);
}

/** x limited to -most..most. @param most not negative */
QM_INLINE int16_t qm_limit(int16_t x, int16_t most)
{
    if (qm_beyond(x, most)) {
        return qm_with_sign(most, x);
    }
    return x;
}

/** (a + b) / 2, rounded toward minus infinity. */
QM_INLINE int16_t qm_mean(int16_t a, int16_t b)
{
    return (int16_t)(((int32_t)a + b) >> 1);
}

/** a - b, limited to half the int16 range so that it can be summed again without overflow. */
QM_INLINE int16_t qm_sub_limited(int16_t a, int16_t b)
{
    return qm_within((int32_t)a - b, -16383, 16383);
}

/** qm_sub_limited() in one place, for where bytes count more than cycles. */
int16_t qm_less(int16_t a, int16_t b);

/** x * 2^bits; the caller proves that it fits. @param bits 0..15 */
QM_INLINE QM_WRAPS int32_t qm_shift(int32_t x, uint16_t bits)
{
    return (int32_t)((uint32_t)x << bits);
}

/** First-order low-pass, Equation 7: y += K (x - y), K in Q16, y kept in 32 bits with 16 fraction bits.
 *  Written as two products because x - y does not fit 16 bits. @return y, the upper word. */
QM_INLINE int16_t qm_lowpass(int32_t *y_q16, int16_t x, int16_t k_q16)
{
    *y_q16 += qm_mulss(x, k_q16) - qm_mulss(qm_hi(*y_q16), k_q16);
    return qm_hi(*y_q16);
}

#endif
