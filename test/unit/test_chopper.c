/* The brake chopper: where the resistor goes on and off, and what share of time it bears. */
#include "hurst_params.h"

#undef BRAKE_CHOPPER_V
#define BRAKE_CHOPPER_V 26

#include "drive_rig.h"

#include "firmware/drive/limits.c"

#define PERIODS_PER_SEC 20000ul

static chopper_t chopper;
static uint16_t now;

void setUp(void)
{
    static const chopper_t cold = { 0 };
    chopper = cold;
    now = 65000; /* wraps soon */
    chopper.ticks = now;
}

/** A step after so many periods. @return 1 where the resistor is on */
static uint16_t step(float bus_v, uint16_t periods)
{
    now = (uint16_t)(now + periods);
    return bus_chopper(&chopper, BUS_Q15(bus_v), now);
}

/** Steps, two periods each, until the resistor is as asked. @return periods, at most `most` */
static uint32_t periods_to(uint16_t on, float bus_v, uint32_t most)
{
    uint32_t periods = 0;
    while (periods < most && step(bus_v, 2) != on) {
        periods += 2u;
    }
    return periods;
}

void test_the_resistor_is_on_from_the_threshold_and_off_two_per_cent_below(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, step(24.0F, 1));
    TEST_ASSERT_EQUAL_UINT16(0, step(25.99F, 1));
    TEST_ASSERT_EQUAL_UINT16(1, step(26.0F, 1));
    TEST_ASSERT_EQUAL_UINT16(1, step(25.5F, 1));
    TEST_ASSERT_EQUAL_UINT16(0, step(25.47F, 1));
    TEST_ASSERT_EQUAL_UINT16(0, step(25.99F, 1));
    TEST_ASSERT_EQUAL_UINT16(1, step(52.7F, 1)); /* the end of the converter */
}

void test_a_count_below_the_lower_level_is_off_and_the_level_itself_is_not(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, bus_chopper(&chopper, CHOPPER_ON_Q15, ++now));
    TEST_ASSERT_EQUAL_UINT16(1, bus_chopper(&chopper, CHOPPER_OFF_Q15, ++now));
    TEST_ASSERT_EQUAL_UINT16(0, bus_chopper(&chopper, (int16_t)(CHOPPER_OFF_Q15 - 1), ++now));
    TEST_ASSERT_EQUAL_UINT16(0, bus_chopper(&chopper, (int16_t)(CHOPPER_ON_Q15 - 1), ++now));
}

void test_a_cold_resistor_bears_its_share_of_the_mean_s_time_at_once_and_then_rests_for_an_eighth_of_it(void)
{
    const uint32_t on = periods_to(0, 28.0F, 40u * PERIODS_PER_SEC);
    TEST_ASSERT_UINT32_WITHIN(200, 22124, on); /* 0.0996 * 10 s / (1 - 0.0996) */
    TEST_ASSERT_EQUAL_UINT16(1, chopper.rests);
    TEST_ASSERT_EQUAL_UINT16(0, step(60.0F, 1)); /* whatever the bus is */
    TEST_ASSERT_UINT32_WITHIN(100, PERIODS_PER_SEC * 10u / 8u, periods_to(1, 28.0F, 40u * PERIODS_PER_SEC));
    TEST_ASSERT_EQUAL_UINT16(0, chopper.rests);
    TEST_ASSERT_UINT32_WITHIN(100, on / 8u, periods_to(0, 28.0F, 40u * PERIODS_PER_SEC));
}

void test_no_stretch_of_time_has_more_than_its_share_and_that_of_the_mean_s_time(void)
{
    uint32_t on = 0, periods;
    for (periods = 0; periods < 100u * PERIODS_PER_SEC; periods += 2u) {
        on += 2u * step(28.0F, 2);
    }
    TEST_ASSERT_TRUE(on <= (uint32_t)(0.1F * 110.0F * (float)PERIODS_PER_SEC));
    TEST_ASSERT_TRUE(on >= (uint32_t)(0.099F * 100.0F * (float)PERIODS_PER_SEC)); /* nor much less */
}

void test_a_rest_ends_though_the_bus_has_fallen_and_a_cold_resistor_gives_nothing_back(void)
{
    (void)periods_to(0, 28.0F, 40u * PERIODS_PER_SEC);
    TEST_ASSERT_EQUAL_UINT16(1, chopper.rests);
    for (uint32_t periods = 0; periods < 20u * PERIODS_PER_SEC; periods += 2u) {
        TEST_ASSERT_EQUAL_UINT16(0, step(24.0F, 2));
    }
    TEST_ASSERT_EQUAL_UINT16(0, chopper.rests);
    TEST_ASSERT_EQUAL_UINT32(0, chopper.spent_q10);
    TEST_ASSERT_UINT32_WITHIN(200, 22124, periods_to(0, 28.0F, 40u * PERIODS_PER_SEC)); /* as cold as ever */
}

void test_time_counts_in_periods_however_often_it_is_called(void)
{
    (void)step(28.0F, 1);
    (void)step(28.0F, 1);
    TEST_ASSERT_EQUAL_UINT32(1024u - 102u, chopper.spent_q10);
    (void)step(28.0F, 10);
    TEST_ASSERT_EQUAL_UINT32(11u * (1024u - 102u), chopper.spent_q10);
    (void)step(24.0F, 1);
    (void)step(24.0F, 1);
    TEST_ASSERT_EQUAL_UINT32(12u * (1024u - 102u) - 102u, chopper.spent_q10);
}

