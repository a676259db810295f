/* A PWM period of the drive from every reachable state: no run-time error, no overflow, and the state's bounds hold again.
 *
 * modes: proof_tick TORQUE_MODE TUNING OPEN_LOOP_FUNCTIONING SCOPED LATE EACH EACH_LATE
 * options: -eva-domains equality,symbolic-locations -eva-use-spec estimator_omega,observer_between,fieldweak_between,held_sum,held_along
 *     -eva-subdivide-non-linear-function vd_limit:100,estimator_oldest:100
 *     -inline-calls protection_check_current,drive_is_running,drive_raise,drive_enter,calibration_step,startup_bootstrap,idle_step,qm_abs
 *     -eva-slevel-function drive_tick:200,drive_idle:200,calibration_step:20,drive_zero:1000,lowpass_in_pieces:50,speed_ramp:10
 *     -eva-slevel-function qm_abs:5,qm_beyond:5,qm_clamp:5,qm_limit:5,qm_sub_limited:5,set_bounds:40,largest_ls:40,any_estimator:20,bounds_hold_again:20
 *     -eva-slevel-function estimator_pll:200,lowpass_bounded:50,emf_d_in_pieces:50,emf_q_beside_d:10
 *     -eva-split-return-function qm_beyond:full,lowpass_in_pieces:full,lowpass_bounded:full,emf_d_in_pieces:full */
#include "any.h"
#include "bounds.h"

#include "firmware/control/current_control.c"
#include "firmware/control/transforms.c"

/*@ assigns \result \from sum, sum_max, inv_kfi;
    admit ensures speed: -32767 <= \result <= 32767; */ /* blocks.c, proof_omega: the last two are of one adaptation_apply(), or inv_kfi is 0 */
int16_t estimator_omega(int16_t sum, int16_t sum_max, int16_t inv_kfi);

/*@ requires axes: -emf_dq_max <= emf.d <= emf_dq_max && -emf_dq_max <= emf.q <= emf_dq_max;
    requires turns: -1 <= sign <= 1;
    assigns \result \from sign, emf;
    admit ensures length: -32767 <= \result <= 32767; */ /* circle.c, proof_lowpass: |d| + |q| is at most sqrt(2) times the length */
static int16_t held_sum(int16_t sign, dq_t emf);

/*@ requires axes: -emf_dq_max <= emf.d <= emf_dq_max && -emf_dq_max <= emf.q <= emf_dq_max;
    assigns \result \from emf, ahead;
    admit ensures length: -emf_dq_max <= \result <= emf_dq_max; */ /* emf_q_beside_d(): no part of a vector is longer than it, and emf_dq_max is its length */
static int16_t held_along(dq_t emf, angle_t ahead);

/*@ assigns \result \from a, b, share;
    admit ensures between: a <= \result <= b || b <= \result <= a; */ /* blocks.c, proof_between */
int16_t observer_between(int16_t a, int16_t b, q15_t share);

/*@ requires entry: index <= 16;
    assigns \result \from table[index], table[index + 1], fraction_q16;
    admit ensures between: table[index] <= \result <= table[index + 1] || table[index + 1] <= \result <= table[index]; */ /* blocks.c, proof_between */
int16_t fieldweak_between(const int16_t *table, uint16_t index, uint16_t fraction_q16);

/*@ requires pieces: reference < -erpm_max || -erpm_max <= reference <= erpm_max || erpm_max < reference; */ /* further out is no step outwards */
int16_t speed_ramp(int16_t reference, int16_t target, int16_t step_erpm);

/* In the drive, a call of a block that was proved alone (blocks.c, circle.c) goes through what was proved of it. */
static sincos_t sincos_bounded(angle_t angle);
static q15_t circle_bounded(q15_t x);
static int16_t lowpass_in_pieces(int32_t *y_q16, int16_t x, int16_t k_q16);
static alphabeta_t clarke_bounded(int16_t a_q13, int16_t b_q13);
static alphabeta_t inverse_park_bounded(dq_t x, sincos_t sc);
static int16_t pi_tick_bounded(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit);
static dq_t current_control_bounded(pi_t *pi_d, const pi_gains_t *gains_d, pi_t *pi_q, const pi_gains_t *gains_q,
                                    dq_t ref_q13, dq_t meas_q13, const voltage_circle_t *circle, voltage_q14_t *limit_q);
static void observer_step_bounded(observer_t *o, const observer_params_t *p, uint32_t rho_q32, current_q13_t iq_q13);
static void adaptation_learn_bounded(adaptation_t *a, const adaptation_params_t *p, dq_t emf_q12, voltage_q12_t ri_q12);
#define trig_sincos sincos_bounded
#define trig_circle circle_bounded
#define qm_lowpass lowpass_in_pieces
#define clarke clarke_bounded
#define inverse_park inverse_park_bounded
#define pi_tick pi_tick_bounded
#include "firmware/control/motor_model.c"
#include "firmware/control/estimator.c"
#include "firmware/control/observer.c"
#include "firmware/control/svm.c"
#define current_control current_control_bounded
#define observer_step observer_step_bounded
#define adaptation_learn adaptation_learn_bounded
#include "firmware/drive/limits.c"
static void startup_ramp_turning(drive_t *d, const drive_params_t *p);
#define startup_ramp_from_here startup_ramp_turning
#include "firmware/drive/catch.c"
#include "firmware/drive/held.c"
#include "firmware/drive/model.c"
#include "firmware/drive/modes/bringup.c"
#include "firmware/drive/modes/modes.c"
#include "firmware/drive/protection.c"
#include "firmware/drive/signals.c"
static void signals_check_bounded(drive_t *d, const drive_params_t *p);
static void signals_judge_bounded(drive_t *d, const drive_params_t *p);
#define signals_check signals_check_bounded
#define signals_judge signals_judge_bounded
#include "firmware/drive/schedule.c"
#undef signals_check
#undef signals_judge
#include "firmware/drive/speed.c"
#undef startup_ramp_from_here
#include "firmware/drive/startup.c"
#include "firmware/drive/states.c"
#include "firmware/drive/tick.c"
#undef trig_sincos
#undef trig_circle
#undef qm_lowpass
#undef clarke
#undef inverse_park
#undef pi_tick
#undef current_control
#undef observer_step
#undef adaptation_learn

static drive_t drive;

#include "state.h"

/** blocks.c, proof_trig. */
static sincos_t sincos_bounded(angle_t angle)
{
    sincos_t r = { any(-32767, 32767), any(-32767, 32767) };
    (void)angle;
    return r;
}

/** blocks.c, proof_trig. */
static q15_t circle_bounded(q15_t x)
{
    //@ check input: 0 <= x;
    return any(0, 32767);
}

static int16_t emf_d; /* of this period; the q axis comes after it */

/** Pieces, for the q axis has what d leaves. */
static int16_t emf_d_in_pieces(int32_t *y_q16)
{
    int16_t wide = (int16_t)(emf_dq_max / 8 + 1);
    //@ loop unroll 16;
    for (int16_t k = -8; k < 8; k++) {
        if (k == 7 || any(0, 1)) {
            *y_q16 = any_l(k * wide * 65536l, (k + 1) * wide * 65536l - 1);
            break;
        }
    }
    //@ admit piece: emf_dq_max * -65536 <= *y_q16 <= emf_dq_max * 65536 + 65535;
    emf_d = qm_hi(*y_q16);
    return emf_d;
}

/** |d| + |q| of a vector is at most sqrt(2) times its length. */
static int16_t emf_q_beside_d(int32_t *y_q16)
{
    int16_t most = (int16_t)(emf_dq_max * 1449l / 1024 + 2 - qm_abs(emf_d));
    most = (most < emf_dq_max) ? most : emf_dq_max;
    *y_q16 = any_l(most * -65536l, most * 65536l + 65535);
    return qm_hi(*y_q16);
}

/** circle.c, proof_lowpass: the back-EMF, whose filter follows the speed. */
static int16_t lowpass_bounded(int32_t *y_q16, int16_t x, int16_t k_q16)
{
    const fieldweak_params_t *p = &params.fieldweak;
    //@ admit length_of_the_back_emf: -emf_dq_max <= x <= emf_dq_max;
    //@ check filter: (FIELDWEAK_FILTER_LEAST <= k_q16 && k_q16 % 8 == 0) || k_q16 == p->kfilter_esdq_q16 || k_q16 == p->kfilter_esdq_fw_q16;
    //@ check largest: k_q16 <= p->kfilter_esdq_q16 || k_q16 <= p->kfilter_esdq_fw_q16;
    return (y_q16 == &drive.run.estimator.e_d_q28) ? emf_d_in_pieces(y_q16) : emf_q_beside_d(y_q16);
}

/** y += K (x - y) stays in the range of x, but only because y is near x at its ends: pieces that shrink towards them. */
static int16_t lowpass_in_pieces(int32_t *y_q16, int16_t x, int16_t k_q16)
{
    static const int16_t widths[] = { 0, 4, 20, 84, 340, 1364, 5460, 21844 };
    int16_t low = -32767, high = 32767;
    if (y_q16 == &drive.bus_q31) {
        low = 0;
    } else if (y_q16 != &drive.run.estimator.omega_filtered_q16) {
        return lowpass_bounded(y_q16, x, k_q16);
    }
    //@ check input: low <= x <= high;
    for (int i = 0; i < 8; i++) {
        if (*y_q16 < (low + 1l + widths[i]) * 65536) {
            return qm_lowpass(y_q16, x, k_q16);
        }
        if (*y_q16 >= (high - (int32_t)widths[i]) * 65536) {
            return qm_lowpass(y_q16, x, k_q16);
        }
    }
    return qm_lowpass(y_q16, x, k_q16);
}

static alphabeta_t clarke_bounded(int16_t a_q13, int16_t b_q13)
{
    alphabeta_t r;
    //@ check trip_level: -params.overcurrent_q13 <= a_q13 <= params.overcurrent_q13 && -params.overcurrent_q13 <= b_q13 <= params.overcurrent_q13;
    r = clarke(a_q13, b_q13);
    //@ admit phase_c_is_checked_too: -beta_max <= r.beta <= beta_max;
    return r;
}

static alphabeta_t inverse_park_bounded(dq_t x, sincos_t sc)
{
    alphabeta_t r = inverse_park(x, sc);
    //@ admit vector_is_in_the_circle: -voltage_max <= r.alpha <= voltage_max && -voltage_max <= r.beta <= voltage_max;
    return r;
}

/** blocks.c, proof_pi: the integrator and the limit hold for these inputs. */
static int16_t pi_tick_bounded(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit)
{
    //@ check gains: gains->kp >= 0 && gains->ki >= 0 && gains->kc >= PI_KC_MIN;
    //@ check error: -PI_ERROR_MAX <= err <= PI_ERROR_MAX;
    //@ check limit: 0 <= limit;
    //@ check sum: -SUM_MAX <= pi->sum <= SUM_MAX;
    pi->sum = any_l(-SUM_MAX, SUM_MAX);
    return any((int16_t)-limit, limit);
}

/** circle.c: with the reciprocal of its radius, the result is within the circle. */
static dq_t current_control_bounded(pi_t *pi_d, const pi_gains_t *gains_d, pi_t *pi_q, const pi_gains_t *gains_q,
                                           dq_t ref_q13, dq_t meas_q13, const voltage_circle_t *circle, voltage_q14_t *limit_q)
{
    dq_t v;
    //@ check radius: 0 <= circle->limit_q14 <= radius_max;
    v.d = pi_tick_bounded(pi_d, gains_d, (int16_t)(ref_q13.d - meas_q13.d), circle->vd_most_q14);
    *limit_q = any(0, circle->limit_q14);
    v.q = pi_tick_bounded(pi_q, gains_q, (int16_t)(ref_q13.q - meas_q13.q), *limit_q);
    return v;
}

/** observer.c, proof_observer_step: speed and load stay in their formats for these parameters and this current. */
static void observer_step_bounded(observer_t *o, const observer_params_t *p, uint32_t rho_q32, current_q13_t iq_q13)
{
    int32_t square = qm_mulss(p->fast_q16, p->fast_q16) >> 10;
    int64_t largest = (int64_t)p->innovation_max_erpm * square << p->shift;
    //@ check formats: 1 <= p->shift <= 13 && 32768 <= p->per_current_q16 && 0 < p->load_max <= 8192;
    //@ check angle: 2863 <= p->deltat_q32 <= 16780 && 1999 <= p->per_turn_q12 <= 11719;
    //@ check rate: 0 <= o->rate_q16 <= p->fast_q16 <= RATE_MOST_Q16;
    //@ check innovation: 0 < p->innovation_max_erpm <= 16383 && largest <= 16000 * 4194304;
    //@ check current: -IQ_MAX <= iq_q13 <= IQ_MAX;
    o->omega_q16 = any_l(-32767 * 65536l, 32767 * 65536l);
    o->load_q16 = any_l(p->load_max * -65536l, p->load_max * 65536l);
    o->rho_q32 = rho_q32;
    o->fast_share_q15 = any(0, 32767);
    o->gate_level = ANYU16();
    o->gate_last_erpm = ANY16();
    o->innovation_erpm = any(-16383, 16383);
    o->wrong_steps = ANYU16();
}

/** observer.c, proof_adaptation_learn. */
static void adaptation_learn_bounded(adaptation_t *a, const adaptation_params_t *p, dq_t emf_q12, voltage_q12_t ri_q12)
{
    (void)emf_q12;
    (void)ri_q12;
    //@ check rate: 0 <= p->rate_q16 <= 8192 && 1 <= p->emf_least_q12;
    //@ check limits: -16384 <= p->kfi_least <= 0 <= p->kfi_most <= 16384 && -16384 <= p->rs_least <= 0 <= p->rs_most <= 24576;
    any_adaptation(a);
}

/** No ramp begins with an angle that stands. */
static void startup_ramp_turning(drive_t *d, const drive_params_t *p)
{
    startup_ramp_from_here(d, p);
    //@ check turns: d->run.held.phase <= HELD_TURNS;
}

/** The bounds of the sums are those of so many checks: proof_evidence. */
static void signals_check_bounded(drive_t *d, const drive_params_t *p)
{
    signals_check(d, p);
    //@ check so_many: d->run.evidence.checks <= SIGNALS_CHECKS_END;
    any_evidence(&d->run.evidence);
}

static void signals_judge_bounded(drive_t *d, const drive_params_t *p)
{
    signals_judge(d, p);
    //@ check so_many: d->run.evidence.checks <= SIGNALS_CHECKS_END;
    any_evidence(&d->run.evidence);
}

static void any_state(uint16_t state)
{
    any_drive(state);
    any_estimator(&drive.run.estimator);
    any_control(&drive.run.control);
#if SCOPE
    drive.run.sine.left = ANYU16();
    drive.run.sine.step = ANYU16();
    drive.run.sine.angle = ANYU16();
    drive.run.sine.size_iq_q16 = ANY16();
    drive.run.sine.size_rho_q17 = ANY16();
#endif
    drive.run.fieldweak.trim_q13 = any((int16_t)-params.fieldweak.trim_max_q13, 0);
    any_observer_state(&drive.run.observer);
    any_adaptation(&drive.run.adaptation);
    drive_update_model(&drive.run, &params, any(-32767, 32767), any(-32767, 32767));
}

static drive_samples_t any_samples(void)
{
    drive_samples_t raw;
    raw.i_a = ANY16();
    raw.i_b = ANY16();
    raw.v_bus = ANY16();
    return raw;
}

/** As a number, an address is known to equal itself and nothing else: any use of it is an alarm. */
#define SEALED(x) (*(drive_t **)&(x))

static uint16_t calibrates; /* the calibration has had its sample, and its sums are sealed */

#define ROUND (SLOW_ROUND_STEPS * SLOW_PERIODS)

static uint16_t began = DRIVE_STATE_COUNT; /* the state in which the period began, where a check wants to know it */

/** A start, also from what the last run has left, sees a rotor that turns; a fault is left with the bridge off. In closed loop see startup_ramp_turning(). */
static void starts_turn(void)
{
    uint16_t phase = drive.run.held.phase, state = drive.state, starts = (uint16_t)(began == DRIVE_STOPPED || !may_stand(began));
    //@ check turns: starts == 0 || began == DRIVE_STATE_COUNT || phase <= HELD_TURNS;
    //@ check off: began != DRIVE_FAULT || state == DRIVE_STOPPED || state == DRIVE_CALIBRATE || state == DRIVE_FAULT;
}

static void slow_in(uint16_t slot)
{
    uint16_t seals = calibrates, state = drive.state; /* what a check alone reads, the analyser's memory of calls does not know */
    drive_samples_t raw;
    drive.ticks = (uint16_t)(ROUND * any_u(0, 65536ul / ROUND - 1u) + slot);
    raw = any_samples();
    if (!calibrates) {
        (void)drive_slow(&drive, &params, &raw);
    } else if ((slot & (SLOW_EVERY - 1u)) == 0u) {
        schedule_run(&drive, &params, &raw);
    }
    //@ check sums_stay: seals == 0 || (SEALED(drive.calibration.sum_a) == &drive && SEALED(drive.calibration.sum_b) == &drive);
    //@ check ended: seals == 0 || state == DRIVE_CALIBRATE || drive.state != DRIVE_CALIBRATE;
    bounds_hold_again();
    starts_turn();
}

/** What a tick has left, with the slow work of each slot. */
static void slow(void)
{
    static drive_t left;
    left = drive;
    //@ loop unroll 33;
    for (uint16_t slot = 0; slot < ROUND; slot = (uint16_t)(slot + SLOW_EVERY)) {
        drive = left;
        slow_in(slot);
    }
    drive = left;
    slow_in(1); /* the odd ones are all alike */
}

/** A period: before the slow work, all slots are the same. */
static void tick(void)
{
    drive_samples_t raw = any_samples();
    duties_t duty;
    drive_tick(&drive, &params, &raw, &duty);
    slow();
}

/** Every state but CALIBRATE, every slot. */
void proof_tick(void)
{
    set_bounds();
    //@ loop unroll DRIVE_STATE_COUNT;
    for (uint16_t state = DRIVE_STOPPED; state <= DRIVE_FAULT; state++) {
        any_state(state);
        began = state;
        tick();
    }
}

/** The evidence of so many checks. */
static void evidence_of(signals_evidence_t *e, uint16_t checks)
{
    const int32_t most = 32768l * checks;
    any_evidence(e);
    e->checks = checks;
    e->once.cosine = any_l(-most, most);
    e->once.sine = any_l(-most, most);
    e->twice.cosine = any_l(-most, most);
    e->twice.sine = any_l(-most, most);
    e->size = any_ul(0, (uint32_t)most);
}

static void evidence_is_of(const signals_evidence_t *e, uint16_t checks)
{
    //@ check checks: e->checks == checks;
    //@ check once: -32768 * checks <= e->once.cosine <= 32768 * checks && -32768 * checks <= e->once.sine <= 32768 * checks;
    //@ check twice: -32768 * checks <= e->twice.cosine <= 32768 * checks && -32768 * checks <= e->twice.sine <= 32768 * checks;
    //@ check size: e->size <= 32768 * checks;
}

/** signals.c: a check more, and half of them: the sums keep to what so many checks can make. */
void proof_evidence(void)
{
    signals_evidence_t e;
    set_bounds();
    any_state(DRIVE_CLOSED);
    //@ loop unroll 600;
    for (uint16_t checks = 0; checks <= SIGNALS_CHECKS_END; checks++) {
        evidence_of(&e, checks);
        signals_fade(&e);
        evidence_is_of(&e, (uint16_t)((checks + 1u) / 2u));
        evidence_of(&e, checks);
        signals_gather(&e, &drive, any_u(0, 1));
        evidence_is_of(&e, (uint16_t)(checks + 1u));
    }
}

static drive_t calibrating;

/** CALIBRATE after k samples, with sums that k samples can have; the next sums are those that k + 1 can have. */
static void calibrate_after(uint16_t k)
{
    drive_samples_t raw = any_samples();
    duties_t duty;
    drive = calibrating;
    drive.periods = k;
    drive.calibration.sum_a = any_l(-32768l * k, 32767l * k);
    drive.calibration.sum_b = any_l(-32768l * k, 32767l * k);
    drive_tick(&drive, &params, &raw, &duty);
    drive_idle(&drive, &params, &raw);
    //@ check off: drive.state == DRIVE_CALIBRATE || drive.state == DRIVE_STOPPED || drive.state == DRIVE_FAULT;
    //@ check sum_a: -32768 * (k + 1) <= drive.calibration.sum_a <= 32767 * (k + 1);
    //@ check sum_b: -32768 * (k + 1) <= drive.calibration.sum_b <= 32767 * (k + 1);
    //@ check ends: k < 1023 || drive.state != DRIVE_CALIBRATE;
    drive.periods = ANYU16();
    SEALED(drive.calibration.sum_a) = &drive;
    SEALED(drive.calibration.sum_b) = &drive;
    calibrates = 1;
    slow(); /* every k leaves the same to it, but for the last */
}

/** The calibration, sample by sample. */
void proof_tick_calibrate(void)
{
    set_bounds();
    any_state(DRIVE_CALIBRATE);
    calibrating = drive;
    calibrating.command.clear_fault = 0; /* in a fault: see proof_tick_recalibrate */
    //@ loop unroll 1024;
    for (uint16_t k = 0; k < 1u << CALIBRATION_LOG2; k++) {
        calibrate_after(k);
    }
}

/** A cleared fault before the first calibration starts it anew. */
void proof_tick_recalibrate(void)
{
    set_bounds();
    any_state(DRIVE_FAULT);
    drive.command.clear_fault = 1;
    drive.calibration.done = 0;
    tick();
    //@ check anew: drive.state == DRIVE_CALIBRATE && drive.periods == 0 && drive.calibration.sum_a == 0 && drive.calibration.sum_b == 0;
}

/** drive_init() and drive_start() establish the bounds. */
void proof_start(void)
{
    set_bounds();
    drive_init(&drive, &params);
    bounds_hold_again();
    any_state(DRIVE_STOPPED);
    drive_start(&drive, &params, any(0, 1) ? 1 : -1);
    bounds_hold_again();
}

/** The reasons why the output is limited, for every state. */
void proof_limits_reasons(void)
{
    set_bounds();
    //@ loop unroll DRIVE_STATE_COUNT;
    for (uint16_t state = DRIVE_CALIBRATE; state < DRIVE_STATE_COUNT; state++) {
        uint16_t reasons;
        any_state(state);
        reasons = limits_reasons(&drive, &params);
        //@ check known: reasons <= 1023;
    }
}
