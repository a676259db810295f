/* The PI controller: gains, both limits, wind-up and recovery, the preset, and the reference. */
#include "control/pi.h"
#include "golden.h"
#include "golden_pi.h"
#include "unity.h"

static pi_t pi;
static pi_gains_t gains;

void setUp(void)
{
    pi.sum = 0;
    gains.kp = 2048; /* 2 output counts per error count */
    gains.ki = 512;  /* half an output count per error count and step */
    gains.kc = 32735;
    gains.shift = 10;
}

void tearDown(void)
{
}

void test_sequences_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_PI_ROWS; n++) {
        golden_pi_t v = golden_pi[n];
        gains.kp = v.kp;
        gains.ki = v.ki;
        gains.kc = v.kc;
        gains.shift = v.shift;
        if (v.op == 2u) {
            pi_preset(&pi, &gains, v.err, v.limit);
        } else {
            pi.sum = (v.op == 1u) ? 0 : pi.sum;
            TEST_ASSERT_EQUAL_INT16_MESSAGE(v.out, pi_tick(&pi, &gains, v.err, v.limit), golden_row(n));
        }
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.sum, pi.sum, golden_row(n));
    }
}

void test_first_output_is_proportional_to_the_error(void)
{
    TEST_ASSERT_EQUAL_INT16(200, pi_tick(&pi, &gains, 100, 32767));
    setUp();
    TEST_ASSERT_EQUAL_INT16(-200, pi_tick(&pi, &gains, -100, 32767));
}

void test_integral_follows_a_step_later(void)
{
    TEST_ASSERT_EQUAL_INT16(200, pi_tick(&pi, &gains, 100, 32767));
    TEST_ASSERT_EQUAL_INT16(250, pi_tick(&pi, &gains, 100, 32767));
    TEST_ASSERT_EQUAL_INT16(100, pi_tick(&pi, &gains, 0, 32767));
    TEST_ASSERT_EQUAL_INT16(100, pi_tick(&pi, &gains, 0, 32767));
}

void test_negative_error_takes_the_integral_back(void)
{
    (void)pi_tick(&pi, &gains, 100, 32767);
    TEST_ASSERT_EQUAL_INT16(-150, pi_tick(&pi, &gains, -100, 32767));
    TEST_ASSERT_EQUAL_INT16(0, pi_tick(&pi, &gains, 0, 32767));
}

void test_output_stops_at_either_limit(void)
{
    TEST_ASSERT_EQUAL_INT16(1000, pi_tick(&pi, &gains, 5000, 1000));
    setUp();
    TEST_ASSERT_EQUAL_INT16(-1000, pi_tick(&pi, &gains, -5000, 1000));
}

void test_output_just_inside_the_limit_is_not_limited(void)
{
    TEST_ASSERT_EQUAL_INT16(998, pi_tick(&pi, &gains, 499, 999));
    TEST_ASSERT_EQUAL_INT32(INT32_C(499) * 512, pi.sum);
    setUp();
    TEST_ASSERT_EQUAL_INT16(-998, pi_tick(&pi, &gains, -499, 999));
    TEST_ASSERT_EQUAL_INT32(-INT32_C(499) * 512, pi.sum);
}

void test_limit_zero_gives_zero(void)
{
    TEST_ASSERT_EQUAL_INT16(0, pi_tick(&pi, &gains, 5000, 0));
    TEST_ASSERT_EQUAL_INT16(0, pi_tick(&pi, &gains, -5000, 0));
}

void test_excess_is_taken_from_the_integrator_by_Kc(void)
{
    /* U = 2048 * 10000, limit 1000 << 10: the excess is 296 whole steps of 65536 */
    (void)pi_tick(&pi, &gains, 10000, 1000);
    TEST_ASSERT_EQUAL_INT32(INT32_C(10000) * 512 - 2 * INT32_C(296) * 32735, pi.sum);
    setUp();
    (void)pi_tick(&pi, &gains, -10000, 1000);
    TEST_ASSERT_EQUAL_INT32(-INT32_C(10000) * 512 + 2 * INT32_C(296) * 32735, pi.sum);
}

void test_a_long_time_at_the_limit_does_not_wind_up(void)
{
    uint16_t n;
    for (n = 0; n < 5000u; n++) {
        TEST_ASSERT_EQUAL_INT16(3000, pi_tick(&pi, &gains, 2000, 3000));
    }
    /* back inside with the first error of the other sign */
    TEST_ASSERT_TRUE(pi_tick(&pi, &gains, -100, 3000) < 3000);
}

void test_without_Kc_the_integrator_winds_up(void)
{
    uint16_t n;
    gains.kc = 0;
    for (n = 0; n < 100u; n++) {
        (void)pi_tick(&pi, &gains, 2000, 3000);
    }
    TEST_ASSERT_EQUAL_INT32(INT32_C(100) * 2000 * 512, pi.sum);
    TEST_ASSERT_EQUAL_INT16(3000, pi_tick(&pi, &gains, -100, 3000));
}

void test_both_signs_wind_up_and_recover_alike(void)
{
    pi_t mirror = { 0 };
    uint16_t n;
    for (n = 0; n < 60u; n++) {
        int16_t err = (int16_t)((n < 30u) ? 4096 : -1024); /* no rounding with these */
        int16_t up = pi_tick(&pi, &gains, err, 2048), down = pi_tick(&mirror, &gains, (int16_t)-err, 2048);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(-pi.sum, mirror.sum, golden_row(n));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1, (int16_t)-up, down, golden_row(n));
    }
}

void test_output_rounds_toward_minus_infinity(void)
{
    gains.ki = 0;
    gains.kp = 1;
    TEST_ASSERT_EQUAL_INT16(0, pi_tick(&pi, &gains, 1023, 100));
    TEST_ASSERT_EQUAL_INT16(1, pi_tick(&pi, &gains, 1024, 100));
    TEST_ASSERT_EQUAL_INT16(-1, pi_tick(&pi, &gains, -1, 100));
}

void test_largest_shift_and_limit_do_not_overflow(void)
{
    gains.shift = 14;
    gains.kp = 32767;
    TEST_ASSERT_EQUAL_INT16(32767, pi_tick(&pi, &gains, 32767, 32767));
    setUp();
    gains.shift = 14;
    gains.kp = 32767;
    TEST_ASSERT_EQUAL_INT16(-32767, pi_tick(&pi, &gains, -32767, 32767));
}

void test_preset_makes_the_next_output_what_was_asked_for(void)
{
    pi_preset(&pi, &gains, 300, 1234);
    TEST_ASSERT_EQUAL_INT16(1234, pi_tick(&pi, &gains, 300, 32767));
    pi_preset(&pi, &gains, -77, -4321);
    TEST_ASSERT_EQUAL_INT16(-4321, pi_tick(&pi, &gains, -77, 32767));
    gains.shift = 13;
    pi_preset(&pi, &gains, 1000, -2625);
    TEST_ASSERT_EQUAL_INT16(-2625, pi_tick(&pi, &gains, 1000, 5120));
}
