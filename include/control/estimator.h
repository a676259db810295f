/* AN1292's PLL estimator, Equations 1-7: currents and the acting voltage become back-EMF, speed and rotor angle. */
#ifndef CONTROL_ESTIMATOR_H
#define CONTROL_ESTIMATOR_H

#include "control/transforms.h"

#define ESTIMATOR_HISTORY 4 /* two periods apart, and the current of the last period: eight periods */

/** Motor and filter constants that do not change while the motor runs. */
typedef struct {
    uint16_t rs_exp;              /**< 0..3, for motors whose Rs does not fit */
    uint16_t ls_exp;              /**< 0..3, the same for Ls */
    int16_t d_ilimit_ls_q14;      /**< limit of the eight-sample current difference (D_ILIMIT_LS), below 16384 */
    int16_t d_ilimit_hs_q14;      /**< limit of the one-sample difference (D_ILIMIT_HS), below 4096 */
    int16_t deltat_q32;           /**< Ts/60 * 2^32: angle per period and count of speed (NORM_DELTAT, unrounded) */
    uint16_t half_step_q16_rad;   /**< Ts pi/60 * 2^32: half the angle step in radians * 65536, per count of speed, as high-word factor */
    int16_t kfilter_velestim_q16; /**< speed filter, of every second period: 1 - (1 - KFILTER_VELESTIM)^2 */
    speed_erpm_t nominal_erpm;    /**< EIGHT_SAMPLES_ERPM: above, the derivative spans one sample instead of eight */
    speed_erpm_t decimate_erpm;   /**< a tenth of it: below, the sign of Equation 2 comes from the filtered speed */
} estimator_params_t;

/** Constants that field weakening and the adaptation change while the motor runs. */
typedef struct {
    uint16_t rs_q16;          /**< Rs I0 / (2 U0) * 65536 >> rs_exp: Q14 current to Q13 voltage */
    uint16_t ls_q16;          /**< Ls/(8 Ts) I0/(2 U0) * 65536 >> ls_exp: Q14 eight-sample difference to Q13 voltage */
    int16_t inv_kfi;          /**< InvKFi in AN1292's format: 1/Kphi / 2 in Q15 */
    int16_t emf_sum_max_q12;  /**< 32767 * 2048 / inv_kfi: keeps the speed in 16 bits */
    int16_t kfilter_esdq_q16; /**< back-EMF filter, 2 * KFILTER_ESDQ or 2 * KFILTER_ESDQ_FW */
} motor_model_t;

/** State. Everything zero is a valid start at standstill. */
typedef struct {
    alphabeta_t history_q14[ESTIMATOR_HISTORY]; /**< currents, the newest two periods before the last settled one */
    alphabeta_t i_last_q14;                     /**< the current of the last period */
    alphabeta_t i_oldest_q14;                   /**< and of eight periods before the next two, in the mean of the two */
    alphabeta_t v_last_q13;                     /**< voltage commanded one period ago */
    alphabeta_t v_mean_q13;                     /**< that acts between the last sample and the next one: the mean of the last two */
    int32_t e_d_q28, e_q_q28;                   /**< filtered back-EMF: Q12 with 16 fraction bits */
    speed_erpm_t omega_erpm;                    /**< speed of Equation 2; integrates to the angle */
    speed_erpm_t omega_before_erpm;             /**< and of the period before */
    int32_t omega_filtered_q16;                 /**< filtered speed, 16 fraction bits: speed loop, thresholds, display */
    uint32_t rho_q32;                           /**< angle of the rotor flux half a period after the last sample */
    int16_t half_step_q16_rad;                  /**< half the angle step of a period, radians * 65536 */
    angle_t next;                               /**< see estimator_next_angle() */
    int16_t old_turn_q16_rad;                   /**< 3.5 steps: from the middle of eight periods to that of the last one */
    uint16_t is_fast;                           /**< 1 from nominal_erpm on: the derivative of the current spans one sample */
    int16_t sign;                               /**< of the rotation, for Equation 2: 1, 0 at the start, or -1 */
    sincos_t own;                               /**< of rho and half a step, while the forced angle drives the motor */
} estimator_t;

/** Filtered speed. */
speed_erpm_t estimator_speed(const estimator_t *e);

/** Filtered back-EMF in the estimator's own frame, Q12. */
dq_t estimator_emf(const estimator_t *e);

/** Angle that the next period needs: at the next sample, which is also the centre of the next voltage pulse. */
angle_t estimator_next_angle(const estimator_t *e);

/** Half a step ahead of rho. @param step_q32 of a period */
angle_t estimator_ahead(uint32_t rho_q32, int32_t step_q32);

/** x turned by a small angle: error a^2/2. @param a_q16_rad angle in radians * 65536, +-0.5 rad */
alphabeta_t estimator_turn(alphabeta_t x, int16_t a_q16_rad);

/** Equation 4 in the stator frame: E = V - Rs I - Ls dI/dt, all taken at the middle of the last period.
 *
 *  The delay constant: a vector computed at sample n is loaded at the next PWM boundary, half a period later, and acts for one period; so
 *  the mean voltage between samples n-1 and n is the mean of the last two vectors. @return the back-EMF half a period in the past, Q13 */
alphabeta_t estimator_back_emf(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t i_q14);

/** Equation 2: speed from Eq and Ed. @param sum_max limit of their sum, 32767 * 2048 / inv_kfi @return within 16 bits */
speed_erpm_t estimator_omega(int16_t sum, int16_t sum_max, int16_t inv_kfi);

/** Equations 1 and 2, and Equation 7 for Ed and Eq: filtered, they give the speed, the speed gives the angle.
 *  Lock is stable where cos(error) + sin(error) = K'/K: a wrong Kphi turns the angle, not the speed. */
void estimator_pll(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, dq_t e_q12);

/** Remembers the vector that was just given to the modulator. */
void estimator_commanded(estimator_t *e, alphabeta_t v_q13);

/** What follows the speed slowly: the sign of Equation 2, that of Eq, at low speed that of the filtered speed; and the turn of the eight-sample difference. */
void estimator_follow(estimator_t *e, const estimator_params_t *p);

/** Three quarters of the current of six periods ago and a quarter of that of eight: the current of 6.5 periods ago, which is eight before the
 *  next two periods in the mean. Their ripple, a sixteenth, has half the PWM's frequency and is nothing behind the back-EMF's filter. */
int16_t estimator_oldest(int16_t six_ago, int16_t eight_ago);

/** What the next two periods need of those that were. */
void estimator_remember(estimator_t *e);

/** Which span the derivative of the current has at the filtered speed: after every change of that. */
void estimator_choose_span(estimator_t *e, const estimator_params_t *p);

/** After the duties of every second period: the filtered speed of Equation 7, and what the next two periods need. */
void estimator_filter_speed(estimator_t *e, const estimator_params_t *p);

/** The estimator's own frame for the next two periods, in the mean of the two; they need it while the forced angle drives the motor. */
void estimator_turn_frame(estimator_t *e);

/** What the back-EMF says of speed and angle, while the estimator's angle drives the motor. @param e_q13 see estimator_back_emf() @param frame of the control */
void estimator_track(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t e_q13, sincos_t frame);

/** The same in a frame of its own, while the forced angle drives the motor (ALIGN and RAMP). */
void estimator_run_along(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t e_q13);

#endif
