/* Integer square root and length of a vector, for the background. */
#ifndef CONTROL_ROOT_H
#define CONTROL_ROOT_H

#include "control/qmath.h"

/** Square root, rounded down. */
uint16_t root_of(uint32_t x);

/** Length of (x, y), rounded down. @param x,y -32767 .. 32767 */
uint16_t root_length(int16_t x, int16_t y);

#endif
