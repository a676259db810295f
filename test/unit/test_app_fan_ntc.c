/* The application fan where the bridge has an NTC: its temperature in place of the potentiometer's input. */
#define BRIDGE_NTC_USED 1
#include "firmware/app/fan.c"

#include "app_rig.h"

/** Long at a temperature. */
static void at_celsius(double celsius)
{
    told.bridge_q4 = APP_CELSIUS(celsius);
    (void)rig_clears(FAN_CALM_MS);
}

void setUp(void)
{
    rig_fresh();
}

void tearDown(void)
{
}

void test_it_starts_at_40_degrees_and_stops_at_37_whatever_the_potentiometer_says(void)
{
    static const struct {
        double celsius;
        int16_t run;
    } steps[] = { { -40.0, 0 }, { 0.0, 0 }, { 38.5, 0 }, { 39.9, 0 }, { 40.0, 1 }, { 38.5, 1 }, { 37.0, 1 }, { 36.9, 0 }, { 38.5, 0 }, { 152.0, 1 } };
    EACH(n, steps) {
        told.pot_q16 = (uint16_t)(n & 1u ? 0u : 65535u);
        at_celsius(steps[n].celsius);
        TEST_ASSERT_EQUAL_INT16(steps[n].run, asks.run);
    }
}

void test_the_speed_rises_in_a_line_from_40_to_70_degrees(void)
{
    at_celsius(40.0);
    TEST_ASSERT_INT16_WITHIN(1, APP_RPM(FAN_LOW_RPM), asks.target_erpm);
    at_celsius(55.0);
    TEST_ASSERT_INT16_WITHIN(2, APP_RPM((FAN_LOW_RPM + FAN_HIGH_RPM) / 2), asks.target_erpm);
    at_celsius(70.0);
    TEST_ASSERT_INT16_WITHIN(1, APP_RPM(FAN_HIGH_RPM), asks.target_erpm);
    at_celsius(152.0);
    TEST_ASSERT_INT16_WITHIN(1, APP_RPM(FAN_HIGH_RPM), asks.target_erpm);
}
