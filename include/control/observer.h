/* The load observer: from the speed that the estimator sees and the q current, the rotor's speed and the load on it.
 *
 * The shaft obeys J dw/dt = Kt (i_q - i_load). The observer runs this model beside the motor and corrects it by what the estimated
 * speed w^ says, with both poles at the rate r:
 *
 *     dw/dt = Kt/J (i_q - i_load) + 2 r (w^ - w),    d i_load/dt = -r^2 J/Kt (w^ - w)
 *
 * i_load goes to the controller as it is, so the loop is stiff without waiting for an integral. The rate follows what is known: slow
 * without load, where dead time disturbs the back-EMF most; quicker under load; quickest for a while after a large innovation
 * w^ - w; and all in proportion to the speed at low speed, for the estimator's own lock is as quick as the rotor turns. What counts as
 * large grows while large ones go on, and one that turns back ends the answer: a step of the load stands out from the calm before it and
 * has one direction, the loop's own swing does not. */
#ifndef CONTROL_OBSERVER_H
#define CONTROL_OBSERVER_H

#include "control/qmath.h"

#define OBSERVER_UNREST_STEPS 1000 /**< a load step is over in a tenth of a second; what goes on longer is the loop's own */
#define OBSERVER_UNREST_SHIFT 8    /**< after 256 / 4 steps that were not calm, a large innovation is twice as large */
#define OBSERVER_START_UNREST 768  /**< at the hand-over it is four times as large: d current and wrong constants shake the estimate */
#define OBSERVER_HALF_Q15 12288    /**< so quick up to one and a half of what is large: dead time may be behind it */
#define OBSERVER_CALM_SHIFT 6      /**< after a large innovation the quick rate fades by 1/64 a step */

/** Constants; `erpm` stands for counts of speed_erpm_t. A step is a slow one, eight periods. Accelerations have a unit of their own, erpm per
 *  step / 2^shift, chosen so that a count of current gives 1/2 to 1 of it. */
typedef struct {
    int16_t deltat_q32;                       /**< angle in an eighth of a step and erpm: per period, see estimator_params_t */
    int16_t per_turn_q12;                     /**< speed that turns 2^16 counts of the angle's 2^32 further in a step, erpm * 4096 */
    uint16_t shift;                           /**< 0..15 */
    uint16_t per_current_q16;                 /**< units a count of q current, 32768..65535 */
    uint16_t per_unit_q15;                    /**< counts of q current a unit: 2^31 / per_current_q16 */
    int16_t innovation_max_erpm;              /**< |w^ - w| counts up to here, erpm: keeps a step of the load in its word */
    int16_t load_max;                         /**< largest |load|, units */
    int16_t quiet_q16, loaded_q16, quick_q16; /**< rate * step: without load, under load, after a large innovation */
    speed_erpm_t full_erpm;                   /**< speed reference from which the rates are these; below in proportion */
    int16_t load_from, load_width;            /**< the load that begins to count, and over what more it counts, units */
    int16_t load_slope_q15;                   /**< 32767 / load_width */
    int16_t large_erpm, large_loaded_erpm;    /**< what a large innovation is: without and under load, and 1/32 of the speed more */
} observer_params_t;

/** State. */
typedef struct {
    int32_t omega_q16;       /**< speed, erpm with 16 fraction bits */
    int32_t load_q16;        /**< acceleration that the load takes, units with 16 fraction bits */
    uint32_t rho_q32;        /**< the estimator's angle a step ago */
    int16_t rate_q16;        /**< rate * step in use */
    int16_t wrong_erpm;      /**< larger innovations are not dead time's; twice as much without load, when it disturbs most */
    int16_t large_erpm;      /**< a large innovation begins here */
    q15_t quick_q15;         /**< 1 = a large innovation was just seen */
    uint16_t wrong_steps;    /**< steps with an innovation above wrong_erpm, less those without */
    int16_t large_last_erpm; /**< the last large innovation */
    uint16_t unrest_steps;   /**< four for each step that was not calm, less one for each that was */
    q15_t share_q15;         /**< of the full rates, by the speed */
} observer_t;

/** Speed, electrical rpm. */
QM_INLINE speed_erpm_t observer_speed(const observer_t *o)
{
    return qm_hi(o->omega_q16);
}

/** The q current that holds the load, with 13 fraction bits. */
QM_INLINE int32_t observer_load_q26(const observer_t *o, const observer_params_t *p)
{
    return qm_mulsu(qm_hi_rounded(o->load_q16), p->per_unit_q15) >> 2;
}

/** The same in whole counts. */
QM_INLINE current_q13_t observer_load(const observer_t *o, const observer_params_t *p)
{
    int32_t load_q28 = qm_mulsu(qm_hi_rounded(o->load_q16), p->per_unit_q15);
    return (int16_t)(2 * qm_hi(load_q28) + (int16_t)((((uint16_t)load_q28 >> 14) + 1u) >> 1)); /* rounded to Q13 */
}

/** Nonzero while something changes fast: the innovation has been large in the last 50 ms or so. */
QM_INLINE uint16_t observer_is_stirred(const observer_t *o)
{
    return (uint16_t)((uint16_t)o->quick_q15 >> 12);
}

/** 1 while nothing does. */
QM_INLINE uint16_t observer_is_calm(const observer_t *o)
{
    return (uint16_t)(observer_is_stirred(o) == 0u);
}

/** a + (b - a) * share; b - a fits a word. @param share 0..1 */
QM_INLINE int16_t observer_between(int16_t a, int16_t b, q15_t share)
{
    return (int16_t)(a + qm_mulhi_su((int16_t)(b - a), (uint16_t)(2u * (uint16_t)share)));
}

/** 2 * share, at most 1. @param share 0..1 */
QM_INLINE q15_t observer_twice(q15_t share)
{
    return (int16_t)((share < 16384) ? 2 * share : 32767);
}

#define OBSERVER_FASTEST 32700u

/** The speed and a change of it, within the format. @param change at most 2^30 */
NOINLINE QM_WRAPS int32_t observer_sum(int32_t omega_q16, int32_t change)
{
#ifdef __FRAMAC__ /* what it means */
    const int32_t fastest_q16 = (int32_t)OBSERVER_FASTEST * 65536;
    if (change >= 0) {
        return (omega_q16 > fastest_q16 - change) ? fastest_q16 : omega_q16 + change;
    }
    return (omega_q16 < -fastest_q16 - change) ? -fastest_q16 : omega_q16 + change;
#else
    int16_t half = qm_hi((omega_q16 >> 1) + (change >> 1)); /* its whole tells the end exactly: that is even */
    if ((uint16_t)((uint16_t)half + OBSERVER_FASTEST / 2u) >= OBSERVER_FASTEST) {
        return (int32_t)qm_with_sign((int16_t)OBSERVER_FASTEST, half) * 65536;
    }
    return omega_q16 + change;
#endif
}

/** Begins at a known angle and speed with a known q current, calm. @param speed_erpm at most 32700 */
QM_INLINE void observer_preset(observer_t *o, const observer_params_t *p, uint32_t rho_q32, speed_erpm_t speed_erpm, current_q13_t iq_q13)
{
    o->rho_q32 = rho_q32;
    o->omega_q16 = (int32_t)speed_erpm * 65536;
    o->load_q16 = (int32_t)qm_mulhi_su(iq_q13, p->per_current_q16) * 65536;
    o->quick_q15 = 0;
    o->unrest_steps = OBSERVER_START_UNREST;
}

/** What counts as a large innovation after so much unrest: up to 16 times as much.
 *  @param calm_erpm 0..32767 @param unrest_steps some thousand at most */
QM_INLINE int16_t observer_large(int16_t calm_erpm, uint16_t unrest_steps)
{
    uint32_t large = qm_muluu((uint16_t)calm_erpm, (uint16_t)(unrest_steps + (1u << OBSERVER_UNREST_SHIFT)));
    int16_t limited = 32767;
#ifdef __FRAMAC__ /* what it means */
    if (large < 32768ul << OBSERVER_UNREST_SHIFT) {
#else
    if (((uint16_t)(large >> 16) >> (OBSERVER_UNREST_SHIFT - 1)) == 0u) {
#endif
        limited = (int16_t)(large >> OBSERVER_UNREST_SHIFT);
    }
    return limited;
}

/** As much unrest as at the hand-over, at least. */
QM_INLINE void observer_unsettle(observer_t *o)
{
    if (o->unrest_steps < OBSERVER_START_UNREST) {
        o->unrest_steps = OBSERVER_START_UNREST;
    }
}

/** How much of a load there is: 0 as without any, 1 where it and the current that flows for it are clear of what dead time leaves. A load that
 *  only slows the rotor down takes no current.
 *  @param iq_q13 q current asked for, above -32768 */
QM_INLINE q15_t observer_loaded(const observer_t *o, const observer_params_t *p, current_q13_t iq_q13)
{
    int16_t held = qm_size(qm_hi(o->load_q16)), flows = qm_size(qm_mulhi_su(iq_q13, p->per_current_q16));
    int16_t load = (int16_t)(((held < flows) ? held : flows) - p->load_from);
    return (int16_t)(qm_clamp_called(load, 0, p->load_width) * p->load_slope_q15);
}

/** The rate for the next step. @param speed magnitude of the speed reference @param iq_q13 q current asked for, above -32768 */
QM_INLINE void observer_schedule(observer_t *o, const observer_params_t *p, speed_erpm_t speed, current_q13_t iq_q13)
{
    int16_t rate, wrong = (int16_t)(p->large_erpm + (speed >> 5));
    q15_t loaded = observer_loaded(o, p, iq_q13), share = 32767;

    if (speed < p->full_erpm) {
        share = qm_share((uint16_t)speed, (uint16_t)p->full_erpm);
    }
    rate = observer_between(0, p->quiet_q16, share);
    /* under load the back-EMF is clean, and half the speed is enough */
    share = observer_between(share, observer_twice(share), loaded);
    o->share_q15 = share;
    rate = observer_between(rate, observer_between(0, p->loaded_q16, share), loaded);
    o->rate_q16 = observer_between(rate, observer_between(0, p->quick_q16, share), o->quick_q15);
    /* without load dead time may make a light rotor hunt for long: twice as much is not wrong then */
    wrong = (int16_t)((wrong > 16383) ? 16383 : wrong);
    o->wrong_erpm = observer_between((int16_t)(2 * wrong), wrong, loaded);
    o->large_erpm = observer_large((int16_t)(observer_between(p->large_erpm, p->large_loaded_erpm, loaded) + (speed >> 5)), o->unrest_steps);
}

/** By how much the angle has turned further in a step than the speed says, as a speed.
 *  The mean over the step, not a sample: a step of current gives the back-EMF a pulse and, over the derivative's eight samples, its
 *  opposite, which cancel over eight periods. The difference wraps with the angle, so no speed is too high.
 *  @param rho_q32 the estimator's angle @param omega_erpm speed in the middle of the step @return erpm, within innovation_max_erpm */
QM_INLINE QM_WRAPS int16_t observer_innovation(observer_t *o, const observer_params_t *p, uint32_t rho_q32, speed_erpm_t omega_erpm)
{
    uint32_t turned = qm_turn_sub(rho_q32, o->rho_q32), expected = (uint32_t)qm_mulss(omega_erpm, p->deltat_q32);
    /* rounded: a count of `more` is 2 electrical rpm, so that half of one would be an offset of the speed */
    int16_t more = qm_clamp(qm_hi((int32_t)qm_turn_add(qm_turn_sub(turned, 8u * expected), 32768u)), -8192, 8191);
    o->rho_q32 = rho_q32;
    return qm_limit_called((int16_t)((qm_mulss(more, p->per_turn_q12) + 2048) >> 12), p->innovation_max_erpm);
}

/** By how much the load's estimate falls: innovation * rate^2 in all its bits, for a slow rate's square is below a word's last.
 *  @param innovation erpm @param rate_q16 rate * step @return the observer's units, 16 fraction bits */
QM_INLINE int32_t observer_load_step(const observer_params_t *p, int16_t innovation, int16_t rate_q16)
{
    int32_t square_q32 = qm_mulss(rate_q16, rate_q16);
    return qm_shift(qm_mulss(innovation, qm_hi(square_q32)), p->shift) + (qm_mulsu(innovation, (uint16_t)square_q32) >> (16u - p->shift));
}

/** What a step's innovation calls for: in full from one and a half of what is large; none while it is the loop's own swing. */
QM_INLINE void observer_answer(observer_t *o, int16_t innovation)
{
    const uint16_t stirred = observer_is_stirred(o);
    uint16_t unrest = o->unrest_steps;
    q15_t level = 0;
    if (stirred) {
        unrest = (uint16_t)((unrest < 4u * OBSERVER_UNREST_STEPS) ? unrest + 4u : unrest);
    } else if (unrest != 0u) {
        unrest--;
    } else {
        /* calm for long */
    }
    if (qm_size(innovation) > o->large_erpm && (!stirred || unrest < OBSERVER_UNREST_STEPS)) {
        if (stirred && (innovation ^ o->large_last_erpm) < 0) {
            unrest = OBSERVER_UNREST_STEPS;
        }
        o->large_last_erpm = innovation;
        level = (int16_t)((qm_size(innovation) - (o->large_erpm >> 1) > o->large_erpm) ? 32767 : OBSERVER_HALF_Q15);
    }
    o->unrest_steps = unrest;
    o->quick_q15 = (int16_t)(o->quick_q15 - (o->quick_q15 >> OBSERVER_CALM_SHIFT));
    if (o->quick_q15 < level) {
        o->quick_q15 = level;
    }
}

/** One step. @param rho_q32 the estimator's angle @param iq_q13 measured q current */
QM_INLINE void observer_step(observer_t *o, const observer_params_t *p, uint32_t rho_q32, current_q13_t iq_q13)
{
    int16_t innovation;
    int32_t before_q16 = o->omega_q16;

    o->omega_q16 = observer_sum(o->omega_q16, (qm_mulsu(iq_q13, p->per_current_q16) - o->load_q16) >> p->shift);
    innovation = observer_innovation(o, p, rho_q32, qm_hi((before_q16 >> 1) + (o->omega_q16 >> 1)));
    o->omega_q16 = observer_sum(o->omega_q16, 2 * qm_mulss(innovation, o->rate_q16));
    o->load_q16 = qm_clamp_hi(o->load_q16 - observer_load_step(p, innovation, o->rate_q16), (int16_t)-p->load_max, p->load_max);
    if (qm_size(innovation) > o->wrong_erpm) {
        o->wrong_steps++;
    } else if (o->wrong_steps != 0u) {
        o->wrong_steps--;
    } else {
        /* right for long */
    }
    observer_answer(o, innovation);
}

#endif
