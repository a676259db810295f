/* The one machine: the drive's states, what each does on entry and in a step, and which may follow which. */
#ifndef DRIVE_STATES_H
#define DRIVE_STATES_H

#include "control/qmath.h"
#include "drive/faults.h"
#include "drive/forward.h"

/** X(name, meaning): what the drive is doing. Each state has its TRANSITIONS_FROM_ below. */
#define DRIVE_STATE_TABLE(X) \
    X(CALIBRATE, "outputs off, current offsets are averaged") \
    X(STOPPED, "outputs off, ready") \
    X(BOOTSTRAP, "low sides on: high-side drivers charge, the short circuit's current tells of a rotor that turns") \
    X(ALIGN, "a current that grows while it turns takes the rotor along") \
    X(RAMP, "forced angle accelerates; the estimator runs along") \
    X(CLOSED, "the estimator's angle drives the motor") \
    X(STOPPING, "closed loop, ramping down to a speed where the outputs can go off") \
    X(FAULT, "outputs off until S2 clears the fault") \
    X(CATCH, "outputs off: between two looks at a rotor that turns, or while it is too fast") \
    X(BRAKE, "STOP_MODE 2, low sides on: the short-circuited winding brakes until the rotor stands")

#define DRIVE_STATE_ENUM(name, meaning) DRIVE_##name,

typedef enum { DRIVE_STATE_TABLE(DRIVE_STATE_ENUM) DRIVE_STATE_COUNT } drive_state_t;

/* The transitions, X(next, reason): which states may follow a state, and why. drive_enter() refuses any other as a fault of the program, SELFTEST.
 * docs/states.md and its diagram come from here. */

#define TRANSITIONS_FROM_CALIBRATE(X) \
    X(STOPPED, "both current offsets are plausible") \
    X(FAULT, "OFFSET: one is not") \
    TRANSITIONS_BY_SUPERVISION(X)
#define TRANSITIONS_FROM_STOPPED(X) \
    X(BOOTSTRAP, "a start is requested") \
    X(CATCH, "a start is requested, and the bus is so high that switching would trip") \
    TRANSITIONS_BY_SUPERVISION(X)
#define TRANSITIONS_FROM_BOOTSTRAP(X) \
    X(STOPPED, "the request is taken back, or its target is in the other direction") \
    X(ALIGN, "the drivers are charged, the rotor stands") \
    X(CATCH, "a look has ended, and the rotor turns") \
    TRANSITIONS_BY_SUPERVISION(X) \
    TRANSITIONS_BY_CURRENT_OR_BUS(X)
#define TRANSITIONS_FROM_ALIGN(X) \
    X(STOPPED, "the request is taken back, or its target is in the other direction") \
    X(RAMP, "LOCK_TIME is over: the rotor turns with the vector") \
    TRANSITIONS_BY_SUPERVISION(X) \
    TRANSITIONS_BY_CURRENT_OR_BUS(X)
#define TRANSITIONS_FROM_RAMP(X) \
    X(STOPPED, "the request is taken back, or its target is in the other direction") \
    X(CLOSED, "the estimator agrees, and the current pulls the rotor: hand-over; never in OPEN_LOOP_FUNCTIONING, IDENTIFY, BRINGUP") \
    X(FAULT, "START_FAILED: it does not agree in time, or swings too long") \
    TRANSITIONS_BY_SUPERVISION(X) \
    TRANSITIONS_BY_CURRENT_OR_BUS(X)
#define TRANSITIONS_FROM_CLOSED(X) \
    X(STOPPING, "a stop is requested, or a target in the other direction") \
    X(STOPPED, "STOP_MODE 1: a stop is requested, and the rotor coasts") \
    X(BRAKE, "STOP_MODE 2: a stop is requested at a speed whose short circuit fits") \
    TRANSITIONS_BY_SUPERVISION(X) \
    TRANSITIONS_BY_CURRENT_OR_BUS(X) \
    TRANSITIONS_BY_ROTOR_OR_SIGNAL(X)
#define TRANSITIONS_FROM_STOPPING(X) \
    X(STOPPED, "the rotor is slow enough; or dead time hides its speed near the stop's end") \
    X(BRAKE, "STOP_MODE 2: slow enough for the short circuit") \
    X(RAMP, "slow enough, with a target in the other direction: the ramp takes the rotor through zero") \
    X(CLOSED, "a run is requested again, in this direction") \
    TRANSITIONS_BY_SUPERVISION(X) \
    TRANSITIONS_BY_CURRENT_OR_BUS(X) \
    TRANSITIONS_BY_ROTOR_OR_SIGNAL(X)
#define TRANSITIONS_FROM_FAULT(X) \
    X(CALIBRATE, "the fault is cleared, and it came before the current offsets were known") \
    X(STOPPED, "the fault is cleared") \
    TRANSITIONS_BY_SUPERVISION(X)
#define TRANSITIONS_FROM_CATCH(X) \
    X(STOPPED, "the request is taken back, or its target is in the other direction") \
    X(BOOTSTRAP, "the pause is over and the bus is low enough: the next look, or a start without one") \
    X(RAMP, "the rotor is seen, slower than the minimum speed") \
    X(CLOSED, "the rotor is seen, fast enough for the estimator") \
    X(FAULT, "OVERVOLTAGE: the bus does not fall, so the supply holds it") \
    TRANSITIONS_BY_SUPERVISION(X)
#define TRANSITIONS_FROM_BRAKE(X) \
    X(STOPPED, "no current is left: the rotor stands") \
    X(FAULT, "OVERCURRENT_SW, OVERTEMPERATURE: a load turns the rotor too fast, or for too long") \
    TRANSITIONS_BY_SUPERVISION(X)

/* What every state must bear; these come from an interrupt, a trap or the background, in the middle of anything. From FAULT the first code stays. */
#define TRANSITIONS_BY_SUPERVISION(X) \
    X(FAULT, "OVERCURRENT_HW, TRAP, CLOCK: the fault input or a trap") \
    X(FAULT, "ISR_OVERRUN, ADC_LOST, INTERRUPT_RATE, WATCHDOG, SELFTEST: the program does not run as it must") \
    X(FAULT, "POTENTIOMETER, APPLICATION; OVERVOLTAGE: the bus reads the end of its range") \
    X(FAULT, "MOTOR_HOT, BRIDGE_HOT, NTC_SENSOR: a temperature, or its sensor")
/* While the bridge conducts. */
#define TRANSITIONS_BY_CURRENT_OR_BUS(X) X(FAULT, "OVERCURRENT_SW, OVERVOLTAGE, UNDERVOLTAGE, OVERTEMPERATURE: current, bus or heat outside the limits")
/* While the estimator's angle is in command. */
#define TRANSITIONS_BY_ROTOR_OR_SIGNAL(X) \
    X(FAULT, "STALL, LOST_LOCK: the rotor does not follow") \
    X(FAULT, "CURRENT_SENSOR, OPEN_PHASE, BUS_SENSOR: signals and motor do not fit each other")

/** What drives the six outputs. */
typedef enum { OUTPUTS_OFF,
               OUTPUTS_BOOTSTRAP,
               OUTPUTS_PWM } outputs_t;

/** Clears bytes: assigning a zero struct would copy it from flash. */
void drive_zero(void *object, uint16_t size);

/** x turned into the direction of rotation. */
int16_t along_direction(const drive_t *d, int16_t x);

/** Brings the object to CALIBRATE; every field gets its start value. */
void drive_init(drive_t *d, const drive_params_t *p);

/** 1 where the table has this transition. */
uint16_t drive_may_follow(uint16_t state, drive_state_t next);

/** Enters a state; its clock begins anew. While a fault is kept, every way leads to FAULT: only drive_clear_fault() opens it. A transition that is not
 *  in the table is a fault of the program: SELFTEST, outputs off. */
void drive_enter(drive_t *d, drive_state_t next);

/** The last word of a period: a fault that a trap has raised in the middle of it outlives what it has entered since. @return 1: outputs off */
uint16_t drive_latch_fault(drive_t *d);

/** Stops at once and keeps the code of the first fault. Any context: background, interrupt, trap. */
void drive_raise(drive_t *d, drive_fault_t fault);

/** The same in place: for handlers, which save no more than they use. */
void drive_raise_at_once(drive_t *d, drive_fault_t fault);

/** Forgets the fault. The slow work only. @return the next state: STOPPED, or the calibration that it has interrupted */
drive_state_t drive_clear_fault(drive_t *d);

/** The direction of the run: of the target, or of the rotor that was caught. */
void drive_set_direction(drive_t *d, int16_t direction);

/** 1 while the bridge switches under the law's control: ALIGN to STOPPING, in one comparison. */
uint16_t drive_is_running(const drive_t *d);

/** 1 with the forced angle in command, ALIGN or RAMP, of the states in which the bridge switches. */
uint16_t drive_is_forced(const drive_t *d);

/** 1 with the estimator's angle in command: CLOSED or STOPPING. */
uint16_t drive_is_closed(const drive_t *d);

/** 1 while the bridge conducts, its drivers' charge with it, BOOTSTRAP to STOPPING, in one comparison. Not in BRAKE, whose low sides conduct, too: drive_shorts(). */
uint16_t drive_conducts(const drive_t *d);

/** 1 in BRAKE: the law rests, and the low sides short-circuit the winding. */
uint16_t drive_shorts(const drive_t *d);

/** What drives the bridge (outputs_t) in the drive's present state. */
uint16_t drive_outputs(const drive_t *d);

/** Prepares a start and requests it. Called by the background while the drive is STOPPED; does nothing otherwise. @param direction +1 or -1 */
void drive_start(drive_t *d, const drive_params_t *p, int16_t direction);

/** A period with the bridge off or charging its drivers, after its duties: each state says which comes next, the gate lets it in or not. */
void idle_step(drive_t *d, const drive_params_t *p, int16_t i_a, int16_t i_b);

/** What ALIGN and RAMP do in every fourth slot. */
void states_start_step(drive_t *d, const drive_params_t *p);

/** Where RAMP, CATCH and STOPPING lead to the next state by what the rotor does, in every fourth slot. */
void states_rotor_step(drive_t *d, const drive_params_t *p);

#endif
