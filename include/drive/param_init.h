/* The drive's parameter structure, filled from userparams.h at compile time. */
#ifndef DRIVE_PARAM_INIT_H
#define DRIVE_PARAM_INIT_H

#include "drive/drive.h"
#include "drive/param_scaling.h"

#define PARAM_18(f) \
    { \
        f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7), f(8), f(9), f(10), f(11), f(12), f(13), f(14), f(15), f(16), f(17) \
    }
#define PARAM_IDREF(i) CURRENT_Q13(IDREF_SPEED##i)
#define PARAM_INVKFI_ENTRY(i) ((int16_t)PARAM_ROUND(PARAM_F(INVKFI_SPEED##i)))
#define PARAM_LS_ENTRY(i) ((int16_t)PARAM_ROUND(PARAM_F(LS_OVER2LS0_SPEED##i) * 32768.0F))

#define PARAM_ESTIMATOR_INIT \
    { \
        .rs_q16 = PARAM_SCALED(PARAM_RS_FULL, PARAM_RS_EXP), \
        .rs_exp = PARAM_RS_EXP, \
        .ls_exp = PARAM_LS_EXP, \
        .d_ilimit_ls_q14 = D_ILIMIT_LS_Q14, \
        .d_ilimit_hs_q14 = D_ILIMIT_HS_Q14, \
        .deltat_q32 = (int16_t)PARAM_ROUND(PARAM_F(LOOPTIME_SEC) / 60.0F * 4294967296.0F), \
        .half_step_q16_rad = (int16_t)PARAM_ROUND(PARAM_F(LOOPTIME_SEC) * PARAM_PI / 60.0F * 4294967296.0F), \
        .kfilter_velestim_q16 = 2 * (KFILTER_VELESTIM), \
        .nominal_erpm = (int16_t)NOMINAL_SPEED_ERPM, \
        .decimate_erpm = (int16_t)DECIMATE_NOMINAL_SPEED \
    }

#define PARAM_FIELDWEAK_INIT \
    { \
        .idref_q13 = PARAM_18(PARAM_IDREF), \
        .inv_kfi = PARAM_18(PARAM_INVKFI_ENTRY), \
        .ls_over2ls0_q15 = PARAM_18(PARAM_LS_ENTRY), \
        .on_speed_erpm = (int16_t)FW_START_SPEED_ERPM, \
        .ls_base_q16 = PARAM_SCALED(PARAM_LS_FULL, PARAM_LS_EXP), \
        .kfilter_esdq_q16 = 2 * (KFILTER_ESDQ), \
        .kfilter_esdq_fw_q16 = 2 * (KFILTER_ESDQ_FW), \
        .trim_max_q13 = CURRENT_Q13(FW_TRIM_CURRENT_A), \
        .trim_step_q13 = 2, \
        .margin_q14 = VOLTAGE_Q14(PARAM_F(NOMINAL_BUS_V) * 0.01F), \
        .trim_speed_erpm = (int16_t)PARAM_ROUND(PARAM_F(FW_START_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) * 0.6F) \
    }

#define PARAM_SVM_INIT \
    { \
        .full = PWM_FULL_DUTY, \
        .top = PWM_TOP_DUTY, \
        .dead_time = DEAD_TIME_DUTY, \
        .knee_q13 = DEAD_TIME_KNEE_Q13, \
        .dead_slope_q16 = DEAD_TIME_SLOPE_Q16, \
        .turn_q13 = (int16_t)(PARAM_DI(MAXIMUM_SPEED_RPM) / 2.0F) \
    }

#define PARAM_PI_INIT(p, i, c, s) \
    { \
        .kp = PARAM_KP(p), .ki = (i), .kc = Q15(c), .shift = (s) \
    }

/** Initialiser of a drive_params_t. */
#define DRIVE_PARAMS_INIT \
    { \
        .estimator = PARAM_ESTIMATOR_INIT, \
        .fieldweak = PARAM_FIELDWEAK_INIT, \
        .forced = { .end_speed_q10 = PARAM_ROUND(PARAM_F(END_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) * PARAM_F(LOOPTIME_SEC) / 60.0F * 67108864.0F), \
                    .increase_rate_q10 = OPENLOOP_RAMPSPEED_INCREASERATE }, \
        .svm = PARAM_SVM_INIT, \
        .pi_d = PARAM_PI_INIT(D_CURRCNTR_PTERM, PARAM_CURRENT_KI(D_CURRCNTR_ITERM), D_CURRCNTR_CTERM, CURRENT_PI_SHIFT), \
        .pi_q = PARAM_PI_INIT(Q_CURRCNTR_PTERM, PARAM_CURRENT_KI(Q_CURRCNTR_ITERM), Q_CURRCNTR_CTERM, CURRENT_PI_SHIFT), \
        .pi_speed = PARAM_PI_INIT(SPEEDCNTR_PTERM, PARAM_SPEED_KI(SPEEDCNTR_ITERM), SPEEDCNTR_CTERM, SPEED_PI_SHIFT), \
        .kcurr_a = Q15(KCURRA), \
        .kcurr_b = Q15(KCURRB), \
        .offset_max_q13 = 1024, /* an eighth of full scale: 0.2 V at the converter */ \
            .bootstrap_periods = PARAM_PERIODS(0.010F), \
        .align_periods = LOCK_TIME, \
        .align_sweep_q32 = 0x40000000ul / (LOCK_TIME / 2), \
        .agree_steps = PARAM_SLOW_STEPS(0.02F), \
        .wait_steps = PARAM_SLOW_STEPS(0.2F), \
        .open_loop_q13 = CURRENT_Q13(Q_CURRENT_REF_OPENLOOP), \
        .current_max_q13 = CURRENT_Q13(MAXIMUM_CURRENT_A), \
        .current_max_reciprocal = (uint16_t)(33554432.0F / (PARAM_F(MAXIMUM_CURRENT_A) / PARAM_F(NORM_CURRENT_CONST) / 4.0F) + 0.5F), \
        .overcurrent_q13 = CURRENT_Q13(OVER_CURRENT_THRESHOLD_A), \
        .voltage_limit_per_bus_q16 = VOLTAGE_LIMIT_PER_BUS_Q16, \
        .duty_per_volt_numerator = DUTY_PER_VOLT_NUMERATOR, \
        .bus_over_q15 = BUS_Q15(OVER_VOLTAGE_V), \
        .bus_under_q15 = BUS_Q15(UNDER_VOLTAGE_V), \
        .bus_regen_q15 = BUS_Q15(REGEN_LIMIT_V), \
        .brake_per_bus_q8 = (int16_t)(256.0F * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) / PARAM_F(BUS_Q15(2.0F)) + 0.5F), /* to nothing in 2 V */ \
            .bus_nominal_q15 = BUS_Q15(NOMINAL_BUS_V), \
        .minimum_erpm = (int16_t)MINIMUM_SPEED_ERPM, \
        .nominal_erpm = (int16_t)NOMINAL_SPEED_ERPM, \
        .maximum_erpm = (int16_t)MAXIMUMSPEED_ELECTR, \
        .end_erpm = (int16_t)ENDSPEED_ELECTR, \
        .speed_ramp_erpm = SPEEDREFRAMP, \
        .tuning_step_q16 = TUNING_STEP_Q16, \
        .ramp_hold_erpm = (int16_t)PARAM_ROUND(PARAM_F(NOMINAL_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) / 8.0F), \
        .stall_steps = PARAM_SLOW_STEPS(0.3F), \
        .lost_lock_steps = PARAM_SLOW_STEPS(0.05F), \
        .overspeed_erpm = (int16_t)PARAM_ROUND(PARAM_MIN(PARAM_F(MAXIMUM_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) * 1.25F, 32700.0F)) \
    }

#endif
