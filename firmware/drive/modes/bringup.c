/* BRINGUP, the background's part: leads through the steps, measures, asks the user, and finds what is wrong. */
#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

#include "drive/modes/bringup_tick.h"

#define REST_MS 100u      /* no button is touched yet */
#define REPEAT_MS 1000u   /* the first line again, by the other pin */
#define BUTTON_MS 20000u  /* patience with a button */
#define CURRENT_MS 60000u /* patience while current flows */
#define CLEAR_MS 150u     /* a fault is cleared, the offsets are averaged, and it is back if its cause is */
#define START_MS 100u     /* a start charges the drivers first */
#define SUM_LOG2 10u
#define SUM_PERIODS 1024u
#define SETTLE_HALF PARAM_PERIODS(0.3F) /* the rotor swings into the field */
#define SETTLE_FULL PARAM_PERIODS(0.15F)
#define NOISE_MOST_STEPS 3                        /* mean deviation, steps of the converter */
#define STEP_Q13 ((int16_t)(64.0F * 0.5F * 0.5F)) /* a step of the converter at a gain of 0.5, halved by the product */

/* ---- What is expected ---- */
#define BUS_10MV(volts) ((int32_t)(PARAM_F(volts) * 100.0F + 0.5F))
#define R_MOHM(share) ((int32_t)(PARAM_F(share) * PARAM_F(MOTOR_RS_OHM) * 1000.0F))
#define R_BRIDGE_MOHM 100 /* transistors, shunt and leads add at most */
#define DEAD_NS (PARAM_F(DEADTIME_SEC) * 1000000000.0F)
#define DEAD_LEAST_NS ((int32_t)(0.75F * DEAD_NS))
#define DEAD_MOST_NS ((int32_t)(1.25F * DEAD_NS + 150.0F)) /* diodes and the transistors' delays */
#define RATIO_LEAST 88u
#define RATIO_MOST 114u
#define POT_END 10 /* % */

/* Most amplitude: 1.6 times what R and half as much again as what dead time take. Whatever the signals say, it bounds the current. */
#define MOST_V \
    (1.6F * PARAM_F(BRINGUP_CURRENT_SHARE) * PARAM_F(MAXIMUM_CURRENT_A) * (PARAM_F(MOTOR_RS_OHM) + 0.05F) + 1.5F * 4.0F / 3.0F * PARAM_DEAD_TIME_V)
#define MOST_ROOM (PARAM_F(PWM_TOP_DUTY) - PARAM_F(PWM_FULL_DUTY) / 2.0F)
#define MOST_AMPLITUDE ((int16_t)PARAM_MIN(MOST_V / PARAM_F(NOMINAL_BUS_V) * PARAM_F(PWM_FULL_DUTY), MOST_ROOM))

/* ---- Saying and asking ---- */

static void say(bringup_guide_t *g, bringup_kind_t kind, uint16_t code, uint16_t part)
{
    g->message.kind = (uint16_t)kind;
    g->message.code = code;
    g->message.part = part;
}

static void go(bringup_guide_t *g, bringup_step_t step)
{
    g->step = (uint16_t)step;
    g->index = 0;
    g->phase = 0;
    g->asked = 0;
    g->button = 0;
    g->waited_ms = 0;
}

static void find(bringup_guide_t *g, bringup_finding_t finding, uint16_t part)
{
    g->found++;
    say(g, BRINGUP_FINDS, (uint16_t)finding, part);
}

/** What ends it: the rest has no meaning. */
static void give_up(bringup_guide_t *g, bringup_finding_t finding, uint16_t part)
{
    find(g, finding, part);
    go(g, BRINGUP_STEP_LAST);
}

/** A value with its range; outside of it the finding follows. @return 1 if it is inside */
static uint16_t tell(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high)
{
    say(g, BRINGUP_TELLS, (uint16_t)what, part);
    g->message.value = value;
    g->message.low = low;
    g->message.high = high;
    return (uint16_t)(value >= low && value <= high);
}

static void tell_or_find(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high, bringup_finding_t finding)
{
    if (!tell(g, what, part, value, low, high)) {
        g->pending = (uint16_t)finding;
        g->pending_part = part;
    }
}

/** Asks once and waits. @return the button that answers, 2 or 3; 0: none yet */
static uint16_t answered(bringup_guide_t *g, bringup_question_t question, uint16_t part, int32_t value)
{
    uint16_t button = g->button;
    if (!g->asked) {
        say(g, BRINGUP_ASKS, (uint16_t)question, part);
        g->message.value = value;
        g->asked = 1;
        button = 0;
    } else if (button != 0u) {
        g->asked = 0;
        g->waited_ms = 0;
    } else {
        /* the user thinks */
    }
    g->button = 0;
    return button;
}

/* ---- Measuring ---- */

/** Sums anew, after so many periods. The last word: from here on the interrupt owns the instrument. */
static void measure(drive_t *d, uint16_t wait)
{
    bringup_run_t *t = &d->run.bringup;
    t->sum_a = 0;
    t->sum_b = 0;
    t->off_a = 0;
    t->off_b = 0;
    t->wait = wait;
    t->left = SUM_PERIODS;
    t->ready = 0;
}

static int16_t mean_of(int32_t sum)
{
    return (int16_t)(sum >> SUM_LOG2);
}

/** The bridge begins to switch, without a vector. @return 1 when it does, or when it will not */
static uint16_t started(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    if (g->phase == 0u) {
        drive_start(d, p, 1);
        g->waited_ms = 0;
        g->phase = 1;
    }
    return (uint16_t)(drive_is_running(d) || g->waited_ms >= START_MS);
}

/** What has switched the bridge off. @return 1 if something has */
static uint16_t has_tripped(bringup_guide_t *g, const drive_t *d)
{
    bringup_finding_t finding = BRINGUP_FAULT;
    if (drive_is_running(d)) {
        return 0;
    }
    if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        finding = BRINGUP_SHORT_CIRCUIT;
    } else if (d->fault == (uint16_t)FAULT_OVERCURRENT_SW) {
        finding = BRINGUP_OVERCURRENT;
    } else {
        /* another one */
    }
    give_up(g, finding, 0);
    g->message.value = (int32_t)d->fault;
    return 1;
}

static uint16_t bus_10mv(const drive_t *d)
{
    return (uint16_t)((uint32_t)qm_muluu((uint16_t)((uint32_t)d->bus_q31 >> 16), (uint16_t)BUS_10MV(BUS_FULL_SCALE_V)) >> 15);
}

static int16_t pot_percent(int16_t pot_q15)
{
    return (int16_t)((qm_muluu((uint16_t)((uint16_t)pot_q15 ^ 0x8000u), 100u) + 32768ul) >> 16);
}

/* ---- Buttons, lights, potentiometer ---- */

static void step_begin(bringup_guide_t *g, const panel_inputs_t *in)
{
    if (g->phase == 0u) {
        if (in->s2_down || in->s3_down) {
            give_up(g, BRINGUP_BUTTON_DOWN, 0);
        } else if (g->waited_ms >= REST_MS) {
            g->phase = 1;
            g->waited_ms = REPEAT_MS;
        } else {
            /* at rest so far */
        }
    } else if (g->button != 0u) {
        g->first = g->button;
        g->sender = BRINGUP_LINES_BOTH;
        go(g, BRINGUP_STEP_S3);
    } else if (g->waited_ms >= REPEAT_MS) {
        g->sender = (uint16_t)((g->sender == 0u) ? 1u : 0u);
        say(g, BRINGUP_ASKS, (uint16_t)BRINGUP_ASK_BEGIN, g->sender);
        g->waited_ms = 0;
    } else {
        /* it has been said */
    }
}

static void step_s3(bringup_guide_t *g)
{
    uint16_t button = answered(g, BRINGUP_ASK_S3, 0, 0);
    if (button == 0u) {
        if (g->waited_ms >= BUTTON_MS) {
            give_up(g, BRINGUP_BUTTON_DEAD, 0);
        }
        return;
    }
    if (button == g->first) {
        give_up(g, BRINGUP_BUTTON_DEAD, 0);
        return;
    }
    if (button == 2u) {
        find(g, BRINGUP_BUTTONS_SWAPPED, 0);
        g->swapped = 1;
    }
    go(g, BRINGUP_STEP_UART);
}

static void step_uart(bringup_guide_t *g)
{
    uint16_t button = answered(g, BRINGUP_ASK_UART, 0, 0);
    if (button == 0u) {
        return;
    }
    if (button == 3u) {
        find(g, BRINGUP_UART_PIN, 0);
    } else {
        g->sender = 0; /* the other pin may be anybody's */
    }
    go(g, BRINGUP_STEP_LED_ALIVE);
}

/** One LED is lit: is it the right one? @param led 0: ALIVE, 1: RUN */
static void step_led(bringup_guide_t *g, uint16_t led)
{
    bringup_question_t question = led ? BRINGUP_ASK_LED_RUN : BRINGUP_ASK_LED_ALIVE;
    uint16_t button;
    g->leds = (uint16_t)(1u << led);
    button = g->leds_judged ? 2u : answered(g, question, 0, 0);
    if (button == 2u) {
        go(g, led ? BRINGUP_STEP_POT_LEFT : BRINGUP_STEP_LED_RUN);
    } else if (button == 3u) {
        go(g, led ? BRINGUP_STEP_LED_RUN_OTHER : BRINGUP_STEP_LED_ALIVE_OTHER);
    } else {
        /* no answer yet */
    }
}

static void step_led_other(bringup_guide_t *g, uint16_t led)
{
    uint16_t button = answered(g, BRINGUP_ASK_LED_OTHER, 0, 0);
    if (button == 0u) {
        return;
    }
    find(g, (button == 2u) ? BRINGUP_LEDS_SWAPPED : BRINGUP_LED_DARK, 0);
    g->leds_judged = (uint16_t)(button == 2u);
    go(g, led ? BRINGUP_STEP_POT_LEFT : BRINGUP_STEP_LED_RUN);
}

static void step_pot_end(bringup_guide_t *g, int16_t pot_q15, uint16_t right)
{
    if (answered(g, right ? BRINGUP_ASK_POT_RIGHT : BRINGUP_ASK_POT_LEFT, 0, 0) == 0u) {
        return;
    }
    if (right) {
        g->pot_right = pot_percent(pot_q15);
    } else {
        g->pot_left = pot_percent(pot_q15);
    }
    go(g, right ? BRINGUP_STEP_POT : BRINGUP_STEP_POT_RIGHT);
}

static bringup_finding_t pot_finding(const bringup_guide_t *g)
{
    if (qm_abs((int16_t)(g->pot_right - g->pot_left)) <= POT_END) {
        return BRINGUP_POT_DEAD;
    }
    return (g->pot_left > g->pot_right) ? BRINGUP_POT_REVERSED : BRINGUP_POT_RANGE;
}

static void step_pot(bringup_guide_t *g)
{
    int32_t zero = (int32_t)(PARAM_F(POT_LIVE_ZERO) * 100.0F);
    if (g->index == 0u) {
        (void)tell(g, BRINGUP_VALUE_POT_LEFT, 0, g->pot_left, 0, zero + POT_END);
        g->index = 1;
    } else {
        uint16_t right = tell(g, BRINGUP_VALUE_POT_RIGHT, 0, g->pot_right, 100 - zero - POT_END, 100);
        if (!right || g->pot_left > zero + POT_END) {
            g->pending = (uint16_t)pot_finding(g);
        }
        go(g, BRINGUP_STEP_BUS);
    }
}

/* ---- Signals at rest ---- */

static void step_bus(bringup_guide_t *g, const drive_t *d)
{
    uint16_t bus = bus_10mv(d);
    tell_or_find(g, BRINGUP_VALUE_BUS, 0, (int32_t)bus, BUS_10MV(0.9F * PARAM_F(NOMINAL_BUS_V)), BUS_10MV(1.1F * PARAM_F(NOMINAL_BUS_V)), BRINGUP_BUS_DIVIDER);
    g->blocked |= (uint16_t)(g->pending != (uint16_t)BRINGUP_FINDINGS);
    go(g, BRINGUP_STEP_OFFSETS);
}

/** Means first, then what the samples are off them. @param noises 1: the second time */
static void step_rest(bringup_guide_t *g, drive_t *d, uint16_t noises)
{
    bringup_run_t *t = &d->run.bringup;
    if (g->phase == 0u) {
        t->ready = 1;
        t->mean_a_q13 = g->mean[0];
        t->mean_b_q13 = g->mean[1];
        measure(d, 0);
        g->phase = 1;
    } else if (!t->ready) {
        /* it measures */
    } else if (noises) {
        g->off[0] = mean_of(t->off_a);
        g->off[1] = mean_of(t->off_b);
        go(g, BRINGUP_STEP_SIGNALS);
    } else {
        g->mean[0] = mean_of(t->sum_a);
        g->mean[1] = mean_of(t->sum_b);
        go(g, BRINGUP_STEP_NOISES);
    }
}

static void step_signals(bringup_guide_t *g, const drive_t *d, const drive_params_t *p)
{
    uint16_t signal = (uint16_t)(g->index >> 1);
    int16_t offset_q13 = (int16_t)(signal ? d->calibration.offset_b_q13 : d->calibration.offset_a_q13);
    int32_t most = bringup_ma(p->offset_max_q13), noise = bringup_ma((int16_t)(NOISE_MOST_STEPS * STEP_Q13));
    if ((g->index & 1u) == 0u) {
        tell_or_find(g, BRINGUP_VALUE_OFFSET, signal, bringup_ma((int16_t)(g->mean[signal] + offset_q13)), -most, most, BRINGUP_OFFSET);
        g->blocked |= (uint16_t)(g->pending != (uint16_t)BRINGUP_FINDINGS);
    } else {
        tell_or_find(g, BRINGUP_VALUE_NOISE, signal, bringup_ma(g->off[signal]), 0, noise, BRINGUP_NOISE);
    }
    g->index++;
    if (g->index == 4u) {
        go(g, BRINGUP_STEP_FAULT_REST);
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

static void step_fault_rest(bringup_guide_t *g, drive_t *d)
{
    if (!cleared(g, d)) {
        return;
    }
    if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        give_up(g, BRINGUP_FAULT_LOW, 0);
    } else if (g->blocked) {
        go(g, BRINGUP_STEP_LAST);
    } else {
        go(g, BRINGUP_STEP_FAULT_INPUT);
    }
}

static void step_fault_input(bringup_guide_t *g, const drive_t *d)
{
    uint16_t button = answered(g, BRINGUP_ASK_FAULT_INPUT, 0, 0);
    if (button == 3u) {
        go(g, BRINGUP_STEP_CURRENT);
    } else if (button == 0u) {
        /* not yet */
    } else if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        go(g, BRINGUP_STEP_FAULT_OPEN);
    } else {
        give_up(g, BRINGUP_FAULT_DEAD, 0);
    }
}

static void step_fault_open(bringup_guide_t *g, drive_t *d)
{
    if (g->phase == 0u && answered(g, BRINGUP_ASK_FAULT_OPEN, 0, 0) == 0u) {
        return;
    }
    if (!cleared(g, d)) {
        return;
    }
    if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        give_up(g, BRINGUP_FAULT_LOW, 0);
    } else {
        go(g, BRINGUP_STEP_CURRENT);
    }
}

/* ---- Six directions ---- */

static void step_current(bringup_guide_t *g, const drive_t *d)
{
    uint16_t button = answered(g, BRINGUP_ASK_CURRENT, 0, 0);
    if (button == 0u) {
        return;
    }
    go(g, (button == 2u) ? BRINGUP_STEP_DRIVE : BRINGUP_STEP_LAST);
    if (d->fault != (uint16_t)FAULT_NONE) {
        give_up(g, BRINGUP_FAULT, 0);
        g->message.value = (int32_t)d->fault;
    }
}

/** A vector at one level. @param phase 2: half of the current, 3: all of it */
static void drive_level(bringup_guide_t *g, drive_t *d, uint16_t phase)
{
    bringup_run_t *t = &d->run.bringup;
    t->stop_q13 = (int16_t)((phase == 2u) ? BRINGUP_FULL_Q13 / 2 : BRINGUP_FULL_Q13);
    t->most = MOST_AMPLITUDE;
    measure(d, (phase == 2u) ? SETTLE_HALF : SETTLE_FULL);
    g->phase = phase;
}

static void keep_level(const bringup_guide_t *g, const drive_t *d, bringup_level_t *level)
{
    static const uint16_t phase_of[BRINGUP_DIRECTIONS] = { 0, 2, 1, 0, 2, 1 };
    const bringup_run_t *t = &d->run.bringup;
    level->a[g->index] = mean_of(t->sum_a);
    level->b[g->index] = mean_of(t->sum_b);
    level->amplitude[g->index] = qm_abs(t->part[phase_of[g->index]]);
}

/** Half the current, all of it, none, in one direction after the other. A press ends it. */
static void step_drive(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    static const angle_t angle_of[BRINGUP_DIRECTIONS] = { 0, 10923, 21845, 32768u, 43691u, 54613u }; /* +A, -C, +B, -A, +C, -B */
    bringup_run_t *t = &d->run.bringup;
    if (g->phase <= 1u && !started(g, d, p)) {
        return;
    }
    if (has_tripped(g, d)) {
        return;
    }
    if (g->button != 0u) {
        go(g, BRINGUP_STEP_LAST);
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
            go(g, BRINGUP_STEP_SHOW);
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

static void step_show(bringup_guide_t *g, const drive_t *d)
{
    uint16_t n = g->index;
    say(g, BRINGUP_SHOWS, n, 0);
    g->message.value = (int32_t)qm_divud(qm_muluu((uint16_t)g->full.amplitude[n], bus_10mv(d)), (uint16_t)PWM_FULL_DUTY);
    g->message.low = bringup_ma(g->full.a[n]);
    g->message.high = bringup_ma(g->full.b[n]);
    g->index++;
    if (g->index == BRINGUP_DIRECTIONS) {
        g->wiring = bringup_wiring(&g->full);
        go(g, BRINGUP_STEP_WIRING);
    }
}

/** Which legs the signals follow. */
static void find_legs(bringup_guide_t *g)
{
    uint16_t a = g->wiring.leg[0], b = g->wiring.leg[1];
    if (a == b || (a != 0u && b != 1u && (a != 1u || b != 0u))) {
        find(g, BRINGUP_CURRENTS_MIXED, 0);
    } else if (a == 1u) {
        find(g, BRINGUP_CURRENTS_SWAPPED, 0);
    } else if (a == 2u || b == 2u) {
        find(g, BRINGUP_DRIVER_SWAPPED, (uint16_t)(a != 2u));
    } else {
        /* each its own */
    }
}

/** The finding of one question to the wiring: number 0 the legs, then three a mask. */
static void find_wiring(bringup_guide_t *g, uint16_t number)
{
    const bringup_wiring_t *w = &g->wiring;
    uint16_t part = (uint16_t)(number % 3u), bit = (uint16_t)(1u << part);
    const uint16_t masks[5] = { w->dead, w->open, w->high, w->low, w->inverted };
    static const bringup_finding_t findings[5] = { BRINGUP_CURRENT_DEAD, BRINGUP_PHASE_OPEN, BRINGUP_HIGH_SIDE, BRINGUP_LOW_SIDE, BRINGUP_SHUNT_INVERTED };
    if ((masks[number / 3u] & bit) != 0u) {
        find(g, findings[number / 3u], part);
    }
}

static void step_wiring(bringup_guide_t *g)
{
    const bringup_wiring_t *w = &g->wiring;
    uint16_t bad = (uint16_t)(w->dead | w->open | w->high | w->low);
    if (w->open == 7u) {
        give_up(g, BRINGUP_NO_CURRENT, 0);
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
    go(g, (bad == 0u && w->leg[0] != w->leg[1]) ? BRINGUP_STEP_BRIDGE : BRINGUP_STEP_LAST);
}

/* ---- Gains, resistance, dead time ---- */

static void step_bridge(bringup_guide_t *g, const drive_t *d)
{
    const bringup_bridge_t *r = &g->bridge;
    uint16_t n = g->index;
    g->index++;
    switch (n) {
    case 0:
        g->bridge = bringup_bridge(&g->half, &g->full, &g->wiring, bus_10mv(d));
        (void)tell(g, BRINGUP_VALUE_RATIO, 0, (int32_t)r->b_percent_of_a, (int32_t)RATIO_LEAST, (int32_t)RATIO_MOST);
        break;
    case 1:
        (void)tell(g, BRINGUP_VALUE_RESISTANCE, 0, (int32_t)r->resistance_mohm, R_MOHM(PARAM_R_LEAST), R_MOHM(PARAM_R_MOST) + R_BRIDGE_MOHM);
        break;
    default:
        tell_or_find(g, BRINGUP_VALUE_DEAD_TIME, 0, (int32_t)r->dead_time_ns, DEAD_LEAST_NS, DEAD_MOST_NS, BRINGUP_DEAD_TIME);
        go(g, BRINGUP_STEP_AMMETER);
        break;
    }
}

/** All of the current along phase A. @return 1 when it flows */
static uint16_t holds_a(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    bringup_run_t *t = &d->run.bringup;
    if (g->phase <= 1u) {
        if (!started(g, d, p)) {
            return 0;
        }
        t->stop_q13 = BRINGUP_FULL_Q13;
        t->most = g->full.amplitude[0];
        measure(d, SETTLE_HALF);
        g->phase = 2;
    }
    return t->ready;
}

static void step_ammeter(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    uint16_t button, ready = holds_a(g, d, p);
    if (g->phase == 2u && has_tripped(g, d)) {
        return;
    }
    if (!ready) {
        return;
    }
    if (g->wiring.leg[0] != 0u || g->wiring.leg[1] != 1u) {
        go(g, BRINGUP_STEP_DIRECTION); /* which wire the signal is in is open */
        return;
    }
    button = answered(g, BRINGUP_ASK_AMMETER, 0, bringup_ma(qm_abs(mean_of(d->run.bringup.sum_a))));
    if (button != 0u) {
        g->yes = (uint16_t)(button == 2u);
        go(g, BRINGUP_STEP_GAINS);
    }
}

/** What the ammeter and both resistances say of the gains. */
static void step_gains(bringup_guide_t *g)
{
    int32_t by_a = (int32_t)g->bridge.resistance_mohm;
    uint16_t alike = (uint16_t)(g->bridge.b_percent_of_a >= RATIO_LEAST && g->bridge.b_percent_of_a <= RATIO_MOST);
    if (!g->yes && alike) {
        find(g, BRINGUP_SHUNT_GAINS, 0);
    } else if (!g->yes || !alike) {
        find(g, BRINGUP_SHUNT_GAIN, g->yes); /* A's, or where A's is right B's */
    } else if (by_a < R_MOHM(PARAM_R_LEAST) || by_a > R_MOHM(PARAM_R_MOST) + R_BRIDGE_MOHM) {
        find(g, BRINGUP_RESISTANCE, 0);
    } else {
        /* right */
    }
    go(g, BRINGUP_STEP_DIRECTION);
}

/* ---- Turning ---- */

static void step_direction(bringup_guide_t *g, drive_t *d)
{
    uint16_t button;
    if (has_tripped(g, d)) {
        return;
    }
    d->run.bringup.most = MOST_AMPLITUDE;
    d->run.bringup.keeps_current = 1;
    d->run.bringup.turning = 1;
    button = answered(g, BRINGUP_ASK_DIRECTION, 0, 0);
    if (button == 3u) {
        find(g, BRINGUP_DIRECTION, 0);
    }
    if (button != 0u) {
        d->run.bringup.turning = 0; /* at the end of this turn */
        go(g, BRINGUP_STEP_MARK);
    }
}

static void step_mark(bringup_guide_t *g, drive_t *d)
{
    if (has_tripped(g, d) || answered(g, BRINGUP_ASK_MARK, 0, 0) == 0u) {
        return;
    }
    d->run.bringup.turns = 0;
    d->run.bringup.turning = 1;
    go(g, BRINGUP_STEP_TURNS);
}

static void step_turns(bringup_guide_t *g, drive_t *d)
{
    uint16_t button;
    if (has_tripped(g, d)) {
        return;
    }
    button = answered(g, BRINGUP_ASK_TURNS, 0, 0);
    if (button == 3u) {
        find(g, BRINGUP_STANDS, 0);
    } else if (button == 2u) {
        tell_or_find(g, BRINGUP_VALUE_POLE_PAIRS, 0, (int32_t)d->run.bringup.turns, NOPOLESPAIRS, NOPOLESPAIRS, BRINGUP_POLE_PAIRS);
    } else {
        return;
    }
    go(g, BRINGUP_STEP_LAST);
}

static void step_last(bringup_guide_t *g, drive_t *d)
{
    d->command.run = 0;
    say(g, BRINGUP_ENDS, 0, 0);
    g->message.value = (int32_t)g->found;
    go(g, BRINGUP_STEP_END);
}

/* ---- A pass ---- */

void bringup_init(bringup_guide_t *g)
{
    g->message.kind = (uint16_t)BRINGUP_SILENT;
    g->found = 0;
    g->blocked = 0;
    g->s2.down_ms = 0;
    g->s3.down_ms = 0;
    g->swapped = 0;
    g->leds = 0;
    g->leds_judged = 0;
    g->mean[0] = 0;
    g->mean[1] = 0;
    g->pending = (uint16_t)BRINGUP_FINDINGS;
    g->sender = 1;
    go(g, BRINGUP_STEP_BEGIN);
}

/** The steps that let current flow, and those after them. */
static void step_with_current(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    switch (g->step) {
    case BRINGUP_STEP_DRIVE: step_drive(g, d, p); break;
    case BRINGUP_STEP_SHOW: step_show(g, d); break;
    case BRINGUP_STEP_WIRING: step_wiring(g); break;
    case BRINGUP_STEP_BRIDGE: step_bridge(g, d); break;
    case BRINGUP_STEP_AMMETER: step_ammeter(g, d, p); break;
    case BRINGUP_STEP_GAINS: step_gains(g); break;
    case BRINGUP_STEP_DIRECTION: step_direction(g, d); break;
    case BRINGUP_STEP_MARK: step_mark(g, d); break;
    case BRINGUP_STEP_TURNS: step_turns(g, d); break;
    case BRINGUP_STEP_LAST: step_last(g, d); break;
    default: /* END: S2 begins anew */
        if (g->button == 2u) {
            bringup_init(g);
        }
        break;
    }
}

static void take_step(bringup_guide_t *g, drive_t *d, const drive_params_t *p, const panel_inputs_t *in, int16_t pot_q15)
{
    switch (g->step) {
    case BRINGUP_STEP_BEGIN: step_begin(g, in); break;
    case BRINGUP_STEP_S3: step_s3(g); break;
    case BRINGUP_STEP_UART: step_uart(g); break;
    case BRINGUP_STEP_LED_ALIVE: step_led(g, 0); break;
    case BRINGUP_STEP_LED_ALIVE_OTHER: step_led_other(g, 0); break;
    case BRINGUP_STEP_LED_RUN: step_led(g, 1); break;
    case BRINGUP_STEP_LED_RUN_OTHER: step_led_other(g, 1); break;
    case BRINGUP_STEP_POT_LEFT: step_pot_end(g, pot_q15, 0); break;
    case BRINGUP_STEP_POT_RIGHT: step_pot_end(g, pot_q15, 1); break;
    case BRINGUP_STEP_POT: step_pot(g); break;
    case BRINGUP_STEP_BUS: step_bus(g, d); break;
    case BRINGUP_STEP_OFFSETS: step_rest(g, d, 0); break;
    case BRINGUP_STEP_NOISES: step_rest(g, d, 1); break;
    case BRINGUP_STEP_SIGNALS: step_signals(g, d, p); break;
    case BRINGUP_STEP_FAULT_REST: step_fault_rest(g, d); break;
    case BRINGUP_STEP_FAULT_INPUT: step_fault_input(g, d); break;
    case BRINGUP_STEP_FAULT_OPEN: step_fault_open(g, d); break;
    case BRINGUP_STEP_CURRENT: step_current(g, d); break;
    default: step_with_current(g, d, p); break;
    }
}

/** The button that has been pressed, by the name on it. */
static void read_buttons(bringup_guide_t *g, const panel_inputs_t *in)
{
    uint16_t s2 = button_pressed(&g->s2, in->s2_down, in->elapsed_ms), s3 = button_pressed(&g->s3, in->s3_down, in->elapsed_ms);
    if (s2 || s3) {
        g->button = (uint16_t)((s2 != g->swapped) ? 2u : 3u);
    }
}

panel_lights_t bringup_pass(bringup_guide_t *g, drive_t *d, const drive_params_t *p, const panel_inputs_t *in, int16_t pot_q15)
{
    panel_lights_t lights;
    read_buttons(g, in);
    g->waited_ms = (uint16_t)((g->waited_ms > UINT16_MAX - in->elapsed_ms) ? UINT16_MAX : g->waited_ms + in->elapsed_ms);
    if (drive_is_running(d) && g->asked && g->waited_ms >= CURRENT_MS) {
        go(g, BRINGUP_STEP_LAST);
    }
    if (g->message.kind != (uint16_t)BRINGUP_SILENT) {
        /* it is still being said */
    } else if (g->pending != (uint16_t)BRINGUP_FINDINGS) {
        bringup_finding_t finding = (bringup_finding_t)g->pending;
        g->pending = (uint16_t)BRINGUP_FINDINGS;
        find(g, finding, g->pending_part);
    } else {
        take_step(g, d, p, in, pot_q15);
    }
    lights.led_alive = g->leds & 1u;
    lights.led_run = (uint16_t)(g->leds >> 1);
    return lights;
}

#endif
