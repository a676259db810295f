/* Angles, and the Clarke and Park transformations with their inverses (amplitude invariant, alpha along phase A, d along the rotor flux). */
#ifndef CONTROL_TRANSFORMS_H
#define CONTROL_TRANSFORMS_H

#include "control/qmath.h"

/* ---- Sine and cosine from a table of 128 steps a turn, the circle sqrt(1 - x^2), and the angle that a start forces on the rotor ---- */

#define TRIG_SIN_STEPS 128 /* of a turn */
#define TRIG_SIN_ENTRIES (TRIG_SIN_STEPS / 2)
#define TRIG_CIRCLE_STEPS 64

/** sin(2 pi i / 128) * 32757, i = 0..63. The amplitude is 10 below 32767 because interpolation by the derivative overshoots by 10. */
extern const int16_t trig_sin_table[TRIG_SIN_ENTRIES];

/** sqrt(1 - (i/64)^2) in Q15, i = 0..64, rounded down so that the circle is never left. */
extern const int16_t trig_circle_table[TRIG_CIRCLE_STEPS + 1];

/** Sine and cosine of one angle. */
typedef struct {
    q15_t sin; /**< Q15, amplitude 32757..32767 */
    q15_t cos; /**< Q15 */
} sincos_t;

/** sin and cos of an angle: nearest table entry, corrected along the derivative: sin(a+x) = sin a + x cos a. Error at most 12 LSB (0.04 %). */
sincos_t trig_sincos(angle_t angle);

/** Direction of the vector (x, y), to a quarter of a degree; 0 of a vector that has none. @param x,y -32767 .. 32767 */
angle_t trig_direction(int16_t x, int16_t y);

/** sqrt(1 - x^2) for 0 <= x <= 1 in Q15, linear between table entries: a chord, so above the circle by a tenth of a count at most. */
q15_t trig_circle(q15_t x);

/* ---- the forced angle of the start: it turns slowly while the current grows, then a ramp takes it up to the hand-over speed ---- */

/** Constants of the ramp, in AN1292's 1/1024 angle counts per period. */
typedef struct {
    int32_t end_speed_q10;     /**< END_SPEED_RPM * P * Ts * 65536/60 * 1024 */
    int16_t increase_rate_q10; /**< OPENLOOP_RAMPSPEED_INCREASERATE: added every period of the ramp, as a rule */
} forced_angle_params_t;

/** State. */
typedef struct {
    int32_t speed_q10;    /**< along the direction, 1/1024 angle counts per period; negative while the rotor still turns against it */
    uint32_t angle_q32;   /**< the fraction below one count is kept, so the speed is exact */
    uint32_t step_q32;    /**< of the angle, every period: the speed with the direction's sign */
    int16_t increase_q10; /**< of the speed, every period: 0 or more */
} forced_angle_t;

/** Accelerates. @param direction +1 or -1 @param periods 1 or 2, since the last time @return nonzero at the end speed */
int16_t forced_angle_accelerate(forced_angle_t *f, const forced_angle_params_t *p, int16_t direction, uint16_t periods);

/** A period passes. */
void forced_angle_move(forced_angle_t *f);

/** The angle in counts. */
angle_t forced_angle(const forced_angle_t *f);

/* ---- Clarke, Park, their inverses ---- */

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
