/* What a mode asks of the parameters beyond their own table. */
#ifndef DRIVE_MODES_MODE_RELATIONS_H
#define DRIVE_MODES_MODE_RELATIONS_H

#include "drive/param_scaling.h" /* userparams.h may define the mode */

/** X(condition, message): as PARAM_RELATION_TABLE, for the mode that is switched on. */
#ifdef BRINGUP
#define MODE_RELATION_BRINGUP(X) \
    X(PARAM_F(NORM_CURRENT_CONST) <= 0.0039F, \
      PARAM_NAMED(NORM_CURRENT_CONST) " must be at most 0.0039 with BRINGUP, which counts milliamperes in 16 bits: leave BRINGUP out")
#else
#define MODE_RELATION_BRINGUP(X)
#endif

/* Those that add to each period's work, or look at what follows a duty at once. */
#if defined(SNAPSHOT)
#define MODE_WITHOUT_TIME "SNAPSHOT"
#elif defined(IDENTIFY)
#define MODE_WITHOUT_TIME "IDENTIFY"
#elif defined(BRINGUP)
#define MODE_WITHOUT_TIME "BRINGUP"
#endif
#ifdef MODE_WITHOUT_TIME
#define MODE_RELATION_LATE(X) \
    X(!LATE_DUTIES, \
      PARAM_NAMED(LOOPTIME_SEC) " must be at least 0.00004 with " MODE_WITHOUT_TIME ", for which a shorter period has no time: leave it out, or use a longer period")
#else
#define MODE_RELATION_LATE(X)
#endif

#define MODE_RELATION_TABLE(X) MODE_RELATION_LATE(X) MODE_RELATION_BRINGUP(X)

#endif
