/* What changes the motor's constants: field weakening's table, flux and resistance from the running motor, a salient motor's d current. */
#include "control/motor_model.h"

#include "control/tuned.h"

void adaptation_learn(adaptation_t *a, const adaptation_params_t *p, dq_t emf_q12, voltage_q12_t ri_q12)
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

int16_t adaptation_kfi(int32_t kfi)
{
    return qm_within(kfi, ADAPTATION_KFI_LEAST, 32767);
}

/** 1/Kphi of the table with its change. */
static int16_t adaptation_kfi_changed(int16_t table, q15_t change)
{
    return adaptation_kfi((int32_t)table + 2 * (int32_t)qm_mulhi(table, change));
}

/** R of the header with its change. */
static uint16_t adaptation_rs_changed(uint16_t base_q16, q15_t change)
{
    const int32_t rs = (int32_t)base_q16 + 2 * (int32_t)qm_mulhi_su(change, base_q16);
    return (uint16_t)((rs > 65535) ? 65535 : rs);
}

void adaptation_apply(const adaptation_t *a, const adaptation_params_t *p, motor_model_t *model)
{
    int16_t kfi = adaptation_kfi_changed(model->inv_kfi, qm_hi(a->kfi_q31));
    model->inv_kfi = kfi;
    model->rs_q16 = adaptation_rs_changed(p->rs_base_q16, qm_hi(a->rs_q31));
    if (kfi < 2048) { /* below no sum is too large: 1/Kphi of a slow motor */
        kfi = 2048;
    }
    model->emf_sum_max_q12 = (int16_t)qm_divud(32767ul * 2048ul, (uint16_t)kfi);
}

#define SALIENCE_MOST_Q13 16383 /**< d current that counts: twice full scale */

void salience_update(salience_t *s, uint16_t double_q13, q15_t kfi)
{
    int16_t least = (int16_t)((double_q13 < SALIENCE_MOST_Q13 / 2) ? -2 * (int16_t)double_q13 : -SALIENCE_MOST_Q13);
    int16_t most = (int16_t)((double_q13 < 32768u) ? double_q13 / 2u - 1u : SALIENCE_MOST_Q13);
    int16_t i_d = qm_clamp(s->id_q13, -SALIENCE_MOST_Q13, SALIENCE_MOST_Q13);
    uint16_t change;
    /* a weaker flux is changed more by the same current */
    i_d = qm_clamp((int16_t)(i_d + qm_hi(2 * qm_mulss(i_d, kfi))), least, most);
    change = qm_divud((uint32_t)(uint16_t)qm_abs(i_d) << 13, double_q13);
    s->flux_q13 = (uint16_t)((i_d < 0) ? 8192u + change : 8192u - change);
    s->per_flux_q15 = qm_divud(UINT32_C(1) << 28, s->flux_q13);
}

current_q13_t salience_torque(const salience_t *s, current_q13_t iq_q13)
{
    return (int16_t)(qm_mulsu(iq_q13, s->flux_q13) >> 13);
}

int32_t salience_current_q26(const salience_t *s, int32_t torque_q26)
{
    int32_t x = (torque_q26 > SALIENCE_MOST_Q26) ? SALIENCE_MOST_Q26 : (torque_q26 < -SALIENCE_MOST_Q26) ? -SALIENCE_MOST_Q26
                                                                                                         : torque_q26;
    return 2 * qm_mulsu(qm_hi(x), s->per_flux_q15) + (int32_t)(qm_muluu((uint16_t)x, s->per_flux_q15) >> 15);
}

int32_t salience_kfi(const salience_t *s, int16_t inv_kfi)
{
    return (int32_t)(qm_muluu((uint16_t)inv_kfi, s->per_flux_q15) >> 15);
}

void salience_least(salience_t *s, uint16_t double_q13, current_q13_t iq_q13, uint16_t wanted)
{
    int16_t to = 0;
    if (wanted) {
        to = (int16_t)qm_divud((uint32_t)qm_mulss(iq_q13, iq_q13), (uint16_t)(double_q13 + (uint16_t)s->least_q13));
    }
    s->least_q13 = (int16_t)(s->least_q13 + ((to - s->least_q13) >> SALIENCE_LEAST_SHIFT));
}

int16_t fieldweak_between(const int16_t *table, uint16_t index, uint16_t fraction_q16)
{
    return (int16_t)(table[index] - qm_mulhi_su((int16_t)(table[index] - table[index + 1u]), fraction_q16));
}

void fieldweak_trim(fieldweak_t *fw, const fieldweak_params_t *p, voltage_q14_t free_q14, speed_erpm_t speed_erpm)
{
    int16_t step = p->trim_step_q13;
    if (qm_beyond(speed_erpm, p->trim_speed_erpm)) {
        step = qm_clamp((int16_t)(free_q14 >> FIELDWEAK_TRIM_SHIFT), (int16_t)-p->trim_most_q13, p->trim_step_q13);
    }
    fw->trim_q13 = qm_clamp((int16_t)(fw->trim_q13 + step), (int16_t)-p->trim_max_q13, 0);
}

void fieldweak_tick(fieldweak_t *fw, const fieldweak_params_t *p, motor_model_t *model, speed_erpm_t ref_erpm)
{
    int16_t speed = qm_abs(ref_erpm), above = (int16_t)(speed - p->on_speed_erpm), filter, ratio_q15;
    uint16_t index = 0, fraction_q16 = 0;
    model->kfilter_esdq_q16 = p->kfilter_esdq_q16;
    if (above > 0) {
        uint32_t place_q16 = qm_muluu((uint16_t)above, p->index_per_count_q16);
        index = (uint16_t)(place_q16 >> 16);
        fraction_q16 = (uint16_t)place_q16;
        model->kfilter_esdq_q16 = p->kfilter_esdq_fw_q16;
        if (index > FIELDWEAK_ENTRIES - 2) {
            index = FIELDWEAK_ENTRIES - 2;
            fraction_q16 = 65535u;
        }
    }
    filter = (int16_t)qm_mulhi_uu((uint16_t)speed, p->esdq_per_erpm_q13);
    if (filter < (int16_t)(model->kfilter_esdq_q16 >> 3)) {
        model->kfilter_esdq_q16 = (int16_t)(8 * ((filter > FIELDWEAK_FILTER_LEAST / 8) ? filter : FIELDWEAK_FILTER_LEAST / 8));
    }
    fw->index = index;
    fw->table_q13 = fieldweak_between(p->idref_q13, index, fraction_q16);
    model->inv_kfi = fieldweak_between(p->inv_kfi, index, fraction_q16);
    ratio_q15 = fieldweak_between(p->ls_over2ls0_q15, index, fraction_q16);
    model->ls_q16 = (uint16_t)(qm_muluu(p->ls_base_q16, (uint16_t)ratio_q15) >> 14);
}
