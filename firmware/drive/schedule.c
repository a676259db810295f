/* The slots of the schedule: what each half calls, and how the self-test follows it. */
#include "drive/schedule.h"

#include "drive/drive.h"
#include "drive/held.h"
#include "drive/limits.h"
#include "drive/protection.h"
#include "drive/signals.h"
#include "drive/speed.h"

/** A step of the start; in closed loop the load observer's. */
static void observe_load(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    mode_sine_step(&d->run);
    if (drive_is_closed(d)) {
        handover_observe(&d->run, p);
    } else if (MODE_ALIGNS && drive_is_running(d)) { /* else the mode turns the rotor */
        states_start_step(d, p);
    } else { /* it does, or the bridge is off */
    }
}

/** The speed controller's step. */
static void control_speed(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    speed_step(d, p);
}

/** Where a state leads to the next by what the rotor does, CLOSED does not, or what follows for a rotor that may be held. */
static void step_state(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    if (d->run.held.act != (uint16_t)HELD_WAITS && drive_is_closed(d)) {
        held_act(d, p);
    } else if (d->state != (uint16_t)DRIVE_CLOSED) {
        states_rotor_step(d, p);
    } else { /* nothing waits */
    }
}

/** In closed loop: may the rotor stand? Else as step_state(). */
static void ask_rotor(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    if (drive_is_closed(d)) {
        held_step(d, p);
    } else {
        states_rotor_step(d, p);
    }
}

/** The modulator's gain follows the bus, and so does what braking may do to it. */
static void follow_bus(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    bus_step(d, p, raw->v_bus);
    if (drive_is_closed(d)) {
        limits_flux_brake(&d->run, p);
        limits_braking(&d->run, p, bus_sample(raw->v_bus));
    }
}

/** The voltage circle at the filtered bus. */
static void limit_voltage(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    bus_update_voltage_limit(d, p);
}

/** What is left of the hand-over decays; the references of d and q current, and their limits. */
static void limit_currents(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    if (d->run.handover.offset != 0) {
        handover_decay(&d->run.handover);
    } else {
        d->run.handover.id_q13 = 0; /* a bit of it that flipped would stay */
    }
    limits_current(&d->run, p);
    limits_driving(d, p);
}

/** As limit_currents(); then what the running motor teaches. */
static void limit_and_learn(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    limit_currents(d, p, raw);
    model_learn_step(&d->run, p);
}

/** The observer's rate, the controller's gain, the current that the samples miss. */
static void follow_speed(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    speed_follow(&d->run, p);
}

/** Once signals seem wrong, they are looked at in every such slot, and judged. */
QM_INLINE void watch_signals(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    if (d->run.observer.wrong_steps != 0u) {
        signals_check(d, p);
        signals_judge(d, p);
        protection_check_bus_signal(d, p, bus_sample(raw->v_bus));
    }
}

/** Does the rotor stand? */
static void probe_rotor(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    protection_probe_rotor(d, p);
}

/** Does the run go on? */
static void choose_state(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    speed_choose_state(d, p);
}

/* wcet: speed_load_moves_against excludes speed_schedule */
/** The speed's error at rest; stall and lost lock. While the innovation gate is open the gains follow here, too, and the trim does not look at the load's way. */
static void trim_speed(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    speed_trim_step(d, p);
    protection_check_rotor(d, p);
    if (!observer_gate_is_closed(&d->run.observer)) {
        speed_schedule(&d->run, p);
    }
}

/** The estimator's sign, and the signals while they seem wrong. */
static void follow_estimate(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    estimator_follow(&d->run.estimator, &p->estimator);
    if (drive_is_closed(d) && d->run.observer.wrong_steps != 0u) {
        signals_check(d, p);
    }
}

/** Do signals and motor fit each other? Then the motor's constants at this speed. */
static void update_model(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    if (drive_is_closed(d)) {
        if (d->run.observer.wrong_steps == 0u) { /* else watch_signals() has it */
            signals_check(d, p);
        }
        model_update(d, p);
    } else {
        model_update_in_ramp(d, p);
    }
}

/** Can the motor be what it has shown? */
static void check_model(drive_t *d, const drive_params_t *p, const drive_samples_t *raw UNUSED)
{
    protection_check_model(d, p);
}

/* ---- which half comes when: the only place that knows of the period's length ---- */

#define IN_EVERY(d) 1u
#define IN_CLOSED(d) drive_is_closed(d)

/* Deferred duties: a call is half a slot. */
#define SLOT_OF(call) ((call) >> DEFER_DUTIES)
#define RUNS_FIRST(call) (!DEFER_DUTIES || ((call)&1u) == 0u)
#define RUNS_SECOND(call) (!DEFER_DUTIES || ((call)&1u) != 0u)
#define MARK_OF(slot, call) (DEFER_DUTIES ? 2u * (slot) + ((call)&1u) : (slot))

INLINE uint16_t schedule_is_due(uint16_t ticks)
{
    return (uint16_t)((ticks & (SLOW_EVERY - 1u)) == 0u);
}

/* A slot marks its own number, so that one that came in another's place is noticed. */
#define SCHEDULE_CASE(number, first, first_in, second, second_in) \
    case (number): \
        if (RUNS_FIRST(call) && IN_##first_in(d)) { \
            first(d, p, raw); \
        } \
        if (RUNS_SECOND(call) && IN_##second_in(d)) { \
            second(d, p, raw); \
        } \
        done = (uint16_t)MARK_OF(number##u, call); \
        break;

void schedule_run(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    const uint16_t call = (uint16_t)((d->ticks / SLOW_EVERY) & (SLOW_CALLS - 1u));
    uint16_t done = 0;
    switch (SLOT_OF(call)) {
        SCHEDULE_TABLE(SCHEDULE_CASE)
    default: break; /* there is none */
    }
    SELFTEST_MARK(d, done);
}
