/* The panel in BIDIRECTIONAL_SPEED and TORQUE_MODE together: a signed q current. */
/* defines: -DBIDIRECTIONAL_SPEED -DTORQUE_MODE */
#include "hurst_params.h"

#include "law.c"
#include "panel_rig.h"

#include "drive/request.h"

void setUp(void)
{
    panel_reset();
    rig_ready();
    panel_turn_pot(0);
}

void test_ends_of_the_pot_are_MAXIMUM_CURRENT_in_both_directions(void)
{
    TEST_ASSERT_INT16_WITHIN(6, 5120, panel_target(&params, 32704, 0, 1));
    TEST_ASSERT_INT16_WITHIN(6, -5120, panel_target(&params, -32768, 0, 1));
    TEST_ASSERT_INT16_WITHIN(6, 2560, panel_target(&params, 16384, 0, 1));
}

void test_no_position_in_the_middle_stops_a_reverse_run(void)
{
    int16_t pot;
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(-1, drive.direction);
    rig_tick(300);
    for (pot = 1000; pot >= -1000; pot--) {
        the_pot.now_q15 = pot;
        the_pot.smooth_q31 = (int32_t)pot * 65536;
        the_pot.used_q15 = pot;
        panel_ms(1);
        TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    }
}
