/* Integer square root, bit by bit. */
#include "control/root.h"

uint16_t root_of(uint32_t x)
{
    uint16_t r = 0, bit;
    for (bit = 0x8000u; bit != 0u; bit >>= 1) {
        uint16_t next = (uint16_t)(r | bit);
        if (qm_muluu(next, next) <= x) {
            r = next;
        }
    }
    return r;
}

uint16_t root_length(int16_t x, int16_t y)
{
    return root_of((uint32_t)(qm_mulss(x, x) + qm_mulss(y, y)));
}
