/* The speed controller: the ramped reference and the filtered speed give the q current. */
#ifndef DRIVE_SPEED_H
#define DRIVE_SPEED_H

#include "drive/limits.h"
#include "drive/modes/modes.h"
#include "drive/reference.h"
#include "drive/state.h"

/** The next speed reference. STOPPING ramps to zero. */
QM_INLINE void speed_reference_step(drive_t *d, const drive_params_t *p)
{
    speed_erpm_t target = d->command.target_erpm;
    if (d->state == (uint16_t)DRIVE_STOPPING) {
        target = 0;
    } else if (mode_reference_step(d, p)) {
        return;
    }
    reference_step(d, p, target, p->speed_ramp_erpm);
}

/** One step of the controller, every eighth period in closed loop. STOPPING ends below the minimum speed. */
NOINLINE void speed_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    speed_erpm_t speed = estimator_speed(&d->run.estimator);
    int16_t err, iq_q13;

    if (mode_current_step(d, p, speed)) {
        return;
    }
    speed_reference_step(d, p);
    err = qm_sub_limited(c->reference_erpm, speed);
    iq_q13 = pi_tick(&c->pi_speed, &p->pi_speed, err, c->iq_limit_q13);
    c->ref_q13.q = limits_apply_braking(c, p, speed, err, iq_q13);
    if (d->state == (uint16_t)DRIVE_STOPPING && qm_abs(speed) < p->minimum_erpm && qm_abs(c->reference_erpm) < p->minimum_erpm) {
        drive_enter(d, DRIVE_STOPPED);
    }
}

#endif
