/* The speed reference with a slope of its own towards standstill: up by one, down and in a stop by the other. */
#include "bench.h"

#undef SPEEDREF_DECEL_RPM_PER_S
#define SPEEDREF_DECEL_RPM_PER_S 1000

#include "firmware/board/isr.c"

void setUp(void)
{
    bench_set_up();
}

void test_speed_rises_by_one_slope_and_falls_by_the_other(void)
{
    run_at(1000.0);
    turn_to_rpm(2000.0);
    wait_s(0.35); /* 30 ms of filter, 1000 rpm at 4000 rpm/s */
    (void)assert_holds(2000.0, 0.2);
    turn_to_rpm(1000.0);
    wait_s(0.53);
    TEST_ASSERT_DOUBLE_WITHIN(60.0, 1500.0, get("state.speed_rpm"));
    wait_s(0.6);
    (void)assert_holds(1000.0, 0.2);
}

void test_a_stop_takes_the_slope_towards_standstill(void)
{
    run_at(1500.0);
    press("input.s2"); /* holds the button for 0.1 s */
    wait_s(0.4);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, board_drive.state);
    TEST_ASSERT_DOUBLE_WITHIN(80.0, 1030.0, get("state.speed_rpm"));
    wait_s(1.0);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
    assert_outputs_off();
}
