/* What the drive reaches against what it asks for. */
#include "drive/deviation.h"

#include "drive/limit_reasons.h"
#include "drive/state.h"

#define MEAN_SHIFT 9 /* 512 ms */
#define MOST_TIMES 2 /* a deviation counts as twice its limit at most: then it may last 0.35 s */
#define HELD_BACK ((uint16_t)LIMIT_VOLTAGE | (uint16_t)LIMIT_CURRENT | (uint16_t)LIMIT_BRAKE | (uint16_t)LIMIT_RAMP | (uint16_t)LIMIT_RAMP_WAITS \
                   | (uint16_t)LIMIT_SPEED_RANGE)

/** Takes a deviation into its mean. @param limit more than 0, at most 16383 @return 1 where the mean is above it */
static uint16_t takes(int32_t *mean_q16, int16_t deviation, int16_t limit)
{
    int16_t size = qm_clamp(qm_abs(deviation), 0, (int16_t)(MOST_TIMES * limit));
    *mean_q16 += ((int32_t)size * 65536 - *mean_q16) >> MEAN_SHIFT;
    return (uint16_t)(qm_hi(*mean_q16) > limit);
}

uint16_t deviation_tick(deviation_t *v, const drive_t *d, const drive_params_t *p, uint16_t reasons)
{
    const drive_run_t *run = &d->run;
    const drive_control_t *c = &run->control;
    uint16_t found = 0;

    if (d->state != (uint16_t)DRIVE_CLOSED || run->handover.id_q13 != 0) {
        v->speed_q16 = 0;
        v->id_q16 = 0;
        return 0;
    }
    if ((reasons & HELD_BACK) != 0u) {
        return 0;
    }
    if (qm_abs(c->reference_erpm) >= p->observer.full_erpm) { /* below, the speed controller is slow */
        found = takes(&v->speed_q16, qm_sub_limited(c->reference_erpm, estimator_speed(&run->estimator)), qm_clamp(run->observer.wrong_erpm, 1, 16383));
    }
    return (uint16_t)(found | takes(&v->id_q16, (int16_t)(c->ref_q13.d - c->i_q13.d), p->id_off_q13));
}
