/* Dead time's compensation of the next two pulses: one for both, or, where the rotor may turn far in a period (DEAD_EACH), one for each. */
#ifndef DRIVE_DEAD_TIME_H
#define DRIVE_DEAD_TIME_H

#include "drive/late.h"
#include "drive/state.h"

#define DEAD_STEP 20861 /**< 65536 / pi: from half a step, radians * 65536, to a step, angle counts */

/** That of this period's pulse: the slow work follows the second one. */
QM_INLINE const dead_duties_t *dead_of_pulse(const drive_t *d)
{
    if (DEAD_EACH && (d->ticks & (SLOW_EVERY - 1u)) == 0u) {
        return d->dead_second;
    }
    return &d->dead;
}

/** That of the second pulse, where it has its own: a step after the first. The forced angle is slow, there it is the same.
 *  @param asked currents of the first */
QM_INLINE void dead_prepare_second(drive_t *d, const drive_params_t *p, dq_t asked)
{
    if (DEAD_EACH) {
        sincos_t frame = d->frame;
        if (!drive_is_forced(d)) {
            trig_sincos_called(&frame, (angle_t)(d->angle + (uint16_t)qm_mulhi(d->run.estimator.half_step_q16_rad, DEAD_STEP)));
        }
        svm_compensation(&p->svm, phases_of(asked, frame), d->dead_second);
    }
}

#endif
