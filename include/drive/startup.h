/* The start without the estimator: charge the drivers, take the rotor along, accelerate it by the forced angle. */
#ifndef DRIVE_STARTUP_H
#define DRIVE_STARTUP_H

#include "drive/handover.h"
#include "drive/protection.h"

/** The low sides conduct and charge the high sides' drivers. @return the next state */
QM_INLINE drive_state_t startup_bootstrap(drive_t *d, const drive_params_t *p)
{
    (void)protection_check_current(d, p); /* a fault that it raises keeps every state out */
    d->periods++;
    if (!d->command.run) {
        return DRIVE_STOPPED;
    }
    return (d->periods >= p->bootstrap_periods) ? DRIVE_ALIGN : DRIVE_BOOTSTRAP;
}

/** The forced angle goes on where the estimator is, at its speed, against the direction too: the current lies along the rotor's flux and pulls no
 *  further than it turns. */
NOINLINE void startup_ramp_from_here(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    drive_control_t *c = &run->control;
    angle_t quarter = (angle_t)along_direction(d, 0x4000), estimated = estimator_next_angle(&run->estimator);
    angle_t forced = (angle_t)(estimated - quarter);
    dq_t v = c->v_q14;

    run->handover.agreed_steps = 0;
    run->handover.is_due = 0;
    run->handover.ahead_erpm = 0;
    run->handover.speed_is_preset = 0;
    run->handover.offset = 0;
    run->handover.id_q13 = 0;
    c->burn_q13 = 0;
    d->forced.speed_q10 = qm_mulss(along_direction(d, run->estimator.omega_erpm), p->estimator.deltat_q32) >> 6;
    d->forced.angle_q32 = (uint32_t)forced << 16;
    d->forced.increase_q10 = p->forced.increase_rate_q10;
    c->v_q14.d = along_direction(d, (int16_t)-v.q); /* the same vector in a frame a quarter turn behind */
    c->v_q14.q = along_direction(d, v.d);
    c->ref_q13.d = 0;
    c->ref_q13.q = along_direction(d, p->open_loop_q13);
    handover_preset(d, p, forced);
    drive_enter(d, DRIVE_RAMP);
}

/** The vector of ALIGN turns PARAM_ALIGN_TURNS times while its current grows from nothing. A weak current passes a rotor that lies against it and takes
 *  it along the next time, so that it is never thrown back; the ramp goes on from this speed. Every slow step. */
QM_INLINE void startup_align(drive_t *d, const drive_params_t *p)
{
    int16_t current = p->open_loop_q13;
    d->periods = (uint16_t)(d->periods + SLOW_PERIODS);
    if (d->periods >= p->align_periods) {
        d->forced.increase_q10 = p->forced.increase_rate_q10;
        drive_enter(d, DRIVE_RAMP);
    } else {
        current = (int16_t)(qm_muluu(d->periods, p->align_rate_q12) >> 12);
    }
    d->run.control.ref_q13.q = along_direction(d, current);
}

#endif
