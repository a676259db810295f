/* STOP_MODE 1: a requested stop switches the outputs off at once, and the rotor coasts. */
#include "hurst_params.h"

#undef STOP_MODE
#define STOP_MODE 1

#include "law.c"
#include "drive_rig.h"

void setUp(void)
{
    rig_closed(1, 20000);
    drive.command.run = 0;
}

void test_a_requested_stop_leaves_the_bridge_off_at_any_speed(void)
{
    EACH_DIRECTION(direction) {
        rig_closed(direction, (int16_t)(direction * 27000));
        drive.command.run = 0;
        speed_choose_state(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, drive_outputs(&drive));
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    }
}

void test_it_does_so_within_32_periods(void)
{
    TEST_ASSERT_LESS_OR_EQUAL_UINT16(32, rig_tick_until(DRIVE_STOPPED, 40));
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "coasts");
}

void test_a_target_in_the_other_direction_slows_down_and_a_stop_on_the_way_lets_go(void)
{
    drive.command.run = 1;
    drive.command.target_erpm = -5000;
    speed_choose_state(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
    speed_choose_state(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
    drive.command.run = 0;
    speed_choose_state(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}
