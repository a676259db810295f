/* The motor stops in order at any speed, and the bus stays in its range. */
#include "bench.h"

void setUp(void)
{
    bench_set_up();
}

void test_stops_in_order_from_every_speed(void)
{
    static const double cases[][2] = { { 600.0, 0.5 }, { 2800.0, 1.0 }, { 5500.0, 2.0 } }; /* rpm, seconds at most */
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        run_at(cases[i][0]);
        set("stat.reset", 1.0);
        double begin = get("time_s");
        press("input.s2");
        while (board_drive.state != DRIVE_STOPPED && get("time_s") < begin + cases[i][1]) {
            wait_s(0.0005);
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(FAULT_NONE, board_drive.fault, vb_fault_name((int)board_drive.fault));
        TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
        TEST_ASSERT_TRUE(get("state.speed_rpm") < MINIMUM_SPEED_RPM * 1.6); /* slow enough to let go: the reference is below the minimum, the rotor near it */
        assert_outputs_off();
        wait_s(0.3);
        TEST_ASSERT_TRUE(get("stat.bus_max_v") < 30.0);
        TEST_ASSERT_DOUBLE_WITHIN(1.0, 0.0, get("state.speed_rpm"));
    }
}

void test_braking_a_heavy_rotor_keeps_the_bus_below_30_V(void)
{
    set("mech.inertia_kgm2", 100e-6);
    set("mech.viscous_nms", 2e-6);
    run_at(2500.0);
    set("stat.reset", 1.0);
    turn_to_rpm(500.0);
    wait_s(3.0);
    TEST_ASSERT_TRUE(get("stat.bus_max_v") > 25.0); /* it regenerates */
    TEST_ASSERT_TRUE(get("stat.bus_max_v") < 30.0);
    assert_running();
}

void test_stop_can_be_turned_into_a_new_start(void)
{
    run_at(2800.0);
    press("input.s2");
    wait_s(0.1);
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPING, board_drive.state);
    turn_to_rpm(1000.0);
    press("input.s2"); /* wants to run again: completes the stop, then starts */
    wait_s(3.5);
    assert_running();
}
