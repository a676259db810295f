/* The fault recorder on the board: the one recorder, and its rows as lines for the UART. */
#ifndef BOARD_RECORD_H
#define BOARD_RECORD_H

#include "board/firmware.h"
#include "drive/recorder.h"

/** The control interrupt writes it; kept over every reset but power-up. */
extern recorder_t board_recorder;

/** After reset_take(). @param kept the fault that the firmware starts with */
void record_init(drive_fault_t kept);

/** A pass of the background. */
void record_tick(void);

/** The next line of a record that is complete and not sent yet: "record fault 6 rows 64 every 4 offsets -12 3", the currents' offsets in Q13;
 *  then for each row, the oldest first, "row 17 -12 3 6 80 -113 101": its place in the ring and its bytes (recorder.h).
 *  @return its end; the line itself without one */
char *record_line(char *line);

#endif
