/* What follows the bus: called, so that the start and the interrupt share one copy. */
#include "drive/bus.h"

void bus_update_gain(drive_t *d, const drive_params_t *p, int16_t bus_q15)
{
    /* the least keeps the quotient within 16 bits */
    int16_t used_q15 = (int16_t)((bus_q15 < p->bus_under_q15) ? p->bus_under_q15 : bus_q15);
    d->duty_per_volt_q16 = qm_divud(p->duty_per_volt_numerator, (uint16_t)((uint16_t)used_q15 << 1));
}

void bus_update_voltage_limit(drive_t *d, const drive_params_t *p)
{
    int16_t bus_q15 = qm_clamp(qm_hi(d->bus_q31), 0, p->bus_used_q15);
    voltage_circle_of(&d->circle, (int16_t)qm_mulhi_uu((uint16_t)((uint16_t)bus_q15 << p->bus_shift), p->voltage_limit_per_bus_q16));
}
