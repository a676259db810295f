/* TUNING: in closed loop the reference climbs slowly to the maximum speed, whatever the potentiometer says. */
#ifndef DRIVE_MODES_TUNING_H
#define DRIVE_MODES_TUNING_H

#include "drive/reference.h"

/** One step of the reference in closed loop. @return 1 if the mode has taken it */
QM_INLINE uint16_t mode_reference_step(drive_t *d, const drive_params_t *p)
{
#ifdef TUNING
    reference_step(d, p, along_direction(d, p->maximum_erpm), p->tuning_step_q16);
    return 1;
#else
    (void)d;
    (void)p;
    return 0;
#endif
}

#endif
