/* One PWM period of the drive, top to bottom: samples, currents, current control, angle, modulation; then the slow work. */
#include "drive/tick.h"

#include "drive/limits.h"
#include "drive/deferred.h"
#include "drive/drive.h"
#include "drive/protection.h"
#include "drive/speed.h"

INLINE void drive_measure(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    d->phases_q13.a = (int16_t)(qm_mulhi(raw->i_a, p->kcurr_a) - d->calibration.offset_a_q13);
    d->phases_q13.b = (int16_t)(qm_mulhi(raw->i_b, p->kcurr_b) - d->calibration.offset_b_q13);
    d->phases_q13.c = (int16_t)(-d->phases_q13.a - d->phases_q13.b);
}

INLINE void drive_run(drive_t *d, const drive_params_t *p, duties_t *duty)
{
    drive_run_t *run = &d->run;
    drive_control_t *c = &run->control;
    const angle_t before = d->angle;
    alphabeta_t i = clarke(d->phases_q13.a, d->phases_q13.b), e, v;

    c->i_q13 = park(i, d->frame);
    c->i_q13.q = (int16_t)(c->i_q13.q + c->sample_shift_q13);
    c->v_q14 = current_control(&c->pi_d, &p->pi_d, &c->pi_q, &p->pi_q, c->ref_q13, c->i_q13, &d->circle, &c->vq_limit_q14);
    e = estimator_back_emf(&run->estimator, &p->estimator, &run->model, i);
    if (drive_is_forced(d)) {
        estimator_run_along(&run->estimator, &p->estimator, &run->model, e);
        forced_angle_move(&d->forced);
        d->angle = forced_angle(&d->forced);
    } else {
        estimator_track(&run->estimator, &p->estimator, &run->model, e, d->frame);
        d->angle = estimator_next_angle(&run->estimator);
    }
    d->frame = trig_sincos(d->angle);
    v = inverse_park(c->v_q14, deferred_frame(d, before));
    estimator_commanded(&run->estimator, deferred_vector(run, v));
    svm(&p->svm, v, d->duty_per_volt_q16, dead_of_pulse(d), &d->phases_q13, duty);
}

void drive_prepare(drive_t *d, const drive_params_t *p)
{
    dq_t asked;
    if (drive_is_forced(d)) {
        asked = d->run.control.ref_q13;
        (void)forced_angle_accelerate(&d->forced, &p->forced, d->direction, SLOW_EVERY);
        estimator_turn_frame(&d->run.estimator);
    } else { /* the pulses' centres are one and two steps ahead of the frame, or two and three */
        asked = deferred_currents(&d->run);
    }
    svm_compensation(&p->svm, phases_of(asked, d->frame), &d->dead);
    dead_prepare_second(d, p, asked);
}

INLINE uint16_t drive_tick(drive_t *d, const drive_params_t *p, const drive_samples_t *raw, duties_t *duty)
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

/* wcet: idle_step excludes estimator_remember speed_step signals_check protection_probe_rotor protection_check_rotor adaptation_learn */
void drive_idle(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    mode_idle(d);
    idle_step(d, p, raw->i_a, raw->i_b);
}

/** What the estimator's last two periods leave to be done; the modes of their own have no estimator. */
static void drive_follow(drive_t *d, const drive_params_t *p)
{
    if (MODE_ALIGNS) {
        estimator_filter_speed(&d->run.estimator, &p->estimator);
    }
}

INLINE uint16_t drive_slow_follows(const drive_t *d)
{
    return (uint16_t)(DEFER_DUTIES || schedule_is_due(d->ticks));
}

uint16_t drive_slow(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    uint16_t was_running = drive_is_running(d), is_due = schedule_is_due(d->ticks);

    if (!was_running) {
        drive_idle(d, p, raw);
    } else if (is_due != (uint16_t)DEFER_DUTIES) { /* deferred duties leave time between the slots */
        drive_follow(d, p);
    } else {
        /* the slot alone */
    }
    if (!is_due) {
        return was_running;
    }
    schedule_run(d, p, raw);
    if (!drive_is_running(d)) {
        return 0;
    }
    if (MODE_ALIGNS) {
        drive_prepare(d, p);
    }
    return was_running;
}
