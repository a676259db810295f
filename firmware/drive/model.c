/* What the running motor teaches about itself, and what a salient motor adds. */
#include "drive/model.h"

#include "control/tuned.h"
#include "drive/drive.h"

void salient_model(drive_run_t *run UNUSED, const drive_params_t *p UNUSED)
{
#if MOTOR_SALIENCY_UH
    salience_update(&run->salience, p->salience_q13, qm_hi(run->adaptation.kfi_q31));
    run->model.inv_kfi = adaptation_kfi(salience_kfi(&run->salience, run->model.inv_kfi));
#endif
}

/** In closed loop the control's frame is the rotor's. What the hand-over has of current along the flux counts half more, as with magnets a fifth
 *  weaker than the header's: with too much flux in its model the estimator loses its lock. Before drive_update_model(). */
static void salient_sees_current(drive_run_t *run UNUSED)
{
#if MOTOR_SALIENCY_UH
    int16_t id_q13 = run->control.i_q13.d;
    run->salience.id_q13 = (int16_t)((id_q13 > 0) ? id_q13 + (id_q13 >> 1) : id_q13);
#endif
}

/** On the forced angle the estimator's frame is the rotor's, as soon as it agrees. There is more such current, so it counts three quarters more: the
 *  estimator finds its lock with half of the flux in its model, but not with half too much. Before drive_update_model(). */
static void salient_sees_forced_current(drive_t *d UNUSED)
{
#if MOTOR_SALIENCY_UH
    drive_run_t *run = &d->run;
    sincos_t turn;
    int16_t id_q13;
    turn = trig_sincos((angle_t)(d->angle - estimator_next_angle(&run->estimator)));
    id_q13 = (int16_t)(2 * inverse_park(run->control.i_q13, turn).alpha);
    run->salience.id_q13 = (int16_t)((id_q13 > 0) ? id_q13 + (id_q13 >> 1) + (id_q13 >> 2) : id_q13);
#endif
}

current_q13_t salient_torque(const drive_run_t *run UNUSED, current_q13_t iq_q13)
{
#if MOTOR_SALIENCY_UH
    return salience_torque(&run->salience, iq_q13);
#else
    return iq_q13;
#endif
}

int32_t salient_current_q26(const drive_run_t *run UNUSED, int32_t torque_q26)
{
#if MOTOR_SALIENCY_UH
    return salience_current_q26(&run->salience, torque_q26);
#else
    return torque_q26;
#endif
}

uint16_t salient_current_beside(const drive_run_t *run, const drive_params_t *p UNUSED, current_q13_t id_q13)
{
    uint16_t torque_q13 = (uint16_t)qm_abs(salient_torque(run, run->control.ref_q13.q));
#if MOTOR_SALIENCY_UH
    return qm_divud(qm_muluu(torque_q13, p->salience_q13), (uint16_t)(p->salience_q13 - (uint16_t)id_q13));
#else
    (void)id_q13;
    return torque_q13;
#endif
}

current_q13_t salient_id(drive_run_t *run, const drive_params_t *p UNUSED)
{
#if MOTOR_SALIENCY_UH
    int16_t least = run->salience.least_q13;
    salience_least(&run->salience, p->salience_q13, run->control.ref_q13.q, (uint16_t)(run->probe_id_q13 == 0));
    return (int16_t)((-least < run->fieldweak.table_q13) ? -least : run->fieldweak.table_q13);
#else
    return run->fieldweak.table_q13;
#endif
}

voltage_q12_t model_header_ri(const drive_params_t *p, current_q13_t i_q13)
{
    return (int16_t)(qm_mulhi_su(i_q13, p->adaptation.rs_base_q16) * (1 << p->estimator.rs_exp));
}

voltage_q12_t model_ri(const drive_run_t *run, const drive_params_t *p)
{
    return (int16_t)(qm_mulhi_su(run->control.i_q13.q, run->model.rs_q16) * (1 << p->estimator.rs_exp));
}

void drive_update_model(drive_run_t *run, const drive_params_t *p, speed_erpm_t ref_erpm, speed_erpm_t speed_erpm)
{
    const uint16_t turns = (uint16_t)(run->held.phase == (uint16_t)HELD_NOT); /* as it should */
    fieldweak_tick(&run->fieldweak, &p->fieldweak, &run->model, turns ? ref_erpm : held_weakened_for(p, qm_abs(ref_erpm), qm_abs(speed_erpm)));
    salient_model(run, p);
    adaptation_apply(&run->adaptation, &p->adaptation, &run->model);
    if (held_angle_stands(&run->held)) {
        run->model.inv_kfi = 0;
    }
}

/** 1 where the closed loop teaches: it rests until the observer runs, while the speed changes fast, and at the limits of current and voltage. It does not wait
 *  for the hand-over's d current to go: where R, L and Kphi are all wrong, the lock needs it before; what dR i_d puts into Ed passes with that current. */
static uint16_t model_is_taught(const drive_run_t *run)
{
    const drive_control_t *c = &run->control;
    return (uint16_t)(run->handover.phase == (uint16_t)START_DONE && observer_gate_is_closed(&run->observer) && qm_abs(c->v_q14.q) < c->vq_limit_q14
                      && !held_angle_stands(&run->held) && qm_abs(c->ref_q13.q) < c->iq_limit_q13);
}

void model_learn_step(drive_run_t *run, const drive_params_t *p)
{
    if (model_is_taught(run)) {
        adaptation_learn(&run->adaptation, &p->adaptation, estimator_emf(&run->estimator), model_ri(run, p));
    }
}

void model_learn_flux(drive_run_t *run, const drive_params_t *p)
{
    adaptation_learn(&run->adaptation, &p->adaptation, estimator_emf(&run->estimator), 0);
}

/** While there is d current of the start: what R has too much then loses a loaded rotor, what it lacks does not. After drive_update_model(). */
static void model_starts_with_less_resistance(motor_model_t *model)
{
    model->rs_q16 = (uint16_t)(model->rs_q16 - (model->rs_q16 >> START_LESS_SHIFT));
}

void model_update(drive_t *d, const drive_params_t *p)
{
    salient_sees_current(&d->run);
    drive_update_model(&d->run, p, d->run.control.reference_erpm, observer_speed(&d->run.observer));
    if (d->run.handover.offset != 0) {
        model_starts_with_less_resistance(&d->run.model);
    }
}

void model_update_in_ramp(drive_t *d, const drive_params_t *p)
{
    if (d->state == (uint16_t)DRIVE_RAMP) {
        salient_sees_forced_current(d);
        drive_update_model(&d->run, p, p->end_erpm, p->end_erpm);
        model_starts_with_less_resistance(&d->run.model);
    }
}
