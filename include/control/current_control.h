/* The two current controllers and the voltage circle: the d axis takes what it needs first, the q axis gets the rest. */
#ifndef CONTROL_CURRENT_CONTROL_H
#define CONTROL_CURRENT_CONTROL_H

#include "control/transforms.h"

/* ---- AN1292's PI controller with anti-windup: U = Sum + Kp err; out = limit(U); Sum += Ki err - Kc (U - out) ---- */

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

/** One step with the output limited to +-limit. @param err error, |err| <= 32767 @param limit 0..32767 in output counts @return the limited
 *  output. The excess is taken in steps of 65536 U counts, alike for both signs. */
int16_t pi_tick(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit);

/** Presets the integrator so that the next step returns out for the error err: a bumpless take-over. */
void pi_preset(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t out);

/* ---- The voltage circle and both controllers ---- */

/** The voltage circle at the measured bus. */
typedef struct {
    voltage_q14_t limit_q14;   /**< radius */
    voltage_q14_t vd_most_q14; /**< see vd_limit() */
    uint16_t reciprocal;       /**< 2^28 / radius, see voltage_circle_reciprocal() */
} voltage_circle_t;

#define VOLTAGE_CIRCLE_LEAST_Q14 4097 /* a quarter of the nominal bus */

/** 2^28 / radius for vq_limit(), rounded up.
 *  @param radius_q14 VOLTAGE_CIRCLE_LEAST_Q14 or more (the drive trips on under-voltage above it); less is taken as that */
uint16_t voltage_circle_reciprocal(voltage_q14_t radius_q14);

/** Largest |Vd|: 31/32 of the circle, so that the q axis never loses all control. */
voltage_q14_t vd_limit(voltage_q14_t radius_q14);

/** The circle of this radius. */
void voltage_circle_of(voltage_circle_t *circle, voltage_q14_t radius_q14);

/** Largest |Vq|: sqrt(limit^2 - Vd^2), by the circle table, never rounded up. @param vd_q14 within vd_limit() */
voltage_q14_t vq_limit(const voltage_circle_t *circle, voltage_q14_t vd_q14);

/** One period of both controllers. @param ref_q13,meas_q13 d and q currents @param limit_q of the q axis, returned for display and for the
 *  field-weakening trim @return d and q voltage inside the circle */
dq_t current_control(pi_t *pi_d, const pi_gains_t *gains_d, pi_t *pi_q, const pi_gains_t *gains_q,
                     dq_t ref_q13, dq_t meas_q13, const voltage_circle_t *circle, voltage_q14_t *limit_q);

#endif
