/* The bus voltage: its filter, and what the modulator and the current controllers get from it. */
#ifndef DRIVE_BUS_H
#define DRIVE_BUS_H

#include "drive/protection.h"

/** The modulator's gain at a bus voltage. @param bus_q15 of full scale, any; below the under-voltage trip it counts as that */
void bus_update_gain(drive_t *d, const drive_params_t *p, int16_t bus_q15);

/** The voltage circle at the filtered bus. */
void bus_update_voltage_limit(drive_t *d, const drive_params_t *p);

/** The bus of this moment, Q15 of full scale. @param v_bus_raw the converter's result, any value */
QM_INLINE int16_t bus_sample(int16_t v_bus_raw)
{
    return (int16_t)((uint16_t)((uint16_t)v_bus_raw ^ 0x8000u) >> 1);
}

/** Filters the bus, checks it, and follows the bus of this moment with the modulator's gain: after a step of the supply a late gain is a wrong
 *  voltage, which the estimator takes for speed. Every slow step, in every state.
 *  @param v_bus_raw the converter's result, any value */
QM_INLINE void bus_step(drive_t *d, const drive_params_t *p, int16_t v_bus_raw)
{
    int16_t now_q15 = bus_sample(v_bus_raw);
    int16_t bus_q15 = qm_lowpass(&d->bus_q31, now_q15, 16384);

    protection_check_bus(d, p, now_q15, bus_q15);
    bus_update_gain(d, p, now_q15);
}

#endif
