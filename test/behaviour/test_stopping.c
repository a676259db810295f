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

void test_S2_during_a_stop_goes_on_from_the_present_speed_without_a_bounce(void)
{
    static const double inertias[] = { 1.0, 9.0, 36.0 };
    for (size_t i = 0; i < sizeof inertias / sizeof inertias[0]; i++) {
        stop_from(2800.0, inertias[i]);
        TEST_ASSERT_EQUAL_INT(DRIVE_STOPPING, board_drive.state);
        wait_s(0.1);
        double before = get("state.speed_rpm");
        press("input.s2");
        TEST_ASSERT_EQUAL_INT(DRIVE_CLOSED, board_drive.state);
        measured_t m = measure(0.5);
        TEST_ASSERT_TRUE(before > 1500.0);
        TEST_ASSERT_TRUE(m.rpm_min > before - 250.0); /* it slowed down until the button counted */
        TEST_ASSERT_TRUE(m.i_peak_a < 1.1 * MAXIMUM_CURRENT_A);
        assert_running();
        set("mech.inertia_kgm2", 5.5e-6);
    }
}

void test_a_heavy_rotor_s_energy_goes_into_the_winding_where_the_supply_cannot_sink(void)
{
    static const double inertias[] = { 9.0, 36.0 };
    for (size_t i = 0; i < sizeof inertias / sizeof inertias[0]; i++) {
        run_at(5500.0);
        set("mech.inertia_kgm2", inertias[i] * 5.5e-6);
        wait_s(2.0);
        double begin = get("time_s");
        TEST_ASSERT_TRUE(get("state.speed_rpm") > 5300.0);
        press("input.s2");
        measured_t m = measure(1.6); /* without d current the heaviest took 5.0 s */
        TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
        TEST_ASSERT_TRUE(get("time_s") - begin < 5.0 / 3.0 + 0.1);
        TEST_ASSERT_TRUE(m.bus_max_v < 30.0);
        TEST_ASSERT_TRUE(m.i_peak_a < 1.1 * MAXIMUM_CURRENT_A);
        wait_s(1.0);
        set("mech.inertia_kgm2", 5.5e-6);
    }
}

void test_a_supply_that_sinks_leaves_the_winding_alone(void)
{
    set("supply.sinks", 1.0);
    run_at(2800.0);
    set("mech.inertia_kgm2", 36.0 * 5.5e-6);
    wait_s(1.0);
    press("input.s2");
    measured_t m = measure(0.3);
    TEST_ASSERT_TRUE(m.i_q_a < -0.3);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.0, m.i_d_a);
}
