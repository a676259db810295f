/* One PWM period of the drive, top to bottom: samples, references, current control, angle, modulation. */
#ifndef DRIVE_DRIVE_TICK_H
#define DRIVE_DRIVE_TICK_H

#include "drive/drive.h"
#include "drive/identify_tick.h"
#include "drive/param_scaling.h"

QM_INLINE int16_t drive_signed(const drive_t *d, int16_t x)
{
    return (int16_t)((d->direction >= 0) ? x : -x);
}

/** Phase currents from the samples: gain, then the calibrated offset. */
QM_INLINE void drive_measure(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    d->i_a_q13 = (int16_t)(qm_mulhi(raw->i_a, p->kcurr_a) - d->offset_a_q13);
    d->i_b_q13 = (int16_t)(qm_mulhi(raw->i_b, p->kcurr_b) - d->offset_b_q13);
    d->i_c_q13 = (int16_t)(-d->i_a_q13 - d->i_b_q13);
    d->pot_q15 = raw->pot;
}

QM_INLINE void drive_check_overcurrent(drive_t *d, const drive_params_t *p)
{
    const int16_t limit = p->overcurrent_q13;
    if (qm_abs(d->i_a_q13) > limit || qm_abs(d->i_b_q13) > limit || qm_abs(d->i_c_q13) > limit) {
        drive_raise(d, FAULT_OVERCURRENT_SW);
    }
}

/** Bus voltage: trip levels, and the modulator's gain for it. Every eighth period, in every state. */
QM_INLINE void drive_bus_step(drive_t *d, const drive_params_t *p, int16_t v_bus_raw)
{
    int16_t now_q15 = (int16_t)((uint16_t)((uint16_t)v_bus_raw ^ 0x8000u) >> 1);
    int16_t bus_q15 = qm_lowpass(&d->bus_q31, now_q15, 16384);

    if (now_q15 > p->bus_over_q15) {
        drive_raise(d, FAULT_OVERVOLTAGE);
    } else if (bus_q15 < p->bus_under_q15 && d->state != (uint16_t)DRIVE_STOPPED && d->state != (uint16_t)DRIVE_CALIBRATE) {
        drive_raise(d, FAULT_UNDERVOLTAGE);
    }
    drive_gain_step(d, p);
}

/** The ramped reference waits while the motor cannot follow: field weakening is indexed by it and must stay true. */
QM_INLINE int16_t drive_ramp_may_move(const drive_t *d, const drive_params_t *p, speed_erpm_t target)
{
    int32_t reference = drive_signed(d, d->control.reference_erpm);
    int32_t ahead = drive_signed(d, estimator_speed(&d->estimator)) - reference;
    return (int16_t)((drive_signed(d, target) > reference) ? ahead > -p->ramp_hold_erpm : ahead < p->ramp_hold_erpm);
}

/** The next speed reference in normal operation, in TUNING and while stopping. */
QM_INLINE void drive_reference_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->control;
    speed_erpm_t target = d->command.target_erpm;
#ifdef TUNING
    if (d->state == (uint16_t)DRIVE_CLOSED) {
        int32_t sum = (int32_t)c->tuning_low + p->tuning_step_q16;
        target = drive_signed(d, p->maximum_erpm);
        c->tuning_low = (uint16_t)sum;
        if (drive_ramp_may_move(d, p, target)) {
            c->reference_erpm = speed_ramp(c->reference_erpm, target, qm_hi(sum));
        }
        return;
    }
#endif
    if (d->state == (uint16_t)DRIVE_STOPPING) {
        target = 0;
    }
    if (drive_ramp_may_move(d, p, target)) {
        c->reference_erpm = speed_ramp(c->reference_erpm, target, p->speed_ramp_erpm);
    }
}

#ifdef TORQUE_MODE
/** TORQUE_MODE: the command is the q current; the speed controller only keeps it below the maximum speed, and below the
 *  minimum speed, where the estimator would lose the rotor, a proportional share holds against it. */
QM_INLINE current_q13_t drive_torque_step(drive_t *d, const drive_params_t *p, speed_erpm_t speed)
{
    drive_control_t *c = &d->control;
    int16_t torque = qm_abs(d->command.target_erpm);
    int16_t limit = (torque < c->iq_limit_q13) ? torque : c->iq_limit_q13;
    int16_t iq = pi_tick(&c->pi_speed, &p->pi_speed, qm_sub_limited(drive_signed(d, p->maximum_erpm), speed), limit);
    int32_t hold = qm_mulss(qm_sub_limited(p->minimum_erpm, drive_signed(d, speed)), p->pi_speed.kp) >> p->pi_speed.shift;

    c->reference_erpm = speed; /* field weakening and an orderly stop start from it */
    if (hold > c->iq_limit_q13) {
        hold = c->iq_limit_q13;
    }
    return (hold > drive_signed(d, iq)) ? drive_signed(d, (int16_t)hold) : iq;
}
#endif

/** Braking within what the bus takes: the speed controller's integrator goes along. @return the q current */
QM_INLINE current_q13_t drive_limit_brake(drive_control_t *c, const drive_params_t *p, speed_erpm_t speed, int16_t err, current_q13_t iq)
{
    current_q13_t limited = iq;
    if ((iq ^ speed) < 0 && qm_abs(iq) > c->brake_limit_q13) {
        limited = (int16_t)((iq < 0) ? -c->brake_limit_q13 : c->brake_limit_q13);
        pi_preset(&c->pi_speed, &p->pi_speed, err, limited);
    }
    return limited;
}

/** Speed controller: the ramped reference and the filtered speed give the q current; braking is limited by the bus. */
QM_RARE void drive_speed_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->control;
    speed_erpm_t speed = estimator_speed(&d->estimator);
    int16_t err, iq;

#ifdef TORQUE_MODE
    if (d->state == (uint16_t)DRIVE_CLOSED) {
        c->ref_q13.q = drive_torque_step(d, p, speed);
        return;
    }
#endif
    drive_reference_step(d, p);
    err = qm_sub_limited(c->reference_erpm, speed);
    iq = pi_tick(&c->pi_speed, &p->pi_speed, err, c->iq_limit_q13);
    c->ref_q13.q = drive_limit_brake(c, p, speed, err, iq);
    if (d->state == (uint16_t)DRIVE_STOPPING && qm_abs(speed) < p->minimum_erpm && qm_abs(c->reference_erpm) < p->minimum_erpm) {
        d->state = (uint16_t)DRIVE_STOPPED;
    }
}

/** d current: what is left of the hand-over, the table and its trim; the q current gets the rest of the circle. */
QM_INLINE void drive_current_limit_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->control;
    int16_t id_max = (int16_t)(p->current_max_q13 - (p->current_max_q13 >> 5));
    uint32_t ratio;

    fieldweak_trim(&d->fieldweak, &p->fieldweak, (int16_t)(c->vq_limit_q14 - qm_abs(c->v_q14.q)), estimator_speed(&d->estimator));
    c->ref_q13.d = qm_clamp((int16_t)(c->handover_q13 + d->fieldweak.table_q13 + d->fieldweak.trim_q13), (int16_t)-id_max, id_max);
    ratio = qm_muluu((uint16_t)qm_abs(c->ref_q13.d), p->current_max_reciprocal) >> 10;
    c->iq_limit_q13 = qm_hi(2 * qm_mulss(p->current_max_q13, trig_circle((int16_t)((ratio > 32767u) ? 32767u : ratio))));
}

/** Stall and lost lock: conditions that must not last. */
QM_INLINE void drive_protect_step(drive_t *d, const drive_params_t *p)
{
    int16_t speed = qm_abs(estimator_speed(&d->estimator));
    int16_t least = (int16_t)(qm_abs(d->control.reference_erpm) >> 1);
    dq_t emf = estimator_emf(&d->estimator);

    if (least < (p->minimum_erpm >> 1)) {
        least = (int16_t)(p->minimum_erpm >> 1);
    }
    d->stall_count = (uint16_t)((speed < least) ? d->stall_count + 1u : 0u);
    if (d->stall_count > p->stall_slots) {
        drive_raise(d, FAULT_STALL);
    }
    d->lost_count = (uint16_t)((qm_abs(emf.d) > qm_abs(emf.q) || speed > p->overspeed_erpm) ? d->lost_count + 1u : 0u);
    if (d->lost_count > p->lost_lock_slots) {
        drive_raise(d, FAULT_LOST_LOCK);
    }
}

/** The hand-over's remaining offset decays one count a period; braking current follows the bus. */
QM_INLINE void drive_handover_step(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->control;
    int16_t over = (int16_t)(qm_hi(d->bus_q31) - p->bus_regen_q15);

    if (c->handover_offset != 0) {
        c->handover_offset = speed_ramp(c->handover_offset, 0, SLOTS);
        c->handover_q13 = (int16_t)-qm_hi(2 * qm_mulss(drive_signed(d, p->open_loop_q13), trig_sincos((angle_t)c->handover_offset).sin));
    }
    c->brake_limit_q13 = p->current_max_q13;
    if (over > 0) {
        int32_t less = qm_mulss(over, p->brake_per_bus_q8) >> 8;
        c->brake_limit_q13 = (int16_t)((less > p->current_max_q13) ? 0 : p->current_max_q13 - less);
    }
}

/** Bumpless change of frame: currents, voltages and integrators are turned from the forced frame into the estimator's. The angles
 *  are those of the next sample. */
QM_RARE void drive_hand_over(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->control;
    angle_t estimated = estimator_next_angle(&d->estimator);
    sincos_t turn;
    dq_t x;
    alphabeta_t y;

    c->handover_offset = (int16_t)(angle_t)(d->angle - estimated);
    turn = trig_sincos((angle_t)c->handover_offset);
    y = inverse_park(c->v_q14, turn);
    c->v_q14.d = (int16_t)(2 * y.alpha);
    c->v_q14.q = (int16_t)(2 * y.beta);
    x.d = 0;
    x.q = drive_signed(d, p->open_loop_q13);
    y = inverse_park(x, turn);
    c->ref_q13.d = (int16_t)(2 * y.alpha);
    c->ref_q13.q = (int16_t)(2 * y.beta);
    c->handover_q13 = c->ref_q13.d;
    pi_preset(&c->pi_d, &p->pi_d, 0, c->v_q14.d);
    pi_preset(&c->pi_q, &p->pi_q, 0, c->v_q14.q);
    c->reference_erpm = drive_signed(d, p->end_erpm);
    d->angle = estimated;
    d->frame = trig_sincos(estimated);
    d->stall_count = 0;
    d->lost_count = 0;
    d->state = (uint16_t)DRIVE_CLOSED;
}

/** Six periods after the hand-over, whose own period has enough to do: the speed controller, which comes next, goes on from its q current. */
QM_INLINE void drive_speed_preset(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->control;
    if (d->slots != 0u) {
        d->slots = 0;
        pi_preset(&c->pi_speed, &p->pi_speed, qm_sub_limited(c->reference_erpm, estimator_speed(&d->estimator)), c->ref_q13.q);
    }
}

/** Slow work after the duties of a period are written, for they have a deadline and this has none: one block every period in turn, so
 *  that no period has more than one. Bus and circle in every state, the rest in closed loop.
 *  @param v_bus_raw the converter's result for the bus, any value */
QM_RARE void drive_slow(drive_t *d, const drive_params_t *p, int16_t v_bus_raw)
{
    uint16_t slot = d->ticks & (SLOTS - 1u);
    if (slot == 2u) {
        drive_bus_step(d, p, v_bus_raw);
    } else if (slot == 3u) {
        drive_circle_step(d, p);
    } else if (slot == 1u && d->state == (uint16_t)DRIVE_RAMP) {
        if (d->slots >= p->ready_slots) {
            drive_hand_over(d, p);
        }
    } else if (d->state == (uint16_t)DRIVE_CLOSED || d->state == (uint16_t)DRIVE_STOPPING) {
        switch (slot) {
        case 0: drive_speed_step(d, p); break;
        case 1: fieldweak_tick(&d->fieldweak, &p->fieldweak, &d->tuning, d->control.reference_erpm); break;
        case 4: drive_current_limit_step(d, p); break;
        case 5: drive_protect_step(d, p); break;
        case 6: drive_handover_step(d, p); break;
        default: drive_speed_preset(d, p); break; /* 7 */
        }
    }
}

/** At the end speed: decide for the hand-over once the estimator agrees with the forced speed long enough, or give up by name. */
QM_INLINE void drive_try_hand_over(drive_t *d, const drive_params_t *p)
{
#ifdef OPEN_LOOP_FUNCTIONING
    (void)d;
    (void)p;
#else
    int16_t miss;
    if ((d->ticks & (SLOTS - 1u)) != 0u) {
        return;
    }
    miss = qm_abs(qm_sub_limited(drive_signed(d, estimator_speed(&d->estimator)), p->end_erpm));
    d->timer = (uint16_t)(d->timer + 1u);
    d->slots = (uint16_t)((miss < (p->end_erpm >> 2)) ? d->slots + 1u : 0u);
    if (d->slots < p->ready_slots && d->timer >= p->ready_timeout_slots) {
        drive_raise(d, FAULT_START_FAILED);
    }
#endif
}

/** The vector turns by 90 degrees during the first half of the lock, so that no rotor position is a dead point. */
QM_INLINE void drive_lock_sweep(drive_t *d, const drive_params_t *p)
{
    d->forced.angle_q32 = (d->direction >= 0) ? qm_turn_add(d->forced.angle_q32, p->lock_sweep_q32)
                                              : qm_turn_sub(d->forced.angle_q32, p->lock_sweep_q32);
}

/** The forced angle while the rotor is locked and accelerated. */
QM_INLINE void drive_forced_step(drive_t *d, const drive_params_t *p)
{
    if (d->state == (uint16_t)DRIVE_LOCK) {
        d->timer++;
        if (d->timer <= (p->lock_periods >> 1)) {
            drive_lock_sweep(d, p);
        } else if (d->timer >= p->lock_periods) {
            d->state = (uint16_t)DRIVE_RAMP;
            d->timer = 0;
        }
        d->angle = forced_angle(&d->forced);
    } else {
        int16_t at_end = forced_angle_tick(&d->forced, &p->forced, d->direction);
        d->angle = forced_angle(&d->forced);
        if (at_end) {
            drive_try_hand_over(d, p);
        }
    }
}

/** Lock and ramp after the estimator: the forced angle moves; letting go is harmless at these speeds. */
QM_RARE void drive_open_loop(drive_t *d, const drive_params_t *p)
{
    drive_forced_step(d, p);
    if (!d->command.run && d->state != (uint16_t)DRIVE_FAULT) {
        d->state = (uint16_t)DRIVE_STOPPED;
    }
}

/** A period with the bridge switching. */
QM_INLINE duties_t drive_run(drive_t *d, const drive_params_t *p)
{
#ifdef IDENTIFY
    return identify_run(d, p);
#else
    drive_control_t *c = &d->control;
    alphabeta_t i = clarke(d->i_a_q13, d->i_b_q13), v;
    uint16_t forced = (uint16_t)(d->state <= (uint16_t)DRIVE_RAMP); /* LOCK or RAMP */

    c->i_q13 = park(i, d->frame);
    c->v_q14 = current_control(&c->pi_d, &p->pi_d, &c->pi_q, &p->pi_q, c->ref_q13, c->i_q13, &d->circle, &c->vq_limit_q14);
    estimator_tick(&d->estimator, &p->estimator, &d->tuning, i, d->frame, forced);
    if (forced) {
        drive_open_loop(d, p);
    } else {
        d->angle = estimator_next_angle(&d->estimator);
        if (!d->command.run && d->state == (uint16_t)DRIVE_CLOSED) {
            d->state = (uint16_t)DRIVE_STOPPING;
        }
    }
    d->frame = trig_sincos(d->angle);
    v = inverse_park(c->v_q14, d->frame);
    estimator_commanded(&d->estimator, v);
    return svm(&p->svm, v, d->duty_per_volt_q16, d->i_a_q13, d->i_b_q13, d->i_c_q13);
#endif
}

/** Averages the offsets; a plausible result allows the first start. */
QM_INLINE void drive_calibrate(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    d->offset_sum_a += raw->i_a;
    d->offset_sum_b += raw->i_b;
    d->timer++;
    if (d->timer == (1u << DRIVE_CALIBRATION_LOG2)) {
        int16_t a_q13 = qm_mulhi((int16_t)(d->offset_sum_a >> DRIVE_CALIBRATION_LOG2), p->kcurr_a);
        int16_t b_q13 = qm_mulhi((int16_t)(d->offset_sum_b >> DRIVE_CALIBRATION_LOG2), p->kcurr_b);
        if (qm_abs(a_q13) > p->offset_max_q13 || qm_abs(b_q13) > p->offset_max_q13) {
            drive_raise(d, FAULT_OFFSET);
        } else {
            d->offset_a_q13 = a_q13;
            d->offset_b_q13 = b_q13;
            d->calibrated = 1;
            d->state = (uint16_t)DRIVE_STOPPED;
        }
    }
}

/** The low sides conduct and charge the high sides' drivers. */
QM_INLINE void drive_bootstrap_step(drive_t *d, const drive_params_t *p)
{
    d->timer++;
    if (!d->command.run) {
        d->state = (uint16_t)DRIVE_STOPPED;
    } else if (d->timer >= p->bootstrap_periods) {
        d->timer = 0;
        d->state = (uint16_t)DRIVE_LOCK;
    }
    drive_check_overcurrent(d, p); /* last: a fault overrides any other change of state */
}

/** A period with the bridge off or charging its drivers. */
QM_RARE void drive_idle(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    switch (d->state) {
    case DRIVE_CALIBRATE:
        drive_calibrate(d, p, raw);
        break;
    case DRIVE_STOPPED:
        d->estimator.omega_filtered_q16 = 0; /* nothing is known of a rotor that coasts */
        d->control.reference_erpm = 0;
        if (d->command.run) {
            d->timer = 0;
            d->state = (uint16_t)DRIVE_BOOTSTRAP;
        }
        break;
    case DRIVE_BOOTSTRAP:
        drive_bootstrap_step(d, p);
        break;
    default: /* FAULT */
        if (d->command.clear_fault) {
            d->fault = (uint16_t)FAULT_NONE;
            d->timer = 0;
            d->offset_sum_a = 0;
            d->offset_sum_b = 0;
            d->state = (uint16_t)(d->calibrated ? DRIVE_STOPPED : DRIVE_CALIBRATE);
        }
        break;
    }
    d->command.clear_fault = 0;
}

/** One PWM period up to the duties; then drive_outputs(), and last drive_slow(), which has no deadline.
 *  @param raw the converter's results at the centre of the low sides' conduction
 *  @return duties; the board must load them before the next PWM boundary */
QM_INLINE duties_t drive_tick(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    duties_t duty = { 0, 0, 0 };

    d->ticks = (uint16_t)(d->ticks + 1u);
    drive_measure(d, p, raw);
    if (drive_is_running(d)) {
        drive_check_overcurrent(d, p); /* before the law: its formats end above the trip level */
    } else {
        drive_idle(d, p, raw);
    }
    if (drive_is_running(d)) {
        duty = drive_run(d, p);
    }
    return duty;
}

/** What drives the bridge (outputs_t) in the drive's present state. */
QM_INLINE uint16_t drive_outputs(const drive_t *d)
{
    if (drive_is_running(d)) {
        return (uint16_t)OUTPUTS_PWM;
    }
    return (uint16_t)((d->state == (uint16_t)DRIVE_BOOTSTRAP) ? OUTPUTS_BOOTSTRAP : OUTPUTS_OFF);
}

#endif
