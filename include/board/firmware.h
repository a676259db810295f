/* The firmware as a whole: its start, its loop, and the one drive object. */
#ifndef BOARD_FIRMWARE_H
#define BOARD_FIRMWARE_H

#include "drive/drive.h"
#include "drive/limits.h"
#include "drive/modes/mode_table.h"
#include "drive/request.h"

/* Not in main: the stack of neither stays while the other runs. The processor's test has registers of its own. */
#define FIRMWARE_CALLED __attribute__((noinline))

/** The drive's parameters, from userparams.h. */
extern MODE_PARAMS_PLACE drive_params_t board_params;

/** The drive; the interrupts run it, the background writes its commands and raises faults. */
extern drive_t board_drive;

/** What is wished of the drive. */
extern request_t board_request;

/** What is left of the retries, and what began them. */
extern retry_t board_retry;

/** The brake chopper. */
extern chopper_t board_chopper;

#if SCOPE
/** What a client on the serial line asks of the drive. */
extern remote_t scope_command;
#endif

/** Not 0 from a failure of the clock to the next reset: on a wrong clock nothing may run, whatever the user presses. */
extern volatile uint16_t board_clock_failed;

/** All that main does before its loop: clock, pins, PWM with its outputs off, ADC, timer, UART, interrupts.
 *  A clock that does not come up, or fails later, raises FAULT_CLOCK, which S2 cannot clear; the outputs stay off. */
void firmware_init(void) FIRMWARE_CALLED;

/** Outputs off and the fault raised, from anywhere but the control interrupt. The first fault stays, and none is raised after it. */
void firmware_trip(drive_fault_t fault) FIRMWARE_CALLED;

#if HEAT_USED
/** AD1CHS0 as it was written last. */
extern uint16_t board_ch0;

/** Chooses CH0's input. Background. @param input an AN number, or BOARD_AN_OFF */
void firmware_choose_input(uint16_t input);
#else
#define firmware_choose_input(input) (AD1CHS0 = (input))
#endif

/** One pass of the loop. */
void firmware_background(void) FIRMWARE_CALLED;

#endif
