/* What the modes add to the state of a run: nothing unless userparams.h or DEFINES switches one on. */
#ifndef DRIVE_MODES_MODE_STATE_H
#define DRIVE_MODES_MODE_STATE_H

#include "drive/modes/bringup.h"
#include "drive/modes/identify.h"

/** Members of drive_run_t. */
#define MODE_STATE IDENTIFY_STATE BRINGUP_STATE

/** 0 where no state has a closed loop: what belongs to it is left out. */
#ifdef BRINGUP
#define MODE_CLOSES_LOOP 0
#else
#define MODE_CLOSES_LOOP 1
#endif

#endif
