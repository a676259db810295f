/* OPEN_LOOP_FUNCTIONING: the forced angle keeps turning the motor at END_SPEED_RPM, for a first look at currents and voltages. */
#ifndef DRIVE_MODES_OPEN_LOOP_H
#define DRIVE_MODES_OPEN_LOOP_H

#include "drive/drive.h"

/** 1 if the end of the ramp leads to closed loop. */
QM_INLINE uint16_t mode_hands_over(void)
{
#if defined OPEN_LOOP_FUNCTIONING || defined IDENTIFY || defined BRINGUP /* these have vectors of their own */
    return 0;
#else
    return 1;
#endif
}

#endif
