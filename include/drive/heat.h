/* Temperatures of motor and bridge by NTC thermistors: what they leave of the driving current, when they trip, and what a broken sensor does. Nothing
 * without one (MOTOR_NTC_USED, BRIDGE_NTC_USED). */
#ifndef DRIVE_HEAT_H
#define DRIVE_HEAT_H

#include "control/qmath.h"
#include "drive/faults.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

#define HEAT_USED ((MOTOR_NTC_USED) || (BRIDGE_NTC_USED))

#define NTC_OPEN_Q16 64880u      /* 99 % of the reference and more: a broken wire */
#define NTC_SHORTED_Q16 492u     /* 0.75 % and less: a short circuit */
#define NTC_BROKEN_SAMPLES 32u   /* so many, less those that are right, are a broken sensor: 64 or 128 ms */
#define NTC_FOLLOWS_Q16 4096     /* of its change that the filtered share takes a sample: 30 or 60 ms */
#define HEAT_COOLER_Q4 (10 * 16) /* below the trip level a temperature has passed */

/** An NTC thermistor from the converter's input to ground, with a resistor to its reference. */
typedef struct {
    uint16_t share_q16[NTC_NODES]; /**< of the reference, every NTC_STEP_C from NTC_LEAST_C on: it falls */
    int16_t derate_q4, trip_q4;    /**< degrees Celsius * 16 */
    int16_t derate_per_q4_q8;      /**< driving current that each count above derate_q4 takes off, Q13 counts * 256 */
} ntc_params_t;

/** What a sensor has shown. Zero is the start. */
typedef struct {
    int32_t smooth_q31; /**< filtered sample */
    int16_t celsius_q4; /**< degrees Celsius * 16; 0 before the first sample that is right */
    uint16_t is_known;  /**< 1 from then on */
    uint16_t is_hot;    /**< 1 from the trip level on, until HEAT_COOLER_Q4 below it */
    uint16_t broken;    /**< samples at an end of the range, less those that are not; NTC_BROKEN_SAMPLES at most */
} ntc_t;

/** Temperature for a share of the reference: within 1.5 K of the Beta equation between -20 and 120 degrees, within 2 K between -40 and 152, and these at
 *  the ends, for each sensor that the build accepts. @return degrees Celsius * 16 */
int16_t ntc_celsius(const ntc_params_t *p, uint16_t share_q16);

/** A sample of the sensor's own input. @param sample_q15 signed fractional */
void ntc_sample(ntc_t *ntc, const ntc_params_t *p, int16_t sample_q15);

/** Driving current at a temperature: MAXIMUM_CURRENT_A up to derate_q4, a fifth of it (DERATE_LEAST) at trip_q4 and above, linear between.
 *  @return Q13, current_max_q13 / 5..current_max_q13 */
current_q13_t ntc_derated(const ntc_params_t *ntc, const drive_params_t *p, int16_t celsius_q4);

/** Initialiser of a ntc_params_t, of MOTOR or BRIDGE. */
#define PARAM_NTC_INIT(stem) \
    { \
        .share_q16 = { PARAM_NTC_NODE(stem, 0), PARAM_NTC_NODE(stem, 1), PARAM_NTC_NODE(stem, 2), PARAM_NTC_NODE(stem, 3), PARAM_NTC_NODE(stem, 4), \
                       PARAM_NTC_NODE(stem, 5), PARAM_NTC_NODE(stem, 6), PARAM_NTC_NODE(stem, 7), PARAM_NTC_NODE(stem, 8), PARAM_NTC_NODE(stem, 9), \
                       PARAM_NTC_NODE(stem, 10), PARAM_NTC_NODE(stem, 11), PARAM_NTC_NODE(stem, 12) }, \
        .derate_q4 = CELSIUS_Q4(stem##_DERATE_C), \
        .trip_q4 = CELSIUS_Q4(stem##_TRIP_C), \
        .derate_per_q4_q8 = (int16_t)(PARAM_NTC_DERATE_Q8(stem) + 0.5F) \
    }

#if MOTOR_NTC_USED
#define PARAM_MOTOR_NTC_INIT .motor_ntc = PARAM_NTC_INIT(MOTOR),
#define HEAT_MOTOR_PARAMS ntc_params_t motor_ntc;
#define HEAT_MOTOR_STATE ntc_t motor;
#else
#define PARAM_MOTOR_NTC_INIT
#define HEAT_MOTOR_PARAMS
#define HEAT_MOTOR_STATE
#endif
#if BRIDGE_NTC_USED
#define PARAM_BRIDGE_NTC_INIT .bridge_ntc = PARAM_NTC_INIT(BRIDGE),
#define HEAT_BRIDGE_PARAMS ntc_params_t bridge_ntc;
#define HEAT_BRIDGE_STATE ntc_t bridge;
#else
#define PARAM_BRIDGE_NTC_INIT
#define HEAT_BRIDGE_PARAMS
#define HEAT_BRIDGE_STATE
#endif
#define HEAT_PARAMS HEAT_MOTOR_PARAMS HEAT_BRIDGE_PARAMS

#if HEAT_USED
/** The background writes it; the slow work reads what is volatile. */
typedef struct {
    HEAT_MOTOR_STATE
    HEAT_BRIDGE_STATE
    volatile current_q13_t most_q13; /**< what the temperatures leave of the driving current */
    volatile uint16_t held;          /**< drive_fault_t that nothing clears yet; FAULT_NONE: each may be cleared */
} heat_t;
#define HEAT_STATE heat_t heat;

/** All of MAXIMUM_CURRENT_A, until a sensor has been read. */
void heat_init(drive_t *d, const drive_params_t *p);

/** A millisecond of the background: what the temperatures leave of the current, and whether one is too high or its sensor broken.
 *  @return the fault that stands, drive_fault_t; FAULT_NONE as a rule */
uint16_t heat_follow(drive_t *d, const drive_params_t *p);

/** Driving current that the temperatures leave. */
current_q13_t heat_most(const drive_t *d);

/** 1 while the drive's fault is a temperature or a sensor that is still so: it cannot be cleared. */
uint16_t heat_holds(const drive_t *d);
#else
#define HEAT_STATE
#define heat_init(d, p) ((void)0)
#define heat_most(d) INT16_MAX
#define heat_holds(d) 0u
#endif

#endif
