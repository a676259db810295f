/* The states with the bridge off or charging its drivers. */
#ifndef DRIVE_IDLE_H
#define DRIVE_IDLE_H

#include "drive/calibration.h"
#include "drive/catch.h"

/** A period with the bridge off or charging its drivers, after its duties: each state says which comes next, the gate lets it in or not. */
QM_INLINE void idle_step(drive_t *d, const drive_params_t *p, int16_t i_a, int16_t i_b)
{
    uint16_t next = d->state;
    switch (next) {
    case DRIVE_CALIBRATE:
        next = (uint16_t)calibration_step(d, p, i_a, i_b);
        break;
    case DRIVE_STOPPED:
        d->run.estimator.omega_filtered_q16 = 0; /* nothing is known of a rotor that coasts */
        d->run.control.reference_erpm = 0;
        if (d->command.run) {
            next = (uint16_t)(catch_bus_is_high(d, p) ? DRIVE_CATCH : DRIVE_BOOTSTRAP);
        }
        break;
    case DRIVE_BOOTSTRAP:
        next = (uint16_t)startup_bootstrap(d, p);
        if (next == (uint16_t)DRIVE_BOOTSTRAP && d->run.catching.step != (uint16_t)CATCH_NO_LOOK && catch_look(d, p)) {
            next = (uint16_t)DRIVE_CATCH;
        }
        break;
    case DRIVE_CATCH:
        next = (uint16_t)catch_pass(d, p);
        break;
    default: /* FAULT; without a fault when the background raised one while it was cleared here */
        if (d->command.clear_fault || d->fault == (uint16_t)FAULT_NONE) {
            calibration_restart(&d->calibration);
            next = (uint16_t)drive_clear_fault(d);
        }
        break;
    }
    d->command.clear_fault = 0;
    if (d->state != next) {
        drive_enter(d, (drive_state_t)next);
    }
}

#endif
