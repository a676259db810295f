/* The constants around the law: the start, the limits, and what protects (trip levels, how long a wrong state may last, how far the header may be off).
 *
 *     align: I(t) = I t/T while the vector turns n times in T:  n/T turns a second        (AN1292: LOCK_TIME)
 *     R of the winding: dv = R I/n from turn to turn                (drive/startup.h), where w psi < 0.4 R I (ALIGN_EMF_MOST)
 *     ramp:  dw/dt constant, to END_SPEED_RPM      (AN1292: OPENLOOP_RAMPSPEED_INCREASERATE; 2^26 counts a turn: Q10 of 2^16)
 *     hand-over: from w = 2 pi 20 Hz (PARAM_EARLY_HZ) or 1.25 times the minimum speed on; the estimator's lock is as quick as the rotor turns
 *     i2t:   dh/dt = (i^2 - h)/T, too hot from h = I2T_CURRENT_A^2                        (drive/protection.h)
 *     flux:  E - V_dead - (R's part) - (L's part) > F E (1 + k)                           (drive/protection.h)
 *     NTC:   R(T) = R25 exp(B (1/T - 1/T25)), share of the reference at the converter R/(R + Rd)    (drive/protection.h)
 *     d current off: noise, and V_dead/Kp, what dead time drives against its controller   (drive/signals.h)
 *
 * Times in steps of the slot that counts them (drive/schedule.h); the tolerances are those that make robust promises
 * (tools/bench/scenarios/tables/robust.toml). */
#ifndef DRIVE_SCALING_MACHINE_H
#define DRIVE_SCALING_MACHINE_H

#include "drive/scaling/controllers.h"
#include "drive/scaling/current_voltage.h"
#include "drive/scaling/estimator.h"

/** From here on the back-EMF is enough for a hand-over. */
#define PARAM_EARLY_ERPM PARAM_MIN(PARAM_F(ENDSPEED_ELECTR), PARAM_MAX(60.0F * PARAM_F(PARAM_EARLY_HZ), PARAM_F(PARAM_EARLY_SHARE) * PARAM_F(MINIMUM_SPEED_ERPM)))

#define PARAM_FORCED_INIT \
    { \
        .end_speed_q10 = PARAM_ROUND(PARAM_F(END_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) * PARAM_F(LOOPTIME_SEC) / 60.0F * 67108864.0F), \
        .increase_rate_q10 = OPENLOOP_RAMPSPEED_INCREASERATE \
    }

/** What R of the header takes more of voltage from one turn of ALIGN to the next; 0 where that is not to be told from rounding or from back-EMF. */
#define PARAM_ALIGN_RI_V (PARAM_PHASE_OHM * PARAM_F(Q_CURRENT_REF_OPENLOOP))
#define PARAM_ALIGN_EMF_V (60.0F * PARAM_F(PARAM_ALIGN_TURNS) / (PARAM_F(LOCK_TIME) * PARAM_F(LOOPTIME_SEC)) / PARAM_ERPM_PER_V)
#define PARAM_ALIGN_RISE_Q14 VOLTAGE_Q14(PARAM_ALIGN_RI_V / PARAM_F(PARAM_ALIGN_TURNS))
#define PARAM_ALIGN_TEACHES (PARAM_ALIGN_EMF_V < PARAM_F(ALIGN_EMF_MOST) * PARAM_ALIGN_RI_V && PARAM_ALIGN_RISE_Q14 >= ALIGN_RISE_LEAST)

/** The fields of drive_params_t that are the start's. */
#define PARAM_START_INIT \
    .offset_max_q13 = (int16_t)(8192.0F * PARAM_F(OFFSET_MOST_SHARE)), \
    .bootstrap_periods = PARAM_PERIODS(BOOTSTRAP_SEC), \
    .flying_start = (uint16_t)((FLYING_START) ? 1 : 0), \
    .align_periods = LOCK_TIME, \
    .align_rate_q12 = (uint16_t)(PARAM_F(Q_CURRENT_REF_OPENLOOP) / PARAM_F(NORM_CURRENT_CONST) * 1024.0F / PARAM_F(LOCK_TIME) + 0.5F), \
    .align_speed_q10 = (int32_t)((PARAM_ALIGN_TURNS * 67108864l + LOCK_TIME / 2) / LOCK_TIME), \
    .align_rise_q14 = (int16_t)(PARAM_ALIGN_TEACHES ? PARAM_ALIGN_RISE_Q14 : 0), \
    .early_erpm = (int16_t)PARAM_ROUND(SPEED_COUNTS(PARAM_EARLY_ERPM)), \
    .agree_steps = PARAM_STEPS_OF_8(AGREE_SEC), \
    .wait_periods = PARAM_PERIODS(WAIT_SEC), \
    .open_loop_q13 = CURRENT_Q13(Q_CURRENT_REF_OPENLOOP)

/** What noise and dead time make of the d current's mean deviation. A current within the ripple, E (1 - m) T / (4 L) at m = 1/2, changes its sign in
 *  the period and loses nothing to dead time: what compensates that drives the current, up to the ripple. */
#define PARAM_RIPPLE_A (PARAM_F(NOMINAL_BUS_V) / PARAM_SQRT3 * PARAM_F(LOOPTIME_SEC) / (16.0F * PARAM_F(MOTOR_LS_MH) * 0.001F))
#define PARAM_DEAD_OFF (PARAM_F(ID_OFF_DEAD) * PARAM_DEAD_TIME_V * PARAM_IU / (16.0F * PARAM_F(D_CURRCNTR_PTERM))) /**< where the P term alone takes ID_OFF_DEAD of dead time's voltage */
#define PARAM_ID_OFF (PARAM_F(ID_OFF_NOISE) * PARAM_F(MAXIMUM_CURRENT_A) + PARAM_MAX(PARAM_DEAD_OFF, PARAM_F(ID_OFF_RIPPLE) * PARAM_RIPPLE_A))

/** Speed below which the short-circuited winding takes at most MAXIMUM_CURRENT_A, Kphi n/sqrt(3) = R I, in counts (STOP_MODE 2). R stands for |Z|:
 *  the current's first swing goes beyond what stays, by as much as w L takes off. */
#define PARAM_BRAKE_COUNTS PARAM_MIN(SPEED_COUNTS(PARAM_F(MAXIMUM_CURRENT_A) * PARAM_PHASE_OHM * PARAM_ERPM_PER_V), 32767.0F)

/** Supply current as a q current at the voltage circle: V I = 3/2 u i with V = sqrt(3) u / top, top the highest duty. Q13 counts. */
#define PARAM_SUPPLY_Q13 (2.0F * PARAM_F(SUPPLY_CURRENT_LIMIT_A) * PARAM_F(PWM_FULL_DUTY) / (PARAM_SQRT3 * PARAM_F(PWM_TOP_DUTY)))

/** Driving current that a count of bus takes off between DERATE_BELOW_V and the trip, Q13 counts * 256; 0: none. */
#define PARAM_DERATE_BAND_V PARAM_MAX(PARAM_F(DERATE_BELOW_V) - PARAM_F(UNDER_VOLTAGE_V), 1.0F)
#define PARAM_DERATE_Q8 ((DERATE_BELOW_V) ? 256.0F * (1.0F - 1.0F / PARAM_F(DERATE_LEAST)) * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) / PARAM_F(BUS_Q15(PARAM_DERATE_BAND_V)) : 0.0F)

/** The brake chopper (drive/limits.h): the bus that switches its resistor on and off, the share of time that this bears, and the periods * 1024 that
 *  it may have been on beyond its share. */
#define CHOPPER_USED ((int)(BRAKE_CHOPPER_V) > 0)
#define CHOPPER_ON_Q15 BUS_Q15(BRAKE_CHOPPER_V)
#define CHOPPER_OFF_Q15 BUS_Q15(PARAM_F(BRAKE_CHOPPER_V) * (1.0F - PARAM_F(CHOPPER_BAND_SHARE)))
#define CHOPPER_SHARE_Q10 ((uint16_t)(PARAM_F(BRAKE_CHOPPER_SHARE) * 1024.0F + 0.01F))
#define CHOPPER_MOST_Q10 ((uint32_t)(PARAM_F(CHOPPER_SHARE_Q10) * PARAM_F(BRAKE_CHOPPER_SEC) / PARAM_F(LOOPTIME_SEC)))

/* ---- NTC thermistors: their share of the converter's reference every NTC_STEP_C from NTC_LEAST_C on; a line lies between. e^x is the eighth power of a
 *      Pade approximation, right to 2e-5 for what an NTC has ---- */
#define NTC_LEAST_C (-40)
#define NTC_STEP_C 16
#define NTC_NODES 13
#define NTC_MOST_C 152
#define PARAM_NTC_EXP_TOP(y, sign) (120.0F + (y) * ((sign)*60.0F + (y) * (12.0F + (y) * (sign))))
#define PARAM_NTC_EXP_EIGHTH(y) (PARAM_NTC_EXP_TOP(y, 1.0F) / PARAM_NTC_EXP_TOP(y, -1.0F))
#define PARAM_SQUARED(x) ((x) * (x))
#define PARAM_NTC_EXP(x) PARAM_SQUARED(PARAM_SQUARED(PARAM_SQUARED(PARAM_NTC_EXP_EIGHTH((x) / 8.0F))))
#define PARAM_NTC_SHARE(stem, celsius) \
    (1.0F / (1.0F + PARAM_F(stem##_NTC_DIVIDER_OHM) / PARAM_F(stem##_NTC_OHM) * PARAM_NTC_EXP(PARAM_F(stem##_NTC_BETA_K) * (1.0F / 298.15F - 1.0F / (273.15F + PARAM_F(celsius))))))
#define PARAM_NTC_NODE(stem, n) ((uint16_t)(65536.0F * PARAM_NTC_SHARE(stem, NTC_LEAST_C + NTC_STEP_C * (n)) + 0.5F))
#define CELSIUS_Q4(celsius) ((int16_t)PARAM_ROUND(16.0F * PARAM_F(celsius)))

/** Driving current that a sixteenth of a degree takes off between DERATE_C and TRIP_C, Q13 counts * 256. */
#define PARAM_NTC_DERATE_Q8(stem) \
    (256.0F * (1.0F - 1.0F / PARAM_F(DERATE_LEAST)) * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) / (16.0F * (PARAM_F(stem##_TRIP_C) - PARAM_F(stem##_DERATE_C))))

/** The fields of drive_params_t that are the protection's, and the limits'. */
#define PARAM_PROTECTION_INIT \
    .current_max_q13 = CURRENT_Q13(MAXIMUM_CURRENT_A), \
    .flux_brake_most_q13 = PARAM_FLUX_BRAKES ? CURRENT_Q13(PARAM_F(MAXIMUM_CURRENT_A) * (PARAM_F(1 << ASKED_LESS_SHIFT) - 1.0F) / PARAM_F(1 << ASKED_LESS_SHIFT)) : 0, \
    .supply_limit_q13 = CURRENT_Q13(PARAM_SUPPLY_Q13), \
    .derate_per_bus_q8 = (int16_t)(PARAM_DERATE_Q8 + 0.5F), \
    .current_max_reciprocal = (uint16_t)(33554432.0F / (PARAM_F(MAXIMUM_CURRENT_A) / PARAM_F(NORM_CURRENT_CONST) / 4.0F) + 0.5F), \
    .overcurrent_q13 = CURRENT_Q13(OVER_CURRENT_THRESHOLD_A), \
    .i2t_most_q25 = (int32_t)CURRENT_Q13(I2T_CURRENT_A) * CURRENT_Q13(I2T_CURRENT_A) / 2, \
    .i2t_rate_q16 = (uint16_t)((float)OVERLOAD_STEP_MS * 65.536F / PARAM_F(I2T_TIME_SEC) + 0.5F), \
    .bus_over_q15 = BUS_Q15(OVER_VOLTAGE_V), \
    .bus_under_q15 = BUS_Q15(UNDER_VOLTAGE_V), \
    .bus_used_q15 = BUS_Q15(PARAM_USED_BUS_V), \
    .bus_regen_q15 = BUS_Q15(REGEN_LIMIT_V), \
    .brake_per_bus_q8 = (int16_t)(256.0F * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) / PARAM_F(BUS_Q15(BRAKE_BAND_V)) + 0.5F), \
    .stall_steps = PARAM_STEPS_OF_16(PARAM_F(PARAM_STALL_SEC)), \
    .lost_lock_steps = PARAM_STEPS_OF_16(LOST_LOCK_SEC), \
    .wrong_steps = PARAM_STEPS_OF_8(WRONG_SEC), .load_erpm = (uint16_t)(PARAM_LOAD_ERPM + 0.5F), \
    .impossible_steps = PARAM_STEPS_OF_32(IMPOSSIBLE_SEC), \
    .kfi_impossible = PARAM_Q15(1.0F / PARAM_F(PARAM_FLUX_MOST) - 1.0F), \
    .id_off_q13 = CURRENT_Q13(PARAM_ID_OFF), \
    .rs_impossible = (PARAM_RS_RISES > 0.99F * PARAM_F(PARAM_RS_MOST)) ? PARAM_Q15(PARAM_RS_RISES) : INT16_MAX, \
    .rs_off_least = PARAM_Q15(PARAM_R_LEAST - 1.0), \
    .rs_off_most = PARAM_Q15(PARAM_R_MOST - 1.0), \
    .ls_off = PARAM_Q15(PARAM_L_OFF), \
    .dead_emf_q12 = (int16_t)((VOLTAGE_Q14(PARAM_DEAD_TIME_V) + 2) / 4), \
    .overspeed_erpm = (int16_t)PARAM_ROUND(PARAM_MIN(SPEED_COUNTS(PARAM_TOP_ERPM * PARAM_F(OVERSPEED_SHARE)), 32700.0F))

#endif
