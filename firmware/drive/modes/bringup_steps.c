/* BRINGUP, the steps in their order: panel, rest, currents in six directions, gains, turns of the shaft. */
#include "drive/modes/bringup.h"

#include "drive/drive.h"

#ifdef BRINGUP
#define REST_MS 100u     /* no button is touched yet */
#define REPEAT_MS 1000u  /* the first line again, by the other pin */
#define BUTTON_MS 20000u /* patience with a button */
#define POT_END 10       /* % */

static int16_t pot_percent(int16_t pot_q15)
{
    return (int16_t)((qm_muluu((uint16_t)((uint16_t)pot_q15 ^ 0x8000u), 100u) + 32768ul) >> 16);
}

void bringup_step_begin(bringup_guide_t *g, const buttons_t *in)
{
    if (g->phase == 0u) {
        if (in->s2_down || in->s3_down) {
            bringup_give_up(g, BRINGUP_BUTTON_DOWN, 0);
        } else if (g->waited_ms >= REST_MS) {
            g->phase = 1;
            g->waited_ms = REPEAT_MS;
        } else { /* at rest so far */
        }
    } else if (g->button != 0u) {
        g->first = g->button;
        g->sender = BRINGUP_LINES_BOTH;
        bringup_go(g, BRINGUP_STEP_S3);
    } else if (g->waited_ms >= REPEAT_MS) {
        g->sender = (uint16_t)((g->sender == 0u) ? 1u : 0u);
        bringup_say(g, BRINGUP_ASKS, (uint16_t)BRINGUP_ASK_BEGIN, g->sender);
        g->waited_ms = 0;
    } else { /* it has been said */
    }
}

void bringup_step_s3(bringup_guide_t *g)
{
    uint16_t button = bringup_answered(g, BRINGUP_ASK_S3, 0, 0);
    if (button == 0u) {
        if (g->waited_ms >= BUTTON_MS) {
            bringup_give_up(g, BRINGUP_BUTTON_DEAD, 0);
        }
        return;
    }
    if (button == g->first) {
        bringup_give_up(g, BRINGUP_BUTTON_DEAD, 0);
        return;
    }
    if (button == 2u) {
        bringup_find(g, BRINGUP_BUTTONS_SWAPPED, 0);
        g->swapped = 1;
    }
    bringup_go(g, BRINGUP_STEP_UART);
}

void bringup_step_uart(bringup_guide_t *g)
{
    uint16_t button = bringup_answered(g, BRINGUP_ASK_UART, 0, 0);
    if (button == 0u) {
        return;
    }
    if (button == 3u) {
        bringup_find(g, BRINGUP_UART_PIN, 0);
    } else {
        g->sender = 0; /* the other pin may be anybody's */
    }
    bringup_go(g, BRINGUP_STEP_LED_ALIVE);
}

void bringup_step_led(bringup_guide_t *g, uint16_t led)
{
    bringup_question_t question = led ? BRINGUP_ASK_LED_RUN : BRINGUP_ASK_LED_ALIVE;
    uint16_t button;
    g->leds = (uint16_t)(1u << led);
    button = g->leds_judged ? 2u : bringup_answered(g, question, 0, 0);
    if (button == 2u) {
        bringup_go(g, led ? BRINGUP_STEP_POT_LEFT : BRINGUP_STEP_LED_RUN);
    } else if (button == 3u) {
        bringup_go(g, led ? BRINGUP_STEP_LED_RUN_OTHER : BRINGUP_STEP_LED_ALIVE_OTHER);
    } else { /* no answer yet */
    }
}

void bringup_step_led_other(bringup_guide_t *g, uint16_t led)
{
    uint16_t button = bringup_answered(g, BRINGUP_ASK_LED_OTHER, 0, 0);
    if (button == 0u) {
        return;
    }
    bringup_find(g, (button == 2u) ? BRINGUP_LEDS_SWAPPED : BRINGUP_LED_DARK, 0);
    g->leds_judged = (uint16_t)(button == 2u);
    bringup_go(g, led ? BRINGUP_STEP_POT_LEFT : BRINGUP_STEP_LED_RUN);
}

void bringup_step_pot_end(bringup_guide_t *g, int16_t pot_q15, uint16_t right)
{
    if (bringup_answered(g, right ? BRINGUP_ASK_POT_RIGHT : BRINGUP_ASK_POT_LEFT, 0, 0) == 0u) {
        return;
    }
    if (right) {
        g->pot_right = pot_percent(pot_q15);
    } else {
        g->pot_left = pot_percent(pot_q15);
    }
    bringup_go(g, right ? BRINGUP_STEP_POT : BRINGUP_STEP_POT_RIGHT);
}

static bringup_finding_t pot_finding(const bringup_guide_t *g)
{
    if (qm_abs((int16_t)(g->pot_right - g->pot_left)) <= POT_END) {
        return BRINGUP_POT_DEAD;
    }
    return (g->pot_left > g->pot_right) ? BRINGUP_POT_REVERSED : BRINGUP_POT_RANGE;
}

void bringup_step_pot(bringup_guide_t *g)
{
    int32_t zero = (int32_t)(PARAM_F(POT_LIVE_ZERO) * 100.0F);
    if (g->index == 0u) {
        (void)bringup_tell(g, BRINGUP_VALUE_POT_LEFT, 0, g->pot_left, 0, zero + POT_END);
        g->index = 1;
    } else {
        uint16_t right = bringup_tell(g, BRINGUP_VALUE_POT_RIGHT, 0, g->pot_right, 100 - zero - POT_END, 100);
        if (!right || g->pot_left > zero + POT_END) {
            g->pending = (uint16_t)pot_finding(g);
        }
        bringup_go(g, BRINGUP_STEP_BUS);
    }
}

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
        bringup_go(g, (FAULT_INPUT_USED) ? BRINGUP_STEP_FAULT_INPUT : BRINGUP_STEP_CURRENT);
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
    } else { /* each its own */
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
    } else { /* right */
    }
    bringup_go(g, BRINGUP_STEP_DIRECTION);
}

void bringup_step_direction(bringup_guide_t *g, drive_t *d)
{
    uint16_t button;
    if (bringup_has_tripped(g, d)) {
        return;
    }
    d->run.bringup.most = BRINGUP_MOST_AMPLITUDE;
    d->run.bringup.keeps_current = 1;
    d->run.bringup.turning = 1;
    button = bringup_answered(g, BRINGUP_ASK_DIRECTION, 0, 0);
    if (button == 3u) {
        bringup_find(g, BRINGUP_DIRECTION, 0);
    }
    if (button != 0u) {
        d->run.bringup.turning = 0; /* at the end of this turn */
        bringup_go(g, BRINGUP_STEP_MARK);
    }
}

void bringup_step_mark(bringup_guide_t *g, drive_t *d)
{
    if (bringup_has_tripped(g, d) || bringup_answered(g, BRINGUP_ASK_MARK, 0, 0) == 0u) {
        return;
    }
    d->run.bringup.turns = 0;
    d->run.bringup.turning = 1;
    bringup_go(g, BRINGUP_STEP_TURNS);
}

void bringup_step_turns(bringup_guide_t *g, drive_t *d)
{
    uint16_t button;
    if (bringup_has_tripped(g, d)) {
        return;
    }
    button = bringup_answered(g, BRINGUP_ASK_TURNS, 0, 0);
    if (button == 3u) {
        bringup_find(g, BRINGUP_STANDS, 0);
    } else if (button == 2u) {
        bringup_tell_or_find(g, BRINGUP_VALUE_POLE_PAIRS, 0, (int32_t)d->run.bringup.turns, NOPOLESPAIRS, NOPOLESPAIRS, BRINGUP_POLE_PAIRS);
    } else {
        return;
    }
    bringup_go(g, BRINGUP_STEP_LAST);
}

void bringup_step_last(bringup_guide_t *g, drive_t *d)
{
    d->command.run = 0;
    bringup_say(g, BRINGUP_ENDS, 0, 0);
    g->message.value = (int32_t)g->found;
    bringup_go(g, BRINGUP_STEP_END);
}

void bringup_step_end(bringup_guide_t *g)
{
    if (g->button == 2u) {
        bringup_init(g);
    }
}
#endif
