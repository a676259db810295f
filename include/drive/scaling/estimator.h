/* The estimator's constants, of its model and of what it learns.
 *
 *     E = u - R i - L di/dt                                     (AN1292, Equation 4; R and L/Ts: Equation 5)
 *     w = (Eq - sign(Eq) Ed) / Kphi,   rho += w Ts              (Equations 2 and 1; 1/Kphi: Equation 6)
 *     y += K (x - y),   1 - K = exp(-2 pi f Ts)                 (Equation 7)
 *
 * In counts of U0, I0, SPEED_UNIT and 2^32 a turn. Equation numbers are AN1292's, in their corrected form (docs/architecture.md).
 *
 *     |di| <= 2 pi f Ts I        a sine of the largest current in a period; AN1292's formula has 2 in place of 2 pi I/Ipeak, and clips
 *     E <= U + R I + 2 pi f L I  below the trip levels: must fit the back-EMF's Q13 */
#ifndef DRIVE_SCALING_ESTIMATOR_H
#define DRIVE_SCALING_ESTIMATOR_H

#include "drive/scaling/current_voltage.h"

/* ---- AN1292's motor constants, pre-divided by 2, 256 and 2. The estimator has formats of its own for R and L, which fit where these two end at 32767. ---- */
#ifndef BRIDGE_RS_OHM
#define BRIDGE_RS_OHM 0 /* transistor and half of the shunt, where that counts beside the winding */
#endif
/** What a phase's current meets: winding and bridge. */
#define PARAM_PHASE_OHM (PARAM_F(MOTOR_RS_OHM) + PARAM_F(BRIDGE_RS_OHM))
#define PARAM_AN1292(x) ((int16_t)PARAM_ROUND(((x) < 32767.0F) ? (x) : 32767.0F))
#define NORM_RS PARAM_AN1292(PARAM_PHASE_OHM *PARAM_IU * 16384.0F)
#define NORM_LSDTBASE PARAM_AN1292(PARAM_F(MOTOR_LS_MH) * 0.001F / PARAM_F(LOOPTIME_SEC) * PARAM_IU * 128.0F)
#define PARAM_INVKFI (PARAM_SQRT3 * 1000.0F * PARAM_F(NOPOLESPAIRS) * NORM_VOLTAGE_CONST / PARAM_F(MOTOR_KPHI_V_PER_KRPM) * 16384.0F / PARAM_F(SPEED_UNIT))
#define NORM_INVKFIBASE ((int16_t)PARAM_ROUND(PARAM_INVKFI))
#define NORM_DELTAT ((int16_t)PARAM_ROUND(PARAM_F(LOOPTIME_SEC) / 60.0F * 2147483648.0F * PARAM_F(SPEED_UNIT)))
/* The speed filter runs every second period: two steps of Equation 7 in one. */
#define PARAM_VELESTIM_Q16 ((int16_t)PARAM_ROUND(PARAM_F(KFILTER_VELESTIM) * (4.0F - PARAM_F(KFILTER_VELESTIM) / 16384.0F)))

/* ---- The estimator's own: R and L with an exponent of two ---- */
/** Angle per period and count of speed, 2^32 a turn (NORM_DELTAT, unrounded). */
#define PARAM_DELTAT_Q32 (PARAM_F(LOOPTIME_SEC) / 60.0F * 4294967296.0F * PARAM_F(SPEED_UNIT))
#define PARAM_EXP(x) ((uint16_t)(((x) < 65535.0F) ? 0 : ((x) < 131071.0F) ? 1 \
                                                    : ((x) < 262143.0F)   ? 2 \
                                                                          : 3))
#define PARAM_RS_FULL (PARAM_PHASE_OHM * PARAM_IU * 32768.0F)
#define PARAM_LS_FULL (PARAM_F(MOTOR_LS_MH) * 0.001F / PARAM_F(LOOPTIME_SEC) * PARAM_IU * 4096.0F)
#define PARAM_SCALED(x, exp) ((uint16_t)((x) / (float)(1 << (exp)) + 0.5F))
#define PARAM_RS_EXP PARAM_EXP(PARAM_RS_FULL)
#define PARAM_LS_EXP PARAM_EXP(PARAM_LS_FULL *PARAM_LS_RAISED)
#define PARAM_LS_RAISED 1.2F /* largest LS_OVER2LS0 over its 0.5 */

/* ---- Limits of the derivative ---- */
/** Below it the derivative spans eight samples: AN1292's nominal speed, or less with a long period. */
#define EIGHT_SAMPLES_ERPM PARAM_MIN(PARAM_F(NOMINAL_SPEED_ERPM), PARAM_F(PARAM_EIGHT_TURN) * 60.0F / (8.0F * PARAM_F(LOOPTIME_SEC)))
#define D_ILIMIT_LS_Q14 ((int16_t)PARAM_MIN(8.0F * PARAM_DI(EIGHT_SAMPLES_ERPM / PARAM_F(NOPOLESPAIRS)) + 0.5F, 16383.0F))
#define D_ILIMIT_HS_Q14 ((int16_t)PARAM_MIN(PARAM_DI(MAXIMUM_SPEED_RPM) + 0.5F, 4095.0F))
#define PARAM_LDI_LS_Q14 ((int16_t)PARAM_MIN(8.0F * PARAM_LDI_LS_SHARE * PARAM_DI(EIGHT_SAMPLES_ERPM / PARAM_F(NOPOLESPAIRS)) + 0.5F, 16383.0F))
#define PARAM_LDI_HS_Q14 ((int16_t)PARAM_MIN(PARAM_LDI_SHARE * PARAM_DI(MAXIMUM_SPEED_RPM) + 0.5F, 4095.0F))
#define D_ILIMIT_LS ((int16_t)(2 * D_ILIMIT_LS_Q14)) /* in AN1292's format */
#define D_ILIMIT_HS ((int16_t)(2 * D_ILIMIT_HS_Q14))

/* ---- The back-EMF's format ---- */
#define PARAM_EMF_MAX_V (PARAM_MOST_V + PARAM_TRIP_RI_V + PARAM_LDI_V)
#define PARAM_MOST_V (PARAM_USED_BUS_V / PARAM_SQRT3)
#define PARAM_TRIP_RI_V (2.0F / PARAM_SQRT3 * PARAM_F(OVER_CURRENT_THRESHOLD_A) * PARAM_PHASE_OHM)
#define PARAM_FASTEST_RPM PARAM_MAX(PARAM_F(MAXIMUM_SPEED_RPM), PARAM_F(PARAM_OLD_LONGER) * PARAM_F(NOMINAL_SPEED_RPM))
#define PARAM_LDI_V (2.0F * PARAM_PI / 60.0F * PARAM_FASTEST_RPM * PARAM_F(NOPOLESPAIRS) * PARAM_LS_RAISED * PARAM_F(MOTOR_LS_MH) * 0.001F * PARAM_F(MAXIMUM_CURRENT_A))
#define PARAM_EMF_END_V (PARAM_F(PARAM_EMF_SHARE) * 131068.0F * NORM_VOLTAGE_CONST)
/** The adaptation raises R, too. What is missing for that the limits of L di/dt give, which full current at full speed alone would reach; then R
 *  rises less, and tells nothing of the winding's temperature. */
#define PARAM_LDI_SHARE PARAM_MAX(PARAM_F(PARAM_LDI_LEAST_SHARE), PARAM_MIN(1.0F, (PARAM_EMF_END_V - PARAM_MOST_V - (1.0F + PARAM_F(PARAM_RS_MOST)) * PARAM_TRIP_RI_V) / PARAM_LDI_V))
#define PARAM_LDI_LS_SHARE PARAM_MIN(1.0F, PARAM_LDI_SHARE *PARAM_FASTEST_RPM / (PARAM_F(PARAM_OLD_LONGER) * PARAM_F(NOMINAL_SPEED_RPM)))
#define PARAM_RS_ROOM ((PARAM_EMF_END_V - PARAM_MOST_V - PARAM_LDI_SHARE * PARAM_LDI_V) / PARAM_TRIP_RI_V - 1.0F)
#define PARAM_RS_RISES PARAM_MAX(0.0F, PARAM_MIN(PARAM_F(PARAM_RS_MOST), PARAM_RS_ROOM))

/* ---- Filter of the back-EMF at low speed: K per count of speed ---- */
#define PARAM_ESDQ_PER_COUNT (65536.0F * 2.0F * PARAM_PI * PARAM_F(PARAM_ESDQ_RATIO) / 60.0F * PARAM_F(LOOPTIME_SEC) * PARAM_F(SPEED_UNIT))

#define PARAM_ESTIMATOR_INIT \
    { \
        .rs_exp = PARAM_RS_EXP, \
        .ls_exp = PARAM_LS_EXP, \
        .d_ilimit_ls_q14 = PARAM_LDI_LS_Q14, \
        .d_ilimit_hs_q14 = PARAM_LDI_HS_Q14, \
        .deltat_q32 = (int16_t)PARAM_ROUND(PARAM_DELTAT_Q32), \
        .half_step_q16_rad = (uint16_t)PARAM_ROUND(PARAM_F(LOOPTIME_SEC) * PARAM_PI / 60.0F * 4294967296.0F * PARAM_F(SPEED_UNIT)), \
        .kfilter_velestim_q16 = PARAM_VELESTIM_Q16, \
        .nominal_erpm = (int16_t)SPEED_COUNTS(EIGHT_SAMPLES_ERPM), \
        .decimate_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(DECIMATE_NOMINAL_SPEED)) \
    }

/* ---- What the running motor teaches ---- */
/** The sum is the flux times the angle, E dt = psi d theta, with psi of the header; and more than what dead time may shake in four steps. */
#define PARAM_TURNED_V PARAM_MAX(PARAM_F(HELD_TURNED_RAD) * 60.0F / (2.0F * PARAM_PI * PARAM_ERPM_PER_V) / (2.0F * PARAM_STEP_SEC), 2.0F * PARAM_F(ADAPTATION_EMF_SHARE) * PARAM_DEAD_TIME_V)
#define PARAM_ADAPTATION_INIT \
    { \
        .rate_q16 = (int16_t)(PARAM_F(ADAPTATION_RATE) * (float)SLOW_ROUND_STEPS * PARAM_STEP_SEC * 65536.0F + 0.5F), \
        .kfi_least = PARAM_Q15(-ADAPTATION_KFI_LESS), .kfi_most = PARAM_Q15(ADAPTATION_KFI_MORE), .rs_least = PARAM_Q15(-ADAPTATION_RS_LESS), .rs_most = PARAM_Q15(PARAM_RS_RISES), \
        .emf_least_q12 = (int16_t)(PARAM_F(ADAPTATION_EMF_SHARE) * PARAM_DEAD_TIME_V / NORM_VOLTAGE_CONST / 8.0F), \
        .turned_q12 = (int16_t)PARAM_MIN(32767.0F, PARAM_TURNED_V / NORM_VOLTAGE_CONST / 8.0F), \
        .rs_base_q16 = PARAM_SCALED(PARAM_RS_FULL, PARAM_RS_EXP) \
    }

#endif
