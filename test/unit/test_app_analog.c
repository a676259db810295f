/* The application analog: thresholds, hysteresis, the range of speeds, and what clears a fault. */
#include "firmware/app/analog.c"

#include "app_rig.h"

/** Calls at a share of the signal's range. */
static void signal(float share, uint16_t count_ms)
{
    told.pot_q16 = (uint16_t)(share * 65535.0F);
    (void)rig_clears(count_ms);
}

void setUp(void)
{
    rig_fresh();
}

void tearDown(void)
{
}

void test_it_starts_above_the_one_threshold_and_stops_below_the_other(void)
{
    static const struct {
        float share;
        int16_t run;
    } steps[] = { { 0.0F, 0 }, { 0.06F, 0 }, { 0.079F, 0 }, { 0.081F, 1 }, { 0.06F, 1 }, { 0.051F, 1 }, { 0.049F, 0 }, { 0.06F, 0 }, { 1.0F, 1 } };
    EACH(n, steps) {
        signal(steps[n].share, 1);
        TEST_ASSERT_EQUAL_INT16(steps[n].run, asks.run);
    }
}

void test_noise_of_two_per_cent_around_a_threshold_neither_starts_nor_stops_it_again_and_again(void)
{
    uint16_t n, changes = 0;
    int16_t before = 0;
    for (n = 0; n < 100u; n++) {
        signal((n % 2u) ? 0.07F : 0.09F, 1);
        changes = (uint16_t)(changes + (asks.run != before));
        before = asks.run;
    }
    TEST_ASSERT_EQUAL_UINT16(1, changes);
}

void test_the_range_above_the_threshold_is_minimum_to_maximum_speed(void)
{
    static const struct {
        float share;
        int16_t speed;
    } at[] = { { 0.06F, 500 }, { 0.08F, 500 }, { 0.54F, 2250 }, { 1.0F, 4000 } };
    EACH(n, at) {
        signal(at[n].share, 1);
        TEST_ASSERT_INT16_WITHIN(2, at[n].speed, asks.target_erpm);
    }
}

void test_with_a_signal_for_both_directions_its_side_chooses(void)
{
    told.towards = -1;
    signal(1.0F, 1);
    TEST_ASSERT_INT16_WITHIN(2, -4000, asks.target_erpm);
}

void test_a_second_without_signal_clears_a_fault_and_the_next_signal_starts(void)
{
    signal(0.5F, 10);
    told.fault = FAULT_STALL;
    TEST_ASSERT_EQUAL_UINT16(60000, rig_ms_to_clear(60000));
    told.pot_q16 = 0;
    TEST_ASSERT_UINT16_WITHIN(1, ANALOG_CLEAR_MS, rig_ms_to_clear(60000));
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    told.fault = FAULT_NONE;
    signal(0.5F, 1);
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_a_short_gap_of_the_signal_clears_nothing(void)
{
    told.fault = FAULT_STALL;
    signal(0.0F, ANALOG_CLEAR_MS / 2u);
    signal(0.5F, 1);
    told.pot_q16 = 0;
    TEST_ASSERT_EQUAL_UINT16(0, rig_clears(ANALOG_CLEAR_MS - 10u));
}

void test_a_broken_wire_is_a_fault_that_stays_until_it_is_mended(void)
{
    told.pot_is_lost = 1;
    rig_ms();
    TEST_ASSERT_EQUAL_UINT16(FAULT_POTENTIOMETER, asks.fault);
    told.fault = FAULT_POTENTIOMETER;
    TEST_ASSERT_EQUAL_UINT16(0, rig_clears(5000));
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    told.pot_is_lost = 0;
    TEST_ASSERT_UINT16_WITHIN(2, ANALOG_CLEAR_MS, rig_ms_to_clear(60000));
}
