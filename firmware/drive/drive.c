/* The drive's beginnings: the object at power-up and the preparation of each start. */
#include "drive/drive.h"

#include "drive/begin.h"
#include "drive/bus.h"
#include "drive/param_init.h"
#include "drive/salient.h"
#include "drive/state.h"

void drive_zero(void *object, uint16_t size)
{
    uint8_t *byte = object;
    uint16_t left = size;
    do {
        *byte = 0;
        byte++;
        left--;
    } while (left != 0u);
}

void drive_fail(drive_t *d, drive_fault_t fault)
{
    drive_raise(d, fault);
}

#ifdef __XC16__
/* The image keeps every byte of an object that it reads by an index. The tables of constant parameters are therefore objects of their own, and
 * nothing is left of all others, which are in the instructions. */
static const int16_t constant_idref_q13[FIELDWEAK_ENTRIES] = PARAM_18(PARAM_IDREF);
static const int16_t constant_inv_kfi[FIELDWEAK_ENTRIES] = PARAM_18(PARAM_INVKFI_ENTRY);
static const int16_t constant_ls_over2ls0_q15[FIELDWEAK_ENTRIES] = PARAM_18(PARAM_LS_ENTRY);
static const fieldweak_tables_t constant_tables = { constant_idref_q13, constant_inv_kfi, constant_ls_over2ls0_q15 };
#define TABLES(p, others) (QM_CONSTANT((p)->end_erpm) ? &constant_tables : (others))
#else
#define TABLES(p, others) (others)
#endif

void drive_update_model(drive_run_t *run, const drive_params_t *p, speed_erpm_t ref_erpm)
{
    const fieldweak_tables_t tables = fieldweak_tables(&p->fieldweak);
    fieldweak_tick(&run->fieldweak, &p->fieldweak, TABLES(p, &tables), &run->model, ref_erpm);
    salient_model(run, p);
    adaptation_apply(&run->adaptation, &p->adaptation, &run->model);
}

void drive_init(drive_t *d, const drive_params_t *p)
{
    drive_zero(d, sizeof *d);
    d->direction = 1;
    SELFTEST_KEEP(d, direction, 1);
    SELFTEST_KEEP(d, state, DRIVE_CALIBRATE); /* 0, as all of it: drive_enter() would find nothing else to do */
    SELFTEST_KEEP(d, fault, FAULT_NONE);
    SELFTEST_KEEP(d, offset_a, 0);
    SELFTEST_KEEP(d, offset_b, 0);
    d->bus_q31 = (int32_t)p->bus_nominal_q15 * 65536;
    bus_update_gain(d, p, p->bus_nominal_q15);
    bus_update_voltage_limit(d, p);
    drive_update_model(&d->run, p, p->end_erpm);
}

void drive_start(drive_t *d, const drive_params_t *p, int16_t direction)
{
    if (d->state == (uint16_t)DRIVE_STOPPED && !d->command.run) {
        drive_begin(d, p, direction);
    }
}
