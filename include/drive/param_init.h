/* The drive's parameter structure, filled from userparams.h at compile time. */
#ifndef DRIVE_PARAM_INIT_H
#define DRIVE_PARAM_INIT_H

#include "drive/drive.h"
#include "drive/protection.h"

/** Initialiser of a drive_params_t. */
#define DRIVE_PARAMS_INIT \
    { \
        .estimator = PARAM_ESTIMATOR_INIT, \
        .fieldweak = PARAM_FIELDWEAK_INIT, \
        .forced = PARAM_FORCED_INIT, \
        .svm = PARAM_SVM_INIT, \
        .pi_d = PARAM_PI_INIT(D_CURRCNTR_PTERM, PARAM_CURRENT_KI(D_CURRCNTR_ITERM), D_CURRCNTR_CTERM, CURRENT_PI_SHIFT), \
        .pi_q = PARAM_PI_INIT(Q_CURRCNTR_PTERM, PARAM_CURRENT_KI(Q_CURRCNTR_ITERM), Q_CURRCNTR_CTERM, CURRENT_PI_SHIFT), \
        .adaptation = PARAM_ADAPTATION_INIT, \
        .observer = PARAM_OBSERVER_INIT, \
        .speed_kp_q13 = PARAM_KP(SPEEDCNTR_PTERM), \
        .speed_kp_fast_q13 = (int16_t)PARAM_MIN(PARAM_F(PARAM_FAST_GAIN) * 32768.0F * PARAM_F(SPEEDCNTR_PTERM), 32767.0F), \
        .sample_shift_q16 = (int16_t)PARAM_MIN(PARAM_SAMPLE_SHIFT_Q16 + 0.5F, 32767.0F), \
        .kcurr_a = PARAM_Q15(KCURRA), \
        .kcurr_b = PARAM_Q15(KCURRB), \
        .bus_shift = BUS_SHIFT, \
        .voltage_limit_per_bus_q16 = VOLTAGE_LIMIT_PER_BUS_Q16, \
        .duty_per_volt_numerator = DUTY_PER_VOLT_NUMERATOR, \
        .bus_nominal_q15 = BUS_Q15(NOMINAL_BUS_V), \
        .minimum_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(MINIMUM_SPEED_ERPM)), \
        .nominal_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(NOMINAL_SPEED_ERPM)), \
        .maximum_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(MAXIMUMSPEED_ELECTR)), \
        .end_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(ENDSPEED_ELECTR)), \
        .speed_ramp_q16 = SPEEDREFRAMP, \
        .speed_decel_q16 = SPEEDREF_DECEL, \
        .tuning_step_q16 = TUNING_STEP_Q16, \
        .ramp_hold_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(PARAM_F(NOMINAL_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) * PARAM_F(RAMP_HOLD_SHARE))), \
        .pot_zero_q16 = (uint16_t)(PARAM_F(POT_LIVE_ZERO) * 65536.0F + 0.5F), \
        .pot_scale_q15 = (uint16_t)(32768.0F / (1.0F - 2.0F * PARAM_F(POT_LIVE_ZERO)) + 0.5F), \
        PARAM_START_INIT, \
        PARAM_PROTECTION_INIT, \
        PARAM_MOTOR_NTC_INIT \
            PARAM_BRIDGE_NTC_INIT \
                PARAM_PROFILE_INIT \
                    PARAM_SALIENT_INIT \
    }

#endif
