/* Sine and cosine from a table of 128 steps a turn, and the circle limit sqrt(1 - x^2), without a square root or a branch. */
#ifndef CONTROL_TRIG_H
#define CONTROL_TRIG_H

#include "control/qmath.h"

#define TRIG_SIN_STEPS 128 /* of a turn */
#define TRIG_SIN_ENTRIES (TRIG_SIN_STEPS / 2)
#define TRIG_CIRCLE_STEPS 64

/** sin(2 pi i / 128) * 32757, i = 0..63. The amplitude is 10 below 32767 because interpolation by the derivative overshoots by 10. */
extern const int16_t trig_sin_table[TRIG_SIN_ENTRIES];

/** sqrt(1 - (i/64)^2) in Q15, i = 0..64, rounded down so that the circle is never left. */
extern const int16_t trig_circle_table[TRIG_CIRCLE_STEPS + 1];

/** Sine and cosine of one angle. */
typedef struct {
    q15_t sin; /**< Q15, amplitude 32757..32767 */
    q15_t cos; /**< Q15 */
} sincos_t;

/** sin and cos of an angle: nearest table entry, corrected along the derivative: sin(a+x) = sin a + x cos a.
 *  Error at most 12 LSB (0.04 %). */
sincos_t trig_sincos(angle_t angle);

/** Direction of the vector (x, y), to a quarter of a degree; 0 of a vector that has none. @param x,y -32767 .. 32767 */
angle_t trig_direction(int16_t x, int16_t y);

/** sqrt(1 - x^2) for 0 <= x <= 1 in Q15, linear between table entries: a chord, so above the circle by a tenth of a count at most. */
q15_t trig_circle(q15_t x);

#endif
