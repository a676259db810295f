/* The speed controller: the ramped reference, the observed speed and the observed load give the q current. */
#ifndef DRIVE_SPEED_H
#define DRIVE_SPEED_H

#include "drive/limits.h"
#include "drive/modes/modes.h"
#include "drive/reference.h"
#include "drive/startup.h"

/** The next speed reference. */
QM_INLINE void speed_reference_step(drive_t *d, const drive_params_t *p)
{
    if (!mode_reference_step(d, p)) {
        reference_step(d, p, mode_speed_target(d, p), p->speed_ramp_q16);
    }
}

/** What belongs to the speed: the observer's rate, the gain, the current that the samples miss. Every rare step in closed loop, after a large
 *  innovation every slow one. */
QM_INLINE void speed_follow(drive_run_t *run, const drive_params_t *p)
{
    speed_schedule(run, p);
    run->control.sample_shift_q13 = qm_mulhi(observer_speed(&run->observer), p->sample_shift_q16);
}

/** 1 while the target lies in the other direction. */
QM_INLINE uint16_t speed_is_to_turn(const drive_t *d)
{
    return (uint16_t)((d->command.target_erpm ^ d->direction) < 0);
}

/** 1 when a stop has come to its end: the reference below the minimum speed and the rotor near it, for what the observer does not see of an
 *  unloaded motor's current can hold it just above. */
QM_INLINE uint16_t speed_has_stopped(const drive_t *d, const drive_params_t *p)
{
    return (uint16_t)(qm_size(observer_speed(&d->run.observer)) < p->minimum_erpm + (p->minimum_erpm >> 1)
                      && qm_size(d->run.control.reference_erpm) < p->minimum_erpm);
}

/** A stop goes on as a run, from the rotor's speed. What drove the rotor in the observer's eyes was its inertia, if there is more of it than the
 *  header says: it is forgotten, or the braking would go on for a while. */
QM_INLINE void speed_go_on(drive_t *d)
{
    observer_t *o = &d->run.observer;
    d->run.control.reference_erpm = observer_speed(o);
    if (along_direction(d, qm_hi(o->load_q16)) < 0) {
        o->load_q16 = 0;
    }
    drive_enter(d, DRIVE_CLOSED);
}

/** Whether the run goes on or slows down: the wish to stop or a target in the other direction slows it down; a new wish to run goes on from the present speed.
 *  Every seldom step in closed loop. */
NOINLINE void speed_choose_state(drive_t *d, const drive_params_t *p)
{
    uint16_t stops = (uint16_t)(d->state == (uint16_t)DRIVE_STOPPING), other = speed_is_to_turn(d);

    if (!stops) {
        if (other || !d->command.run) {
            drive_enter(d, DRIVE_STOPPING);
        }
    } else if (d->command.run) {
        if (!other) {
            speed_go_on(d);
        }
    } else if (speed_has_stopped(d, p)) {
        drive_enter(d, DRIVE_STOPPED);
    } else {
        /* on its way */
    }
}

/* wcet: speed_turn_round/drive_turns excludes model_update */
/** In STOPPING, every slow step: when the rotor has slowed down for a target in the other direction, the ramp takes it through zero. */
QM_INLINE void speed_turn_round(drive_t *d, const drive_params_t *p)
{
    if (d->command.run && speed_is_to_turn(d) && speed_has_stopped(d, p)) {
        drive_turns(d, (int16_t)-d->direction);
        startup_ramp_from_here(d, p);
    }
}

/** The controller's trim, every rare step in closed loop. */
QM_INLINE void speed_trim_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    if (!mode_commands_current(d)) {
        speed_trim(&d->run, p, c->trim_reference_erpm, c->ref_q13.q);
    }
    c->trim_reference_erpm = c->reference_erpm;
}

/** One step of the controller, every slow step in closed loop. */
QM_INLINE void speed_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    speed_erpm_t speed = observer_speed(&d->run.observer);
    current_q13_t iq_q13;

    if (!mode_current_step(d, p, &iq_q13)) {
        speed_reference_step(d, p);
        iq_q13 = speed_current_step(&d->run, p, c->reference_erpm);
    }
    c->ref_q13.q = limits_apply_braking(c, speed, iq_q13);
}

#endif
