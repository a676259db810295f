/* The start without the estimator: charge the drivers, align the rotor, accelerate it by the forced angle. */
#ifndef DRIVE_STARTUP_H
#define DRIVE_STARTUP_H

#include "drive/handover.h"
#include "drive/protection.h"

/** The low sides conduct and charge the high sides' drivers. @return the next state */
QM_INLINE drive_state_t startup_bootstrap(drive_t *d, const drive_params_t *p)
{
    protection_check_current(d, p);
    d->periods++;
    if (!d->command.run) {
        return DRIVE_STOPPED;
    }
    return (d->periods >= p->bootstrap_periods) ? DRIVE_ALIGN : DRIVE_BOOTSTRAP;
}

/** The vector turns by 90 degrees during the first half of ALIGN, so that no rotor position is a dead point. */
QM_INLINE void startup_sweep(drive_t *d, const drive_params_t *p)
{
    d->forced.angle_q32 = (d->direction >= 0) ? qm_turn_add(d->forced.angle_q32, p->align_sweep_q32)
                                              : qm_turn_sub(d->forced.angle_q32, p->align_sweep_q32);
}

/** The forced angle while the rotor is aligned and accelerated. */
QM_INLINE void startup_forced_step(drive_t *d, const drive_params_t *p)
{
    if (d->state == (uint16_t)DRIVE_ALIGN) {
        d->periods++;
        if (d->periods <= (p->align_periods >> 1)) {
            startup_sweep(d, p);
        } else if (d->periods >= p->align_periods) {
            drive_enter(d, DRIVE_RAMP);
        }
        d->angle = forced_angle(&d->forced);
    } else {
        (void)forced_angle_tick(&d->forced, &p->forced, d->direction);
        d->angle = forced_angle(&d->forced);
    }
}

/** A period of ALIGN or RAMP, after the estimator. Letting go is harmless at these speeds. */
QM_INLINE void startup_step(drive_t *d, const drive_params_t *p)
{
    startup_forced_step(d, p);
    if (!d->command.run) {
        drive_enter(d, DRIVE_STOPPED);
    }
}

#endif
