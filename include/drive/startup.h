/* The start without the estimator: average the current offsets, charge the drivers, take the rotor along, accelerate it by the forced angle. */
#ifndef DRIVE_STARTUP_H
#define DRIVE_STARTUP_H

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

#endif
