/* Fixed-point arithmetic: products, upper words, division, limits and the low-pass of Equation 7. */
#include "control/trig.h"
#include "golden.h"
#include "golden_divide.h"
#include "golden_limits.h"
#include "golden_lowpass.h"
#include "golden_multiply.h"
#include "unity.h"

void setUp(void)
{
}

void tearDown(void)
{
}

/* ---- products ---- */

void test_products_and_upper_words_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_MULTIPLY_ROWS; n++) {
        golden_multiply_t v = golden_multiply[n];
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.ss, qm_mulss(v.a, v.b), golden_row(n));
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.su, qm_mulsu(v.a, (uint16_t)v.b), golden_row(n));
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(v.uu, qm_muluu((uint16_t)v.a, (uint16_t)v.b), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.hi, qm_mulhi(v.a, v.b), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.hi_su, qm_mulhi_su(v.a, (uint16_t)v.b), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.hi_uu, qm_mulhi_uu((uint16_t)v.a, (uint16_t)v.b), golden_row(n));
    }
}

void test_product_of_the_two_most_negative_words_is_2_to_the_30(void)
{
    TEST_ASSERT_EQUAL_INT32(INT32_C(0x40000000), qm_mulss(INT16_MIN, INT16_MIN));
}

void test_mixed_product_takes_the_second_factor_as_unsigned(void)
{
    TEST_ASSERT_EQUAL_INT32(-INT32_C(65535), qm_mulsu(-1, 65535u));
    TEST_ASSERT_EQUAL_INT32(INT32_C(65535), qm_mulsu(1, 65535u));
}

void test_unsigned_product_uses_all_32_bits(void)
{
    TEST_ASSERT_EQUAL_UINT32(UINT32_C(4294836225), qm_muluu(65535u, 65535u));
}

void test_upper_word_rounds_toward_minus_infinity(void)
{
    TEST_ASSERT_EQUAL_INT16(0, qm_hi(INT32_C(65535)));
    TEST_ASSERT_EQUAL_INT16(1, qm_hi(INT32_C(65536)));
    TEST_ASSERT_EQUAL_INT16(-1, qm_hi(-1));
    TEST_ASSERT_EQUAL_INT16(-1, qm_hi(-INT32_C(65536)));
    TEST_ASSERT_EQUAL_INT16(-2, qm_hi(-INT32_C(65537)));
}

/* ---- division ---- */

void test_quotients_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_DIVIDE_ROWS; n++) {
        golden_divide_t v = golden_divide[n];
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.q, qm_divud(v.n, v.d), golden_row(n));
    }
}

/* ---- limits ---- */

void test_magnitude_difference_and_clamp_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_LIMITS_ROWS; n++) {
        golden_limits_t v = golden_limits[n];
        int16_t low = (v.b < v.c) ? v.b : v.c, high = (v.b < v.c) ? v.c : v.b;
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.abs_a, qm_abs(v.a), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.sub, qm_sub_limited(v.a, v.b), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.clamped, qm_clamp(v.a, low, high), golden_row(n));
    }
}

void test_magnitude_of_the_most_negative_word_is_the_most_positive(void)
{
    TEST_ASSERT_EQUAL_INT16(32767, qm_abs(INT16_MIN));
    TEST_ASSERT_EQUAL_INT16(32767, qm_abs(-32767));
    TEST_ASSERT_EQUAL_INT16(0, qm_abs(0));
}

void test_clamp_reaches_both_limits_and_leaves_them(void)
{
    TEST_ASSERT_EQUAL_INT16(10, qm_clamp(11, -20, 10));
    TEST_ASSERT_EQUAL_INT16(10, qm_clamp(10, -20, 10));
    TEST_ASSERT_EQUAL_INT16(9, qm_clamp(9, -20, 10));
    TEST_ASSERT_EQUAL_INT16(-19, qm_clamp(-19, -20, 10));
    TEST_ASSERT_EQUAL_INT16(-20, qm_clamp(-20, -20, 10));
    TEST_ASSERT_EQUAL_INT16(-20, qm_clamp(-21, -20, 10));
}

void test_difference_saturates_at_half_the_range_for_both_signs(void)
{
    TEST_ASSERT_EQUAL_INT16(16383, qm_sub_limited(32767, -32768));
    TEST_ASSERT_EQUAL_INT16(-16383, qm_sub_limited(-32768, 32767));
    TEST_ASSERT_EQUAL_INT16(16383, qm_sub_limited(16384, 0));
    TEST_ASSERT_EQUAL_INT16(-16383, qm_sub_limited(0, 16384));
    TEST_ASSERT_EQUAL_INT16(-3, qm_sub_limited(4, 7));
}

/* ---- angles ---- */

void test_sums_and_differences_of_angles_wrap_at_a_turn(void)
{
    TEST_ASSERT_EQUAL_HEX32(UINT32_C(0x00000001), qm_turn_add(UINT32_C(0xFFFFFFFF), 2));
    TEST_ASSERT_EQUAL_HEX32(UINT32_C(0xC0000000), qm_turn_sub(UINT32_C(0x40000000), UINT32_C(0x80000000)));
}

/* ---- Equation 7 ---- */

void test_low_pass_equals_the_reference(void)
{
    int32_t y = 0;
    uint32_t n;
    for (n = 0; n < GOLDEN_LOWPASS_ROWS; n++) {
        golden_lowpass_t v = golden_lowpass[n];
        int16_t out;
        y = v.start ? 0 : y;
        out = qm_lowpass(&y, v.x, v.k);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.y, y, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(qm_hi(v.y), out, golden_row(n));
    }
}

void test_low_pass_makes_K_of_the_way_in_one_step(void)
{
    int32_t y = INT32_C(1000) * 65536;
    TEST_ASSERT_EQUAL_INT16(1500, qm_lowpass(&y, 3000, 16384));
    TEST_ASSERT_EQUAL_INT16(1125, qm_lowpass(&y, 0, 16384));
}

void test_low_pass_survives_a_jump_over_the_whole_range(void)
{
    int32_t y = INT32_C(32767) * 65536;
    TEST_ASSERT_EQUAL_INT16(16383, qm_lowpass(&y, INT16_MIN, 16384));
    y = -INT32_C(32768) * 65536;
    TEST_ASSERT_EQUAL_INT16(-16385, qm_lowpass(&y, INT16_MAX, 16384));
}

void test_low_pass_settles_exactly_on_its_input(void)
{
    static const int16_t gains[] = { 2400, 328, 1496 };
    uint16_t g, n;
    for (g = 0; g < 3u; g++) {
        int32_t y = 0;
        for (n = 0; n < 4000u; n++) {
            (void)qm_lowpass(&y, -12345, gains[g]);
        }
        TEST_ASSERT_EQUAL_INT16(-12345, qm_hi(y));
        for (n = 0; n < 4000u; n++) {
            (void)qm_lowpass(&y, 12345, gains[g]);
        }
        TEST_ASSERT_EQUAL_INT16(12345, qm_hi(y));
    }
}

/** Power gain for a sine. @param step_q32 angle step per sample, 2^32 a turn @param settle samples before the measurement */
static float power_gain(int16_t k, uint32_t step_q32, uint16_t settle, uint16_t samples)
{
    uint32_t phase = 0;
    int32_t y = 0;
    float in = 0.0F, out = 0.0F;
    uint16_t n;
    for (n = 0; n < settle + samples; n++) {
        int16_t x = trig_sincos((angle_t)(phase >> 16)).sin;
        float filtered = (float)qm_lowpass(&y, x, k);
        if (n >= settle) {
            in += (float)x * (float)x * 1e-9F;
            out += filtered * filtered * 1e-9F;
        }
        phase = (uint32_t)(((uint64_t)phase + step_q32) & UINT32_C(0xFFFFFFFF));
    }
    return out / in;
}

/* Steps: frequency / 20 kHz * 2^32; samples: whole periods. */

void test_back_emf_filter_is_3_dB_down_at_118_Hz(void)
{
    TEST_ASSERT_FLOAT_WITHIN(0.005F, 0.5F, power_gain(2400, UINT32_C(25505833), 500, 1684)); /* 118.77 Hz */
}

void test_back_emf_filter_of_field_weakening_is_3_dB_down_at_16_Hz(void)
{
    TEST_ASSERT_FLOAT_WITHIN(0.005F, 0.5F, power_gain(328, UINT32_C(3429774), 2000, 5009)); /* 15.97 Hz */
}

void test_speed_filter_is_3_dB_down_at_73_Hz(void)
{
    TEST_ASSERT_FLOAT_WITHIN(0.005F, 0.5F, power_gain(1496, UINT32_C(15785431), 500, 2721)); /* 73.51 Hz */
}

void test_filter_is_20_dB_down_a_decade_above_its_corner(void)
{
    /* 1 / (1 + 10^2), a little less by the sampling */
    TEST_ASSERT_FLOAT_WITHIN(0.0007F, 0.0103F, power_gain(2400, UINT32_C(255058330), 500, 1684));
}
