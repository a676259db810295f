/* The panel in BIDIRECTIONAL_SPEED: the potentiometer's sides are the directions, its middle is the lowest speed. */
/* defines: -DBIDIRECTIONAL_SPEED */
#include "panel_rig.h"
#include "unity.h"

#include "hurst_params.h"

#include "firmware/drive/panel.c"

void setUp(void)
{
    panel_reset();
    rig_ready();
    panel_turn_pot(1023);
}

void tearDown(void)
{
}

void test_ends_of_the_pot_are_nominal_speed_in_both_directions(void)
{
    TEST_ASSERT_INT16_WITHIN(12, 14000, panel_target(&params, 32704, 0, 1));
    TEST_ASSERT_INT16_WITHIN(12, -14000, panel_target(&params, -32768, 0, 1));
}

void test_half_way_is_half_of_the_range_in_both_directions(void)
{
    TEST_ASSERT_INT16_WITHIN(12, 8250, panel_target(&params, 16384, 0, 1));
    TEST_ASSERT_INT16_WITHIN(12, -8250, panel_target(&params, -16384, 0, 1));
}

void test_middle_keeps_the_direction_at_about_minimum_speed(void)
{
    TEST_ASSERT_INT16_WITHIN(360, 2680, panel_target(&params, 0, 0, 1));
    TEST_ASSERT_INT16_WITHIN(360, -2680, panel_target(&params, 0, 0, -1));
    TEST_ASSERT_LESS_THAN_INT16(0, panel_target(&params, 900, 0, -1));
    TEST_ASSERT_GREATER_THAN_INT16(0, panel_target(&params, -900, 0, 1));
}

void test_beyond_the_middle_the_side_decides(void)
{
    TEST_ASSERT_GREATER_THAN_INT16(0, panel_target(&params, 1100, 0, -1));
    TEST_ASSERT_LESS_THAN_INT16(0, panel_target(&params, -1100, 0, 1));
}

void test_target_is_at_least_minimum_speed_everywhere(void)
{
    int32_t pot;
    for (pot = -32768; pot <= 32767; pot += 13) {
        int16_t size = qm_abs(panel_target(&params, (int16_t)pot, 0, 1));
        TEST_ASSERT_TRUE(size >= 2500 && size <= 14000);
    }
}

void test_starts_in_the_direction_of_the_pot(void)
{
    panel_turn_pot(0);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(-1, drive.direction);
}

void test_the_other_direction_is_a_stop_and_a_new_start(void)
{
    press_s2(50);
    rig_tick(300);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, drive.state);
    panel_turn_pot(0);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    rig_tick(1); /* STOPPED */
    panel_ms(1);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(-1, drive.direction);
}

void test_S3_has_no_function(void)
{
    int16_t before;
    press_s2(50);
    before = drive.command.target_erpm;
    press_s3(50);
    TEST_ASSERT_EQUAL_INT16(before, drive.command.target_erpm);
}
