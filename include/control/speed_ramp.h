/* The speed reference's ramp: a bounded step towards the target, and a snap when the target is near. */
#ifndef CONTROL_SPEED_RAMP_H
#define CONTROL_SPEED_RAMP_H

#include "control/qmath.h"

/** Next reference. @param step_erpm 0 (stays where it is) or more @return target when it is nearer than two steps, else one step closer */
QM_INLINE QM_WRAPS speed_erpm_t speed_ramp(speed_erpm_t reference, speed_erpm_t target, int16_t step_erpm)
{
#ifdef __FRAMAC__ /* what it means */
    int32_t difference = (int32_t)target - reference;
    if (difference > -2 * step_erpm && difference < 2 * step_erpm) {
        return target;
    }
    return (int16_t)((difference > 0) ? reference + step_erpm : reference - step_erpm);
#else
    uint16_t left = (uint16_t)((uint16_t)target - (uint16_t)reference);
    int16_t step = step_erpm;
    if (target < reference) {
        left = (uint16_t)(0u - left);
        step = (int16_t)-step;
    }
    return (int16_t)((left < 2u * (uint16_t)step_erpm) ? target : reference + step);
#endif
}

#endif
