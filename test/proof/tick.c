/* A PWM period of the drive from every reachable state: no run-time error, no overflow, and the state's bounds hold again. */
#include "any.h"

#include "control/transforms.h"
#include "pieces.h"

static inline int16_t lowpass_in_pieces(int32_t *y_q16, int16_t x, int16_t k_q16);
static inline alphabeta_t clarke_bounded(int16_t a_q13, int16_t b_q13);
static inline alphabeta_t inverse_park_bounded(dq_t x, sincos_t sc);
static inline int16_t speed_ramp_in_pieces(int16_t reference, int16_t target, int16_t step_erpm);

/* In the drive, a call of a block that was proved alone (blocks.c, circle.c) goes through what was proved of it. */
#include "control/pi.h"
#include "control/speed_ramp.h"
static inline int16_t pi_tick_bounded(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit);
#define trig_sincos sincos_in_pieces
#define trig_circle circle_in_pieces
#define qm_lowpass lowpass_in_pieces
#define clarke clarke_bounded
#define inverse_park inverse_park_bounded
#define speed_ramp speed_ramp_in_pieces
#define pi_tick pi_tick_bounded
#include "control/current_control.h"
static inline dq_t current_control_bounded(pi_t *pi_d, const pi_gains_t *gains_d, pi_t *pi_q, const pi_gains_t *gains_q,
                                           dq_t ref_q13, dq_t meas_q13, const voltage_circle_t *circle, voltage_q14_t *limit_q);
#define current_control current_control_bounded
#include "drive/drive_tick.h"
#undef trig_sincos
#undef trig_circle
#undef qm_lowpass
#undef clarke
#undef inverse_park
#undef speed_ramp
#undef pi_tick
#undef current_control

#include "bounds.h"

static drive_t drive;

/** y += K (x - y) stays in the range of x, but only because y is near x at its ends: pieces that shrink towards them. */
static inline int16_t lowpass_in_pieces(int32_t *y_q16, int16_t x, int16_t k_q16)
{
    static const int16_t widths[] = { 0, 4, 20, 84, 340, 1364, 5460, 21844 };
    int16_t low = -32767, high = 32767;
    if (y_q16 == &drive.bus_q31) {
        low = 0;
    } else if (y_q16 != &drive.estimator.omega_filtered_q16) {
        low = (int16_t)-emf_dq_max;
        high = emf_dq_max;
        //@ admit length_of_the_back_emf: low <= x <= high;
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

static inline alphabeta_t clarke_bounded(int16_t a_q13, int16_t b_q13)
{
    alphabeta_t r;
    //@ check trip_level: -params.overcurrent_q13 <= a_q13 <= params.overcurrent_q13 && -params.overcurrent_q13 <= b_q13 <= params.overcurrent_q13;
    r = clarke(a_q13, b_q13);
    //@ admit phase_c_is_checked_too: -beta_max <= r.beta <= beta_max;
    return r;
}

static inline alphabeta_t inverse_park_bounded(dq_t x, sincos_t sc)
{
    alphabeta_t r = inverse_park(x, sc);
    //@ admit vector_is_in_the_circle: -voltage_max <= r.alpha <= voltage_max && -voltage_max <= r.beta <= voltage_max;
    return r;
}

/** Pieces: nearer than two steps to the end of the range, there is no step outwards. */
static inline int16_t speed_ramp_in_pieces(int16_t reference, int16_t target, int16_t step_erpm)
{
    if (reference > erpm_max - 2 * step_erpm) {
        return speed_ramp(reference, target, step_erpm);
    }
    if (reference < 2 * step_erpm - erpm_max) {
        return speed_ramp(reference, target, step_erpm);
    }
    if (reference < 0) {
        return speed_ramp(reference, target, step_erpm);
    }
    return speed_ramp(reference, target, step_erpm);
}

/** blocks.c, proof_pi: the integrator and the limit hold for these inputs. */
static inline int16_t pi_tick_bounded(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit)
{
    //@ check gains: gains->kp >= 0 && gains->ki >= 0 && gains->kc >= PI_KC_MIN;
    //@ check error: -PI_ERROR_MAX <= err <= PI_ERROR_MAX;
    //@ check limit: 0 <= limit;
    //@ check sum: -SUM_MAX <= pi->sum <= SUM_MAX;
    pi->sum = any_l(-SUM_MAX, SUM_MAX);
    return any((int16_t)-limit, limit);
}

/** circle.c: with the reciprocal of its radius, the result is within the circle. */
static inline dq_t current_control_bounded(pi_t *pi_d, const pi_gains_t *gains_d, pi_t *pi_q, const pi_gains_t *gains_q,
                                           dq_t ref_q13, dq_t meas_q13, const voltage_circle_t *circle, voltage_q14_t *limit_q)
{
    dq_t v;
    //@ check radius: 0 <= circle->limit_q14 <= radius_max;
    v.d = pi_tick_bounded(pi_d, gains_d, (int16_t)(ref_q13.d - meas_q13.d), vd_limit(circle));
    *limit_q = any(0, circle->limit_q14);
    v.q = pi_tick_bounded(pi_q, gains_q, (int16_t)(ref_q13.q - meas_q13.q), *limit_q);
    return v;
}

/** Any value that the tick can leave behind, for each member; what depends on the state is set by its caller. */
static void any_drive(uint16_t state, uint16_t slot)
{
    drive.command.run = any(0, 1);
    drive.command.clear_fault = any(0, 1);
    drive.command.target_erpm = any((int16_t)-erpm_max, erpm_max);
    drive.state = state;
    drive.fault = any_u(0, FAULT_COUNT - 1);
    drive.ticks = (uint16_t)(8u * any_u(0, 8191) + slot);
    drive.timer = ANYU16();
    drive.slots = ANYU16();
    drive.direction = any(0, 1) ? 1 : -1;
    drive.calibrated = any(0, 1);
    drive.offset_sum_a = 0;
    drive.offset_sum_b = 0;
    drive.offset_a_q13 = any((int16_t)-params.offset_max_q13, params.offset_max_q13);
    drive.offset_b_q13 = any((int16_t)-params.offset_max_q13, params.offset_max_q13);
    drive.bus_q31 = any_l(0, INT32_MAX);
    drive.circle.limit_q14 = any(0, radius_max);
    drive.circle.reciprocal = voltage_circle_reciprocal(drive.circle.limit_q14);
    drive.duty_per_volt_q16 = any_u(0, qm_divud(params.duty_per_volt_numerator, (uint16_t)((uint16_t)params.bus_under_q15 << 1)));
    drive.angle = ANYU16();
    drive.frame = sincos_in_pieces(drive.angle);
    drive.forced.speed_q10 = any_l(0, params.forced.end_speed_q10);
    drive.forced.angle_q32 = any_ul(0, UINT32_MAX);
    drive.stall_count = any_u(0, params.stall_slots);
    drive.lost_count = any_u(0, params.lost_lock_slots);
}

static void any_estimator(estimator_t *e)
{
    for (int i = 0; i < ESTIMATOR_HISTORY; i++) {
        e->history_q14[i].alpha = any((int16_t)-alpha_max, alpha_max);
        e->history_q14[i].beta = any((int16_t)-beta_max, beta_max);
    }
    e->newest = any_u(0, ESTIMATOR_HISTORY - 1);
    e->v_last_q13.alpha = any((int16_t)-voltage_max, voltage_max);
    e->v_last_q13.beta = any((int16_t)-voltage_max, voltage_max);
    e->v_before_q13.alpha = any((int16_t)-voltage_max, voltage_max);
    e->v_before_q13.beta = any((int16_t)-voltage_max, voltage_max);
    e->e_q13.alpha = ANY16();
    e->e_q13.beta = ANY16();
    e->e_d_q28 = any_l(emf_dq_max * -65536l, emf_dq_max * 65536l + 65535l);
    e->e_q_q28 = any_l(emf_dq_max * -65536l, emf_dq_max * 65536l + 65535l);
    e->omega_erpm = any(-32767, 32767);
    e->omega_filtered_q16 = any_l(-32767 * 65536l, INT32_MAX);
    e->rho_q32 = any_ul(0, UINT32_MAX);
    e->half_step_q16_rad = qm_mulhi(e->omega_erpm, params.estimator.half_step_q16_rad);
}

static void any_control(drive_control_t *c)
{
    c->reference_erpm = any((int16_t)-erpm_max, erpm_max);
    c->tuning_low = ANYU16();
    c->ref_q13.d = any((int16_t)-current_max, current_max);
    c->ref_q13.q = any((int16_t)-current_max, current_max);
    c->iq_limit_q13 = any(0, current_max);
    c->brake_limit_q13 = any(0, current_max);
    c->handover_q13 = any((int16_t)-current_max, current_max);
    c->handover_offset = ANY16();
    c->i_q13.d = ANY16();
    c->i_q13.q = ANY16();
    c->v_q14.d = any((int16_t)-(2 * voltage_max), 2 * voltage_max);
    c->v_q14.q = any((int16_t)-(2 * voltage_max), 2 * voltage_max);
    c->vq_limit_q14 = any(0, radius_max);
    c->pi_d.sum = any_l(-SUM_MAX, SUM_MAX);
    c->pi_q.sum = any_l(-SUM_MAX, SUM_MAX);
    c->pi_speed.sum = any_l(-SUM_MAX, SUM_MAX);
}

static void bounds_hold_again(void)
{
    const estimator_t *e = &drive.estimator;
    const drive_control_t *c = &drive.control;
    //@ check state: drive.state <= DRIVE_FAULT && drive.fault < FAULT_COUNT;
    //@ check direction: drive.direction == 1 || drive.direction == -1;
    //@ check command: 0 <= drive.command.run <= 1 && -erpm_max <= drive.command.target_erpm <= erpm_max;
    //@ check offset_a: -params.offset_max_q13 <= drive.offset_a_q13 <= params.offset_max_q13;
    //@ check offset_b: -params.offset_max_q13 <= drive.offset_b_q13 <= params.offset_max_q13;
    //@ check bus: 0 <= drive.bus_q31;
    //@ check circle: 0 <= drive.circle.limit_q14 <= radius_max;
    //@ check forced: 0 <= drive.forced.speed_q10 <= params.forced.end_speed_q10;
    //@ check newest: e->newest < ESTIMATOR_HISTORY;
    //@ check history_alpha: \forall integer i; 0 <= i < ESTIMATOR_HISTORY ==> -alpha_max <= e->history_q14[i].alpha <= alpha_max;
    //@ check history_beta: \forall integer i; 0 <= i < ESTIMATOR_HISTORY ==> -beta_max <= e->history_q14[i].beta <= beta_max;
    //@ check v_last_alpha: -voltage_max <= e->v_last_q13.alpha <= voltage_max;
    //@ check v_last_beta: -voltage_max <= e->v_last_q13.beta <= voltage_max;
    //@ check v_before_alpha: -voltage_max <= e->v_before_q13.alpha <= voltage_max;
    //@ check v_before_beta: -voltage_max <= e->v_before_q13.beta <= voltage_max;
    //@ check emf_d: emf_dq_max * -65536 <= e->e_d_q28 <= emf_dq_max * 65536 + 65535;
    //@ check emf_q: emf_dq_max * -65536 <= e->e_q_q28 <= emf_dq_max * 65536 + 65535;
    //@ check omega: -32767 <= e->omega_erpm;
    //@ check omega_filtered: -32767 * 65536 <= e->omega_filtered_q16;
    //@ check reference: -erpm_max <= c->reference_erpm <= erpm_max;
    //@ check ref_d: -current_max <= c->ref_q13.d <= current_max;
    //@ check ref_q: -current_max <= c->ref_q13.q <= current_max;
    //@ check iq_limit: 0 <= c->iq_limit_q13 <= current_max;
    //@ check brake_limit: 0 <= c->brake_limit_q13 <= current_max;
    //@ check handover: -current_max <= c->handover_q13 <= current_max;
    //@ check v_d: -2 * voltage_max <= c->v_q14.d <= 2 * voltage_max;
    //@ check v_q: -2 * voltage_max <= c->v_q14.q <= 2 * voltage_max;
    //@ check vq_limit: 0 <= c->vq_limit_q14 <= radius_max;
    //@ check sum_d: -SUM_MAX <= c->pi_d.sum <= SUM_MAX;
    //@ check sum_q: -SUM_MAX <= c->pi_q.sum <= SUM_MAX;
    //@ check sum_speed: -SUM_MAX <= c->pi_speed.sum <= SUM_MAX;
    //@ check trim: -params.fieldweak.trim_max_q13 <= drive.fieldweak.trim_q13 <= 0;
    //@ check table: drive.fieldweak.index < FIELDWEAK_ENTRIES;
    //@ check counts: drive.stall_count <= params.stall_slots + 1 && drive.lost_count <= params.lost_lock_slots + 1;
}

/** A tick in the given state and slot. */
static void tick_in(uint16_t state, uint16_t slot)
{
    drive_samples_t raw;
    any_drive(state, slot);
    any_estimator(&drive.estimator);
    any_control(&drive.control);
    drive.fieldweak.trim_q13 = any((int16_t)-params.fieldweak.trim_max_q13, 0);
    fieldweak_tick(&drive.fieldweak, &params.fieldweak, &drive.tuning, any((int16_t)-erpm_max, erpm_max));
    raw.i_a = ANY16();
    raw.i_b = ANY16();
    raw.v_bus = ANY16();
    raw.pot = ANY16();
    (void)drive_tick(&drive, &params, &raw);
    bounds_hold_again();
}

void proof_tick(void)
{
    set_bounds();
    for (uint16_t state = DRIVE_STOPPED; state <= DRIVE_FAULT; state++) {
        for (uint16_t slot = 0; slot < SLOTS; slot++) {
            tick_in(state, slot);
        }
    }
}
