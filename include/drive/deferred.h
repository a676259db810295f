/* What duties that act a period later add to a run, and a compensation of dead time for each pulse: nothing where they act in time and one serves two. */
#ifndef DRIVE_DEFERRED_H
#define DRIVE_DEFERRED_H

#include "control/svm.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

/** As long as ALIGN counts before its first duties are written. */
#define DEFER_ALIGN_PERIODS (DEFER_DUTIES ? SLOW_PERIODS : 0u)

/** Frame of the pulse whose duties are computed now: the next sample's, or a step further. @param before angle of this period's sample */
sincos_t deferred_frame(const drive_t *d, angle_t before);

/** The vector that the next pulse is: this one, or the one that has waited. @param v_q13 given to the modulator */
alphabeta_t deferred_vector(drive_run_t *run, alphabeta_t v_q13);

/** The estimator and what waits, as if this vector had acted all the time. */
void deferred_preset(drive_run_t *run, alphabeta_t v_q13);

/** The asked currents at the middle of the next two pulses, or of the first one. */
dq_t deferred_currents(const drive_run_t *run);

/* ---- What a compensation of dead time for each pulse adds to the state: nothing where one serves two ---- */

/** That of this period's pulse: the slow work follows the second one. */
const dead_duties_t *dead_of_pulse(const drive_t *d);

/** That of the second pulse, where it has its own: a step after the first. The forced angle is slow, there it is the same.
 *  @param asked currents of the first */
void dead_prepare_second(drive_t *d, const drive_params_t *p, dq_t asked);

#endif
