/* Clarke, Park and inverse Park: named directions, both senses of rotation, round trips, and the reference. */
#include "control/transforms.h"
#include "golden.h"
#include "golden_clarke.h"
#include "golden_inverse_park.h"
#include "golden_park.h"
#include "unity.h"

#define QUARTER_TURN 16384u
#define EIGHTH_TURN 8192u

void setUp(void)
{
}

void tearDown(void)
{
}

static dq_t park_at(int16_t alpha, int16_t beta, angle_t angle)
{
    alphabeta_t x;
    x.alpha = alpha;
    x.beta = beta;
    return park(x, trig_sincos(angle));
}

static alphabeta_t inverse_park_at(int16_t d, int16_t q, angle_t angle)
{
    dq_t x;
    x.d = d;
    x.q = q;
    return inverse_park(x, trig_sincos(angle));
}

/* ---- Clarke ---- */

void test_clarke_equals_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_CLARKE_ROWS; n++) {
        golden_clarke_t v = golden_clarke[n];
        alphabeta_t r = clarke(v.a, v.b);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.alpha, r.alpha, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.beta, r.beta, golden_row(n));
    }
}

void test_clarke_of_a_current_from_A_to_B_and_C_is_on_alpha(void)
{
    alphabeta_t r = clarke(8192, -4096);
    TEST_ASSERT_EQUAL_INT16(16384, r.alpha);
    TEST_ASSERT_EQUAL_INT16(0, r.beta);
}

void test_clarke_of_a_current_from_B_to_C_is_on_beta(void)
{
    alphabeta_t r = clarke(0, 7094); /* sqrt(3)/2 of full scale */
    TEST_ASSERT_EQUAL_INT16(0, r.alpha);
    TEST_ASSERT_INT16_WITHIN(1, 16383, r.beta);
}

void test_clarke_of_a_current_from_C_to_B_is_on_negative_beta(void)
{
    alphabeta_t r = clarke(0, -7094);
    TEST_ASSERT_EQUAL_INT16(0, r.alpha);
    TEST_ASSERT_INT16_WITHIN(1, -16383, r.beta);
}

void test_clarke_of_the_sequence_A_B_C_turns_forward(void)
{
    alphabeta_t at_b = clarke(-4096, 8192), at_c = clarke(-4096, -4096);
    TEST_ASSERT_EQUAL_INT16(-8192, at_b.alpha);
    TEST_ASSERT_INT16_WITHIN(1, 14189, at_b.beta);
    TEST_ASSERT_EQUAL_INT16(-8192, at_c.alpha);
    TEST_ASSERT_INT16_WITHIN(1, -14189, at_c.beta);
}

/* ---- Park ---- */

void test_park_equals_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_PARK_ROWS; n++) {
        golden_park_t v = golden_park[n];
        dq_t r = park_at(v.alpha, v.beta, v.angle);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.d, r.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.q, r.q, golden_row(n));
    }
}

void test_park_of_a_vector_along_alpha_is_on_d_at_angle_zero(void)
{
    dq_t r = park_at(16384, 0, 0);
    TEST_ASSERT_INT16_WITHIN(4, 8192, r.d);
    TEST_ASSERT_INT16_WITHIN(1, 0, r.q);
}

void test_park_of_a_vector_along_beta_is_on_q_at_angle_zero(void)
{
    dq_t r = park_at(0, 16384, 0);
    TEST_ASSERT_INT16_WITHIN(1, 0, r.d);
    TEST_ASSERT_INT16_WITHIN(4, 8192, r.q);
}

void test_park_of_a_vector_along_the_frame_is_on_d(void)
{
    dq_t r = park_at(0, 16384, QUARTER_TURN);
    TEST_ASSERT_INT16_WITHIN(4, 8192, r.d);
    TEST_ASSERT_INT16_WITHIN(1, 0, r.q);
}

void test_park_of_a_vector_behind_the_frame_is_on_negative_q(void)
{
    dq_t r = park_at(16384, 0, QUARTER_TURN);
    TEST_ASSERT_INT16_WITHIN(1, 0, r.d);
    TEST_ASSERT_INT16_WITHIN(4, -8192, r.q);
}

void test_park_holds_the_largest_vector_in_every_frame(void)
{
    uint32_t a;
    for (a = 0; a < UINT32_C(65536); a += 64u) {
        dq_t r = park_at(23170, -23170, (angle_t)a);
        int32_t square = qm_mulss(r.d, r.d) + qm_mulss(r.q, r.q);
        TEST_ASSERT_INT32_WITHIN_MESSAGE(INT32_C(25) * 16384, INT32_C(268425000), square, golden_row(a));
    }
}

/* ---- inverse Park ---- */

void test_inverse_park_equals_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_INVERSE_PARK_ROWS; n++) {
        golden_inverse_park_t v = golden_inverse_park[n];
        alphabeta_t r = inverse_park_at(v.d, v.q, v.angle);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.alpha, r.alpha, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.beta, r.beta, golden_row(n));
    }
}

void test_inverse_park_of_d_is_along_the_frame(void)
{
    alphabeta_t r = inverse_park_at(16384, 0, EIGHTH_TURN);
    TEST_ASSERT_INT16_WITHIN(4, 5793, r.alpha);
    TEST_ASSERT_INT16_WITHIN(4, 5793, r.beta);
}

void test_inverse_park_of_q_is_a_quarter_turn_ahead_of_the_frame(void)
{
    alphabeta_t r = inverse_park_at(0, 16384, EIGHTH_TURN);
    TEST_ASSERT_INT16_WITHIN(4, -5793, r.alpha);
    TEST_ASSERT_INT16_WITHIN(4, 5793, r.beta);
}

void test_park_undoes_inverse_park_within_2_counts_of_full_scale(void)
{
    uint32_t a;
    for (a = 0; a < UINT32_C(65536); a += 251u) {
        alphabeta_t x = inverse_park_at(12000, -7000, (angle_t)a);
        dq_t r = park_at(x.alpha, x.beta, (angle_t)a);
        /* a quarter of the counts; the amplitude of the sine counts twice: 0.06 % */
        TEST_ASSERT_INT16_WITHIN_MESSAGE(3, 3000, r.d, golden_row(a));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(3, -1750, r.q, golden_row(a));
    }
}
