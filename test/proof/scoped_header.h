/* userparams.h with the scope: a client's sine beside the current asked for. */
#define SCOPE 1
#include "drive/param_scaling.h"
