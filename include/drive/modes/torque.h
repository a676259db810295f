/* TORQUE_MODE: the potentiometer commands the q current; speed is only limited. */
#ifndef DRIVE_MODES_TORQUE_H
#define DRIVE_MODES_TORQUE_H

#include "drive/modes/bidirectional.h"
#include "drive/limit_reasons.h"
#include "drive/speed_law.h"

/** Ends of the potentiometer's travel: speeds, or q currents in Q13. */
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

/** 1 while the mode, and no speed controller, makes the q current. */
QM_INLINE uint16_t mode_commands_current(const drive_t *d)
{
#ifdef TORQUE_MODE
    return (uint16_t)(d->state == (uint16_t)DRIVE_CLOSED);
#else
    (void)d;
    return 0;
#endif
}

/** The q current in CLOSED: as commanded, between what would hold the minimum speed, below which the estimator would lose the rotor, and
 *  what holds the maximum speed. Both come from the speed controller's own law, which has no memory: limits are met and left without
 *  a bounce, and a stop goes on from what is there. @param iq_q13 the result @return 1 if the mode has taken the step */
QM_INLINE uint16_t mode_current_step(drive_t *d, const drive_params_t *p, current_q13_t *iq_q13)
{
#ifdef TORQUE_MODE
    drive_run_t *run = &d->run;
    int16_t iq, speed = along_direction(d, observer_speed(&run->observer));

    *iq_q13 = 0;
    if (!mode_commands_current(d)) {
        return 0;
    }
    /* field weakening, the rates and a controlled stop start from it */
    run->control.reference_erpm = along_direction(d, (speed > p->minimum_erpm) ? speed : p->minimum_erpm);
    iq = qm_clamp(qm_abs(d->command.target_erpm), along_direction(d, speed_current(run, p, along_direction(d, p->minimum_erpm))),
                  along_direction(d, speed_current(run, p, along_direction(d, p->maximum_erpm))));
    *iq_q13 = along_direction(d, iq);
    return 1;
#else
    (void)d;
    (void)p;
    *iq_q13 = 0;
    return 0;
#endif
}

/** Why the commanded current is not given. @param reasons the result @return 1 if the mode, and no speed reference, is in command */
QM_INLINE uint16_t mode_limit_reasons(const drive_t *d, const drive_params_t *p, uint16_t *reasons)
{
#ifdef TORQUE_MODE
    int16_t asked = qm_clamp(qm_abs(d->command.target_erpm), 0, d->run.control.iq_limit_q13);
    int16_t missing = qm_sub_limited(asked, along_direction(d, d->run.control.ref_q13.q));

    *reasons = (uint16_t)((qm_abs(missing) > (p->current_max_q13 >> 6)) ? LIMIT_SPEED_RANGE : LIMIT_NONE);
    return mode_commands_current(d);
#else
    (void)d;
    (void)p;
    *reasons = (uint16_t)LIMIT_NONE;
    return 0;
#endif
}

#endif
