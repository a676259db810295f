/* The preparation of a start. */
#ifndef DRIVE_BEGIN_H
#define DRIVE_BEGIN_H

#include "drive/limits.h"
#include "drive/modes/modes.h"
#include "drive/state.h"

/** drive_start() in place, for the one who calls it and has seen that the drive may start. */
QM_INLINE void drive_begin(drive_t *d, const drive_params_t *p, int16_t direction)
{
    drive_run_t *run = &d->run;
    uint8_t *from = (uint8_t *)&d->forced;
    drive_turns(d, direction);
    /* from the forced angle on, whose angle is the control's */
    drive_zero(from, (uint16_t)((uint8_t *)(run + 1) - from));
    drive_update_model(run, p, p->end_erpm);
    run->control.iq_limit_q13 = p->current_max_q13;
    run->control.brake_limit_q13 = limits_asked_most(p);
    d->forced.speed_q10 = p->align_speed_q10;
    trig_sincos_called(&d->frame, 0);
    run->catching.step = mode_hands_over() ? p->flying_start : (uint16_t)CATCH_NO_LOOK;
    mode_start(d, p);
    d->command.run = 1;
}

#endif
