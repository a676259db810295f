/* I2t: how long a winding stands more than its current, and how it cools. */
#include "drive_rig.h"

#include <math.h>

#include "drive/overload.h"

#define RATED_Q13 2800.0
static overload_t overload;
static drive_params_t p;

void setUp(void)
{
    static const overload_t cold;
    overload = cold;
    rig_power_up();
    rig_closed(1, 10000);
    p = params;
    p.i2t_most_q25 = (int32_t)(RATED_Q13 * RATED_Q13 / 2.0);
}

static void set_time(double seconds)
{
    p.i2t_rate_q16 = (uint16_t)(0.512 / seconds * 65536.0 + 0.5);
}

/** The current as a vector, in a direction that is neither axis. */
static void set_current(double times)
{
    drive.run.control.i_q13.d = (int16_t)(-0.6 * times * RATED_Q13);
    drive.run.control.i_q13.q = (int16_t)(0.8 * times * RATED_Q13);
}

/** Passes of so many milliseconds until it is too hot, at most these seconds. @return seconds */
static double seconds_to_trip(uint16_t pass_ms, double most_s)
{
    double seconds = 0.0;
    while (!overload_tick(&overload, &drive, &p, pass_ms) && seconds < most_s) {
        seconds += pass_ms * 0.001;
    }
    return seconds;
}

void test_cold_winding_stands_k_times_its_current_for_T_ln_of_what_the_square_leaves(void)
{
    static const double times[] = { 1.05, 1.2, 1.5, 2.0, 4.0 }, constants_s[] = { 5.0, 20.0, 300.0, 1000.0 };
    EACH(n, times) {
        EACH(i, constants_s) {
            double law_s = -constants_s[i] * log(1.0 - 1.0 / (times[n] * times[n]));
            setUp();
            set_time(constants_s[i]);
            set_current(times[n]);
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.7 + 0.04 * law_s, law_s, seconds_to_trip(1, 10000.0), golden_row(n));
        }
    }
}

void test_what_the_winding_stands_for_ever_never_trips(void)
{
    set_time(2.0);
    set_current(0.99);
    TEST_ASSERT_TRUE(seconds_to_trip(1, 100.0) >= 100.0);
    set_current(1.01);
    TEST_ASSERT_TRUE(seconds_to_trip(1, 100.0) < 10.0);
}

void test_passes_of_other_lengths_make_no_difference(void)
{
    static const uint16_t pass_ms[] = { 1, 2, 7, 32, 100, 511, 512, 513, 2000 };
    EACH(n, pass_ms) {
        setUp();
        set_time(50.0);
        set_current(2.0);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.7 + 0.001 * pass_ms[n], 14.38, seconds_to_trip(pass_ms[n], 100.0), golden_row(n));
    }
}

void test_winding_cools_between_runs_and_a_stopped_drive_is_no_fault(void)
{
    double cold_s, warm_s;
    set_time(20.0);
    set_current(2.0);
    cold_s = seconds_to_trip(1, 100.0);
    drive.state = (uint16_t)DRIVE_STOPPED; /* the registers keep what flowed last */
    TEST_ASSERT_TRUE(seconds_to_trip(1, 5.0) >= 5.0);
    drive.state = (uint16_t)DRIVE_CLOSED;
    warm_s = seconds_to_trip(1, 100.0);
    /* h = e^(-5/20) of the limit, from there up to 4 times it */
    TEST_ASSERT_DOUBLE_WITHIN(0.7, 20.0 * log((4.0 - exp(-0.25)) / 3.0), warm_s);
    TEST_ASSERT_TRUE(warm_s < 0.5 * cold_s);
}

void test_no_current_in_the_header_means_no_i2t(void)
{
    p.i2t_most_q25 = 0;
    set_time(2.0);
    set_current(4.0);
    TEST_ASSERT_TRUE(seconds_to_trip(1, 60.0) >= 60.0);
    TEST_ASSERT_EQUAL_INT32(0, overload.heat_q25);
}

void test_largest_vector_for_ever_keeps_to_the_format(void)
{
    drive.run.control.i_q13.d = -32768;
    drive.run.control.i_q13.q = -32768;
    p.i2t_most_q25 = INT32_MAX;
    p.i2t_rate_q16 = 16777;
    for (int n = 0; n < 4000; n++) {
        (void)overload_tick(&overload, &drive, &p, (n < 2000) ? 511 : 60000);
        TEST_ASSERT_TRUE(overload.heat_q25 >= 0 && overload.heat_q25 <= 0x40000000);
    }
    TEST_ASSERT_INT32_WITHIN(8, 0x40000000, overload.heat_q25);
}
