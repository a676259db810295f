/* Angles: sine and cosine from a table of 128 steps a turn, the circle sqrt(1 - x^2), and the angle that a start forces on the rotor. */
#include "control/transforms.h"

INLINE sincos_t trig_sincos(angle_t angle)
{
    uint16_t nearest = (uint16_t)(angle + 256u), step = (uint16_t)(nearest >> 9) & (TRIG_SIN_ENTRIES - 1u);
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

INLINE q15_t trig_circle(q15_t x)
{
    const q15_t *entry = &trig_circle_table[(uint16_t)x >> 9];
    uint16_t fraction_q16 = (uint16_t)((uint16_t)x << 7);
    int16_t drop = (int16_t)(entry[0] - entry[1]);
    return (int16_t)(entry[0] - qm_mulhi_su(drop, fraction_q16));
}

const int16_t trig_sin_table[TRIG_SIN_ENTRIES] = {
    0, 1607, 3211, 4806, 6391, 7959, 9509, 11036, 12536, 14005, 15442, 16840, 18199, 19513, 20781, 21998,
    23163, 24271, 25322, 26311, 27236, 28097, 28889, 29612, 30264, 30842, 31346, 31775, 32128, 32402, 32599, 32718,
    32757, 32718, 32599, 32402, 32128, 31775, 31346, 30842, 30264, 29612, 28889, 28097, 27236, 26311, 25322, 24271,
    23163, 21998, 20781, 19513, 18199, 16840, 15442, 14005, 12536, 11036, 9509, 7959, 6391, 4806, 3211, 1607
};

const int16_t trig_circle_table[TRIG_CIRCLE_STEPS + 1] = {
    32767, 32762, 32750, 32730, 32702, 32666, 32622, 32570, 32509, 32441, 32364, 32279, 32185, 32083, 31973, 31854,
    31726, 31589, 31444, 31289, 31125, 30952, 30770, 30577, 30375, 30163, 29941, 29708, 29464, 29210, 28944, 28666,
    28377, 28075, 27760, 27432, 27091, 26736, 26365, 25980, 25578, 25160, 24724, 24269, 23794, 23299, 22781, 22240,
    21673, 21078, 20453, 19795, 19101, 18367, 17587, 16755, 15863, 14900, 13851, 12696, 11402, 9914, 8127, 5769,
    0
};

angle_t trig_direction(int16_t x, int16_t y)
{
    uint16_t across = (uint16_t)qm_abs(x), up = (uint16_t)qm_abs(y), steep = (uint16_t)(up > across);
    uint16_t least = steep ? across : up, most = steep ? up : across;
    q15_t r;
    angle_t angle;
    if (most == 0u) {
        return 0;
    }
    /* atan r = r pi/4 + 0.273 r (1 - r), within 0.22 degrees */
    r = (least == most) ? 32767 : qm_share(least, most);
    angle = (angle_t)(((uint16_t)r >> 2) + (uint16_t)qm_mulhi(qm_mulhi_su(r, (uint16_t)((uint16_t)(32767 - r) << 1)), 5694));
    angle = steep ? (angle_t)(0x4000u - angle) : angle;
    angle = (x < 0) ? (angle_t)(0x8000u - angle) : angle;
    return (y < 0) ? (angle_t)~angle : angle; /* to a count */
}

NOINLINE int16_t qm_less(int16_t a, int16_t b)
{
    return qm_sub_limited(a, b);
}

/* ---- the forced angle ---- */

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
