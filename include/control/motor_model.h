/* What changes the motor's constants: field weakening's table, flux and resistance from the running motor, a salient motor's d current.
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
    int16_t turned_q12;        /**< what the back-EMF of a rotor that turns by HELD_TURNED_RAD sums to, a step of 16 periods each */
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

/* ---- Field weakening by table: the speed reference gives the d current and adapts the estimator, as in AN1292 ---- */

#define FIELDWEAK_ENTRIES 18
#define SPEED_INDEX_CONST 10 /**< one table step is 2^10 electrical rpm */

/** The three tables of AN1292 and what frames them. */
typedef struct {
    current_q13_t idref_q13[FIELDWEAK_ENTRIES]; /**< IDREF_SPEED0..17: d current, 0 or negative */
    int16_t inv_kfi[FIELDWEAK_ENTRIES];         /**< INVKFI_SPEED0..17: 1/Kphi, AN1292's format */
    int16_t ls_over2ls0_q15[FIELDWEAK_ENTRIES]; /**< LS_OVER2LS0_SPEED0..17: Ls/(2 Ls0), Q15, 16384 = no change */
    speed_erpm_t on_speed_erpm;                 /**< speed reference where field weakening starts (qFwOnSpeed) */
    uint16_t index_per_count_q16;               /**< table steps a count of speed: 2^(16 - SPEED_INDEX_CONST) where it is an electrical rpm */
    uint16_t ls_base_q16;                       /**< estimator's ls_q16 at index 0 */
    int16_t kfilter_esdq_q16;                   /**< back-EMF filter up to the start speed */
    int16_t kfilter_esdq_fw_q16;                /**< and above */
    uint16_t esdq_per_erpm_q13;                 /**< at low speed the filter's corner is five times the electrical frequency: K per count of speed */
    int16_t trim_max_q13;                       /**< largest additional d current of the voltage feedback */
    int16_t trim_step_q13;                      /**< by how much a step, 16 periods, gives back at most */
    int16_t trim_most_q13;                      /**< by how much it asks for more at most: less with deferred duties, whose ripple it follows */
    speed_erpm_t trim_speed_erpm;               /**< estimated speed above which the trim may act */
} fieldweak_params_t;

/** State; all zero at standstill. */
typedef struct {
    uint16_t index;          /**< table index in use (FdWeakParm.qIndex) */
    current_q13_t table_q13; /**< d current from the table */
    current_q13_t trim_q13;  /**< d current added by the voltage feedback, -trim_max_q13..0 */
} fieldweak_t;

/** Entry of a table between two points. @param index 0..FIELDWEAK_ENTRIES - 2 */
int16_t fieldweak_between(const int16_t *table, uint16_t index, uint16_t fraction_q16);

/** Looks up the three tables for a speed reference (not the estimated speed); with the back-EMF's filter they go to the estimator. Entries above the last are
 *  never read: at and beyond index 17 the last entry holds, to one count. @param ref_erpm speed reference, any value and sign */
void fieldweak_tick(fieldweak_t *fw, const fieldweak_params_t *p, motor_model_t *model, speed_erpm_t ref_erpm);

/** Voltage feedback: where the q axis has run into the voltage limit, more d current is asked for, and given back later. It makes up for a
 *  sagging bus or a table that is not tuned; it is bounded, so it cannot run the motor into demagnetisation. @param free_q14 q-axis limit
 *  minus |Vq| of the last period @param speed_erpm filtered estimated speed */
void fieldweak_trim(fieldweak_t *fw, const fieldweak_params_t *p, voltage_q14_t free_q14, speed_erpm_t speed_erpm);

#endif
