/* The drive's parameter structure, filled from userparams.h at compile time. */
#ifndef DRIVE_PARAM_INIT_H
#define DRIVE_PARAM_INIT_H

#include "drive/drive.h"
#include "drive/overload.h"
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
        .trim_step_q13 = 4, \
        .trim_most_q13 = LATE_DUTIES ? 15 : 24, \
        .trim_speed_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(PARAM_F(FW_START_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) * 0.6F)) \
    }

#define PARAM_SVM_INIT \
    { \
        .full = PWM_FULL_DUTY, \
        .top = PWM_TOP_DUTY, \
        .dead_time = DEAD_TIME_DUTY, \
        .knee_q13 = DEAD_TIME_KNEE_Q13, \
        .dead_slope_q8 = DEAD_TIME_SLOPE_Q8, \
        .turn_q13 = (int16_t)(PARAM_DI(MAXIMUM_SPEED_RPM) * (float)(1 + LATE_DUTIES) / 2.0F) \
    }

#define PARAM_ADAPTATION_INIT \
    { \
        .rate_q16 = (int16_t)(6.0F * (float)SLOW_SELDOM * PARAM_STEP_SEC * 65536.0F + 0.5F), /* 6/s, less where a part of the voltage is R i */ \
            .kfi_least = Q15(-0.30), .kfi_most = Q15(0.35), .rs_least = Q15(-0.4), .rs_most = Q15(PARAM_RS_RISES), \
        .emf_least_q12 = (int16_t)(0.2F * PARAM_DEAD_TIME_V / NORM_VOLTAGE_CONST / 8.0F), \
        .rs_base_q16 = PARAM_SCALED(PARAM_RS_FULL, PARAM_RS_EXP) \
    }

/* A speed's angle is rounded as the estimator rounds it. */
#define PARAM_OBSERVER_INIT \
    { \
        .deltat_q32 = (int16_t)((1 + LATE_DUTIES) * PARAM_ROUND(PARAM_DELTAT_Q32)), \
        .per_turn_q12 = (int16_t)(65536.0F * 4096.0F / ((float)SLOW_PERIODS * PARAM_DELTAT_Q32) + 0.5F), \
        .shift = PARAM_ACCEL_SHIFT, \
        .per_current_q16 = (uint16_t)PARAM_MIN(PARAM_ACCEL_UNITS * 65536.0F + 0.5F, 65535.0F), \
        .per_unit_q15 = (uint16_t)PARAM_MIN(32768.0F / PARAM_ACCEL_UNITS + 0.5F, 65535.0F), \
        .innovation_max_erpm = (int16_t)PARAM_INNOVATION_MAX, \
        .load_max = (int16_t)(PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) * PARAM_ACCEL_UNITS), \
        .quiet_q16 = (int16_t)PARAM_QUIET_Q16, .loaded_q16 = (int16_t)PARAM_LOADED_Q16, .quick_q16 = (int16_t)PARAM_QUICK_Q16, \
        .full_erpm = (int16_t)SPEED_COUNTS(PARAM_FULL_ERPM), .load_from = (int16_t)PARAM_LOAD_FROM, \
        .load_width = (int16_t)PARAM_LOAD_FROM, .load_slope_q15 = (int16_t)(32767.0F / PARAM_LOAD_FROM), \
        .large_erpm = (int16_t)SPEED_COUNTS(PARAM_LARGE_ERPM), \
        .large_loaded_erpm = (int16_t)SPEED_COUNTS(PARAM_LARGE_LOADED_ERPM) \
    }

#define PARAM_PI_INIT(p, i, c, s) \
    { \
        .kp = PARAM_KP(p), .ki = (i), .kc = Q15(c), .shift = (s) \
    }

#if MOTOR_SALIENCY_UH
#define PARAM_SALIENT_INIT .salience_q13 = (uint16_t)(PARAM_SALIENCE_Q13 + 0.5F)
#else
#define PARAM_SALIENT_INIT
#endif

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
        .adaptation = PARAM_ADAPTATION_INIT, \
        .observer = PARAM_OBSERVER_INIT, \
        .speed_kp_q13 = PARAM_KP(SPEEDCNTR_PTERM), \
        .speed_kp_quick_q13 = (int16_t)PARAM_MIN(PARAM_F(PARAM_QUICK_GAIN) * 32768.0F * PARAM_F(SPEEDCNTR_PTERM), 32767.0F), \
        .sample_shift_q16 = (int16_t)PARAM_MIN(PARAM_SAMPLE_SHIFT_Q16 + 0.5F, 32767.0F), \
        .kcurr_a = Q15(KCURRA), \
        .kcurr_b = Q15(KCURRB), \
        .offset_max_q13 = 1024, /* an eighth of full scale: 0.2 V at the converter */ \
            .bootstrap_periods = PARAM_PERIODS(0.010F), \
        .flying_start = (uint16_t)((FLYING_START) ? CATCH_FIRST_LOOK : CATCH_NO_LOOK), \
        .align_periods = LOCK_TIME, \
        .align_rate_q12 = (uint16_t)(PARAM_F(Q_CURRENT_REF_OPENLOOP) / PARAM_F(NORM_CURRENT_CONST) * 1024.0F / PARAM_F(LOCK_TIME) + 0.5F), \
        .align_speed_q10 = (int32_t)((PARAM_ALIGN_TURNS * 67108864l + LOCK_TIME / 2) / LOCK_TIME), \
        .early_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(PARAM_EARLY_ERPM)), \
        .agree_steps = PARAM_SLOW_STEPS(0.02F), \
        .wait_periods = PARAM_PERIODS(0.2F), \
        .open_loop_q13 = CURRENT_Q13(Q_CURRENT_REF_OPENLOOP), \
        .current_max_q13 = CURRENT_Q13(MAXIMUM_CURRENT_A), \
        .burn_most_q13 = PARAM_BURNS ? CURRENT_Q13(PARAM_F(MAXIMUM_CURRENT_A) * 31.0F / 32.0F) : 0, \
        .current_max_reciprocal = (uint16_t)(33554432.0F / (PARAM_F(MAXIMUM_CURRENT_A) / PARAM_F(NORM_CURRENT_CONST) / 4.0F) + 0.5F), \
        .overcurrent_q13 = CURRENT_Q13(OVER_CURRENT_THRESHOLD_A), \
        .i2t_most_q25 = (int32_t)CURRENT_Q13(I2T_CURRENT_A) * CURRENT_Q13(I2T_CURRENT_A) / 2, \
        .i2t_rate_q16 = (uint16_t)((float)OVERLOAD_STEP_MS * 65.536F / PARAM_F(I2T_TIME_SEC) + 0.5F), \
        .bus_shift = BUS_SHIFT, \
        .voltage_limit_per_bus_q16 = VOLTAGE_LIMIT_PER_BUS_Q16, \
        .duty_per_volt_numerator = DUTY_PER_VOLT_NUMERATOR, \
        .bus_over_q15 = BUS_Q15(OVER_VOLTAGE_V), \
        .bus_under_q15 = BUS_Q15(UNDER_VOLTAGE_V), \
        .bus_used_q15 = BUS_Q15(PARAM_USED_BUS_V), \
        .bus_regen_q15 = BUS_Q15(REGEN_LIMIT_V), \
        .brake_per_bus_q8 = (int16_t)(256.0F * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) / PARAM_F(BUS_Q15(2.0F)) + 0.5F), /* to nothing in 2 V */ \
            .bus_nominal_q15 = BUS_Q15(NOMINAL_BUS_V), \
        .minimum_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(MINIMUM_SPEED_ERPM)), \
        .nominal_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(NOMINAL_SPEED_ERPM)), \
        .maximum_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(MAXIMUMSPEED_ELECTR)), \
        .end_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(ENDSPEED_ELECTR)), \
        .speed_ramp_q16 = SPEEDREFRAMP, \
        .tuning_step_q16 = TUNING_STEP_Q16, \
        .ramp_hold_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(PARAM_F(NOMINAL_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) / 8.0F)), \
        .stall_steps = PARAM_RARE_STEPS(PARAM_F(PARAM_STALL_SEC)), \
        .lost_lock_steps = PARAM_RARE_STEPS(0.06F), \
        .pot_zero_q16 = (uint16_t)(PARAM_F(POT_LIVE_ZERO) * 65536.0F + 0.5F), \
        .pot_scale_q15 = (uint16_t)(32768.0F / (1.0F - 2.0F * PARAM_F(POT_LIVE_ZERO)) + 0.5F), \
        .wrong_steps = PARAM_SLOW_STEPS(0.1F), \
        .impossible_steps = PARAM_SELDOM_STEPS(0.25F), \
        .kfi_impossible = Q15(1.0F / PARAM_F(PARAM_FLUX_MOST) - 1.0F), \
        .id_off_q13 = CURRENT_Q13(PARAM_ID_OFF), \
        .rs_impossible = (PARAM_RS_RISES > 0.99F * PARAM_F(PARAM_RS_MOST)) ? Q15(PARAM_RS_RISES) : INT16_MAX, \
        .rs_off_least = Q15(PARAM_R_LEAST - 1.0), \
        .rs_off_most = Q15(PARAM_R_MOST - 1.0), \
        .ls_off = Q15(PARAM_L_OFF), \
        .dead_emf_q12 = (int16_t)((VOLTAGE_Q14(PARAM_DEAD_TIME_V) + 2) / 4), \
        .overspeed_erpm = (int16_t)PARAM_ROUND(PARAM_MIN(SPEED_COUNTS(PARAM_TOP_ERPM * 1.25F), 32700.0F)), \
        PARAM_SALIENT_INIT \
    }

#endif
