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

/** Over-voltage at once, under-voltage while anything is on, every eighth period. @param now_q15 unfiltered @param bus_q15 filtered */
QM_INLINE void protection_check_bus(drive_t *d, const drive_params_t *p, int16_t now_q15, int16_t bus_q15)
{
    drive_fault_t found;
    if (now_q15 > p->bus_over_q15) {
        found = FAULT_OVERVOLTAGE;
    } else if (bus_q15 < p->bus_under_q15 && d->state != (uint16_t)DRIVE_STOPPED && d->state != (uint16_t)DRIVE_CALIBRATE) {
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

#define PROTECTION_TURN_SHIFT 4 /* the angle step of a period to that of eight: ls_q16 is L of eight samples */

/** 1 where no flux within the header's tolerances explains the q back-EMF: what dead time, and R and L within theirs, may put into it is taken off first.
 *  With E = Eq as the model sees it, k the change of 1/Kphi and F the most flux: E - (R's part) - (L's part) > F E (1 + k), here divided by F,
 *  with a fifth more of the two parts. Where the motor brakes R i lowers the voltage, and the least R counts. */
QM_INLINE uint16_t protection_flux_is_impossible(const drive_run_t *run, const drive_params_t *p)
{
    dq_t i = run->control.i_q13, emf = estimator_emf(&run->estimator);
    int16_t e_q12 = qm_clamp(qm_sub_limited(qm_abs(emf.q), p->dead_emf_q12), 0, 32767), rs = qm_hi(run->adaptation.rs_q31), more = (int16_t)(p->kfi_impossible - qm_hi(run->adaptation.kfi_q31));
    int16_t r_more = (int16_t)(((i.q ^ emf.q) >= 0) ? p->rs_off_most - rs : rs - p->rs_off_least);
    int16_t ri_q12 = (int16_t)(qm_mulhi_su(qm_abs(i.q), p->adaptation.rs_base_q16) * (1 << p->estimator.rs_exp));
    uint16_t turned_q13 = (uint16_t)((uint16_t)qm_abs(qm_mulhi(i.d, run->estimator.half_step_q16_rad)) << PROTECTION_TURN_SHIFT);
    int16_t li_q12 = (int16_t)((qm_muluu(turned_q13, run->model.ls_q16) >> 16) << p->estimator.ls_exp);
    return (uint16_t)(qm_mulss(e_q12, more) > qm_mulss(ri_q12, r_more) + qm_mulss(li_q12, p->ls_off));
}

/** What the motor has shown against the header must be possible: the flux within its tolerance, and a winding that has gained 60 % of its
 *  resistance is too hot. Every eighth period in closed loop. */
QM_INLINE void protection_check_model(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    uint16_t strong = protection_flux_is_impossible(run, p);
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
