/* Temperatures of motor and bridge by NTC thermistors: what they leave of the driving current, when they trip, and what a broken sensor does. */
#include "drive/heat.h"

#include "drive/drive.h"

#if HEAT_USED
int16_t ntc_celsius(const ntc_params_t *p, uint16_t share_q16)
{
    uint16_t node = 1, below, span, above = 0;
    while (node < NTC_NODES - 1u && share_q16 < p->share_q16[node]) {
        node++;
    }
    below = p->share_q16[node];
    span = (uint16_t)(p->share_q16[node - 1u] - below);
    if (share_q16 > below) {
        above = (uint16_t)(share_q16 - below);
    }
    if (above >= span) {
        above = (uint16_t)(span - 1u);
    }
    return (int16_t)(16 * (NTC_LEAST_C + NTC_STEP_C * (int16_t)node) - (qm_share(above, span) >> 7)); /* 2^15 are 16 * NTC_STEP_C */
}

/** 1 where no temperature is. */
static uint16_t ntc_is_at_an_end(uint16_t share_q16)
{
    return (uint16_t)(share_q16 >= NTC_OPEN_Q16 || share_q16 <= NTC_SHORTED_Q16);
}

void ntc_sample(ntc_t *ntc, const ntc_params_t *p, int16_t sample_q15)
{
    const int16_t trip_q4 = (int16_t)(p->trip_q4 - (ntc->is_hot ? HEAT_COOLER_Q4 : 0));
    if (ntc_is_at_an_end((uint16_t)((uint16_t)sample_q15 ^ 0x8000u))) {
        if (ntc->broken < NTC_BROKEN_SAMPLES) {
            ntc->broken++;
        }
        return;
    }
    if (ntc->broken != 0u) {
        ntc->broken--;
    }
    if (!ntc->is_known) {
        ntc->smooth_q31 = (int32_t)sample_q15 * 65536;
        ntc->is_known = 1;
    }
    ntc->celsius_q4 = ntc_celsius(p, (uint16_t)((uint16_t)qm_lowpass(&ntc->smooth_q31, sample_q15, NTC_FOLLOWS_Q16) ^ 0x8000u));
    ntc->is_hot = (uint16_t)(ntc->celsius_q4 >= trip_q4);
}

current_q13_t ntc_derated(const ntc_params_t *ntc, const drive_params_t *p, int16_t celsius_q4)
{
    const int16_t over_q4 = (int16_t)(celsius_q4 - ntc->derate_q4), least = (int16_t)(p->current_max_q13 / DERATE_LEAST);
    int32_t most = p->current_max_q13;
    if (over_q4 > 0) {
        most -= qm_mulss(over_q4, ntc->derate_per_q4_q8) >> 8;
    }
    return (int16_t)((most < least) ? least : most);
}

/** What the sensors say together. */
typedef struct {
    current_q13_t most_q13;
    uint16_t found; /* drive_fault_t */
} judged_heat_t;

/** What one of them says. @param hot its fault when it is too hot */
static void ntc_judge(judged_heat_t *now, const ntc_t *ntc, const ntc_params_t *its, const drive_params_t *p, drive_fault_t hot)
{
    const current_q13_t most = ntc_derated(its, p, ntc->celsius_q4);
    if (most < now->most_q13) {
        now->most_q13 = most;
    }
    if (ntc->broken == NTC_BROKEN_SAMPLES) {
        now->found = (uint16_t)FAULT_NTC_SENSOR;
    } else if (ntc->is_hot) {
        now->found = (uint16_t)hot;
    } else { /* nothing to say */
    }
}

uint16_t heat_follow(drive_t *d, const drive_params_t *p)
{
    judged_heat_t now = { p->current_max_q13, (uint16_t)FAULT_NONE };
#if BRIDGE_NTC_USED
    ntc_judge(&now, &d->heat.bridge, &p->bridge_ntc, p, FAULT_BRIDGE_HOT);
#endif
#if MOTOR_NTC_USED
    ntc_judge(&now, &d->heat.motor, &p->motor_ntc, p, FAULT_MOTOR_HOT);
#endif
    d->heat.most_q13 = now.most_q13;
    d->heat.held = now.found;
    return now.found;
}

void heat_init(drive_t *d, const drive_params_t *p)
{
    d->heat.most_q13 = p->current_max_q13;
}

current_q13_t heat_most(const drive_t *d)
{
    return d->heat.most_q13;
}

uint16_t heat_holds(const drive_t *d)
{
    return (uint16_t)(d->heat.held != (uint16_t)FAULT_NONE && d->heat.held == d->fault);
}
#endif
