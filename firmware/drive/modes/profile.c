/* TORQUE_PROFILE: a learned q current by the turn's position meets a load that pulses with the shaft. */
#include "drive/modes/profile.h"

#include "drive/drive.h"
#include "drive/limits.h"

#ifdef TORQUE_PROFILE

angle_t profile_shaft(profile_t *f, const profile_params_t *p, angle_t rho, speed_erpm_t speed)
{
    if (speed >= 0) {
        f->poles = (uint16_t)((rho < f->rho) ? f->poles + 1u : f->poles);
        f->poles = (uint16_t)((f->poles >= p->pole_pairs) ? 0u : f->poles);
    } else if (rho > f->rho) {
        f->poles = (uint16_t)(((f->poles != 0u) ? f->poles : p->pole_pairs) - 1u);
    } else { /* the same electrical turn */
    }
    f->rho = rho;
    f->shaft = (angle_t)(qm_muluu(f->poles, p->per_pole_q16) + qm_mulhi_uu(rho, p->per_pole_q16));
    return f->shaft;
}

QM_WRAPS void profile_follow(profile_t *f, const profile_params_t *p, speed_erpm_t speed)
{
    const uint16_t turn_q16 = (uint16_t)(qm_muluu((uint16_t)qm_abs(speed), p->per_erpm_q31) >> 15); /* of a step */
    const uint32_t gain_q16 = qm_muluu(turn_q16, p->gain_q8) >> 8;
    uint16_t k, turns_q16 = 0;
    f->gain_q16 = (uint16_t)((gain_q16 > PROFILE_GAIN_MOST_Q16) ? PROFILE_GAIN_MOST_Q16 : gain_q16);
    for (k = 0; k < PROFILE_ORDERS; k++) { /* wcet: at most 2 turns */
        angle_t lag;
        turns_q16 = (uint16_t)((turn_q16 > 32767u - turns_q16) ? 32767u : turns_q16 + turn_q16);
        lag = (angle_t)(2u * (uint32_t)trig_direction(p->corner_q16, (int16_t)turns_q16) + ((uint32_t)turns_q16 * PROFILE_DELAY_QUARTERS >> 2));
        f->lag[k] = (angle_t)((speed < 0) ? 0u - lag : lag);
    }
}

/** A cosine or a sine: what it gains, less what it leaks. */
static int32_t profile_part(int32_t part_q29, const profile_params_t *p, int16_t gained_q16, int16_t gain_q16)
{
    const int32_t kept_q29 = part_q29 - (part_q29 >> PROFILE_LEAK_SHIFT);
    return qm_clamp_hi(kept_q29 + (qm_mulss(gained_q16, gain_q16) >> 3), (int16_t)-p->most_q13, p->most_q13);
}

QM_WRAPS void profile_learn(profile_t *f, const profile_params_t *p, angle_t shaft, int16_t error_q16)
{
    const uint16_t order = (uint16_t)(f->next + 1u);
    profile_harmonic_t *h = &f->harmonic[f->next];
    const sincos_t at = trig_sincos((angle_t)(order * (uint32_t)shaft - f->lag[f->next]));
    const int16_t gain_q16 = (int16_t)(order * f->gain_q16);
    h->cos_q29 = profile_part(h->cos_q29, p, qm_hi(2 * qm_mulss(error_q16, at.cos)), gain_q16);
    h->sin_q29 = profile_part(h->sin_q29, p, qm_hi(2 * qm_mulss(error_q16, at.sin)), gain_q16);
    f->next = (uint16_t)((order < PROFILE_ORDERS) ? order : 0u);
}

/** All that was learned fades by 2^-shift. */
static void profile_fade(profile_t *f, uint16_t shift)
{
    uint16_t k;
    for (k = 0; k < PROFILE_ORDERS; k++) { /* wcet: at most 2 turns */
        f->harmonic[k].cos_q29 -= f->harmonic[k].cos_q29 >> shift;
        f->harmonic[k].sin_q29 -= f->harmonic[k].sin_q29 >> shift;
    }
}

current_q13_t profile_current(const profile_t *f, const profile_params_t *p, angle_t shaft)
{
    uint16_t k;
    int32_t sum_q28 = 0;
    angle_t angle = 0;
    for (k = 0; k < PROFILE_ORDERS; k++) { /* wcet: at most 2 turns */
        sincos_t at;
        angle = (angle_t)(angle + shaft);
        at = trig_sincos(angle);
        sum_q28 += qm_mulss(qm_hi_rounded(f->harmonic[k].cos_q29), at.cos) + qm_mulss(qm_hi_rounded(f->harmonic[k].sin_q29), at.sin);
    }
    return qm_limit((int16_t)((sum_q28 + 16384) >> 15), p->sum_most_q13);
}

/** A turn has ended. What the voltage did not follow taught nothing, and each limit takes back some of what was learned. */
static void profile_turn(profile_t *f)
{
    f->learns = (uint16_t)(f->limited < PROFILE_VOLTAGE);
    if (f->limited != 0u) {
        profile_fade(f, PROFILE_LIMITED_SHIFT);
    }
    f->limited = 0;
}

/** What the last step's current met: PROFILE_CURRENT, PROFILE_VOLTAGE, or nothing. */
static uint16_t profile_limit(const drive_control_t *c, const drive_params_t *p, speed_erpm_t speed)
{
    const current_q13_t most = limits_brakes(c->ref_q13.q, speed) ? c->brake_limit_q13 : c->iq_limit_q13;
    if (qm_abs(c->v_q14.q) >= c->vq_limit_q14 && qm_abs((int16_t)(c->ref_q13.q - c->i_q13.q)) > (p->current_max_q13 >> PROFILE_MISSING_SHIFT)) {
        return PROFILE_VOLTAGE;
    }
    return (uint16_t)(qm_abs(c->ref_q13.q) >= most ? PROFILE_CURRENT : 0u);
}

/** 1 where the speed's error may be the shaft's position: neither the reference nor a load step makes it. A step is over before the gate has been
 *  open for long; a load that pulses keeps opening it. */
static uint16_t profile_may_learn(const drive_run_t *run)
{
    const observer_t *o = &run->observer;
    return (uint16_t)(run->profile.learns && run->handover.offset == 0 && run->control.reference_erpm == run->profile.reference_erpm
                      && (observer_gate_is_closed(o) || o->gate_level >= PROFILE_UNREST_STEPS));
}

void mode_profile_step(drive_t *d, const drive_params_t *p)
{
    const profile_params_t *pp = &p->profile;
    const drive_control_t *c = &d->run.control;
    profile_t *f = &d->run.profile;
    const speed_erpm_t speed = observer_speed(&d->run.observer);
    const angle_t before = f->shaft, shaft = profile_shaft(f, pp, (angle_t)(d->run.observer.rho_q32 >> 16), speed);
    if ((speed >= 0) ? (shaft < before) : (shaft > before)) {
        profile_turn(f);
    }
    f->limited |= profile_limit(c, p, speed);
    if (d->state != (uint16_t)DRIVE_CLOSED || qm_abs(c->reference_erpm) < pp->least_erpm) {
        profile_fade(f, PROFILE_FADE_SHIFT);
    } else if (profile_may_learn(&d->run)) {
        const int32_t error_q16 = qm_mulss(qm_sub_limited(c->reference_erpm, speed), p->speed_kp_q13) >> 10;
        profile_learn(f, pp, shaft, qm_within(error_q16, (int16_t)-pp->error_most_q16, pp->error_most_q16));
    } else { /* a ramp, or no voltage: what was learned stays */
    }
    f->reference_erpm = c->reference_erpm;
    f->now_q13 = mode_commands_current(d) ? 0 : profile_current(f, pp, shaft);
}

#endif
