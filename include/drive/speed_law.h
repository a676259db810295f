/* The q current that brings a speed about: proportional to what is missing, and what the observer says the load takes. */
#ifndef DRIVE_SPEED_LAW_H
#define DRIVE_SPEED_LAW_H

#include "drive/drive.h"

/** The observer's rate and the gain that goes with it. Every eighth period in closed loop. */
QM_INLINE void speed_schedule(drive_run_t *run, const drive_params_t *p)
{
    observer_t *o = &run->observer;
    int16_t gain, reference = qm_abs(run->control.reference_erpm), speed = qm_abs(observer_speed(o));
    observer_schedule(o, &p->observer, (speed > reference) ? speed : reference);
    gain = observer_between(p->speed_kp_q13, p->speed_kp_quick_q13, o->quick_q15);
    run->control.speed_kp_q13 = observer_between(0, gain, o->share_q15);
}

/** No integral: the load's estimate is one that never winds up, for it is made from the current that flows.
 *  @param target_erpm speed to be held @return q current within iq_limit_q13, with 13 fraction bits */
QM_INLINE int32_t speed_current_q26(const drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm)
{
    const drive_control_t *c = &run->control;
    int32_t limit_q26 = qm_mulss(c->iq_limit_q13, 8192);
    int32_t iq_q26 = qm_mulss(qm_sub_limited(target_erpm, observer_speed(&run->observer)), c->speed_kp_q13)
                     + observer_load_q26(&run->observer, &p->observer);
    if (iq_q26 > limit_q26) {
        return limit_q26;
    }
    return (iq_q26 < -limit_q26) ? -limit_q26 : iq_q26;
}

/** The same in whole counts. */
QM_INLINE current_q13_t speed_current(const drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm)
{
    return (int16_t)((speed_current_q26(run, p, target_erpm) + 4096) >> 13);
}

/** The same step by step: what a step leaves below a whole count goes to the next, for a count can turn a light rotor out of its speed. */
QM_INLINE current_q13_t speed_current_step(drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm)
{
    int32_t iq_q26 = speed_current_q26(run, p, target_erpm) + run->control.iq_rest_q26;
    run->control.iq_rest_q26 = (int16_t)(iq_q26 & 8191);
    return (int16_t)(iq_q26 >> 13);
}

#endif
