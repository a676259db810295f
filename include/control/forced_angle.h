/* The forced angle of the start: it turns slowly while the current grows, then a ramp takes it up to the hand-over speed. */
#ifndef CONTROL_FORCED_ANGLE_H
#define CONTROL_FORCED_ANGLE_H

#include "control/qmath.h"

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
