/* The units of current, voltage, speed and time, and what the modulator makes of them.
 *
 *     I0 = full scale of the converter,  U0 = Vbus/sqrt(3) (1 - Td/Ts), the largest phase voltage    (AN1292, base quantities)
 *     duty = V/Vbus,  Ts = PWM_FULL_DUTY * 25 ns,  a leg loses Vbus Td/Ts to dead time
 *     a phase current below Vbus/2 Td/L ends within the dead time, and the lost voltage falls with it
 *
 * The only reader of userparams.h. */
#ifndef DRIVE_SCALING_CURRENT_VOLTAGE_H
#define DRIVE_SCALING_CURRENT_VOLTAGE_H

#include <stdint.h>

#include "control/tuned.h"
#include "userparams.h"

#if defined(NORM_RS) || defined(NORM_LSDTBASE) || defined(NORM_INVKFIBASE) || defined(NORM_DELTAT)
#define PARAM_OF_AN1292 /* firmware/drive/param_text.c refuses it */
#undef NORM_RS
#undef NORM_LSDTBASE
#undef NORM_INVKFIBASE
#undef NORM_DELTAT
#endif
/* In userparams.h AN1292's forms stand for the number in their brackets, Q15(-0.5) for -0.5 and NORM_CURRENT(-0.09) for -0.09 A: parameters have
 * engineering units. A definition of AN1292's own there (its Example 2) means the same. */
#undef Q15
#undef NORM_CURRENT
#define Q15(fraction) (fraction)
#define NORM_CURRENT(current_a) (current_a)

#define PARAM_F(x) ((float)(x))
#define PARAM_ROUND(x) ((int32_t)((x) + (((x) < 0.0F) ? -0.5F : 0.5F)))
#define PARAM_PI 3.14159265F
#define PARAM_SQRT3 1.73205081F
#define PARAM_MIN(a, b) (((a) < (b)) ? (a) : (b))
#define PARAM_MAX(a, b) (((a) > (b)) ? (a) : (b))

/* ---- The unit of speed: a count of a speed_erpm_t is so many electrical rpm that the maximum speed, with what it may overshoot, fits a word ---- */
#define SPEED_UNIT_ERPM 32000 /* most with one electrical rpm a count; the tuner reads it */
#define PARAM_TOP_ERPM (PARAM_F(MAXIMUM_SPEED_RPM) * PARAM_F(NOPOLESPAIRS))
#define SPEED_UNIT ((PARAM_TOP_ERPM <= PARAM_F(SPEED_UNIT_ERPM)) ? 1 : (PARAM_TOP_ERPM <= 2.0F * PARAM_F(SPEED_UNIT_ERPM)) ? 2 \
                                                                                                                           : 4)
/** Counts of so many electrical rpm, as a float. */
#define SPEED_COUNTS(erpm) (PARAM_F(erpm) / PARAM_F(SPEED_UNIT))

/** Q15 of a fraction, rounded as AN1292 does: positive * 32767, negative * 32768. */
#define PARAM_Q15(x) ((int16_t)((PARAM_F(x) < 0.0F) ? PARAM_F(x) * 32768.0F - 0.5F : PARAM_F(x) * 32767.0F + 0.5F))
/** Counts of a current in AN1292's format (Q15 of full scale): CURRENT_Q15(1.41) = 11653 at 0.000121 A/count. */
#define CURRENT_Q15(current_a) PARAM_Q15(PARAM_F(current_a) / PARAM_F(NORM_CURRENT_CONST) / 32768.0F)

/* ---- Base quantities (facts: U0 is the largest phase voltage Vbus/sqrt(3), less the dead time's share) ---- */
#define NORM_VOLTAGE_CONST (PARAM_F(NOMINAL_BUS_V) / PARAM_SQRT3 * (1.0F - PARAM_F(DEADTIME_SEC) / PARAM_F(LOOPTIME_SEC)) / 32768.0F)
#define PARAM_IU (PARAM_F(NORM_CURRENT_CONST) / NORM_VOLTAGE_CONST) /* I0/U0, A/V */

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
/* A sine of the largest current changes by 2 pi f Ts I a period. */
#define PARAM_DI(rpm) (2.0F * PARAM_PI * PARAM_F(rpm) / 60.0F * PARAM_F(NOPOLESPAIRS) * PARAM_F(LOOPTIME_SEC) * CURRENT_Q14_F(MAXIMUM_CURRENT_A))

/* ---- Modulator and bus ---- */
#define PWM_TICK_SEC 0.000000025F                                         /* one PWM clock at 40 MIPS; two duty counts */
#define PARAM_PWM_PERIODS (PARAM_F(LOOPTIME_SEC) / (2.0F * PWM_TICK_SEC)) /* the counter's way, up or down */
#define PARAM_PWM_REST PARAM_MAX(PARAM_PWM_PERIODS - PARAM_F(PARAM_ROUND(PARAM_PWM_PERIODS)), PARAM_F(PARAM_ROUND(PARAM_PWM_PERIODS)) - PARAM_PWM_PERIODS)
#define PWM_FULL_DUTY ((int16_t)PARAM_ROUND(PARAM_F(LOOPTIME_SEC) / PWM_TICK_SEC))
#define PWM_TOP_DUTY ((int16_t)(PWM_FULL_DUTY - 2 * PARAM_ROUND(PARAM_F(SAMPLE_WINDOW_SEC) / PWM_TICK_SEC)))
#define DEAD_TIME_DUTY ((int16_t)PARAM_ROUND(PARAM_F(DEADTIME_SEC) / PWM_TICK_SEC))
#define PARAM_LOST_CURRENT_Q13 (PARAM_F(NOMINAL_BUS_V) / 2.0F * PARAM_F(DEADTIME_SEC) / (PARAM_F(MOTOR_LS_MH) * 0.001F) / PARAM_F(NORM_CURRENT_CONST) / 4.0F)
#define DEAD_TIME_KNEE_Q13 ((int16_t)PARAM_MAX(PARAM_F(DEAD_KNEE_SHARE) * PARAM_LOST_CURRENT_Q13 + 0.5F, 2.0F))
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
#define PARAM_USED_BUS_V PARAM_MIN(PARAM_F(OVER_VOLTAGE_V), PARAM_F(USED_BUS_SHARE) * PARAM_F(NOMINAL_BUS_V))
/** q current that a sample misses which is taken SAMPLE_DELAY_CLOCKS after the centre of the low sides' conduction: delay psi w/L. */
#define PARAM_SAMPLE_SHIFT_Q16 (PARAM_F(SAMPLE_DELAY_CLOCKS) * PWM_TICK_SEC / PARAM_ERPM_PER_V / (PARAM_F(MOTOR_LS_MH) * 0.001F) \
                                / PARAM_F(NORM_CURRENT_CONST) / 4.0F * 65536.0F * PARAM_F(SPEED_UNIT))

#define PARAM_SVM_INIT \
    { \
        .full = PWM_FULL_DUTY, \
        .top = PWM_TOP_DUTY, \
        .dead_time = DEAD_TIME_DUTY, \
        .knee_q13 = DEAD_TIME_KNEE_Q13, \
        .dead_slope_q8 = DEAD_TIME_SLOPE_Q8, \
        .turn_q13 = (int16_t)(PARAM_DI(MAXIMUM_SPEED_RPM) * (float)(1 + DEFER_DUTIES) / 2.0F) \
    }

/* ---- Duties: in time for the next pulse, or in a shorter period for the one after it (drive/tick.h). The tuner reads the period. ---- */
#define DEFER_BELOW_SEC 0.00004
#define DEFER_DUTIES (PARAM_F(LOOPTIME_SEC) < PARAM_F(DEFER_BELOW_SEC))

/** Two pulses have one compensation of dead time, unless the rotor may turn too far in a period. */
#define DEAD_EACH (PARAM_TOP_ERPM / 60.0F * PARAM_F(LOOPTIME_SEC) > PARAM_F(DEAD_EACH_TURN))

/* ---- The slow work (drive/schedule.h): a slot follows every second period, with deferred duties half a slot. A step is four slots, a round sixteen.
 *      PARAM_STEPS_OF_N counts steps N periods apart, with deferred duties twice as many. The tools read the periods. ---- */
#define SLOW_EVERY 2u
#define SLOW_PARTS 16u /* of a round */
#define SLOW_PERIODS_IN_TIME 8
#define SLOW_CALLS ((DEFER_DUTIES) ? 2u * SLOW_PARTS : SLOW_PARTS)                                     /* of a round */
#define SLOW_PERIODS ((DEFER_DUTIES) ? 2u * (SLOW_PERIODS_IN_TIME) : (unsigned)(SLOW_PERIODS_IN_TIME)) /* of a step */
#define SLOW_ROUND_STEPS 4u                                                                            /* of a round */
#define SLOW_STEPS_PER_SEC (1.0F / PARAM_STEP_SEC)
#define PARAM_STEPS_OF_8(time_s) ((uint16_t)PARAM_ROUND(PARAM_F(time_s) * SLOW_STEPS_PER_SEC))
#define PARAM_STEPS_OF_16(time_s) ((uint16_t)PARAM_ROUND(PARAM_F(time_s) * SLOW_STEPS_PER_SEC / 2.0F))
#define PARAM_STEPS_OF_32(time_s) ((uint16_t)PARAM_ROUND(PARAM_F(time_s) * SLOW_STEPS_PER_SEC / 4.0F))
#define PARAM_PERIODS(time_s) ((uint16_t)PARAM_ROUND(PARAM_F(time_s) / PARAM_F(LOOPTIME_SEC)))
#define PARAM_STEP_SEC ((float)SLOW_PERIODS * PARAM_F(LOOPTIME_SEC))

#endif
