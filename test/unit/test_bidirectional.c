/* The panel in BIDIRECTIONAL_SPEED: the potentiometer's sides are the directions, its middle is the lowest speed. */
/* defines: -DBIDIRECTIONAL_SPEED */
#include "hurst_params.h"

#include "law.c"
#include "panel_rig.h"

#include "drive/modes/modes.h"
#include "drive/request.h"

void setUp(void)
{
    panel_reset();
    rig_ready();
    panel_turn_pot(1023);
}

void test_each_side_spans_its_direction_and_the_middle_keeps_the_one_there_is(void)
{
    static const struct {
        int16_t pot, direction, tolerance, target_erpm;
    } cases[] = {
        { 32704, 1, 12, 14000 }, { -32768, 1, 12, -14000 }, { 16384, 1, 12, 8250 }, { -16384, 1, 12, -8250 },
        { 0, 1, 360, 2680 }, { 0, -1, 360, -2680 }, { 900, -1, 360, -2680 }, { -900, 1, 360, 2680 }, /* the middle */
        { 1100, -1, 720, 2860 }, { -1100, 1, 720, -2860 }, /* beyond it the side decides */
    };
    EACH(n, cases) {
        int16_t target = panel_target(&params, cases[n].pot, 0, cases[n].direction);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(cases[n].tolerance, cases[n].target_erpm, target, golden_row(n));
    }
}

void test_travel_is_twice_the_distance_from_the_middle_and_its_first_three_per_cent_keep_the_direction(void)
{
    static const struct {
        uint16_t pot_q16, travel_q16;
        int16_t direction;
    } cases[] = {
        { 0xC000u, 0x8000u, 1 }, { 0x4000u, 0x8000u, -1 }, { 0x8401u, 2050u, 1 }, { 0x7BFFu, 2050u, -1 }, { 0x8400u, 2048u, 7 }, { 0x7C00u, 2048u, 7 },
    };
    EACH(n, cases) {
        int16_t direction = 7; /* whatever there is */
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].travel_q16, mode_pot_split(cases[n].pot_q16, &direction), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].direction, direction, golden_row(n));
    }
}

void test_target_is_at_least_minimum_speed_everywhere(void)
{
    int32_t pot;
    for (pot = -32768; pot <= 32767; pot += 13) {
        int16_t size = qm_abs(panel_target(&params, (int16_t)pot, 0, 1));
        TEST_ASSERT_TRUE(size >= 2500 && size <= 14000);
    }
}

void test_starts_in_the_direction_of_the_pot_and_the_other_one_is_a_stop_and_a_new_start(void)
{
    press_s2(50);
    rig_tick(300);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, drive.state);
    panel_turn_pot(0);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    rig_tick(SLOW_PERIODS); /* STOPPED */
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
