/* The speed controller: the ramped reference, the observed speed and the observed load give the q current. */
#ifndef DRIVE_SPEED_H
#define DRIVE_SPEED_H

#include "drive/limits.h"
#include "drive/modes/modes.h"
#include "drive/reference.h"
#include "drive/state.h"

/** The next speed reference. */
QM_INLINE void speed_reference_step(drive_t *d, const drive_params_t *p)
{
    if (d->state == (uint16_t)DRIVE_STOPPING || !mode_reference_step(d, p)) {
        reference_step(d, p, mode_speed_target(d, p), p->speed_ramp_q16);
    }
}

/** What belongs to the speed: the observer's rate, the gain, the current that the samples miss. Every eighth period in closed loop. */
QM_INLINE void speed_follow(drive_run_t *run, const drive_params_t *p)
{
    speed_schedule(run, p);
    run->control.sample_shift_q13 = qm_mulhi(observer_speed(&run->observer), p->sample_shift_q16);
}

/** One step of the controller, every eighth period in closed loop. STOPPING ends when the reference has come below the minimum speed and the rotor
 *  near it: what the observer does not see of an unloaded motor's current can hold it just above. */
NOINLINE void speed_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    speed_erpm_t speed = observer_speed(&d->run.observer);
    current_q13_t iq_q13;

    if (!mode_current_step(d, p, &iq_q13)) {
        speed_erpm_t before = c->reference_erpm;
        speed_reference_step(d, p);
        iq_q13 = speed_current_step(&d->run, p, c->reference_erpm);
        speed_trim(&d->run, p, before, iq_q13);
    }
    c->ref_q13.q = limits_apply_braking(c, speed, iq_q13);
    if (d->state == (uint16_t)DRIVE_STOPPING && qm_abs(speed) < p->minimum_erpm + (p->minimum_erpm >> 1) && qm_abs(c->reference_erpm) < p->minimum_erpm) {
        drive_enter(d, DRIVE_STOPPED);
    }
}

#endif
