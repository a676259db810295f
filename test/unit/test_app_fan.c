/* The application fan: speed by temperature, hysteresis, a broken sensor, retries without end. */
#include "firmware/app/fan.c"

#include "app_rig.h"

#include <math.h>

/** A call at a temperature, as the thermistor's divider has it. */
static void at_celsius(double celsius)
{
    const double ohm = 10e3 * exp(3435.0 * (1.0 / (celsius + 273.15) - 1.0 / 298.15));
    told.pot_q16 = (uint16_t)(65535.0 * ohm / (ohm + 10e3));
    rig_ms();
}

void setUp(void)
{
    rig_fresh();
}

void tearDown(void)
{
}

void test_it_starts_at_40_degrees_and_stops_at_37(void)
{
    static const struct {
        double celsius;
        int16_t run;
    } steps[] = { { 20.0, 0 }, { 38.5, 0 }, { 39.8, 0 }, { 40.2, 1 }, { 38.5, 1 }, { 37.2, 1 }, { 36.8, 0 }, { 38.5, 0 }, { 90.0, 1 } };
    EACH(n, steps) {
        at_celsius(steps[n].celsius);
        (void)rig_clears(FAN_CALM_MS);
        TEST_ASSERT_EQUAL_INT16(steps[n].run, asks.run);
    }
}

void test_a_moment_below_37_degrees_stops_nothing_nor_does_one_above_40_start_it(void)
{
    at_celsius(60.0);
    (void)rig_clears(FAN_CALM_MS / 2u);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    (void)rig_clears(FAN_CALM_MS);
    at_celsius(20.0);
    (void)rig_clears(FAN_CALM_MS / 2u);
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
    at_celsius(38.0);
    at_celsius(20.0);
    (void)rig_clears(FAN_CALM_MS - 10u);
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_the_speed_rises_from_40_to_70_degrees(void)
{
    int16_t celsius, before = 0;
    at_celsius(38.0);
    TEST_ASSERT_EQUAL_INT16(APP_RPM(FAN_LOW_RPM), asks.target_erpm);
    for (celsius = 41; celsius <= 69; celsius++) {
        at_celsius(celsius);
        TEST_ASSERT_GREATER_THAN_INT16(before, asks.target_erpm);
        before = asks.target_erpm;
    }
    at_celsius(71.0);
    TEST_ASSERT_INT16_WITHIN(1, APP_RPM(FAN_HIGH_RPM), asks.target_erpm);
    at_celsius(55.0);
    TEST_ASSERT_INT16_WITHIN(APP_RPM(200), APP_RPM((FAN_LOW_RPM + FAN_HIGH_RPM) / 2), asks.target_erpm);
}

void test_with_a_broken_or_shorted_sensor_it_turns_at_its_highest_speed(void)
{
    static const uint16_t ends[] = { 0, 700, 64900, 65535 };
    EACH(n, ends) {
        rig_fresh();
        told.pot_q16 = ends[n];
        (void)rig_clears(FAN_CALM_MS);
        TEST_ASSERT_EQUAL_INT16(1, asks.run);
        TEST_ASSERT_INT16_WITHIN(1, APP_RPM(FAN_HIGH_RPM), asks.target_erpm);
    }
}

void test_a_fault_that_may_pass_is_cleared_after_each_pause_without_end(void)
{
    at_celsius(60.0);
    (void)rig_clears(FAN_CALM_MS);
    told.fault = FAULT_STALL;
    TEST_ASSERT_UINT16_WITHIN(1, FAN_PAUSE_MS, rig_ms_to_clear(60000));
    TEST_ASSERT_EQUAL_UINT16(6, rig_clears(6u * FAN_PAUSE_MS + 10u));
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    told.fault = FAULT_NONE;
    rig_ms();
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_a_fault_that_may_be_a_short_circuit_stays(void)
{
    told.fault = FAULT_OVERCURRENT_HW;
    TEST_ASSERT_EQUAL_UINT16(0, rig_clears(60000));
}
