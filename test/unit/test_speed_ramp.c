/* The speed reference's ramp: the reference has far, near and equal targets, two steps to the count, zero and both ends of the word. */
#include "drive/speed.h"
#include "golden.h"
#include "golden_speed_ramp.h"
#include "unity.h"

void test_steps_equal_the_reference(void)
{
    GOLDEN_EACH(speed_ramp, v) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.next, speed_ramp(v.reference, v.target, v.step), golden_row(n));
    }
}
