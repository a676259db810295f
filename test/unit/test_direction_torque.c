/* The direction input in TORQUE_MODE: a command of no current keeps its direction. */
/* defines: -DTORQUE_MODE */
#include "hurst_params.h"

#undef DIRECTION_INPUT_USED
#define DIRECTION_INPUT_USED 1

#include "law.c"
#include "panel_rig.h"

void setUp(void)
{
    panel_reset();
    rig_ready();
}

void test_the_potentiometer_at_its_end_asks_for_a_count_in_the_direction_of_the_input(void)
{
    app_told_t told = panel_told(&params, &inputs);
    app_asks_t asks = { 0 };
    told.pot_q16 = 0;
    told.towards = -1;
    panel_tick(&app_panel, &told, &asks);
    TEST_ASSERT_EQUAL_INT16(-1, asks.target_erpm); /* 0 would turn a reverse run round */
    told.pot_q16 = 65535;
    panel_tick(&app_panel, &told, &asks);
    TEST_ASSERT_INT16_WITHIN(1, -5120, asks.target_erpm);
}
