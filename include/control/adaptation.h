/* Flux and resistance from the running motor.
 *
 * In lock the filtered Ed is zero if 1/Kphi and R are right. An angle that leads makes it positive in both directions of rotation (see
 * estimator_pll()): 1/Kphi is too large, or R too small for a motor that drives. A step down the gradient corrects each by its own share of
 * the voltage, so that the flux learns where the back-EMF prevails and the resistance where the current does. The tables of field
 * weakening stay the feed-forward; the flux is the magnets' temperature, the resistance the winding's. */
#ifndef CONTROL_ADAPTATION_H
#define CONTROL_ADAPTATION_H

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
QM_INLINE void adaptation_learn(adaptation_t *a, const adaptation_params_t *p, dq_t emf_q12, voltage_q12_t ri_q12)
{
    uint16_t emf = (uint16_t)qm_abs(emf_q12.q), ri = (uint16_t)qm_abs(ri_q12), wrong = (uint16_t)qm_abs(emf_q12.d), sum;
    int16_t error, rs_rate;
    if (emf < (uint16_t)p->emf_least_q12) {
        return;
    }
    sum = (uint16_t)(emf + ri); /* more than either: the least back-EMF is 1 at least */
    if (wrong >= sum) {
        wrong = (uint16_t)(sum - 1u);
    }
    error = qm_share(wrong, sum);
    if (emf_q12.d < 0) {
        error = (int16_t)-error;
    }
    /* The rate is shared out, not the error: an error's rounding would turn its noise into a drift of R where no current holds it. */
    rs_rate = qm_hi_rounded(2 * qm_mulss(qm_share(ri, sum), p->rate_q16));
    a->kfi_q31 = qm_clamp_hi(a->kfi_q31 - qm_mulss(error, (int16_t)(p->rate_q16 - rs_rate)), p->kfi_least, p->kfi_most);
    if ((ri_q12 ^ emf_q12.q) < 0) {
        error = (int16_t)-error;
    }
    a->rs_q31 = qm_clamp_hi(a->rs_q31 + qm_mulss(error, rs_rate), p->rs_least, p->rs_most);
}

/** 1/Kphi within its format, ADAPTATION_KFI_LEAST .. 32767. */
QM_INLINE int16_t adaptation_kfi(int32_t kfi)
{
    if (kfi > 32767) {
        return 32767;
    }
    return (int16_t)((kfi < ADAPTATION_KFI_LEAST) ? ADAPTATION_KFI_LEAST : kfi);
}

/** A constant with a change of it, Q15. */
#define ADAPTATION_CHANGED(base, change) ((int32_t)(base) + 2 * (((int32_t)(base) * (change)) >> 16))

/** 1/Kphi with its change; of constants it is known whether that reaches a limit. */
QM_INLINE int16_t adaptation_kfi_changed(const adaptation_params_t *p, int16_t table, q15_t change)
{
    int16_t more = (int16_t)(2 * qm_mulhi(table, change));
    if (QM_KNOWN(ADAPTATION_CHANGED(table, p->kfi_least) >= ADAPTATION_KFI_LEAST)) {
        if (QM_KNOWN(ADAPTATION_CHANGED(table, p->kfi_most) <= 32767)) {
            return (int16_t)(table + more);
        }
    }
    return adaptation_kfi((int32_t)table + more);
}

/** The same of R. */
QM_INLINE uint16_t adaptation_rs_changed(const adaptation_params_t *p, q15_t change)
{
    int16_t half = qm_mulhi_su(change, p->rs_base_q16);
    int32_t rs;
    if (QM_KNOWN(ADAPTATION_CHANGED(p->rs_base_q16, p->rs_most) <= 65535)) {
        return (uint16_t)(p->rs_base_q16 + 2u * (uint16_t)half);
    }
    rs = (int32_t)p->rs_base_q16 + 2 * (int32_t)half;
    return (uint16_t)((rs > 65535) ? 65535 : rs);
}

/** The model with what was learnt: 1/Kphi comes from the table anew in every step, R from the header. */
QM_INLINE void adaptation_apply(const adaptation_t *a, const adaptation_params_t *p, motor_model_t *model)
{
    const int16_t table = model->inv_kfi;
    int16_t kfi = adaptation_kfi_changed(p, table, qm_hi(a->kfi_q31));
    model->inv_kfi = kfi;
    model->rs_q16 = adaptation_rs_changed(p, qm_hi(a->rs_q31));
    if (!QM_KNOWN(ADAPTATION_CHANGED(table, p->kfi_least) >= 2048) && kfi < 2048) {
        kfi = 2048; /* below no sum is too large: 1/Kphi of a slow motor */
    }
    model->emf_sum_max_q12 = (int16_t)qm_divud(32767ul * 2048ul, (uint16_t)kfi);
}

#endif
