/* TORQUE_MODE: the potentiometer commands the q current; speed is only limited. */
#ifndef DRIVE_MODES_TORQUE_H
#define DRIVE_MODES_TORQUE_H

#include "drive/modes/bidirectional.h"

/** Ends of the potentiometer's travel: electrical rpm, or q current in Q13. */
typedef struct {
    int16_t low, high;
} mode_range_t;

/** What the potentiometer's travel means. @param fast_range S3's speed range, NOMINAL to MAXIMUM; not with two directions */
QM_INLINE mode_range_t mode_target_range(const drive_params_t *p, int16_t fast_range)
{
    mode_range_t range;
#ifdef TORQUE_MODE
    (void)fast_range;
    range.low = MODE_TWO_DIRECTIONS; /* never 0 then: the sign is the direction */
    range.high = p->current_max_q13;
#else
    uint16_t fast = (uint16_t)(fast_range && !MODE_TWO_DIRECTIONS);
    range.low = fast ? p->nominal_erpm : p->minimum_erpm;
    range.high = fast ? p->maximum_erpm : p->nominal_erpm;
#endif
    return range;
}

/** The q current in CLOSED: as commanded; the speed controller keeps it below the maximum speed, and below the minimum speed,
 *  where the estimator would lose the rotor, a proportional share holds against it. @return 1 if the mode has taken the step */
QM_INLINE uint16_t mode_current_step(drive_t *d, const drive_params_t *p, speed_erpm_t speed)
{
#ifdef TORQUE_MODE
    drive_control_t *c = &d->run.control;
    int16_t torque = qm_abs(d->command.target_erpm);
    int16_t limit = (torque < c->iq_limit_q13) ? torque : c->iq_limit_q13;
    int16_t iq;
    int32_t hold;

    if (d->state != (uint16_t)DRIVE_CLOSED) {
        return 0;
    }
    iq = pi_tick(&c->pi_speed, &p->pi_speed, qm_sub_limited(along_direction(d, p->maximum_erpm), speed), limit);
    hold = qm_mulss(qm_sub_limited(p->minimum_erpm, along_direction(d, speed)), p->pi_speed.kp) >> p->pi_speed.shift;
    c->reference_erpm = speed; /* field weakening and a controlled stop start from it */
    if (hold > c->iq_limit_q13) {
        hold = c->iq_limit_q13;
    }
    c->ref_q13.q = (hold > along_direction(d, iq)) ? along_direction(d, (int16_t)hold) : iq;
    return 1;
#else
    (void)d;
    (void)p;
    (void)speed;
    return 0;
#endif
}

#endif
