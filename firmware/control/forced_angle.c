/* The forced angle of the start: it turns slowly while the current grows, then a ramp takes it up to the hand-over speed. */
#include "control/forced_angle.h"

QM_WRAPS int16_t forced_angle_accelerate(forced_angle_t *f, const forced_angle_params_t *p, int16_t direction, uint16_t periods)
{
    int32_t speed_q10 = f->speed_q10 + qm_mulsu(f->increase_q10, periods);
    uint32_t step_q32;
    if (speed_q10 > p->end_speed_q10) {
        speed_q10 = p->end_speed_q10;
    }
    f->speed_q10 = speed_q10;
    step_q32 = (uint32_t)qm_shift(speed_q10, 6);
    f->step_q32 = (direction >= 0) ? step_q32 : 0u - step_q32;
    return (int16_t)(speed_q10 == p->end_speed_q10);
}

INLINE void forced_angle_move(forced_angle_t *f)
{
    f->angle_q32 = qm_turn_add(f->angle_q32, f->step_q32);
}

INLINE angle_t forced_angle(const forced_angle_t *f)
{
    return (angle_t)(f->angle_q32 >> 16);
}
