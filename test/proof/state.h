/* The drive's state: every value that a period can leave behind, and the check that it is left behind again.
 *
 * The including file names the object `drive`. What is not listed here is bounded by its type. */
#ifndef PROOF_STATE_H
#define PROOF_STATE_H

#include "any.h"
#include "bounds.h"

#define DEAD_MOST 120 /* duty counts: blocks.c, proof_dead_time */

/** A sum of so many innovations times a pointer is at most this: proof_evidence. */
#define EVIDENCE_MOST (32768l * (SIGNALS_CHECKS_END + 1))

static void any_evidence(signals_evidence_t *e)
{
    e->once.cosine = any_l(-EVIDENCE_MOST, EVIDENCE_MOST);
    e->once.sine = any_l(-EVIDENCE_MOST, EVIDENCE_MOST);
    e->twice.cosine = any_l(-EVIDENCE_MOST, EVIDENCE_MOST);
    e->twice.sine = any_l(-EVIDENCE_MOST, EVIDENCE_MOST);
    e->size = any_ul(0, EVIDENCE_MOST);
    e->checks = any_u(0, SIGNALS_CHECKS_END);
    e->unexplained = any_u(0, SIGNALS_CHECKS_END);
    e->phases[0] = ANYU16();
    e->phases[1] = ANYU16();
    e->phases[2] = ANYU16();
}

/** 1 where the angle may stand: in closed loop, and where a run may have left it so with the bridge off. */
static uint16_t may_stand(uint16_t state)
{
    return (uint16_t)(state == DRIVE_CLOSED || state == DRIVE_STOPPING || state == DRIVE_CALIBRATE || state == DRIVE_STOPPED || state == DRIVE_FAULT);
}

/** @param phase the last possible one: from HELD_SETTLES on the angle stands */
static void any_held(held_t *h, held_phase_t phase)
{
    h->phase = any_u(HELD_NOT, phase);
    h->act = any_u(HELD_WAITS, HELD_GOES_ON);
    h->steps = ANYU16();
    h->doubts = ANYU16();
    h->doubted_steps = ANYU16();
    h->turned_q12 = any(-32767, 32767);
    h->patience = ANYU16();
    h->stood = any_u(0, 2);
    h->emf_q12.d = any((int16_t)-emf_dq_max, emf_dq_max);
    h->emf_q12.q = any(-32767, 32767); /* a mean */
    h->lag_q12 = any(-32767, 32767);
    h->inv_kfi = any(0, 32767);
    h->emf_sum_max_q12 = any(0, 32767);
    h->run_on = any(-16384, 16384);
    h->load = any((int16_t)(-params.observer.load_max - 1), params.observer.load_max);
}

static void any_drive(uint16_t state)
{
    drive.command.run = any(0, 1);
    drive.command.clear_fault = any(0, 1);
    drive.command.target_erpm = any((int16_t)-erpm_max, erpm_max);
    drive.state = state;
    drive.fault = any_u(0, FAULT_COUNT - 1);
    drive.ticks = ANYU16();
    drive.periods = ANYU16();
    drive.direction = any(0, 1) ? 1 : -1;
    drive.calibration.done = any(0, 1);
    drive.calibration.sum_a = any_l(INT32_MIN, INT32_MAX);
    drive.calibration.sum_b = any_l(INT32_MIN, INT32_MAX);
    drive.calibration.offset_a_q13 = any((int16_t)-params.offset_max_q13, params.offset_max_q13);
    drive.calibration.offset_b_q13 = any((int16_t)-params.offset_max_q13, params.offset_max_q13);
    drive.bus_q31 = any_l(0, INT32_MAX);
    voltage_circle_of(&drive.circle, any(0, radius_max));
    drive.duty_per_volt_q16 = any_u(0, qm_divud(params.duty_per_volt_numerator, (uint16_t)((uint16_t)params.bus_under_q15 << 1)));
    drive.dead.a = any(-DEAD_MOST, DEAD_MOST);
    drive.dead.b = any(-DEAD_MOST, DEAD_MOST);
    drive.dead.c = any(-DEAD_MOST, DEAD_MOST);
    drive.dead_second.a = any(-DEAD_MOST, DEAD_MOST);
    drive.dead_second.b = any(-DEAD_MOST, DEAD_MOST);
    drive.dead_second.c = any(-DEAD_MOST, DEAD_MOST);
    drive.run.deferred_v_q13.alpha = any((int16_t)-voltage_max, voltage_max);
    drive.run.deferred_v_q13.beta = any((int16_t)-voltage_max, voltage_max);
    drive.angle = ANYU16();
    drive.frame.sin = any(-32767, 32767);
    drive.frame.cos = any(-32767, 32767);
    drive.forced.speed_q10 = any_l(-forced_max, forced_max);
    drive.forced.angle_q32 = any_ul(0, UINT32_MAX);
    drive.forced.step_q32 = any_ul(0, UINT32_MAX);
    drive.forced.increase_q10 = any(0, HANDOVER_HURRY * params.forced.increase_rate_q10);
    drive.run.align.sum_q14 = any_ul(0, 32767ul * 8000ul);
    drive.run.align.steps = ANYU16();
    drive.run.align.turned = ANYU16();
    drive.run.align.turns = any_u(0, PARAM_ALIGN_TURNS);
    drive.run.align.mean_q14 = any(0, 32767);
    drive.run.align.least_q14 = any(-32767, 32767);
    drive.run.align.second_q14 = any(-32767, 32767);
    drive.run.align.is_limited = any_u(0, 1);
    drive.run.handover.agreed_steps = ANYU16();
    drive.run.handover.phase = any_u(START_ALIGN, START_DONE);
    drive.run.handover.offset = ANY16();
    drive.run.handover.id_q13 = any((int16_t)-current_max, current_max);
#ifdef TUNING
    drive.run.control.ramp_q16 = ANYU16();
    drive.run.control.ramp_waits = any_u(0, 1);
#endif
    any_held(&drive.run.held, may_stand(state) ? HELD_STANDS : HELD_TURNS);
    any_evidence(&drive.run.evidence);
    drive.run.probe_phase = any_u(PROBE_WAIT, PROBE_PAUSE);
    drive.run.probe_steps = ANYU16();
    drive.run.probe_asked = any_u(0, 1);
    drive.run.dip_steps = ANYU16();
    drive.run.stall_steps = any_u(0, params.stall_steps);
    drive.run.lost_lock_steps = any_u(0, params.lost_lock_steps);
}

static void any_estimator(estimator_t *e)
{
    for (int i = 0; i < ESTIMATOR_HISTORY; i++) {
        e->history_q14[i].alpha = any((int16_t)-alpha_max, alpha_max);
        e->history_q14[i].beta = any((int16_t)-beta_max, beta_max);
    }
    e->i_last_q14.alpha = any((int16_t)-alpha_max, alpha_max);
    e->i_last_q14.beta = any((int16_t)-beta_max, beta_max);
    e->i_oldest_q14.alpha = any((int16_t)-alpha_max, alpha_max);
    e->i_oldest_q14.beta = any((int16_t)-beta_max, beta_max);
    e->v_last_q13.alpha = any((int16_t)-voltage_max, voltage_max);
    e->v_last_q13.beta = any((int16_t)-voltage_max, voltage_max);
    e->v_mean_q13.alpha = any((int16_t)-voltage_max, voltage_max);
    e->v_mean_q13.beta = any((int16_t)-voltage_max, voltage_max);
    e->e_d_q28 = any_l(emf_dq_max * -65536l, emf_dq_max * 65536l + 65535l);
    e->e_q_q28 = any_l(emf_dq_max * -65536l, emf_dq_max * 65536l + 65535l);
    e->omega_erpm = any(-32767, 32767);
    e->omega_before_erpm = any(-32767, 32767);
    e->omega_filtered_q16 = any_l(-32767 * 65536l, INT32_MAX);
    e->rho_q32 = any_ul(0, UINT32_MAX);
    e->next = ANYU16();
    e->old_turn_q16_rad = any(-32767, 32767);
    e->sign = any(-1, 1);
    e->own.sin = any(-32767, 32767);
    e->own.cos = any(-32767, 32767);
    e->half_step_q16_rad = qm_mulhi_su(e->omega_erpm, params.estimator.half_step_q16_rad);
}

static void any_observer_state(observer_t *o)
{
    o->omega_q16 = any_l(-32767 * 65536l, 32767 * 65536l);
    o->load_q16 = any_l((params.observer.load_max + 1) * -65536l, params.observer.load_max * 65536l);
    o->rho_q32 = any_ul(0, UINT32_MAX);
    o->rate_q16 = any(0, params.observer.fast_q16);
    o->gate_erpm = any(0, 32767);
    o->fast_share_q15 = any(0, 32767);
    o->gate_level = ANYU16();
    o->gate_last_erpm = ANY16();
    o->wrong_erpm = any(0, 32767);
    o->innovation_erpm = any(-16383, 16383);
    o->wrong_steps = ANYU16();
    o->share_q15 = any(0, 32767);
}

static void any_adaptation(adaptation_t *a)
{
    a->kfi_q31 = any_l(params.adaptation.kfi_least * 65536l, params.adaptation.kfi_most * 65536l);
    a->rs_q31 = any_l(params.adaptation.rs_least * 65536l, params.adaptation.rs_most * 65536l);
}

static void any_control(drive_control_t *c)
{
    c->reference_erpm = any(-32767, 32767); /* TORQUE_MODE: the observed speed */
    c->ref_q13.d = any((int16_t)-current_max, current_max);
    c->ref_q13.q = any((int16_t)-current_max, current_max);
    c->iq_limit_q13 = any(0, current_max);
    c->over_q13 = any(0, 16383);
    c->brake_limit_q13 = any(0, current_max);
    c->supply_q13 = any(0, current_max);
    c->i_q13.d = any(-IQ_MAX, IQ_MAX);
    c->i_q13.q = any(-IQ_MAX, IQ_MAX);
    c->v_q14.d = any((int16_t)-(2 * voltage_max), 2 * voltage_max);
    c->v_q14.q = any((int16_t)-(2 * voltage_max), 2 * voltage_max);
    c->vq_limit_q14 = any(0, radius_max);
    c->pi_d.sum = any_l(-SUM_MAX, SUM_MAX);
    c->pi_q.sum = any_l(-SUM_MAX, SUM_MAX);
    c->speed_kp_q13 = any(0, params.speed_kp_fast_q13);
    c->sample_shift_q13 = any((int16_t)-sample_shift_max, sample_shift_max);
}

static void held_holds_again(const held_t *h)
{
    //@ check held: h->phase <= HELD_STANDS && h->act <= HELD_GOES_ON && h->stood <= 2;
    //@ check held_emf_d: -emf_dq_max <= h->emf_q12.d <= emf_dq_max;
    //@ check held_emf_q: -32767 <= h->emf_q12.q;
    //@ check held_lag: -32767 <= h->lag_q12 && 0 <= h->inv_kfi && 0 <= h->emf_sum_max_q12;
    //@ check held_run_on: -16384 <= h->run_on <= 16384;
    //@ check held_turned: -32767 <= h->turned_q12;
    //@ check held_load: -params.observer.load_max - 1 <= h->load <= params.observer.load_max;
}

static void evidence_holds_again(const signals_evidence_t *e)
{
    //@ check once: -EVIDENCE_MOST <= e->once.cosine <= EVIDENCE_MOST && -EVIDENCE_MOST <= e->once.sine <= EVIDENCE_MOST;
    //@ check twice: -EVIDENCE_MOST <= e->twice.cosine <= EVIDENCE_MOST && -EVIDENCE_MOST <= e->twice.sine <= EVIDENCE_MOST;
    //@ check size: e->size <= EVIDENCE_MOST && e->checks <= SIGNALS_CHECKS_END;
}

static void bounds_hold_again(void)
{
    const estimator_t *e = &drive.run.estimator;
    const drive_control_t *c = &drive.run.control;
    const observer_t *o = &drive.run.observer;
    const adaptation_t *a = &drive.run.adaptation;
    //@ check state: drive.state < DRIVE_STATE_COUNT && drive.fault < FAULT_COUNT;
    //@ check direction: drive.direction == 1 || drive.direction == -1;
    //@ check command: 0 <= drive.command.run <= 1 && -erpm_max <= drive.command.target_erpm <= erpm_max;
    //@ check offset_a: -params.offset_max_q13 <= drive.calibration.offset_a_q13 <= params.offset_max_q13;
    //@ check offset_b: -params.offset_max_q13 <= drive.calibration.offset_b_q13 <= params.offset_max_q13;
    //@ check bus: 0 <= drive.bus_q31;
    //@ check circle: 0 <= drive.circle.limit_q14 <= radius_max;
    //@ check forced: -forced_max <= drive.forced.speed_q10 <= forced_max;
    //@ check i_last: -alpha_max <= e->i_last_q14.alpha <= alpha_max && -beta_max <= e->i_last_q14.beta <= beta_max;
    //@ check i_oldest: -alpha_max <= e->i_oldest_q14.alpha <= alpha_max && -beta_max <= e->i_oldest_q14.beta <= beta_max;
    //@ check old_turn: -32767 <= e->old_turn_q16_rad && -1 <= e->sign <= 1;
    //@ check dead: -DEAD_MOST <= drive.dead.a <= DEAD_MOST && -DEAD_MOST <= drive.dead.b <= DEAD_MOST && -DEAD_MOST <= drive.dead.c <= DEAD_MOST;
    //@ check dead_second_a: -DEAD_MOST <= drive.dead_second.a <= DEAD_MOST;
    //@ check dead_second_b: -DEAD_MOST <= drive.dead_second.b <= DEAD_MOST;
    //@ check dead_second_c: -DEAD_MOST <= drive.dead_second.c <= DEAD_MOST;
    //@ check history_alpha: \forall integer i; 0 <= i < ESTIMATOR_HISTORY ==> -alpha_max <= e->history_q14[i].alpha <= alpha_max;
    //@ check history_beta: \forall integer i; 0 <= i < ESTIMATOR_HISTORY ==> -beta_max <= e->history_q14[i].beta <= beta_max;
    //@ check late_alpha: -voltage_max <= drive.run.deferred_v_q13.alpha <= voltage_max;
    //@ check late_beta: -voltage_max <= drive.run.deferred_v_q13.beta <= voltage_max;
    //@ check v_last: -voltage_max <= e->v_last_q13.alpha <= voltage_max && -voltage_max <= e->v_last_q13.beta <= voltage_max;
    //@ check v_mean: -voltage_max <= e->v_mean_q13.alpha <= voltage_max && -voltage_max <= e->v_mean_q13.beta <= voltage_max;
    //@ check emf_d: emf_dq_max * -65536 <= e->e_d_q28 <= emf_dq_max * 65536 + 65535;
    //@ check emf_q: emf_dq_max * -65536 <= e->e_q_q28 <= emf_dq_max * 65536 + 65535;
    //@ check omega: -32767 <= e->omega_erpm && -32767 <= e->omega_before_erpm;
    //@ check omega_filtered: -32767 * 65536 <= e->omega_filtered_q16;
    //@ check reference: -32767 <= c->reference_erpm;
    //@ check ref: -current_max <= c->ref_q13.d <= current_max && -current_max <= c->ref_q13.q <= current_max;
    //@ check iq_limit: 0 <= c->iq_limit_q13 <= current_max;
    //@ check over: 0 <= c->over_q13 <= 16383;
    //@ check brake_limit: 0 <= c->brake_limit_q13 <= current_max;
    //@ check supply: 0 <= c->supply_q13 <= current_max;
    //@ check align: 0 <= drive.run.align.mean_q14 && -32767 <= drive.run.align.least_q14 && -32767 <= drive.run.align.second_q14;
    //@ check handover: -current_max <= drive.run.handover.id_q13 <= current_max;
    //@ check v: -2 * voltage_max <= c->v_q14.d <= 2 * voltage_max && -2 * voltage_max <= c->v_q14.q <= 2 * voltage_max;
    //@ check vq_limit: 0 <= c->vq_limit_q14 <= radius_max;
    //@ check sums: -SUM_MAX <= c->pi_d.sum <= SUM_MAX && -SUM_MAX <= c->pi_q.sum <= SUM_MAX;
    //@ check measured: -IQ_MAX <= c->i_q13.d <= IQ_MAX && -IQ_MAX <= c->i_q13.q <= IQ_MAX;
    //@ check gain: 0 <= c->speed_kp_q13 <= params.speed_kp_fast_q13;
    //@ check sample_shift: -sample_shift_max <= c->sample_shift_q13 <= sample_shift_max;
    //@ check observed_speed: -32767 * 65536 <= o->omega_q16 <= 32767 * 65536;
    //@ check observed_load: (params.observer.load_max + 1) * -65536 <= o->load_q16 <= params.observer.load_max * 65536;
    //@ check rate: 0 <= o->rate_q16 <= params.observer.fast_q16;
    //@ check large: 0 <= o->gate_erpm;
    //@ check quick: 0 <= o->fast_share_q15 && 0 <= o->share_q15;
    //@ check innovation: -16383 <= o->innovation_erpm <= 16383 && 0 <= o->wrong_erpm;
    //@ check learnt_kfi: params.adaptation.kfi_least * 65536 <= a->kfi_q31 <= params.adaptation.kfi_most * 65536;
    //@ check learnt_rs: params.adaptation.rs_least * 65536 <= a->rs_q31 <= params.adaptation.rs_most * 65536;
    //@ check model_rs: drive.run.model.rs_q16 <= rs_max;
    //@ check trim: -params.fieldweak.trim_max_q13 <= drive.run.fieldweak.trim_q13 <= 0;
    //@ check table: drive.run.fieldweak.index < FIELDWEAK_ENTRIES;
    //@ check counts: drive.run.stall_steps <= params.stall_steps + 1 && drive.run.lost_lock_steps <= params.lost_lock_steps + 2;
    held_holds_again(&drive.run.held);
    evidence_holds_again(&drive.run.evidence);
}

#endif
