/* The bus voltage: its filter, and what the modulator and the current controllers get from it. */
#ifndef DRIVE_BUS_H
#define DRIVE_BUS_H

#include "drive/protection.h"

/** The modulator's gain at a bus voltage. @param bus_q15 of full scale, any; below the under-voltage trip it counts as that */
void bus_update_gain(drive_t *d, const drive_params_t *p, int16_t bus_q15);

/** The voltage circle at the filtered bus. */
void bus_update_voltage_limit(drive_t *d, const drive_params_t *p);

/** A conversion of the bus, of full scale. */
QM_INLINE int16_t bus_now_q15(int16_t v_bus_raw)
{
    return (int16_t)((uint16_t)((uint16_t)v_bus_raw ^ 0x8000u) >> 1);
}

/** The bus that braking is limited by: the filter's delay is long enough for a small capacitor to rise by a volt or two. */
QM_INLINE int16_t bus_highest_q15(const drive_t *d, int16_t v_bus_raw)
{
    int16_t now_q15 = bus_now_q15(v_bus_raw), filtered_q15 = qm_hi(d->bus_q31);
    return (now_q15 > filtered_q15) ? now_q15 : filtered_q15;
}

/** Filters the bus, checks it, and follows the bus of this moment with the modulator's gain: after a step of the supply a late gain is a wrong
 *  voltage, which the estimator takes for speed. Every eighth period, in every state.
 *  @param v_bus_raw the converter's result, any value */
QM_INLINE void bus_step(drive_t *d, const drive_params_t *p, int16_t v_bus_raw)
{
    int16_t now_q15 = bus_now_q15(v_bus_raw);
    int16_t bus_q15 = qm_lowpass(&d->bus_q31, now_q15, 16384);

    protection_check_bus(d, p, now_q15, bus_q15);
    bus_update_gain(d, p, now_q15);
}

#endif
