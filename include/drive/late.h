/* Duties that act a period later (LATE_DUTIES). A period below LATE_BELOW_SEC has no time for conversion and law before the duties load: the next
 * control interrupt writes them first. The law's vector then acts centred on the sample after the next; what belongs to that is here, and nothing
 * of it where the duties are in time. */
#ifndef DRIVE_LATE_H
#define DRIVE_LATE_H

#include "drive/drive.h"

/** Half steps of the angle from the frame that the slow work sees to the middle of the next two pulses, or to the first one. */
#define LATE_HALF_STEPS (3 - DEAD_EACH + 2 * LATE_DUTIES)
/** Largest half step that so many leave within a word. */
#define LATE_HALF_STEP_MOST (32767 / LATE_HALF_STEPS)
/** 1 where no speed that a word holds has a larger one. */
#define LATE_HALF_STEP_FITS (32768.0F * 65536.0F * PARAM_PI / 60.0F * PARAM_F(LOOPTIME_SEC) * PARAM_F(SPEED_UNIT) < 32767.0F / PARAM_F(LATE_HALF_STEPS))

/** As long as ALIGN counts before its first duties are written. */
#define LATE_ALIGN_PERIODS (LATE_DUTIES ? SLOW_PERIODS : 0u)

/** Frame of the pulse whose duties are computed now: the next sample's, or a step further. @param before angle of this period's sample */
QM_INLINE QM_WRAPS sincos_t late_frame(const drive_t *d, angle_t before)
{
    if (LATE_DUTIES) {
        return trig_sincos((angle_t)(2u * (uint32_t)d->angle - before));
    }
    return d->frame;
}

/** The vector that the next pulse is: this one, or the one that has waited. @param v_q13 given to the modulator */
QM_INLINE alphabeta_t late_vector(drive_run_t *run, alphabeta_t v_q13)
{
    if (LATE_DUTIES) {
        alphabeta_t waited = *run->late_v_q13;
        *run->late_v_q13 = v_q13;
        return waited;
    }
    return v_q13;
}

/** The estimator and what waits, as if this vector had acted all the time. */
QM_INLINE void late_preset(drive_run_t *run, alphabeta_t v_q13)
{
    run->estimator.v_last_q13 = v_q13;
    run->estimator.v_mean_q13 = v_q13;
    (void)late_vector(run, v_q13);
}

/** The asked currents at the middle of the next two pulses, or of the first one. */
QM_INLINE dq_t late_asked(const drive_run_t *run)
{
    int16_t half_step = run->estimator.half_step_q16_rad;
    if (!LATE_HALF_STEP_FITS) {
        half_step = qm_limit(half_step, LATE_HALF_STEP_MOST);
    }
    return dq_turn(run->control.ref_q13, (int16_t)(LATE_HALF_STEPS * half_step));
}

/** Which call of the round's this is. */
QM_INLINE uint16_t late_call(uint16_t ticks)
{
    return (uint16_t)((ticks / SLOW_EVERY) & (SLOW_CALLS - 1u));
}

/** The part of the round that a call belongs to. */
QM_INLINE uint16_t late_part(uint16_t call)
{
    return (uint16_t)(call >> LATE_DUTIES);
}

/** 1 in a call that takes the first half of its part. */
QM_INLINE uint16_t late_first(uint16_t call)
{
    return (uint16_t)(!LATE_DUTIES || (call & 1u) == 0u);
}

/** 1 in a call that takes the second half: with duties in time a call takes both. */
QM_INLINE uint16_t late_second(uint16_t call)
{
    return (uint16_t)(!LATE_DUTIES || (call & 1u) != 0u);
}

/** What the self-test's sum gets for a part, or for its half. @param part that came to its end */
QM_INLINE uint16_t late_mark(uint16_t part, uint16_t call)
{
    return (uint16_t)(LATE_DUTIES ? 2u * part + (call & 1u) : part);
}

#endif
