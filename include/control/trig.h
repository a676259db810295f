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
QM_INLINE sincos_t trig_sincos(angle_t angle)
{
    uint16_t nearest = (uint16_t)(angle + 256u);
    uint16_t step = (uint16_t)(nearest >> 9) & (TRIG_SIN_ENTRIES - 1u);
    q15_t s = trig_sin_table[step];
    q15_t c = trig_sin_table[step ^ (TRIG_SIN_ENTRIES / 2u)]; /* a quarter of a turn away, to the one side or the other */
    /* the low nine bits as a signed fraction of one step, then in radians * 65536: 2 pi / 128 / 2 * 65536 / 32768 */
    int16_t rest_q16_rad = qm_mulhi((int16_t)(uint16_t)(angle << 7), 3217);
    sincos_t r;
    if (nearest & 0x8000u) {
        s = (int16_t)-s;
    }
    if ((uint16_t)(nearest + 0x4000u) & 0x8000u) {
        c = (int16_t)-c;
    }
    r.sin = (int16_t)(s + qm_mulhi(c, rest_q16_rad));
    r.cos = (int16_t)(c - qm_mulhi(s, rest_q16_rad));
    return r;
}

/** The same as one called copy, for where it runs rarely. @param r written */
void trig_sincos_called(sincos_t *r, angle_t angle);

/** Direction of the vector (x, y), to a quarter of a degree; 0 of a vector that has none. @param x,y -32767 .. 32767 */
angle_t trig_direction(int16_t x, int16_t y);

/** sqrt(1 - x^2) for 0 <= x <= 1 in Q15, linear between table entries: a chord, so above the circle by a tenth of a count at most. */
QM_INLINE q15_t trig_circle(q15_t x)
{
    const q15_t *entry = &trig_circle_table[(uint16_t)x >> 9];
    uint16_t fraction_q16 = (uint16_t)((uint16_t)x << 7);
    int16_t drop = (int16_t)(entry[0] - entry[1]);
    return (int16_t)(entry[0] - qm_mulhi_su(drop, fraction_q16));
}

#endif
