/* Space-vector modulation: a voltage vector and the measured bus become three duty cycles that leave the shunts a window. */
#ifndef CONTROL_SVM_H
#define CONTROL_SVM_H

#include "control/transforms.h"

/** Constants of the modulator, in duty counts. */
typedef struct {
    int16_t full;          /**< duty of 100 %: 2 (PTPER + 1) */
    int16_t top;           /**< highest duty before dead-time compensation: keeps the low sides on around the sample */
    int16_t dead_time;     /**< duty that dead time takes from a leg: Td / Ts * full */
    int16_t knee_q13;      /**< current at which dead-time compensation is full; linear below */
    int16_t dead_slope_q8; /**< dead_time / knee_q13 * 256; times knee_q13 it fits a word */
    int16_t turn_q13;      /**< most that a phase current changes from the sample to the middle of the pulse */
} svm_params_t;

/** What each leg gets for its dead time, duty counts. */
typedef struct {
    int16_t a, b, c;
} dead_duties_t;

/** The three duties. */
typedef struct {
    duty_t a, b, c;
} duties_t;

/** Duty that restores what dead time takes: the leg loses Td for a positive current and gains it for a negative one. */
int16_t svm_dead_time(const svm_params_t *p, current_q13_t asked_q13);

/** What dead time takes from each leg while these currents flow. @param dead written in place, for a returned structure is copied */
void svm_compensation(const svm_params_t *p, phases_t asked, dead_duties_t *dead);

/** @param duty with its dead-time compensation @param i_q13 measured, read only where it matters @return what the leg can have of it */
duty_t svm_leg(const svm_params_t *p, int16_t duty, const current_q13_t *i_q13);

/** Duties for a voltage vector.
 *  Centred between the extreme phases (min-max injection), then moved down as far as the sampling window asks: more of
 *  vector 000, less of 111, the same line voltages.
 *  @param v voltage vector, Q13
 *  @param duty_per_volt_q16 duty counts per voltage count * 65536, from the measured bus (see bus_update_gain())
 *  @param dead of the phase currents that the controllers ask for at the centre of the pulse, see svm_compensation(). The measured
 *         ones are a period older and carry the converter's steps; compensation that follows them makes a current stick at zero
 *  @param i measured phase currents, for the sampling window
 *  @param d the duties: written in place, for a returned structure is copied */
void svm(const svm_params_t *p, alphabeta_t v, uint16_t duty_per_volt_q16, const dead_duties_t *dead, const phases_t *i, duties_t *d);

#endif
