/* From userparams.h to counts: AN1292's constants, and the parameter structures of the control law and the drive.
 *
 * Every constant is a single-precision expression, so that the target's compiler (whose double has 32 bits) and a PC's
 * fold it to the same integer. Equation numbers are AN1292's, in their corrected form (docs/architecture.md). */
#ifndef DRIVE_PARAM_SCALING_H
#define DRIVE_PARAM_SCALING_H

#include <stdint.h>

#include "userparams.h"

#define PARAM_F(x) ((float)(x))
#define PARAM_ROUND(x) ((int32_t)((x) + (((x) < 0.0F) ? -0.5F : 0.5F)))
#define PARAM_PI 3.14159265F
#define PARAM_SQRT3 1.73205081F

/* ---- The unit of speed: a count of a speed_erpm_t is so many electrical rpm that the maximum speed, with what it may overshoot, fits a word ---- */
#define SPEED_UNIT_ERPM 32000 /* most with one electrical rpm a count; the tuner reads it */
#define PARAM_TOP_ERPM (PARAM_F(MAXIMUM_SPEED_RPM) * PARAM_F(NOPOLESPAIRS))
#define SPEED_UNIT ((PARAM_TOP_ERPM <= PARAM_F(SPEED_UNIT_ERPM)) ? 1 : (PARAM_TOP_ERPM <= 2.0F * PARAM_F(SPEED_UNIT_ERPM)) ? 2 \
                                                                                                                           : 4)
/** Counts of so many electrical rpm, as a float. */
#define SPEED_COUNTS(erpm) (PARAM_F(erpm) / PARAM_F(SPEED_UNIT))

/** Q15 of a fraction, rounded as AN1292 does: positive * 32767, negative * 32768. */
#define Q15(x) ((int16_t)((PARAM_F(x) < 0.0F) ? PARAM_F(x) * 32768.0F - 0.5F : PARAM_F(x) * 32767.0F + 0.5F))
/** Counts of a current in AN1292's format (Q15 of full scale): NORM_CURRENT(1.41) = 11653 at 0.000121 A/count. */
#define NORM_CURRENT(current_a) Q15(PARAM_F(current_a) / PARAM_F(NORM_CURRENT_CONST) / 32768.0F)

/* ---- Base quantities (facts: U0 is the largest phase voltage Vbus/sqrt(3), less the dead time's share) ---- */
#define NORM_VOLTAGE_CONST (PARAM_F(NOMINAL_BUS_V) / PARAM_SQRT3 * (1.0F - PARAM_F(DEADTIME_SEC) / PARAM_F(LOOPTIME_SEC)) / 32768.0F)
#define PARAM_IU (PARAM_F(NORM_CURRENT_CONST) / NORM_VOLTAGE_CONST) /* I0/U0, A/V */

/* ---- AN1292's motor constants, Equations 5 and 6, pre-divided by 2, 256 and 2. The estimator has formats of its own
 * for R and L, which fit where these two end at 32767. ---- */
/* The speed filter runs every second period: two steps of Equation 7 in one. */
#define PARAM_VELESTIM_Q16 ((int16_t)PARAM_ROUND(PARAM_F(KFILTER_VELESTIM) * (4.0F - PARAM_F(KFILTER_VELESTIM) / 16384.0F)))
#define PARAM_AN1292(x) ((int16_t)PARAM_ROUND(((x) < 32767.0F) ? (x) : 32767.0F))
#define NORM_RS PARAM_AN1292(PARAM_F(MOTOR_RS_OHM) * PARAM_IU * 16384.0F)
#define NORM_LSDTBASE PARAM_AN1292(PARAM_F(MOTOR_LS_MH) * 0.001F / PARAM_F(LOOPTIME_SEC) * PARAM_IU * 128.0F)
#define PARAM_INVKFI (PARAM_SQRT3 * 1000.0F * PARAM_F(NOPOLESPAIRS) * NORM_VOLTAGE_CONST / PARAM_F(MOTOR_KPHI_V_PER_KRPM) * 16384.0F / PARAM_F(SPEED_UNIT))
#define NORM_INVKFIBASE ((int16_t)PARAM_ROUND(PARAM_INVKFI))
#define NORM_DELTAT ((int16_t)PARAM_ROUND(PARAM_F(LOOPTIME_SEC) / 60.0F * 2147483648.0F * PARAM_F(SPEED_UNIT)))

/* ---- Speeds in electrical rpm; param_init.h makes counts of them ---- */
#define PARAM_ERPM(rpm) PARAM_ROUND(PARAM_F(rpm) * PARAM_F(NOPOLESPAIRS))
#define MINIMUM_SPEED_ERPM PARAM_ERPM(MINIMUM_SPEED_RPM)
#define NOMINAL_SPEED_ERPM PARAM_ERPM(NOMINAL_SPEED_RPM)
#define MAXIMUMSPEED_ELECTR PARAM_ERPM(MAXIMUM_SPEED_RPM)
#define ENDSPEED_ELECTR PARAM_ERPM(END_SPEED_RPM)
#define DECIMATE_NOMINAL_SPEED PARAM_ERPM(PARAM_F(NOMINAL_SPEED_RPM) / 10.0F)
#define FW_START_SPEED_ERPM PARAM_ERPM(FW_START_SPEED_RPM)

/* ---- The drive's own number formats (see control/qmath.h) ---- */
#define CURRENT_Q13(current_a) ((int16_t)PARAM_ROUND(PARAM_F(current_a) / PARAM_F(NORM_CURRENT_CONST) / 4.0F))
#define CURRENT_Q14_F(current_a) (PARAM_F(current_a) / PARAM_F(NORM_CURRENT_CONST) / 2.0F)
#define VOLTAGE_Q14(voltage_v) ((int16_t)PARAM_ROUND(PARAM_F(voltage_v) / NORM_VOLTAGE_CONST / 2.0F))
#define BUS_Q15(voltage_v) ((int16_t)PARAM_ROUND(PARAM_F(voltage_v) / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F))

/* ---- Estimator ---- */
/** Angle per period and count of speed, 2^32 a turn (NORM_DELTAT, unrounded). */
#define PARAM_DELTAT_Q32 (PARAM_F(LOOPTIME_SEC) / 60.0F * 4294967296.0F * PARAM_F(SPEED_UNIT))
#define PARAM_EXP(x) ((uint16_t)(((x) < 65535.0F) ? 0 : ((x) < 131071.0F) ? 1 \
                                                    : ((x) < 262143.0F)   ? 2 \
                                                                          : 3))
#define PARAM_RS_FULL (PARAM_F(MOTOR_RS_OHM) * PARAM_IU * 32768.0F)
#define PARAM_LS_FULL (PARAM_F(MOTOR_LS_MH) * 0.001F / PARAM_F(LOOPTIME_SEC) * PARAM_IU * 4096.0F)
#define PARAM_SCALED(x, exp) ((uint16_t)((x) / (float)(1 << (exp)) + 0.5F))
#define PARAM_RS_EXP PARAM_EXP(PARAM_RS_FULL)
#define PARAM_LS_EXP PARAM_EXP(PARAM_LS_FULL * 1.2F) /* LS_OVER2LS0 may raise it by a fifth */
/* A sine of the largest current changes by 2 pi f Ts I a period; AN1292's formula has 2 in place of 2 pi I/Ipeak and clips. */
#define PARAM_DI(rpm) (2.0F * PARAM_PI * PARAM_F(rpm) / 60.0F * PARAM_F(NOPOLESPAIRS) * PARAM_F(LOOPTIME_SEC) * CURRENT_Q14_F(MAXIMUM_CURRENT_A))
#define PARAM_MIN(a, b) (((a) < (b)) ? (a) : (b))
#define PARAM_MAX(a, b) (((a) > (b)) ? (a) : (b))
/** Largest back-EMF Equation 4 can give below the trip levels: voltage limit + R i + L di/dt. Must fit its Q13 format.
 *  LS_OVER2LS0 may raise Ls by 1.2; below nominal speed turning the old difference forward may lengthen an axis by 1.5. */
#define PARAM_EMF_MAX_V (PARAM_MOST_V + PARAM_TRIP_RI_V + PARAM_LDI_V)
#define PARAM_USED_BUS_V PARAM_MIN(PARAM_F(OVER_VOLTAGE_V), 1.25F * PARAM_F(NOMINAL_BUS_V)) /* a bus that braking lifts serves nobody */
#define PARAM_MOST_V (PARAM_USED_BUS_V / PARAM_SQRT3)
#define PARAM_TRIP_RI_V (2.0F / PARAM_SQRT3 * PARAM_F(OVER_CURRENT_THRESHOLD_A) * PARAM_F(MOTOR_RS_OHM))
#define PARAM_FASTEST_RPM PARAM_MAX(PARAM_F(MAXIMUM_SPEED_RPM), 1.5F * PARAM_F(NOMINAL_SPEED_RPM))
#define PARAM_LDI_V (2.0F * PARAM_PI / 60.0F * PARAM_FASTEST_RPM * PARAM_F(NOPOLESPAIRS) * 1.2F * PARAM_F(MOTOR_LS_MH) * 0.001F * PARAM_F(MAXIMUM_CURRENT_A))
#define PARAM_EMF_END_V (0.98F * 131068.0F * NORM_VOLTAGE_CONST) /* an axis may be lengthened by the turn to the middle of the period */
/** The adaptation raises R, too. What is missing for that the limits of L di/dt give, which full current at full speed alone would reach: at most a
 *  quarter of it; then R rises less, and tells nothing of the winding's temperature. */
#define PARAM_RS_MOST 0.6
#define PARAM_LDI_SHARE PARAM_MAX(0.75F, PARAM_MIN(1.0F, (PARAM_EMF_END_V - PARAM_MOST_V - (1.0F + PARAM_F(PARAM_RS_MOST)) * PARAM_TRIP_RI_V) / PARAM_LDI_V))
#define PARAM_LDI_LS_SHARE PARAM_MIN(1.0F, PARAM_LDI_SHARE *PARAM_FASTEST_RPM / (1.5F * PARAM_F(NOMINAL_SPEED_RPM)))
#define PARAM_RS_ROOM ((PARAM_EMF_END_V - PARAM_MOST_V - PARAM_LDI_SHARE * PARAM_LDI_V) / PARAM_TRIP_RI_V - 1.0F)
#define PARAM_RS_RISES PARAM_MAX(0.0F, PARAM_MIN(PARAM_F(PARAM_RS_MOST), PARAM_RS_ROOM))
/** Below it the derivative spans eight samples, in which the current turns by 43 degrees at most: AN1292's nominal speed, or less with a long period. */
#define EIGHT_SAMPLES_ERPM PARAM_MIN(PARAM_F(NOMINAL_SPEED_ERPM), PARAM_F(PARAM_EIGHT_TURN) * 60.0F / (8.0F * PARAM_F(LOOPTIME_SEC)))
#define PARAM_EIGHT_TURN 0.12
#define D_ILIMIT_LS_Q14 ((int16_t)PARAM_MIN(8.0F * PARAM_DI(EIGHT_SAMPLES_ERPM / PARAM_F(NOPOLESPAIRS)) + 0.5F, 16383.0F))
#define D_ILIMIT_HS_Q14 ((int16_t)PARAM_MIN(PARAM_DI(MAXIMUM_SPEED_RPM) + 0.5F, 4095.0F))
#define PARAM_LDI_LS_Q14 ((int16_t)PARAM_MIN(8.0F * PARAM_LDI_LS_SHARE * PARAM_DI(EIGHT_SAMPLES_ERPM / PARAM_F(NOPOLESPAIRS)) + 0.5F, 16383.0F))
#define PARAM_LDI_HS_Q14 ((int16_t)PARAM_MIN(PARAM_LDI_SHARE * PARAM_DI(MAXIMUM_SPEED_RPM) + 0.5F, 4095.0F))
#define D_ILIMIT_LS ((int16_t)(2 * D_ILIMIT_LS_Q14)) /* in AN1292's format */
#define D_ILIMIT_HS ((int16_t)(2 * D_ILIMIT_HS_Q14))

/* ---- Controllers: gains in AN1292's units (gain/16 and per-period integral, in full scales) from bandwidths.
 *      Current loops: pole-zero cancellation, Kp = 2 pi f L, Ki = 2 pi f R. Speed loop: Kp = 2 pi f J/Kt, and the load observer.
 *      Any of them may be defined in userparams.h instead. ---- */
#define PARAM_KT (1.5F * PARAM_F(MOTOR_KPHI_V_PER_KRPM) / PARAM_SQRT3 * 60.0F / (2000.0F * PARAM_PI)) /* N m per A peak */
#ifndef D_CURRCNTR_PTERM
#define D_CURRCNTR_PTERM (2.0F * PARAM_PI * PARAM_F(CURRENT_BANDWIDTH_HZ) * PARAM_F(MOTOR_LS_MH) * 0.001F * PARAM_IU / 16.0F)
#endif
#ifndef D_CURRCNTR_ITERM
#define D_CURRCNTR_ITERM (2.0F * PARAM_PI * PARAM_F(CURRENT_BANDWIDTH_HZ) * PARAM_F(MOTOR_RS_OHM) * PARAM_F(LOOPTIME_SEC) * PARAM_IU)
#endif
#ifndef D_CURRCNTR_CTERM
#define D_CURRCNTR_CTERM 0.999
#endif
#ifndef Q_CURRCNTR_PTERM
#define Q_CURRCNTR_PTERM D_CURRCNTR_PTERM
#endif
#ifndef Q_CURRCNTR_ITERM
#define Q_CURRCNTR_ITERM D_CURRCNTR_ITERM
#endif
#ifndef Q_CURRCNTR_CTERM
#define Q_CURRCNTR_CTERM 0.999
#endif
#ifndef SPEEDCNTR_PTERM /* 2 pi f J/Kt, in A per count of speed, over I0 (Q15 counts), /16 */
#define SPEEDCNTR_PTERM (2.0F * PARAM_PI * PARAM_F(SPEED_BANDWIDTH_HZ) * PARAM_F(MOTOR_INERTIA_KGM2) / PARAM_KT \
                         * (2.0F * PARAM_PI / 60.0F) / PARAM_F(NOPOLESPAIRS) / PARAM_F(NORM_CURRENT_CONST) / 16.0F * PARAM_F(SPEED_UNIT))
#endif
#define CURRENT_PI_SHIFT 10u
#define PARAM_KP(pterm) ((int16_t)PARAM_ROUND(PARAM_F(pterm) * 32768.0F))
#define PARAM_CURRENT_KI(iterm) ((int16_t)PARAM_ROUND(PARAM_F(iterm) * 2048.0F))

/* ---- Modulator and bus ---- */
#define PWM_TICK_SEC 0.000000025F                                         /* one PWM clock at 40 MIPS; two duty counts */
#define PARAM_PWM_PERIODS (PARAM_F(LOOPTIME_SEC) / (2.0F * PWM_TICK_SEC)) /* the counter's way, up or down */
#define PARAM_PWM_REST PARAM_MAX(PARAM_PWM_PERIODS - PARAM_F(PARAM_ROUND(PARAM_PWM_PERIODS)), PARAM_F(PARAM_ROUND(PARAM_PWM_PERIODS)) - PARAM_PWM_PERIODS)
#define PWM_FULL_DUTY ((int16_t)PARAM_ROUND(PARAM_F(LOOPTIME_SEC) / PWM_TICK_SEC))
#define PWM_TOP_DUTY ((int16_t)(PWM_FULL_DUTY - 2 * PARAM_ROUND(PARAM_F(SAMPLE_WINDOW_SEC) / PWM_TICK_SEC)))
#define DEAD_TIME_DUTY ((int16_t)PARAM_ROUND(PARAM_F(DEADTIME_SEC) / PWM_TICK_SEC))
/* A phase current below Vbus/2 Td/L ends within the dead time, and the voltage that is lost falls with it. Compensation is linear below a
 * quarter of that: a little too much at small currents looks like a resistance that damps, too little like one that drives. */
#define PARAM_LOST_CURRENT_Q13 (PARAM_F(NOMINAL_BUS_V) / 2.0F * PARAM_F(DEADTIME_SEC) / (PARAM_F(MOTOR_LS_MH) * 0.001F) / PARAM_F(NORM_CURRENT_CONST) / 4.0F)
#define DEAD_TIME_KNEE_Q13 ((int16_t)PARAM_MAX(PARAM_LOST_CURRENT_Q13 / 4.0F + 0.5F, 2.0F))
#define DEAD_TIME_SLOPE_Q8 ((int16_t)(DEAD_TIME_DUTY * 256 / DEAD_TIME_KNEE_Q13))
#define PARAM_DEAD_TIME_V (PARAM_F(NOMINAL_BUS_V) * PARAM_F(DEADTIME_SEC) / PARAM_F(LOOPTIME_SEC))        /* what it takes from a leg */
#define PARAM_ERPM_PER_V (PARAM_SQRT3 * 1000.0F * PARAM_F(NOPOLESPAIRS) / PARAM_F(MOTOR_KPHI_V_PER_KRPM)) /* speed of a phase back-EMF */
/** Circle inside the usable hexagon, in Q14 voltage per Q16 bus: top duty / sqrt(3). */
#define PARAM_VOLTAGE_PER_BUS (PARAM_F(PWM_TOP_DUTY) / PARAM_F(PWM_FULL_DUTY) / PARAM_SQRT3 * PARAM_F(BUS_FULL_SCALE_V) / NORM_VOLTAGE_CONST / 2.0F)
/* The supply may be a sixteenth of the bus range: the bus is shifted left to fill its word. */
#define BUS_SHIFT ((uint16_t)((PARAM_VOLTAGE_PER_BUS < 65535.0F) ? 1 : (PARAM_VOLTAGE_PER_BUS < 131070.0F) ? 2 \
                                                                                                           : 3))
#define VOLTAGE_LIMIT_PER_BUS_Q16 ((uint16_t)(PARAM_VOLTAGE_PER_BUS * 2.0F / (float)(1 << BUS_SHIFT)))
/** duty counts per Q13 voltage count * 65536 = this / bus in Q16 of full scale. */
#define DUTY_PER_VOLT_NUMERATOR ((uint32_t)(PARAM_F(PWM_FULL_DUTY) * 4.0F * NORM_VOLTAGE_CONST / PARAM_F(BUS_FULL_SCALE_V) * 4294967296.0F))

/* ---- Duties: in time for the next pulse, or in a shorter period for the one after it (drive/late.h). The tuner reads the period. ---- */
#define LATE_BELOW_SEC 0.00004
#define LATE_DUTIES (PARAM_F(LOOPTIME_SEC) < PARAM_F(LATE_BELOW_SEC))

/** Two pulses have one compensation of dead time, unless the rotor may turn by more than 12 degrees in a period. */
#define DEAD_EACH_TURN 0.0333
#define DEAD_EACH (PARAM_TOP_ERPM / 60.0F * PARAM_F(LOOPTIME_SEC) > PARAM_F(DEAD_EACH_TURN))

/* ---- The slow work: a part of it follows every second period, with late duties half a part. Sixteen parts are a round: speed and bus come every slow step,
 *      four times in it; limits and rates every rare step, twice; the others once, every seldom step. The tools read the periods. ---- */
#define SLOW_EVERY 2u
#define SLOW_PARTS 16u /* of a round */
#define SLOW_PERIODS_IN_TIME 8
#define SLOW_CALLS ((LATE_DUTIES) ? 2u * SLOW_PARTS : SLOW_PARTS)                                     /* of a round */
#define SLOW_PERIODS ((LATE_DUTIES) ? 2u * (SLOW_PERIODS_IN_TIME) : (unsigned)(SLOW_PERIODS_IN_TIME)) /* of a slow step */
#define SLOW_RARE 2u                                                                                  /* slow steps in a rare one */
#define SLOW_SELDOM 4u                                                                                /* and in a seldom one, which is a round */
#define SLOW_STEPS_PER_SEC (1.0F / PARAM_STEP_SEC)
#define PARAM_SLOW_STEPS(time_s) ((uint16_t)PARAM_ROUND(PARAM_F(time_s) * SLOW_STEPS_PER_SEC))
#define PARAM_RARE_STEPS(time_s) ((uint16_t)PARAM_ROUND(PARAM_F(time_s) * SLOW_STEPS_PER_SEC / (float)SLOW_RARE))
#define PARAM_SELDOM_STEPS(time_s) ((uint16_t)PARAM_ROUND(PARAM_F(time_s) * SLOW_STEPS_PER_SEC / (float)SLOW_SELDOM))
#define PARAM_PERIODS(time_s) ((uint16_t)PARAM_ROUND(PARAM_F(time_s) / PARAM_F(LOOPTIME_SEC)))
#define PARAM_STEP_SEC ((float)SLOW_PERIODS * PARAM_F(LOOPTIME_SEC))
#define SPEEDREFRAMP PARAM_ROUND(SPEED_COUNTS(PARAM_F(SPEEDREFRAMP_RPM_PER_S) * PARAM_F(NOPOLESPAIRS)) / SLOW_STEPS_PER_SEC * 65536.0F)
/* ---- The start. The tuner reads the turns. ---- */
#define PARAM_ALIGN_TURNS 5    /* of the vector while the current of ALIGN grows */
#define PARAM_EARLY_HZ 20      /* electrical frequency from which the load observer is quick enough to catch the rotor */
#define PARAM_EARLY_SHARE 1.25 /* of the minimum speed, at least */
/** From here on the back-EMF is enough for a hand-over. */
#define PARAM_EARLY_ERPM PARAM_MIN(PARAM_F(ENDSPEED_ELECTR), PARAM_MAX(60.0F * PARAM_F(PARAM_EARLY_HZ), PARAM_F(PARAM_EARLY_SHARE) * PARAM_F(MINIMUM_SPEED_ERPM)))
/* ---- Load observer (control/observer.h), adaptation, low speed. Rates in rad/s times the slow step. The tuner reads the ratios. ---- */
#define PARAM_QUIET_RATIO 1.22  /* rate without load over SPEED_BANDWIDTH_HZ */
#define PARAM_LOADED_SHARE 0.3  /* rate under load over LOAD_BANDWIDTH_HZ */
#define PARAM_QUICK_GAIN 1.8    /* of the speed controller after a large innovation */
#define PARAM_FULL_RATIO 2.7    /* LOAD_BANDWIDTH_HZ over the electrical frequency from which rates and gain are in full */
#define PARAM_ESDQ_RATIO 5      /* corner of the back-EMF filter at low speed over the electrical frequency */
#define PARAM_LOWEST_SHARE 0.65 /* back-EMF over dead-time voltage at the lowest speed at which a rotor is held; times 1732 in a message of the table */
#define PARAM_CALM_SHARE 0.4    /* most of SPEED_BANDWIDTH_HZ over the electrical frequency: beyond it the speed hunts without load; over 2.7 in a message */
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
#define PARAM_RATE_Q16(hz) (2.0F * PARAM_PI * (hz)*PARAM_STEP_SEC * 65536.0F)
#define PARAM_QUICK_Q16 PARAM_RATE_Q16(PARAM_F(LOAD_BANDWIDTH_HZ))
#define PARAM_LOADED_Q16 (PARAM_F(PARAM_LOADED_SHARE) * PARAM_QUICK_Q16)
#define PARAM_QUIET_Q16 PARAM_MIN(PARAM_RATE_Q16(PARAM_F(PARAM_QUIET_RATIO) * PARAM_F(SPEED_BANDWIDTH_HZ)), PARAM_LOADED_Q16)
/** In full the rates need an estimator that is as quick: electrical speed in rad/s above the quick one / 2.7. */
#define PARAM_FULL_ERPM (60.0F / PARAM_F(PARAM_FULL_RATIO) * PARAM_F(LOAD_BANDWIDTH_HZ))
/** Below, the voltage that dead time's compensation leaves takes the estimator's lock from a rotor under load. */
#define PARAM_LOWEST_ERPM (PARAM_F(PARAM_LOWEST_SHARE) * PARAM_DEAD_TIME_V * PARAM_ERPM_PER_V)
/** Largest bandwidth of the speed loop, which falls with the speed as the rates do. */
#define PARAM_CALM_HZ (PARAM_F(PARAM_CALM_SHARE) / 60.0F * PARAM_MAX(PARAM_FULL_ERPM, PARAM_F(MINIMUM_SPEED_RPM) * PARAM_F(NOPOLESPAIRS)))
/** d current I burns 1.5 R I^2; half of dead time's voltage, all that its compensation may leave where the current's ripple crosses zero, turns it by an
 *  angle that brakes and gives back 1.5 V I. */
#define PARAM_BURNS (PARAM_F(MOTOR_RS_OHM) * PARAM_F(MAXIMUM_CURRENT_A) > 0.5F * PARAM_DEAD_TIME_V)
#define PARAM_LOAD_FROM_LOST 5 /* times the current that dead time loses */
/** Where the load's current is clear of what dead time leaves; within what the observer's schedule divides by. */
#define PARAM_LOAD_FROM PARAM_MIN(PARAM_MAX(PARAM_F(PARAM_LOAD_FROM_LOST) * PARAM_LOST_CURRENT_Q13 * PARAM_ACCEL_UNITS, 1.0F), 16000.0F)
/** A large innovation: without load above what dead time's compensation leaves. */
#define PARAM_LARGE_ERPM (0.13F * PARAM_DEAD_TIME_V * PARAM_ERPM_PER_V)
#define PARAM_LARGE_LOADED_ERPM (0.03F * PARAM_DEAD_TIME_V * PARAM_ERPM_PER_V)
/** Innovation at which the load changes by 16000 units in a step. */
#define PARAM_INNOVATION_MAX PARAM_MIN(16383.0F, 16000.0F * 65536.0F * 65536.0F / (PARAM_QUICK_Q16 * PARAM_QUICK_Q16) / (float)(1L << PARAM_ACCEL_SHIFT))
/** q current that a sample misses which is taken this long after the centre of the low sides' conduction: delay psi w/L. */
#define SAMPLE_DELAY_CLOCKS 60
#define PARAM_SAMPLE_SHIFT_Q16 (PARAM_F(SAMPLE_DELAY_CLOCKS) * PWM_TICK_SEC / PARAM_ERPM_PER_V / (PARAM_F(MOTOR_LS_MH) * 0.001F) \
                                / PARAM_F(NORM_CURRENT_CONST) / 4.0F * 65536.0F * PARAM_F(SPEED_UNIT))
/** The back-EMF filter's corner at low speed is five times the electrical frequency: K per count of speed. */
#define PARAM_ESDQ_PER_COUNT (65536.0F * 2.0F * PARAM_PI * PARAM_F(PARAM_ESDQ_RATIO) / 60.0F * PARAM_F(LOOPTIME_SEC) * PARAM_F(SPEED_UNIT))

/* ---- Salient motors (control/salience.h) ---- */
/** -i_d that doubles the flux, psi/(Lq - Ld), Q13 counts. */
#define PARAM_SALIENCE_Q13 (60.0F / (2.0F * PARAM_PI * PARAM_ERPM_PER_V) / (PARAM_MAX(PARAM_F(MOTOR_SALIENCY_UH), 0.001F) * 0.000001F) \
                            / PARAM_F(NORM_CURRENT_CONST) / 4.0F)
#define PARAM_SALIENT_FROM 8.0 /* times the largest current: beyond, MTPA would save less than 0.8 % of the largest current, and a third of that at rated current; the tuner reads it */

/* ---- How far the header may be off, as make robust promises (tools/bench/scenarios/tables/robust.toml) ---- */
#define PARAM_R_LEAST 0.7 /* true R over the header's */
#define PARAM_R_MOST 1.5
#define PARAM_L_OFF 0.3      /* of the header's, to either side */
#define PARAM_FLUX_MOST 1.25 /* 1.2, and what dead time leaves */

/** The d current's mean deviation: a 32nd of the largest current for noise, and what a fifth of dead time's voltage drives against the controller. */
#define PARAM_ID_OFF (PARAM_F(MAXIMUM_CURRENT_A) / 32.0F + 0.2F * PARAM_DEAD_TIME_V * PARAM_IU / (16.0F * PARAM_F(D_CURRCNTR_PTERM)))
#define PARAM_STALL_SEC 0.23 /* below half the reference; until a standing rotor shows takes up to 0.08 s more */

/** TUNING's ramp: Q16 of a count per slow step. */
#define TUNING_STEP_Q16 (PARAM_ROUND(SPEED_COUNTS(SLOW_PERIODS) * 65536.0F / (PARAM_F(TUNING_DELAY_RAMPUP) + 1.0F)))

#endif
