/* AN1292's PI controller with anti-windup: U = Sum + Kp err; out = limit(U); Sum += Ki err - Kc (U - out). */
#ifndef CONTROL_PI_H
#define CONTROL_PI_H

#include "control/qmath.h"

/** Integrator of one controller, in units of U (output counts << shift). */
typedef struct {
    int32_t sum;
} pi_t;

/** Gains of one controller; U counts are output counts << shift. */
typedef struct {
    int16_t kp;     /**< U counts per error count */
    int16_t ki;     /**< U counts per error count and step */
    q15_t kc;       /**< share of the excess that is taken back from the integrator, Q15 */
    uint16_t shift; /**< 0..14 */
} pi_gains_t;

/** What the integrator does not keep of a step whose output is at its limit, and that output.
 *  @param u within the limit or not @param step of the integrator, less what it does not keep @return the output */
QM_INLINE int16_t pi_limit(int32_t u, int32_t limit_u, const pi_gains_t *gains, int16_t limit, int32_t *step)
{
    int32_t half;
    if (u > limit_u) {
        half = qm_mulss(qm_hi(u - limit_u), gains->kc);
        *step -= half;
        *step -= half;
        return limit;
    }
    if (u < -limit_u) {
        half = qm_mulss(qm_hi(-limit_u - u), gains->kc);
        *step += half;
        *step += half;
        return (int16_t)-limit;
    }
    return (int16_t)(u >> gains->shift);
}

/** One step with the output limited to +-limit.
 *  @param err error, |err| <= 32767
 *  @param limit 0..32767 in output counts
 *  @return the limited output. The excess is taken in steps of 65536 U counts, alike for both signs. */
QM_INLINE int16_t pi_tick(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit)
{
    const int32_t sum = pi->sum;
    int32_t u = sum + qm_mulss(err, gains->kp);
    int32_t limit_u = qm_mulss(limit, (int16_t)(1u << gains->shift)), step;
    int16_t out;

    if (qm_clear_of(u, limit_u)) { /* as mostly */
        out = (int16_t)(u >> gains->shift);
        step = qm_mulss(err, gains->ki);
    } else {
        step = qm_mulss(err, gains->ki);
        out = pi_limit(u, limit_u, gains, limit, &step);
    }
    pi->sum = sum + step;
    return out;
}

/** Presets the integrator so that the next step returns out for the error err: a bumpless take-over. */
QM_INLINE void pi_preset(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t out)
{
    pi->sum = qm_mulss(out, (int16_t)(1u << gains->shift)) - (int32_t)err * gains->kp; /* in C: no error costs nothing */
}

#endif
