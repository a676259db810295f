/* The preparation of a start. */
#ifndef DRIVE_BEGIN_H
#define DRIVE_BEGIN_H

#include "drive/limits.h"
#include "drive/modes/modes.h"
#include "drive/state.h"

/** drive_start() in place, for the one who calls it. */
QM_INLINE void drive_begin(drive_t *d, const drive_params_t *p, int16_t direction)
{
    drive_run_t *run = &d->run;
    if (d->state != (uint16_t)DRIVE_STOPPED || d->command.run) {
        return;
    }
    drive_zero(run, sizeof *run);
    drive_turns(d, direction);
    drive_update_model(run, p, p->end_erpm);
    run->control.iq_limit_q13 = p->current_max_q13;
    run->control.brake_limit_q13 = limits_asked_most(p);
    drive_zero(&d->forced, sizeof d->forced);
    d->forced.speed_q10 = p->align_speed_q10;
    d->dead = (dead_duties_t){ 0, 0, 0 };
    if (sizeof d->dead_second != 0u) {
        drive_zero(d->dead_second, (uint16_t)sizeof d->dead_second);
    }
    d->angle = forced_angle(&d->forced);
    trig_sincos_called(&d->frame, d->angle);
    run->catching.step = mode_hands_over() ? p->flying_start : (uint16_t)CATCH_NO_LOOK;
    mode_start(d, p);
    d->command.run = 1;
}

#endif
