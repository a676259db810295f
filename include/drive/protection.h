/* Protection: the conditions that the control interrupt finds itself and that end in a fault. */
#ifndef DRIVE_PROTECTION_H
#define DRIVE_PROTECTION_H

#include "drive/limits.h"
#include "drive/model.h"
#include "drive/salient.h"

/** Over-current of any phase, every period with the bridge on. @return 1 then: the law must not run */
QM_INLINE uint16_t protection_check_current(drive_t *d, const drive_params_t *p)
{
    const int16_t limit = p->overcurrent_q13;
    if (qm_beyond(d->phases_q13.a, limit) || qm_beyond(d->phases_q13.b, limit) || qm_beyond(d->phases_q13.c, limit)) {
        drive_raise(d, FAULT_OVERCURRENT_SW);
        return 1;
    }
    return 0;
}

#define PROTECTION_BUS_END_Q15 32640 /* the converter's last steps: more cannot be told from a broken signal */

/** Over-voltage at once, under-voltage filtered, both while anything is on: at rest a rotor may charge the bus, but no further than what can be
 *  measured. Every slow step. @param now_q15 unfiltered @param bus_q15 filtered */
QM_INLINE void protection_check_bus(drive_t *d, const drive_params_t *p, int16_t now_q15, int16_t bus_q15)
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

#define PROTECTION_PHASE_SHIFT 6 /* 250 sums of a current above the trip level fit a word */
#define PROTECTION_OPEN_SHIFT 2  /* a phase with less than a quarter of the largest current is open */

/** A phase's sum with this period's current. */
QM_INLINE uint16_t protection_phase_sum(uint16_t sum, current_q13_t i_q13)
{
    return (uint16_t)(sum + ((uint16_t)qm_size(i_q13) >> PROTECTION_PHASE_SHIFT));
}

/** Which signal is wrong: currents that do not fit the motor, with or without a phase that carries hardly any. */
QM_INLINE drive_fault_t protection_wrong_signal(const drive_run_t *run)
{
    uint16_t most = 0, least = 0xFFFFu, n;
    for (n = 0; n < 3u; n++) { /* wcet: at most 3 turns */
        most = (run->phase_sums[n] > most) ? run->phase_sums[n] : most;
        least = (run->phase_sums[n] < least) ? run->phase_sums[n] : least;
    }
    return (least < (most >> PROTECTION_OPEN_SHIFT)) ? FAULT_OPEN_PHASE : FAULT_CURRENT_SENSOR;
}

#define PROTECTION_DEAD_TIMES 5   /* emf_least_q12 is a fifth of what dead time takes */
#define PROTECTION_UNEXPLAINED 2u /* as many wrong innovations */

/** R of the header times a current, Q12. @param i_q13 not negative */
QM_INLINE voltage_q12_t protection_ri(const drive_params_t *p, int16_t i_q13)
{
    return (int16_t)(qm_mulhi_su(i_q13, p->adaptation.rs_base_q16) * (1 << p->estimator.rs_exp));
}

/** 1 where neither a back-EMF in its direction nor R off by all of it nor dead time explains the voltage: one is commanded that drives no current. */
QM_INLINE uint16_t protection_voltage_is_unexplained(const drive_run_t *run, const drive_params_t *p)
{
    dq_t i = run->control.i_q13, emf = estimator_emf(&run->estimator);
    int16_t unturned_q12 = (int16_t)(qm_size(emf.d) - qm_size(emf.q)); /* beyond a back-EMF in its direction */
    /* fits a word: no current flows for which R takes more voltage than there is */
    uint16_t ri_q12 = (uint16_t)((uint16_t)protection_ri(p, qm_size(i.d)) + (uint16_t)protection_ri(p, qm_size(i.q)));
    uint16_t dead_q12 = (uint16_t)(PROTECTION_DEAD_TIMES * p->adaptation.emf_least_q12);
    return (uint16_t)(unturned_q12 > 0 && (uint16_t)unturned_q12 > ri_q12 + dead_q12);
}

#define PROTECTION_BLUR_SHIFT 2 /* dead time may turn an estimate by a quarter of the back-EMF that it is made from, and more below */

/** 1 near the end of a stop, where what dead time leaves can make innovations that do not end: the currents of a rotor that slows down by
 *  itself are too small to tell its sign. A wrong signal would ask for more. */
QM_INLINE uint16_t protection_stop_is_blurred(const drive_t *d, const drive_params_t *p)
{
    return (uint16_t)(d->state == (uint16_t)DRIVE_STOPPING && !d->command.run
                      && (qm_size(estimator_emf(&d->run.estimator).q) >> PROTECTION_BLUR_SHIFT) < p->dead_emf_q12
                      && qm_size(d->run.control.ref_q13.q) < p->id_off_q13);
}

/** Innovations of the load observer that no load explains, for they do not end, or voltage that nothing explains: the voltage equation does not hold
 *  with what is measured. In closed loop every seldom step, and every slow one while something is wrong: the phases' sums must not meet the same
 *  angles of each turn. */
NOINLINE void protection_check_signals(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    if (protection_voltage_is_unexplained(run, p)) {
        run->observer.wrong_steps = (uint16_t)(run->observer.wrong_steps + PROTECTION_UNEXPLAINED);
    }
    if (run->observer.wrong_steps == 0u) {
        run->phase_sums[0] = 0;
        run->phase_sums[1] = 0;
        run->phase_sums[2] = 0;
        return;
    }
    run->phase_sums[0] = protection_phase_sum(run->phase_sums[0], d->phases_q13.a);
    run->phase_sums[1] = protection_phase_sum(run->phase_sums[1], d->phases_q13.b);
    run->phase_sums[2] = protection_phase_sum(run->phase_sums[2], d->phases_q13.c);
    if (run->observer.wrong_steps <= p->wrong_steps) {
        return;
    }
    if (protection_stop_is_blurred(d, p)) {
        drive_enter(d, DRIVE_STOPPED); /* as at a stop's end: the bridge goes off and the rotor runs out */
    } else {
        drive_raise(d, protection_wrong_signal(run));
    }
}

#define PROTECTION_TURN_SHIFT 4 /* the angle step of a period to that of eight: ls_q16 is L of eight samples */

/** 1 where no flux within the header's tolerances explains the q back-EMF: what dead time, and R and L within theirs, may put into it is taken off first.
 *  With E = Eq as the model sees it, k the change of 1/Kphi, F the most flux and V_dead what dead time makes of it:
 *  E - V_dead - (R's part) - (L's part) > F E (1 + k), here divided by F, with a fifth more of the three parts.
 *  Where the motor brakes R i lowers the voltage, and the least R counts. */
QM_INLINE uint16_t protection_flux_is_impossible(const drive_run_t *run, const drive_params_t *p)
{
    dq_t i = run->control.i_q13, emf = estimator_emf(&run->estimator);
    int16_t e_q12 = qm_size(emf.q), rs = qm_hi(run->adaptation.rs_q31), more = (int16_t)(p->kfi_impossible - qm_hi(run->adaptation.kfi_q31));
    int16_t r_more = (int16_t)(((i.q ^ emf.q) >= 0) ? p->rs_off_most - rs : rs - p->rs_off_least);
    int16_t ri_q12 = protection_ri(p, qm_size(i.q));
    uint16_t turned_q13 = (uint16_t)((uint16_t)qm_size(qm_mulhi(i.d, run->estimator.half_step_q16_rad)) << PROTECTION_TURN_SHIFT);
    uint32_t li_q12 = (qm_muluu(turned_q13, run->model.ls_q16) >> 16) << p->estimator.ls_exp;
    int32_t parts_q27 = qm_mulss(ri_q12, r_more) + qm_mulss((int16_t)((li_q12 > 32767ul) ? 32767ul : li_q12), p->ls_off);
    return (uint16_t)(qm_mulss(e_q12, more) - ((int32_t)p->dead_emf_q12 << 15) > parts_q27);
}

/** What the motor has shown against the header must be possible: the flux within its tolerance, and a winding that has gained 60 % of its
 *  resistance is too hot. Every seldom step in closed loop. */
NOINLINE void protection_check_model(drive_t *d, const drive_params_t *p)
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

#define STALL_FALL 4u /* steps that a fast one takes back */

#define PROBE_WAIT_STEPS 13    /* the rotor seems to turn for 20 ms before a probe */
#define PROBE_STEPS 25         /* a probe takes 40 ms: more than the estimator's filters at the lowest speed */
#define PROBE_DIP_STEPS 6      /* or soon after a speed 10 ms below three quarters of the reference: no ripple lasts so long */
#define PROBE_PAUSE_STEPS 3125 /* five seconds from one to the next */
#define PROBE_SLOPE_SHIFT 3    /* the largest current takes 8 steps, so that the estimate does not jump */
#define PROBE_MOST_Q15 22528   /* of the largest current, so that as much q current is left */
#if MOTOR_SALIENCY_UH
#define PROBE_LEAST_Q15 9830 /* 0.3: such a d current takes of a salient motor's torque, too */
#else
#define PROBE_LEAST_Q15 14648 /* 1/sqrt(5): takes a tenth of the largest q current, and half of a standing rotor's estimate */
#endif

/** 1 where a resistance within the header's tolerance and dead time would explain the whole back-EMF: the rotor may stand, for a voltage in phase
 *  with the current is both. */
QM_INLINE uint16_t protection_rotor_is_doubtful(const drive_run_t *run, const drive_params_t *p)
{
    int16_t r_more = (int16_t)(p->rs_off_most - qm_hi(run->adaptation.rs_q31));
    int16_t less_q12 = (int16_t)(qm_size(estimator_emf(&run->estimator).q) - p->adaptation.emf_least_q12);
    return (uint16_t)(less_q12 <= qm_hi(2 * qm_mulss(protection_ri(p, qm_size(run->control.i_q13.q)), r_more)));
}

/** The most d current of a probe: it leaves the q current that flows, but for a tenth of the largest. A salient motor needs more q current beside
 *  it: half of each step's change is taken, which comes to the current that fits. */
QM_INLINE current_q13_t protection_probe_most(const drive_run_t *run, const drive_params_t *p)
{
    int16_t most = limits_beside(p, salient_current_beside(run, p, run->probe_most_q13));
    /* products in C: constants */
    most = qm_clamp_called(most, (int16_t)(((int32_t)p->current_max_q13 * PROBE_LEAST_Q15) >> 15),
                           (int16_t)(((int32_t)p->current_max_q13 * PROBE_MOST_Q15) >> 15));
#if MOTOR_SALIENCY_UH
    most = (int16_t)((most + run->probe_most_q13) / 2);
#endif
    return most;
}

/** Speed along the direction below which the rotor counts as stalled: half the reference, or of a low one half the minimum speed. */
NOINLINE speed_erpm_t protection_least_speed(const drive_run_t *run, const drive_params_t *p)
{
    int16_t least = (int16_t)(qm_size(run->control.reference_erpm) >> 1), standing = (int16_t)(p->minimum_erpm >> 1);
    return (least < standing) ? standing : least;
}

/** Steps of a dip; those of the probe's own dip stay beyond PROBE_DIP_STEPS until it is over. */
QM_INLINE void protection_count_dip(drive_run_t *run, uint16_t dips)
{
    if (!dips) {
        run->dip_steps = 0;
    } else if (run->dip_steps <= PROBE_DIP_STEPS) {
        run->dip_steps++;
    } else {
        /* the probe's own */
    }
}

/** Where the rotor may stand, as much d current as q current: a standing rotor's estimate, (Eq - Ed)/Kphi of what R i leaves, falls to nothing and is
 *  a stall; a turning one does not care. It begins when the rotor seems to turn, waits for the stall while E has the current's direction, and comes
 *  again: soon after a dip of the speed.
 *  Every seldom step in closed loop. */
QM_INLINE void protection_probe_rotor(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    int16_t along = along_direction(d, estimator_speed(&run->estimator)), reference = qm_size(run->control.reference_erpm);
    uint16_t doubtful = (uint16_t)(run->handover.id_q13 == 0 && protection_rotor_is_doubtful(run, p));
    uint16_t seems_to_turn = (uint16_t)(along >= protection_least_speed(run, p));
    dq_t emf = estimator_emf(&run->estimator);
    uint16_t turns = (uint16_t)(seems_to_turn || qm_size(emf.d) < (qm_size(emf.q) >> 2)), steps = run->probe_steps;
    int16_t id_q13 = 0, slope = (int16_t)(p->current_max_q13 >> PROBE_SLOPE_SHIFT);

    if (steps < PROBE_WAIT_STEPS) {
        steps = (uint16_t)((doubtful && seems_to_turn) ? steps + 1u : 0u);
        run->probe_most_q13 = protection_probe_most(run, p);
    } else if (steps < PROBE_WAIT_STEPS + PROBE_STEPS) {
        id_q13 = qm_clamp(qm_size(run->control.ref_q13.q), 0, run->probe_most_q13);
        run->dip_steps = PROBE_DIP_STEPS + 1u; /* a heavy load dips for want of the probe's current: none counts before it is over */
        steps = (uint16_t)(doubtful ? steps + turns : PROBE_WAIT_STEPS + PROBE_STEPS);
    } else {
        protection_count_dip(run, (uint16_t)(along < reference - (reference >> 2)));
        steps = (uint16_t)((steps < PROBE_PAUSE_STEPS && run->dip_steps != PROBE_DIP_STEPS) ? steps + 1u : 0u);
    }
    run->probe_steps = steps;
    run->probe_id_q13 = qm_clamp_called(id_q13, (int16_t)(run->probe_id_q13 - slope), (int16_t)(run->probe_id_q13 + slope));
}

/** Stall and lost lock: conditions that must not last. Every rare step in closed loop. */
QM_INLINE void protection_check_rotor(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    int16_t along = along_direction(d, estimator_speed(&run->estimator)), speed = qm_size(along), standing = (int16_t)(p->minimum_erpm >> 1);
    dq_t emf = estimator_emf(&run->estimator);

    if (along < protection_least_speed(run, p)) {
        run->stall_steps++;
    } else { /* of a rotor that only jerks the estimate is fast now and then */
        run->stall_steps = (uint16_t)((run->stall_steps > STALL_FALL) ? run->stall_steps - STALL_FALL : 0u);
    }
    /* of a standing rotor the direction of its back-EMF says nothing */
    if (speed > p->overspeed_erpm || (speed >= standing && qm_size(emf.d) > qm_size(emf.q))) {
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
