/* BRINGUP, the steps from both levels of current and from an ammeter: gains, resistance, dead time. */
#include "drive/modes/bringup_gains.h"

#ifdef BRINGUP

#include "drive/modes/bringup_measure.h"
#include "drive/modes/bringup_say.h"

#define R_MOHM(share) ((int32_t)(PARAM_F(share) * PARAM_F(MOTOR_RS_OHM) * 1000.0F))
#define R_LEAST_MOHM R_MOHM(PARAM_R_LEAST)
#define R_MOST_MOHM (R_MOHM(PARAM_R_MOST) + 100) /* transistors, shunt and leads add at most 0.1 ohm */
#define DEAD_NS (PARAM_F(DEADTIME_SEC) * 1000000000.0F)
#define DEAD_LEAST_NS ((int32_t)(0.75F * DEAD_NS))
#define DEAD_MOST_NS ((int32_t)(1.25F * DEAD_NS + 150.0F)) /* diodes and the transistors' delays */
#define RATIO_LEAST 88u
#define RATIO_MOST 114u

void bringup_step_bridge(bringup_guide_t *g, const drive_t *d)
{
    const bringup_bridge_t *r = &g->bridge;
    uint16_t n = g->index;
    g->index++;
    switch (n) {
    case 0:
        g->bridge = bringup_bridge(&g->half, &g->full, &g->wiring, bringup_bus_10mv(d));
        (void)bringup_tell(g, BRINGUP_VALUE_RATIO, 0, (int32_t)r->b_percent_of_a, (int32_t)RATIO_LEAST, (int32_t)RATIO_MOST);
        break;
    case 1:
        (void)bringup_tell(g, BRINGUP_VALUE_RESISTANCE, 0, (int32_t)r->resistance_mohm, R_LEAST_MOHM, R_MOST_MOHM);
        break;
    default:
        bringup_tell_or_find(g, BRINGUP_VALUE_DEAD_TIME, 0, (int32_t)r->dead_time_ns, DEAD_LEAST_NS, DEAD_MOST_NS, BRINGUP_DEAD_TIME);
        bringup_go(g, BRINGUP_STEP_AMMETER);
        break;
    }
}

/** All of the current along phase A. @return 1 when it flows */
static uint16_t holds_a(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    bringup_run_t *t = &d->run.bringup;
    if (g->phase <= 1u) {
        if (!bringup_started(g, d, p)) {
            return 0;
        }
        t->stop_q13 = BRINGUP_FULL_Q13;
        t->most = g->full.amplitude[0];
        bringup_measure(d, BRINGUP_SWING_PERIODS);
        g->phase = 2;
    }
    return t->ready;
}

void bringup_step_ammeter(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    uint16_t button, ready = holds_a(g, d, p);
    if (g->phase == 2u && bringup_has_tripped(g, d)) {
        return;
    }
    if (g->button != 0u && !g->asked) {
        bringup_go(g, BRINGUP_STEP_LAST);
        return;
    }
    if (!ready) {
        return;
    }
    if (g->wiring.leg[0] != 0u || g->wiring.leg[1] != 1u) {
        bringup_go(g, BRINGUP_STEP_DIRECTION); /* which wire the signal is in is open */
        return;
    }
    button = bringup_answered(g, BRINGUP_ASK_AMMETER, 0, bringup_ma(qm_abs(bringup_mean_of(d->run.bringup.sum_a))));
    if (button != 0u) {
        g->yes = (uint16_t)(button == 2u);
        bringup_go(g, BRINGUP_STEP_GAINS);
    }
}

void bringup_step_gains(bringup_guide_t *g)
{
    int32_t by_a = (int32_t)g->bridge.resistance_mohm;
    uint16_t alike = (uint16_t)(g->bridge.b_percent_of_a >= RATIO_LEAST && g->bridge.b_percent_of_a <= RATIO_MOST);
    if (!g->yes && alike) {
        bringup_find(g, BRINGUP_SHUNT_GAINS, 0);
    } else if (!g->yes || !alike) {
        bringup_find(g, BRINGUP_SHUNT_GAIN, g->yes); /* A's, or where A's is right B's */
    } else if (by_a < R_LEAST_MOHM || by_a > R_MOST_MOHM) {
        bringup_find(g, BRINGUP_RESISTANCE, 0);
    } else {
        /* right */
    }
    bringup_go(g, BRINGUP_STEP_DIRECTION);
}

#endif
