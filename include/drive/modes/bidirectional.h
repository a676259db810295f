/* BIDIRECTIONAL_SPEED: the middle of the potentiometer is the lowest speed, its two halves are the two directions. */
#ifndef DRIVE_MODES_BIDIRECTIONAL_H
#define DRIVE_MODES_BIDIRECTIONAL_H

#include "drive/drive.h"

#ifdef BIDIRECTIONAL_SPEED
#define MODE_TWO_DIRECTIONS 1
#else
#define MODE_TWO_DIRECTIONS 0
#endif

/** The potentiometer's travel and direction. @param direction of the running motor, which the middle keeps; becomes +1 or -1
 *  @return the travel, Q16 */
QM_INLINE uint16_t mode_pot_split(uint16_t pot_q16, int16_t *direction)
{
#ifdef BIDIRECTIONAL_SPEED
    int16_t signed_q15 = (int16_t)(pot_q16 ^ 0x8000u);
    uint16_t travel_q16 = (uint16_t)(2u * (uint16_t)qm_abs(signed_q15));
    if (travel_q16 > 2048u) { /* three per cent around the middle */
        *direction = (int16_t)((signed_q15 > 0) ? 1 : -1);
    }
    return travel_q16;
#else
    *direction = 1;
    return pot_q16;
#endif
}

#endif
