/* BRINGUP, the steps without current: bus divider, both current signals at rest, the fault input. */
#include "drive/modes/bringup_rest.h"

#ifdef BRINGUP

#include "drive/modes/bringup_measure.h"
#include "drive/modes/bringup_say.h"

#define BUS_LEAST BRINGUP_10MV(0.9F * PARAM_F(NOMINAL_BUS_V))
#define BUS_MOST BRINGUP_10MV(1.1F * PARAM_F(NOMINAL_BUS_V))
#define CLEAR_MS 150u                             /* a fault is cleared, the offsets are averaged, and it is back if its cause is */
#define NOISE_MOST_STEPS 3                        /* mean deviation, steps of the converter */
#define STEP_Q13 ((int16_t)(64.0F * 0.5F * 0.5F)) /* a step of the converter at a gain of 0.5, halved by the product */

void bringup_step_bus(bringup_guide_t *g, const drive_t *d)
{
    uint16_t bus = bringup_bus_10mv(d);
    bringup_tell_or_find(g, BRINGUP_VALUE_BUS, 0, (int32_t)bus, BUS_LEAST, BUS_MOST, BRINGUP_BUS_DIVIDER);
    g->blocked |= (uint16_t)(g->pending != (uint16_t)BRINGUP_FINDINGS);
    bringup_go(g, BRINGUP_STEP_OFFSETS);
}

void bringup_step_rest(bringup_guide_t *g, drive_t *d, uint16_t noises)
{
    bringup_run_t *t = &d->run.bringup;
    if (g->phase == 0u) {
        t->ready = 1;
        t->mean_a_q13 = g->mean[0];
        t->mean_b_q13 = g->mean[1];
        bringup_measure(d, 0);
        g->phase = 1;
    } else if (!t->ready) {
        /* it measures */
    } else if (noises) {
        g->off[0] = bringup_mean_of(t->off_a);
        g->off[1] = bringup_mean_of(t->off_b);
        bringup_go(g, BRINGUP_STEP_SIGNALS);
    } else {
        g->mean[0] = bringup_mean_of(t->sum_a);
        g->mean[1] = bringup_mean_of(t->sum_b);
        bringup_go(g, BRINGUP_STEP_NOISES);
    }
}

void bringup_step_signals(bringup_guide_t *g, const drive_t *d, const drive_params_t *p)
{
    uint16_t signal = (uint16_t)(g->index >> 1);
    int16_t offset_q13 = (int16_t)(signal ? d->calibration.offset_b_q13 : d->calibration.offset_a_q13);
    int32_t most = bringup_ma(p->offset_max_q13), noise = bringup_ma((int16_t)(NOISE_MOST_STEPS * STEP_Q13));
    if ((g->index & 1u) == 0u) {
        int16_t off = bringup_ma((int16_t)(g->mean[signal] + offset_q13));
        bringup_tell_or_find(g, BRINGUP_VALUE_OFFSET, signal, off, -most, most, BRINGUP_OFFSET);
        g->blocked |= (uint16_t)(g->pending != (uint16_t)BRINGUP_FINDINGS);
    } else {
        bringup_tell_or_find(g, BRINGUP_VALUE_NOISE, signal, bringup_ma(g->off[signal]), 0, noise, BRINGUP_NOISE);
    }
    g->index++;
    if (g->index == 4u) {
        bringup_go(g, BRINGUP_STEP_FAULT_REST);
    }
}

/* ---- Fault input ---- */

/** Clears what is kept and waits whether it comes back. @return 1 when that is known */
static uint16_t cleared(bringup_guide_t *g, drive_t *d)
{
    if (g->phase == 0u) {
        d->command.clear_fault = 1;
        g->waited_ms = 0;
        g->phase = 1;
    }
    return (uint16_t)(g->waited_ms >= CLEAR_MS);
}

void bringup_step_fault_rest(bringup_guide_t *g, drive_t *d)
{
    if (!cleared(g, d)) {
        return;
    }
    if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        bringup_give_up(g, BRINGUP_FAULT_LOW, 0);
    } else if (g->blocked) {
        bringup_go(g, BRINGUP_STEP_LAST);
    } else {
        bringup_go(g, BRINGUP_STEP_FAULT_INPUT);
    }
}

void bringup_step_fault_input(bringup_guide_t *g, const drive_t *d)
{
    uint16_t button = bringup_answered(g, BRINGUP_ASK_FAULT_INPUT, 0, 0);
    if (button == 3u) {
        bringup_go(g, BRINGUP_STEP_CURRENT);
    } else if (button == 0u) {
        /* not yet */
    } else if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        bringup_go(g, BRINGUP_STEP_FAULT_OPEN);
    } else {
        bringup_give_up(g, BRINGUP_FAULT_DEAD, 0);
    }
}

void bringup_step_fault_open(bringup_guide_t *g, drive_t *d)
{
    if (g->phase == 0u && bringup_answered(g, BRINGUP_ASK_FAULT_OPEN, 0, 0) == 0u) {
        return;
    }
    if (!cleared(g, d)) {
        return;
    }
    if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        bringup_give_up(g, BRINGUP_FAULT_LOW, 0);
    } else {
        bringup_go(g, BRINGUP_STEP_CURRENT);
    }
}

#endif
