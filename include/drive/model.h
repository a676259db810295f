/* What the running motor teaches about itself, and when it may. */
#ifndef DRIVE_MODEL_H
#define DRIVE_MODEL_H

#include "drive/salient.h"
#include "drive/state.h"

/** R i_q in the format of the filtered back-EMF. */
QM_INLINE voltage_q12_t model_ri(const drive_run_t *run, const drive_params_t *p)
{
    return (int16_t)(qm_mulhi_su(run->control.i_q13.q, run->model.rs_q16) * (1 << p->estimator.rs_exp));
}

/** 1 where the closed loop teaches: it rests until the observer runs, while the speed changes fast, and at the limits of current and voltage. It does
 *  not wait for the hand-over's d current to go: where R, L and Kphi are all wrong, the lock needs it before; what dR i_d puts into Ed passes with
 *  that current. */
QM_INLINE uint16_t model_is_taught(const drive_run_t *run)
{
    const drive_control_t *c = &run->control;
    return (uint16_t)(run->handover.speed_is_preset && observer_is_calm(&run->observer) && qm_size(c->v_q14.q) < c->vq_limit_q14
                      && qm_size(c->ref_q13.q) < c->iq_limit_q13);
}

/** A step of the adaptation, every seldom step. At the end of the ramp, while the estimator is waited for, it may need a truer flux before it can
 *  lock, with flux, R and L all off; the current is nearly all d current there and says nothing of R. */
QM_INLINE void model_learn_step(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    voltage_q12_t ri_q12 = 0;
    if (drive_is_closed(d)) {
        if (!model_is_taught(run)) {
            return;
        }
        ri_q12 = model_ri(run, p);
    } else if (d->state != (uint16_t)DRIVE_RAMP || d->periods == 0u) {
        return; /* nothing turns that the estimator could see */
    } else {
        /* flux alone */
    }
    adaptation_learn(&run->adaptation, &p->adaptation, estimator_emf(&run->estimator), ri_q12);
}

/** The motor's constants follow the speed reference, and what was learnt. Every seldom step in closed loop. */
QM_INLINE void model_update(drive_t *d, const drive_params_t *p)
{
    salient_sees_current(&d->run);
    drive_update_model(&d->run, p, d->run.control.reference_erpm);
}

/** The same in RAMP. */
QM_INLINE void model_update_in_ramp(drive_t *d, const drive_params_t *p)
{
    if (d->state == (uint16_t)DRIVE_RAMP) {
        salient_sees_forced_current(d);
        drive_update_model(&d->run, p, p->end_erpm);
    }
}

#endif
