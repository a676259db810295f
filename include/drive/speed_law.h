/* The q current that brings a speed about: proportional to what is missing, and what the observer says the load takes. */
#ifndef DRIVE_SPEED_LAW_H
#define DRIVE_SPEED_LAW_H

#include "drive/salient.h"

#define SPEED_TRIM_SHIFT 8 /**< the trim takes 1/256 of the error in half of the rare steps: 2.4 rad/s at 20 kHz */
#define SPEED_TRIM_HALF (INT32_C(1) << (SPEED_TRIM_SHIFT - 1))
#define SPEED_TRIM_LEAK_SHIFT 7  /**< and is forgotten in a tenth of a second */
#define SPEED_TRIM_MOST_SHIFT 3  /**< an eighth of the largest current at most */
#define SPEED_TRIM_ERROR_SHIFT 3 /**< an error beyond an eighth of the speed is no rest */

/** The observer's rate and the gain that goes with it. Every rare step in closed loop. */
QM_INLINE void speed_schedule(drive_run_t *run, const drive_params_t *p)
{
    observer_t *o = &run->observer;
    int16_t gain, reference = qm_size(run->control.reference_erpm), speed = qm_size(observer_speed(o));
    observer_schedule(o, &p->observer, (speed > reference) ? speed : reference, run->control.ref_q13.q);
    gain = observer_between(p->speed_kp_q13, p->speed_kp_quick_q13, o->quick_q15);
    run->control.speed_kp_q13 = observer_between(0, gain, observer_twice(o->share_q15)); /* at low speed a light rotor needs it more than the rates */
}

/** No integral for the load: its estimate never winds up, for it is made from the current that flows. The trim takes what an estimate leaves
 *  whose innovations are not as large to either side.
 *  @param target_erpm speed to be held @return q current within iq_limit_q13, with 13 fraction bits */
QM_INLINE int32_t speed_current_q26(const drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm)
{
    const drive_control_t *c = &run->control;
    int32_t limit_q26 = qm_mulss(c->iq_limit_q13, 8192);
    int32_t torque_q26 = qm_mulss(qm_sub_limited(target_erpm, observer_speed(&run->observer)), c->speed_kp_q13)
                         + observer_load_q26(&run->observer, &p->observer) + c->iq_trim_q26;
    int32_t iq_q26 = salient_current_q26(run, torque_q26);
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

/** 1 where the observer's load moves against the error by itself.
 *  @param seen,speed the estimator's speed and the observer's @param error where it is 0 the trim asks in vain */
QM_INLINE uint16_t speed_load_moves_against(speed_erpm_t seen, speed_erpm_t speed, int16_t error)
{
    return (uint16_t)((error > 0) ? seen < speed : seen > speed);
}

/** What the observer's estimate leaves of the speed's error at rest: an integral, slower than any rate of the observer, that acts while the
 *  reference stands, nothing changes fast and no limit is reached, and is forgotten otherwise. It waits in the steps in which the observer's
 *  load moves against the error by itself: while a load grows, the error is the observer's.
 *  @param before_erpm the reference a rare step ago @param iq_q13 the q current that is asked for */
QM_INLINE void speed_trim(drive_run_t *run, const drive_params_t *p, speed_erpm_t before_erpm, current_q13_t iq_q13)
{
    drive_control_t *c = &run->control;
    const speed_erpm_t speed = observer_speed(&run->observer);
    const int16_t error = qm_sub_limited(c->reference_erpm, speed), most_q10 = (int16_t)(p->current_max_q13 >> (3 + SPEED_TRIM_MOST_SHIFT));
    int32_t trim_q26 = c->iq_trim_q26;
    if (c->reference_erpm == before_erpm && qm_size(error) <= (qm_size(before_erpm) >> SPEED_TRIM_ERROR_SHIFT)
        && observer_is_calm(&run->observer) && qm_size(iq_q13) < c->iq_limit_q13 && qm_size(c->v_q14.q) < c->vq_limit_q14) {
        if (!speed_load_moves_against(estimator_speed(&run->estimator), speed, error)) {
            trim_q26 += (qm_mulss(error, c->speed_kp_q13) + SPEED_TRIM_HALF) >> SPEED_TRIM_SHIFT;
        }
    } else {
        trim_q26 -= trim_q26 >> SPEED_TRIM_LEAK_SHIFT;
    }
    c->iq_trim_q26 = qm_clamp_hi(trim_q26, (int16_t)-most_q10, most_q10);
}

/** The same step by step: what a step leaves below a whole count goes to the next, for a count can turn a light rotor out of its speed. */
QM_INLINE current_q13_t speed_current_step(drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm)
{
    int32_t iq_q26 = speed_current_q26(run, p, target_erpm) + run->control.iq_rest_q26;
    run->control.iq_rest_q26 = (int16_t)(iq_q26 & 8191);
    return (int16_t)(iq_q26 >> 13);
}

#endif
