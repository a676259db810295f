/* I2t: the heat that the current leaves in the winding, for motors whose sheet gives a thermal time constant.
 *
 *     dh/dt = (i_d^2 + i_q^2 - h) / I2T_TIME_SEC,  too hot from h = I2T_CURRENT_A^2
 *
 * A cold winding stands k times the current for -T ln(1 - 1/k^2). The resistance that the drive learns tells the same more slowly and of any
 * motor; it sees the housing, too. */
#ifndef DRIVE_OVERLOAD_H
#define DRIVE_OVERLOAD_H

#include "drive/state.h"

#define OVERLOAD_STEP_MS 512u /**< a mean over so long makes a step of the heat */

#define OVERLOAD_SUM_SHIFT 10 /* i^2 / 2 over OVERLOAD_STEP_MS keeps to its word */

/** Heat of the winding. Zero is a valid start: a cold motor. A reset forgets it. */
typedef struct {
    int32_t heat_q25; /**< square of the current that would keep the winding as hot, Q13 counts^2 / 2 */
    uint32_t sum;     /**< of the step: i^2 / 1024 times ms */
    uint16_t ms;      /**< of the step */
} overload_t;

/** i_d^2 + i_q^2. @return Q26, at most 2^31 */
QM_INLINE uint32_t overload_square(const drive_t *d)
{
    dq_t i = d->run.control.i_q13;
    return (uint32_t)qm_mulss(i.d, i.d) + (uint32_t)qm_mulss(i.q, i.q);
}

/** a * rate, in all bits of a. */
QM_INLINE int32_t overload_part(int32_t a, uint16_t rate_q16)
{
    return qm_mulsu(qm_hi(a), rate_q16) + (int32_t)(qm_muluu((uint16_t)a, rate_q16) >> 16);
}

/** A pass of the background. Between runs the winding cools. @param ms since the last pass @return 1 while a running motor is too hot */
QM_INLINE uint16_t overload_tick(overload_t *o, const drive_t *d, const drive_params_t *p, uint16_t ms)
{
    const uint16_t runs = drive_is_running(d);
    uint32_t square = 0; /* a stopped drive's registers keep what flowed last */
    uint16_t rest;
    if (p->i2t_most_q25 == 0) {
        return 0;
    }
    if (runs) {
        square = overload_square(d) >> OVERLOAD_SUM_SHIFT;
    }
    for (rest = ms; rest != 0u; rest--) { /* one as a rule */
        o->sum += square;
        o->ms++;
        if (o->ms == OVERLOAD_STEP_MS) {
            o->heat_q25 += overload_part((int32_t)o->sum - o->heat_q25, p->i2t_rate_q16);
            o->sum = 0;
            o->ms = 0;
        }
    }
    return (uint16_t)(runs && o->heat_q25 >= p->i2t_most_q25);
}

#endif
