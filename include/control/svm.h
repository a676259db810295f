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
QM_INLINE int16_t svm_dead_time(const svm_params_t *p, current_q13_t asked_q13)
{
    if (asked_q13 > p->knee_q13) { /* a constant, and so below */
        return (int16_t)((int16_t)(p->knee_q13 * p->dead_slope_q8) >> 8);
    }
    if (asked_q13 < -p->knee_q13) {
        return (int16_t)((int16_t)(-p->knee_q13 * p->dead_slope_q8) >> 8);
    }
    return (int16_t)((int16_t)(asked_q13 * p->dead_slope_q8) >> 8);
}

/** What dead time takes from each leg while these currents flow. @param dead written in place, for a returned structure is copied */
QM_INLINE void svm_compensation(const svm_params_t *p, phases_t asked, dead_duties_t *dead)
{
    dead->a = svm_dead_time(p, asked.a);
    dead->b = svm_dead_time(p, asked.b);
    dead->c = svm_dead_time(p, asked.c);
}

/** @param duty with its dead-time compensation @param i_q13 measured, read only where it matters @return what the leg can have of it */
QM_INLINE duty_t svm_leg(const svm_params_t *p, int16_t duty, const current_q13_t *i_q13)
{
    int16_t given;
    if (qm_outside(duty, p->top)) {
        /* A current that is surely still positive at the next sample flows in the low diode during the dead time, so the window
         * is open longer by it; otherwise the compensation must not close the window. */
        int16_t most = (*i_q13 > p->turn_q13) ? p->full : p->top;
        given = (duty < 0) ? 0 : (duty > most) ? most
                                               : duty;
    } else {
        given = duty;
    }
    return (duty_t)given;
}

/** Duties for a voltage vector.
 *  Centred between the extreme phases (min-max injection), then moved down as far as the sampling window asks: more of
 *  vector 000, less of 111, the same line voltages.
 *  @param v voltage vector, Q13
 *  @param duty_per_volt_q16 duty counts per voltage count * 65536, from the measured bus (see bus_update_gain())
 *  @param dead of the phase currents that the controllers ask for at the centre of the pulse, see svm_compensation(). The measured
 *         ones are a period older and carry the converter's steps; compensation that follows them makes a current stick at zero
 *  @param i measured phase currents, for the sampling window
 *  @param d the duties: written in place, for a returned structure is copied */
QM_INLINE void svm(const svm_params_t *p, alphabeta_t v, uint16_t duty_per_volt_q16, const dead_duties_t *dead, const phases_t *i, duties_t *d)
{
    int16_t a = qm_mulhi_su(v.alpha, duty_per_volt_q16);
    int16_t t = qm_mulhi_su(qm_mulhi_su(v.beta, duty_per_volt_q16), 56756u); /* sqrt(3)/2 */
    int16_t half = (int16_t)(a >> 1);
    int16_t b = (int16_t)(t - half);
    int16_t c = (int16_t)(-t - half);
    int16_t max = a, min = a, shift;

    if (b > max) {
        max = b;
    } else {
        min = b;
    }
    if (c > max) {
        max = c;
    } else if (c < min) {
        min = c;
    }
    shift = (int16_t)((p->full - max - min) >> 1);
    if ((int16_t)(max + shift) > p->top) {
        shift = (int16_t)(p->top - max);
    }
    d->a = svm_leg(p, (int16_t)(a + shift + dead->a), &i->a);
    d->b = svm_leg(p, (int16_t)(b + shift + dead->b), &i->b);
    d->c = svm_leg(p, (int16_t)(c + shift + dead->c), &i->c);
}

#endif
