/* One PWM period of the drive, top to bottom: samples, currents, current control, angle, modulation; then the slow work. */
#ifndef DRIVE_TICK_H
#define DRIVE_TICK_H

#include "drive/bus.h"
#include "drive/dead_time.h"
#include "drive/idle.h"
#include "drive/model.h"
#include "drive/speed.h"

/** Phase currents from the samples: gain, then the calibrated offset. */
QM_INLINE void drive_measure(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    d->phases_q13.a = (int16_t)(qm_mulhi(raw->i_a, p->kcurr_a) - d->calibration.offset_a_q13);
    d->phases_q13.b = (int16_t)(qm_mulhi(raw->i_b, p->kcurr_b) - d->calibration.offset_b_q13);
    d->phases_q13.c = (int16_t)(-d->phases_q13.a - d->phases_q13.b);
}

/** A period with the bridge switching. @param duty written */
QM_INLINE void drive_run(drive_t *d, const drive_params_t *p, duties_t *duty)
{
    drive_run_t *run = &d->run;
    drive_control_t *c = &run->control;
    const angle_t before = d->angle;
    alphabeta_t i = clarke(d->phases_q13.a, d->phases_q13.b), e, v;

    c->i_q13 = park(i, d->frame);
    c->i_q13.q = (int16_t)(c->i_q13.q + c->sample_shift_q13);
    c->v_q14 = current_control(&c->pi_d, &p->pi_d, &c->pi_q, &p->pi_q, c->ref_q13, c->i_q13, &d->circle, &c->vq_limit_q14);
    e = estimator_back_emf(&run->estimator, &p->estimator, &run->model, i);
    estimator_track(&run->estimator, &p->estimator, &run->model, e, d->frame, drive_is_forced(d));
    if (drive_is_forced(d)) { /* asked again: a flag would take a register */
        forced_angle_move(&d->forced);
        d->angle = forced_angle(&d->forced);
    } else {
        d->angle = estimator_next_angle(&run->estimator);
    }
    d->frame = trig_sincos(d->angle);
    v = inverse_park(c->v_q14, late_frame(d, before));
    estimator_commanded(&run->estimator, late_vector(run, v));
    svm(&p->svm, v, d->duty_per_volt_q16, dead_of_pulse(d), &d->phases_q13, duty);
}

/** Last of the slow work: what the law of the next two periods needs and the samples do not change. */
QM_INLINE void drive_prepare(drive_t *d, const drive_params_t *p)
{
    dq_t asked;
    if (drive_is_forced(d)) {
        asked = d->run.control.ref_q13;
        (void)forced_angle_accelerate(&d->forced, &p->forced, d->direction, SLOW_EVERY);
        estimator_turn_frame(&d->run.estimator);
    } else { /* the pulses' centres are one and two steps ahead of the frame, or two and three */
        asked = late_asked(&d->run);
    }
    svm_compensation(&p->svm, phases_of(asked, d->frame), &d->dead);
    dead_prepare_second(d, p, asked);
}

/** One PWM period up to the duties; after it, where drive_slow_is_due() or the bridge does not switch, drive_slow(), which has no deadline, drive_outputs(), and last
 *  drive_settle().
 *  @param raw the converter's results at the centre of the low sides' conduction
 *  @param duty the board must load it before the next PWM boundary; 0, the low sides on, where the bridge does not switch
 *  @return 1 where it does */
QM_INLINE uint16_t drive_tick(drive_t *d, const drive_params_t *p, const drive_samples_t *raw, duties_t *duty)
{
    d->ticks = (uint16_t)(d->ticks + 1u);
    drive_measure(d, p, raw);
    if (drive_is_running(d) && !protection_check_current(d, p)) { /* before the law: its formats end above the trip level */
        MODE_RUN(d, p, duty);
        return 1;
    }
    duty->a = 0;
    duty->b = 0;
    duty->c = 0;
    return 0;
}

/** Where a state leads to the next by what the rotor does. Every slow step. */
QM_INLINE void drive_state_step(drive_t *d, const drive_params_t *p)
{
    const uint16_t state = d->state;
    if (state == (uint16_t)DRIVE_RAMP) {
        handover_step(d, p);
    } else if (state == (uint16_t)DRIVE_CATCH) {
        catch_step(d, p);
    } else if (state == (uint16_t)DRIVE_STOPPING) {
        speed_turn_round(d, p);
    } else {
        /* the others are left elsewhere */
    }
}

/** What the start does every slow step. */
QM_INLINE void drive_start_step(drive_t *d, const drive_params_t *p)
{
    if (!MODE_ALIGNS || !drive_is_running(d)) { /* nothing turns, or the mode turns it */
        return;
    }
    if (!d->command.run) { /* letting go is harmless at these speeds */
        drive_enter(d, DRIVE_STOPPED);
    } else if (d->state == (uint16_t)DRIVE_RAMP) {
        handover_wait(d, p);
    } else {
        startup_align(d, p);
    }
}

/* wcet: idle_step excludes estimator_settle speed_step protection_check_signals protection_probe_rotor protection_check_rotor adaptation_learn */
/** First of the slow work: what a period with the bridge off is. */
QM_INLINE void drive_rest(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    mode_idle(d);
    idle_step(d, p, raw->i_a, raw->i_b);
}

/** What the estimator's last two periods leave to be done; the modes of their own have no estimator. */
QM_INLINE void drive_follow(drive_t *d, const drive_params_t *p)
{
    if (MODE_ALIGNS) {
        estimator_settle(&d->run.estimator, &p->estimator);
    }
}

/** Observer and speed controller, or the start. Every slow step, in two halves. @param call of late_call() */
QM_INLINE void drive_speed_step(drive_t *d, const drive_params_t *p, uint16_t call)
{
    if (!drive_is_closed(d)) {
        if (late_first(call)) {
            drive_start_step(d, p);
        }
        return;
    }
    if (late_first(call)) {
        handover_observe(&d->run, p);
    }
    if (late_second(call)) {
        speed_step(d, p);
    }
}

/** The state, then the bus and what braking may do to it. Every slow step, in two halves. */
QM_INLINE void drive_bus_step(drive_t *d, const drive_params_t *p, int16_t raw_bus, uint16_t call)
{
    if (late_first(call)) {
        drive_state_step(d, p);
    }
    if (late_second(call)) {
        bus_step(d, p, raw_bus);
        if (drive_is_closed(d)) {
            limits_burn(&d->run, p);
            limits_braking(&d->run, p, bus_sample(raw_bus));
        }
    }
}

/** The voltage circle, and in closed loop what limits the currents. Every rare step, in two halves. */
QM_INLINE void drive_limit_step(drive_t *d, const drive_params_t *p, uint16_t call)
{
    if (late_first(call)) {
        bus_update_voltage_limit(d, p);
    }
    if (late_second(call) && drive_is_closed(d)) {
        if (d->run.handover.offset != 0) {
            handover_decay(&d->run.handover);
        }
        limits_current(&d->run, p);
    }
}

/** Does the rotor stand? Does the run go on? Every seldom step in closed loop, in two halves. */
QM_INLINE void drive_rotor_step(drive_t *d, const drive_params_t *p, uint16_t call)
{
    if (!drive_is_closed(d)) {
        return;
    }
    if (late_first(call)) {
        protection_probe_rotor(d, p);
    }
    if (late_second(call)) {
        speed_choose_state(d, p);
    }
}

/** Do signals and motor fit each other? Then the motor's model. Every seldom step, in two halves. */
QM_INLINE void drive_model_step(drive_t *d, const drive_params_t *p, uint16_t call)
{
    if (late_first(call)) {
        if (drive_is_closed(d)) {
            if (d->run.observer.wrong_steps == 0u) { /* else its turn comes in each slow step */
                protection_check_signals(d, p);
            }
            model_update(d, p);
        } else {
            model_update_in_ramp(d, p);
        }
    }
    if (late_second(call)) {
        protection_check_model(d, p);
    }
}

/** Third part of a slow step: limits, protection, and what the running motor teaches. @param part of the round @return which one it was */
QM_INLINE uint16_t drive_limit_part(drive_t *d, const drive_params_t *p, uint16_t part, uint16_t call)
{
    switch (part) {
    case 6:
        drive_rotor_step(d, p, call);
        return 6;
    case 14:
        drive_model_step(d, p, call);
        return 14;
    default: /* 2, 10 */
        drive_limit_step(d, p, call);
        if ((part & 8u) != 0u && late_first(call)) {
            model_learn_step(d, p);
        }
        return (uint16_t)((part & 8u) | 2u);
    }
}

/** Last part of a slow step, what belongs to the speed: in every other one, and in each after a large innovation, the rates and the gain of its
 *  controller; in those between its trim, does the rotor follow, in closed loop, and the estimator's sign; while signals seem wrong, are they? In two
 *  halves. */
QM_INLINE void drive_rate_step(drive_t *d, const drive_params_t *p, uint16_t part, uint16_t call)
{
    const uint16_t between = (uint16_t)(part & 4u);
    if (late_first(call) && drive_is_closed(d)) {
        if (between) {
            speed_trim_step(d, p);
            protection_check_rotor(d, p);
        }
        if (!between || !observer_is_calm(&d->run.observer)) {
            speed_follow(&d->run, p);
        }
    }
    if (late_second(call)) {
        if (between && drive_is_running(d)) {
            estimator_follow(&d->run.estimator, &p->estimator);
        }
        if (d->run.observer.wrong_steps != 0u && drive_is_closed(d)) {
            protection_check_signals(d, p);
        }
    }
}

/** A part of what comes by and by, with late duties half a part: bus and circle in every state, the hand-over at the end of RAMP, the rest in
 *  closed loop.
 *  @param raw the converter's results of this period */
QM_INLINE void drive_part(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    const uint16_t call = late_call(d->ticks), part = late_part(call);
    uint16_t done;

    switch (part & 3u) {
    case 0:
        drive_speed_step(d, p, call);
        done = (uint16_t)(part & 12u);
        break;
    case 1:
        drive_bus_step(d, p, raw->v_bus, call);
        done = (uint16_t)((part & 12u) | 1u);
        break;
    case 2:
        done = drive_limit_part(d, p, part, call);
        break;
    default: /* 3 */
        drive_rate_step(d, p, part, call);
        done = (uint16_t)((part & 12u) | 3u);
        break;
    }
    SELFTEST_MARK(d, late_mark(done, call));
}

/** 1 in the periods that slow work follows while the bridge switches, every second one. With the bridge off it follows each. */
QM_INLINE uint16_t drive_slow_is_due(const drive_t *d)
{
    return (uint16_t)((d->ticks & (SLOW_EVERY - 1u)) == 0u);
}

/** 1 where the slow work has something to do in this period while the bridge switches: with late duties in each. */
QM_INLINE uint16_t drive_slow_follows(const drive_t *d)
{
    return (uint16_t)(LATE_DUTIES || drive_slow_is_due(d));
}

/** Slow work after the duties of a period are written, for they have a deadline and this has none but the next period.
 *  With late duties the periods between those of the parts take the estimator's share, and the recorder's.
 *  @param raw the converter's results of this period @return 1 while the bridge goes on switching */
QM_INLINE uint16_t drive_slow(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    uint16_t was_running = 1;
    if (drive_is_running(d)) {
        if (!drive_slow_is_due(d)) {
            if (LATE_DUTIES) {
                drive_follow(d, p);
            }
            return 1;
        }
        if (!LATE_DUTIES) {
            drive_follow(d, p);
        }
    } else {
        was_running = 0;
        drive_rest(d, p, raw);
        if (!drive_slow_is_due(d)) {
            return 0;
        }
    }
    drive_part(d, p, raw);
    if (!drive_is_running(d)) {
        return 0;
    }
    if (MODE_ALIGNS) {
        drive_prepare(d, p);
    }
    return was_running;
}

#endif
