/* The one table of faults: code, name, cause and remedy feed the enum, docs/faults.md, the LED and every report. */
#ifndef DRIVE_FAULTS_H
#define DRIVE_FAULTS_H

/** May the fault pass by itself, so that a retry is worth it (RETRY_COUNT)? Not one of the hardware or the program, nor one behind which there
 *  may be a short circuit: each retry would feed it again. */
#define FAULT_PASSES 1
#define FAULT_STAYS 0

/** X(code, name, passes, decided_by, cause, remedy). Codes never change their meaning; the LED blinks the code. The bodies of decided_by's functions name it. */
#define DRIVE_FAULT_TABLE(X) \
    X(0, NONE, FAULT_STAYS, "", \
      "no fault", "nothing to do") \
    X(1, OVERCURRENT_HW, FAULT_STAYS, "_FLTA1Interrupt, firmware_supervise", \
      "the FLTA1 input went low: the board's comparator saw too much current", \
      "look for a short circuit; check MAXIMUM_CURRENT_A and the current loops; S2 clears it when FLTA1 is high again") \
    X(2, OVERCURRENT_SW, FAULT_STAYS, "protection_check_current", \
      "a phase current exceeded OVER_CURRENT_THRESHOLD_A", \
      "lower CURRENT_BANDWIDTH_HZ or MAXIMUM_CURRENT_A; check NORM_CURRENT_CONST, KCURRA and KCURRB") \
    X(3, OVERVOLTAGE, FAULT_PASSES, "protection_check_bus, catch_pass", \
      "the bus exceeded OVER_VOLTAGE_V while something was on, kept a start waiting without falling, or read the end of its range", \
      "brake more gently (SPEEDREFRAMP_RPM_PER_S), lower REGEN_LIMIT_V; check the supply") \
    X(4, UNDERVOLTAGE, FAULT_PASSES, "protection_check_bus", \
      "the bus fell below UNDER_VOLTAGE_V while running", \
      "check the supply, its cable and current limit") \
    X(5, START_FAILED, FAULT_PASSES, "handover_wait, handover_prepare", \
      "at the end of the ramp the estimator did not see the ramp's speed: shaft blocked or load too high", \
      "free the shaft; raise Q_CURRENT_REF_OPENLOOP or LOCK_TIME, lower OPENLOOP_RAMPSPEED_INCREASERATE") \
    X(6, STALL, FAULT_PASSES, "protection_check_rotor", \
      "the estimated speed stayed below half the reference, with little current below a quarter, or backwards; or a probe found the rotor standing", \
      "remove the overload; in field weakening see FdWeakParm.qIndex and raise that IDREF_SPEED entry") \
    X(7, LOST_LOCK, FAULT_PASSES, "protection_check_rotor", \
      "the estimator's d-axis back-EMF exceeded the q-axis one, or its speed left the possible range", \
      "check MOTOR_KPHI_V_PER_KRPM, MOTOR_RS_OHM and MOTOR_LS_MH; accelerate more gently") \
    X(8, ISR_OVERRUN, FAULT_STAYS, "_T2Interrupt", \
      "the control interrupt missed the PWM boundary, so the voltage's delay is no longer known", \
      "build with -O2; shorten what was added to the interrupt") \
    X(9, OFFSET, FAULT_STAYS, "calibration_step", \
      "a current offset measured before the start is outside its range", \
      "check the current amplifiers, AN0 and AN1, and that the motor stood still") \
    X(10, ADC_LOST, FAULT_STAYS, "firmware_watch_interrupt", \
      "no control interrupt came for two milliseconds", \
      "check the PWM and ADC set-up; after a reset the fault must not come back") \
    X(11, CLOCK, FAULT_STAYS, "firmware_init, firmware_supervise, _OscillatorFail", \
      "the PLL did not lock at the start, or the clock monitor, where FCKSM has it on, found the crystal dead", \
      "check the 8 MHz crystal and the configuration words, then reset: S2 does not clear this one") \
    X(12, TRAP, FAULT_STAYS, "_DefaultInterrupt, reset_take", \
      "the processor took a trap or an unexpected interrupt", \
      "read board_trap_intcon1, the copy of INTCON1 that says which trap it was") \
    X(13, WATCHDOG, FAULT_STAYS, "reset_take", \
      "the watchdog reset the processor: the background or the control interrupt stood still", \
      "look for a loop that waits without bound in what was added; board_reset_cause is RCON as the start found it") \
    X(14, CURRENT_SENSOR, FAULT_STAYS, "signals_which_is_wrong, signals_d_current, signals_offset", \
      "voltages and currents did not fit the motor for a tenth of a second, or the d current stayed off its reference: a current signal is wrong", \
      "check AN0 and AN1, the shunts and their amplifiers; with the motor at rest both must read the middle; check MOTOR_LS_MH") \
    X(15, BUS_SENSOR, FAULT_STAYS, "protection_check_model, protection_check_bus_signal", \
      "the voltage that the motor takes asks for more flux than R, L and Kphi within their tolerances explain, or the bus fell at once and took the back-EMF with it: its signal is wrong", \
      "measure the bus and compare it with the drive's; check the divider, BUS_FULL_SCALE_V and MOTOR_KPHI_V_PER_KRPM") \
    X(16, OPEN_PHASE, FAULT_STAYS, "signals_which_is_wrong, signals_phases", \
      "voltages and currents did not fit the motor, and one phase carried much less current than the others; or it carried hardly any of what was asked of it", \
      "check the motor's wires, the transistors of that phase and its current signal") \
    X(17, POTENTIOMETER, FAULT_STAYS, "panel_tick, application_fault", \
      "the potentiometer's signal was in the dead ends of POT_LIVE_ZERO, where no position of it is; or an application's command signal was lost", \
      "check its three wires, or those of the signal") \
    X(18, INTERRUPT_RATE, FAULT_STAYS, "firmware_count_interrupts", \
      "too few control interrupts in a tenth of a second", \
      "look for what holds interrupts up; check the PWM and ADC set-up") \
    X(19, OVERTEMPERATURE, FAULT_STAYS, "protection_check_model, firmware_judge", \
      "the winding's resistance rose to the end of what the drive believes: 180 degrees Celsius if the header's is right at 25; or more than I2T_CURRENT_A flowed for too long", \
      "let the motor cool down, lower the load; check MOTOR_RS_OHM, the wires' contacts and I2T_TIME_SEC") \
    X(20, SELFTEST, FAULT_STAYS, "selftest_fail, drive_enter", \
      "a self-test failed: memory, processor, clock, program flow or a register is not as it must be", \
      "see board_selftest_failed or the status line for the test, docs/selftest.md for its meaning, then reset: S2 does not clear this one") \
    X(21, APPLICATION, FAULT_STAYS, "panel_tick, application_watch, application_fault", \
      "the application did not return within 20 ms, or found a fault of its own", \
      "look in firmware/app, or in the file of APP=, for a loop that waits and for what sets asks->fault") \
    X(22, MOTOR_HOT, FAULT_PASSES, "heat_follow", \
      "the motor's NTC has read MOTOR_TRIP_C, and less than 10 K below it since", \
      "let the motor cool down: until then nothing clears this one; lower the load or MAXIMUM_CURRENT_A; check MOTOR_NTC_OHM and MOTOR_NTC_BETA_K") \
    X(23, BRIDGE_HOT, FAULT_PASSES, "heat_follow", \
      "the bridge's NTC has read BRIDGE_TRIP_C, and less than 10 K below it since", \
      "let the bridge cool down: until then nothing clears this one; cool it better, or lower the load; check BRIDGE_NTC_OHM and BRIDGE_NTC_BETA_K") \
    X(24, NTC_SENSOR, FAULT_STAYS, "ntc_judge", \
      "an NTC's input has read an end of its range for a tenth of a second: a broken wire or a short circuit", \
      "check the wires, and that the sensor is the one of MOTOR_NTC_USED or BRIDGE_NTC_USED; until then nothing clears this one")

#define DRIVE_FAULT_ENUM(code, name, passes, decided_by, cause, remedy) FAULT_##name = (code),
/** Fault codes. */
typedef enum { DRIVE_FAULT_TABLE(DRIVE_FAULT_ENUM) FAULT_COUNT } drive_fault_t;

#endif
