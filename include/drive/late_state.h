/* What duties that act a period later add to the state of a run: nothing where they act in time. */
#ifndef DRIVE_LATE_STATE_H
#define DRIVE_LATE_STATE_H

#include "control/transforms.h"
#include "drive/param_scaling.h" /* LATE_DUTIES */

/** How much waits for the next control interrupt, as a number that arrays can have. */
__extension__ typedef enum { LATE_WAITS = LATE_DUTIES } late_waits_t;

/** Member of drive_run_t: the vector whose duties wait, Q13. */
#define LATE_STATE __extension__ alphabeta_t late_v_q13[LATE_WAITS];

#endif
