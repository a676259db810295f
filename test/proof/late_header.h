/* userparams.h with the shortest period, whose duties are late. */
#include "userparams.h"

#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.000025
