/* What the running motor teaches about itself, and what a salient motor adds. */
#ifndef DRIVE_MODEL_H
#define DRIVE_MODEL_H

#include "control/motor_model.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

#if MOTOR_SALIENCY_UH
#define SALIENT_PARAMS uint16_t salience_q13; /**< -i_d that doubles the flux, psi/(Lq - Ld) */
#define SALIENT_STATE salience_t salience;
#else
#define SALIENT_PARAMS
#define SALIENT_STATE
#endif

/** The model with the flux that the d current makes, before what was learnt is applied to 1/Kphi of the magnets. */
void salient_model(drive_run_t *run, const drive_params_t *p);

/** What a q current is worth: the one that makes the same torque without d current. */
current_q13_t salient_torque(const drive_run_t *run, current_q13_t iq_q13);

/** The q current for that torque. Both with 13 fraction bits. */
int32_t salient_current_q26(const drive_run_t *run, int32_t torque_q26);

/** q current that the torque takes while d current along the flux takes of it. @param id_q13 0 .. MAXIMUM_CURRENT_A, less than doubles the flux @return not negative */
uint16_t salient_current_beside(const drive_run_t *run, const drive_params_t *p, current_q13_t id_q13);

/** d current of the least current, or field weakening's if that is more. Slots 2, 10 in closed loop. */
current_q13_t salient_id(drive_run_t *run, const drive_params_t *p);

/** R of the header times a current. @param i_q13 not negative */
voltage_q12_t model_header_ri(const drive_params_t *p, current_q13_t i_q13);

/** R i_q in the format of the filtered back-EMF. */
voltage_q12_t model_ri(const drive_run_t *run, const drive_params_t *p);

/** A step of the adaptation in closed loop: 1/Kphi and R follow Ed. Slot 10. */
void model_learn_step(drive_run_t *run, const drive_params_t *p);

/** In RAMP 1/Kphi alone follows Ed, four times as often (handover_wait): a wrong one turns the estimator's frame, which has to be right at the hand-over, or keeps it
 *  from locking. The current is nearly all d current there and says nothing of R. */
void model_learn_flux(drive_run_t *run, const drive_params_t *p);

/** The motor's constants for a speed reference: the tables, and what the motor has shown. @param speed_erpm of the rotor: one that was
 *  asked whether it stands gets field weakening for no more than twice this, until it is at half of the reference */
void drive_update_model(drive_run_t *run, const drive_params_t *p, speed_erpm_t ref_erpm, speed_erpm_t speed_erpm);

/** The motor's constants follow the speed reference, and what was learnt; R a little less while d current of the hand-over is left. Slot 14 in closed loop. */
void model_update(drive_t *d, const drive_params_t *p);

/** The same in RAMP. */
void model_update_in_ramp(drive_t *d, const drive_params_t *p);

#endif
