/* What flows against what is asked for, in closed loop: a d current that stays off means a noisy or wrong signal, a phase without current an open
 * one. No limit explains either: of the voltage the d axis takes its part first, and a phase carries its share of any current. */
#ifndef DRIVE_DEVIATION_H
#define DRIVE_DEVIATION_H

#include "drive/drive.h"

/** Sums of the phases' currents. */
typedef struct {
    uint16_t asked[3], flows[3]; /**< |current| that the references ask of the phases and that is measured, Q13 / 16 */
    uint16_t samples;            /**< in the sums */
} deviation_sums_t;

/** Mean size of the d current's deviation over half a second, and what the phases carry. Zero is a valid start. */
typedef struct {
    int32_t id_q16; /**< Q13 counts with 16 fraction bits */
    deviation_sums_t sums;
    uint16_t sampled_tick; /**< period of the last sample */
} deviation_t;

/** Every pass of the background. @return drive_fault_t: OPEN_PHASE when a phase carries next to none of what is asked of it, or none */
uint16_t deviation_phases(deviation_t *v, const drive_t *d, const drive_params_t *p);

/** Every millisecond in the background. @return drive_fault_t: CURRENT_SENSOR when the d current stays further off than dead time and noise
 *  make it, or none */
uint16_t deviation_tick(deviation_t *v, const drive_t *d, const drive_params_t *p);

#endif
