/* Clarke and Park transformations and their inverses (amplitude invariant, alpha along phase A, d along the rotor flux). */
#ifndef CONTROL_TRANSFORMS_H
#define CONTROL_TRANSFORMS_H

#include "control/angle.h"

/** A vector in the stator frame; the unit is that of its user. */
typedef struct {
    int16_t alpha, beta;
} alphabeta_t;

/** A vector in a rotating frame. */
typedef struct {
    int16_t d, q;
} dq_t;

/** A current of each phase. */
typedef struct {
    current_q13_t a, b, c;
} phases_t;

/** Clarke: alpha = a, beta = (a + 2 b)/sqrt(3), for a + b + c = 0. @param a_q13,b_q13 phase currents, |a|, |b| and |a + b| <= 10240 (full
 *  scale and offset), so that all fits 16 bits @return the current vector in Q14 */
QM_INLINE alphabeta_t clarke(current_q13_t a_q13, current_q13_t b_q13)
{
    int16_t sum = (int16_t)(a_q13 + 2 * b_q13);
    alphabeta_t r;
    r.alpha = (int16_t)(2 * a_q13);
    r.beta = (int16_t)(sum + qm_mulhi(sum, 10138)); /* 2/sqrt(3) = 1 + 10138/65536 */
    return r;
}

/** Park: d = alpha cos + beta sin, q = -alpha sin + beta cos.
 *  @return half the input's counts (Q14 in, Q13 out; Q13 in, Q12 out): the guard bit for |x| up to 23170 per axis */
QM_INLINE dq_t park(alphabeta_t x, sincos_t sc)
{
    dq_t r;
    r.d = qm_hi(qm_mulss(x.alpha, sc.cos) + qm_mulss(x.beta, sc.sin));
    r.q = qm_hi(qm_mulss(x.beta, sc.cos) - qm_mulss(x.alpha, sc.sin));
    return r;
}

/** Inverse Park: alpha = d cos - q sin, beta = d sin + q cos. @return half the input's counts (Q14 in, Q13 out). */
QM_INLINE alphabeta_t inverse_park(dq_t x, sincos_t sc)
{
    alphabeta_t r;
    r.alpha = qm_hi(qm_mulss(x.d, sc.cos) - qm_mulss(x.q, sc.sin));
    r.beta = qm_hi(qm_mulss(x.d, sc.sin) + qm_mulss(x.q, sc.cos));
    return r;
}

/** The same of a vector along the q axis. */
QM_INLINE alphabeta_t inverse_park_q(int16_t q, sincos_t sc)
{
    alphabeta_t r;
    r.alpha = qm_hi(-qm_mulss(q, sc.sin));
    r.beta = qm_hi(qm_mulss(q, sc.cos));
    return r;
}

/** x turned by a small angle: error a^2/2. @param a_q16_rad angle in radians * 65536, +-0.5 rad */
QM_INLINE dq_t dq_turn(dq_t x, int16_t a_q16_rad)
{
    dq_t r;
    r.d = (int16_t)(x.d - qm_mulhi(x.q, a_q16_rad));
    r.q = (int16_t)(x.q + qm_mulhi(x.d, a_q16_rad));
    return r;
}

/** The phase currents of a current vector: inverse Park, then a = alpha, b = (sqrt(3) beta - alpha)/2, c = -a - b.
 *  Rounded to the nearest: an offset of one phase would be a direct voltage where dead time is compensated for these currents.
 *  @param x_q13 |x| at most 11585 @return Q13, to a count and 1/3000; their sum is 0 */
QM_INLINE phases_t phases_of(dq_t x_q13, sincos_t sc)
{
    dq_t x_q14 = { (int16_t)(2 * x_q13.d), (int16_t)(2 * x_q13.q) };
    int16_t alpha = qm_hi_rounded(qm_mulss(x_q14.d, sc.cos) - qm_mulss(x_q14.q, sc.sin));
    int16_t beta = qm_hi_rounded(qm_mulss(x_q14.d, sc.sin) + qm_mulss(x_q14.q, sc.cos));
    phases_t i;
    i.a = alpha;
    i.b = (int16_t)(qm_hi_rounded(qm_mulsu(beta, 56756u)) - (alpha >> 1)); /* sqrt(3)/2 */
    i.c = (int16_t)(-i.a - i.b);
    return i;
}

#endif
