/* BRINGUP, the last steps: the field turns, the user tells direction and pole pairs. */
#ifndef DRIVE_MODES_BRINGUP_TURN_H
#define DRIVE_MODES_BRINGUP_TURN_H

#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

/** Turns forward by electrical turns. */
void bringup_step_direction(bringup_guide_t *g, drive_t *d);

/** Stands, so that the user can mark the shaft. */
void bringup_step_mark(bringup_guide_t *g, drive_t *d);

/** Turns until the mark is back, and counts. */
void bringup_step_turns(bringup_guide_t *g, drive_t *d);

#endif

#endif
