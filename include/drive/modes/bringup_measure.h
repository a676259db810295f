/* BRINGUP: how the steps use the instrument: the bridge begins to switch, the interrupt adds up, something trips. */
#ifndef DRIVE_MODES_BRINGUP_MEASURE_H
#define DRIVE_MODES_BRINGUP_MEASURE_H

#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

#define BRINGUP_10MV(volts) ((int32_t)(PARAM_F(volts) * 100.0F + 0.5F))
#define BRINGUP_SWING_PERIODS PARAM_PERIODS(0.3F) /* the rotor swings into the field */

/* Most amplitude: 1.6 times what R and half as much again as what dead time take. Whatever the signals say, it bounds the current. */
#define BRINGUP_MOST_A (1.6F * PARAM_F(BRINGUP_CURRENT_SHARE) * PARAM_F(MAXIMUM_CURRENT_A))
#define BRINGUP_MOST_V (BRINGUP_MOST_A * (PARAM_F(MOTOR_RS_OHM) + 0.05F) + 1.5F * 4.0F / 3.0F * PARAM_DEAD_TIME_V)
#define BRINGUP_MOST_ROOM (PARAM_F(PWM_TOP_DUTY) - PARAM_F(PWM_FULL_DUTY) / 2.0F)
#define BRINGUP_MOST_AMPLITUDE ((int16_t)PARAM_MIN(BRINGUP_MOST_V / PARAM_F(NOMINAL_BUS_V) * PARAM_F(PWM_FULL_DUTY), BRINGUP_MOST_ROOM))

/** Sums anew, after so many periods at the amplitude. Write all else before: from here on the interrupt owns the instrument. */
void bringup_measure(drive_t *d, uint16_t wait);

/** The mean of a complete sum. */
int16_t bringup_mean_of(int32_t sum);

/** The bridge begins to switch, without a vector. Phase 0 of the step becomes 1. @return 1 when it does, or when it will not */
uint16_t bringup_started(bringup_guide_t *g, drive_t *d, const drive_params_t *p);

/** What has switched the bridge off is a finding, and ends it. @return 1 if something has */
uint16_t bringup_has_tripped(bringup_guide_t *g, const drive_t *d);

/** The bus voltage. */
uint16_t bringup_bus_10mv(const drive_t *d);

#endif

#endif
