/* NTC thermistors of motor and bridge: temperature against the Beta equation, derating, trip with hysteresis, a broken sensor, and who may clear it. */
#include "hurst_params.h"

#undef MOTOR_NTC_USED
#undef BRIDGE_NTC_USED
#undef RETRY_COUNT
#define MOTOR_NTC_USED 1
#define BRIDGE_NTC_USED 1
#define RETRY_COUNT 3

/* Another one at the bridge: steeper, and ten times as large. */
#undef BRIDGE_NTC_OHM
#undef BRIDGE_NTC_BETA_K
#undef BRIDGE_NTC_DIVIDER_OHM
#define BRIDGE_NTC_OHM 100000
#define BRIDGE_NTC_BETA_K 3950
#define BRIDGE_NTC_DIVIDER_OHM 82000

#include "law.c"
#include "drive_rig.h"

#include <math.h>

#define PART 1024.0 /* of the converter's steps */
#define SETTLED 400

static request_t request;
static retry_t retry;

void setUp(void)
{
    rig_ready();
    request_init(&request);
    retry_init(&retry);
}

/** Share of the reference at a temperature: the Beta equation. */
static double share(double ohm, double beta_k, double divider_ohm, double celsius)
{
    const double r = ohm * exp(beta_k * (1.0 / (celsius + 273.15) - 1.0 / 298.15));
    return r / (r + divider_ohm);
}

static double motor_share(double celsius)
{
    return share(10e3, 3435.0, 10e3, celsius);
}

static double bridge_share(double celsius)
{
    return share(100e3, 3950.0, 82e3, celsius);
}

/** What the converter makes of a share. */
static int16_t converted(double of_reference)
{
    const double step = fmin(floor(of_reference * PART + 0.5), PART - 1.0);
    return (int16_t)(uint16_t)((uint16_t)(step * 64.0) ^ 0x8000u);
}

static uint16_t samples_of_motor(double celsius, uint16_t count)
{
    while (count-- != 0u) {
        ntc_sample(&drive.heat.motor, &params.motor_ntc, converted(motor_share(celsius)));
    }
    return heat_follow(&drive, &params);
}

static uint16_t samples_of_bridge(double celsius, uint16_t count)
{
    while (count-- != 0u) {
        ntc_sample(&drive.heat.bridge, &params.bridge_ntc, converted(bridge_share(celsius)));
    }
    return heat_follow(&drive, &params);
}

static uint16_t samples_at(double of_reference, uint16_t count)
{
    while (count-- != 0u) {
        ntc_sample(&drive.heat.motor, &params.motor_ntc, converted(of_reference));
    }
    return heat_follow(&drive, &params);
}

/* ---- the temperature ---- */

void test_temperature_is_within_two_kelvin_of_the_beta_equation_and_closer_where_it_matters(void)
{
    double celsius;
    for (celsius = -40.0; celsius <= 152.0; celsius += 0.25) {
        const double of_motor = ntc_celsius(&params.motor_ntc, (uint16_t)(65536.0 * motor_share(celsius) + 0.5)) / 16.0;
        const double of_bridge = ntc_celsius(&params.bridge_ntc, (uint16_t)(65536.0 * bridge_share(celsius) + 0.5)) / 16.0;
        const double most = (celsius >= -20.0 && celsius <= 120.0) ? 1.5 : 2.0;
        TEST_ASSERT_DOUBLE_WITHIN(most, celsius, of_motor);
        TEST_ASSERT_DOUBLE_WITHIN(most, celsius, of_bridge);
    }
}

void test_temperature_is_within_two_kelvin_with_the_converter_s_steps(void)
{
    double celsius;
    for (celsius = -20.0; celsius <= 120.0; celsius += 0.25) {
        const uint16_t q16 = (uint16_t)((uint16_t)converted(motor_share(celsius)) ^ 0x8000u);
        TEST_ASSERT_DOUBLE_WITHIN(2.0, celsius, ntc_celsius(&params.motor_ntc, q16) / 16.0);
    }
}

void test_nodes_are_the_beta_equation_s(void)
{
    for (uint16_t n = 0; n < NTC_NODES; n++) {
        const double celsius = NTC_LEAST_C + NTC_STEP_C * n;
        TEST_ASSERT_UINT16_WITHIN(2, (uint16_t)(65536.0 * motor_share(celsius) + 0.5), params.motor_ntc.share_q16[n]);
        TEST_ASSERT_UINT16_WITHIN(2, (uint16_t)(65536.0 * bridge_share(celsius) + 0.5), params.bridge_ntc.share_q16[n]);
    }
    TEST_ASSERT_EQUAL_INT16(NTC_MOST_C, NTC_LEAST_C + NTC_STEP_C * (NTC_NODES - 1));
}

void test_nodes_of_other_sensors_are_right_too(void)
{
#define OTHER_NTC_DIVIDER_OHM 4700
#define OTHER_NTC_OHM 2200
#define OTHER_NTC_BETA_K 5000
    for (int c = -40; c <= 152; c += 16) {
        TEST_ASSERT_FLOAT_WITHIN(3e-5F, (float)share(2200.0, 5000.0, 4700.0, c), PARAM_NTC_SHARE(OTHER, c));
    }
}

void test_beyond_its_ends_the_temperature_is_the_end(void)
{
    static const uint16_t shares[] = { 0, 1, 600, 65000, 65535 };
    EACH(n, shares) {
        const int16_t celsius_q4 = ntc_celsius(&params.motor_ntc, shares[n]);
        TEST_ASSERT_INT16_WITHIN(1, (shares[n] < 1000u) ? NTC_MOST_C * 16 : NTC_LEAST_C * 16, celsius_q4);
    }
}

void test_first_sample_counts_in_full_and_the_others_are_smoothed(void)
{
    (void)samples_of_motor(60.0, 1);
    TEST_ASSERT_INT16_WITHIN(20, 60 * 16, drive.heat.motor.celsius_q4);
    (void)samples_of_motor(25.0, 1);
    TEST_ASSERT_INT16_WITHIN(60, 57 * 16, drive.heat.motor.celsius_q4);
    (void)samples_of_motor(25.0, SETTLED);
    TEST_ASSERT_INT16_WITHIN(16, 25 * 16, drive.heat.motor.celsius_q4);
}

void test_the_trip_level_itself_is_hot_and_so_is_the_level_ten_kelvin_below_it_until_it_has_been_passed(void)
{
    static const struct {
        uint16_t before;
        int16_t above_q4; /* the trip level, above the temperature */
        uint16_t after;
    } cases[] = { { 0, 0, 1 }, { 0, 1, 0 }, { 1, HEAT_COOLER_Q4, 1 }, { 1, HEAT_COOLER_Q4 + 1, 0 } };
    (void)samples_of_motor(60.0, SETTLED);
    EACH(n, cases) {
        ntc_params_t its = params.motor_ntc;
        its.trip_q4 = (int16_t)(drive.heat.motor.celsius_q4 + cases[n].above_q4);
        drive.heat.motor.is_hot = cases[n].before;
        ntc_sample(&drive.heat.motor, &its, converted(motor_share(60.0)));
        TEST_ASSERT_EQUAL_UINT16(cases[n].after, drive.heat.motor.is_hot);
    }
}

/* ---- derating ---- */

void test_current_falls_from_all_to_a_fifth_between_derate_and_trip(void)
{
    static const struct {
        int16_t celsius, most_q13;
    } cases[] = { { -40, 5120 }, { 25, 5120 }, { 110, 5120 }, { 115, 4096 }, { 120, 3072 }, { 125, 2048 }, { 130, 1024 }, { 152, 1024 } };
    EACH(n, cases) {
        TEST_ASSERT_INT16_WITHIN(5, cases[n].most_q13, ntc_derated(&params.motor_ntc, &params, (int16_t)(16 * cases[n].celsius)));
    }
}

void test_the_warmer_of_motor_and_bridge_counts(void)
{
    TEST_ASSERT_EQUAL_INT16(5120, heat_most(&drive));
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, samples_of_bridge(90.0, SETTLED)); /* half way */
    TEST_ASSERT_INT16_WITHIN(250, 3072, heat_most(&drive));
    (void)samples_of_motor(114.0, SETTLED);
    TEST_ASSERT_INT16_WITHIN(250, 3072, heat_most(&drive));
    (void)samples_of_motor(125.0, SETTLED);
    TEST_ASSERT_INT16_WITHIN(250, 2048, heat_most(&drive));
    (void)samples_of_motor(30.0, SETTLED);
    (void)samples_of_bridge(30.0, SETTLED);
    TEST_ASSERT_EQUAL_INT16(5120, heat_most(&drive));
}

/** Limit of a circle of 5000 at a temperature's current, with a q current in this direction of the rotor. */
static int16_t narrowed(int16_t most_q13, int16_t direction, int16_t iq_q13)
{
    drive_control_t *c = &drive.run.control;
    rig_closed(direction, (int16_t)(direction * 8000));
    drive.heat.most_q13 = most_q13;
    c->ref_q13.q = (int16_t)(direction * iq_q13);
    c->iq_limit_q13 = 5000;
    limits_driving(&drive, &params);
    return c->iq_limit_q13;
}

void test_temperature_narrows_the_driving_current_alone_and_says_so(void)
{
    EACH_DIRECTION(direction) {
        TEST_ASSERT_EQUAL_INT16(2000, narrowed(2000, direction, 2000));
        TEST_ASSERT_EQUAL_HEX16(LIMIT_TEMPERATURE, drive.run.control.limited_by);
        drive.run.control.brake_limit_q13 = 5000;
        TEST_ASSERT_EQUAL_HEX16(LIMIT_TEMPERATURE, limits_reasons(&drive, &params) & (LIMIT_TEMPERATURE | LIMIT_CURRENT));
        TEST_ASSERT_EQUAL_INT16(5000, narrowed(2000, direction, -500));
        TEST_ASSERT_EQUAL_INT16(5000, narrowed(5120, direction, 500));
        TEST_ASSERT_EQUAL_HEX16(LIMIT_NONE, drive.run.control.limited_by);
    }
}

/* ---- trip ---- */

void test_a_motor_at_its_trip_level_is_hot_until_ten_kelvin_below(void)
{
    static const struct {
        double celsius;
        uint16_t fault;
    } steps[] = { { 128.0, FAULT_NONE }, { 132.0, FAULT_MOTOR_HOT }, { 128.0, FAULT_MOTOR_HOT }, { 122.0, FAULT_MOTOR_HOT }, { 118.0, FAULT_NONE }, { 128.0, FAULT_NONE } };
    EACH(n, steps) {
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(steps[n].fault, samples_of_motor(steps[n].celsius, SETTLED), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16(steps[n].fault, drive.heat.held);
    }
}

void test_a_hot_bridge_has_its_own_name_and_levels(void)
{
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, samples_of_bridge(98.5, SETTLED));
    TEST_ASSERT_EQUAL_UINT16(FAULT_BRIDGE_HOT, samples_of_bridge(101.5, SETTLED));
    TEST_ASSERT_EQUAL_UINT16(FAULT_BRIDGE_HOT, samples_of_bridge(91.5, SETTLED));
    TEST_ASSERT_EQUAL_UINT16(FAULT_MOTOR_HOT, samples_of_motor(135.0, SETTLED)); /* of two the motor's is told */
    TEST_ASSERT_EQUAL_UINT16(FAULT_BRIDGE_HOT, samples_of_motor(100.0, SETTLED));
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, samples_of_bridge(88.5, SETTLED));
}

/* ---- a broken sensor ---- */

void test_a_wire_that_is_broken_or_shorted_is_a_fault_after_32_samples_and_the_temperature_stays(void)
{
    static const double ends[] = { 0.0, 0.007, 0.991, 1.0 };
    EACH(n, ends) {
        setUp();
        (void)samples_of_motor(60.0, SETTLED);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(FAULT_NONE, samples_at(ends[n], NTC_BROKEN_SAMPLES - 1u), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(FAULT_NTC_SENSOR, samples_at(ends[n], 1), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16(FAULT_NTC_SENSOR, samples_at(ends[n], 1000));
        TEST_ASSERT_INT16_WITHIN(16, 60 * 16, drive.heat.motor.celsius_q4);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, samples_of_motor(60.0, 1));
    }
}

void test_the_coldest_and_the_hottest_are_no_broken_wire(void)
{
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, samples_of_motor(-40.0, 1000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_MOTOR_HOT, samples_of_motor(152.0, 1000));
    setUp();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, samples_of_bridge(-40.0, 1000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_BRIDGE_HOT, samples_of_bridge(152.0, 1000));
}

void test_a_wire_that_is_loose_most_of_the_time_is_found_and_one_spike_is_not(void)
{
    uint16_t found = FAULT_NONE;
    (void)samples_of_motor(60.0, 10);
    for (uint16_t n = 0; n < 1000u; n++) {
        found |= samples_of_motor(60.0, 3) | samples_at(1.0, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, found);
    for (uint16_t n = 0; n < 40u; n++) {
        found |= samples_of_motor(60.0, 1) | samples_at(1.0, 2);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NTC_SENSOR, found);
}

void test_a_broken_sensor_at_the_bridge_comes_before_a_hot_motor_no_more_than_after(void)
{
    for (uint16_t n = 0; n < NTC_BROKEN_SAMPLES; n++) {
        ntc_sample(&drive.heat.bridge, &params.bridge_ntc, converted(1.0));
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NTC_SENSOR, heat_follow(&drive, &params));
    TEST_ASSERT_EQUAL_UINT16(FAULT_MOTOR_HOT, samples_of_motor(140.0, SETTLED));
}

/* ---- what may clear it ---- */

static void clear(void)
{
    drive.command.clear_fault = 1;
    rig_tick(2);
}

void test_nothing_clears_a_hot_motor_until_it_is_cooler(void)
{
    drive_raise(&drive, (drive_fault_t)samples_of_motor(135.0, SETTLED));
    rig_tick(1);
    clear();
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_MOTOR_HOT, "hot");
    TEST_ASSERT_EQUAL_INT16(0, drive.command.clear_fault);
    (void)samples_of_motor(118.0, SETTLED);
    rig_tick(2);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_MOTOR_HOT, "cooler, not cleared");
    clear();
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "cooler");
}

void test_another_fault_of_a_hot_motor_may_be_cleared(void)
{
    (void)samples_of_motor(135.0, SETTLED);
    drive_raise(&drive, FAULT_STALL);
    rig_tick(1);
    clear();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_retry_waits_until_the_motor_is_cooler_and_its_pause_is_over(void)
{
    uint16_t ms;
    request.interrupted = 1;
    drive_raise(&drive, (drive_fault_t)samples_of_motor(135.0, SETTLED));
    for (ms = 0; ms < 10000u; ms++) {
        retry_tick(&retry, &request, &drive, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(RETRY_COUNT, retry.left);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.clear_fault);
    (void)samples_of_motor(110.0, SETTLED);
    for (ms = 1; ms < 10000u && !drive.command.clear_fault; ms++) {
        retry_tick(&retry, &request, &drive, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(RETRY_PAUSE_SEC * 1000, ms - 1u);
    TEST_ASSERT_EQUAL_UINT16(RETRY_COUNT - 1, retry.left);
}

void test_a_temperature_may_pass_and_a_broken_sensor_does_not(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, retry_may_pass(FAULT_MOTOR_HOT));
    TEST_ASSERT_EQUAL_UINT16(1, retry_may_pass(FAULT_BRIDGE_HOT));
    TEST_ASSERT_EQUAL_UINT16(0, retry_may_pass(FAULT_NTC_SENSOR));
}
