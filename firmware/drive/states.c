/* The one machine: the drive's states, what each does on entry and in a step, and which may follow which. */
#include "drive/states.h"

#include "drive/drive.h"
#include "drive/held.h"
#include "drive/limits.h"
#include "drive/speed.h"

#define BIT_OF(next, reason) | (1u << (uint16_t)DRIVE_##next)
#define MASK_FROM(name, meaning) (uint16_t)(0u TRANSITIONS_FROM_##name(BIT_OF)),

/* A bit for each state that may follow. */
static const uint16_t may_follow[DRIVE_STATE_COUNT] = { DRIVE_STATE_TABLE(MASK_FROM) };

uint16_t drive_may_follow(uint16_t state, drive_state_t next)
{
    return (uint16_t)(state < (uint16_t)DRIVE_STATE_COUNT && ((may_follow[state] >> (uint16_t)next) & 1u) != 0u);
}

/** The one place that writes the state. */
static INLINE void states_write(drive_t *d, drive_state_t next)
{
    d->state = (uint16_t)next;
    SELFTEST_KEEP(d, state, next);
    d->periods = 0;
}

INLINE void drive_raise_at_once(drive_t *d, drive_fault_t fault)
{
    d->command.run = 0;
    if (d->fault == (uint16_t)FAULT_NONE) {
        d->fault = (uint16_t)fault;
        SELFTEST_KEEP(d, fault, fault);
    }
    states_write(d, DRIVE_FAULT);
}

NOINLINE void drive_raise(drive_t *d, drive_fault_t fault)
{
    drive_raise_at_once(d, fault);
}

void drive_enter(drive_t *d, drive_state_t next)
{
    if (d->fault != (uint16_t)FAULT_NONE) {
        states_write(d, DRIVE_FAULT);
    } else if (drive_may_follow(d->state, next)) {
        states_write(d, next); /* a trap between the two lines: drive_latch_fault() has the last word */
    } else {
        drive_raise(d, FAULT_SELFTEST);
    }
}

uint16_t drive_latch_fault(drive_t *d)
{
    if (d->fault == (uint16_t)FAULT_NONE) {
        return 0;
    }
    states_write(d, DRIVE_FAULT);
    return 1;
}

drive_state_t drive_clear_fault(drive_t *d)
{
    d->fault = (uint16_t)FAULT_NONE;
    SELFTEST_KEEP(d, fault, FAULT_NONE);
    return d->calibration.done ? DRIVE_STOPPED : DRIVE_CALIBRATE;
}

void drive_set_direction(drive_t *d, int16_t direction)
{
    d->direction = direction;
    SELFTEST_KEEP(d, direction, direction);
}

INLINE uint16_t drive_is_running(const drive_t *d)
{
    return (uint16_t)((uint16_t)(d->state - (uint16_t)DRIVE_ALIGN) <= (uint16_t)DRIVE_STOPPING - (uint16_t)DRIVE_ALIGN);
}

INLINE uint16_t drive_is_forced(const drive_t *d)
{
    return (uint16_t)(d->state <= (uint16_t)DRIVE_RAMP);
}

INLINE uint16_t drive_is_closed(const drive_t *d)
{
    return (uint16_t)(MODE_CLOSES_LOOP && (uint16_t)(d->state - (uint16_t)DRIVE_CLOSED) <= (uint16_t)DRIVE_STOPPING - (uint16_t)DRIVE_CLOSED);
}

uint16_t drive_conducts(const drive_t *d)
{
    return (uint16_t)(d->fault == (uint16_t)FAULT_NONE && (uint16_t)(d->state - (uint16_t)DRIVE_BOOTSTRAP) <= (uint16_t)DRIVE_STOPPING - (uint16_t)DRIVE_BOOTSTRAP);
}

INLINE uint16_t drive_shorts(const drive_t *d)
{
    return (uint16_t)((STOP_MODE) == STOP_SHORT && d->state == (uint16_t)DRIVE_BRAKE);
}

uint16_t drive_outputs(const drive_t *d)
{
    if (d->fault != (uint16_t)FAULT_NONE) {
        return (uint16_t)OUTPUTS_OFF;
    }
    if (drive_is_running(d)) {
        return (uint16_t)OUTPUTS_PWM;
    }
    return (uint16_t)((d->state == (uint16_t)DRIVE_BOOTSTRAP || (drive_shorts(d) && d->periods != 0u)) ? OUTPUTS_BOOTSTRAP : OUTPUTS_OFF);
}

INLINE int16_t along_direction(const drive_t *d, int16_t x)
{
    return qm_with_sign(x, d->direction);
}

void drive_zero(void *object, uint16_t size)
{
    uint8_t *byte = object;
    uint16_t left = size;
    do {
        *byte = 0;
        byte++;
        left--;
    } while (left != 0u);
}

void drive_init(drive_t *d, const drive_params_t *p)
{
    drive_zero(d, sizeof *d);
    d->direction = 1;
    SELFTEST_KEEP(d, direction, 1);
    SELFTEST_KEEP(d, state, DRIVE_CALIBRATE); /* 0, as all of it: drive_enter() would find nothing else to do */
    SELFTEST_KEEP(d, fault, FAULT_NONE);
    SELFTEST_KEEP(d, offset_a, 0);
    SELFTEST_KEEP(d, offset_b, 0);
    d->bus_q31 = (int32_t)p->bus_nominal_q15 * 65536;
    heat_init(d, p);
    bus_update_gain(d, p, p->bus_nominal_q15);
    bus_update_voltage_limit(d, p);
    drive_update_model(&d->run, p, p->end_erpm, p->end_erpm);
}

void drive_start(drive_t *d, const drive_params_t *p, int16_t direction)
{
    drive_run_t *run = &d->run;
    if (d->state != (uint16_t)DRIVE_STOPPED || d->command.run) {
        return;
    }
    drive_set_direction(d, direction);
    drive_zero(&d->forced, sizeof d->forced);
    drive_zero(&d->dead, sizeof d->dead);
    drive_zero(&d->dead_second, sizeof d->dead_second);
    drive_zero(run, sizeof *run);
    d->angle = 0;
    drive_update_model(run, p, p->end_erpm, p->end_erpm);
    run->control.iq_limit_q13 = p->current_max_q13;
    if (p->supply_limit_q13 != 0) {
        run->control.supply_q13 = p->current_max_q13;
    }
    run->control.brake_limit_q13 = limits_asked_most(p);
    d->forced.speed_q10 = p->align_speed_q10;
    d->frame = trig_sincos(0);
    catch_begin(run, p);
    mode_start(d, p);
    d->command.run = 1;
}

/** Leaves a state whose bridge is off, or is left by a fault. Called nowhere else, so that catch.c's wcet line can name this way out. */
static void idle_move(drive_t *d, drive_state_t next)
{
    drive_enter(d, next);
}

/** 1 where it is cleared, and without a fault: the background raised one while it was cleared here. Where a bit of it has flipped, its copy knows. */
static uint16_t states_fault_is_over(const drive_t *d)
{
    return (uint16_t)((d->command.clear_fault && !heat_holds(d)) || (d->fault == (uint16_t)FAULT_NONE && SELFTEST_KEPT(d, fault, FAULT_NONE)));
}

void idle_step(drive_t *d, const drive_params_t *p, int16_t i_a, int16_t i_b)
{
    uint16_t next = d->state;
    switch (next) {
    case DRIVE_CALIBRATE: next = (uint16_t)calibration_step(d, p, i_a, i_b); break;
    case DRIVE_STOPPED:
        d->run.estimator.omega_filtered_q16 = 0; /* nothing is known of a rotor that coasts */
        d->run.control.reference_erpm = 0;
        held_forget(&d->run.held);
        if (d->command.run) {
            next = (uint16_t)(catch_waits_for_bus(d, p) ? DRIVE_CATCH : DRIVE_BOOTSTRAP);
        }
        break;
    case DRIVE_BOOTSTRAP:
        next = (uint16_t)startup_bootstrap(d, p);
        if (next == (uint16_t)DRIVE_BOOTSTRAP && d->run.catching.phase != (uint16_t)CATCH_NO_LOOK && catch_look(d, p)) {
            next = (uint16_t)DRIVE_CATCH;
        }
        break;
    case DRIVE_CATCH: next = (uint16_t)catch_pass(d, p); break;
    case DRIVE_FAULT:
    case DRIVE_BRAKE:
    default:
        if (drive_shorts(d)) {
            next = (uint16_t)speed_brake_step(d, p);
        } else if (states_fault_is_over(d)) {
            calibration_restart(&d->calibration);
            next = (uint16_t)drive_clear_fault(d);
        }
        break;
    }
    d->command.clear_fault = 0;
    if (d->state != next) {
        idle_move(d, (drive_state_t)next);
    }
}

void states_start_step(drive_t *d, const drive_params_t *p)
{
    d->run.control.sample_shift_q13 = 0; /* as at rest, or a bit of it that flipped would stay */
    if (!d->command.run) {               /* letting go is harmless at these speeds */
        drive_enter(d, DRIVE_STOPPED);
    } else if (d->state == (uint16_t)DRIVE_ALIGN) {
        startup_align(d, p);
    } else {
        handover_wait(d, p);
    }
}

void states_rotor_step(drive_t *d, const drive_params_t *p)
{
    switch (d->state) {
    case DRIVE_RAMP: handover_step(d, p); break;
    case DRIVE_STOPPING: speed_turn_round(d, p); break;
    case DRIVE_CATCH: catch_step(d, p); break;
    default: break; /* the others are left elsewhere */
    }
}
