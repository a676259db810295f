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
