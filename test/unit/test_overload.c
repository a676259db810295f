/* I2t: how long a winding stands more than its current, and how it cools. */
#include "drive_rig.h"

#include "drive/protection.h"

#define RATED_Q13 2800.0F
static overload_t overload;
static drive_params_t p;

void setUp(void)
{
    static const overload_t cold;
    overload = cold;
    rig_power_up();
    rig_closed(1, 10000);
    p = params;
    p.i2t_most_q25 = (int32_t)(RATED_Q13 * RATED_Q13 / 2.0F);
}

static void set_time(float seconds)
{
    p.i2t_rate_q16 = (uint16_t)(0.512F / seconds * 65536.0F + 0.5F);
}

/** The current as a vector, in a direction that is neither axis. */
static void set_current(float times)
{
    drive.run.control.i_q13.d = (int16_t)(-0.6F * times * RATED_Q13);
    drive.run.control.i_q13.q = (int16_t)(0.8F * times * RATED_Q13);
}

/** Passes of so many milliseconds until it is too hot, at most these seconds. @return seconds */
static float seconds_to_trip(uint16_t pass_ms, uint16_t most_s)
{
    uint32_t ms = 0;
    while (!overload_tick(&overload, &drive, &p, pass_ms) && ms < most_s * UINT32_C(1000)) {
        ms += pass_ms;
    }
    return (float)ms * 0.001F;
}

void test_cold_winding_stands_k_times_its_current_for_T_ln_of_what_the_square_leaves(void)
{
    static const float times[] = { 1.05F, 1.2F, 1.5F, 2.0F, 4.0F }, constants_s[] = { 5.0F, 20.0F, 300.0F, 1000.0F };
    static const float logs[] = { 2.3754729F, 1.1856237F, 0.5877867F, 0.2876821F, 0.0645385F }; /* -ln(1 - 1/k^2): the chip's libraries may have none */
    EACH(n, times) {
        EACH(i, constants_s) {
            float law_s = constants_s[i] * logs[n];
            setUp();
            set_time(constants_s[i]);
            set_current(times[n]);
            TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.7F + 0.04F * law_s, law_s, seconds_to_trip(64, 10000), golden_row(n));
        }
    }
}

void test_what_the_winding_stands_for_ever_never_trips(void)
{
    set_time(2.0F);
    set_current(0.99F);
    TEST_ASSERT_TRUE(seconds_to_trip(16, 100) >= 100.0F);
    set_current(1.01F);
    TEST_ASSERT_TRUE(seconds_to_trip(16, 100) < 10.0F);
}

void test_passes_of_other_lengths_make_no_difference(void)
{
    static const uint16_t pass_ms[] = { 1, 2, 7, 32, 100, 511, 512, 513, 2000 };
    EACH(n, pass_ms) {
        setUp();
        set_time(50.0F);
        set_current(2.0F);
        TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.7F + 0.001F * pass_ms[n], 14.38F, seconds_to_trip(pass_ms[n], 100), golden_row(n));
    }
}

void test_winding_cools_between_runs_and_a_stopped_drive_is_no_fault(void)
{
    float cold_s, warm_s;
    set_time(20.0F);
    set_current(2.0F);
    cold_s = seconds_to_trip(16, 100);
    drive.state = (uint16_t)DRIVE_STOPPED; /* the registers keep what flowed last */
    TEST_ASSERT_TRUE(seconds_to_trip(8, 5) >= 5.0F);
    drive.state = (uint16_t)DRIVE_CLOSED;
    warm_s = seconds_to_trip(16, 100);
    /* h = e^(-5/20) of the limit, from there up to 4 times it: 20 s * ln((4 - h) / 3) */
    TEST_ASSERT_FLOAT_WITHIN(0.7F, 1.4228286F, warm_s);
    TEST_ASSERT_TRUE(warm_s < 0.5F * cold_s);
}

void test_no_current_in_the_header_means_no_i2t(void)
{
    p.i2t_most_q25 = 0;
    set_time(2.0F);
    set_current(4.0F);
    TEST_ASSERT_TRUE(seconds_to_trip(16, 60) >= 60.0F);
    TEST_ASSERT_EQUAL_INT32(0, overload.heat_q25);
}

void test_largest_vector_for_ever_keeps_to_the_format(void)
{
    drive.run.control.i_q13.d = -32768;
    drive.run.control.i_q13.q = -32768;
    p.i2t_most_q25 = INT32_MAX;
    p.i2t_rate_q16 = 16777;
    for (uint16_t n = 0; n < 220u; n++) {
        (void)overload_tick(&overload, &drive, &p, (uint16_t)((n < 20u) ? 511u : 60000u));
        TEST_ASSERT_TRUE(overload.heat_q25 >= 0 && overload.heat_q25 <= 0x40000000);
    }
    TEST_ASSERT_INT32_WITHIN(8, 0x40000000, overload.heat_q25);
}

void test_a_heat_of_exactly_its_limit_is_too_much(void)
{
    overload.heat_q25 = p.i2t_most_q25;
    TEST_ASSERT_EQUAL_UINT16(1, overload_tick(&overload, &drive, &p, 1));
    overload.heat_q25 = p.i2t_most_q25 - 1;
    TEST_ASSERT_EQUAL_UINT16(0, overload_tick(&overload, &drive, &p, 1));
}

void test_a_winding_that_rests_cools_by_the_rate_to_the_bit_and_sums_nothing(void)
{
    drive.state = (uint16_t)DRIVE_STOPPED;
    p.i2t_rate_q16 = 32768;
    overload.heat_q25 = 40000;
    (void)overload_tick(&overload, &drive, &p, OVERLOAD_STEP_MS - 1u);
    TEST_ASSERT_EQUAL_UINT32(0, overload.sum);
    (void)overload_tick(&overload, &drive, &p, 1);
    TEST_ASSERT_EQUAL_INT32(20000, overload.heat_q25);
    TEST_ASSERT_EQUAL_UINT32(0, overload.sum);
}
