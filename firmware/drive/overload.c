/* The heat of the winding. */
#include "drive/overload.h"

#include "drive/state.h"

#define SUM_SHIFT 10 /* i^2 / 2 over OVERLOAD_STEP_MS keeps to its word */

/** i_d^2 + i_q^2. @return Q26, at most 2^31 */
static uint32_t square_of_current(const drive_t *d)
{
    dq_t i = d->run.control.i_q13;
    return (uint32_t)qm_mulss(i.d, i.d) + (uint32_t)qm_mulss(i.q, i.q);
}

/** a * rate, in all bits of a. */
static int32_t part_of(int32_t a, uint16_t rate_q16)
{
    return qm_mulsu(qm_hi(a), rate_q16) + (int32_t)(qm_muluu((uint16_t)a, rate_q16) >> 16);
}

uint16_t overload_tick(overload_t *o, const drive_t *d, const drive_params_t *p, uint16_t ms)
{
    const uint16_t runs = drive_is_running(d);
    uint32_t square = 0; /* a stopped drive's registers keep what flowed last */
    uint16_t rest;
    if (p->i2t_most_q25 == 0) {
        return 0;
    }
    if (runs) {
        square = square_of_current(d) >> SUM_SHIFT;
    }
    for (rest = ms; rest != 0u; rest--) { /* one as a rule */
        o->sum += square;
        o->ms++;
        if (o->ms == OVERLOAD_STEP_MS) {
            o->heat_q25 += part_of((int32_t)o->sum - o->heat_q25, p->i2t_rate_q16);
            o->sum = 0;
            o->ms = 0;
        }
    }
    return (uint16_t)(runs && o->heat_q25 >= p->i2t_most_q25);
}
