/* BRINGUP, the steps that let current flow in six directions, and what it tells of the wiring. */
#ifndef DRIVE_MODES_BRINGUP_DIRECTIONS_H
#define DRIVE_MODES_BRINGUP_DIRECTIONS_H

#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

/** The user lets current flow, or ends it. */
void bringup_step_current(bringup_guide_t *g, const drive_t *d);

/** Half the current, all of it, none, in one direction after the other. A press ends it. */
void bringup_step_drive(bringup_guide_t *g, drive_t *d, const drive_params_t *p);

/** Shows what was measured, a line for each direction. */
void bringup_step_show(bringup_guide_t *g, const drive_t *d);

/** What is wrong with wires, transistors, signals. */
void bringup_step_wiring(bringup_guide_t *g);

#endif

#endif
