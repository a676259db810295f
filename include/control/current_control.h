/* The two current controllers and the voltage circle: the d axis takes what it needs first, the q axis gets the rest. */
#ifndef CONTROL_CURRENT_CONTROL_H
#define CONTROL_CURRENT_CONTROL_H

#include "control/pi.h"
#include "control/transforms.h"

/** The voltage circle at the measured bus. */
typedef struct {
    voltage_q14_t limit_q14;   /**< radius */
    voltage_q14_t vd_most_q14; /**< see vd_limit() */
    uint16_t reciprocal;       /**< 2^28 / radius, see voltage_circle_reciprocal() */
} voltage_circle_t;

#define VOLTAGE_CIRCLE_LEAST_Q14 4097 /* a quarter of the nominal bus */

/** 2^28 / radius for vq_limit(), rounded up.
 *  @param radius_q14 VOLTAGE_CIRCLE_LEAST_Q14 or more (the drive trips on under-voltage above it); less is taken as that */
QM_INLINE uint16_t voltage_circle_reciprocal(voltage_q14_t radius_q14)
{
    return (uint16_t)(qm_divud(1ul << 28, (uint16_t)((radius_q14 > VOLTAGE_CIRCLE_LEAST_Q14) ? radius_q14 : VOLTAGE_CIRCLE_LEAST_Q14)) + 1u);
}

/** Largest |Vd|: 31/32 of the circle, so that the q axis never loses all control. */
QM_INLINE voltage_q14_t vd_limit(voltage_q14_t radius_q14)
{
    return (int16_t)(radius_q14 - (radius_q14 >> 5));
}

/** The circle of this radius. */
QM_INLINE void voltage_circle_of(voltage_circle_t *circle, voltage_q14_t radius_q14)
{
    circle->limit_q14 = radius_q14;
    circle->vd_most_q14 = vd_limit(radius_q14);
    circle->reciprocal = voltage_circle_reciprocal(radius_q14);
}

/** Largest |Vq|: sqrt(limit^2 - Vd^2), by the circle table, never rounded up. @param vd_q14 within vd_limit() */
QM_INLINE voltage_q14_t vq_limit(const voltage_circle_t *circle, voltage_q14_t vd_q14)
{
    /* |Vd|/limit in Q12, rounded up; below 4096 because |Vd| <= 31/32 limit */
    uint16_t ratio_q12 = (uint16_t)(qm_mulhi_uu(qm_unsigned(vd_q14), circle->reciprocal) + 1u);
    return (int16_t)qm_mulhi_uu((uint16_t)(2u * (uint16_t)circle->limit_q14), (uint16_t)trig_circle((int16_t)(ratio_q12 << 3)));
}

/** One period of both controllers.
 *  @param ref_q13,meas_q13 d and q currents
 *  @param limit_q of the q axis, returned for display and for the field-weakening trim
 *  @return d and q voltage inside the circle */
QM_INLINE dq_t current_control(pi_t *pi_d, const pi_gains_t *gains_d, pi_t *pi_q, const pi_gains_t *gains_q,
                               dq_t ref_q13, dq_t meas_q13, const voltage_circle_t *circle, voltage_q14_t *limit_q)
{
    dq_t v;
    v.d = pi_tick(pi_d, gains_d, (int16_t)(ref_q13.d - meas_q13.d), circle->vd_most_q14);
    *limit_q = vq_limit(circle, v.d);
    v.q = pi_tick(pi_q, gains_q, (int16_t)(ref_q13.q - meas_q13.q), *limit_q);
    return v;
}

#endif
