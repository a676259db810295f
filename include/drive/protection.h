/* Protection: the conditions that the control interrupt finds itself and that end in a fault. */
#ifndef DRIVE_PROTECTION_H
#define DRIVE_PROTECTION_H

#include "drive/model.h"

/** Over-current of any phase, every period with the bridge on. */
QM_INLINE void protection_check_current(drive_t *d, const drive_params_t *p)
{
    const int16_t limit = p->overcurrent_q13;
    if (qm_abs(d->phases_q13.a) > limit || qm_abs(d->phases_q13.b) > limit || qm_abs(d->phases_q13.c) > limit) {
        drive_raise(d, FAULT_OVERCURRENT_SW);
    }
}

/** Over-voltage at once, under-voltage filtered, both while anything is on: at rest a rotor may charge the bus. Every eighth period. @param now_q15 unfiltered @param bus_q15 filtered */
QM_INLINE void protection_check_bus(drive_t *d, const drive_params_t *p, int16_t now_q15, int16_t bus_q15)
{
    drive_fault_t found;
    if (drive_outputs(d) == (uint16_t)OUTPUTS_OFF) {
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

#define PROTECTION_PHASE_SHIFT 6 /* 250 sums of a current above the trip level fit a word */
#define PROTECTION_OPEN_SHIFT 2  /* a phase with less than a quarter of the largest current is open */

/** Which signal is wrong: currents that do not fit the motor, with or without a phase that carries hardly any. */
QM_INLINE drive_fault_t protection_wrong_signal(const drive_run_t *run)
{
    uint16_t most = 0, least = 0xFFFFu, n;
    for (n = 0; n < 3u; n++) {
        most = (run->phase_sums[n] > most) ? run->phase_sums[n] : most;
        least = (run->phase_sums[n] < least) ? run->phase_sums[n] : least;
    }
    return (least < (most >> PROTECTION_OPEN_SHIFT)) ? FAULT_OPEN_PHASE : FAULT_CURRENT_SENSOR;
}

/** Innovations of the load observer that no load explains, for they do not end: the voltage equation does not hold with what is measured.
 *  Every eighth period in closed loop. */
QM_INLINE void protection_check_signals(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    uint16_t a = (uint16_t)qm_abs(d->phases_q13.a), b = (uint16_t)qm_abs(d->phases_q13.b), c = (uint16_t)qm_abs(d->phases_q13.c);
    if (run->observer.wrong_steps == 0u) {
        run->phase_sums[0] = 0;
        run->phase_sums[1] = 0;
        run->phase_sums[2] = 0;
        return;
    }
    run->phase_sums[0] = (uint16_t)(run->phase_sums[0] + (a >> PROTECTION_PHASE_SHIFT));
    run->phase_sums[1] = (uint16_t)(run->phase_sums[1] + (b >> PROTECTION_PHASE_SHIFT));
    run->phase_sums[2] = (uint16_t)(run->phase_sums[2] + (c >> PROTECTION_PHASE_SHIFT));
    if (run->observer.wrong_steps > p->wrong_steps) {
        drive_raise(d, protection_wrong_signal(run));
    }
}

/** What the motor has shown against the header must be possible: magnets do not gain a third of flux, which counts where no resistance is mistaken
 *  for it, and a winding that has gained 60 % of its resistance is too hot. Every eighth period in closed loop. */
QM_INLINE void protection_check_model(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    uint16_t strong = (uint16_t)(qm_hi(run->adaptation.kfi_q31) < p->kfi_impossible
                                 && qm_abs(model_ri(run, p)) < (qm_abs(estimator_emf(&run->estimator).q) >> 1));
    uint16_t hot = (uint16_t)(qm_hi(run->adaptation.rs_q31) >= p->adaptation.rs_most);
    run->impossible_steps = (uint16_t)((strong || hot) ? run->impossible_steps + 1u : 0u);
    if (run->impossible_steps > p->impossible_steps) {
        drive_raise(d, strong ? FAULT_BUS_SENSOR : FAULT_OVERTEMPERATURE);
    }
}

/** Stall and lost lock: conditions that must not last. Every eighth period in closed loop. */
QM_INLINE void protection_check_rotor(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    int16_t speed = qm_abs(estimator_speed(&run->estimator)), standing = (int16_t)(p->minimum_erpm >> 1);
    int16_t least = (int16_t)(qm_abs(run->control.reference_erpm) >> 1);
    dq_t emf = estimator_emf(&run->estimator);
    uint16_t lost = (uint16_t)(speed >= standing && qm_abs(emf.d) > qm_abs(emf.q)); /* of a standing rotor its direction says nothing */

    if (least < standing) {
        least = standing;
    }
    run->stall_steps = (uint16_t)((speed < least) ? run->stall_steps + 1u : 0u);
    if (lost || speed > p->overspeed_erpm) {
        run->lost_lock_steps = (uint16_t)(run->lost_lock_steps + 2u);
    } else if (run->lost_lock_steps != 0u) { /* a lost estimator slips past the rotor: only now and then Ed is the larger one */
        run->lost_lock_steps--;
    } else {
        /* in lock */
    }
    if (run->stall_steps > p->stall_steps || run->lost_lock_steps > p->lost_lock_steps) {
        drive_raise(d, (run->stall_steps > p->stall_steps) ? FAULT_STALL : FAULT_LOST_LOCK);
    }
}

#endif
