/* The speed reference's ramp: the reference, which has far, near and equal targets, zero and both ends of the word; and its slope. */
#include "control/speed_ramp.h"
#include "golden.h"
#include "golden_speed_ramp.h"
#include "unity.h"

void test_steps_equal_the_reference(void)
{
    GOLDEN_EACH(speed_ramp, v) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.next, speed_ramp(v.reference, v.target, v.step), golden_row(n));
    }
}

void test_target_nearer_than_two_steps_is_taken_at_once_and_a_farther_one_approached(void)
{
    static const int16_t cases[][2] = { /* target, next of 5000 with steps of 8 */
        { 14000, 5008 }, { 5016, 5008 }, { 5015, 5015 }, { 5000, 5000 }, { 4985, 4985 }, { 4984, 4992 }, { -14000, 4992 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n][1], speed_ramp(5000, cases[n][0], 8), golden_row(n));
    }
    TEST_ASSERT_EQUAL_INT16(-32760, speed_ramp(INT16_MIN, INT16_MAX, 8));
    TEST_ASSERT_EQUAL_INT16(32759, speed_ramp(INT16_MAX, INT16_MIN, 8));
}
