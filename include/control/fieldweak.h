/* Field weakening by table: the speed reference gives the d current and adapts the estimator, as in AN1292. */
#ifndef CONTROL_FIELDWEAK_H
#define CONTROL_FIELDWEAK_H

#include "control/estimator.h"

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
    int16_t trim_step_q13;                      /**< by how much a rare step gives back at most */
    int16_t trim_most_q13;                      /**< by how much one asks for more at most: less with late duties, whose ripple it follows */
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

/** Looks up the three tables for a speed reference (not the estimated speed); with the back-EMF's filter they go to the estimator.
 *  Entries above the last are never read: at and beyond index 17 the last entry holds, to one count.
 *  @param ref_erpm speed reference, any value and sign */
void fieldweak_tick(fieldweak_t *fw, const fieldweak_params_t *p, motor_model_t *model, speed_erpm_t ref_erpm);

/** Voltage feedback: where the q axis has run into the voltage limit, more d current is asked for, and given back later. It makes up for a
 *  sagging bus or a table that is not tuned; it is bounded, so it cannot run the motor into demagnetisation. @param free_q14 q-axis limit
 *  minus |Vq| of the last period @param speed_erpm filtered estimated speed */
void fieldweak_trim(fieldweak_t *fw, const fieldweak_params_t *p, voltage_q14_t free_q14, speed_erpm_t speed_erpm);

#endif
