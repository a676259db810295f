/* From userparams.h to counts: a header a subject, which begins with the formulas as one writes them on paper. Numbers by trial: control/tuned.h.
 *
 * Every constant is a single-precision expression, so that the target's compiler (whose double has 32 bits) and a PC's fold it to the same integer.
 * The names of AN1292's constants are its own. */
#ifndef DRIVE_PARAM_SCALING_H
#define DRIVE_PARAM_SCALING_H

#include "drive/scaling/controllers.h"
#include "drive/scaling/current_voltage.h"
#include "drive/scaling/estimator.h"
#include "drive/scaling/machine.h"

#endif
