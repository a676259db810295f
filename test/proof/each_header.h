/* userparams.h as if the rotor might turn far in a period: each pulse has a compensation of dead time of its own. */
#include "drive/param_scaling.h"

#undef DEAD_EACH
#define DEAD_EACH 1
