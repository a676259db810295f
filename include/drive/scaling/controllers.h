/* The gains of the controllers and of the load observer, from bandwidths, and the d current's.
 *
 *     current loops: Kp = 2 pi f L, Ki = 2 pi f R    the zero cancels the pole of u = R i + L di/dt
 *     speed loop:    Kp = 2 pi f J/Kt, Kt = 3/2 p psi    the load observer takes the place of the integral (control/observer.h)
 *     shaft:         J dw/dt = Kt (i_q - i_load)
 *     load observer: dw/dt += 2 r (w^ - w),   d i_load/dt = -r^2 J/Kt (w^ - w)    both poles at the rate r: a Luenberger observer
 *     burnt:         1.5 R I^2 against the 1.5 V I that half of dead time's voltage V, all that its compensation may leave, gives back
 *
 * A step of the load observer is SLOW_PERIODS. Below the electrical frequency LOAD_BANDWIDTH_HZ / 2.7 times 2 pi (PARAM_FULL_RATIO) its rates fall
 * with the speed.
 *
 * In AN1292's units: Kp/16 and the integral per period, both in full scales I0 and U0. Any gain may be defined in userparams.h instead. */
#ifndef DRIVE_SCALING_CONTROLLERS_H
#define DRIVE_SCALING_CONTROLLERS_H

#include "drive/scaling/current_voltage.h"

/* ---- Current loops ---- */
#ifndef D_CURRCNTR_PTERM
#define D_CURRCNTR_PTERM (2.0F * PARAM_PI * PARAM_F(CURRENT_BANDWIDTH_HZ) * PARAM_F(MOTOR_LS_MH) * 0.001F * PARAM_IU / 16.0F)
#endif
#ifndef D_CURRCNTR_ITERM
#define D_CURRCNTR_ITERM (2.0F * PARAM_PI * PARAM_F(CURRENT_BANDWIDTH_HZ) * PARAM_PHASE_OHM * PARAM_F(LOOPTIME_SEC) * PARAM_IU)
#endif
#ifndef D_CURRCNTR_CTERM
#define D_CURRCNTR_CTERM (1.0F - PARAM_F(CURRENT_KEEP_LESS))
#endif
#ifndef Q_CURRCNTR_PTERM
#define Q_CURRCNTR_PTERM D_CURRCNTR_PTERM
#endif
#ifndef Q_CURRCNTR_ITERM
#define Q_CURRCNTR_ITERM D_CURRCNTR_ITERM
#endif
#ifndef Q_CURRCNTR_CTERM
#define Q_CURRCNTR_CTERM (1.0F - PARAM_F(CURRENT_KEEP_LESS))
#endif
#define CURRENT_PI_SHIFT 10u
#define PARAM_KP(pterm) ((int16_t)PARAM_ROUND(PARAM_F(pterm) * 32768.0F))
#define PARAM_CURRENT_KI(iterm) ((int16_t)PARAM_ROUND(PARAM_F(iterm) * 2048.0F))
#define PARAM_PI_INIT(p, i, c, s) \
    { \
        .kp = PARAM_KP(p), .ki = (i), .kc = PARAM_Q15(c), .shift = (s) \
    }

/* ---- Speed loop ---- */
#define PARAM_KT (1.5F * PARAM_F(MOTOR_KPHI_V_PER_KRPM) / PARAM_SQRT3 * 60.0F / (2000.0F * PARAM_PI)) /* N m per A peak */
#ifndef SPEEDCNTR_PTERM                                                                               /* A per count of speed, over I0 (Q15 counts), /16 */
#define SPEEDCNTR_PTERM (2.0F * PARAM_PI * PARAM_F(SPEED_BANDWIDTH_HZ) * PARAM_F(MOTOR_INERTIA_KGM2) / PARAM_KT \
                         * (2.0F * PARAM_PI / 60.0F) / PARAM_F(NOPOLESPAIRS) / PARAM_F(NORM_CURRENT_CONST) / 16.0F * PARAM_F(SPEED_UNIT))
#endif
/** Largest bandwidth of the speed loop, which falls with the speed as the observer's rates do. */
#define PARAM_CALM_HZ (PARAM_F(PARAM_CALM_SHARE) / 60.0F * PARAM_MAX(PARAM_FULL_ERPM, PARAM_F(MINIMUM_SPEED_RPM) * PARAM_F(NOPOLESPAIRS)))
/** Below, the voltage that dead time's compensation leaves takes the estimator's lock from a rotor under load. */
#define PARAM_LOWEST_ERPM (PARAM_F(PARAM_LOWEST_SHARE) * PARAM_DEAD_TIME_V * PARAM_ERPM_PER_V)
#define PARAM_SLOPE_Q16(rpm_per_s) PARAM_ROUND(SPEED_COUNTS(PARAM_F(rpm_per_s) * PARAM_F(NOPOLESPAIRS)) / SLOW_STEPS_PER_SEC * 65536.0F)
#define SPEEDREFRAMP PARAM_SLOPE_Q16(SPEEDREFRAMP_RPM_PER_S)
#define SPEEDREF_DECEL PARAM_SLOPE_Q16((SPEEDREF_DECEL_RPM_PER_S) ? (SPEEDREF_DECEL_RPM_PER_S) : (SPEEDREFRAMP_RPM_PER_S))
/** TUNING's ramp: Q16 of a count every 8 periods. */
#define TUNING_STEP_Q16 (PARAM_ROUND(SPEED_COUNTS(SLOW_PERIODS) * 65536.0F / (PARAM_F(TUNING_DELAY_RAMPUP) + 1.0F)))

/* ---- Field weakening ---- */
#define PARAM_18_OF(f) f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7), f(8), f(9), f(10), f(11), f(12), f(13), f(14), f(15), f(16), f(17)
#define PARAM_18(f) \
    { \
        PARAM_18_OF(f) \
    }
#define PARAM_IDREF(i) CURRENT_Q13(IDREF_SPEED##i)
#define PARAM_INVKFI_ENTRY(i) ((int16_t)PARAM_ROUND(PARAM_F(INVKFI_SPEED##i)))
#define PARAM_LS_ENTRY(i) ((int16_t)PARAM_ROUND(PARAM_F(LS_OVER2LS0_SPEED##i) * 32768.0F))
#define PARAM_FIELDWEAK_INIT \
    { \
        .idref_q13 = PARAM_18(PARAM_IDREF), \
        .inv_kfi = PARAM_18(PARAM_INVKFI_ENTRY), \
        .ls_over2ls0_q15 = PARAM_18(PARAM_LS_ENTRY), \
        .on_speed_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(FW_START_SPEED_ERPM)), \
        .index_per_count_q16 = (uint16_t)(SPEED_UNIT * (65536l >> SPEED_INDEX_CONST)), \
        .ls_base_q16 = PARAM_SCALED(PARAM_LS_FULL, PARAM_LS_EXP), \
        .kfilter_esdq_q16 = 2 * (KFILTER_ESDQ), \
        .kfilter_esdq_fw_q16 = 2 * (KFILTER_ESDQ_FW), \
        .esdq_per_erpm_q13 = (uint16_t)PARAM_MIN(PARAM_ESDQ_PER_COUNT * 8192.0F + 0.5F, 65535.0F), \
        .trim_max_q13 = CURRENT_Q13(FW_TRIM_CURRENT_A), \
        .trim_step_q13 = FIELDWEAK_TRIM_STEP, \
        .trim_most_q13 = DEFER_DUTIES ? FIELDWEAK_TRIM_DEFERRED : FIELDWEAK_TRIM_MOST, \
        .trim_speed_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(PARAM_F(FW_START_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) * PARAM_F(FIELDWEAK_TRIM_FROM))) \
    }

/* ---- Salient motors: -i_d that doubles the flux, psi/(Lq - Ld), Q13 counts ---- */
#define PARAM_SALIENCE_Q13 (60.0F / (2.0F * PARAM_PI * PARAM_ERPM_PER_V) / (PARAM_MAX(PARAM_F(MOTOR_SALIENCY_UH), 0.001F) * 0.000001F) \
                            / PARAM_F(NORM_CURRENT_CONST) / 4.0F)
#if MOTOR_SALIENCY_UH
#define PARAM_SALIENT_INIT .salience_q13 = (uint16_t)(PARAM_SALIENCE_Q13 + 0.5F)
#else
#define PARAM_SALIENT_INIT
#endif

/* ---- d current that burns the rotor's energy in the winding ---- */
#define PARAM_FLUX_BRAKES (PARAM_F(MOTOR_RS_OHM) * PARAM_F(MAXIMUM_CURRENT_A) > PARAM_F(FLUX_BRAKE_DEAD_SHARE) * PARAM_DEAD_TIME_V)

/* ---- Load observer ---- */
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

/* Its rates in rad/s times the step. */
#define PARAM_RATE_Q16(hz) (2.0F * PARAM_PI * (hz)*PARAM_STEP_SEC * 65536.0F)
#define PARAM_QUICK_Q16 PARAM_RATE_Q16(PARAM_F(LOAD_BANDWIDTH_HZ))
#define PARAM_LOADED_Q16 (PARAM_F(PARAM_LOADED_SHARE) * PARAM_QUICK_Q16)
#define PARAM_QUIET_Q16 PARAM_MIN(PARAM_RATE_Q16(PARAM_F(PARAM_QUIET_RATIO) * PARAM_F(SPEED_BANDWIDTH_HZ)), PARAM_LOADED_Q16)
/** In full the rates need an estimator that is as quick. */
#define PARAM_FULL_ERPM (60.0F / PARAM_F(PARAM_FULL_RATIO) * PARAM_F(LOAD_BANDWIDTH_HZ))

/* Where a load and an innovation are clear of what dead time leaves. */
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
