/* Fixed-point arithmetic of the control law: one interface, the target's built-ins or exact C behind it. */
#ifndef CONTROL_QMATH_H
#define CONTROL_QMATH_H

#include <stdint.h>

/** Blocks of the PWM interrupt are composed in one translation unit; a call would cost 18 cycles of saved registers. */
#define QM_INLINE static inline __attribute__((always_inline))

/** Blocks of the interrupt that run rarely or in turn: called, so that they take no registers from the main path. */
#define NOINLINE static __attribute__((noinline, unused))

/** 1 where the compiler knows x, of parameters that are constants of the image; 1 where it knows that c holds. It leaves out what then cannot
 *  happen. 0 tells nothing. */
#ifndef QM_CONSTANT /* a test knows them all */
#ifdef __XC16__
#define QM_CONSTANT(x) __builtin_constant_p(x)
#else
#define QM_CONSTANT(x) 0
#endif
#endif
#define QM_KNOWN(c) (QM_CONSTANT(c) && (c))

/** Number formats. A name such as i_q13 means 2^13 counts for full scale; full scale is NORM_CURRENT's I0*32768 for a
 *  current, and U0*32768 = Vbus_nominal/sqrt(3)*(1-dead time) for a voltage. Guard bits make saturation unnecessary. */
typedef int16_t current_q13_t; /**< phase, d and q currents: 8192 = full-scale current */
typedef int16_t current_q14_t; /**< alpha and beta currents: 16384 = full-scale current */
typedef int16_t voltage_q14_t; /**< d and q voltages: 16384 = full-scale voltage */
typedef int16_t voltage_q13_t; /**< alpha and beta voltages and back-EMF: 8192 = full-scale voltage */
typedef int16_t voltage_q12_t; /**< d and q back-EMF: 4096 = full-scale voltage (4 times the range of Q14) */
typedef int16_t speed_erpm_t;  /**< counts of electrical revolutions per minute, AN1292's speed unit: 1, or SPEED_UNIT (drive/param_scaling.h) of a quick motor */
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

/** Unsigned 32/16 division. The caller proves denominator > numerator >> 16, as the core's DIV needs.
 *  @return quotient, truncated. */
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

/** The same as one called copy. */
NOINLINE int16_t qm_clamp_called(int16_t x, int16_t low, int16_t high)
{
    return qm_clamp(x, low, high);
}

/** x limited to low..high, its upper word. */
NOINLINE int32_t qm_clamp_hi(int32_t x, int16_t low, int16_t high)
{
#ifdef __FRAMAC__ /* what it means */
    int32_t least = (int32_t)low * 65536, most = (int32_t)high * 65536;
    if (x > most) {
        return most;
    }
    return (x < least) ? least : x;
#else
    int16_t end = high;
    if (qm_hi(x) < high) { /* the upper word tells it all: just at the end it is the end */
        if (qm_hi(x) >= low) {
            return x;
        }
        end = low;
    }
    return (int32_t)end * 65536;
#endif
}

/* Ranges, each by one comparison without a sign, and a sign without a branch. The proofs read what they mean; test_qmath.c compares. */
#ifdef __FRAMAC__
#define qm_beyond(x, most) ((x) > (most) || (x) < -(most))
#define qm_outside(x, most) ((x) < 0 || (x) > (most))
#define qm_clear_of(x, most) ((x) <= (most) && (x) >= -(most))
#define qm_with_sign(most, x) ((int16_t)(((x) < 0) ? -(most) : (most)))
#define qm_magnitude(x) (((x) >= 0) ? (x) : ((x) == INT16_MIN) ? INT16_MAX \
                                                               : -(x))
#define qm_unsigned(x) ((uint16_t)(((x) >= 0) ? (x) : -(x)))
#else
/** 1 where |x| > most. @param most not negative */
QM_INLINE QM_WRAPS uint16_t qm_beyond(int16_t x, int16_t most)
{
    return (uint16_t)((uint16_t)((uint16_t)x + (uint16_t)most) > (uint16_t)(2u * (uint16_t)most));
}

/** 1 where x is not 0..most. @param most not negative */
QM_INLINE uint16_t qm_outside(int16_t x, int16_t most)
{
    return (uint16_t)((uint16_t)x > (uint16_t)most);
}

/** 1 where the upper words alone tell that |x| <= most; 0 tells nothing. @param most not negative */
QM_INLINE QM_WRAPS uint16_t qm_clear_of(int32_t x, int32_t most)
{
    uint16_t limit = (uint16_t)qm_hi(most);
    return (uint16_t)((uint16_t)((uint16_t)qm_hi(x) + limit) < (uint16_t)(2u * limit));
}

/** most with the sign of x. @param most not negative */
QM_INLINE int16_t qm_with_sign(int16_t most, int16_t x)
{
    int16_t sign = qm_hi(x); /* 0 or -1 */
    return (int16_t)((most ^ sign) - sign);
}

/** Magnitude of any x, without the end that a sign needs. */
QM_INLINE QM_WRAPS uint16_t qm_unsigned(int16_t x)
{
    return (uint16_t)((x < 0) ? 0u - (uint16_t)x : (uint16_t)x);
}

/** |x| for qm_abs(); -32768 gives 32767. */
QM_INLINE QM_WRAPS int16_t qm_magnitude(int16_t x)
{
    uint16_t m = qm_unsigned(x);
    return (int16_t)(m - (m >> 15));
}
#endif

/** Magnitude; -32768 gives 32767. */
QM_INLINE int16_t qm_abs(int16_t x)
{
    return (int16_t)qm_magnitude(x);
}

/** Magnitude of what the caller proves to be above -32768: two instructions, where qm_abs() takes four. */
QM_INLINE int16_t qm_size(int16_t x)
{
    return (int16_t)((x < 0) ? -x : x);
}

/** x limited to -most..most. @param most not negative */
QM_INLINE int16_t qm_limit(int16_t x, int16_t most)
{
    if (qm_beyond(x, most)) {
        return qm_with_sign(most, x);
    }
    return x;
}

/** The same as one called copy. */
NOINLINE int16_t qm_limit_called(int16_t x, int16_t most)
{
    return qm_limit(x, most);
}

/** (a + b) / 2, rounded toward minus infinity, in 16 bits. */
QM_INLINE int16_t qm_mean(int16_t a, int16_t b)
{
#ifdef __FRAMAC__ /* what it means */
    return (int16_t)(((int32_t)a + b) >> 1);
#else
    return (int16_t)((a & b) + ((int16_t)(a ^ b) >> 1));
#endif
}

/** a - b in 17 bits, limited to half the int16 range so that it can be summed again without overflow. */
NOINLINE int16_t qm_sub_limited(int16_t a, int16_t b)
{
#ifdef __FRAMAC__ /* what it means */
    int32_t difference = (int32_t)a - b;
    return (int16_t)((difference > 16383) ? 16383 : (difference < -16383) ? -16383
                                                                          : difference);
#else
    int16_t half = (int16_t)((a >> 1) - (b >> 1));
    if (qm_beyond(half, 8191)) { /* 16383 at least: half of an odd number is rounded */
        return qm_with_sign(16383, half);
    }
    return (int16_t)(a - b);
#endif
}

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
