/* The load observer's constants, of the shaft and of its rates.
 *
 *     J dw/dt = Kt (i_q - i_load)                              the shaft
 *     dw/dt += 2 r (w^ - w),   d i_load/dt = -r^2 J/Kt (w^ - w)    both poles at the rate r: a Luenberger observer
 *
 * A step is SLOW_PERIODS. Below the electrical frequency LOAD_BANDWIDTH_HZ / 2.7 times 2 pi (PARAM_FULL_RATIO) rates fall with the speed. */
#ifndef DRIVE_SCALING_LOAD_OBSERVER_H
#define DRIVE_SCALING_LOAD_OBSERVER_H

#include "drive/scaling/controllers.h"
#include "drive/scaling/current_voltage.h"

/** Acceleration of a count of q current, counts of speed a step; 2^PARAM_ACCEL_SHIFT of the observer's units are one of them. */
#define PARAM_ACCEL (PARAM_KT / PARAM_F(MOTOR_INERTIA_KGM2) * PARAM_F(NOPOLESPAIRS) * 60.0F / (2.0F * PARAM_PI) * 4.0F * PARAM_F(NORM_CURRENT_CONST) \
                     * PARAM_STEP_SEC / PARAM_F(SPEED_UNIT))
#define PARAM_ACCEL_SHIFT ((uint16_t)(PARAM_ACCEL >= 0.5F               ? 0 \
                                      : PARAM_ACCEL >= 0.25F            ? 1 \
                                      : PARAM_ACCEL >= 0.125F           ? 2 \
                                      : PARAM_ACCEL >= 0.0625F          ? 3 \
                                      : PARAM_ACCEL >= 0.03125F         ? 4 \
                                      : PARAM_ACCEL >= 1.5625e-2F       ? 5 \
                                      : PARAM_ACCEL >= 7.8125e-3F       ? 6 \
                                      : PARAM_ACCEL >= 3.90625e-3F      ? 7 \
                                      : PARAM_ACCEL >= 1.953125e-3F     ? 8 \
                                      : PARAM_ACCEL >= 9.765625e-4F     ? 9 \
                                      : PARAM_ACCEL >= 4.8828125e-4F    ? 10 \
                                      : PARAM_ACCEL >= 2.44140625e-4F   ? 11 \
                                      : PARAM_ACCEL >= 1.220703125e-4F  ? 12 \
                                      : PARAM_ACCEL >= 6.103515625e-5F  ? 13 \
                                      : PARAM_ACCEL >= 3.0517578125e-5F ? 14 \
                                                                        : 15))
#define PARAM_ACCEL_UNITS (PARAM_ACCEL * (float)(1L << PARAM_ACCEL_SHIFT)) /* 0.5 .. 1 a count */

/* ---- Rates in rad/s times the step ---- */
#define PARAM_RATE_Q16(hz) (2.0F * PARAM_PI * (hz)*PARAM_STEP_SEC * 65536.0F)
#define PARAM_QUICK_Q16 PARAM_RATE_Q16(PARAM_F(LOAD_BANDWIDTH_HZ))
#define PARAM_LOADED_Q16 (PARAM_F(PARAM_LOADED_SHARE) * PARAM_QUICK_Q16)
#define PARAM_QUIET_Q16 PARAM_MIN(PARAM_RATE_Q16(PARAM_F(PARAM_QUIET_RATIO) * PARAM_F(SPEED_BANDWIDTH_HZ)), PARAM_LOADED_Q16)
/** In full the rates need an estimator that is as quick. */
#define PARAM_FULL_ERPM (60.0F / PARAM_F(PARAM_FULL_RATIO) * PARAM_F(LOAD_BANDWIDTH_HZ))

/* ---- Where a load and an innovation are clear of what dead time leaves ---- */
#define PARAM_LOAD_FROM PARAM_MIN(PARAM_MAX(PARAM_F(PARAM_LOAD_FROM_LOST) * PARAM_LOST_CURRENT_Q13 * PARAM_ACCEL_UNITS, 1.0F), 16000.0F)
#define PARAM_LARGE_ERPM (PARAM_F(GATE_SHARE) * PARAM_DEAD_TIME_V * PARAM_ERPM_PER_V)
#define PARAM_LARGE_LOADED_ERPM (PARAM_F(GATE_LOADED_SHARE) * PARAM_DEAD_TIME_V * PARAM_ERPM_PER_V)
/** Innovation at which the load changes by 16000 units in a step: both words of its product are full. */
#define PARAM_INNOVATION_MAX PARAM_MIN(16383.0F, 16000.0F * 65536.0F * 65536.0F / (PARAM_QUICK_Q16 * PARAM_QUICK_Q16) / (float)(1L << PARAM_ACCEL_SHIFT))

/** Mean innovation of a load, in Kt/J i / r with the i of MAXIMUM_CURRENT_A. One that swings between 0 and i where the observer is worst, at w = r:
 *  1/2 / 2, and 2/pi of that in the mean. A step to i: t r exp(-r t), at most 1/e; it opens the gate, which ends it within WRONG_SEC if not slow. */
#define PARAM_LOAD_MEAN PARAM_MAX(0.5F / PARAM_PI, PARAM_MIN(0.36788F, 1.0F / (2.0F * PARAM_PI * PARAM_F(LOAD_BANDWIDTH_HZ) * PARAM_F(WRONG_SEC))))
#define PARAM_LOAD_ERPM PARAM_MIN(PARAM_ACCEL *PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) * PARAM_LOAD_MEAN / (PARAM_LOADED_Q16 / 65536.0F), 32767.0F)

/* A speed's angle is rounded as the estimator rounds it. */
#define PARAM_OBSERVER_INIT \
    { \
        .deltat_q32 = (int16_t)((1 + DEFER_DUTIES) * PARAM_ROUND(PARAM_DELTAT_Q32)), \
        .per_turn_q12 = (int16_t)(65536.0F * 4096.0F / ((float)SLOW_PERIODS * PARAM_DELTAT_Q32) + 0.5F), \
        .shift = PARAM_ACCEL_SHIFT, \
        .per_current_q16 = (uint16_t)PARAM_MIN(PARAM_ACCEL_UNITS * 65536.0F + 0.5F, 65535.0F), \
        .per_unit_q15 = (uint16_t)PARAM_MIN(32768.0F / PARAM_ACCEL_UNITS + 0.5F, 65535.0F), \
        .innovation_max_erpm = (int16_t)PARAM_INNOVATION_MAX, \
        .load_max = (int16_t)(PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) * PARAM_ACCEL_UNITS), \
        .quiet_q16 = (int16_t)PARAM_QUIET_Q16, .loaded_q16 = (int16_t)PARAM_LOADED_Q16, .fast_q16 = (int16_t)PARAM_QUICK_Q16, \
        .full_erpm = (int16_t)SPEED_COUNTS(PARAM_FULL_ERPM), .load_from = (int16_t)PARAM_LOAD_FROM, \
        .load_width = (int16_t)PARAM_LOAD_FROM, .load_slope_q15 = (int16_t)(32767.0F / PARAM_LOAD_FROM), \
        .gate_erpm = (int16_t)SPEED_COUNTS(PARAM_LARGE_ERPM), \
        .gate_loaded_erpm = (int16_t)SPEED_COUNTS(PARAM_LARGE_LOADED_ERPM) \
    }

#endif
