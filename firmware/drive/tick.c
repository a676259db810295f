/* One PWM period of the drive, top to bottom: samples, currents, current control, angle, modulation; then the slow work. */
#include "drive/tick.h"

#include "drive/drive.h"
#include "drive/limits.h"
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
    c->v_q14 = current_control(&c->pi_d, &p->pi_d, &c->pi_q, &p->pi_q, mode_asked(run, p), c->i_q13, &d->circle, &c->vq_limit_q14);
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

/* wcet: idle_step excludes estimator_remember speed_step signals_check protection_probe_rotor protection_check_rotor adaptation_learn held_step held_act */
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
    } else { /* the slot alone */
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

/* ---- Deferred duties, and dead time's compensation for each pulse ---- */

/** Half steps of the angle from the frame that the slow work sees to the middle of the next two pulses, or to the first one. */
#define DEFER_HALF_STEPS (3 - DEAD_EACH + 2 * DEFER_DUTIES)

/** Largest half step that so many leave within a word. */
#define DEFER_HALF_STEP_MOST (32767 / DEFER_HALF_STEPS)

/** 1 where no speed that a word holds has a larger one. */
#define DEFER_HALF_STEP_FITS (32768.0F * 65536.0F * PARAM_PI / 60.0F * PARAM_F(LOOPTIME_SEC) * PARAM_F(SPEED_UNIT) < 32767.0F / PARAM_F(DEFER_HALF_STEPS))

INLINE QM_WRAPS sincos_t deferred_frame(const drive_t *d, angle_t before)
{
    if (DEFER_DUTIES) {
        return trig_sincos((angle_t)(2u * (uint32_t)d->angle - before));
    }
    return d->frame;
}

INLINE alphabeta_t deferred_vector(drive_run_t *run, alphabeta_t v_q13)
{
    if (DEFER_DUTIES) {
        alphabeta_t waited = run->deferred_v_q13;
        run->deferred_v_q13 = v_q13;
        return waited;
    }
    return v_q13;
}

void deferred_preset(drive_run_t *run, alphabeta_t v_q13)
{
    run->estimator.v_last_q13 = v_q13;
    run->estimator.v_mean_q13 = v_q13;
    (void)deferred_vector(run, v_q13);
}

dq_t deferred_currents(const drive_run_t *run)
{
    int16_t half_step = run->estimator.half_step_q16_rad;
    if (!DEFER_HALF_STEP_FITS) {
        half_step = qm_limit(half_step, DEFER_HALF_STEP_MOST);
    }
    return dq_turn(run->control.ref_q13, (int16_t)(DEFER_HALF_STEPS * half_step));
}

#define DEAD_STEP 20861 /**< 65536 / pi: from half a step, radians * 65536, to a step, angle counts */

INLINE const dead_duties_t *dead_of_pulse(const drive_t *d)
{
    if (DEAD_EACH && (d->ticks & (SLOW_EVERY - 1u)) == 0u) {
        return &d->dead_second;
    }
    return &d->dead;
}

void dead_prepare_second(drive_t *d, const drive_params_t *p, dq_t asked)
{
    if (DEAD_EACH) {
        sincos_t frame = d->frame;
        if (!drive_is_forced(d)) {
            frame = trig_sincos((angle_t)(d->angle + (uint16_t)qm_mulhi(d->run.estimator.half_step_q16_rad, DEAD_STEP)));
        }
        svm_compensation(&p->svm, phases_of(asked, frame), &d->dead_second);
    }
}
