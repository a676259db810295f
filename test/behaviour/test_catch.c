/* The rotor turns when S2 is pressed: it is caught at its speed, reversed, or waited for. */
#include "bench.h"

#define ROTOR 5.5e-6

void setUp(void)
{
    bench_set_up();
}

/** Power on, then a rotor that turns, and S2. @return seconds from the rotor's speed to a state with the rotor in hand */
static double catch_at(double rpm, double degrees, double inertia)
{
    power_on();
    set("mech.inertia_kgm2", inertia * ROTOR);
    set("input.s2", 1.0);
    wait_s(0.028);
    set("state.speed_rpm", rpm);
    set("state.theta_e_deg", degrees);
    (void)vb_set(bench, "stat.reset", 1.0);
    double begin = get("time_s");
    while ((board_drive.state < DRIVE_ALIGN || board_drive.state > DRIVE_STOPPING) && board_drive.fault == FAULT_NONE && get("time_s") < begin + 1.0) {
        wait_s(0.0005);
    }
    double after = get("time_s") - begin;
    set("input.s2", 0.0);
    return after;
}

void test_a_rotor_that_turns_forward_is_in_closed_loop_within_20_ms_at_its_speed(void)
{
    static const double speeds[] = { 300.0, 1000.0, 2500.0, 3500.0 };
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        for (double degrees = 10.0; degrees < 360.0; degrees += 90.0) {
            char what[48];
            (void)snprintf(what, sizeof what, "%g rpm, %g degrees", speeds[i], degrees);
            TEST_ASSERT_TRUE_MESSAGE(catch_at(speeds[i], degrees, 9.0) < 0.020, what);
            TEST_ASSERT_EQUAL_INT_MESSAGE(DRIVE_CLOSED, board_drive.state, what);
            TEST_ASSERT_TRUE_MESSAGE(get("state.speed_rpm") > 0.93 * speeds[i], what); /* nobody has braked it */
            wait_s(0.02);
            measured_t m = measure(0.05);
            TEST_ASSERT_TRUE_MESSAGE(m.angle_rms_deg < 10.0, what);
            m = measure(1.5);
            TEST_ASSERT_TRUE_MESSAGE(m.i_peak_a < 1.1 * MAXIMUM_CURRENT_A, what);
            TEST_ASSERT_TRUE_MESSAGE(m.bus_max_v < 30.0, what);
            (void)assert_holds(1000.0, 0.3);
        }
    }
}

void test_a_rotor_that_turns_backward_is_slowed_down_and_reversed_without_an_alignment(void)
{
    static const double speeds[] = { -100.0, -300.0, -1000.0, -2500.0 };
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        double begin, seconds = catch_at(speeds[i], 77.0 * (double)i, 9.0);
        TEST_ASSERT_TRUE(seconds < 0.060);
        begin = get("time_s");
        while (get("time_s") < begin + 4.0) {
            wait_s(0.001);
            TEST_ASSERT_TRUE(board_drive.state >= DRIVE_RAMP && board_drive.state <= DRIVE_STOPPING);
        }
        (void)assert_holds(1000.0, 0.3);
    }
}

void test_a_rotor_that_holds_the_bus_above_its_trip_is_waited_for_and_the_drive_says_so(void)
{
    power_on();
    set("mech.inertia_kgm2", 36.0 * ROTOR);
    set("state.speed_rpm", 5600.0);
    set("bus.voltage_v", 38.5);
    wait_s(0.2);
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
    press("input.s2");
    wait_s(0.2);
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, board_drive.fault);
    TEST_ASSERT_EQUAL_INT(DRIVE_CATCH, board_drive.state);
    TEST_ASSERT_EQUAL_INT(128, (int)get("fw.limits"));
    assert_outputs_off();
    wait_s(4.0);
    assert_running();
    TEST_ASSERT_DOUBLE_WITHIN(20.0, 1000.0, measure(2.0).rpm); /* 36 times what the header says: it hunts */
}

void test_a_start_with_a_heavy_rotor_that_still_coasts_works(void)
{
    static const double speeds[] = { 450.0, 200.0, 80.0, 30.0 };
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        (void)catch_at(speeds[i], 123.0, 36.0);
        wait_s(6.0);
        TEST_ASSERT_DOUBLE_WITHIN(20.0, 1000.0, measure(3.0).rpm);
        assert_running();
    }
}

void test_another_resistance_and_flux_than_the_headers_do_not_matter(void)
{
    static const double factors[][2] = { { 0.8, 1.3 }, { 1.2, 0.7 } }; /* Kphi, R */
    for (size_t i = 0; i < sizeof factors / sizeof factors[0]; i++) {
        set("motor.psi_vs", factors[i][0] * 0.00798324);
        set("motor.rs_ohm", factors[i][1] * 2.67);
        for (double rpm = -2000.0; rpm < 2500.0; rpm += 800.0) {
            TEST_ASSERT_TRUE(catch_at(rpm, rpm, 9.0) < 0.060);
            wait_s(5.0);
            (void)assert_holds(1000.0, 0.3);
        }
    }
}
