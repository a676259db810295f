/* Protection: the conditions that end in a fault and need no signal's model: currents, bus, rotor, heat. */
#ifndef DRIVE_PROTECTION_H
#define DRIVE_PROTECTION_H

#include "control/qmath.h"
#include "drive/forward.h"
#include "drive/faults.h"
#include "drive/param_scaling.h"

/** Over-current of any phase, every period with the bridge on. @return 1 then: the law must not run */
uint16_t protection_check_current(drive_t *d, const drive_params_t *p);

/** Over-voltage at once, under-voltage filtered, both while anything is on: at rest a rotor may charge the bus, but no further than what can be
 *  measured. Slots 1, 5, 9, 13. @param now_q15 unfiltered @param bus_q15 filtered */
void protection_check_bus(drive_t *d, const drive_params_t *p, int16_t now_q15, int16_t bus_q15);

/** A bus falls no faster than current is drawn from its capacitor, and the modulator follows: the back-EMF stays. A signal that falls by a fifth at once, and
 *  stands, takes the back-EMF with it, faster than any load. Slots 3 and 11 in closed loop while signals seem wrong. @param now_q15 unfiltered */
void protection_check_bus_signal(drive_t *d, const drive_params_t *p, int16_t now_q15);

/** 1 where no flux within the header's tolerances explains the q back-EMF: what dead time, and R and L within theirs, may put into it is taken off first. With
 *  E = Eq as the model sees it, k the change of 1/Kphi, F the most flux and V_dead what dead time makes of it: E - V_dead - (R's part) - (L's part) > F E (1 + k),
 *  here divided by F, with a fifth more of the three parts. Where the motor brakes R i lowers the voltage, and the least R counts. */
uint16_t protection_flux_is_impossible(const drive_run_t *run, const drive_params_t *p);

/** What the motor has shown against the header must be possible: the flux within its tolerance, and a winding that has gained 60 % of its
 *  resistance is too hot. Slot 14 in closed loop. */
void protection_check_model(drive_t *d, const drive_params_t *p);

/** 1 where a resistance within the header's tolerance and dead time would explain the whole back-EMF: the rotor may stand. */
uint16_t protection_rotor_is_doubtful(const drive_run_t *run, const drive_params_t *p);

/** Speed along the direction below which the rotor counts as stalled: half the reference, or of a low one half the minimum speed. */
speed_erpm_t protection_least_speed(const drive_run_t *run, const drive_params_t *p);

/** The probe whether the rotor turns. */
typedef enum {
    PROBE_WAIT, /**< until the rotor may stand though it seems to turn */
    PROBE_TEST, /**< d current flows: a standing rotor's estimate falls */
    PROBE_PAUSE /**< until the next one */
} probe_phase_t;

/** The most d current of a probe: it leaves the q current that flows, but for a tenth of the largest. A salient motor needs more q current beside
 *  it: half of each step's change is taken, which comes to the current that fits. */
current_q13_t protection_probe_most(const drive_run_t *run, const drive_params_t *p);

/** Where the rotor may stand, as much d current as q current: a standing rotor's estimate, (Eq - Ed)/Kphi of what R i leaves, falls to
 *  nothing and is a stall; a turning one does not care. It begins when the rotor seems to turn, waits for the stall while E has the
 *  current's direction, and comes again: soon after a dip of the speed. Slot 6 in closed loop. */
void protection_probe_rotor(drive_t *d, const drive_params_t *p);

/** Stall and lost lock: conditions that must not last. Slots 7, 15 in closed loop. */
void protection_check_rotor(drive_t *d, const drive_params_t *p);

/* ---- I2t: the heat that the current leaves in the winding, for motors whose sheet gives a thermal time constant ----
 *
 *     dh/dt = (i_d^2 + i_q^2 - h) / I2T_TIME_SEC,  too hot from h = I2T_CURRENT_A^2
 *
 * A cold winding stands k times the current for -T ln(1 - 1/k^2). The resistance that the drive learns tells the same more slowly and of any
 * motor; it sees the housing, too. */

#define OVERLOAD_STEP_MS 512u /**< a mean over so long makes a step of the heat */

/** Heat of the winding. Zero is a valid start: a cold motor. A reset forgets it. */
typedef struct {
    int32_t heat_q25; /**< square of the current that would keep the winding as hot, Q13 counts^2 / 2 */
    uint32_t sum;     /**< of the step: i^2 / 1024 times ms */
    uint16_t ms;      /**< of the step */
} overload_t;

/** A pass of the background. Between runs the winding cools. @param ms since the last pass @return 1 while a running motor is too hot */
uint16_t overload_tick(overload_t *o, const drive_t *d, const drive_params_t *p, uint16_t ms);

/* ---- Temperatures of motor and bridge by NTC thermistors: what they leave of the driving current, when they trip, and what a broken sensor does. Nothing
 * without one (MOTOR_NTC_USED, BRIDGE_NTC_USED). ---- */

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
