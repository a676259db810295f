/* Limits of voltage and current, the bus that they come from, and why the drive gives less than it is asked for. */
#include "drive/limits.h"

#include "drive/protection.h"
#include "drive/speed.h"

INLINE voltage_q14_t limits_free_voltage(const drive_control_t *c, current_q13_t missing_q13)
{
    return (int16_t)(c->vq_limit_q14 - qm_abs(c->v_q14.q) - LIMITS_MISSING_Q14 * qm_clamp(missing_q13, -LIMITS_MISSING_MOST_Q13, LIMITS_MISSING_MOST_Q13));
}

current_q13_t limits_asked_most(const drive_params_t *p)
{
    return (int16_t)(p->current_max_q13 - (p->current_max_q13 >> ASKED_LESS_SHIFT));
}

INLINE uint16_t limits_brakes(current_q13_t iq_q13, int16_t turns)
{
    return (uint16_t)((iq_q13 ^ turns) < 0);
}

/** 1 while the q current brakes and the bus leaves less of it than the circle. With no braking current at all its reference is 0, which has no sign. */
static uint16_t limits_bus_is_narrower(const drive_control_t *c, speed_erpm_t speed)
{
    return (uint16_t)(c->brake_limit_q13 < c->iq_limit_q13 && (c->ref_q13.q == 0 || limits_brakes(c->ref_q13.q, speed)));
}

void limits_flux_brake(drive_run_t *run, const drive_params_t *p)
{
    drive_control_t *c = &run->control;
    const uint16_t bus_holds = (uint16_t)(limits_bus_is_narrower(c, observer_speed(&run->observer)) && qm_abs(c->ref_q13.q) == c->brake_limit_q13);
    const int16_t step = (int16_t)(bus_holds ? FLUX_BRAKE_STEP_Q13 : -FLUX_BRAKE_STEP_Q13);
    c->flux_brake_q13 = qm_clamp((int16_t)(c->flux_brake_q13 + step), 0, p->flux_brake_most_q13);
}

current_q13_t limits_circle(current_q13_t most_q13, uint16_t reciprocal, uint16_t other_q13)
{
    uint32_t ratio = qm_muluu(other_q13, reciprocal) >> 10;
    if (ratio > 32767u) {
        ratio = 32767u;
    }
    return qm_mulhi_su(most_q13, (uint16_t)(2u * (uint16_t)trig_circle((int16_t)ratio)));
}

current_q13_t limits_beside(const drive_params_t *p, uint16_t other_q13)
{
    return limits_circle(p->current_max_q13, p->current_max_reciprocal, other_q13);
}

/** What flows beyond the q reference while a shaft is braked at once: the current control is behind a back-EMF that falls. The limit is lower by it. */
static void limits_leave_room(drive_control_t *c, current_q13_t beyond_q13)
{
    current_q13_t left_q13;
    c->over_q13 = qm_clamp(beyond_q13, qm_mulhi_su(c->over_q13, LIMITS_OVER_STAYS_Q16), 16383);
    left_q13 = (int16_t)(c->iq_limit_q13 - c->over_q13);
    c->iq_limit_q13 = (int16_t)((left_q13 > 0) ? left_q13 : 0);
}

void limits_current(drive_run_t *run, const drive_params_t *p)
{
    drive_control_t *c = &run->control;
    const current_q13_t grown_q13 = (int16_t)(c->ref_q13.d - (p->current_max_q13 >> LIMITS_GROWS_SHIFT)); /* q current makes room first */
    const current_q13_t missing_q13 = qm_with_sign((int16_t)(c->ref_q13.q - c->i_q13.q), c->ref_q13.q), slack_q13 = (int16_t)(p->current_max_q13 >> LIMITS_SLACK_SHIFT);
    current_q13_t id_q13 = run->probe_id_q13;
    fieldweak_trim(&run->fieldweak, &p->fieldweak, limits_free_voltage(c, missing_q13), estimator_speed(&run->estimator));
    if (!held_angle_stands(&run->held)) { /* a rotor that stands needs none but a probe's: it would turn the vector away from q */
        id_q13 = (int16_t)(id_q13 + run->handover.id_q13 + salient_id(run, p) + run->fieldweak.trim_q13 - c->flux_brake_q13);
    }
    c->ref_q13.d = qm_limit((int16_t)((id_q13 < grown_q13) ? grown_q13 : id_q13), limits_asked_most(p));
    c->iq_limit_q13 = limits_beside(p, (uint16_t)qm_abs(c->ref_q13.d));
    if (missing_q13 < -slack_q13 || c->over_q13 != 0) {
        limits_leave_room(c, (int16_t)(-missing_q13 - slack_q13));
    }
}

current_q13_t limits_supply(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    const voltage_q14_t driving_q14 = (int16_t)((c->ref_q13.q < 0) ? -c->v_q14.q : c->v_q14.q);
    const int32_t left = qm_mulss(d->circle.limit_q14, p->supply_limit_q13) - qm_mulss(c->v_q14.d, c->ref_q13.d);
    int16_t most = p->current_max_q13;
    if (left <= 0) {
        most = 0;
    } else if (driving_q14 > 0 && left < qm_mulss(driving_q14, most)) {
        uint16_t fits_q13 = qm_divud((uint32_t)left, (uint16_t)driving_q14);
        if (fits_q13 < (uint16_t)most) { /* it is: the proof sees it here */
            most = (int16_t)fits_q13;
        }
    } else { /* more than the largest current */
    }
    c->supply_q13 = observer_between(c->supply_q13, most, SUPPLY_FOLLOWS_Q15);
    return c->supply_q13;
}

current_q13_t limits_derated(const drive_params_t *p, int16_t bus_q15)
{
    const int16_t above = (int16_t)(bus_q15 - p->bus_under_q15), least = (int16_t)(p->current_max_q13 / DERATE_LEAST);
    int32_t most = least;
    if (above > 0) {
        most += qm_mulss(above, p->derate_per_bus_q8) >> 8;
    }
    return (int16_t)((most > p->current_max_q13) ? p->current_max_q13 : most);
}

/** 1 where a limit of the driving current is in use. */
static uint16_t limits_drive_less(const drive_params_t *p)
{
    return (uint16_t)(HEAT_USED || p->supply_limit_q13 != 0 || p->derate_per_bus_q8 != 0);
}

/** Narrows the q current's limit for a reason. */
static void limits_narrow(drive_control_t *c, current_q13_t most, limit_reason_t reason)
{
    if (most < c->iq_limit_q13) {
        c->iq_limit_q13 = most;
        c->limited_by = (uint16_t)reason;
    }
}

void limits_driving(drive_t *d, const drive_params_t *p)
{
    drive_control_t *c = &d->run.control;
    const uint16_t drives = (uint16_t)!limits_brakes(c->ref_q13.q, observer_speed(&d->run.observer));
    if (!limits_drive_less(p)) {
        return;
    }
    c->limited_by = (uint16_t)LIMIT_NONE;
    if (p->supply_limit_q13 != 0) {
        current_q13_t most = limits_supply(d, p);
        if (drives) {
            limits_narrow(c, most, LIMIT_SUPPLY);
        }
    }
    if (p->derate_per_bus_q8 != 0 && drives) {
        limits_narrow(c, limits_derated(p, qm_hi(d->bus_q31)), LIMIT_LOW_BUS);
    }
    if (HEAT_USED && drives) {
        limits_narrow(c, heat_most(d), LIMIT_TEMPERATURE);
    }
}

void limits_braking(drive_run_t *run, const drive_params_t *p, int16_t bus_q15)
{
    int16_t over = (int16_t)(bus_q15 - p->bus_regen_q15);
    int16_t most = limits_asked_most(p);
    if (over > 0) {
        int32_t less = qm_mulss(over, p->brake_per_bus_q8) >> 8;
        most = (int16_t)((less > most) ? 0 : most - less);
    }
    run->control.brake_limit_q13 = most;
}

current_q13_t limits_apply_braking(const drive_control_t *c, speed_erpm_t speed, current_q13_t iq_q13)
{
    if (limits_brakes(iq_q13, speed)) {
        return qm_limit(iq_q13, c->brake_limit_q13);
    }
    return iq_q13;
}

/** 1 from 1/32 below the limit on: field weakening's trim keeps the voltage a little below it. @param limit 0 or more */
static NOINLINE uint16_t limits_reached(int16_t x, int16_t limit)
{
    return (uint16_t)(qm_abs(x) >= (int16_t)(limit - (limit >> 5)));
}

/** What holds the q current: the bus if it brakes, else the supply or the current. */
static uint16_t limits_current_reasons(const drive_control_t *c, const drive_params_t *p, speed_erpm_t speed)
{
    int16_t limit = c->iq_limit_q13;
    uint16_t reason = (uint16_t)LIMIT_CURRENT;
    if (limits_bus_is_narrower(c, speed) && c->brake_limit_q13 < limits_asked_most(p)) { /* more is never asked for */
        limit = c->brake_limit_q13;
        reason = (uint16_t)LIMIT_BRAKE;
    } else if (limits_drive_less(p) && c->limited_by != (uint16_t)LIMIT_NONE) {
        reason = c->limited_by;
    } else { /* the circle */
    }
    return (uint16_t)(limits_reached(c->ref_q13.q, limit) ? reason : 0u);
}

/** What holds the speed reference. A rest that the next step takes is no ramp. */
static uint16_t limits_ramp_reasons(const drive_t *d, const drive_params_t *p)
{
    speed_erpm_t target = mode_speed_target(d, p);
    int16_t left = qm_abs(qm_less(target, d->run.control.reference_erpm));
    if (d->run.control.ramp_waits) {
        return (uint16_t)LIMIT_RAMP | (uint16_t)LIMIT_RAMP_WAITS;
    }
    return (uint16_t)((left > qm_hi(2 * reference_slope(p, d->run.control.reference_erpm, target) - 1)) ? LIMIT_RAMP : LIMIT_NONE);
}

/** What holds the current's references in closed loop. */
static uint16_t limits_closed_loop_reasons(const drive_t *d, const drive_params_t *p)
{
    const drive_run_t *run = &d->run;
    const drive_control_t *c = &run->control;
    uint16_t found;
    if (!mode_limit_reasons(d, p, &found)) {
        found = limits_ramp_reasons(d, p);
    }
    found |= limits_current_reasons(c, p, observer_speed(&run->observer));
    if (c->flux_brake_q13 > 0) {
        found |= (uint16_t)LIMIT_FLUX_BRAKING;
    }
    if (run->fieldweak.table_q13 + run->fieldweak.trim_q13 < 0) {
        found |= (uint16_t)LIMIT_FIELD_WEAKENING;
    }
    return found;
}

/** The estimator's speed is right in the mean, but not for long enough. */
static uint16_t limits_start_swings(const drive_t *d, const drive_params_t *p)
{
    const handover_t *h = &d->run.handover;
    int16_t forced = handover_forced_erpm(d, p);
    if (!mode_hands_over()) {
        return 0;
    }
    return (uint16_t)(d->state == (uint16_t)DRIVE_RAMP && handover_is_overdue(forced, p) && !handover_agrees(h) && qm_abs(h->ahead_erpm) < forced >> 3);
}

uint16_t limits_reasons(const drive_t *d, const drive_params_t *p)
{
    const drive_control_t *c = &d->run.control;
    uint16_t found;
    if (!drive_is_running(d)) {
        const uint16_t phase = d->run.catching.phase;
        const uint16_t waits = (uint16_t)(phase == (uint16_t)CATCH_BUS_HIGH || phase == (uint16_t)CATCH_TOO_FAST);
        return (uint16_t)((waits && d->state == (uint16_t)DRIVE_CATCH) ? LIMIT_TOO_FAST : LIMIT_NONE);
    }
    found = (uint16_t)((limits_reached(c->v_q14.q, c->vq_limit_q14) | limits_reached(c->v_q14.d, d->circle.vd_most_q14)) * (uint16_t)LIMIT_VOLTAGE);
    if (drive_is_closed(d)) {
        found |= limits_closed_loop_reasons(d, p);
    } else if (limits_start_swings(d, p)) {
        found |= (uint16_t)LIMIT_SWING;
    } else { /* bootstrap, align, and a ramp that goes as it should */
    }
    return found;
}

int16_t bus_sample(int16_t v_bus_raw)
{
    return (int16_t)((uint16_t)((uint16_t)v_bus_raw ^ 0x8000u) >> 1);
}

void bus_step(drive_t *d, const drive_params_t *p, int16_t v_bus_raw)
{
    int16_t now_q15 = bus_sample(v_bus_raw), bus_q15 = qm_lowpass(&d->bus_q31, now_q15, 16384);
    protection_check_bus(d, p, now_q15, bus_q15);
    bus_update_gain(d, p, now_q15);
}

uint16_t bus_chopper(chopper_t *c, int16_t bus_q15, uint16_t ticks)
{
    const uint16_t passed = (uint16_t)(ticks - c->ticks);
    const uint32_t given_back = qm_muluu(passed, CHOPPER_SHARE_Q10);
    c->ticks = ticks;
    c->spent_q10 = c->is_on ? c->spent_q10 + qm_muluu(passed, (uint16_t)(1024u - CHOPPER_SHARE_Q10)) : (c->spent_q10 > given_back) ? c->spent_q10 - given_back
                                                                                                                                   : 0u;
    c->rests = (uint16_t)(c->spent_q10 >= CHOPPER_MOST_Q10 || (c->rests && c->spent_q10 > CHOPPER_MOST_Q10 - (CHOPPER_MOST_Q10 >> CHOPPER_REST_SHIFT)));
    c->is_on = (uint16_t)((bus_q15 >= CHOPPER_ON_Q15 || (c->is_on && bus_q15 >= CHOPPER_OFF_Q15)) && !c->rests);
    return c->is_on;
}

void bus_update_gain(drive_t *d, const drive_params_t *p, int16_t bus_q15)
{
    /* the least keeps the quotient within 16 bits */
    int16_t used_q15 = (int16_t)((bus_q15 < p->bus_under_q15) ? p->bus_under_q15 : bus_q15);
    d->duty_per_volt_q16 = qm_divud(p->duty_per_volt_numerator, (uint16_t)((uint16_t)used_q15 << 1));
}

void bus_update_voltage_limit(drive_t *d, const drive_params_t *p)
{
    int16_t bus_q15 = qm_clamp(qm_hi(d->bus_q31), 0, p->bus_used_q15);
    voltage_circle_of(&d->circle, (int16_t)qm_mulhi_uu((uint16_t)((uint16_t)bus_q15 << p->bus_shift), p->voltage_limit_per_bus_q16));
}
