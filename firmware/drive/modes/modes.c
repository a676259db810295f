/* The seam between the drive and its modes: each mode defines its hook twice, with the mode and without it. */
#include "drive/modes/modes.h"

#include "drive/drive.h"
#include "drive/limits.h"
#include "drive/speed.h"

void mode_start(drive_t *d UNUSED, const drive_params_t *p UNUSED)
{
#if defined IDENTIFY
    identify_start(d, p);
#elif defined BRINGUP
    bringup_start(d, p);
#endif
}

uint16_t mode_hands_over(void)
{
#if defined OPEN_LOOP_FUNCTIONING || defined IDENTIFY || defined BRINGUP /* these have vectors of their own */
    return 0;
#else
    return 1;
#endif
}

speed_erpm_t mode_speed_target(const drive_t *d, const drive_params_t *p)
{
    if (d->state == (uint16_t)DRIVE_STOPPING) {
        return along_direction(d, (int16_t)(p->minimum_erpm - (p->minimum_erpm >> 2)));
    }
#ifdef TUNING
    return along_direction(d, p->maximum_erpm);
#else
    return d->command.target_erpm;
#endif
}

uint16_t mode_reference_step(drive_t *d UNUSED, const drive_params_t *p UNUSED)
{
#ifdef TUNING
    if (d->state == (uint16_t)DRIVE_STOPPING) {
        return 0;
    }
    reference_step(d, p, mode_speed_target(d, p), p->tuning_step_q16);
    return 1;
#else
    return 0;
#endif
}

#ifndef TORQUE_PROFILE
void mode_profile_step(drive_t *d UNUSED, const drive_params_t *p UNUSED)
{
}
#endif

void mode_profile_follow(drive_run_t *run UNUSED, const drive_params_t *p UNUSED)
{
#ifdef TORQUE_PROFILE
    profile_follow(&run->profile, &p->profile, observer_speed(&run->observer));
#endif
}

current_q13_t mode_profile_current(const drive_run_t *run UNUSED)
{
#ifdef TORQUE_PROFILE
    return run->profile.now_q13;
#else
    return 0;
#endif
}

int32_t mode_profile_current_q26(const drive_run_t *run UNUSED)
{
#ifdef TORQUE_PROFILE
    return qm_mulss(run->profile.now_q13, 8192);
#else
    return 0;
#endif
}

uint16_t mode_pot_split(uint16_t pot_q16, int16_t *direction)
{
#ifdef BIDIRECTIONAL_SPEED
    int16_t signed_q15 = (int16_t)(pot_q16 ^ 0x8000u);
    uint16_t travel_q16 = (uint16_t)(2u * (uint16_t)qm_abs(signed_q15));
    if (travel_q16 > 2048u) { /* three per cent around the middle */
        *direction = (int16_t)((signed_q15 > 0) ? 1 : -1);
    }
    return travel_q16;
#else
    *direction = 1;
    return pot_q16;
#endif
}

pot_range_t mode_target_range(const drive_params_t *p, int16_t fast_range UNUSED)
{
    pot_range_t range;
#ifdef TORQUE_MODE
    range.low = MODE_TWO_DIRECTIONS || (DIRECTION_INPUT_USED); /* never 0 then: the sign is the direction */
    range.high = p->current_max_q13;
#else
    uint16_t fast = (uint16_t)(fast_range && !MODE_TWO_DIRECTIONS);
    range.low = fast ? p->nominal_erpm : p->minimum_erpm;
    range.high = fast ? p->maximum_erpm : p->nominal_erpm;
#endif
    return range;
}

uint16_t mode_commands_current(const drive_t *d UNUSED)
{
#ifdef TORQUE_MODE
    return (uint16_t)(d->state == (uint16_t)DRIVE_CLOSED);
#else
    return 0;
#endif
}

uint16_t mode_current_step(drive_t *d UNUSED, const drive_params_t *p UNUSED, current_q13_t *iq_q13)
{
#ifdef TORQUE_MODE
    drive_run_t *run = &d->run;
    int16_t iq, speed = along_direction(d, observer_speed(&run->observer));
    *iq_q13 = 0;
    if (!mode_commands_current(d)) {
        return 0;
    }
    /* field weakening, the rates and a controlled stop start from it */
    run->control.reference_erpm = along_direction(d, (speed > p->minimum_erpm) ? speed : p->minimum_erpm);
    iq = qm_clamp(qm_abs(d->command.target_erpm), along_direction(d, speed_current(run, p, along_direction(d, p->minimum_erpm))),
                  along_direction(d, speed_current(run, p, along_direction(d, p->maximum_erpm))));
    *iq_q13 = along_direction(d, iq);
    return 1;
#else
    *iq_q13 = 0;
    return 0;
#endif
}

uint16_t mode_limit_reasons(const drive_t *d UNUSED, const drive_params_t *p UNUSED, uint16_t *reasons)
{
#ifdef TORQUE_MODE
    int16_t asked = qm_clamp(qm_abs(d->command.target_erpm), 0, d->run.control.iq_limit_q13);
    int16_t missing = qm_sub_limited(asked, along_direction(d, d->run.control.ref_q13.q));
    *reasons = (uint16_t)((qm_abs(missing) > (p->current_max_q13 >> 6)) ? LIMIT_SPEED_RANGE : LIMIT_NONE);
    return mode_commands_current(d);
#else
    *reasons = (uint16_t)LIMIT_NONE;
    return 0;
#endif
}

#if SCOPE
/** The sine of the nearest 128th of a turn, within 0.025: a client knows the angle itself. */
static INLINE q15_t sine_coarse(angle_t angle)
{
    const uint16_t nearest = (uint16_t)(angle + 256u);
    const q15_t s = trig_sin_table[(uint16_t)(nearest >> 9) & (TRIG_SIN_ENTRIES - 1u)];
    return (int16_t)((nearest & 0x8000u) ? -s : s);
}
#endif

INLINE QM_WRAPS dq_t mode_asked(drive_run_t *run, const drive_params_t *p UNUSED)
{
    dq_t asked = run->control.ref_q13;
#if SCOPE
    sine_t *s = &run->sine;
    if (s->left != 0u) {
        s->angle = (angle_t)(s->angle + s->step);
        asked.q = qm_limit((int16_t)(asked.q + (qm_mulhi(s->size_iq_q16, sine_coarse(s->angle)) >> 2)), p->current_max_q13);
    }
#endif
    return asked;
}

void mode_sine_step(drive_run_t *run UNUSED)
{
#if SCOPE
    if (run->sine.left != 0u) {
        run->sine.left--;
    }
#endif
}

uint32_t mode_observed(const drive_run_t *run)
{
    uint32_t rho_q32 = run->estimator.rho_q32;
#if SCOPE
    const sine_t *s = &run->sine;
    if (s->left != 0u) {
        rho_q32 = qm_turn_add(rho_q32, (uint32_t)qm_mulss(s->size_rho_q17, trig_sincos(s->angle).sin));
    }
#endif
    return rho_q32;
}

void snapshot_tick(snapshot_t *s, const drive_t *d)
{
    uint16_t row = s->row;
    if (!*s->start || ++s->wait < s->delay) {
        return;
    }
    s->wait = 0;
    *s->done = 0;
    s->column[0][row] = (int16_t)(4 * qm_clamp(d->phases_q13.a, -8191, 8191));
    s->column[1][row] = (int16_t)(4 * qm_clamp(d->run.control.i_q13.q, -8191, 8191));
    s->column[2][row] = estimator_speed(&d->run.estimator);
    s->column[3][row] = (int16_t)(d->run.estimator.rho_q32 >> 16);
    s->row = (uint16_t)(row + 1u);
    if (s->row >= s->rows) {
        s->row = 0;
        *s->start = 0;
        *s->done = 1;
    }
}
