/* The d current against its reference. */
#include "drive/deviation.h"

#include "drive/limit_reasons.h"
#include "drive/state.h"

#define MEAN_SHIFT 9 /* 512 ms */
#define MOST_TIMES 2 /* a deviation counts as twice its limit at most: then it may last 0.35 s */
#define HELD_BACK ((uint16_t)LIMIT_VOLTAGE | (uint16_t)LIMIT_CURRENT | (uint16_t)LIMIT_BRAKE | (uint16_t)LIMIT_RAMP | (uint16_t)LIMIT_RAMP_WAITS \
                   | (uint16_t)LIMIT_SPEED_RANGE)

uint16_t deviation_tick(deviation_t *v, const drive_t *d, const drive_params_t *p, uint16_t reasons)
{
    const drive_control_t *c = &d->run.control;
    int16_t size;

    if (d->state != (uint16_t)DRIVE_CLOSED || d->run.handover.id_q13 != 0) {
        v->id_q16 = 0;
        return 0;
    }
    if ((reasons & HELD_BACK) != 0u) {
        return 0;
    }
    size = qm_clamp(qm_abs((int16_t)(c->ref_q13.d - c->i_q13.d)), 0, (int16_t)(MOST_TIMES * p->id_off_q13));
    v->id_q16 += ((int32_t)size * 65536 - v->id_q16) >> MEAN_SHIFT;
    return (uint16_t)(qm_hi(v->id_q16) > p->id_off_q13);
}
