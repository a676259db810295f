/* Field weakening's parameters as the golden vectors have them. */
#ifndef GOLDEN_FIELDWEAK_PARAMS_H
#define GOLDEN_FIELDWEAK_PARAMS_H

#include "control/motor_model.h"
#include "golden.h"
#include "golden_fieldweak.h"
#include "golden_fieldweak_tables.h"

/** Tables, the speed from which they hold, a step of 1024 electrical rpm, and the base inductance; the rest of p stays as it is. */
static void golden_fieldweak_params(fieldweak_params_t *p)
{
    GOLDEN_EACH(fieldweak_tables, v)
    {
        p->idref_q13[n] = v.idref;
        p->inv_kfi[n] = v.inv_kfi;
        p->ls_over2ls0_q15[n] = v.ls;
    }
    p->on_speed_erpm = GOLDEN_FIELDWEAK_ON_SPEED;
    p->index_per_count_q16 = 65536u >> SPEED_INDEX_CONST;
    p->ls_base_q16 = (uint16_t)GOLDEN_FIELDWEAK_LS_BASE;
}

#endif
