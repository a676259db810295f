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
    int16_t sign;                               /**< of the rotation, for Equation 2: 1, 0 at the start, or -1 */
    sincos_t own;                               /**< of rho and half a step, while the forced angle drives the motor */
} estimator_t;

/** Filtered speed. */
QM_INLINE speed_erpm_t estimator_speed(const estimator_t *e)
{
    return qm_hi(e->omega_filtered_q16);
}

/** Filtered back-EMF in the estimator's own frame, Q12. */
QM_INLINE dq_t estimator_emf(const estimator_t *e)
{
    dq_t r;
    r.d = qm_hi(e->e_d_q28);
    r.q = qm_hi(e->e_q_q28);
    return r;
}

/** Angle that the next period needs: at the next sample, which is also the centre of the next voltage pulse. */
QM_INLINE angle_t estimator_next_angle(const estimator_t *e)
{
    return e->next;
}

/** Half a step ahead of rho. @param step_q32 of a period */
QM_INLINE angle_t estimator_ahead(uint32_t rho_q32, int32_t step_q32)
{
    return (angle_t)((uint16_t)(rho_q32 >> 16) + (uint16_t)(qm_hi(step_q32) >> 1));
}

/** x turned by a small angle: error a^2/2. @param a_q16_rad angle in radians * 65536, +-0.5 rad */
QM_INLINE alphabeta_t estimator_turn(alphabeta_t x, int16_t a_q16_rad)
{
    alphabeta_t r;
    r.alpha = (int16_t)(x.alpha - qm_mulhi(x.beta, a_q16_rad));
    r.beta = (int16_t)(x.beta + qm_mulhi(x.alpha, a_q16_rad));
    return r;
}

/** Voltage of the inductance, Q13. Below nominal speed over eight samples, which is four samples old and therefore
 *  turned forward by 3.5 steps to the middle of the last period; above over one sample.
 *  @param last the current of the last period */
QM_INLINE alphabeta_t estimator_inductive(const estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t now, alphabeta_t last)
{
    const uint16_t ls_q16 = t->ls_q16;
    alphabeta_t v;
    if (!qm_beyond(estimator_speed(e), (int16_t)(p->nominal_erpm - 1))) {
        const int16_t limit = p->d_ilimit_ls_q14;
        v.alpha = qm_mulhi_su(qm_limit((int16_t)(now.alpha - e->i_oldest_q14.alpha), limit), ls_q16);
        v.beta = qm_mulhi_su(qm_limit((int16_t)(now.beta - e->i_oldest_q14.beta), limit), ls_q16);
        v = estimator_turn(v, e->old_turn_q16_rad);
    } else {
        const int16_t limit = p->d_ilimit_hs_q14;
        v.alpha = qm_mulhi_su((int16_t)(8 * qm_limit((int16_t)(now.alpha - last.alpha), limit)), ls_q16);
        v.beta = qm_mulhi_su((int16_t)(8 * qm_limit((int16_t)(now.beta - last.beta), limit)), ls_q16);
    }
    v.alpha = (int16_t)(v.alpha * (1 << p->ls_exp));
    v.beta = (int16_t)(v.beta * (1 << p->ls_exp));
    return v;
}

/** Equation 4 in the stator frame: E = V - Rs I - Ls dI/dt, all taken at the middle of the last period.
 *
 *  The delay constant: a vector computed at sample n is loaded at the next PWM boundary, half a period later, and acts
 *  for one period; so the mean voltage between samples n-1 and n is the mean of the last two vectors.
 *  @return the back-EMF half a period in the past, Q13 */
QM_INLINE alphabeta_t estimator_back_emf(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t i_q14)
{
    const alphabeta_t last = e->i_last_q14;
    alphabeta_t inductive = estimator_inductive(e, p, t, i_q14, last), e_q13;
    int16_t resistive_alpha, resistive_beta;

    e->i_last_q14 = i_q14;
    resistive_alpha = qm_mulhi_su((int16_t)((i_q14.alpha + last.alpha) >> 1), t->rs_q16);
    resistive_beta = qm_mulhi_su((int16_t)((i_q14.beta + last.beta) >> 1), t->rs_q16);
    e_q13.alpha = (int16_t)(e->v_mean_q13.alpha - resistive_alpha * (1 << p->rs_exp) - inductive.alpha);
    e_q13.beta = (int16_t)(e->v_mean_q13.beta - resistive_beta * (1 << p->rs_exp) - inductive.beta);
    return e_q13;
}

/** Equation 2: speed from Eq and Ed. @param sum_max limit of their sum, 32767 * 2048 / inv_kfi @return within 16 bits */
QM_INLINE speed_erpm_t estimator_omega(int16_t sum, int16_t sum_max, int16_t inv_kfi)
{
    return (int16_t)(qm_mulss(qm_limit(sum, sum_max), inv_kfi) >> 11);
}

/** Equations 1 and 2, and Equation 7 for Ed and Eq: filtered, they give the speed, the speed gives the angle.
 *  Lock is stable where cos(error) + sin(error) = K'/K: a wrong Kphi turns the angle, not the speed. */
QM_INLINE void estimator_pll(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, dq_t e_q12)
{
    int16_t e_d = qm_lowpass(&e->e_d_q28, e_q12.d, t->kfilter_esdq_q16);
    int16_t e_q = qm_lowpass(&e->e_q_q28, e_q12.q, t->kfilter_esdq_q16);
    int16_t sum = (int16_t)(e_q - e->sign * e_d);
    int32_t step_q32;

    e->omega_before_erpm = e->omega_erpm;
    e->omega_erpm = estimator_omega(sum, t->emf_sum_max_q12, t->inv_kfi);
    step_q32 = qm_mulss(e->omega_erpm, p->deltat_q32);
    e->rho_q32 = qm_turn_add(e->rho_q32, (uint32_t)step_q32);
    e->next = estimator_ahead(e->rho_q32, step_q32);
    e->half_step_q16_rad = qm_mulhi_su(e->omega_erpm, p->half_step_q16_rad);
}

/** Remembers the vector that was just given to the modulator. */
QM_INLINE void estimator_commanded(estimator_t *e, alphabeta_t v_q13)
{
    const alphabeta_t last = e->v_last_q13; /* read before it is written: the compiler adds it in a register then */
    e->v_last_q13 = v_q13;
    e->v_mean_q13.alpha = (int16_t)((v_q13.alpha + last.alpha) >> 1);
    e->v_mean_q13.beta = (int16_t)((v_q13.beta + last.beta) >> 1);
}

/** What follows the speed slowly: the sign of Equation 2, that of Eq, at low speed that of the filtered speed; and the turn of the eight-sample
 *  difference. */
NOINLINE void estimator_follow(estimator_t *e, const estimator_params_t *p)
{
    int16_t speed = estimator_speed(e), turns = speed;
    if (qm_beyond(speed, p->decimate_erpm)) {
        turns = qm_hi(e->e_q_q28);
    }
    e->sign = (int16_t)(qm_hi(turns) | 1);
    e->old_turn_q16_rad = (int16_t)(7 * qm_limit_called(qm_mulhi_su(speed, p->half_step_q16_rad), 4681)); /* 0.5 rad at most */
}

/** Three quarters of the current of six periods ago and a quarter of that of eight: the current of 6.5 periods ago, which is eight before the
 *  next two periods in the mean. Their ripple, a sixteenth, has half the PWM's frequency and is nothing behind the back-EMF's filter. */
QM_INLINE int16_t estimator_oldest(int16_t six_ago, int16_t eight_ago)
{
    return (int16_t)(six_ago - (six_ago >> 2) + (eight_ago >> 2));
}

/** What the next two periods need of those that were. */
QM_INLINE void estimator_remember(estimator_t *e)
{
    alphabeta_t *ago = e->history_q14; /* two, four, six, eight periods */
    const alphabeta_t six = ago[2], eight = ago[3];
    e->i_oldest_q14.alpha = estimator_oldest(six.alpha, eight.alpha);
    e->i_oldest_q14.beta = estimator_oldest(six.beta, eight.beta);
    ago[3] = six;
    ago[2] = ago[1];
    ago[1] = ago[0];
    ago[0] = e->i_last_q14;
}

/** After the duties of every second period: the filtered speed of Equation 7, and what the next two periods need. */
QM_INLINE void estimator_settle(estimator_t *e, const estimator_params_t *p)
{
    int16_t mean = qm_mean(e->omega_erpm, e->omega_before_erpm); /* free of the ripple of estimator_remember() */
    estimator_remember(e);
    (void)qm_lowpass(&e->omega_filtered_q16, mean, p->kfilter_velestim_q16);
}

/** Back-EMF in the control frame while that is the estimator's own: Park with the frame's sine and cosine, turned back by the
 *  half step from the sample to the middle of the last period, so that no second sine is needed. */
QM_INLINE dq_t estimator_in_control_frame(const estimator_t *e, alphabeta_t e_q13, sincos_t frame)
{
    dq_t at_sample = park(e_q13, frame), at_middle;
    at_middle.d = (int16_t)(at_sample.d - qm_mulhi(at_sample.q, e->half_step_q16_rad));
    at_middle.q = (int16_t)(at_sample.q + qm_mulhi(at_sample.d, e->half_step_q16_rad));
    return at_middle;
}

/** The estimator's own frame for the next two periods, in the mean of the two; they need it while the forced angle drives the motor. */
QM_INLINE void estimator_turn_frame(estimator_t *e)
{
    trig_sincos_called(&e->own, e->next);
}

/** What the back-EMF says of speed and angle. @param e_q13 see estimator_back_emf() @param frame of the control
 *  @param forced nonzero while the forced angle drives the motor (ALIGN and RAMP): the estimator runs along in a frame of its own */
QM_INLINE void estimator_track(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t e_q13, sincos_t frame, uint16_t forced)
{
    dq_t e_q12;
    if (forced) {
        e_q12 = park(e_q13, e->own);
    } else {
        e_q12 = estimator_in_control_frame(e, e_q13, frame);
    }
    estimator_pll(e, p, t, e_q12);
}

#endif
