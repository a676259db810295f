/* Angles: sine and cosine from a table of 128 steps a turn, the circle sqrt(1 - x^2), and the angle that a start forces on the rotor. */
#ifndef CONTROL_ANGLE_H
#define CONTROL_ANGLE_H

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

/** sin and cos of an angle: nearest table entry, corrected along the derivative: sin(a+x) = sin a + x cos a. Error at most 12 LSB (0.04 %). */
sincos_t trig_sincos(angle_t angle);

/** Direction of the vector (x, y), to a quarter of a degree; 0 of a vector that has none. @param x,y -32767 .. 32767 */
angle_t trig_direction(int16_t x, int16_t y);

/** sqrt(1 - x^2) for 0 <= x <= 1 in Q15, linear between table entries: a chord, so above the circle by a tenth of a count at most. */
q15_t trig_circle(q15_t x);

/* ---- the forced angle of the start: it turns slowly while the current grows, then a ramp takes it up to the hand-over speed ---- */

/** Constants of the ramp, in AN1292's 1/1024 angle counts per period. */
typedef struct {
    int32_t end_speed_q10;     /**< END_SPEED_RPM * P * Ts * 65536/60 * 1024 */
    int16_t increase_rate_q10; /**< OPENLOOP_RAMPSPEED_INCREASERATE: added every period of the ramp, as a rule */
} forced_angle_params_t;

/** State. */
typedef struct {
    int32_t speed_q10;    /**< along the direction, 1/1024 angle counts per period; negative while the rotor still turns against it */
    uint32_t angle_q32;   /**< the fraction below one count is kept, so the speed is exact */
    uint32_t step_q32;    /**< of the angle, every period: the speed with the direction's sign */
    int16_t increase_q10; /**< of the speed, every period: 0 or more */
} forced_angle_t;

/** Accelerates. @param direction +1 or -1 @param periods 1 or 2, since the last time @return nonzero at the end speed */
int16_t forced_angle_accelerate(forced_angle_t *f, const forced_angle_params_t *p, int16_t direction, uint16_t periods);

/** A period passes. */
void forced_angle_move(forced_angle_t *f);

/** The angle in counts. */
angle_t forced_angle(const forced_angle_t *f);

#endif
