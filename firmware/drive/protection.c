/* Protection: the conditions that end in a fault and need no signal's model: currents, bus, rotor, heat. */
#include "drive/protection.h"

#include "drive/drive.h"
#include "drive/limits.h"

INLINE uint16_t protection_check_current(drive_t *d, const drive_params_t *p)
{
    const int16_t limit = p->overcurrent_q13;
    if (qm_beyond(d->phases_q13.a, limit) || qm_beyond(d->phases_q13.b, limit) || qm_beyond(d->phases_q13.c, limit)) {
        drive_raise_at_once(d, FAULT_OVERCURRENT_SW);
        return 1;
    }
    return 0;
}

#define PROTECTION_BUS_STANDS ((int16_t)(DUTY_PER_VOLT_NUMERATOR >> (16 + PROTECTION_BUS_STANDS_SHIFT))) /* numerator/2^16 */
#define PROTECTION_BUS_END_Q15 32640                                                                     /* the converter's last steps: more cannot be told from a broken signal */

void protection_check_bus(drive_t *d, const drive_params_t *p, int16_t now_q15, int16_t bus_q15)
{
    drive_fault_t found;
    if (!drive_conducts(d) && now_q15 < PROTECTION_BUS_END_Q15) {
        return;
    }
    if (now_q15 > p->bus_over_q15) {
        found = FAULT_OVERVOLTAGE;
    } else if (bus_q15 < p->bus_under_q15) {
        found = FAULT_UNDERVOLTAGE;
    } else {
        return;
    }
    drive_raise(d, found);
}

void protection_check_bus_signal(drive_t *d, const drive_params_t *p, int16_t now_q15)
{
    const int16_t bus_q15 = qm_hi(d->bus_q31), against = along_direction(d, d->run.observer.innovation_erpm);
    const uint16_t before = qm_mulhi_uu(d->duty_per_volt_q16, (uint16_t)((uint16_t)now_q15 << 1)); /* numerator/2^16 by the modulator's gain, which has the last step's bus in it */
    if (bus_q15 - now_q15 > bus_q15 >> PROTECTION_BUS_FALL_SHIFT && (int16_t)((uint16_t)(p->duty_per_volt_numerator >> 16) - before) < PROTECTION_BUS_STANDS && against < -d->run.observer.gate_erpm) {
        drive_raise(d, FAULT_BUS_SENSOR);
    }
}

/** How much of the back-EMF may be R i: by what R may be more than is known, or less where the back-EMF brakes. @return Q27 */
static int32_t protection_ri_off_q27(const drive_run_t *run, const drive_params_t *p)
{
    const int16_t rs = qm_hi(run->adaptation.rs_q31), iq_q13 = run->control.i_q13.q;
    const int16_t off = (int16_t)(limits_brakes(iq_q13, estimator_emf(&run->estimator).q) ? rs - p->rs_off_least : p->rs_off_most - rs);
    return qm_mulss(model_header_ri(p, qm_abs(iq_q13)), off);
}

#define PROTECTION_TURN_SHIFT 4 /* the angle step of a period to that of eight: ls_q16 is L of eight samples */

uint16_t protection_flux_is_impossible(const drive_run_t *run, const drive_params_t *p)
{
    dq_t i = run->control.i_q13, emf = estimator_emf(&run->estimator);
    int16_t e_q12 = qm_abs(emf.q), more = (int16_t)(p->kfi_impossible - qm_hi(run->adaptation.kfi_q31));
    uint16_t turned_q13 = (uint16_t)((uint16_t)qm_abs(qm_mulhi(i.d, run->estimator.half_step_q16_rad)) << PROTECTION_TURN_SHIFT);
    uint32_t li_q12 = (qm_muluu(turned_q13, run->model.ls_q16) >> 16) << p->estimator.ls_exp;
    int32_t parts_q27 = protection_ri_off_q27(run, p) + qm_mulss((int16_t)((li_q12 > 32767ul) ? 32767ul : li_q12), p->ls_off);
    return (uint16_t)(qm_mulss(e_q12, more) - ((int32_t)p->dead_emf_q12 << 15) > parts_q27);
}

void protection_check_model(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    uint16_t strong, hot;
    if (!drive_is_closed(d)) {
        return;
    }
    strong = protection_flux_is_impossible(run, p);
    hot = (uint16_t)(qm_hi(run->adaptation.rs_q31) >= p->rs_impossible);
    run->impossible_steps = (uint16_t)((strong || hot) ? run->impossible_steps + 1u : 0u);
    if (run->impossible_steps > p->impossible_steps) {
        drive_raise(d, strong ? FAULT_BUS_SENSOR : FAULT_OVERTEMPERATURE);
    }
}

#define PROTECTION_PROBE_LEAST_Q15 ((MOTOR_SALIENCY_UH) ? PROBE_LEAST_SALIENT_Q15 : PROBE_LEAST_Q15)

uint16_t protection_rotor_is_doubtful(const drive_run_t *run, const drive_params_t *p)
{
    int16_t less_q12 = (int16_t)(qm_abs(estimator_emf(&run->estimator).q) - p->adaptation.emf_least_q12);
    return (uint16_t)(less_q12 <= qm_hi(2 * protection_ri_off_q27(run, p)));
}

current_q13_t protection_probe_most(const drive_run_t *run, const drive_params_t *p)
{
    int16_t most = limits_beside(p, salient_current_beside(run, p, run->probe_most_q13));
    /* products in C: constants */
    most = qm_clamp(most, (int16_t)(((int32_t)p->current_max_q13 * PROTECTION_PROBE_LEAST_Q15) >> 15),
                    (int16_t)(((int32_t)p->current_max_q13 * PROBE_MOST_Q15) >> 15));
#if MOTOR_SALIENCY_UH
    most = (int16_t)((most + run->probe_most_q13) / 2);
#endif
    return most;
}

speed_erpm_t protection_least_speed(const drive_run_t *run, const drive_params_t *p)
{
    int16_t least = (int16_t)(qm_abs(run->control.reference_erpm) >> STALL_SLOW_SHIFT), standing = (int16_t)(p->minimum_erpm >> STALL_SLOW_SHIFT);
    return (least < standing) ? standing : least;
}

/** 1 where a probe can tell something. */
static uint16_t probe_is_wanted(const drive_run_t *run, const drive_params_t *p)
{
    return (uint16_t)(run->handover.id_q13 == 0 && protection_rotor_is_doubtful(run, p));
}

/** 1 where the rotor seems to turn, or the back-EMF has a direction. @param along speed along the run's direction */
static uint16_t probe_sees_a_turn(const drive_run_t *run, const drive_params_t *p, speed_erpm_t along)
{
    dq_t emf = estimator_emf(&run->estimator);
    return (uint16_t)(along >= protection_least_speed(run, p) || qm_abs(emf.d) < (qm_abs(emf.q) >> 2));
}

/** The one place that writes the phase. */
static void probe_enter(drive_run_t *run, probe_phase_t next)
{
    run->probe_phase = (uint16_t)next;
    run->probe_steps = 0;
}

/** Steps of a dip; those of the probe's own dip stay beyond PROBE_DIP_STEPS until it is over. */
static void protection_count_dip(drive_run_t *run, uint16_t dips)
{
    if (!dips) {
        run->dip_steps = 0;
    } else if (run->dip_steps <= PROBE_DIP_STEPS) {
        run->dip_steps++;
    } else { /* the probe's own */
    }
}

/** A step between two probes. */
static void protection_pause(drive_run_t *run, const drive_params_t *p)
{
    run->probe_steps++;
    if (run->probe_steps > PROBE_CALM_STEPS && !observer_gate_is_closed(&run->observer) && probe_is_wanted(run, p)) {
        run->probe_asked = 1; /* a shaft that is blocked looks like a load step, if R is off */
    }
    if (run->probe_steps > PROBE_EVERY_STEPS - PROBE_WAIT_STEPS - PROBE_STEPS || run->dip_steps == PROBE_DIP_STEPS
        || (run->probe_asked && run->probe_steps > PROBE_SOON_STEPS)) {
        probe_enter(run, PROBE_WAIT);
    }
}

void protection_probe_rotor(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    int16_t along = along_direction(d, estimator_speed(&run->estimator)), reference = qm_abs(run->control.reference_erpm);
    int16_t id_q13 = 0, slope = (int16_t)(p->current_max_q13 >> PROBE_SLOPE_SHIFT);
    if (held_angle_stands(&run->held)) {
        if (run->held.phase != (uint16_t)HELD_STANDS) { /* its question, at the currents that flow */
            return;
        }
        probe_enter(run, PROBE_PAUSE); /* it has the answer */
    }
    switch (run->probe_phase) {
    case PROBE_WAIT:
        run->probe_steps = (uint16_t)((along >= protection_least_speed(run, p) && probe_is_wanted(run, p)) ? run->probe_steps + 1u : 0u);
        run->probe_most_q13 = protection_probe_most(run, p);
        if (run->probe_steps == PROBE_WAIT_STEPS) {
            run->probe_asked = 0;
            probe_enter(run, PROBE_TEST);
        }
        break;
    case PROBE_TEST:
        id_q13 = qm_clamp(qm_abs(run->control.ref_q13.q), 0, run->probe_most_q13);
        run->dip_steps = PROBE_DIP_STEPS + 1u; /* a heavy load dips for want of the probe's current: none counts before it is over */
        run->probe_steps = (uint16_t)(run->probe_steps + probe_sees_a_turn(run, p, along));
        if (run->probe_steps == PROBE_STEPS || !probe_is_wanted(run, p)) {
            probe_enter(run, PROBE_PAUSE);
        }
        break;
    case PROBE_PAUSE:
    default:
        protection_count_dip(run, (uint16_t)(along < reference - (reference >> 2)));
        protection_pause(run, p);
        break;
    }
    run->probe_id_q13 = qm_clamp(id_q13, (int16_t)(run->probe_id_q13 - slope), (int16_t)(run->probe_id_q13 + slope));
}

void protection_check_rotor(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    int16_t along = along_direction(d, estimator_speed(&run->estimator)), speed = qm_abs(along), standing = (int16_t)(p->minimum_erpm >> STALL_SLOW_SHIFT);
    dq_t emf = estimator_emf(&run->estimator);
    speed_erpm_t least = protection_least_speed(run, p);
    least = qm_beyond(run->control.ref_q13.q, (int16_t)(p->current_max_q13 >> STALL_ASKS_SHIFT)) ? least : (int16_t)(least >> 1); /* with little it is on its way */
    if (along < least) {
        run->stall_steps++;
    } else { /* of a rotor that only jerks the estimate is fast now and then */
        run->stall_steps = (uint16_t)((run->stall_steps > STALL_FALL) ? run->stall_steps - STALL_FALL : 0u);
    }
    /* of a standing rotor the direction of its back-EMF says nothing */
    if (speed > p->overspeed_erpm || (speed >= standing && qm_abs(emf.d) > qm_abs(emf.q))) {
        run->lost_lock_steps = (uint16_t)(run->lost_lock_steps + 2u);
    } else if (run->lost_lock_steps != 0u) { /* a lost estimator slips past the rotor: only now and then Ed is the larger one */
        run->lost_lock_steps--;
    } else { /* in lock */
    }
    if (run->stall_steps > p->stall_steps || run->lost_lock_steps > p->lost_lock_steps) {
        drive_raise(d, (run->stall_steps > p->stall_steps) ? FAULT_STALL : FAULT_LOST_LOCK);
    }
}

/* ---- overload ---- */

#define OVERLOAD_SUM_SHIFT 10 /* i^2 / 2 over OVERLOAD_STEP_MS keeps to its word */

/** i_d^2 + i_q^2. @return Q26, at most 2^31 */
static uint32_t overload_square(const drive_t *d)
{
    dq_t i = d->run.control.i_q13;
    return (uint32_t)qm_mulss(i.d, i.d) + (uint32_t)qm_mulss(i.q, i.q);
}

/** a * rate, in all bits of a. */
static int32_t overload_part(int32_t a, uint16_t rate_q16)
{
    return qm_mulsu(qm_hi(a), rate_q16) + (int32_t)(qm_muluu((uint16_t)a, rate_q16) >> 16);
}

uint16_t overload_tick(overload_t *o, const drive_t *d, const drive_params_t *p, uint16_t ms)
{
    const uint16_t runs = (uint16_t)(drive_is_running(d) || drive_shorts(d));
    uint32_t square = 0; /* a stopped drive's registers keep what flowed last */
    uint16_t rest;
    if (p->i2t_most_q25 == 0) {
        return 0;
    }
    if (runs) {
        square = overload_square(d) >> OVERLOAD_SUM_SHIFT;
    }
    for (rest = ms; rest != 0u; rest--) { /* one as a rule */
        o->sum += square;
        o->ms++;
        if (o->ms == OVERLOAD_STEP_MS) {
            o->heat_q25 += overload_part((int32_t)o->sum - o->heat_q25, p->i2t_rate_q16);
            o->sum = 0;
            o->ms = 0;
        }
    }
    return (uint16_t)(runs && o->heat_q25 >= p->i2t_most_q25);
}

/* ---- Temperatures of motor and bridge by NTC thermistors: what they leave of the driving current, when they trip, and what a broken sensor does ---- */

#if HEAT_USED
int16_t ntc_celsius(const ntc_params_t *p, uint16_t share_q16)
{
    uint16_t node = 1, below, span, above = 0;
    while (node < NTC_NODES - 1u && share_q16 < p->share_q16[node]) {
        node++;
    }
    below = p->share_q16[node];
    span = (uint16_t)(p->share_q16[node - 1u] - below);
    if (share_q16 > below) {
        above = (uint16_t)(share_q16 - below);
    }
    if (above >= span) {
        above = (uint16_t)(span - 1u);
    }
    return (int16_t)(16 * (NTC_LEAST_C + NTC_STEP_C * (int16_t)node) - (qm_share(above, span) >> 7)); /* 2^15 are 16 * NTC_STEP_C */
}

/** 1 where no temperature is. */
static uint16_t ntc_is_at_an_end(uint16_t share_q16)
{
    return (uint16_t)(share_q16 >= NTC_OPEN_Q16 || share_q16 <= NTC_SHORTED_Q16);
}

void ntc_sample(ntc_t *ntc, const ntc_params_t *p, int16_t sample_q15)
{
    const int16_t trip_q4 = (int16_t)(p->trip_q4 - (ntc->is_hot ? HEAT_COOLER_Q4 : 0));
    if (ntc_is_at_an_end((uint16_t)((uint16_t)sample_q15 ^ 0x8000u))) {
        if (ntc->broken < NTC_BROKEN_SAMPLES) {
            ntc->broken++;
        }
        return;
    }
    if (ntc->broken != 0u) {
        ntc->broken--;
    }
    if (!ntc->is_known) {
        ntc->smooth_q31 = (int32_t)sample_q15 * 65536;
        ntc->is_known = 1;
    }
    ntc->celsius_q4 = ntc_celsius(p, (uint16_t)((uint16_t)qm_lowpass(&ntc->smooth_q31, sample_q15, NTC_FOLLOWS_Q16) ^ 0x8000u));
    ntc->is_hot = (uint16_t)(ntc->celsius_q4 >= trip_q4);
}

current_q13_t ntc_derated(const ntc_params_t *ntc, const drive_params_t *p, int16_t celsius_q4)
{
    const int16_t over_q4 = (int16_t)(celsius_q4 - ntc->derate_q4), least = (int16_t)(p->current_max_q13 / DERATE_LEAST);
    int32_t most = p->current_max_q13;
    if (over_q4 > 0) {
        most -= qm_mulss(over_q4, ntc->derate_per_q4_q8) >> 8;
    }
    return (int16_t)((most < least) ? least : most);
}

/** What the sensors say together. */
typedef struct {
    current_q13_t most_q13;
    uint16_t found; /* drive_fault_t */
} judged_heat_t;

/** What one of them says. @param hot its fault when it is too hot */
static void ntc_judge(judged_heat_t *now, const ntc_t *ntc, const ntc_params_t *its, const drive_params_t *p, drive_fault_t hot)
{
    const current_q13_t most = ntc_derated(its, p, ntc->celsius_q4);
    if (most < now->most_q13) {
        now->most_q13 = most;
    }
    if (ntc->broken == NTC_BROKEN_SAMPLES) {
        now->found = (uint16_t)FAULT_NTC_SENSOR;
    } else if (ntc->is_hot) {
        now->found = (uint16_t)hot;
    } else { /* nothing to say */
    }
}

uint16_t heat_follow(drive_t *d, const drive_params_t *p)
{
    judged_heat_t now = { p->current_max_q13, (uint16_t)FAULT_NONE };
#if BRIDGE_NTC_USED
    ntc_judge(&now, &d->heat.bridge, &p->bridge_ntc, p, FAULT_BRIDGE_HOT);
#endif
#if MOTOR_NTC_USED
    ntc_judge(&now, &d->heat.motor, &p->motor_ntc, p, FAULT_MOTOR_HOT);
#endif
    d->heat.most_q13 = now.most_q13;
    d->heat.held = now.found;
    return now.found;
}

void heat_init(drive_t *d, const drive_params_t *p)
{
    d->heat.most_q13 = p->current_max_q13;
}

current_q13_t heat_most(const drive_t *d)
{
    return d->heat.most_q13;
}

uint16_t heat_holds(const drive_t *d)
{
    return (uint16_t)(d->heat.held != (uint16_t)FAULT_NONE && d->heat.held == d->fault);
}
#endif
