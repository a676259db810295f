/* The catch of a rotor that turns at the start: what the short circuit of the bootstrap tells of its angle and speed.
 *
 * With all low sides on the back-EMF alone drives the current, free of dead time and of the bus:  L i + R int(i dt) = -int(E dt).  A look ends as
 * soon as the current is a tenth of its maximum, so it costs the rotor next to nothing. Its direction is the back-EMF's; the pause before
 * the second look is meant to be 75 degrees, and the turn from look to look is the speed with its sign, whatever Kphi is. */
#ifndef DRIVE_CATCH_H
#define DRIVE_CATCH_H

#include "control/transforms.h"
#include "drive/param_scaling.h"
#include "drive/states.h"

/** How far the catch has come. Looks are in state BOOTSTRAP, the others in CATCH. */
typedef enum {
    CATCH_NO_LOOK,     /**< the rotor stands, or nobody wants to know */
    CATCH_FIRST_LOOK,  /**< does it turn? */
    CATCH_SECOND_LOOK, /**< how far has it turned? */
    CATCH_BUS_HIGH,    /**< before the first look: until the bus has fallen */
    CATCH_PAUSE,       /**< between two looks */
    CATCH_TOO_FAST,    /**< until the rotor has slowed down; then the first look again */
    CATCH_SEEN         /**< angle and speed are known: the rotor's next step goes on from there */
} catch_phase_t;

/** A rotor that turns at the start (drive/catch.h). */
typedef struct {
    uint16_t phase;        /**< catch_phase_t; written by catch_enter() only */
    alphabeta_t sum_q11;   /**< currents of this look */
    int16_t bus_q15;       /**< the bus when it was last asked whether it falls */
    angle_t direction;     /**< of the back-EMF in the middle of the last look */
    uint16_t pause;        /**< with the outputs off, periods */
    uint16_t half_periods; /**< from the middle of the last look to its end; between two looks, to the next one's begin */
} catch_t;

#define CATCH_PAUSE_MOST (CATCH_PAUSE_STEPS * SLOW_PERIODS) /**< periods: 50 ms; in them a rotor turns a tenth of a right angle, or it stands */

/** How long a rotor takes for CATCH_PAUSE_TURN. @param flux_q11 of a look @param samples that it took, the first of a part of a period */
uint16_t catch_pause(const drive_run_t *run, const drive_params_t *p, alphabeta_t flux_q11, uint16_t samples);

/** Speed from a turn. @param size of the turn, 0..32767 @return not negative */
speed_erpm_t catch_speed(const drive_params_t *p, int16_t size, uint16_t half_periods);

/** The start of all: the first look, or none. */
void catch_begin(drive_run_t *run, const drive_params_t *p);

/** 1 where a start must wait in CATCH, with nothing on: the bus is so high that switching would trip. */
uint16_t catch_waits_for_bus(drive_t *d, const drive_params_t *p);

/** A period of a look. @return 1 when it has ended and the rotor turns: the outputs go off */
uint16_t catch_look(drive_t *d, const drive_params_t *p);

/** A period with the outputs off. @return the next state */
drive_state_t catch_pass(drive_t *d, const drive_params_t *p);

/** The estimator as if it had turned with the rotor: half a period after this one's sample. */
void catch_preset_estimator(drive_t *d, const drive_params_t *p);

/** In closed loop from the next period on, at the rotor's speed and without torque. */
void catch_close(drive_t *d, const drive_params_t *p);

/** In CATCH, slots 1, 5, 9, 13: goes on from what was seen. A rotor below the minimum speed, whichever way it turns, is taken by the ramp. */
void catch_step(drive_t *d, const drive_params_t *p);

#endif
