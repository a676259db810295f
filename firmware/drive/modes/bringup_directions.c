/* BRINGUP, the step that lets current flow in six directions, and what it tells of the wiring. */
#include "drive/modes/bringup_directions.h"

#ifdef BRINGUP

#include "drive/modes/bringup_measure.h"
#include "drive/modes/bringup_say.h"

#define SETTLE_FULL PARAM_PERIODS(0.15F)

void bringup_step_current(bringup_guide_t *g, const drive_t *d)
{
    uint16_t button = bringup_answered(g, BRINGUP_ASK_CURRENT, 0, 0);
    if (button == 0u) {
        return;
    }
    bringup_go(g, (button == 2u) ? BRINGUP_STEP_DRIVE : BRINGUP_STEP_LAST);
    if (d->fault != (uint16_t)FAULT_NONE) {
        bringup_give_up(g, BRINGUP_FAULT, 0);
        g->message.value = (int32_t)d->fault;
    }
}

/** A vector at one level. @param phase 2: half of the current, 3: all of it */
static void drive_level(bringup_guide_t *g, drive_t *d, uint16_t phase)
{
    bringup_run_t *t = &d->run.bringup;
    t->stop_q13 = (int16_t)((phase == 2u) ? BRINGUP_FULL_Q13 / 2 : BRINGUP_FULL_Q13);
    t->most = BRINGUP_MOST_AMPLITUDE;
    bringup_measure(d, (phase == 2u) ? BRINGUP_SWING_PERIODS : SETTLE_FULL);
    g->phase = phase;
}

static void keep_level(const bringup_guide_t *g, const drive_t *d, bringup_level_t *level)
{
    static const uint16_t phase_of[BRINGUP_DIRECTIONS] = { 0, 2, 1, 0, 2, 1 };
    const bringup_run_t *t = &d->run.bringup;
    level->a[g->index] = bringup_mean_of(t->sum_a);
    level->b[g->index] = bringup_mean_of(t->sum_b);
    level->amplitude[g->index] = qm_abs(t->part[phase_of[g->index]]);
}

void bringup_step_drive(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    static const angle_t angle_of[BRINGUP_DIRECTIONS] = { 0, 10923, 21845, 32768u, 43691u, 54613u }; /* +A, -C, +B, -A, +C, -B */
    bringup_run_t *t = &d->run.bringup;
    if (g->phase <= 1u && !bringup_started(g, d, p)) {
        return;
    }
    if (bringup_has_tripped(g, d)) {
        return;
    }
    if (g->button != 0u) {
        bringup_go(g, BRINGUP_STEP_LAST);
    } else if (g->phase == 1u) {
        t->angle = angle_of[g->index];
        drive_level(g, d, 2);
    } else if (g->phase == 4u) {
        if (t->amplitude == 0) {
            g->phase = 1;
            g->index++;
        }
        if (g->index == BRINGUP_DIRECTIONS) {
            d->command.run = 0;
            bringup_go(g, BRINGUP_STEP_SHOW);
        }
    } else if (!t->ready) {
        /* it measures */
    } else if (g->phase == 2u) {
        keep_level(g, d, &g->half);
        drive_level(g, d, 3);
    } else {
        keep_level(g, d, &g->full);
        t->most = 0;
        g->phase = 4;
    }
}

void bringup_step_show(bringup_guide_t *g, const drive_t *d)
{
    uint16_t n = g->index;
    bringup_say(g, BRINGUP_SHOWS, n, 0);
    g->message.value = (int32_t)qm_divud(qm_muluu((uint16_t)g->full.amplitude[n], bringup_bus_10mv(d)), (uint16_t)PWM_FULL_DUTY);
    g->message.low = bringup_ma(g->full.a[n]);
    g->message.high = bringup_ma(g->full.b[n]);
    g->index++;
    if (g->index == BRINGUP_DIRECTIONS) {
        g->wiring = bringup_wiring(&g->full);
        bringup_go(g, BRINGUP_STEP_WIRING);
    }
}

/** Which legs the signals follow. */
static void find_legs(bringup_guide_t *g)
{
    uint16_t a = g->wiring.leg[0], b = g->wiring.leg[1];
    if (a == b || (a != 0u && b != 1u && (a != 1u || b != 0u))) {
        bringup_find(g, BRINGUP_CURRENTS_MIXED, 0);
    } else if (a == 1u) {
        bringup_find(g, BRINGUP_CURRENTS_SWAPPED, 0);
    } else if (a == 2u || b == 2u) {
        bringup_find(g, BRINGUP_DRIVER_SWAPPED, (uint16_t)(a != 2u));
    } else {
        /* each its own */
    }
}

/** The finding of one question to the wiring, if it is one. @param number three a mask, one a phase */
static void find_wiring(bringup_guide_t *g, uint16_t number)
{
    const bringup_wiring_t *w = &g->wiring;
    uint16_t part = (uint16_t)(number % 3u), bit = (uint16_t)(1u << part);
    const uint16_t masks[5] = { w->dead, w->open, w->high, w->low, w->inverted };
    static const bringup_finding_t findings[5] = { BRINGUP_CURRENT_DEAD, BRINGUP_PHASE_OPEN, BRINGUP_HIGH_SIDE, BRINGUP_LOW_SIDE,
                                                   BRINGUP_SHUNT_INVERTED };
    if ((masks[number / 3u] & bit) != 0u) {
        bringup_find(g, findings[number / 3u], part);
    }
}

void bringup_step_wiring(bringup_guide_t *g)
{
    const bringup_wiring_t *w = &g->wiring;
    uint16_t bad = (uint16_t)(w->dead | w->open | w->high | w->low);
    if (w->open == 7u) {
        bringup_give_up(g, BRINGUP_NO_CURRENT, 0);
        return;
    }
    while (g->message.kind == (uint16_t)BRINGUP_SILENT && g->index < 15u) {
        find_wiring(g, g->index);
        g->index++;
    }
    if (g->message.kind != (uint16_t)BRINGUP_SILENT) {
        return;
    }
    if (bad == 0u) {
        find_legs(g);
    }
    bringup_go(g, (bad == 0u && w->leg[0] != w->leg[1]) ? BRINGUP_STEP_BRIDGE : BRINGUP_STEP_LAST);
}

#endif
