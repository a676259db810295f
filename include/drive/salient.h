/* The seam between the drive and a salient motor: each hook is defined twice, and costs nothing where the header has no MOTOR_SALIENCY_UH.
 *
 * The load observer and the speed controller count torque, in q current without d current: salient_torque() and salient_current_q26() lead from
 * one to the other. */
#ifndef DRIVE_SALIENT_H
#define DRIVE_SALIENT_H

#include "drive/drive.h"

/** The model with the flux that the d current makes, before what was learnt is applied to 1/Kphi of the magnets. */
QM_INLINE void salient_model(drive_run_t *run, const drive_params_t *p)
{
#if MOTOR_SALIENCY_UH
    salience_update(&run->salience, p->salience_q13, qm_hi(run->adaptation.kfi_q31));
    run->model.inv_kfi = adaptation_kfi(salience_kfi(&run->salience, run->model.inv_kfi));
#else
    (void)run;
    (void)p;
#endif
}

/** In closed loop the control's frame is the rotor's. What the hand-over has of current along the flux counts half more, as with magnets a fifth
 *  weaker than the header's: with too much flux in its model the estimator loses its lock. Before drive_update_model(). */
QM_INLINE void salient_sees_current(drive_run_t *run)
{
#if MOTOR_SALIENCY_UH
    int16_t id_q13 = run->control.i_q13.d;
    run->salience.id_q13 = (int16_t)((id_q13 > 0) ? id_q13 + (id_q13 >> 1) : id_q13);
#else
    (void)run;
#endif
}

/** On the forced angle the estimator's frame is the rotor's, as soon as it agrees. There is more such current, so it counts three quarters more: the
 *  estimator finds its lock with half of the flux in its model, but not with half too much. Before drive_update_model(). */
QM_INLINE void salient_sees_forced_current(drive_t *d)
{
#if MOTOR_SALIENCY_UH
    drive_run_t *run = &d->run;
    sincos_t turn;
    int16_t id_q13;
    trig_sincos_called(&turn, (angle_t)(d->angle - estimator_next_angle(&run->estimator)));
    id_q13 = (int16_t)(2 * inverse_park(run->control.i_q13, turn).alpha);
    run->salience.id_q13 = (int16_t)((id_q13 > 0) ? id_q13 + (id_q13 >> 1) + (id_q13 >> 2) : id_q13);
#else
    (void)d;
#endif
}

/** What a q current is worth: the one that makes the same torque without d current. */
QM_INLINE current_q13_t salient_torque(const drive_run_t *run, current_q13_t iq_q13)
{
#if MOTOR_SALIENCY_UH
    return salience_torque(&run->salience, iq_q13);
#else
    (void)run;
    return iq_q13;
#endif
}

/** The q current for that torque. Both with 13 fraction bits. */
QM_INLINE int32_t salient_current_q26(const drive_run_t *run, int32_t torque_q26)
{
#if MOTOR_SALIENCY_UH
    return salience_current_q26(&run->salience, torque_q26);
#else
    (void)run;
    return torque_q26;
#endif
}

/** q current that the torque takes while d current along the flux takes of it. @param id_q13 0 .. MAXIMUM_CURRENT_A, which is less than doubles the flux
 *  @return not negative */
QM_INLINE uint16_t salient_current_beside(const drive_run_t *run, const drive_params_t *p, current_q13_t id_q13)
{
    uint16_t torque_q13 = (uint16_t)qm_size(salient_torque(run, run->control.ref_q13.q));
#if MOTOR_SALIENCY_UH
    return qm_divud(qm_muluu(torque_q13, p->salience_q13), (uint16_t)(p->salience_q13 - (uint16_t)id_q13));
#else
    (void)p;
    (void)id_q13;
    return torque_q13;
#endif
}

/** d current of the least current, or field weakening's if that is more. Every rare step in closed loop. */
QM_INLINE current_q13_t salient_id(drive_run_t *run, const drive_params_t *p)
{
#if MOTOR_SALIENCY_UH
    int16_t least = run->salience.least_q13;
    salience_least(&run->salience, p->salience_q13, run->control.ref_q13.q, (uint16_t)(run->probe_id_q13 == 0));
    return (int16_t)((-least < run->fieldweak.table_q13) ? -least : run->fieldweak.table_q13);
#else
    (void)p;
    return run->fieldweak.table_q13;
#endif
}

#endif
