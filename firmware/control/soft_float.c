/* Positive numbers with 16 significant bits and any exponent, and integer square roots, for background work whose range no Q format holds. */
#include "control/soft_float.h"

soft_float_t soft_float_of(uint32_t x)
{
    soft_float_t n = { 0, 0 };
    if (x != 0u) {
        uint32_t left = x;
        n.e = 16;
        while (left < 0x80000000ul) {
            left <<= 1;
            n.e--;
        }
        n.m = (uint16_t)(left >> 16);
    }
    return n;
}

soft_float_t soft_float_scaled(uint32_t x, int16_t bits)
{
    soft_float_t n = soft_float_of(x);
    n.e = (int16_t)(n.e - bits);
    return n;
}

soft_float_t soft_float_mul(soft_float_t a, soft_float_t b)
{
    soft_float_t n = soft_float_of(qm_muluu(a.m, b.m));
    n.e = (int16_t)(n.e + a.e + b.e);
    return n;
}

soft_float_t soft_float_div(soft_float_t a, soft_float_t b)
{
    soft_float_t n = { 0, 0 };
    if (b.m != 0u) { /* then 32768 or more: above the numerator's upper word */
        n = soft_float_of(qm_divud((uint32_t)a.m << 15, b.m));
        n.e = (int16_t)(n.e + a.e - b.e - 15);
    }
    return n;
}

uint16_t soft_float_to_uint16(soft_float_t a)
{
    if (a.e > 0) {
        return 65535u;
    }
    if (a.e == 0) {
        return a.m;
    }
    if (a.e < -16) {
        return 0;
    }
    return (uint16_t)((((uint32_t)a.m >> (uint16_t)(-a.e - 1)) + 1u) >> 1);
}

uint32_t soft_float_to_uint32(soft_float_t a)
{
    if (a.e > 16) {
        return 0xFFFFFFFFul;
    }
    return (a.e < 0) ? soft_float_to_uint16(a) : (uint32_t)a.m << (uint16_t)a.e;
}

int32_t soft_float_times(int32_t x, soft_float_t a)
{
    soft_float_t n = soft_float_mul(soft_float_of((uint32_t)((x < 0) ? -x : x)), a);
    uint32_t size = 0;
    if (n.e >= 0) {
        size = (n.e > 14) ? 0x3FFFFFFFul : (uint32_t)n.m << (uint16_t)n.e;
    } else if (n.e > -16) {
        size = (uint32_t)n.m >> (uint16_t)-n.e;
    } else { /* below one */
    }
    return (x < 0) ? -(int32_t)size : (int32_t)size;
}

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
