/* The two current controllers and the voltage circle: the d axis takes what it needs first, the q axis gets the rest. */
#include "control/current_control.h"

/** What the integrator gives back of an excess beyond the limit, 0 or more. */
static INLINE int32_t pi_excess(const pi_gains_t *gains, int32_t beyond)
{
    const int32_t half = qm_mulss(qm_hi(beyond), gains->kc);
    return half + half;
}

INLINE int16_t pi_tick(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit)
{
    const int32_t u = pi->sum + qm_mulss(err, gains->kp), most = qm_mulss(limit, (int16_t)(1u << gains->shift));
    int32_t step = qm_mulss(err, gains->ki);
    int16_t out;
    if (u > most) {
        step -= pi_excess(gains, u - most);
        out = limit;
    } else if (u < -most) {
        step += pi_excess(gains, -most - u);
        out = (int16_t)-limit;
    } else {
        out = (int16_t)(u >> gains->shift);
    }
    pi->sum += step;
    return out;
}

void pi_preset(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t out)
{
    pi->sum = qm_mulss(out, (int16_t)(1u << gains->shift)) - (int32_t)err * gains->kp; /* in C: no error costs nothing */
}

uint16_t voltage_circle_reciprocal(voltage_q14_t radius_q14)
{
    return (uint16_t)(qm_divud(1ul << 28, (uint16_t)((radius_q14 > VOLTAGE_CIRCLE_LEAST_Q14) ? radius_q14 : VOLTAGE_CIRCLE_LEAST_Q14)) + 1u);
}

voltage_q14_t vd_limit(voltage_q14_t radius_q14)
{
    return (int16_t)(radius_q14 - (radius_q14 >> 5));
}

void voltage_circle_of(voltage_circle_t *circle, voltage_q14_t radius_q14)
{
    circle->limit_q14 = radius_q14;
    circle->vd_most_q14 = vd_limit(radius_q14);
    circle->reciprocal = voltage_circle_reciprocal(radius_q14);
}

INLINE voltage_q14_t vq_limit(const voltage_circle_t *circle, voltage_q14_t vd_q14)
{
    /* |Vd|/limit in Q12, rounded up; below 4096 because |Vd| <= 31/32 limit */
    uint16_t vd = (uint16_t)((vd_q14 < 0) ? -vd_q14 : vd_q14), ratio_q12 = (uint16_t)(qm_mulhi_uu(vd, circle->reciprocal) + 1u);
    return (int16_t)qm_mulhi_uu((uint16_t)(2u * (uint16_t)circle->limit_q14), (uint16_t)trig_circle((int16_t)(ratio_q12 << 3)));
}

INLINE dq_t current_control(pi_t *pi_d, const pi_gains_t *gains_d, pi_t *pi_q, const pi_gains_t *gains_q,
                            dq_t ref_q13, dq_t meas_q13, const voltage_circle_t *circle, voltage_q14_t *limit_q)
{
    dq_t v;
    v.d = pi_tick(pi_d, gains_d, (int16_t)(ref_q13.d - meas_q13.d), circle->vd_most_q14);
    *limit_q = vq_limit(circle, v.d);
    v.q = pi_tick(pi_q, gains_q, (int16_t)(ref_q13.q - meas_q13.q), *limit_q);
    return v;
}
