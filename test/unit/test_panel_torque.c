/* The panel in TORQUE_MODE: the potentiometer commands a q current. */
/* defines: -DTORQUE_MODE */
#include "panel_rig.h"
#include "unity.h"

#include "hurst_params.h"

#include "firmware/drive/panel.c"

void setUp(void)
{
    panel_reset();
    rig_ready();
}

void tearDown(void)
{
}

void test_pot_spans_zero_to_MAXIMUM_CURRENT(void)
{
    TEST_ASSERT_INT16_WITHIN(3, 0, panel_target(&params, -32768, 0, 1));
    TEST_ASSERT_INT16_WITHIN(3, 5120, panel_target(&params, 32704, 0, 1));
    TEST_ASSERT_INT16_WITHIN(3, 2560, panel_target(&params, 0, 0, 1));
}

void test_S3_does_not_change_the_command(void)
{
    TEST_ASSERT_EQUAL_INT16(panel_target(&params, 5000, 0, 1), panel_target(&params, 5000, 1, 1));
}

void test_pot_at_zero_still_starts_forward(void)
{
    panel_turn_pot(0);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
}
