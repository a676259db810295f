/* Fixed-point arithmetic: products, upper words, division, limits and the low-pass of Equation 7. */
#include "control/qmath.h"
#include "golden.h"
#include "golden_divide.h"
#include "golden_limits.h"
#include "golden_lowpass.h"
#include "golden_multiply.h"
#include "unity.h"

void test_products_and_upper_words_equal_the_reference(void)
{
    GOLDEN_EACH(multiply, v) {
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.ss, qm_mulss(v.a, v.b), golden_row(n));
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.su, qm_mulsu(v.a, (uint16_t)v.b), golden_row(n));
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(v.uu, qm_muluu((uint16_t)v.a, (uint16_t)v.b), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.hi, qm_mulhi(v.a, v.b), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.hi_su, qm_mulhi_su(v.a, (uint16_t)v.b), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.hi_uu, qm_mulhi_uu((uint16_t)v.a, (uint16_t)v.b), golden_row(n));
    }
}

void test_quotients_equal_the_reference(void)
{
    GOLDEN_EACH(divide, v) {
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.q, qm_divud(v.n, v.d), golden_row(n));
    }
}

void test_magnitude_difference_and_clamp_equal_the_reference(void)
{
    GOLDEN_EACH(limits, v) {
        int16_t low = (v.b < v.c) ? v.b : v.c, high = (v.b < v.c) ? v.c : v.b;
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.abs_a, qm_abs(v.a), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.sub, qm_sub_limited(v.a, v.b), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.clamped, qm_clamp(v.a, low, high), golden_row(n));
    }
}

void test_low_pass_equals_the_reference(void)
{
    int32_t y = 0;
    GOLDEN_EACH(lowpass, v) {
        int16_t out;
        y = v.start ? 0 : y;
        out = qm_lowpass(&y, v.x, v.k);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.y, y, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(qm_hi(v.y), out, golden_row(n));
    }
}

void test_low_pass_settles_exactly_on_its_input(void)
{
    static const int16_t gains[] = { 2400, 328, 1496 };
    uint16_t g, n;
    for (g = 0; g < 3u; g++) {
        int32_t y = 0;
        for (n = 0; n < 8000u; n++) {
            int16_t x = (n < 4000u) ? -12345 : 12345, out = qm_lowpass(&y, x, gains[g]);
            TEST_ASSERT_EQUAL_INT16((n % 4000u == 3999u) ? x : out, out);
        }
    }
}

void test_shift_multiplies_by_a_power_of_two_with_either_sign(void)
{
    static const struct {
        int32_t x, shifted;
        uint16_t bits;
    } cases[] = {
        { 0, 0, 15 }, { 1, 1, 0 }, { -1, -1, 0 }, { 1, 32768, 15 }, { -1, -32768, 15 }, { -3, -24, 3 }, { 65535, INT32_C(2147450880), 15 },
        { -65536, INT32_MIN, 15 }, { INT32_C(1073741823), INT32_C(2147483646), 1 }, { INT32_MIN, INT32_MIN, 0 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_EQUAL_INT32_MESSAGE(cases[n].shifted, qm_shift(cases[n].x, cases[n].bits), golden_row(n));
    }
}

void test_share_is_part_over_whole_in_Q15_rounded_down(void)
{
    static const uint16_t cases[][3] = {
        { 0, 1, 0 }, { 1, 2, 16384 }, { 1, 3, 10922 }, { 2, 3, 21845 }, { 499, 1000, 16351 },
        { 65534u, 65535u, 32767 }, { 1, 65535u, 0 }, { 2, 65535u, 1 }, { 32767, 32768u, 32767 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n][2], qm_share(cases[n][0], cases[n][1]), golden_row(n));
    }
}

void test_limits_of_the_upper_word_keep_the_lower_one_within(void)
{
    static const int32_t cases[][2] = { { INT32_C(65536) * 5, INT32_C(65536) * 5 }, { INT32_C(65536) * 5 - 1, INT32_C(65536) * 5 - 1 },
                                        { INT32_C(65536) * 5 + 1, INT32_C(65536) * 5 }, { INT32_MAX, INT32_C(65536) * 5 },
                                        { -INT32_C(65536) * 3, -INT32_C(65536) * 3 }, { 1 - INT32_C(65536) * 3, 1 - INT32_C(65536) * 3 },
                                        { -1 - INT32_C(65536) * 3, -INT32_C(65536) * 3 }, { INT32_MIN, -INT32_C(65536) * 3 }, { 7, 7 } };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_EQUAL_INT32_MESSAGE(cases[n][1], qm_clamp_hi(cases[n][0], -3, 5), golden_row(n));
    }
}

void test_a_sum_ends_at_its_limits(void)
{
    static const int32_t cases[][2] = { { 5, 5 }, { 6, 5 }, { INT32_MAX, 5 }, { -3, -3 }, { -4, -3 }, { INT32_MIN, -3 }, { 0, 0 } };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n][1], qm_within(cases[n][0], -3, 5), golden_row(n));
    }
    TEST_ASSERT_EQUAL_INT16(INT16_MIN, qm_within(-40000, INT16_MIN, INT16_MAX));
    TEST_ASSERT_EQUAL_INT16(INT16_MAX, qm_within(40000, INT16_MIN, INT16_MAX));
}

/* ---- ranges and magnitudes ---- */

/** Numbers around each bound of -most..most and the ends of the format. */
static int16_t near_bound(int16_t most, int16_t k)
{
    static const int32_t ends[] = { INT16_MIN + 2, 0, INT16_MAX - 2 };
    int32_t at = (k < 15) ? ends[k / 5] : (k < 20) ? most : -(int32_t)most;
    at += k % 5 - 2;
    return (int16_t)((at > INT16_MAX) ? INT16_MAX : (at < INT16_MIN) ? INT16_MIN : at);
}

#define NEAR_COUNT 25
static const int16_t mosts[] = { 0, 1, 2, 255, 4681, 16383, 16384, 20000, 32765, 32766, 32767 };

/** What the proofs take in place of the one compare. */
void test_one_compare_is_two_for_every_limit(void)
{
    for (int32_t most = 0; most <= INT16_MAX; most++) { /* it goes up or down by one with x, so that the ends tell all */
        const int32_t ends[] = { INT16_MIN, -most - 1, -most, 0, most, most + 1, INT16_MAX };
        for (unsigned n = 0; n < sizeof ends / sizeof ends[0]; n++) {
            const int16_t x = (int16_t)((ends[n] > INT16_MAX) ? INT16_MAX : ends[n]);
            TEST_ASSERT_EQUAL_UINT16(x > most || x < -most, qm_beyond(x, (int16_t)most));
        }
    }
}

void test_a_number_is_beyond_a_limit_of_either_sign_only_if_its_magnitude_is_larger(void)
{
    for (unsigned n = 0; n < sizeof mosts / sizeof mosts[0]; n++) {
        for (int16_t k = 0; k < NEAR_COUNT; k++) {
            int32_t x = near_bound(mosts[n], k), limited = (x > mosts[n]) ? mosts[n] : (x < -(int32_t)mosts[n]) ? -(int32_t)mosts[n] : x;
            TEST_ASSERT_EQUAL_UINT16(x > mosts[n] || x < -(int32_t)mosts[n], qm_beyond((int16_t)x, mosts[n]));
            TEST_ASSERT_EQUAL_INT16(limited, qm_limit((int16_t)x, mosts[n]));
            TEST_ASSERT_EQUAL_INT16((x == INT16_MIN) ? INT16_MAX : (x < 0) ? -x : x, qm_abs((int16_t)x));
        }
    }
}

void test_difference_and_mean_are_those_of_17_bits_at_every_edge(void)
{
    static const int16_t edges[] = { -32768, -32767, -16385, -16384, -16383, -16382, -8193, -8192, -2, -1, 0, 1, 2, 8191, 8192, 16382, 16383, 16384, 16385, 32766, 32767 };
    for (unsigned n = 0; n < sizeof edges / sizeof edges[0]; n++) {
        for (int32_t b = -32768; b <= 32767; b++) {
            int32_t difference = (int32_t)edges[n] - b;
            int32_t limited = (difference > 16383) ? 16383 : (difference < -16383) ? -16383 : difference;
            if (qm_sub_limited(edges[n], (int16_t)b) != limited || qm_less(edges[n], (int16_t)b) != limited || qm_mean(edges[n], (int16_t)b) != (((int32_t)edges[n] + b) >> 1)) {
                TEST_FAIL_MESSAGE("a pair differs");
            }
        }
    }
}

void test_zero_has_the_positive_sign(void)
{
    static const int16_t cases[][2] = { { -32768, -7 }, { -1, -7 }, { 0, 7 }, { 1, 7 }, { 32767, 7 } };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n][1], qm_with_sign(7, cases[n][0]), golden_row(n));
    }
}
