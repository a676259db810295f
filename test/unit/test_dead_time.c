/* Dead time's compensation of a motor that turns far in a period: each of the two pulses to come has its own. */
#include "drive/tick.h"
#include "hurst_params.h"

#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 15000 /* 22.5 degrees a period */

#include "law.c"
#include "dead_time_rig.h"

void test_each_pulse_has_the_compensation_of_the_current_asked_for_at_its_centre(void)
{
    dead_time_expect_each(2);
}

void test_a_half_step_that_does_not_fit_turns_the_first_by_half_a_radian_and_the_second_a_step_further(void)
{
    dq_t first;
    dead_duties_t expected;
    dead_time_closed(1, 60000);
    drive.run.estimator.half_step_q16_rad = 32767; /* a step is a radian */
    first = dq_turn(drive.run.control.ref_q13, 32766);
    drive_prepare(&drive, &params);
    svm_compensation(&params.svm, phases_of(first, drive.frame), &expected);
    TEST_ASSERT_EQUAL_INT16(expected.a, drive.dead.a);
    svm_compensation(&params.svm, phases_of(first, trig_sincos((angle_t)(60000 + COUNTS_PER_RAD))), &expected);
    TEST_ASSERT_EQUAL_INT16(expected.a, drive.dead_second.a);
}

void test_the_forced_angle_has_one_for_both(void)
{
    dead_time_closed(1, 5000);
    drive.state = DRIVE_RAMP;
    drive.command.run = 1;
    drive.run.estimator.half_step_q16_rad = 32767; /* the estimator runs along, and may be far off */
    drive_prepare(&drive, &params);
    TEST_ASSERT_TRUE(drive.dead.a != 0 && drive.dead.b != 0);
    TEST_ASSERT_EQUAL_MEMORY(&drive.dead, &drive.dead_second, sizeof drive.dead);
}

void test_a_start_begins_with_none(void)
{
    drive = (drive_t){ 0 };
    drive.state = DRIVE_STOPPED;
    drive.dead.b = drive.dead_second.b = 40;
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT16(0, drive.dead.b);
    TEST_ASSERT_EQUAL_INT16(0, drive.dead_second.b);
}

void test_duties_take_the_first_in_odd_periods_and_the_second_in_even_ones(void)
{
    rig_closed(1, 8000);
    for (uint16_t n = 0; n < 8u; n++) {
        drive.ticks = n;
        drive.dead = (dead_duties_t){ 40, -40, 0 };
        drive.dead_second = (dead_duties_t){ -40, 0, 40 };
        TEST_ASSERT_EQUAL_INT16_MESSAGE((n & 1u) ? 40 : -40, dead_of_pulse(&drive)->a, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE((n & 1u) ? -40 : 0, dead_of_pulse(&drive)->b, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE((n & 1u) ? 0 : 40, dead_of_pulse(&drive)->c, golden_row(n));
    }
}

/* The law runs before the slow work that prepares the next two. */
void test_both_are_prepared_after_the_second_pulse(void)
{
    rig_closed(1, 8000);
    for (uint16_t n = 0; n < 32u; n++) {
        uint16_t even;
        drive.run.control.ref_q13.q = (int16_t)(2000 + n);
        drive.dead.a = drive.dead_second.a = 9999;
        rig_tick(1);
        even = (uint16_t)((drive.ticks & 1u) == 0u);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(even, drive.dead.a != 9999, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(even, drive.dead_second.a != 9999, golden_row(n));
    }
}

void test_a_rotor_may_turn_by_twelve_degrees_in_a_period_with_one_for_two(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, DEAD_EACH);
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 7900
    TEST_ASSERT_EQUAL_UINT16(0, DEAD_EACH);
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 8100
    TEST_ASSERT_EQUAL_UINT16(1, DEAD_EACH);
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.000025
    TEST_ASSERT_EQUAL_UINT16(0, DEAD_EACH);
}
