/* Limits of voltage and current, the bus that they come from, and why the drive gives less than it is asked for. */
#ifndef DRIVE_LIMITS_H
#define DRIVE_LIMITS_H

#include "drive/drive.h"

/** X(bit, name, cause, remedy). Several may hold at once, so each is a bit, which never changes its meaning. */
#define DRIVE_LIMIT_TABLE(X) \
    DRIVE_LIMIT_TABLE_BARE(X) \
    X(8192, CHOPPER, "the brake resistor has had BRAKE_CHOPPER_SHARE of the time and rests", \
      "slow down more gently or less often; raise BRAKE_CHOPPER_SHARE if the resistor bears more")

/** Those of a drive without a brake resistor. */
#define DRIVE_LIMIT_TABLE_BARE(X) \
    X(1, VOLTAGE, "the voltage vector has reached the circle that the bus allows", \
      "raise the bus, lower speed or load, or give field weakening more current (IDREF_SPEED, FW_TRIM_CURRENT_A)") \
    X(2, CURRENT, "the q current is at what MAXIMUM_CURRENT_A and the d current leave", \
      "take load off, accelerate more gently (SPEEDREFRAMP_RPM_PER_S); raise MAXIMUM_CURRENT_A if motor and board withstand it") \
    X(4, BRAKE, "the bus is above REGEN_LIMIT_V and takes no more braking current", \
      "slow down more gently (SPEEDREF_DECEL_RPM_PER_S), or use a supply that takes the current") \
    X(8, RAMP, "the speed reference is on its way to its target", \
      "raise SPEEDREFRAMP_RPM_PER_S, or SPEEDREF_DECEL_RPM_PER_S, if the motor can follow faster") \
    X(16, RAMP_WAITS, "the ramp waits for a motor that is too far from the reference", \
      "look for VOLTAGE, CURRENT or BRAKE beside it; else check the load") \
    X(32, FIELD_WEAKENING, "field weakening's d current takes its part of MAXIMUM_CURRENT_A", \
      "nothing to do: a higher bus would need less of it") \
    X(64, SPEED_RANGE, "TORQUE_MODE: the commanded current would leave the range MINIMUM_SPEED_RPM .. MAXIMUM_SPEED_RPM", \
      "command more current or less, or change load or range") \
    X(128, TOO_FAST, "the start waits for a rotor that turns faster than MAXIMUM_SPEED_RPM, or holds the bus above OVER_VOLTAGE_V", \
      "wait until it has slowed down; a bus that does not fall meanwhile is the supply's: OVERVOLTAGE") \
    X(256, FLUX_BRAKING, "the bus takes no more braking current: flux braking turns the rotor's energy into heat in the winding, within MAXIMUM_CURRENT_A", \
      "nothing to do, but mind the winding's temperature where a heavy rotor is stopped again and again") \
    X(512, SWING, "the hand-over waits for a rotor that swings about the ramp's speed", \
      "make tune with the load's inertia in the motor file; or raise LOCK_TIME, lower OPENLOOP_RAMPSPEED_INCREASERATE") \
    X(1024, SUPPLY, "the q current is at what SUPPLY_CURRENT_LIMIT_A allows", \
      "take load or speed off; raise SUPPLY_CURRENT_LIMIT_A if the supply gives more") \
    X(2048, LOW_BUS, "the bus is below DERATE_BELOW_V and the q current at what that leaves", \
      "check the supply and its cable, or charge the battery; take load off") \
    X(4096, TEMPERATURE, "the motor is above MOTOR_DERATE_C or the bridge above BRIDGE_DERATE_C, and the q current at what that leaves", \
      "take load off, or cool it better; at MOTOR_TRIP_C or BRIDGE_TRIP_C the drive trips")

#define DRIVE_LIMIT_ENUM(bit, name, cause, remedy) LIMIT_##name = (bit),

/** Reasons as bits. */
typedef enum { DRIVE_LIMIT_TABLE(DRIVE_LIMIT_ENUM) LIMIT_NONE = 0 } limit_reason_t;

/** Voltage that the q axis has left, less what the missing q current asks for: a limit that is only touched now and then takes no more d
 *  current than it must, and one that costs speed takes what it needs. @param missing_q13 q current, in its reference's direction */
voltage_q14_t limits_free_voltage(const drive_control_t *c, current_q13_t missing_q13);

/** Most that the d axis and braking ask for: what the current controllers overshoot stays within MAXIMUM_CURRENT_A. */
current_q13_t limits_asked_most(const drive_params_t *p);

/** 1 where a q current brakes: it is against the rotor. @param turns the rotor's speed or its back-EMF */
uint16_t limits_brakes(current_q13_t iq_q13, int16_t turns);

/** The d current that burns the rotor's energy in the winding: more while the bus holds the braking current back, less while the circle does or
 *  nothing. Where both do alike, the vector is as long as it may be and the bus takes nothing. Before the next limits_braking(). */
void limits_flux_brake(drive_run_t *run, const drive_params_t *p);

/** What a circle leaves beside a current of the other axis, by the circle table.
 *  @param reciprocal 2^25 / most_q13 @param other_q13 not negative @return 0..most_q13 */
current_q13_t limits_circle(current_q13_t most_q13, uint16_t reciprocal, uint16_t other_q13);

/** What MAXIMUM_CURRENT_A leaves. A pointer to the parameters would keep all of them in the image. */
current_q13_t limits_beside(const drive_params_t *p, uint16_t other_q13);

/** d current: what is left of the hand-over, the table with its trim or what is burnt, the rotor's probe; the q current gets the rest of the circle. */
void limits_current(drive_run_t *run, const drive_params_t *p);

/** The q current that the supply allows a driving motor: 3/2 (u_d i_d + u_q i_q) = V SUPPLY_CURRENT_LIMIT_A, what the board itself draws not counted.
 *  It takes a quarter of its change a step, 3 ms in all: near standstill u_q is R i_q, and each step would overshoot by as much as it takes.
 *  @return Q13, 0..current_max_q13 */
current_q13_t limits_supply(drive_t *d, const drive_params_t *p);

/** Driving current at a low bus: MAXIMUM_CURRENT_A from DERATE_BELOW_V up, a fifth of it (DERATE_LEAST) at UNDER_VOLTAGE_V and below, linear between.
 *  @param bus_q15 filtered @return Q13, current_max_q13 / 5..current_max_q13 */
current_q13_t limits_derated(const drive_params_t *p, int16_t bus_q15);

/** Narrows the q current's limit to what supply and bus allow, while the q current drives; braking has REGEN_LIMIT_V. After limits_current(). */
void limits_driving(drive_t *d, const drive_params_t *p);

/** Largest braking current: falls to nothing over the 2 V above REGEN_LIMIT_V. @param bus_q15 of this moment: with a filter's lag the bus would swing */
void limits_braking(drive_run_t *run, const drive_params_t *p, int16_t bus_q15);

/** Limits braking current to what the bus absorbs. @param iq_q13 the speed controller's output @return the q current */
current_q13_t limits_apply_braking(const drive_control_t *c, speed_erpm_t speed, current_q13_t iq_q13);

/** Why the drive gives less than it is asked for at this moment: a sum of limit_reason_t, 0 while the bridge is off. It reads the drive's
 *  variables and changes nothing; the background calls it, for the control interrupt has no time to spare. */
uint16_t limits_reasons(const drive_t *d, const drive_params_t *p);

/* ---- The bus voltage: its filter, and what the modulator and the current controllers get from it ---- */

/** The modulator's gain at a bus voltage. @param bus_q15 of full scale, any; below the under-voltage trip it counts as that */
void bus_update_gain(drive_t *d, const drive_params_t *p, int16_t bus_q15);

/** The voltage circle at the filtered bus. */
void bus_update_voltage_limit(drive_t *d, const drive_params_t *p);

/** The bus of this moment, Q15 of full scale. @param v_bus_raw the converter's result, any value */
int16_t bus_sample(int16_t v_bus_raw);

/** Filters the bus, checks it, and follows the bus of this moment with the modulator's gain: after a step of the supply a late gain is a wrong voltage, which
 *  the estimator takes for speed. Slots 1, 5, 9, 13, in every state. @param v_bus_raw the converter's result, any value */
void bus_step(drive_t *d, const drive_params_t *p, int16_t v_bus_raw);

/* ---- The brake chopper: a resistor on the bus turns into heat what the supply does not take back ----
 *
 *     on from V = BRAKE_CHOPPER_V, off 2 % below; the slow work looks, so at the latest two periods late, T = 0.1 ms at 20 kHz
 *     braking with the current I at the voltage circle feeds I_bus = 3/2 I/sqrt(3), and dV/dt = I_bus/C:
 *     2.75 A give 2.4 A, with 1000 uF 2.4 V/ms, so the bus rises by at most 0.24 V beyond V
 *     the resistor takes all of it where R <= V/I_bus, 11 ohm at 26 V; with a larger one REGEN_LIMIT_V holds the rest
 *
 * In any time t the resistor is on for at most BRAKE_CHOPPER_SHARE (t + BRAKE_CHOPPER_SEC), whatever the bus reads: a cold one for
 * SHARE SEC / (1 - SHARE) at once. Then it rests for an eighth of BRAKE_CHOPPER_SEC. */

/** State of the brake chopper. Zero is a valid start: a cold resistor. A reset forgets the time it was on. */
typedef struct {
    uint32_t spent_q10; /**< periods * 1024 that the resistor has been on beyond its share */
    uint16_t ticks;     /**< of the drive, at the last step */
    uint16_t is_on;     /**< 1: the resistor is on */
    uint16_t rests;     /**< 1: it has had its share; LIMIT_CHOPPER */
} chopper_t;

/** A step of the slow work, with the bridge off, too. @param bus_q15 of this moment @param ticks of the drive @return 1 where the resistor is to be on */
uint16_t bus_chopper(chopper_t *c, int16_t bus_q15, uint16_t ticks);

#endif
