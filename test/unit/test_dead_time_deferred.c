/* Dead time's compensation of a motor that turns far in a period whose duties are late: each of the two pulses to come has its own, a step later. */
#include "hurst_params.h"

#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 15000
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.000039 /* 17.5 degrees a period */

#include "law.c"
#include "dead_time_rig.h"

void test_duties_are_late_and_each_pulse_has_its_own(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, DEFER_DUTIES);
    TEST_ASSERT_EQUAL_UINT16(1, DEAD_EACH);
    dead_time_expect_each(4);
}
