/* The drive's types: states, parameters, and the one object with everything the machine knows. */
#include "drive/drive.h"

#include "drive/limits.h"

INLINE int16_t along_direction(const drive_t *d, int16_t x)
{
    return qm_with_sign(x, d->direction);
}

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

void drive_update_model(drive_run_t *run, const drive_params_t *p, speed_erpm_t ref_erpm, speed_erpm_t speed_erpm)
{
    const uint16_t turns = (uint16_t)(run->held.phase == (uint16_t)HELD_NOT); /* as it should */
    fieldweak_tick(&run->fieldweak, &p->fieldweak, &run->model, turns ? ref_erpm : held_weakened_for(p, qm_abs(ref_erpm), qm_abs(speed_erpm)));
    salient_model(run, p);
    adaptation_apply(&run->adaptation, &p->adaptation, &run->model);
    if (held_angle_stands(&run->held)) {
        run->model.inv_kfi = 0;
    }
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
    heat_init(d, p);
    bus_update_gain(d, p, p->bus_nominal_q15);
    bus_update_voltage_limit(d, p);
    drive_update_model(&d->run, p, p->end_erpm, p->end_erpm);
}

void drive_start(drive_t *d, const drive_params_t *p, int16_t direction)
{
    if (d->state == (uint16_t)DRIVE_STOPPED && !d->command.run) {
        drive_begin(d, p, direction);
    }
}
