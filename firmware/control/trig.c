/* The tables behind trig.h, of which test/golden recomputes every entry, and its called function. */
#include "control/trig.h"

const int16_t trig_sin_table[TRIG_SIN_ENTRIES] = {
    0, 1607, 3211, 4806, 6391, 7959, 9509, 11036, 12536, 14005, 15442, 16840,
    18199, 19513, 20781, 21998, 23163, 24271, 25322, 26311, 27236, 28097, 28889, 29612,
    30264, 30842, 31346, 31775, 32128, 32402, 32599, 32718, 32757, 32718, 32599, 32402,
    32128, 31775, 31346, 30842, 30264, 29612, 28889, 28097, 27236, 26311, 25322, 24271,
    23163, 21998, 20781, 19513, 18199, 16840, 15442, 14005, 12536, 11036, 9509, 7959,
    6391, 4806, 3211, 1607
};

const int16_t trig_circle_table[TRIG_CIRCLE_STEPS + 1] = {
    32767, 32762, 32750, 32730, 32702, 32666, 32622, 32570, 32509, 32441, 32364, 32279,
    32185, 32083, 31973, 31854, 31726, 31589, 31444, 31289, 31125, 30952, 30770, 30577,
    30375, 30163, 29941, 29708, 29464, 29210, 28944, 28666, 28377, 28075, 27760, 27432,
    27091, 26736, 26365, 25980, 25578, 25160, 24724, 24269, 23794, 23299, 22781, 22240,
    21673, 21078, 20453, 19795, 19101, 18367, 17587, 16755, 15863, 14900, 13851, 12696,
    11402, 9914, 8127, 5769, 0
};

void trig_sincos_called(sincos_t *r, angle_t angle)
{
    *r = trig_sincos(angle);
}

angle_t trig_direction(int16_t x, int16_t y)
{
    uint16_t across = (uint16_t)qm_size(x), up = (uint16_t)qm_size(y), steep = (uint16_t)(up > across);
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
