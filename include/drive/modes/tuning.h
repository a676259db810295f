/* TUNING: in closed loop the reference climbs slowly to the maximum speed, whatever the potentiometer says. */
#ifndef DRIVE_MODES_TUNING_H
#define DRIVE_MODES_TUNING_H

#include "drive/reference.h"

/** The speed that the reference goes to. STOPPING ramps to three quarters of the minimum speed, where it ends: the rates follow the
 *  reference. */
QM_INLINE speed_erpm_t mode_speed_target(const drive_t *d, const drive_params_t *p)
{
    if (d->state == (uint16_t)DRIVE_STOPPING) {
        return along_direction(d, (int16_t)(p->minimum_erpm - (p->minimum_erpm >> 2)));
    }
#ifdef TUNING
    return along_direction(d, p->maximum_erpm);
#else
    return d->command.target_erpm;
#endif
}

/** One step of the reference in closed loop. @return 1 if the mode has taken it; a stop is never its own */
QM_INLINE uint16_t mode_reference_step(drive_t *d, const drive_params_t *p)
{
#ifdef TUNING
    if (d->state == (uint16_t)DRIVE_STOPPING) {
        return 0;
    }
    reference_step(d, p, mode_speed_target(d, p), p->tuning_step_q16);
    return 1;
#else
    (void)d;
    (void)p;
    return 0;
#endif
}

#endif
