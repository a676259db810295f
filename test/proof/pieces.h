/* Table look-ups a piece at a time, one for each entry, so that the analysis keeps neighbours together. */
#ifndef PROOF_PIECES_H
#define PROOF_PIECES_H

#include "control/trig.h"

static inline sincos_t sincos_in_pieces(angle_t angle)
{
    for (uint16_t k = 0; k < TRIG_SIN_ENTRIES; k++) {
        if (angle < 512u * k + 256u) {
            break;
        }
    }
    return trig_sincos(angle);
}

static inline q15_t circle_in_pieces(q15_t x)
{
    for (int16_t k = 1; k < TRIG_CIRCLE_STEPS; k++) {
        if (x < 512 * k) {
            break;
        }
    }
    return trig_circle(x);
}

#endif
