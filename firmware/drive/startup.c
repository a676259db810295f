/* The start: average the current offsets, charge the drivers, take the rotor along, accelerate it by the forced angle, hand over to the estimator. */
#include "drive/startup.h"

#include "control/tuned.h"
#include "drive/drive.h"
#include "drive/held.h"
#include "drive/protection.h"

drive_state_t calibration_step(drive_t *d, const drive_params_t *p, int16_t i_a, int16_t i_b)
{
    calibration_t *c = &d->calibration;
    c->sum_a += i_a;
    c->sum_b += i_b;
    d->periods++;
    if (d->periods == (1u << CALIBRATION_LOG2)) {
        int16_t a_q13 = qm_mulhi((int16_t)(c->sum_a >> CALIBRATION_LOG2), p->kcurr_a);
        int16_t b_q13 = qm_mulhi((int16_t)(c->sum_b >> CALIBRATION_LOG2), p->kcurr_b);
        if (qm_beyond(a_q13, p->offset_max_q13) || qm_beyond(b_q13, p->offset_max_q13)) {
            drive_raise(d, FAULT_OFFSET);
        } else {
            c->offset_a_q13 = a_q13;
            c->offset_b_q13 = b_q13;
            SELFTEST_KEEP(d, offset_a, a_q13);
            SELFTEST_KEEP(d, offset_b, b_q13);
            c->done = 1;
            return DRIVE_STOPPED;
        }
    }
    return DRIVE_CALIBRATE;
}

void calibration_restart(calibration_t *c)
{
    c->sum_a = 0;
    c->sum_b = 0;
}

drive_state_t startup_bootstrap(drive_t *d, const drive_params_t *p)
{
    (void)protection_check_current(d, p); /* a fault that it raises keeps every state out */
    d->periods++;
    if (!d->command.run) {
        return DRIVE_STOPPED;
    }
    return (d->periods >= p->bootstrap_periods) ? DRIVE_ALIGN : DRIVE_BOOTSTRAP;
}

void startup_ramp_from_here(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    drive_control_t *c = &run->control;
    angle_t quarter = (angle_t)along_direction(d, 0x4000), estimated = estimator_next_angle(&run->estimator);
    angle_t forced = (angle_t)(estimated - quarter);
    dq_t v = c->v_q14;
    held_forget(&run->held); /* the ramp's estimator must see the rotor */
    run->handover.agreed_steps = 0;
    run->handover.ahead_erpm = 0;
    run->handover.offset = 0;
    run->handover.id_q13 = 0;
    c->flux_brake_q13 = 0;
    d->forced.speed_q10 = qm_mulss(along_direction(d, run->estimator.omega_erpm), p->estimator.deltat_q32) >> 6;
    d->forced.angle_q32 = (uint32_t)forced << 16;
    d->forced.increase_q10 = p->forced.increase_rate_q10;
    c->v_q14.d = along_direction(d, (int16_t)-v.q); /* the same vector in a frame a quarter turn behind */
    c->v_q14.q = along_direction(d, v.d);
    c->ref_q13.d = 0;
    c->ref_q13.q = along_direction(d, p->open_loop_q13);
    handover_preset(d, p, forced);
    handover_enter(&run->handover, START_RAMP);
    drive_enter(d, DRIVE_RAMP);
}

/** A turn of ALIGN is over: its mean, and the rise to it. */
static void align_turn_ends(align_t *a)
{
    uint16_t mean = ((uint16_t)(a->sum_q14 >> 16) < a->steps) ? qm_divud(a->sum_q14, a->steps) : 0u;
    int16_t rise = (int16_t)((int16_t)(mean & 0x7FFFu) - a->mean_q14); /* the mean of positive words */
    if (a->turns == 1u) {                                              /* the first turn rose from nothing */
        a->least_q14 = INT16_MAX;
        a->second_q14 = INT16_MAX;
    }
    a->second_q14 = qm_clamp(rise, a->least_q14, a->second_q14);
    a->least_q14 = (rise < a->least_q14) ? rise : a->least_q14;
    a->mean_q14 = (int16_t)(mean & 0x7FFFu);
    a->turns++;
    a->sum_q14 = 0;
    a->steps = 0;
}

/** A step of the measure of R. */
static void align_measure(drive_t *d)
{
    align_t *a = &d->run.align;
    angle_t turned = (angle_t)((d->direction > 0) ? d->angle : 65536ul - d->angle);
    int16_t v = along_direction(d, d->run.control.v_q14.q);
    if (turned < a->turned) {
        align_turn_ends(a);
    }
    a->turned = turned;
    a->steps++;
    if (v > 0) { /* before the first period with the law there is neither voltage nor limit */
        a->sum_q14 += (uint16_t)v;
        a->is_limited |= (uint16_t)(v >= d->run.control.vq_limit_q14);
    }
}

/** All turns are over: R of the estimator follows, within the bounds of what may be learnt. */
static void align_teaches(drive_run_t *run, const drive_params_t *p)
{
    align_t *a = &run->align;
    uint16_t header = (uint16_t)p->align_rise_q14, rise, off;
    align_turn_ends(a);
    rise = (uint16_t)a->second_q14;
    if (header == 0u || a->is_limited || a->turns < PARAM_ALIGN_TURNS || a->second_q14 <= 0) {
        return;
    }
    off = (uint16_t)((rise < header) ? header - rise : rise - header);
    off = (uint16_t)((off < header) ? qm_share(off, header) : INT16_MAX);
    run->adaptation.rs_q31 = qm_clamp_hi((int32_t)((rise < header) ? -(int16_t)off : (int16_t)off) * 65536, p->adaptation.rs_least, p->adaptation.rs_most);
}

void startup_align(drive_t *d, const drive_params_t *p)
{
    int16_t current = p->open_loop_q13;
    d->periods = (uint16_t)(d->periods + SLOW_PERIODS);
    if (d->periods < p->align_periods) {
        align_measure(d);
        current = (int16_t)(qm_muluu(d->periods, p->align_rate_q12) >> 12);
    } else {
        align_teaches(&d->run, p);
        d->forced.increase_q10 = p->forced.increase_rate_q10;
        handover_enter(&d->run.handover, START_RAMP);
        drive_enter(d, DRIVE_RAMP);
    }
    d->run.control.ref_q13.q = along_direction(d, current);
}

/* ---- The hand-over from the forced angle to the estimator's: the decision, the change of frame, what decays after it, and the observer's step in between ---- */

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
    ahead = qm_less(seen, forced);
    h->ahead_erpm = (int16_t)(h->ahead_erpm + ((ahead - h->ahead_erpm) >> HANDOVER_MEAN_SHIFT));
    if (!at_end && forced < p->early_erpm) { /* the two may be one speed, which is counted down */
        return;
    }
    most = (int16_t)(forced >> (handover_agrees(h) ? 1 : 2));
    d->periods = (uint16_t)(at_end ? d->periods + SLOW_PERIODS : 0);
    h->agreed_steps = (uint16_t)((qm_abs(ahead) < most && (at_end || qm_abs(h->ahead_erpm) < most >> 1)) ? h->agreed_steps + 1u : 0u);
    if ((at_end || h->agreed_steps != 0u) && qm_beyond(estimator_emf(&d->run.estimator).d, p->adaptation.emf_least_q12)) {
        model_learn_flux(&d->run, p);
    }
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
        observer_step(&run->observer, &p->observer, mode_observed(run), (int16_t)(salient_torque(run, c->i_q13.q) - mode_profile_current(run)));
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
