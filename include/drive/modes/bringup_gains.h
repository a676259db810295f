/* BRINGUP, the steps that judge gains, resistance and dead time, by both levels of current and by an ammeter. */
#ifndef DRIVE_MODES_BRINGUP_GAINS_H
#define DRIVE_MODES_BRINGUP_GAINS_H

#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

/** Gain of B against A, resistance, dead time. */
void bringup_step_bridge(bringup_guide_t *g, const drive_t *d);

/** Current along phase A, which the user compares with an ammeter. A press before the question ends it. */
void bringup_step_ammeter(bringup_guide_t *g, drive_t *d, const drive_params_t *p);

/** What the ammeter and the resistance say of the gains. */
void bringup_step_gains(bringup_guide_t *g);

#endif

#endif
