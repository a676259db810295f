/* What the modes add to the state of a run: nothing unless userparams.h or DEFINES switches one on. */
#ifndef DRIVE_MODES_MODE_STATE_H
#define DRIVE_MODES_MODE_STATE_H

#include "drive/modes/identify.h"

#ifdef TUNING
#define TUNING_STATE uint16_t tuning_q16; /* fraction of the ramp's speed, Q16 of an electrical rpm */
#else
#define TUNING_STATE
#endif

/** Members of drive_run_t. */
#define MODE_STATE IDENTIFY_STATE TUNING_STATE

#endif
