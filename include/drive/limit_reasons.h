/* The one table of reasons why the drive gives less than it is asked for: it feeds the enum, docs/limits.md, the watch variable, the status
 * line and every report. */
#ifndef DRIVE_LIMIT_REASONS_H
#define DRIVE_LIMIT_REASONS_H

#include <stdint.h>

/** X(bit, name, cause, remedy). Several may hold at once, so each is a bit, which never changes its meaning. */
#define DRIVE_LIMIT_TABLE(X) \
    X(1, VOLTAGE, "the voltage vector has reached the circle that the bus allows", \
      "raise the bus, lower speed or load, or give field weakening more current (IDREF_SPEED, FW_TRIM_CURRENT_A)") \
    X(2, CURRENT, "the q current is at what MAXIMUM_CURRENT_A and the d current leave", \
      "take load off, accelerate more gently (SPEEDREFRAMP_RPM_PER_S); raise MAXIMUM_CURRENT_A if motor and board withstand it") \
    X(4, BRAKE, "the bus is above REGEN_LIMIT_V and takes no more braking current", \
      "slow down more gently (SPEEDREFRAMP_RPM_PER_S), or use a supply that takes the current") \
    X(8, RAMP, "the speed reference is on its way to its target", \
      "raise SPEEDREFRAMP_RPM_PER_S if the motor can follow faster") \
    X(16, RAMP_WAITS, "the ramp waits for a motor that is too far from the reference", \
      "look for VOLTAGE, CURRENT or BRAKE beside it; else check the load") \
    X(32, FIELD_WEAKENING, "field weakening's d current takes its part of MAXIMUM_CURRENT_A", \
      "nothing to do: a higher bus would need less of it") \
    X(64, SPEED_RANGE, "TORQUE_MODE: the commanded current would leave the range MINIMUM_SPEED_RPM .. MAXIMUM_SPEED_RPM", \
      "command more current or less, or change load or range") \
    X(128, TOO_FAST, "the start waits for a rotor that turns faster than MAXIMUM_SPEED_RPM, or holds the bus above OVER_VOLTAGE_V", \
      "wait until it has slowed down; a bus that does not fall meanwhile is the supply's: OVERVOLTAGE") \
    X(256, BURN, "the bus takes no more braking current: d current burns the rotor's energy in the winding, within MAXIMUM_CURRENT_A", \
      "nothing to do, but mind the winding's temperature where a heavy rotor is stopped again and again") \
    X(512, SWING, "the hand-over waits for a rotor that swings about the ramp's speed", \
      "make tune with the load's inertia in the motor file; or raise LOCK_TIME, lower OPENLOOP_RAMPSPEED_INCREASERATE")

#define DRIVE_LIMIT_ENUM(bit, name, cause, remedy) LIMIT_##name = (bit),
/** Reasons as bits. */
typedef enum { DRIVE_LIMIT_TABLE(DRIVE_LIMIT_ENUM) LIMIT_NONE = 0 } limit_reason_t;

#endif
