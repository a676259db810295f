/* For tools/live/tuning.py: the parameters as a userparams.h gives them, and the scales by which numbers on the page are read. */
#include "drive/param_init.h"

const drive_params_t tuned_params = DRIVE_PARAMS_INIT;

const double tuned_scales[] = { (double)PARAM_F(NORM_CURRENT_CONST), (double)NORM_VOLTAGE_CONST, (double)SPEED_UNIT / (double)(NOPOLESPAIRS),
                                (double)PARAM_F(BUS_FULL_SCALE_V), (double)PARAM_F(LOOPTIME_SEC) };
