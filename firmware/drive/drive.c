/* The drive's beginnings: the object at power-up and the preparation of each start. */
#include "drive/drive.h"

/** Zeroes a part of the object: a constant copy of nothing would cost its size in RAM or flash. */
QM_RARE void drive_clear(void *begin, const void *end)
{
    uint8_t *byte = begin;
    while (byte != end) {
        *byte = 0;
        byte++;
    }
}

void drive_gain_step(drive_t *d, const drive_params_t *p)
{
    int16_t bus_q15 = qm_hi(d->bus_q31);
    if (bus_q15 < p->bus_under_q15) {
        bus_q15 = p->bus_under_q15; /* keeps the quotient within 16 bits */
    }
    d->duty_per_volt_q16 = qm_divud(p->duty_per_volt_numerator, (uint16_t)((uint16_t)bus_q15 << 1));
}

void drive_circle_step(drive_t *d, const drive_params_t *p)
{
    int16_t bus_q15 = qm_clamp(qm_hi(d->bus_q31), 0, p->bus_over_q15); /* above it nothing runs, and the formats end */
    d->circle.limit_q14 = (int16_t)qm_mulhi_uu((uint16_t)((uint16_t)bus_q15 << 1), p->voltage_limit_per_bus_q16);
    d->circle.reciprocal = voltage_circle_reciprocal(d->circle.limit_q14);
}

void drive_init(drive_t *d, const drive_params_t *p)
{
    drive_clear(d, &d[1]);
    d->direction = 1;
    d->bus_q31 = (int32_t)p->bus_nominal_q15 * 65536;
    drive_gain_step(d, p);
    drive_circle_step(d, p);
    fieldweak_tick(&d->fieldweak, &p->fieldweak, &d->tuning, 0);
    d->state = (uint16_t)DRIVE_CALIBRATE;
}

void drive_start(drive_t *d, const drive_params_t *p, int16_t direction)
{
    if (d->state != (uint16_t)DRIVE_STOPPED || d->command.run) {
        return;
    }
    d->direction = direction;
    drive_clear(&d->estimator, &d->stall_count); /* up to control: all that a run needs anew */
    fieldweak_tick(&d->fieldweak, &p->fieldweak, &d->tuning, 0);
    d->control.ref_q13.q = (int16_t)(direction * p->open_loop_q13);
    d->control.iq_limit_q13 = p->current_max_q13;
    d->control.brake_limit_q13 = p->current_max_q13;
    d->forced.speed_q10 = 0;
    d->forced.angle_q32 = (direction >= 0) ? 0xC0000000ul : 0x40000000ul; /* the lock sweeps it to zero */
    d->angle = forced_angle(&d->forced);
    d->frame = trig_sincos_called(d->angle);
    d->slots = 0;
#ifdef IDENTIFY
    drive_clear(&d->identify, &d[1]);
    identify_start(d, p);
#endif
    d->command.run = 1;
}
