/* BRINGUP, what the currents say: which signal follows which leg and with which sign, what is open or dead, resistance and dead time. */
#include "drive/modes/bringup_judge.h"

#ifdef BRINGUP

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
    int32_t ma = qm_mulsu(i_q13, MA_PER_COUNT) >> MA_SHIFT;
    return (int16_t)((ma > INT16_MAX) ? INT16_MAX : (ma < INT16_MIN) ? INT16_MIN
                                                                     : ma);
}

/** A signal's answer to a phase: half the difference of its two directions. */
static int16_t answer(const current_q13_t *signal, uint16_t phase)
{
    return (int16_t)((signal[plus[phase]] - signal[minus[phase]]) / 2);
}

/** The leg that a signal follows: its answer has the other sign than those to the other two phases. Where one of them says nothing, the
 *  expected leg. */
static uint16_t leg_of(const current_q13_t *signal, uint16_t expected)
{
    uint16_t phase, positive = 0, negative = 0;
    for (phase = 0; phase < PHASES; phase++) {
        int16_t size = answer(signal, phase);
        positive |= (uint16_t)((size >= BRINGUP_LEAST_Q13) ? 1u << phase : 0u);
        negative |= (uint16_t)((size <= -BRINGUP_LEAST_Q13) ? 1u << phase : 0u);
    }
    if ((positive | negative) != 7u || positive == 0u || negative == 0u) {
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
        } else {
            /* both ways */
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
