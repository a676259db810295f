/* I2t: the heat that the current leaves in the winding, for motors whose sheet gives a thermal time constant.
 *
 *     dh/dt = (i_d^2 + i_q^2 - h) / I2T_TIME_SEC,  too hot from h = I2T_CURRENT_A^2
 *
 * A cold winding stands k times the current for -T ln(1 - 1/k^2). The resistance that the drive learns tells the same more slowly and of any
 * motor; it sees the housing, too. */
#ifndef DRIVE_OVERLOAD_H
#define DRIVE_OVERLOAD_H

#include "drive/drive.h"

#define OVERLOAD_STEP_MS 512u /**< a mean over so long makes a step of the heat */

/** Heat of the winding. Zero is a valid start: a cold motor. A reset forgets it. */
typedef struct {
    int32_t heat_q25; /**< square of the current that would keep the winding as hot, Q13 counts^2 / 2 */
    uint32_t sum;     /**< of the step: i^2 / 1024 times ms */
    uint16_t ms;      /**< of the step */
} overload_t;

/** A pass of the background. Between runs the winding cools. @param ms since the last pass @return 1 while a running motor is too hot */
uint16_t overload_tick(overload_t *o, const drive_t *d, const drive_params_t *p, uint16_t ms);

#endif
