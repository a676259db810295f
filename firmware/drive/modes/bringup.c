/* BRINGUP: the first day with a board. */
#include "drive/modes/bringup.h"

#include "drive/drive.h"

#ifdef BRINGUP
#define BRINGUP_FILTER_SHIFT 5                   /* 1.6 ms: four counts of the amplitude */
#define BRINGUP_STEP_MASK 7u                     /* the amplitude changes by a count every eighth period */
#define BRINGUP_TURN_PERIODS PARAM_PERIODS(0.4F) /* of an electrical turn, and of the pause after it */
#define BRINGUP_TURN_Q32 ((uint32_t)(4294967295.0F / PARAM_F(BRINGUP_TURN_PERIODS)))

void bringup_add(drive_t *d, uint16_t settled)
{
    bringup_run_t *t = &d->run.bringup;
    if (t->ready || t->left == 0u || !settled) {
        return;
    }
    if (t->wait != 0u) {
        t->wait--;
        return;
    }
    t->sum_a += d->phases_q13.a;
    t->sum_b += d->phases_q13.b;
    t->off_a += qm_abs((int16_t)(d->phases_q13.a - t->mean_a_q13));
    t->off_b += qm_abs((int16_t)(d->phases_q13.b - t->mean_b_q13));
    t->left--;
    t->ready = (uint16_t)(t->left == 0u);
}

int16_t bringup_direction(bringup_run_t *t, int16_t carried_q13)
{
    if (t->keeps_current) {
        return (int16_t)((carried_q13 < t->stop_q13 && t->amplitude < t->most) ? 1 : (t->amplitude > 0) ? -1
                                                                                                        : 0);
    }
    if (t->amplitude < t->most && carried_q13 >= t->stop_q13) {
        t->most = t->amplitude;
    } else if (t->amplitude > 0 && t->most == t->amplitude && carried_q13 > t->stop_q13 + (t->stop_q13 >> 1)) {
        t->most = (int16_t)(t->amplitude - 1); /* it has grown by itself */
    } else {
        /* on its way, or there */
    }
    return (int16_t)((t->amplitude < t->most) ? 1 : (t->amplitude > t->most) ? -1
                                                                             : 0);
}

/** A count towards the amplitude that is asked for. @return 1 when it stands, or follows the current */
static uint16_t bringup_step_amplitude(drive_t *d)
{
    bringup_run_t *t = &d->run.bringup;
    int16_t direction = bringup_direction(t, (int16_t)(t->carried_q21 >> 8));
    t->carried_q21 += ((int32_t)(qm_abs(d->phases_q13.a) + qm_abs(d->phases_q13.b)) * 256 - t->carried_q21) >> BRINGUP_FILTER_SHIFT;
    if ((d->ticks & BRINGUP_STEP_MASK) == 0u) {
        t->amplitude = (int16_t)(t->amplitude + direction);
    }
    return (uint16_t)(direction == 0 || t->keeps_current);
}

void bringup_turn(bringup_run_t *t)
{
    uint32_t before = t->turn_q32;
    if (!t->turning && before == 0u) { /* a turn that has begun goes on to its end */
        return;
    }
    if (t->pause != 0u) {
        t->pause--;
        return;
    }
    t->turn_q32 = qm_turn_add(before, BRINGUP_TURN_Q32);
    if (t->turn_q32 < before) { /* it has come round */
        t->turn_q32 = 0;
        t->turns++;
        t->pause = BRINGUP_TURN_PERIODS;
    }
    t->angle = (angle_t)(t->turn_q32 >> 16);
}

void bringup_run(drive_t *d, const drive_params_t *p UNUSED, duties_t *duty)
{
    bringup_run_t *t = &d->run.bringup;
    uint16_t settled = bringup_step_amplitude(d);
    dq_t vector;
    phases_t part;
    if (settled) {
        bringup_turn(t);
    }
    bringup_add(d, settled);
    vector.d = t->amplitude;
    vector.q = 0;
    part = phases_of(vector, trig_sincos(t->angle));
    t->part[0] = part.a;
    t->part[1] = part.b;
    t->part[2] = part.c;
    duty->a = (duty_t)(BRINGUP_HALF_DUTY + part.a);
    duty->b = (duty_t)(BRINGUP_HALF_DUTY + part.b);
    duty->c = (duty_t)(BRINGUP_HALF_DUTY + part.c);
    if (!d->command.run) {
        drive_enter(d, DRIVE_STOPPED);
    }
}

void bringup_start(drive_t *d, const drive_params_t *p UNUSED)
{
    d->run.bringup.ready = 1;
}
#endif

void mode_idle(drive_t *d UNUSED)
{
#ifdef BRINGUP
    bringup_add(d, 1);
#endif
}

/* ---- BRINGUP, the background's part: what it knows of the board so far, and what it says next ---- */

#ifdef BRINGUP
void bringup_say(bringup_guide_t *g, bringup_kind_t kind, uint16_t code, uint16_t part)
{
    g->message.kind = (uint16_t)kind;
    g->message.code = code;
    g->message.part = part;
}

void bringup_go(bringup_guide_t *g, bringup_step_t step)
{
    g->step = (uint16_t)step;
    g->index = 0;
    g->phase = 0;
    g->asked = 0;
    g->button = 0;
    g->waited_ms = 0;
}

void bringup_find(bringup_guide_t *g, bringup_finding_t finding, uint16_t part)
{
    g->found++;
    bringup_say(g, BRINGUP_FINDS, (uint16_t)finding, part);
}

void bringup_give_up(bringup_guide_t *g, bringup_finding_t finding, uint16_t part)
{
    bringup_find(g, finding, part);
    bringup_go(g, BRINGUP_STEP_LAST);
}

uint16_t bringup_tell(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high)
{
    bringup_say(g, BRINGUP_TELLS, (uint16_t)what, part);
    g->message.value = value;
    g->message.low = low;
    g->message.high = high;
    return (uint16_t)(value >= low && value <= high);
}

void bringup_tell_or_find(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high, bringup_finding_t finding)
{
    if (!bringup_tell(g, what, part, value, low, high)) {
        g->pending = (uint16_t)finding;
        g->pending_part = part;
    }
}

uint16_t bringup_answered(bringup_guide_t *g, bringup_question_t question, uint16_t part, int32_t value)
{
    uint16_t button = g->button;
    if (!g->asked) {
        bringup_say(g, BRINGUP_ASKS, (uint16_t)question, part);
        g->message.value = value;
        g->asked = 1;
        button = 0;
    } else if (button != 0u) {
        g->asked = 0;
        g->waited_ms = 0;
    } else { /* the user thinks */
    }
    g->button = 0;
    return button;
}

#define START_MS 100u /* a start charges the drivers first */
#define SUM_LOG2 10u
#define SUM_PERIODS 1024u

void bringup_measure(drive_t *d, uint16_t wait)
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

int16_t bringup_mean_of(int32_t sum)
{
    return (int16_t)(sum >> SUM_LOG2);
}

uint16_t bringup_started(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    if (g->phase == 0u) {
        drive_start(d, p, 1);
        g->waited_ms = 0;
        g->phase = 1;
    }
    return (uint16_t)(drive_is_running(d) || g->waited_ms >= START_MS);
}

uint16_t bringup_has_tripped(bringup_guide_t *g, const drive_t *d)
{
    bringup_finding_t finding = BRINGUP_FAULT;
    if (drive_is_running(d)) {
        return 0;
    }
    if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        finding = BRINGUP_SHORT_CIRCUIT;
    } else if (d->fault == (uint16_t)FAULT_OVERCURRENT_SW) {
        finding = BRINGUP_OVERCURRENT;
    } else { /* another one */
    }
    bringup_give_up(g, finding, 0);
    g->message.value = (int32_t)d->fault;
    return 1;
}

uint16_t bringup_bus_10mv(const drive_t *d)
{
    return (uint16_t)((uint32_t)qm_muluu((uint16_t)((uint32_t)d->bus_q31 >> 16), (uint16_t)BRINGUP_10MV(BUS_FULL_SCALE_V)) >> 15);
}

#define CURRENT_MS 60000u /* patience while current flows */

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
    bringup_go(g, BRINGUP_STEP_BEGIN);
}

#define BRINGUP_STEP_CALL(name, call) \
    case BRINGUP_STEP_##name: (call); break;

static void take_step(bringup_guide_t *g, drive_t *d, const drive_params_t *p, const buttons_t *in, int16_t pot_q15)
{
    switch (g->step) {
        BRINGUP_STEP_TABLE(BRINGUP_STEP_CALL)
    default: break; /* there is no other */
    }
}

/** The button that has been pressed, by the name on it. */
static void read_buttons(bringup_guide_t *g, const buttons_t *in)
{
    uint16_t s2 = button_pressed(&g->s2, in->s2_down, in->elapsed_ms), s3 = button_pressed(&g->s3, in->s3_down, in->elapsed_ms);
    if (s2 || s3) {
        g->button = (uint16_t)((s2 != g->swapped) ? 2u : 3u);
    }
}

lights_t bringup_pass(bringup_guide_t *g, drive_t *d, const drive_params_t *p, const buttons_t *in, int16_t pot_q15)
{
    lights_t lights;
    read_buttons(g, in);
    g->waited_ms = (uint16_t)((g->waited_ms > UINT16_MAX - in->elapsed_ms) ? UINT16_MAX : g->waited_ms + in->elapsed_ms);
    if (drive_is_running(d) && g->asked && g->waited_ms >= CURRENT_MS) {
        bringup_go(g, BRINGUP_STEP_LAST);
    }
    if (g->message.kind != (uint16_t)BRINGUP_SILENT) {
        /* it is still being said */
    } else if (g->pending != (uint16_t)BRINGUP_FINDINGS) {
        bringup_finding_t finding = (bringup_finding_t)g->pending;
        g->pending = (uint16_t)BRINGUP_FINDINGS;
        bringup_find(g, finding, g->pending_part);
    } else {
        take_step(g, d, p, in, pot_q15);
    }
    lights.led_alive = g->leds & 1u;
    lights.led_run = (uint16_t)(g->leds >> 1);
    return lights;
}
#endif

/* ---- BRINGUP: what currents in six directions say: which signal follows which leg, what is open or dead, resistance and dead time ---- */

#ifdef BRINGUP
#define BRINGUP_LEAST_Q13 (BRINGUP_FULL_Q13 / 8) /* less is no current */
#define PHASES 3u
#define MISSING_SHIFT 2 /* less than a quarter of the current in the other direction */
#define MA_SHIFT 12u    /* up to 16 mA a count: the build refuses more */
#define MA_PER_COUNT ((uint16_t)(4000.0F * PARAM_F(NORM_CURRENT_CONST) * 4096.0F + 0.5F))

/* Of a duty count, Q8: one leg loses what two others gain, 4/3 along the vector. */
#define DEAD_NS_A_COUNT ((uint16_t)(0.75F * PWM_TICK_SEC * 1000000000.0F * 256.0F + 0.5F))
#define MOST_MOHM 60000u

/* Where the directions +A, -C, +B, -A, +C, -B have a phase's own. */
static const uint16_t plus[PHASES] = { 0, 2, 4 }, minus[PHASES] = { 3, 5, 1 };

int16_t bringup_ma(current_q13_t i_q13)
{
    return qm_within(qm_mulsu(i_q13, MA_PER_COUNT) >> MA_SHIFT, INT16_MIN, INT16_MAX);
}

/** A signal's answer to a phase: half the difference of its two directions. */
static int16_t answer(const current_q13_t *signal, uint16_t phase)
{
    return (int16_t)((signal[plus[phase]] - signal[minus[phase]]) / 2);
}

/** The leg that a signal follows: its answer has the other sign than those to the other two phases. Where one of them says nothing, the expected leg. */
static uint16_t leg_of(const current_q13_t *signal, uint16_t expected)
{
    uint16_t phase, positive = 0, negative = 0;
    for (phase = 0; phase < PHASES; phase++) {
        int16_t size = answer(signal, phase);
        positive |= (uint16_t)((size >= BRINGUP_LEAST_Q13) ? 1u << phase : 0u);
        negative |= (uint16_t)((size <= -BRINGUP_LEAST_Q13) ? 1u << phase : 0u);
    }
    if ((positive | negative) != 7u) {
        return expected;
    }
    for (phase = 0; phase < PHASES; phase++) {
        if (positive == 1u << phase || negative == 1u << phase) {
            return phase;
        }
    }
    return expected;
}

/** Current of a leg in a direction, by the signals that follow two of them. */
static int16_t leg_current(const bringup_level_t *full, const bringup_wiring_t *w, uint16_t leg, uint16_t direction)
{
    int16_t a = (int16_t)((w->inverted & 1u) ? -full->a[direction] : full->a[direction]);
    int16_t b = (int16_t)((w->inverted & 2u) ? -full->b[direction] : full->b[direction]);
    if (leg == w->leg[0]) {
        return a;
    }
    return (int16_t)((leg == w->leg[1]) ? b : -a - b);
}

/** Phases that lack current in both directions or in one. */
static void judge_phases(const bringup_level_t *full, bringup_wiring_t *w)
{
    uint16_t phase;
    for (phase = 0; phase < PHASES; phase++) {
        uint16_t bit = (uint16_t)(1u << phase);
        int16_t away = leg_current(full, w, phase, plus[phase]), back = (int16_t)-leg_current(full, w, phase, minus[phase]);
        int16_t least = BRINGUP_LEAST_Q13;
        if (away < least && back < least) {
            w->open |= bit;
        } else if (away < (back >> MISSING_SHIFT)) {
            w->high |= bit;
        } else if (back < (away >> MISSING_SHIFT)) {
            w->low |= bit;
        } else { /* both ways */
        }
    }
}

/** 1 where a signal does not follow although the other one carries current along its phase: else the phase is open. */
static uint16_t is_dead(const current_q13_t *signal, const current_q13_t *other, uint16_t phase)
{
    return (uint16_t)(qm_abs(answer(signal, phase)) < BRINGUP_LEAST_Q13 && qm_abs(answer(other, phase)) >= BRINGUP_LEAST_Q13);
}

bringup_wiring_t bringup_wiring(const bringup_level_t *full)
{
    bringup_wiring_t w = { 0, { 0, 0 }, 0, 0, 0, 0 };
    w.leg[0] = leg_of(full->a, 0);
    w.leg[1] = leg_of(full->b, 1);
    w.dead = (uint16_t)(is_dead(full->a, full->b, 0) | (uint16_t)(is_dead(full->b, full->a, 1) << 1));
    w.inverted = (uint16_t)((answer(full->a, w.leg[0]) < 0 ? 1u : 0u) | (answer(full->b, w.leg[1]) < 0 ? 2u : 0u));
    if (w.dead == 0u && w.leg[0] != w.leg[1]) {
        judge_phases(full, &w);
    }
    return w;
}

/** numerator / denominator, limited to `most`. */
static uint16_t quotient(uint32_t numerator, uint16_t denominator, uint16_t most)
{
    return (uint16_t)((denominator == 0u || (numerator >> 16) >= denominator) ? most : qm_divud(numerator, denominator));
}

/** Sums over both directions of a signal's leg. */
typedef struct {
    uint16_t half_q13, full_q13;             /**< currents */
    uint16_t half_amplitude, full_amplitude; /**< duty counts */
} both_t;

static both_t both(const bringup_level_t *half, const bringup_level_t *full, uint16_t leg, uint16_t signal)
{
    both_t s;
    const current_q13_t *h = signal ? half->b : half->a, *f = signal ? full->b : full->a;
    uint16_t p = plus[leg], m = minus[leg];
    s.half_q13 = (uint16_t)((uint16_t)qm_abs(h[p]) + (uint16_t)qm_abs(h[m]));
    s.full_q13 = (uint16_t)((uint16_t)qm_abs(f[p]) + (uint16_t)qm_abs(f[m]));
    s.half_amplitude = (uint16_t)(half->amplitude[p] + half->amplitude[m]);
    s.full_amplitude = (uint16_t)(full->amplitude[p] + full->amplitude[m]);
    return s;
}

/** mohm: the amplitude's voltage over the current, from the difference of both levels. */
static uint16_t resistance(const both_t *s, uint16_t bus_10mv)
{
    uint16_t counts = (uint16_t)(s->full_amplitude - s->half_amplitude), ma = 0;
    uint32_t mv;
    if (s->full_q13 > s->half_q13 && s->full_amplitude > s->half_amplitude) {
        ma = (uint16_t)bringup_ma((int16_t)(s->full_q13 - s->half_q13));
    }
    mv = qm_muluu(quotient(qm_muluu(counts, bus_10mv), (uint16_t)PWM_FULL_DUTY, UINT16_MAX), 10u);
    return quotient(((mv < 4290000ul) ? mv : 4290000ul) * 1000ul, ma, MOST_MOHM);
}

/** ns: the amplitude that is left without current. */
static uint16_t dead_time(const both_t *s)
{
    int32_t left = (int32_t)qm_muluu(s->half_amplitude, s->full_q13) - (int32_t)qm_muluu(s->full_amplitude, s->half_q13);
    uint16_t counts = 0;
    if (left > 0 && s->full_q13 > s->half_q13) {
        counts = quotient((uint32_t)left, (uint16_t)(s->full_q13 - s->half_q13), 6000u);
    }
    return (uint16_t)(qm_muluu(counts, DEAD_NS_A_COUNT) >> 9); /* Q8, of two directions */
}

static uint16_t percent(uint16_t part, uint16_t whole)
{
    return quotient(qm_muluu(part, 100u), whole, 999u);
}

bringup_bridge_t bringup_bridge(const bringup_level_t *half, const bringup_level_t *full, const bringup_wiring_t *w, uint16_t bus_10mv)
{
    bringup_bridge_t r;
    both_t a = both(half, full, w->leg[0], 0), b = both(half, full, w->leg[1], 1);
    uint16_t third = (uint16_t)(PHASES - w->leg[0] - w->leg[1]);
    r.resistance_mohm = resistance(&a, bus_10mv);
    r.b_percent_of_a = percent((uint16_t)qm_abs(answer(full->b, third)), (uint16_t)qm_abs(answer(full->a, third)));
    r.dead_time_ns = (uint16_t)((dead_time(&a) >> 1) + (dead_time(&b) >> 1));
    return r;
}
#endif
