/* Why the drive gives less than it is asked for, read off its variables. */
#ifndef DRIVE_LIMITS_NOW_H
#define DRIVE_LIMITS_NOW_H

#include "drive/handover.h"
#include "drive/limit_reasons.h"
#include "drive/limits.h"
#include "drive/modes/modes.h"
#include "drive/state.h"

/** 1 from 1/32 below the limit on: field weakening's trim keeps the voltage a little below it. @param limit 0 or more */
NOINLINE uint16_t limits_reached(int16_t x, int16_t limit)
{
    return (uint16_t)(qm_size(x) >= (int16_t)(limit - (limit >> 5)));
}

/** What holds the q current: the bus if it brakes, else the current. With no braking current at all its reference is 0, which has no sign. */
QM_INLINE uint16_t limits_current_reasons(const drive_control_t *c, speed_erpm_t speed)
{
    int16_t limit = c->iq_limit_q13;
    uint16_t reason = (uint16_t)LIMIT_CURRENT;
    if (c->brake_limit_q13 < limit && (c->ref_q13.q == 0 || (c->ref_q13.q ^ speed) < 0)) {
        limit = c->brake_limit_q13;
        reason = (uint16_t)LIMIT_BRAKE;
    }
    return (uint16_t)(limits_reached(c->ref_q13.q, limit) ? reason : 0u);
}

/** What holds the speed reference. A rest that the next step takes is no ramp. */
QM_INLINE uint16_t limits_ramp_reasons(const drive_t *d, const drive_params_t *p)
{
    speed_erpm_t target = mode_speed_target(d, p);
    int16_t left = qm_size(qm_sub_limited(target, d->run.control.reference_erpm));

    if (d->run.control.ramp_waits) {
        return (uint16_t)LIMIT_RAMP | (uint16_t)LIMIT_RAMP_WAITS;
    }
    return (uint16_t)((left > qm_hi(2 * p->speed_ramp_q16 - 1)) ? LIMIT_RAMP : LIMIT_NONE);
}

/** What holds the current's references in closed loop. */
QM_INLINE uint16_t limits_closed_loop_reasons(const drive_t *d, const drive_params_t *p)
{
    const drive_run_t *run = &d->run;
    const drive_control_t *c = &run->control;
    uint16_t found;

    if (!mode_limit_reasons(d, p, &found)) {
        found = limits_ramp_reasons(d, p);
    }
    found |= limits_current_reasons(c, observer_speed(&run->observer));
    if (c->burn_q13 > 0) {
        found |= (uint16_t)LIMIT_BURN;
    }
    if (run->fieldweak.table_q13 + run->fieldweak.trim_q13 < 0) {
        found |= (uint16_t)LIMIT_FIELD_WEAKENING;
    }
    return found;
}

/** The estimator's speed is right in the mean, but not for long enough. */
QM_INLINE uint16_t limits_start_swings(const drive_t *d, const drive_params_t *p)
{
    const handover_t *h = &d->run.handover;
    int16_t forced = handover_forced_erpm(d, p);
    if (!mode_hands_over()) {
        return 0;
    }
    return (uint16_t)(d->state == (uint16_t)DRIVE_RAMP && handover_is_overdue(forced, p) && !handover_agrees(h, p)
                      && qm_size(h->ahead_erpm) < forced >> 3);
}

/** Why the drive gives less than it is asked for at this moment: a sum of limit_reason_t, 0 while the bridge is off. It reads the drive's
 *  variables and changes nothing; the background calls it, for the control interrupt has no time to spare. */
QM_INLINE uint16_t limits_reasons(const drive_t *d, const drive_params_t *p)
{
    const drive_control_t *c = &d->run.control;
    uint16_t found;

    if (!drive_is_running(d)) {
        return (uint16_t)((d->state == (uint16_t)DRIVE_CATCH && d->run.catching.step <= (uint16_t)CATCH_FIRST_LOOK) ? LIMIT_TOO_FAST : LIMIT_NONE);
    }
    found = (uint16_t)((limits_reached(c->v_q14.q, c->vq_limit_q14) | limits_reached(c->v_q14.d, d->circle.vd_most_q14)) * (uint16_t)LIMIT_VOLTAGE);
    if (drive_is_closed(d)) {
        found |= limits_closed_loop_reasons(d, p);
    } else if (limits_start_swings(d, p)) {
        found |= (uint16_t)LIMIT_SWING;
    } else {
        /* bootstrap, align, and a ramp that goes as it should */
    }
    return found;
}

#endif
