/* The seam between the application's room and the drive: what it is told, what it asks, and how long it may take. */
#ifndef BOARD_APPLICATION_H
#define BOARD_APPLICATION_H

#include "drive/inputs.h"

/** The potentiometer. */
extern pot_t board_pot;

/** After a reset. */
void application_init(void);

/** A pass of the background: the application decides. Its lights are on their pins afterwards. */
void application_tick(uint16_t elapsed_ms);

/** Each pass of the slow work: an application that does not return is late after APP_LATE_MS. Then the drive stops in order, for APPLICATION_STOP_SEC
 *  at most, and then the fault is APPLICATION, also where it has returned meanwhile. If it does not, the watchdog, which has been served until then, resets
 *  the processor. */
void application_watch(void);

#endif
