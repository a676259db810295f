/* The start: average the current offsets, charge the drivers, take the rotor along, accelerate it by the forced angle, hand over to the estimator. */
#ifndef DRIVE_STARTUP_H
#define DRIVE_STARTUP_H

#include "control/transforms.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"
#include "drive/states.h"

/** Current offsets and the sums they come from. */
typedef struct {
    int32_t sum_a, sum_b;
    int16_t offset_a_q13, offset_b_q13;
    int16_t done; /**< 1: the offsets are known */
} calibration_t;

/** R from ALIGN: the voltage along the current, turn by turn. */
typedef struct {
    uint32_t sum_q14;         /**< of this turn */
    uint16_t steps;           /**< of this turn */
    angle_t turned;           /**< along the direction, at the last step */
    uint16_t turns;           /**< that are over */
    voltage_q14_t mean_q14;   /**< of the last one that is over, 0 or more */
    voltage_q14_t least_q14;  /**< smallest rise of the mean from turn to turn */
    voltage_q14_t second_q14; /**< and the next to it */
    uint16_t is_limited;      /**< 1: the limit of voltage has held the current back */
} align_t;

/** One sample. The last one raises FAULT_OFFSET unless both offsets are plausible. @return the next state */
drive_state_t calibration_step(drive_t *d, const drive_params_t *p, int16_t i_a, int16_t i_b);

/** Sums begin anew, after a fault that came before the offsets were known. */
void calibration_restart(calibration_t *c);

/** The low sides conduct and charge the high sides' drivers. @return the next state */
drive_state_t startup_bootstrap(drive_t *d, const drive_params_t *p);

/** The forced angle goes on where the estimator is, at its speed, against the direction too: the current lies along the rotor's flux and pulls no
 *  further than it turns. */
void startup_ramp_from_here(drive_t *d, const drive_params_t *p);

/** The vector of ALIGN turns PARAM_ALIGN_TURNS times while its current grows from nothing. A weak current passes a rotor that lies against it and takes
 *  it along the next time, so that it is never thrown back; the ramp goes on from this speed. Slots 0, 4, 8, 12.
 *
 *  The current grows by the same amount every turn, and with it the voltage along it: by R of that, for what dead time leaves is the same in each. A rotor that
 *  stands adds nothing, one that follows a falling part of its back-EMF. Where it begins to follow, at most two of the four rises are too large; the
 *  second smallest is none of them. It becomes R before RAMP. */
void startup_align(drive_t *d, const drive_params_t *p);

/* ---- The hand-over from the forced angle to the estimator's: the decision, the change of frame, what decays after it, the observer's step in between ---- */

/** How far a start has come. */
typedef enum {
    START_ALIGN,     /**< state ALIGN: the current grows while it turns */
    START_RAMP,      /**< state RAMP: the forced angle accelerates, too slow for the estimator to be asked */
    START_AGREE,     /**< it is asked: does it agree with the forced speed, for long enough? */
    START_RELEASE,   /**< it does: the speed waits, the current falls until it pulls the rotor */
    START_HAND_OVER, /**< it pulls: the rotor's next step hands over */
    START_OBSERVE,   /**< state CLOSED: the observer begins with its next step, six periods after the hand-over */
    START_DONE       /**< the observer runs */
} start_phase_t;

/** The way from the forced angle to the estimator's. A step is 8 periods, with deferred duties 16. */
typedef struct {
    uint16_t phase;            /**< start_phase_t; written by handover_enter() only */
    uint16_t agreed_steps;     /**< the last ones, in which the estimator agreed with the forced speed */
    int16_t ahead_erpm;        /**< by how much the estimated speed is ahead of the forced one, in the mean */
    int16_t offset;            /**< angle that is left of the change of frame, angle counts */
    current_q13_t current_q13; /**< of the ramp, at the hand-over */
    current_q13_t id_q13;      /**< d current that goes with the offset */
} handover_t;

#define HANDOVER_MOST_STEPS(p) ((uint16_t)((p)->wait_periods >> DEFER_DUTIES)) /**< 1.6 s of agreement: the slowest rotor has swung to where the current pulls it */

/** The one place that writes the phase of a start. */
void handover_enter(handover_t *h, start_phase_t next);

/** 1 while the estimator agrees with the forced speed, and has for long enough; or the hand-over is done. */
uint16_t handover_agrees(const handover_t *h);

/** The forced angle's speed along the direction, counts of speed_erpm_t. */
speed_erpm_t handover_forced_erpm(const drive_t *d, const drive_params_t *p);

/** 1 from the forced speed on at which the estimator should have agreed. */
uint16_t handover_is_overdue(speed_erpm_t forced, const drive_params_t *p);

/** In RAMP, slots 0, 4, 8, 12: from the speed on that the back-EMF allows, counts how long the estimator agrees with the forced speed; at the ramp's
 *  end it gives up by name. Once it agrees the speed may swing more, for the current that holds it falls. Where it does not agree by half as much
 *  again, the rotor is blocked or the constants are off: the rest of the ramp is quicker. */
void handover_wait(drive_t *d, const drive_params_t *p);

/** The law goes on at an angle: its frame, and integrators that give the voltages that are commanded. */
void handover_preset(drive_t *d, const drive_params_t *p, angle_t angle);

/** The vector that is commanded stays, in a frame that is turned back. @param back angle counts @return cosine and sine of them */
sincos_t handover_turn_voltage(drive_run_t *run, int16_t back);

/** Bumpless change of frame: currents, voltages and integrators turn from the forced frame into the estimator's. The angles are those of the next sample. */
void handover_now(drive_t *d, const drive_params_t *p);

/** In RAMP, in the period after handover_wait(), which has time for one of the two. */
void handover_step(drive_t *d, const drive_params_t *p);

/** The observer's step. Its first one, six periods after the hand-over, whose own period has enough to do, begins with the hand-over's q
 *  current, so that the speed controller, which comes next, goes on from it. */
void handover_observe(drive_run_t *run, const drive_params_t *p);

/** What is left of the angle offset falls in slots 2 and 10, while there is any; its d current follows. */
void handover_decay(handover_t *h);

#endif
