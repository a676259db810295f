/* Arbitrary values for the proofs, and slices: an interval analysis is told to look at a range piece by piece. */
#ifndef PROOF_ANY_H
#define PROOF_ANY_H

#include <stdint.h>

#include "__fc_builtin.h"

/* Two compares tell an interval analysis what is left of x, and qmath.h's one compare does not; test_qmath.c shows that they are the same. */
#define qm_beyond qm_beyond_by_one_compare
#define qm_limit qm_limit_by_one_compare
#include "control/qmath.h"
#undef qm_beyond
#undef qm_limit

static inline uint16_t qm_beyond(int16_t x, int16_t most)
{
    return (uint16_t)(x > most || x < -most);
}

static inline int16_t qm_limit(int16_t x, int16_t most)
{
    if (qm_beyond(x, most)) {
        return qm_with_sign(most, x);
    }
    return x;
}

/** Any value of low..high. */
static inline int16_t any(int16_t low, int16_t high)
{
    return (int16_t)Frama_C_interval(low, high);
}

static inline uint16_t any_u(uint16_t low, uint16_t high)
{
    return (uint16_t)Frama_C_unsigned_int_interval(low, high);
}

static inline int32_t any_l(int32_t low, int32_t high)
{
    return Frama_C_long_interval(low, high);
}

static inline uint32_t any_ul(uint32_t low, uint32_t high)
{
    return Frama_C_unsigned_long_interval(low, high);
}

/** Any number of the type. */
#define ANY16() any(INT16_MIN, INT16_MAX)
#define ANYU16() any_u(0, UINT16_MAX)

/** Bounds of piece k of n of low..high; the pieces cover the range. */
static inline int16_t piece_low(int16_t low, int16_t high, int16_t k, int16_t n)
{
    return (int16_t)(low + ((int32_t)high - low) * k / n);
}

#define PIECE(low, high, k, n) any(piece_low(low, high, k, n), piece_low(low, high, (int16_t)((k) + 1), n))

#endif
