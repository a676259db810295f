/* What duties that act a period later add to a run, and a compensation of dead time for each pulse: nothing where they act in time and one serves two. */
#include "drive/deferred.h"

#include "drive/drive.h"

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

/* ---- What a compensation of dead time for each pulse adds to the state: nothing where one serves two ---- */

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
