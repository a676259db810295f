/* The hand-over from the forced angle to the estimator's: the decision, the change of frame, what decays after it, and the observer's step in between. */
#include "drive/handover.h"

#include "drive/drive.h"

/** The current of the ramp, which a light load leaves nearly without torque, falls until the rotor needs it: a large d current would turn every
 *  error of the estimator's angle into torque. @return its magnitude */
static current_q13_t handover_release(drive_t *d, const drive_params_t *p)
{
    int16_t current = qm_abs(d->run.control.ref_q13.q), least = (int16_t)(p->open_loop_q13 >> HANDOVER_FLOOR_SHIFT);
    current = (int16_t)(current - (current >> HANDOVER_FALL_SHIFT) - (current >> (HANDOVER_FALL_SHIFT + 1)) - 1);
    current = (current < least) ? least : current;
    d->run.control.ref_q13.q = along_direction(d, current);
    return current;
}

void handover_enter(handover_t *h, start_phase_t next)
{
    h->phase = (uint16_t)next;
}

uint16_t handover_agrees(const handover_t *h)
{
    return (uint16_t)(h->phase >= (uint16_t)START_RELEASE);
}

speed_erpm_t handover_forced_erpm(const drive_t *d, const drive_params_t *p)
{
    int32_t erpm = qm_mulss((int16_t)(d->forced.speed_q10 >> 8), p->observer.per_turn_q12) >> (11 - DEFER_DUTIES);
    if (DEFER_DUTIES) { /* the angle per period may be rounded up by more than a count of the largest speed */
        erpm = qm_within(erpm, -INT16_MAX, INT16_MAX);
    }
    return (int16_t)erpm;
}

uint16_t handover_is_overdue(speed_erpm_t forced, const drive_params_t *p)
{
    return (uint16_t)(forced > p->early_erpm + (p->early_erpm >> 1));
}

/** 1 where the current pulls the rotor, or cannot fall further and the rotor has swung to where the floor pulls it: while it falls behind it is slower
 *  than the speed that the closed loop begins with, and loses more of it before the observer knows.
 *  @param current_q13 its magnitude @param ahead_erpm of the forced speed */
static uint16_t handover_is_due(const drive_t *d, const drive_params_t *p, current_q13_t current_q13, speed_erpm_t forced, int16_t ahead_erpm)
{
    int16_t offset = (int16_t)(angle_t)(d->angle - estimator_next_angle(&d->run.estimator));
    return (uint16_t)(!qm_beyond(offset, HANDOVER_MOST_OFFSET)
                      || (current_q13 <= (p->open_loop_q13 >> HANDOVER_FLOOR_SHIFT) && ahead_erpm >= -(forced >> HANDOVER_SWUNG_SHIFT)));
}

/** While the estimator agrees: the speed waits, the current falls, and what the closed loop begins with is ready. A rotor that swings ahead is not braked.
 *  @param forced,seen speeds along the direction @param ahead_erpm of the forced speed */
static void handover_prepare(drive_t *d, const drive_params_t *p, speed_erpm_t forced, speed_erpm_t seen, int16_t ahead_erpm)
{
    handover_t *h = &d->run.handover;
    current_q13_t current = handover_release(d, p);
    d->forced.increase_q10 = 0;
    handover_enter(h, handover_is_due(d, p, current, forced, ahead_erpm) ? START_HAND_OVER : START_RELEASE);
    d->run.control.reference_erpm = along_direction(d, (seen > forced) ? seen : forced);
    if (h->phase == (uint16_t)START_RELEASE && h->agreed_steps >= p->agree_steps + HANDOVER_MOST_STEPS(p)) {
        drive_raise(d, FAULT_START_FAILED);
    }
}

/* wcet: handover_wait excludes speed_step */
void handover_wait(drive_t *d, const drive_params_t *p)
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
    most = (int16_t)(forced >> (handover_agrees(h) ? 1 : 2));
    h->at_end = at_end;
    d->periods = (uint16_t)(at_end ? d->periods + SLOW_PERIODS : 0);
    h->agreed_steps = (uint16_t)((qm_abs(ahead) < most && (at_end || qm_abs(h->ahead_erpm) < most >> 1)) ? h->agreed_steps + 1u : 0u);
    if (h->agreed_steps >= p->agree_steps) {
        handover_prepare(d, p, forced, seen, ahead);
        return;
    }
    handover_enter(h, START_AGREE);
    d->run.control.ref_q13.q = along_direction(d, p->open_loop_q13);
    d->forced.increase_q10 = (int16_t)(handover_is_overdue(forced, p) ? HANDOVER_HURRY * p->forced.increase_rate_q10 : p->forced.increase_rate_q10);
    if (d->periods >= p->wait_periods) {
        drive_raise(d, FAULT_START_FAILED);
    }
}

void handover_preset(drive_t *d, const drive_params_t *p, angle_t angle)
{
    drive_control_t *c = &d->run.control;
    pi_preset(&c->pi_d, &p->pi_d, 0, c->v_q14.d);
    pi_preset(&c->pi_q, &p->pi_q, 0, c->v_q14.q);
    d->angle = angle;
    d->frame = trig_sincos(angle);
}

NOINLINE sincos_t handover_turn_voltage(drive_run_t *run, int16_t back)
{
    drive_control_t *c = &run->control;
    const sincos_t turn = trig_sincos((angle_t)back);
    const alphabeta_t v = inverse_park(c->v_q14, turn);
    c->v_q14.d = (int16_t)(2 * v.alpha);
    c->v_q14.q = (int16_t)(2 * v.beta);
    return turn;
}

void handover_now(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    handover_t *h = &d->run.handover;
    angle_t estimated = estimator_next_angle(&d->run.estimator);
    sincos_t turn;
    alphabeta_t y;
    h->offset = (int16_t)(angle_t)(d->angle - estimated);
    turn = handover_turn_voltage(&d->run, h->offset);
    h->current_q13 = c->ref_q13.q;
    y = inverse_park_q(h->current_q13, turn);
    c->ref_q13.d = (int16_t)(2 * y.alpha);
    c->ref_q13.q = (int16_t)(2 * y.beta);
    h->id_q13 = c->ref_q13.d;
    handover_preset(d, p, estimated);
    handover_enter(h, START_OBSERVE);
    drive_enter(d, DRIVE_CLOSED);
}

void handover_step(drive_t *d, const drive_params_t *p)
{
    if (d->run.handover.phase == (uint16_t)START_HAND_OVER) {
        handover_now(d, p);
    }
}

void handover_observe(drive_run_t *run, const drive_params_t *p)
{
    const drive_control_t *c = &run->control;
    if (held_angle_stands(&run->held)) {
        return;
    }
    if (run->handover.phase == (uint16_t)START_DONE) {
        observer_step(&run->observer, &p->observer, mode_observed(run),
                      (int16_t)(salient_torque(run, c->i_q13.q) - mode_profile_current(run)));
        /* dead time shakes the estimate most while the d current falls, and where a q current that brakes crosses zero: no load does */
        if (run->handover.offset != 0 || qm_mulss(c->ref_q13.q, observer_speed(&run->observer)) < 0) {
            observer_raise_gate(&run->observer);
        }
    } else {
        handover_enter(&run->handover, START_DONE);
        observer_preset(&run->observer, &p->observer, run->estimator.rho_q32, estimator_speed(&run->estimator), salient_torque(run, c->ref_q13.q));
    }
}

void handover_decay(handover_t *h)
{
    int16_t offset = h->offset;
    sincos_t turn;
    if (offset > -2 * HANDOVER_DECAY && offset < 2 * HANDOVER_DECAY) {
        offset = 0;
    } else {
        offset = (int16_t)((offset > 0) ? offset - HANDOVER_DECAY : offset + HANDOVER_DECAY);
    }
    h->offset = offset;
    turn = trig_sincos((angle_t)offset);
    h->id_q13 = (int16_t)-qm_hi(2 * qm_mulss(h->current_q13, turn.sin));
}
