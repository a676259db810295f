/* Field weakening by table: the speed reference gives the d current and adapts the estimator, as in AN1292. */
#include "control/fieldweak.h"

#include "control/tuned.h"

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
