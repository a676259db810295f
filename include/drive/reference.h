/* The ramped speed reference: a bounded slope, and a wait while the motor cannot follow. */
#ifndef DRIVE_REFERENCE_H
#define DRIVE_REFERENCE_H

#include "drive/drive.h"

/** 1 while the motor is near enough to the reference, on the side of the target: field weakening is indexed by it, so it must stay true. */
QM_INLINE int16_t reference_may_move(const drive_t *d, const drive_params_t *p, speed_erpm_t target)
{
    const speed_erpm_t reference = d->run.control.reference_erpm;
    int16_t ahead = qm_sub_limited(estimator_speed(&d->run.estimator), reference); /* ramp_hold_erpm is below half the format */
    if (target < reference) {
        ahead = (int16_t)-ahead;
    }
    return (int16_t)(ahead > -p->ramp_hold_erpm);
}

/** One step of the reference towards the target; what a step has below a whole electrical rpm counts in the next. @param step_q16 0 or more */
QM_INLINE void reference_step(drive_t *d, const drive_params_t *p, speed_erpm_t target, int32_t step_q16)
{
    drive_control_t *c = &d->run.control;
    int32_t step = step_q16 + (int32_t)c->ramp_q16;
    c->ramp_q16 = (uint16_t)step;
    c->ramp_waits = 0;
    if (c->reference_erpm == target) {
        return;
    }
    if (reference_may_move(d, p, target)) {
        c->reference_erpm = speed_ramp(c->reference_erpm, target, qm_hi(step));
    } else {
        c->ramp_waits = 1;
    }
}

#endif
