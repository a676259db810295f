/* What a compensation of dead time for each pulse adds to the state: nothing where one serves two. */
#ifndef DRIVE_DEAD_STATE_H
#define DRIVE_DEAD_STATE_H

#include "control/svm.h"
#include "drive/param_scaling.h" /* DEAD_EACH */

/** How many compensations come after the first, as a number that arrays can have. */
__extension__ typedef enum { DEAD_MORE = DEAD_EACH } dead_more_t;

/** Member of drive_t: dead-time compensation of the second pulse to come. */
#define DEAD_STATE __extension__ dead_duties_t dead_second[DEAD_MORE];

#endif
