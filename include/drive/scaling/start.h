/* The start's constants: align, ramp, hand-over.
 *
 *     align: I(t) = I t/T while the vector turns n times in T:  n/T turns a second        (AN1292: LOCK_TIME)
 *     ramp:  dw/dt constant, to END_SPEED_RPM      (AN1292: OPENLOOP_RAMPSPEED_INCREASERATE; 2^26 counts a turn: Q10 of 2^16)
 *     hand-over: from w = 2 pi 20 Hz (PARAM_EARLY_HZ) or 1.25 times the minimum speed on; the estimator's lock is as quick as the rotor turns */
#ifndef DRIVE_SCALING_START_H
#define DRIVE_SCALING_START_H

#include "drive/scaling/current_voltage.h"

/** From here on the back-EMF is enough for a hand-over. */
#define PARAM_EARLY_ERPM PARAM_MIN(PARAM_F(ENDSPEED_ELECTR), PARAM_MAX(60.0F * PARAM_F(PARAM_EARLY_HZ), PARAM_F(PARAM_EARLY_SHARE) * PARAM_F(MINIMUM_SPEED_ERPM)))

#define PARAM_FORCED_INIT \
    { \
        .end_speed_q10 = PARAM_ROUND(PARAM_F(END_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) * PARAM_F(LOOPTIME_SEC) / 60.0F * 67108864.0F), \
        .increase_rate_q10 = OPENLOOP_RAMPSPEED_INCREASERATE \
    }

/** The fields of drive_params_t that are the start's. */
#define PARAM_START_INIT \
    .offset_max_q13 = (int16_t)(8192.0F * PARAM_F(OFFSET_MOST_SHARE)), \
    .bootstrap_periods = PARAM_PERIODS(BOOTSTRAP_SEC), \
    .flying_start = (uint16_t)((FLYING_START) ? 1 : 0), \
    .align_periods = LOCK_TIME, \
    .align_rate_q12 = (uint16_t)(PARAM_F(Q_CURRENT_REF_OPENLOOP) / PARAM_F(NORM_CURRENT_CONST) * 1024.0F / PARAM_F(LOCK_TIME) + 0.5F), \
    .align_speed_q10 = (int32_t)((PARAM_ALIGN_TURNS * 67108864l + LOCK_TIME / 2) / LOCK_TIME), \
    .early_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(PARAM_EARLY_ERPM)), \
    .agree_steps = PARAM_SLOW_STEPS(AGREE_SEC), \
    .wait_periods = PARAM_PERIODS(WAIT_SEC), \
    .open_loop_q13 = CURRENT_Q13(Q_CURRENT_REF_OPENLOOP)

#endif
