/* BRINGUP, the steps without current: bus divider, both current signals at rest, the fault input. */
#ifndef DRIVE_MODES_BRINGUP_REST_H
#define DRIVE_MODES_BRINGUP_REST_H

#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

/** The supply as it is measured, against NOMINAL_BUS_V. */
void bringup_step_bus(bringup_guide_t *g, const drive_t *d);

/** Means of both current signals first, then how far their samples are off them. @param noises 1: the second time */
void bringup_step_rest(bringup_guide_t *g, drive_t *d, uint16_t noises);

/** Judges offset and noise of both signals. */
void bringup_step_signals(bringup_guide_t *g, const drive_t *d, const drive_params_t *p);

/** The fault input is high at rest. */
void bringup_step_fault_rest(bringup_guide_t *g, drive_t *d);

/** It trips when the user pulls it low ... */
void bringup_step_fault_input(bringup_guide_t *g, const drive_t *d);

/** ... and is high again afterwards. */
void bringup_step_fault_open(bringup_guide_t *g, drive_t *d);

#endif

#endif
