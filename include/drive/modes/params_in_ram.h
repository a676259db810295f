/* PARAMS_IN_RAM: a debugger can change the parameters while the motor turns; TUNING needs it too. */
#ifndef DRIVE_MODES_PARAMS_IN_RAM_H
#define DRIVE_MODES_PARAMS_IN_RAM_H

#include "drive/param_scaling.h" /* userparams.h may define the mode */

/** In RAM each parameter is read anew in the next period, e.g. board_params.fieldweak.idref_q13[3], and nobody checks its range.
 *  Otherwise parameters are constants in the interrupt's instructions. */
#if defined(TUNING) || defined(PARAMS_IN_RAM)
#define MODE_PARAMS_PLACE
#else
#define MODE_PARAMS_PLACE const
#endif

#endif
