/* The look-up of field weakening: called, so that start and interrupt share one copy. */
#include "control/fieldweak.h"

void fieldweak_tick(fieldweak_t *fw, const fieldweak_params_t *p, const fieldweak_tables_t *tables, motor_model_t *model, speed_erpm_t ref_erpm)
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
    fw->table_q13 = FIELDWEAK_ENTRY(p, tables, idref_q13, index, fraction_q16);
    model->inv_kfi = FIELDWEAK_ENTRY(p, tables, inv_kfi, index, fraction_q16);
    ratio_q15 = FIELDWEAK_ENTRY(p, tables, ls_over2ls0_q15, index, fraction_q16);
    model->ls_q16 = QM_KNOWN(ratio_q15 == 16384) ? p->ls_base_q16 : (uint16_t)(qm_muluu(p->ls_base_q16, (uint16_t)ratio_q15) >> 14);
}
