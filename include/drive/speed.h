/* The speed controller: the ramped reference, the observed speed and the observed load give the q current. */
#ifndef DRIVE_SPEED_H
#define DRIVE_SPEED_H

#include "control/qmath.h"
#include "drive/forward.h"
#include "drive/states.h"

/** Next reference. @param step_erpm 0 (stays where it is) or more @return target when it is nearer than two steps, else one step closer */
speed_erpm_t speed_ramp(speed_erpm_t reference, speed_erpm_t target, int16_t step_erpm);

/** One step of the reference towards the target; what a step has below a whole electrical rpm counts in the next. @param step_q16 0 or more */
void reference_step(drive_t *d, const drive_params_t *p, speed_erpm_t target, int32_t step_q16);

/** Slope of the reference on its way to a target: SPEEDREF_DECEL_RPM_PER_S where its magnitude falls, else SPEEDREFRAMP_RPM_PER_S.
 *  @return electrical rpm every 8 periods, 16 fraction bits, above 0 */
int32_t reference_slope(const drive_params_t *p, speed_erpm_t reference, speed_erpm_t target);

/** The observer's rate and the gain that goes with it. */
void speed_schedule(drive_run_t *run, const drive_params_t *p);

/** The q current that the controller asks for to hold a speed, within iq_limit_q13: gain times the speed's error, and the observed load. */
current_q13_t speed_current(const drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm);

/** What the observer's estimate leaves of the speed's error at rest: an integral, slower than any rate of the observer. It acts while the reference stands,
 *  nothing changes fast and no limit is reached, but waits in the steps in which the observer's load moves against the error by itself: while a load grows, the
 *  error is the observer's. While the speed swings it acts whatever else happens, for only an integral of all of the error holds the mean; its gain is constant
 *  then, and its speed the estimator's, for the controller's gain and the observer's rate change over a swing. It is forgotten otherwise. @param before_erpm
 *  the reference 16 periods ago @param iq_q13 the q current that is asked for */
void speed_trim(drive_run_t *run, const drive_params_t *p, speed_erpm_t before_erpm, current_q13_t iq_q13);

/** 1 while the speed swings about its reference, as under a load that pulses with the shaft: it was far off to the other side four times, less than
 *  SPEED_SWING_STEPS apart in the mean. A load step is up to three such times; slower swings are the loop's own, with far more inertia than the header's. */
uint16_t speed_swings(const drive_run_t *run);

/** speed_current() step by step: what a step leaves below a whole count goes to the next, for a count can turn a light rotor out of its speed. */
current_q13_t speed_current_step(drive_run_t *run, const drive_params_t *p, speed_erpm_t target_erpm);

/** The next speed reference. */
void speed_reference_step(drive_t *d, const drive_params_t *p);

/** What belongs to the speed: the observer's rate, the gain, the current that the samples miss. Slots 3, 11 in closed loop; while the
 *  innovation gate is open 7, 15, too. */
void speed_follow(drive_run_t *run, const drive_params_t *p);

/* What a stop does that is requested in closed loop, STOP_MODE; with 0 the reference ramps down in STOPPING, then the outputs go off. A target in the
 * other direction always ramps down. */
#define STOP_COAST 1 /**< STOPPED: the outputs go off at once and the rotor runs out. Above the bus its back-EMF charges the bus, as after a fault */
#define STOP_SHORT 2 /**< STOPPING down to PARAM_BRAKE_COUNTS, then BRAKE: all low sides on until the rotor stands */

/** Whether the run goes on, slows down or ends: a requested stop does what STOP_MODE says, a target in the other direction slows down; a new request
 *  to run goes on from the present speed. Slot 6 in closed loop. */
void speed_choose_state(drive_t *d, const drive_params_t *p);

/** In STOPPING, slots 1, 5, 9, 13: when the rotor has slowed down for a target in the other direction, the ramp takes it through zero. */
void speed_turn_round(drive_t *d, const drive_params_t *p);

/** A period in BRAKE: the winding's short circuit brakes, I = w psi/|Z|, and nothing reaches the bus. The first period leaves the outputs off, so that no
 *  high side still conducts. A load that turns the rotor keeps it braking, under OVERCURRENT_SW and I2t.
 *  @return STOPPED when every phase current has been below four steps of the converter for 20 ms, else BRAKE */
drive_state_t speed_brake_step(drive_t *d, const drive_params_t *p);

/** The controller's trim. Slots 7, 15 in closed loop. */
void speed_trim_step(drive_t *d, const drive_params_t *p);

/** One step of the controller. Slots 0, 4, 8, 12 in closed loop. */
void speed_step(drive_t *d, const drive_params_t *p);

#endif
