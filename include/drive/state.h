/* The gate: the only place that writes the drive's state, and the only one that raises and clears faults. */
#ifndef DRIVE_STATE_H
#define DRIVE_STATE_H

#include "drive/drive.h"

/** Enters a state; its clock begins anew. While a fault is kept, every way leads to FAULT: only drive_clear_fault() opens it. */
NOINLINE void drive_enter(drive_t *d, drive_state_t next)
{
    uint16_t state = (uint16_t)((d->fault == (uint16_t)FAULT_NONE) ? next : DRIVE_FAULT);
    d->state = state;
    SELFTEST_KEEP(d, state, state);
    d->periods = 0;
}

/** The last word of a period: a fault that a trap has raised in the middle of it outlives what the period has entered since.
 *  @return 1 when the outputs must be off */
QM_INLINE uint16_t drive_settle(drive_t *d)
{
    if (d->fault == (uint16_t)FAULT_NONE) {
        return 0;
    }
    drive_enter(d, DRIVE_FAULT);
    return 1;
}

/** Stops at once and keeps the code of the first fault. Any context: background, interrupt, trap. */
NOINLINE void drive_raise(drive_t *d, drive_fault_t fault)
{
    d->command.run = 0;
    if (d->fault == (uint16_t)FAULT_NONE) {
        d->fault = (uint16_t)fault;
        SELFTEST_KEEP(d, fault, fault);
    }
    drive_enter(d, DRIVE_FAULT);
}

/** Forgets the fault. Control interrupt only. @return the next state: STOPPED, or the calibration that it has interrupted */
QM_INLINE drive_state_t drive_clear_fault(drive_t *d)
{
    d->fault = (uint16_t)FAULT_NONE;
    SELFTEST_KEEP(d, fault, FAULT_NONE);
    return d->calibration.done ? DRIVE_STOPPED : DRIVE_CALIBRATE;
}

/** The direction of the run: of the target, or of the rotor that was caught. */
QM_INLINE void drive_turns(drive_t *d, int16_t direction)
{
    d->direction = direction;
    SELFTEST_KEEP(d, direction, direction);
}

/** 1 while the bridge switches under the law's control: ALIGN to STOPPING, in one comparison. */
QM_INLINE uint16_t drive_is_running(const drive_t *d)
{
    return (uint16_t)((uint16_t)(d->state - (uint16_t)DRIVE_ALIGN) <= (uint16_t)DRIVE_STOPPING - (uint16_t)DRIVE_ALIGN);
}

/** 1 with the forced angle in command, ALIGN or RAMP, of the states in which the bridge switches. */
QM_INLINE uint16_t drive_is_forced(const drive_t *d)
{
    return (uint16_t)(d->state <= (uint16_t)DRIVE_RAMP);
}

/** 1 with the estimator's angle in command: CLOSED or STOPPING. */
QM_INLINE uint16_t drive_is_closed(const drive_t *d)
{
    return (uint16_t)(MODE_CLOSES_LOOP && (uint16_t)(d->state - (uint16_t)DRIVE_CLOSED) <= (uint16_t)DRIVE_STOPPING - (uint16_t)DRIVE_CLOSED);
}

/** 1 while the bridge conducts, its drivers' charge with it, BOOTSTRAP to STOPPING: drive_outputs() are not off. In one comparison. */
QM_INLINE uint16_t drive_conducts(const drive_t *d)
{
    return (uint16_t)(d->fault == (uint16_t)FAULT_NONE
                      && (uint16_t)(d->state - (uint16_t)DRIVE_BOOTSTRAP) <= (uint16_t)DRIVE_STOPPING - (uint16_t)DRIVE_BOOTSTRAP);
}

/** What drives the bridge (outputs_t) in the drive's present state. */
QM_INLINE uint16_t drive_outputs(const drive_t *d)
{
    if (d->fault != (uint16_t)FAULT_NONE) {
        return (uint16_t)OUTPUTS_OFF;
    }
    if (drive_is_running(d)) {
        return (uint16_t)OUTPUTS_PWM;
    }
    return (uint16_t)((d->state == (uint16_t)DRIVE_BOOTSTRAP) ? OUTPUTS_BOOTSTRAP : OUTPUTS_OFF);
}

#endif
