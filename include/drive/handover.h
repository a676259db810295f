/* The hand-over from the forced angle to the estimator's: the decision, the change of frame, and what decays after it. */
#ifndef DRIVE_HANDOVER_H
#define DRIVE_HANDOVER_H

#include "drive/modes/modes.h"
#include "drive/salient.h"
#include "drive/state.h"

#define HANDOVER_FALL_SHIFT 7                                                 /**< the current that has brought the rotor up falls by 1/128 + 1/256 a step */
#define HANDOVER_FLOOR_SHIFT 3                                                /**< to an eighth at least */
#define HANDOVER_SWUNG_SHIFT 5                                                /**< where the rotor is no longer slower than by 1/32 */
#define HANDOVER_MEAN_SHIFT 5                                                 /**< the mean deviation of the speed is one over 32 steps: a rotor swings about the forced speed, a wrong constant is off it */
#define HANDOVER_HURRY 3                                                      /**< times the ramp's rate, once the estimator should have agreed */
#define HANDOVER_MOST_STEPS(p) ((uint16_t)((p)->wait_periods >> LATE_DUTIES)) /**< 1.6 s of agreement: the slowest rotor has swung to where the current pulls it */
#define HANDOVER_DECAY 16                                                     /**< angle counts of the offset that go in a rare step */
#define HANDOVER_MOST_OFFSET 0x2000                                           /**< 45 degrees: so much torque of the current is no surprise to the estimator's frame */

/** The current of the ramp, which a light load leaves nearly without torque, falls until the rotor needs it: a large d current would turn every
 *  error of the estimator's angle into torque. @return its magnitude */
QM_INLINE current_q13_t handover_release(drive_t *d, const drive_params_t *p)
{
    int16_t current = qm_size(d->run.control.ref_q13.q), least = (int16_t)(p->open_loop_q13 >> HANDOVER_FLOOR_SHIFT);
    current = (int16_t)(current - (current >> HANDOVER_FALL_SHIFT) - (current >> (HANDOVER_FALL_SHIFT + 1)) - 1);
    current = (current < least) ? least : current;
    d->run.control.ref_q13.q = along_direction(d, current);
    return current;
}

/** 1 once the estimator has agreed with the forced speed for long enough. */
QM_INLINE uint16_t handover_agrees(const handover_t *h, const drive_params_t *p)
{
    return (uint16_t)(h->agreed_steps >= p->agree_steps);
}

/** The forced angle's speed along the direction, counts of speed_erpm_t. */
NOINLINE speed_erpm_t handover_forced_erpm(const drive_t *d, const drive_params_t *p)
{
    int32_t erpm = qm_mulss((int16_t)(d->forced.speed_q10 >> 8), p->observer.per_turn_q12) >> (11 - LATE_DUTIES);
    if (LATE_DUTIES) { /* the angle per period may be rounded up by more than a count of the largest speed */
        erpm = (erpm > INT16_MAX) ? INT16_MAX : (erpm < -INT16_MAX) ? -INT16_MAX
                                                                    : erpm;
    }
    return (int16_t)erpm;
}

/** 1 from the forced speed on at which the estimator should have agreed. */
QM_INLINE uint16_t handover_is_overdue(speed_erpm_t forced, const drive_params_t *p)
{
    return (uint16_t)(forced > p->early_erpm + (p->early_erpm >> 1));
}

/** 1 where the current pulls the rotor, or cannot fall further and the rotor has swung to where the floor pulls it: while it falls behind it is slower
 *  than the speed that the closed loop begins with, and loses more of it before the observer knows.
 *  @param current_q13 its magnitude @param ahead_erpm of the forced speed */
QM_INLINE uint16_t handover_is_due(const drive_t *d, const drive_params_t *p, current_q13_t current_q13, speed_erpm_t forced,
                                   int16_t ahead_erpm)
{
    int16_t offset = (int16_t)(angle_t)(d->angle - estimator_next_angle(&d->run.estimator));
    return (uint16_t)(!qm_beyond(offset, HANDOVER_MOST_OFFSET)
                      || (current_q13 <= (p->open_loop_q13 >> HANDOVER_FLOOR_SHIFT) && ahead_erpm >= -(forced >> HANDOVER_SWUNG_SHIFT)));
}

/** While the estimator agrees: the speed waits, the current falls, and what the closed loop begins with is ready. A rotor that swings ahead is not braked.
 *  @param forced,seen speeds along the direction @param ahead_erpm of the forced speed */
QM_INLINE void handover_prepare(drive_t *d, const drive_params_t *p, speed_erpm_t forced, speed_erpm_t seen, int16_t ahead_erpm)
{
    handover_t *h = &d->run.handover;
    current_q13_t current = handover_release(d, p);
    d->forced.increase_q10 = 0;
    h->is_due = handover_is_due(d, p, current, forced, ahead_erpm);
    d->run.control.reference_erpm = along_direction(d, (seen > forced) ? seen : forced);
    if (!h->is_due && h->agreed_steps >= p->agree_steps + HANDOVER_MOST_STEPS(p)) {
        drive_raise(d, FAULT_START_FAILED);
    }
}

/* wcet: handover_wait excludes speed_step */
/** In RAMP, every slow step: from the speed on that the back-EMF allows, counts how long the estimator agrees with the forced speed; at the ramp's
 *  end it gives up by name. Once it agrees the speed may swing more, for the current that holds it falls. Where it does not agree by half as much
 *  again, the rotor is blocked or the constants are off: the rest of the ramp is quicker. */
QM_INLINE void handover_wait(drive_t *d, const drive_params_t *p)
{
    handover_t *h = &d->run.handover;
    int16_t forced, seen, ahead, most;
    uint16_t at_end = (uint16_t)(d->forced.speed_q10 >= p->forced.end_speed_q10);
    if (!mode_hands_over()) {
        return;
    }
    forced = handover_forced_erpm(d, p);
    seen = along_direction(d, estimator_speed(&d->run.estimator));
    ahead = qm_sub_limited(seen, forced);
    h->ahead_erpm = (int16_t)(h->ahead_erpm + ((ahead - h->ahead_erpm) >> HANDOVER_MEAN_SHIFT));
    if (!at_end && forced < p->early_erpm) { /* the two may be one speed, which is counted down */
        return;
    }
    most = (int16_t)(forced >> (handover_agrees(h, p) ? 1 : 2));
    d->periods = (uint16_t)(at_end ? d->periods + SLOW_PERIODS : 0);
    h->agreed_steps = (uint16_t)((qm_size(ahead) < most && (at_end || qm_size(h->ahead_erpm) < most >> 1)) ? h->agreed_steps + 1u : 0u);
    if (handover_agrees(h, p)) {
        handover_prepare(d, p, forced, seen, ahead);
        return;
    }
    d->run.control.ref_q13.q = along_direction(d, p->open_loop_q13);
    d->forced.increase_q10 = (int16_t)(handover_is_overdue(forced, p) ? HANDOVER_HURRY * p->forced.increase_rate_q10 : p->forced.increase_rate_q10);
    if (d->periods >= p->wait_periods) {
        drive_raise(d, FAULT_START_FAILED);
    }
}

/** The law goes on at an angle: its frame, and integrators that give the voltages that are commanded. */
NOINLINE void handover_preset(drive_t *d, const drive_params_t *p, angle_t angle)
{
    drive_control_t *c = &d->run.control;
    pi_preset(&c->pi_d, &p->pi_d, 0, c->v_q14.d);
    pi_preset(&c->pi_q, &p->pi_q, 0, c->v_q14.q);
    d->angle = angle;
    trig_sincos_called(&d->frame, angle);
}

/** Bumpless change of frame: currents, voltages and integrators turn from the forced frame into the estimator's. The angles are
 *  those of the next sample. */
QM_INLINE void handover_now(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    handover_t *h = &d->run.handover;
    angle_t estimated = estimator_next_angle(&d->run.estimator);
    sincos_t turn;
    alphabeta_t y;

    h->offset = (int16_t)(angle_t)(d->angle - estimated);
    trig_sincos_called(&turn, (angle_t)h->offset);
    y = inverse_park(c->v_q14, turn);
    c->v_q14.d = (int16_t)(2 * y.alpha);
    c->v_q14.q = (int16_t)(2 * y.beta);
    h->current_q13 = c->ref_q13.q;
    y = inverse_park_q(h->current_q13, turn);
    c->ref_q13.d = (int16_t)(2 * y.alpha);
    c->ref_q13.q = (int16_t)(2 * y.beta);
    h->id_q13 = c->ref_q13.d;
    handover_preset(d, p, estimated);
    drive_enter(d, DRIVE_CLOSED);
}

/** In RAMP, in the period after handover_wait(), which has time for one of the two. */
QM_INLINE void handover_step(drive_t *d, const drive_params_t *p)
{
    if (d->run.handover.is_due) {
        handover_now(d, p);
    }
}

/** The observer's step. Its first one, six periods after the hand-over, whose own period has enough to do, begins with the hand-over's q
 *  current, so that the speed controller, which comes next, goes on from it. */
QM_INLINE void handover_observe(drive_run_t *run, const drive_params_t *p)
{
    const drive_control_t *c = &run->control;
    if (run->handover.speed_is_preset) {
        observer_step(&run->observer, &p->observer, run->estimator.rho_q32, salient_torque(run, c->i_q13.q));
        if (run->handover.offset != 0) {
            observer_unsettle(&run->observer); /* dead time shakes the estimate most while the d current falls */
        }
    } else {
        run->handover.speed_is_preset = 1;
        observer_preset(&run->observer, &p->observer, run->estimator.rho_q32, estimator_speed(&run->estimator), salient_torque(run, c->ref_q13.q));
    }
}

/** What is left of the angle offset falls every rare step, while there is any; its d current follows. */
QM_INLINE void handover_decay(handover_t *h)
{
    int16_t offset = h->offset;
    sincos_t turn;
    if (offset > -2 * HANDOVER_DECAY && offset < 2 * HANDOVER_DECAY) {
        offset = 0;
    } else {
        offset = (int16_t)((offset > 0) ? offset - HANDOVER_DECAY : offset + HANDOVER_DECAY);
    }
    h->offset = offset;
    trig_sincos_called(&turn, (angle_t)offset);
    h->id_q13 = (int16_t)-qm_hi(2 * qm_mulss(h->current_q13, turn.sin));
}

#endif
