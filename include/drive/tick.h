/* One PWM period of the drive, top to bottom: samples, currents, current control, angle, modulation; then the slow work. */
#ifndef DRIVE_TICK_H
#define DRIVE_TICK_H

#include "control/svm.h"
#include "drive/schedule.h"

/** Phase currents from the samples: gain, then the calibrated offset. */
void drive_measure(drive_t *d, const drive_params_t *p, const drive_samples_t *raw);

/** A period with the bridge switching. @param duty written */
void drive_run(drive_t *d, const drive_params_t *p, duties_t *duty);

/** Last of the slow work: what the law of the next two periods needs and the samples do not change. */
void drive_prepare(drive_t *d, const drive_params_t *p);

/** One PWM period up to the duties; after it, where schedule_is_due() or the bridge does not switch, drive_slow(), which may take until the next
 *  period, drive_outputs(), and last drive_latch_fault(). @param raw the converter's results, sampled while the low sides conduct @param duty
 *  the board must load it before the next PWM boundary; 0, the low sides on, where the bridge does not switch @return 1 where it does */
uint16_t drive_tick(drive_t *d, const drive_params_t *p, const drive_samples_t *raw, duties_t *duty);

/** First of the slow work: what a period with the bridge off is. */
void drive_idle(drive_t *d, const drive_params_t *p, const drive_samples_t *raw);

/** 1 where the slow work has something to do in this period while the bridge switches: with deferred duties in each. */
uint16_t drive_slow_follows(const drive_t *d);

/** Slow work after the duties of a period are written, for they have a deadline and this has none but the next period. With deferred duties the periods between
 *  the slots take the estimator's share, and the recorder's. @param raw the converter's results of this period @return 1 while the bridge goes on switching */
uint16_t drive_slow(drive_t *d, const drive_params_t *p, const drive_samples_t *raw);

/* ---- What duties that act a period later add to a run: nothing where they act in time ---- */

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

/** That of the second pulse, where it has its own: a step after the first. The forced angle is slow, there it is the same. @param asked currents of the first */
void dead_prepare_second(drive_t *d, const drive_params_t *p, dq_t asked);

#endif
