/* The firmware as a whole: its start, its loop, and the one drive object. */
#ifndef BOARD_FIRMWARE_H
#define BOARD_FIRMWARE_H

#include "drive/drive.h"
#include "drive/panel.h"
#include "drive/param_scaling.h"

/** In RAM a debugger or scope can change a parameter while the motor turns, e.g. board_params.fieldweak.idref_q13[3]; each is
 *  read anew in the next period. Nobody checks its range then. Otherwise parameters are constants in the instructions. */
#if defined(TUNING) || defined(PARAMS_IN_RAM)
#define BOARD_PARAMS_PLACE
#else
#define BOARD_PARAMS_PLACE const
#endif

/** The drive's parameters, from userparams.h. */
extern BOARD_PARAMS_PLACE drive_params_t board_params;

/** The drive; the control interrupt runs it, the background only writes its commands. */
extern drive_t board_drive;

/** Buttons, potentiometer, lights. */
extern panel_t board_panel;

/** Not 0 from a failure of the clock to the next reset: on a wrong clock nothing may run, whatever the user presses. */
extern volatile uint16_t board_clock_failed;

/** All that main does before its loop: clock, pins, PWM with its outputs off, ADC, timer, UART, interrupts.
 *  A clock that does not come up, or fails later, raises FAULT_CLOCK, which S2 cannot clear; the outputs stay off. */
void firmware_init(void);

/** One pass of the loop. */
void firmware_background(void);

#endif
