/* The status line on UART1: state, fault and speed, or what IDENTIFY has measured, twice a second. */
#ifndef BOARD_STATUS_H
#define BOARD_STATUS_H

#include "board/firmware.h"
#include "drive/recorder.h"

#include <stdint.h>

#define FOC33_VERSION "0.10.0" /**< the newest one in CHANGELOG.md */

/** The first line, version and cause of the last reset: "foc33 0.10.0 reset BOR POR". */
void status_init(void);

/** Composes the next line when it is due: "state 5 fault NONE speed 1000 rpm limit CURRENT RAMP"; in IDENTIFY "step 11 BUSY fault NONE R 2692100 uohm
 *  Ld 1919400 nH Lq 1920100 nH Kphi 0 uV/krpm ..." in one line. */
void status_tick(uint16_t elapsed_ms);

/** Hands one character to the UART if it has room. */
void status_send(void);

/** A speed in rpm of the shaft, cut off towards 0. @param speed counts of SPEED_UNIT electrical rpm @return within a word: a lost estimator may see more */
int16_t status_rpm(speed_erpm_t speed);

/* ---- Text into a buffer, for the status line ---- */

/** Each writes from `at` on, without a closing zero, and returns where the next text goes. The caller has room. */
char *text_put(char *at, const char *text);
char *text_put_unsigned(char *at, uint16_t number);

/** The line's end. */
char *text_end(char *at);

/** A text and a number behind it, in one call: the lines have many of them. */
char *text_put_named(char *at, const char *name, int16_t number);

/** A text and the fault's name behind it: "fault STALL", "fault NONE" without one. @param fault drive_fault_t; UNKNOWN for what is none of them */
char *text_put_fault(char *at, const char *before, uint16_t fault);

/** What follows a name in a list of them, each with its closing zero. */
const char *text_next(const char *name);

/* ---- The fault recorder on the board: the one recorder, and its rows as lines for the UART ---- */

/** The slow work writes it; kept over every reset but power-up. */
extern recorder_t board_recorder;

/** After reset_take(). @param kept the fault that the firmware starts with */
void record_init(drive_fault_t kept);

/** A pass of the background. */
void record_tick(void);

/** The next line of a record that is complete and not sent yet: "record fault STALL rows 64 every 4 offsets -12 3", the currents' offsets in Q13; then for each
 *  row, the oldest first, "row 17 -12 3 6 80 -113 101": its place in the ring and its bytes (recorder.h). @return its end; the line itself without one */
char *record_line(char *line);

#endif
