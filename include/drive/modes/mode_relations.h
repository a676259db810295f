/* What a mode asks of the parameters beyond their own table. */
#ifndef DRIVE_MODES_MODE_RELATIONS_H
#define DRIVE_MODES_MODE_RELATIONS_H

#include "drive/param_scaling.h" /* userparams.h may define the mode */

/** X(condition, message): as PARAM_RELATION_TABLE, for the mode that is switched on. */
#ifdef BRINGUP
#define MODE_RELATION_TABLE(X) \
    X(PARAM_F(NORM_CURRENT_CONST) <= 0.0039F, \
      PARAM_NAMED(NORM_CURRENT_CONST) " must be at most 0.0039 with BRINGUP, which counts milliamperes in 16 bits: leave BRINGUP out")
#else
#define MODE_RELATION_TABLE(X)
#endif

#endif
