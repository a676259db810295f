/* Space-vector modulation: a voltage vector and the measured bus become three duty cycles that leave the shunts a window. */
#include "control/svm.h"

int16_t svm_dead_time(const svm_params_t *p, current_q13_t asked_q13)
{
    if (asked_q13 > p->knee_q13) { /* a constant, and so below */
        return (int16_t)((int16_t)(p->knee_q13 * p->dead_slope_q8) >> 8);
    }
    if (asked_q13 < -p->knee_q13) {
        return (int16_t)((int16_t)(-p->knee_q13 * p->dead_slope_q8) >> 8);
    }
    return (int16_t)((int16_t)(asked_q13 * p->dead_slope_q8) >> 8);
}

void svm_compensation(const svm_params_t *p, phases_t asked, dead_duties_t *dead)
{
    dead->a = svm_dead_time(p, asked.a);
    dead->b = svm_dead_time(p, asked.b);
    dead->c = svm_dead_time(p, asked.c);
}

INLINE duty_t svm_leg(const svm_params_t *p, int16_t duty, const current_q13_t *i_q13)
{
    int16_t given;
    if (duty < 0 || duty > p->top) {
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

INLINE void svm(const svm_params_t *p, alphabeta_t v, uint16_t duty_per_volt_q16, const dead_duties_t *dead, const phases_t *i, duties_t *d)
{
    int16_t a = qm_mulhi_su(v.alpha, duty_per_volt_q16);
    int16_t t = qm_mulhi_su(qm_mulhi_su(v.beta, duty_per_volt_q16), 56756u); /* sqrt(3)/2 */
    int16_t half = (int16_t)(a >> 1);
    int16_t b = (int16_t)(t - half), c = (int16_t)(-t - half);
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
