/* The speed reference's ramp: equal steps both ways, the snap to a near target, and the slope in rpm per second. */
#include "control/speed_ramp.h"
#include "golden.h"
#include "golden_speed_ramp.h"
#include "unity.h"

void setUp(void)
{
}

void tearDown(void)
{
}

void test_steps_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_SPEED_RAMP_ROWS; n++) {
        golden_speed_ramp_t v = golden_speed_ramp_row(n);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.next, speed_ramp(v.reference, v.target, v.step), golden_row(n));
    }
}

void test_far_target_is_approached_by_one_step(void)
{
    TEST_ASSERT_EQUAL_INT16(5008, speed_ramp(5000, 14000, 8));
    TEST_ASSERT_EQUAL_INT16(4992, speed_ramp(5000, -14000, 8));
}

void test_target_nearer_than_two_steps_is_taken_at_once(void)
{
    TEST_ASSERT_EQUAL_INT16(5015, speed_ramp(5000, 5015, 8));
    TEST_ASSERT_EQUAL_INT16(4985, speed_ramp(5000, 4985, 8));
    TEST_ASSERT_EQUAL_INT16(5000, speed_ramp(5000, 5000, 8));
}

void test_target_two_steps_away_is_approached_by_one_step(void)
{
    TEST_ASSERT_EQUAL_INT16(5008, speed_ramp(5000, 5016, 8));
    TEST_ASSERT_EQUAL_INT16(4992, speed_ramp(5000, 4984, 8));
}

void test_reference_crosses_zero_without_a_jump(void)
{
    int16_t reference = 100, next;
    while (reference != -100) {
        next = speed_ramp(reference, -100, 8);
        TEST_ASSERT_TRUE(reference - next <= 15 && reference - next >= 5);
        reference = next;
    }
}

void test_targets_at_the_ends_of_the_word_do_not_wrap(void)
{
    TEST_ASSERT_EQUAL_INT16(-32760, speed_ramp(INT16_MIN, INT16_MAX, 8));
    TEST_ASSERT_EQUAL_INT16(32759, speed_ramp(INT16_MAX, INT16_MIN, 8));
}

void test_slope_of_8_every_8_periods_is_4000_rpm_per_second(void)
{
    /* 2500 steps of 400 us are a second; 5 electrical rpm are 1 rpm */
    int16_t reference = 0;
    uint16_t n;
    for (n = 0; n < 1250u; n++) {
        reference = speed_ramp(reference, 30000, 8);
    }
    TEST_ASSERT_EQUAL_INT16(2000 * 5, reference);
}
