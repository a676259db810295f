/* Positive numbers with 16 significant bits and any exponent, and integer square roots, for background work whose range no Q format holds. */
#ifndef CONTROL_SOFT_FLOAT_H
#define CONTROL_SOFT_FLOAT_H

#include "control/qmath.h"

/** m * 2^e; m = 32768 .. 65535, or m = e = 0 for zero. */
typedef struct {
    uint16_t m;
    int16_t e;
} soft_float_t;

/** An integer, truncated to 16 significant bits. */
soft_float_t soft_float_of(uint32_t x);

/** A constant that comes multiplied by 2^bits. */
soft_float_t soft_float_scaled(uint32_t x, int16_t bits);

/** a * b, truncated. */
soft_float_t soft_float_mul(soft_float_t a, soft_float_t b);

/** a / b, truncated; 0 for b = 0. */
soft_float_t soft_float_div(soft_float_t a, soft_float_t b);

/** Rounded, at most 65535. */
uint16_t soft_float_to_uint16(soft_float_t a);

/** Rounded, at most 2^32 - 1. */
uint32_t soft_float_to_uint32(soft_float_t a);

/** x times a, truncated towards zero, for products below 2^30. */
int32_t soft_float_times(int32_t x, soft_float_t a);

/** Square root, rounded down. */
uint16_t root_of(uint32_t x);

/** Length of (x, y), rounded down. @param x,y -32767 .. 32767 */
uint16_t root_length(int16_t x, int16_t y);

#endif
