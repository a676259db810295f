/* AN1292's PLL estimator, Equations 1-7: currents and the acting voltage become back-EMF, speed and rotor angle. */
#include "control/estimator.h"

INLINE speed_erpm_t estimator_speed(const estimator_t *e)
{
    return qm_hi(e->omega_filtered_q16);
}

INLINE dq_t estimator_emf(const estimator_t *e)
{
    dq_t r;
    r.d = qm_hi(e->e_d_q28);
    r.q = qm_hi(e->e_q_q28);
    return r;
}

INLINE angle_t estimator_next_angle(const estimator_t *e)
{
    return e->next;
}

INLINE angle_t estimator_ahead(uint32_t rho_q32, int32_t step_q32)
{
    return (angle_t)((uint16_t)(rho_q32 >> 16) + (uint16_t)(qm_hi(step_q32) >> 1));
}

INLINE alphabeta_t estimator_turn(alphabeta_t x, int16_t a_q16_rad)
{
    alphabeta_t r;
    r.alpha = (int16_t)(x.alpha - qm_mulhi(x.beta, a_q16_rad));
    r.beta = (int16_t)(x.beta + qm_mulhi(x.alpha, a_q16_rad));
    return r;
}

/** Voltage of the inductance, Q13. Below nominal speed over eight samples, which is four samples old and therefore turned forward by 3.5
 *  steps to the middle of the last period; above over one sample. @param last the current of the last period */
static INLINE alphabeta_t estimator_inductive(const estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t now, alphabeta_t last)
{
    const uint16_t ls_q16 = t->ls_q16;
    alphabeta_t v;
    if (!e->is_fast) {
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

INLINE alphabeta_t estimator_back_emf(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t i_q14)
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

INLINE speed_erpm_t estimator_omega(int16_t sum, int16_t sum_max, int16_t inv_kfi)
{
    return (int16_t)(qm_mulss(qm_limit(sum, sum_max), inv_kfi) >> 11);
}

INLINE void estimator_pll(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, dq_t e_q12)
{
    int16_t e_d = qm_lowpass(&e->e_d_q28, e_q12.d, t->kfilter_esdq_q16), e_q = qm_lowpass(&e->e_q_q28, e_q12.q, t->kfilter_esdq_q16);
    int16_t sum = (int16_t)(e_q - e->sign * e_d);
    int32_t step_q32;
    e->omega_before_erpm = e->omega_erpm;
    e->omega_erpm = estimator_omega(sum, t->emf_sum_max_q12, t->inv_kfi);
    step_q32 = qm_mulss(e->omega_erpm, p->deltat_q32);
    e->rho_q32 = qm_turn_add(e->rho_q32, (uint32_t)step_q32);
    e->next = estimator_ahead(e->rho_q32, step_q32);
    e->half_step_q16_rad = qm_mulhi_su(e->omega_erpm, p->half_step_q16_rad);
}

INLINE void estimator_commanded(estimator_t *e, alphabeta_t v_q13)
{
    const alphabeta_t last = e->v_last_q13; /* read before it is written: the compiler adds it in a register then */
    e->v_last_q13 = v_q13;
    e->v_mean_q13.alpha = (int16_t)((v_q13.alpha + last.alpha) >> 1);
    e->v_mean_q13.beta = (int16_t)((v_q13.beta + last.beta) >> 1);
}

void estimator_follow(estimator_t *e, const estimator_params_t *p)
{
    int16_t speed = estimator_speed(e), turns = speed;
    if (qm_beyond(speed, p->decimate_erpm)) {
        turns = qm_hi(e->e_q_q28);
    }
    e->sign = (int16_t)(qm_hi(turns) | 1);
    e->old_turn_q16_rad = (int16_t)(7 * qm_limit(qm_mulhi_su(speed, p->half_step_q16_rad), 4681)); /* 0.5 rad at most */
}

int16_t estimator_oldest(int16_t six_ago, int16_t eight_ago)
{
    return (int16_t)(six_ago - (six_ago >> 2) + (eight_ago >> 2));
}

void estimator_remember(estimator_t *e)
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

void estimator_choose_span(estimator_t *e, const estimator_params_t *p)
{
    e->is_fast = qm_beyond(estimator_speed(e), (int16_t)(p->nominal_erpm - 1));
}

void estimator_filter_speed(estimator_t *e, const estimator_params_t *p)
{
    int16_t mean = qm_mean(e->omega_erpm, e->omega_before_erpm); /* free of the ripple of estimator_remember() */
    estimator_remember(e);
    (void)qm_lowpass(&e->omega_filtered_q16, mean, p->kfilter_velestim_q16);
    estimator_choose_span(e, p);
}

/** Back-EMF in the control frame while that is the estimator's own: Park with the frame's sine and cosine, turned back by the
 *  half step from the sample to the middle of the last period, so that no second sine is needed. */
static INLINE dq_t estimator_in_control_frame(const estimator_t *e, alphabeta_t e_q13, sincos_t frame)
{
    return dq_turn(park(e_q13, frame), e->half_step_q16_rad);
}

void estimator_turn_frame(estimator_t *e)
{
    e->own = trig_sincos(e->next);
}

INLINE void estimator_track(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t e_q13, sincos_t frame)
{
    estimator_pll(e, p, t, estimator_in_control_frame(e, e_q13, frame));
}

INLINE void estimator_run_along(estimator_t *e, const estimator_params_t *p, const motor_model_t *t, alphabeta_t e_q13)
{
    estimator_pll(e, p, t, park(e_q13, e->own));
}
