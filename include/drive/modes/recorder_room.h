/* Which modes take the fault recorder's place in RAM. */
#ifndef DRIVE_MODES_RECORDER_ROOM_H
#define DRIVE_MODES_RECORDER_ROOM_H

#include "drive/param_scaling.h" /* userparams.h may define the mode */

/** RECORDER_PERIODS, or 0, which is without the recorder, where a mode has variables in its place. */
#if defined(SNAPSHOT)
#define MODE_WITHOUT_RECORDER "SNAPSHOT"
#elif defined(TUNING)
#define MODE_WITHOUT_RECORDER "TUNING"
#elif defined(PARAMS_IN_RAM)
#define MODE_WITHOUT_RECORDER "PARAMS_IN_RAM"
#elif defined(IDENTIFY)
#define MODE_WITHOUT_RECORDER "IDENTIFY"
#elif defined(BRINGUP)
#define MODE_WITHOUT_RECORDER "BRINGUP"
#elif SCOPE
#define MODE_WITHOUT_RECORDER "SCOPE"
#endif
#ifdef MODE_WITHOUT_RECORDER
#define MODE_RECORDER_PERIODS 0u
#else
#define MODE_RECORDER_PERIODS (RECORDER_PERIODS)
#endif

#endif
