/* Clarke, Park, its inverse and the phase currents of a vector: named directions, both senses of rotation, and the reference. */
#include "control/transforms.h"
#include "golden.h"
#include "golden_clarke.h"
#include "golden_inverse_park.h"
#include "golden_park.h"
#include "golden_phases.h"
#include "unity.h"

static dq_t park_at(int16_t alpha, int16_t beta, angle_t angle)
{
    alphabeta_t x = { alpha, beta };
    return park(x, trig_sincos(angle));
}

static alphabeta_t inverse_park_at(int16_t d, int16_t q, angle_t angle)
{
    dq_t x = { d, q };
    return inverse_park(x, trig_sincos(angle));
}

void test_transformations_equal_the_reference(void)
{
    GOLDEN_EACH(clarke, c) {
        alphabeta_t r = clarke(c.a, c.b);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(c.alpha, r.alpha, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(c.beta, r.beta, golden_row(n));
    }
    GOLDEN_EACH(park, p) {
        dq_t r = park_at(p.alpha, p.beta, p.angle);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(p.d, r.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(p.q, r.q, golden_row(n));
    }
    GOLDEN_EACH(phases, v) {
        dq_t x = { v.d, v.q };
        phases_t r = phases_of(x, trig_sincos(v.angle));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.a, r.a, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.b, r.b, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.c, r.c, golden_row(n));
    }
    GOLDEN_EACH(inverse_park, i) {
        alphabeta_t r = inverse_park_at(i.d, i.q, i.angle);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(i.alpha, r.alpha, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(i.beta, r.beta, golden_row(n));
    }
}

typedef struct {
    const char *what;
    int16_t x, y;   /* phases A and B, alpha and beta, or d and q */
    angle_t angle;
    int16_t r, s;   /* what they become */
} direction_t;

void test_directions_of_clarke(void)
{
    static const direction_t cases[] = {
        { "from A to B and C: alpha", 8192, -4096, 0, 16384, 0 },
        { "from B to C: beta", 0, 7094, 0, 0, 16383 }, /* sqrt(3)/2 of full scale */
        { "from C to B: negative beta", 0, -7094, 0, 0, -16383 },
        { "highest in B, then in C: forward", -4096, 8192, 0, -8192, 14189 },
        { "highest in C: a third of a turn further", -4096, -4096, 0, -8192, -14189 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        alphabeta_t got = clarke(cases[n].x, cases[n].y);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].r, got.alpha, cases[n].what);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1, cases[n].s, got.beta, cases[n].what);
    }
}

void test_directions_of_park_and_its_inverse(void)
{
    static const direction_t cases[] = {
        { "alpha at angle zero: d", 16384, 0, 0, 8192, 0 },
        { "beta at angle zero: q", 0, 16384, 0, 0, 8192 },
        { "along the frame: d", 0, 16384, 16384u, 8192, 0 },
        { "behind the frame: negative q", 16384, 0, 16384u, 0, -8192 },
        { "between alpha and beta, along the frame: d", 11585, 11585, 8192u, 8192, 0 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        dq_t got = park_at(cases[n].x, cases[n].y, cases[n].angle);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(4, cases[n].r, got.d, cases[n].what);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(4, cases[n].s, got.q, cases[n].what);
        alphabeta_t back = inverse_park_at(got.d, got.q, cases[n].angle); /* either halves */
        TEST_ASSERT_INT16_WITHIN_MESSAGE(4, cases[n].x / 4, back.alpha, cases[n].what);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(4, cases[n].y / 4, back.beta, cases[n].what);
    }
}

/* ---- the phase currents of a vector ---- */

static phases_t phases_at(int16_t d, int16_t q, angle_t angle)
{
    dq_t x = { d, q };
    return phases_of(x, trig_sincos(angle));
}

void test_directions_of_the_phase_currents(void)
{
    static const struct {
        const char *what;
        int16_t d, q;
        angle_t angle;
        phases_t i;
    } cases[] = {
        { "d at angle zero: into A, out of B and C", 8192, 0, 0, { 8192, -4096, -4096 } },
        { "q at angle zero: from C to B", 0, 8192, 0, { 0, 7094, -7094 } },
        { "negative q: from B to C", 0, -8192, 0, { 0, -7094, 7094 } },
        { "d a third of a turn on: into B", 8192, 0, 21845u, { -4096, 8192, -4096 } },
        { "d two thirds of a turn on: into C", 8192, 0, 43691u, { -4096, -4096, 8192 } },
        { "nothing", 0, 0, 12345u, { 0, 0, 0 } },
        { "the longest vector", 11585, 0, 0, { 11585, -5793, -5792 } },
        { "the other way", -11585, 0, 0, { -11585, 5792, 5793 } },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        phases_t i = phases_at(cases[n].d, cases[n].q, cases[n].angle);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(5, cases[n].i.a, i.a, cases[n].what);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(5, cases[n].i.b, i.b, cases[n].what);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(5, cases[n].i.c, i.c, cases[n].what);
    }
}

/** What every phase would carry on average is a direct current: dead time would be compensated for it. */
void test_phase_currents_sum_to_zero_and_none_has_an_offset_over_a_turn(void)
{
    static const int16_t lengths[] = { 11585, -11585, 5120, 30, -30, 7, 1 };
    for (unsigned n = 0; n < sizeof lengths / sizeof lengths[0]; n++) {
        int32_t a = 0, b = 0, c = 0;
        uint32_t angle;
        for (angle = 0; angle < UINT32_C(65536); angle += 64u) {
            phases_t i = phases_at(lengths[n], (int16_t)(lengths[n] / 3), (angle_t)angle);
            TEST_ASSERT_EQUAL_INT16(0, i.a + i.b + i.c);
            a += i.a;
            b += i.b;
            c += i.c;
        }
        TEST_ASSERT_INT32_WITHIN_MESSAGE(512, 0, a, golden_row(n)); /* half a count on average over the 1024 angles */
        TEST_ASSERT_INT32_WITHIN_MESSAGE(512, 0, b, golden_row(n));
        TEST_ASSERT_INT32_WITHIN_MESSAGE(512, 0, c, golden_row(n));
    }
}
