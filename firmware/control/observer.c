/* The load observer: from the speed that the estimator sees and the q current, the rotor's speed and the load on it. */
#include "control/observer.h"

#include "control/tuned.h"

INLINE speed_erpm_t observer_speed(const observer_t *o)
{
    return qm_hi(o->omega_q16);
}

int32_t observer_load_q26(const observer_t *o, const observer_params_t *p)
{
    return qm_mulsu(qm_hi_rounded(o->load_q16), p->per_unit_q15) >> 2;
}

current_q13_t observer_load(const observer_t *o, const observer_params_t *p)
{
    int32_t load_q28 = qm_mulsu(qm_hi_rounded(o->load_q16), p->per_unit_q15);
    return (int16_t)(2 * qm_hi(load_q28) + (int16_t)((((uint16_t)load_q28 >> 14) + 1u) >> 1)); /* rounded to Q13 */
}

/** Nonzero while something changes fast: the innovation has been large in the last 50 ms or so. */
static INLINE uint16_t observer_gate_is_open(const observer_t *o)
{
    return (uint16_t)((uint16_t)o->fast_share_q15 >> OBSERVER_GATE_OPEN_SHIFT);
}

INLINE uint16_t observer_gate_is_closed(const observer_t *o)
{
    return (uint16_t)(observer_gate_is_open(o) == 0u);
}

INLINE int16_t observer_between(int16_t a, int16_t b, q15_t share)
{
    return (int16_t)(a + qm_mulhi_su((int16_t)(b - a), (uint16_t)(2u * (uint16_t)share)));
}

INLINE q15_t observer_twice(q15_t share)
{
    return (int16_t)((share < 16384) ? 2 * share : 32767);
}

#define OBSERVER_FASTEST 32700

int32_t observer_sum(int32_t omega_q16, int32_t change)
{
    const int32_t fastest_q16 = (int32_t)OBSERVER_FASTEST * 65536;
    if (change >= 0) {
        return (omega_q16 > fastest_q16 - change) ? fastest_q16 : omega_q16 + change;
    }
    return (omega_q16 < -fastest_q16 - change) ? -fastest_q16 : omega_q16 + change;
}

void observer_preset(observer_t *o, const observer_params_t *p, uint32_t rho_q32, speed_erpm_t speed_erpm, current_q13_t iq_q13)
{
    o->rho_q32 = rho_q32;
    o->omega_q16 = (int32_t)speed_erpm * 65536;
    o->load_q16 = (int32_t)qm_mulhi_su(iq_q13, p->per_current_q16) * 65536;
    o->fast_share_q15 = 0;
    o->gate_level = OBSERVER_GATE_AT_START;
}

int16_t observer_gate(int16_t calm_erpm, uint16_t gate_level)
{
    const uint32_t large = qm_muluu((uint16_t)calm_erpm, (uint16_t)(gate_level + (1u << OBSERVER_GATE_SHIFT))) >> OBSERVER_GATE_SHIFT;
    return (int16_t)((large > 32767u) ? 32767u : large);
}

void observer_raise_gate(observer_t *o)
{
    if (o->gate_level < OBSERVER_GATE_AT_START) {
        o->gate_level = OBSERVER_GATE_AT_START;
    }
}

/** How much of a load there is: 0 as without any, 1 where it and the current that flows for it are clear of what dead time leaves. A load
 *  that only slows the rotor down takes no current. @param iq_q13 q current asked for, above -32768 */
static q15_t observer_loaded(const observer_t *o, const observer_params_t *p, current_q13_t iq_q13)
{
    int16_t held = qm_abs(qm_hi(o->load_q16)), flows = qm_abs(qm_mulhi_su(iq_q13, p->per_current_q16));
    int16_t load = (int16_t)(((held < flows) ? held : flows) - p->load_from);
    return (int16_t)(qm_clamp(load, 0, p->load_width) * p->load_slope_q15);
}

void observer_schedule(observer_t *o, const observer_params_t *p, speed_erpm_t speed, current_q13_t iq_q13)
{
    int16_t rate, wrong = (int16_t)(p->gate_erpm + (speed >> OBSERVER_GATE_SPEED_SHIFT));
    q15_t loaded = observer_loaded(o, p, iq_q13), share = 32767;
    if (speed < p->full_erpm) {
        share = qm_share((uint16_t)speed, (uint16_t)p->full_erpm);
    }
    rate = observer_between(0, p->quiet_q16, share);
    /* under load the back-EMF is clean, and half the speed is enough */
    share = observer_between(share, observer_twice(share), loaded);
    o->share_q15 = share;
    rate = observer_between(rate, observer_between(0, p->loaded_q16, share), loaded);
    o->rate_q16 = observer_between(rate, observer_between(0, p->fast_q16, share), o->fast_share_q15);
    /* without load dead time may make a light rotor hunt for long: twice as much is not wrong then */
    wrong = (int16_t)((wrong > 16383) ? 16383 : wrong);
    o->wrong_erpm = observer_between((int16_t)(2 * wrong), wrong, loaded);
    o->gate_erpm = observer_gate((int16_t)(observer_between(p->gate_erpm, p->gate_loaded_erpm, loaded) + (speed >> OBSERVER_GATE_SPEED_SHIFT)), o->gate_level);
}

QM_WRAPS int16_t observer_innovation(observer_t *o, const observer_params_t *p, uint32_t rho_q32, speed_erpm_t omega_erpm)
{
    uint32_t turned = qm_turn_sub(rho_q32, o->rho_q32), expected = (uint32_t)qm_mulss(omega_erpm, p->deltat_q32);
    /* rounded: a count of `more` is 2 electrical rpm, so that half of one would be an offset of the speed */
    int16_t more = qm_clamp(qm_hi((int32_t)qm_turn_add(qm_turn_sub(turned, 8u * expected), 32768u)), -8192, 8191);
    o->rho_q32 = rho_q32;
    return qm_limit((int16_t)((qm_mulss(more, p->per_turn_q12) + 2048) >> 12), p->innovation_max_erpm);
}

int32_t observer_load_step(const observer_params_t *p, int16_t innovation, int16_t rate_q16)
{
    int32_t square_q32 = qm_mulss(rate_q16, rate_q16);
    return qm_shift(qm_mulss(innovation, qm_hi(square_q32)), p->shift) + (qm_mulsu(innovation, (uint16_t)square_q32) >> (16u - p->shift));
}

void observer_answer(observer_t *o, int16_t innovation)
{
    const uint16_t stirred = observer_gate_is_open(o);
    uint16_t unrest = o->gate_level;
    q15_t level = 0;
    if (stirred) {
        unrest = (uint16_t)((unrest < 4u * OBSERVER_GATE_STEPS) ? unrest + 4u : unrest);
    } else if (unrest != 0u) {
        unrest--;
    } else { /* calm for long */
    }
    if (qm_beyond(innovation, o->gate_erpm) && (!stirred || unrest < OBSERVER_GATE_STEPS)) {
        if (stirred && (innovation ^ o->gate_last_erpm) < 0) {
            unrest = OBSERVER_GATE_STEPS;
        }
        o->gate_last_erpm = innovation;
        level = (int16_t)((qm_abs(innovation) - (o->gate_erpm >> 1) > o->gate_erpm) ? 32767 : OBSERVER_FAST_HALF_Q15);
    }
    o->gate_level = unrest;
    o->fast_share_q15 = (int16_t)(o->fast_share_q15 - (o->fast_share_q15 >> OBSERVER_FAST_FADE_SHIFT));
    if (o->fast_share_q15 < level) {
        o->fast_share_q15 = level;
    }
}

void observer_step(observer_t *o, const observer_params_t *p, uint32_t rho_q32, current_q13_t iq_q13)
{
    int16_t innovation;
    int32_t before_q16 = o->omega_q16;
    o->omega_q16 = observer_sum(o->omega_q16, (qm_mulsu(iq_q13, p->per_current_q16) - o->load_q16) >> p->shift);
    innovation = observer_innovation(o, p, rho_q32, qm_hi((before_q16 >> 1) + (o->omega_q16 >> 1)));
    o->innovation_erpm = innovation;
    o->omega_q16 = observer_sum(o->omega_q16, 2 * qm_mulss(innovation, o->rate_q16));
    o->load_q16 = qm_clamp_hi(o->load_q16 - observer_load_step(p, innovation, o->rate_q16), (int16_t)-p->load_max, p->load_max);
    if (qm_beyond(innovation, o->wrong_erpm)) {
        o->wrong_steps++;
    } else if (o->wrong_steps != 0u) {
        o->wrong_steps--;
    } else { /* right for long */
    }
    observer_answer(o, innovation);
}
