/* The limits and what protects: trip levels, how long a wrong state may last, and how far the header may be off.
 *
 *     i2t:   dh/dt = (i^2 - h)/T, too hot from h = I2T_CURRENT_A^2                        (drive/overload.h)
 *     flux:  E - V_dead - (R's part) - (L's part) > F E (1 + k)                           (drive/protection.h)
 *     d current off: noise, and V_dead/Kp, what dead time drives against its controller   (drive/deviation.h)
 *
 * Times in steps of the slot that counts them (drive/schedule.h); the tolerances are those that make robust promises
 * (tools/bench/scenarios/tables/robust.toml). */
#ifndef DRIVE_SCALING_PROTECTION_H
#define DRIVE_SCALING_PROTECTION_H

#include "drive/scaling/controllers.h"
#include "drive/scaling/current_voltage.h"
#include "drive/scaling/estimator.h"

/** What noise and dead time make of the d current's mean deviation. */
#define PARAM_ID_OFF (PARAM_F(ID_OFF_NOISE) * PARAM_F(MAXIMUM_CURRENT_A) + PARAM_F(ID_OFF_DEAD) * PARAM_DEAD_TIME_V * PARAM_IU / (16.0F * PARAM_F(D_CURRCNTR_PTERM)))

/** The fields of drive_params_t that are the protection's, and the limits'. */
#define PARAM_PROTECTION_INIT \
    .current_max_q13 = CURRENT_Q13(MAXIMUM_CURRENT_A), \
    .flux_brake_most_q13 = PARAM_FLUX_BRAKES ? CURRENT_Q13(PARAM_F(MAXIMUM_CURRENT_A) * (PARAM_F(1 << ASKED_LESS_SHIFT) - 1.0F) / PARAM_F(1 << ASKED_LESS_SHIFT)) : 0, \
    .current_max_reciprocal = (uint16_t)(33554432.0F / (PARAM_F(MAXIMUM_CURRENT_A) / PARAM_F(NORM_CURRENT_CONST) / 4.0F) + 0.5F), \
    .overcurrent_q13 = CURRENT_Q13(OVER_CURRENT_THRESHOLD_A), \
    .i2t_most_q25 = (int32_t)CURRENT_Q13(I2T_CURRENT_A) * CURRENT_Q13(I2T_CURRENT_A) / 2, \
    .i2t_rate_q16 = (uint16_t)((float)OVERLOAD_STEP_MS * 65.536F / PARAM_F(I2T_TIME_SEC) + 0.5F), \
    .bus_over_q15 = BUS_Q15(OVER_VOLTAGE_V), \
    .bus_under_q15 = BUS_Q15(UNDER_VOLTAGE_V), \
    .bus_used_q15 = BUS_Q15(PARAM_USED_BUS_V), \
    .bus_regen_q15 = BUS_Q15(REGEN_LIMIT_V), \
    .brake_per_bus_q8 = (int16_t)(256.0F * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) / PARAM_F(BUS_Q15(BRAKE_BAND_V)) + 0.5F), \
    .stall_steps = PARAM_RARE_STEPS(PARAM_F(PARAM_STALL_SEC)), \
    .lost_lock_steps = PARAM_RARE_STEPS(LOST_LOCK_SEC), \
    .wrong_steps = PARAM_SLOW_STEPS(WRONG_SEC), \
    .impossible_steps = PARAM_SELDOM_STEPS(IMPOSSIBLE_SEC), \
    .kfi_impossible = Q15(1.0F / PARAM_F(PARAM_FLUX_MOST) - 1.0F), \
    .id_off_q13 = CURRENT_Q13(PARAM_ID_OFF), \
    .rs_impossible = (PARAM_RS_RISES > 0.99F * PARAM_F(PARAM_RS_MOST)) ? Q15(PARAM_RS_RISES) : INT16_MAX, \
    .rs_off_least = Q15(PARAM_R_LEAST - 1.0), \
    .rs_off_most = Q15(PARAM_R_MOST - 1.0), \
    .ls_off = Q15(PARAM_L_OFF), \
    .dead_emf_q12 = (int16_t)((VOLTAGE_Q14(PARAM_DEAD_TIME_V) + 2) / 4), \
    .overspeed_erpm = (int16_t)PARAM_ROUND(PARAM_MIN(SPEED_COUNTS(PARAM_TOP_ERPM * PARAM_F(OVERSPEED_SHARE)), 32700.0F))

#endif
