/* What changes the motor's constants: flux and resistance from the running motor, and a salient motor's d current.
 *
 * In lock the filtered Ed is zero if 1/Kphi and R are right. An angle that leads makes it positive in both directions of rotation (see
 * estimator_pll()): 1/Kphi is too large, or R too small for a motor that drives. A step down the gradient corrects each by its own share of
 * the voltage, so that the flux learns where the back-EMF prevails and the resistance where the current does. The tables of field
 * weakening stay the feed-forward; the flux is the magnets' temperature, the resistance the winding's. */
#ifndef CONTROL_MOTOR_MODEL_H
#define CONTROL_MOTOR_MODEL_H

#include "control/estimator.h"

#define ADAPTATION_KFI_LEAST 1024 /**< a speed of 2048 counts at full voltage: a count is 0.1 % */

/** Constants. */
typedef struct {
    int16_t rate_q16;          /**< share of an error that a step takes back, 0..8192 */
    q15_t kfi_least, kfi_most; /**< bounds of the change of 1/Kphi */
    q15_t rs_least, rs_most;   /**< and of R, above -1 */
    int16_t emf_least_q12;     /**< no information below, at least 1 */
    uint16_t rs_base_q16;      /**< R of the header, see motor_model_t */
} adaptation_params_t;

/** State: changes against the header, Q31. */
typedef struct {
    int32_t kfi_q31; /**< of 1/Kphi: negative where the flux is stronger */
    int32_t rs_q31;
} adaptation_t;

/** One step. @param emf_q12 filtered back-EMF in the estimator's frame @param ri_q12 R i_q of the model, signed */
void adaptation_learn(adaptation_t *a, const adaptation_params_t *p, dq_t emf_q12, voltage_q12_t ri_q12);

/** 1/Kphi within its format, ADAPTATION_KFI_LEAST .. 32767. */
int16_t adaptation_kfi(int32_t kfi);

/** The model with what was learnt: 1/Kphi comes from the table anew in every step, R from the header. */
void adaptation_apply(const adaptation_t *a, const adaptation_params_t *p, motor_model_t *model);

/* ---- Salient motors: what the d current does to torque and back-EMF, and the d current of the least current for the torque (MTPA) ---- */

#define SALIENCE_MOST_Q26 (INT32_C(1) << 28) /**< q current that can be converted: four times full scale */

/** State. Zero and salience_update() are a valid start. */
typedef struct {
    current_q13_t id_q13;    /**< d current in the rotor's frame */
    current_q13_t least_q13; /**< what the least current takes of negative d current, 0 or more */
    uint16_t flux_q13;       /**< flux over the magnets', 0.5 .. 3; 8192 = 1 */
    uint16_t per_flux_q15;   /**< one over it */
} salience_t;

/** The flux at this d current. @param double_q13 I: -i_d that doubles the flux, 256..57343 @param kfi change of 1/Kphi that was learnt */
void salience_update(salience_t *s, uint16_t double_q13, q15_t kfi);

/** q current that would make the same torque without d current. @param iq_q13 within full scale */
current_q13_t salience_torque(const salience_t *s, current_q13_t iq_q13);

/** The q current that makes such a torque. Both with 13 fraction bits. */
int32_t salience_current_q26(const salience_t *s, int32_t torque_q26);

/** 1/Kphi of the flux. @return below 65536 */
int32_t salience_kfi(const salience_t *s, int16_t inv_kfi);

/** A step towards the least current: -i_d = i_q^2/(I - i_d), which comes to its root by itself. @param double_q13 I @param iq_q13 q current; its
 *  square is below 65536 I @param wanted 0: none of it */
void salience_least(salience_t *s, uint16_t double_q13, current_q13_t iq_q13, uint16_t wanted);

#endif
