/* The speed controller: the ramped reference, the observed speed and the observed load give the q current. */
#include "drive/speed.h"

#include "drive/drive.h"
#include "drive/limits.h"
#include "drive/protection.h"

speed_erpm_t speed_ramp(speed_erpm_t reference, speed_erpm_t target, int16_t step_erpm)
{
    const int32_t left = (int32_t)target - reference, near = 2 * (int32_t)step_erpm;
    if (left > -near && left < near) {
        return target;
    }
    return (int16_t)((left > 0) ? reference + step_erpm : reference - step_erpm);
}

/** 1 while the motor is near enough to the reference, on the side of the target: field weakening is indexed by it, so it must stay true. */
static int16_t reference_may_move(const drive_t *d, const drive_params_t *p, speed_erpm_t target)
{
    const speed_erpm_t reference = d->run.control.reference_erpm;
    int16_t ahead = qm_sub_limited(estimator_speed(&d->run.estimator), reference); /* ramp_hold_erpm is below half the format */
    if (target < reference) {
        ahead = (int16_t)-ahead;
    }
    return (int16_t)(ahead > -p->ramp_hold_erpm);
}

int32_t reference_slope(const drive_params_t *p, speed_erpm_t reference, speed_erpm_t target)
{
    return ((reference < 0) ? target > reference : target < reference) ? p->speed_decel_q16 : p->speed_ramp_q16;
}

void reference_step(drive_t *d, const drive_params_t *p, speed_erpm_t target, int32_t step_q16)
{
    drive_control_t *c = &d->run.control;
    int32_t step = step_q16 + (int32_t)c->ramp_q16;
    c->ramp_q16 = (uint16_t)step;
    c->ramp_waits = 0;
    if (c->reference_erpm == target) {
        return;
    }
    if (reference_may_move(d, p, target)) {
        c->reference_erpm = speed_ramp(c->reference_erpm, target, qm_hi(step));
    } else {
        c->ramp_waits = 1;
    }
}

#define SPEED_TRIM_HALF (INT32_C(1) << (SPEED_TRIM_SHIFT - 1))

void speed_schedule(drive_run_t *run, const drive_params_t *p)
{
    observer_t *o = &run->observer;
    int16_t gain, reference = qm_abs(run->control.reference_erpm), speed = qm_abs(observer_speed(o));
    observer_schedule(o, &p->observer, (speed > reference) ? speed : reference, (int16_t)(run->control.ref_q13.q - mode_profile_current(run)));
    gain = observer_between(p->speed_kp_q13, p->speed_kp_fast_q13, o->fast_share_q15);
    run->control.speed_kp_q13 = observer_between(0, gain, observer_twice(o->share_q15)); /* at low speed a light rotor needs it more than the rates */
}

/** No integral for the load: its estimate never winds up, for it is made from the current that flows. The trim takes what an estimate leaves whose innovations
 *  are not as large to either side. @param target_erpm speed to be held @return q current within iq_limit_q13, with 13 fraction bits */
static int32_t speed_current_q26(const drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm)
{
    const drive_control_t *c = &run->control;
    int32_t limit_q26 = qm_mulss(c->iq_limit_q13, 8192);
    int32_t torque_q26 = qm_mulss(qm_sub_limited(target_erpm, observer_speed(&run->observer)), c->speed_kp_q13)
                         + observer_load_q26(&run->observer, &p->observer) + c->iq_trim_q26 + mode_profile_current_q26(run);
    int32_t iq_q26 = salient_current_q26(run, torque_q26);
    if (iq_q26 > limit_q26) {
        return limit_q26;
    }
    return (iq_q26 < -limit_q26) ? -limit_q26 : iq_q26;
}

current_q13_t speed_current(const drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm)
{
    return (int16_t)((speed_current_q26(run, p, target_erpm) + 4096) >> 13);
}

uint16_t speed_swings(const drive_run_t *run)
{
    return (uint16_t)(run->control.swing_steps > 3u * SPEED_SWING_STEPS);
}

/** Takes a step of the trim into the memory of swings. @param swings 1: the error is as large as a swing's */
static void speed_remember_swing(drive_control_t *c, int16_t error, uint16_t swings)
{
    if (swings && (c->swing_steps & SPEED_SWING_MASK) == 0u && (error ^ c->swung_erpm) < 0) {
        c->swung_erpm = error;
        c->swing_steps = (uint16_t)((c->swing_steps < 4u * SPEED_SWING_STEPS) ? c->swing_steps + SPEED_SWING_STEPS : c->swing_steps);
    } else if (c->swing_steps != 0u) {
        c->swing_steps--;
    } else { /* as a rule */
    }
}

/** 1 where nothing changes fast and no limit is reached. */
static uint16_t speed_is_calm(const drive_run_t *run, current_q13_t iq_q13)
{
    const drive_control_t *c = &run->control;
    return (uint16_t)(observer_gate_is_closed(&run->observer) && qm_abs(iq_q13) < c->iq_limit_q13 && qm_abs(c->v_q14.q) < c->vq_limit_q14);
}

/** 1 where the observer's load moves against the error by itself: while a load grows, the error is the observer's. */
static uint16_t speed_load_moves_against(const drive_run_t *run, int16_t error)
{
    const speed_erpm_t seen = estimator_speed(&run->estimator), speed = observer_speed(&run->observer);
    return (uint16_t)((error > 0) ? seen < speed : seen > speed);
}

void speed_trim(drive_run_t *run, const drive_params_t *p, speed_erpm_t before_erpm, current_q13_t iq_q13)
{
    drive_control_t *c = &run->control;
    const uint16_t swings = speed_swings(run);
    const int16_t error = qm_sub_limited(c->reference_erpm, swings ? estimator_speed(&run->estimator) : observer_speed(&run->observer));
    const int16_t most_q10 = (int16_t)(p->current_max_q13 >> (3 + SPEED_TRIM_MOST_SHIFT));
    int16_t before = qm_abs(before_erpm);
    int32_t trim_q26 = c->iq_trim_q26;
    speed_remember_swing(c, error, qm_beyond(error, before >> SPEED_SWING_SHIFT));
    if (c->reference_erpm != before_erpm || (!swings && (qm_beyond(error, before >> SPEED_TRIM_ERROR_SHIFT) || !speed_is_calm(run, iq_q13)))) {
        trim_q26 -= trim_q26 >> SPEED_TRIM_LEAK_SHIFT;
    } else if (swings || !speed_load_moves_against(run, error)) {
        trim_q26 += (qm_mulss(error, swings ? p->speed_kp_q13 : c->speed_kp_q13) + SPEED_TRIM_HALF) >> SPEED_TRIM_SHIFT;
    } else { /* it waits */
    }
    c->iq_trim_q26 = qm_clamp_hi(trim_q26, (int16_t)-most_q10, most_q10);
}

current_q13_t speed_current_step(drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm)
{
    int32_t iq_q26 = speed_current_q26(run, p, target_erpm) + run->control.iq_rest_q26;
    run->control.iq_rest_q26 = (int16_t)(iq_q26 & 8191);
    return (int16_t)(iq_q26 >> 13);
}

void speed_reference_step(drive_t *d, const drive_params_t *p)
{
    if (!mode_reference_step(d, p)) {
        speed_erpm_t target = mode_speed_target(d, p);
        reference_step(d, p, target, reference_slope(p, d->run.control.reference_erpm, target));
    }
}

void speed_follow(drive_run_t *run, const drive_params_t *p)
{
    speed_schedule(run, p);
    mode_profile_follow(run, p);
    run->control.sample_shift_q13 = qm_mulhi(observer_speed(&run->observer), p->sample_shift_q16);
}

/** 1 while the target lies in the other direction. */
static uint16_t speed_is_to_turn(const drive_t *d)
{
    return (uint16_t)((d->command.target_erpm ^ d->direction) < 0);
}

/** 1 when a stop has come to its end: the reference below the minimum speed and the rotor near it, for what the observer does not see of an
 *  unloaded motor's current can hold it just above. */
static uint16_t speed_has_stopped(const drive_t *d, const drive_params_t *p)
{
    return (uint16_t)(qm_abs(observer_speed(&d->run.observer)) < p->minimum_erpm + (p->minimum_erpm >> 1)
                      && qm_abs(d->run.control.reference_erpm) < p->minimum_erpm);
}

/** A stop goes on as a run, from the rotor's speed. What drove the rotor in the observer's eyes was its inertia, if there is more of it than the
 *  header says: it is forgotten, or the braking would go on for a while. */
static void speed_go_on(drive_t *d)
{
    observer_t *o = &d->run.observer;
    d->run.control.reference_erpm = observer_speed(o);
    if (along_direction(d, qm_hi(o->load_q16)) < 0) {
        o->load_q16 = 0;
    }
    drive_enter(d, DRIVE_CLOSED);
}

/** Where a requested stop leads to at this moment. */
static drive_state_t speed_stop_leads_to(const drive_t *d, const drive_params_t *p)
{
    if ((STOP_MODE) == STOP_COAST) {
        return DRIVE_STOPPED;
    }
    if ((STOP_MODE) == STOP_SHORT && qm_abs(observer_speed(&d->run.observer)) < (int16_t)PARAM_BRAKE_COUNTS) {
        return DRIVE_BRAKE;
    }
    return (d->state == (uint16_t)DRIVE_STOPPING && speed_has_stopped(d, p)) ? DRIVE_STOPPED : DRIVE_STOPPING;
}

void speed_choose_state(drive_t *d, const drive_params_t *p)
{
    uint16_t stops = (uint16_t)(d->state == (uint16_t)DRIVE_STOPPING), other = speed_is_to_turn(d);
    drive_state_t next = (drive_state_t)d->state;
    if (!d->command.run) {
        next = speed_stop_leads_to(d, p);
    } else if (other) {
        next = DRIVE_STOPPING;
    } else if (stops) {
        speed_go_on(d);
        return;
    } else { /* it runs */
    }
    if ((uint16_t)next != d->state) {
        drive_enter(d, next);
    }
}

#define BRAKE_STANDS_Q13 64 /* four steps of the converter */
#define BRAKE_STANDS_PERIODS PARAM_PERIODS(0.02F)

drive_state_t speed_brake_step(drive_t *d, const drive_params_t *p)
{
    alphabeta_t i = clarke(d->phases_q13.a, d->phases_q13.b);
    d->run.control.i_q13.d = (int16_t)(i.alpha >> 1); /* no frame: its length is I2t's */
    d->run.control.i_q13.q = (int16_t)(i.beta >> 1);
    d->periods++;
    if (protection_check_current(d, p)) {
        return DRIVE_FAULT;
    }
    if (qm_beyond(d->phases_q13.a, BRAKE_STANDS_Q13) || qm_beyond(d->phases_q13.b, BRAKE_STANDS_Q13)) {
        d->periods = 1;
    }
    return (d->periods > BRAKE_STANDS_PERIODS) ? DRIVE_STOPPED : DRIVE_BRAKE;
}

/* wcet: speed_turn_round/drive_set_direction excludes model_update */
void speed_turn_round(drive_t *d, const drive_params_t *p)
{
    if (d->command.run && speed_is_to_turn(d) && speed_has_stopped(d, p)) {
        drive_set_direction(d, (int16_t)-d->direction);
        startup_ramp_from_here(d, p);
    }
}

void speed_trim_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    if (!mode_commands_current(d)) {
        speed_trim(&d->run, p, c->trim_reference_erpm, c->ref_q13.q);
    }
    c->trim_reference_erpm = c->reference_erpm;
}

void speed_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    speed_erpm_t speed = observer_speed(&d->run.observer);
    current_q13_t iq_q13;
    mode_profile_step(d, p);
    if (!mode_current_step(d, p, &iq_q13)) {
        speed_reference_step(d, p);
        iq_q13 = speed_current_step(&d->run, p, c->reference_erpm);
    }
    c->ref_q13.q = limits_apply_braking(c, speed, iq_q13);
}
