/* The motor starts: from any angle, under load, and not when it must not. */
#include "bench.h"

void setUp(void)
{
    bench_set_up();
}

static void start_from(double degrees, double load_nm)
{
    char what[48];
    (void)snprintf(what, sizeof what, "from %g degrees with %g N m", degrees, load_nm);
    set("state.theta_e_deg", degrees);
    set("load.constant_nm", load_nm);
    power_on();
    TEST_ASSERT_TRUE_MESSAGE(start() < 2.0, what);
    TEST_ASSERT_EQUAL_INT_MESSAGE(DRIVE_CLOSED, board_drive.state, what);
    wait_s(0.5);
    measured_t m = measure(0.3);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(5.0, 1000.0, m.rpm, what);
    TEST_ASSERT_TRUE_MESSAGE(m.rpm_min > 900.0, what);
}

void test_starts_without_load_from_any_angle(void)
{
    for (double degrees = 0.0; degrees < 360.0; degrees += 45.0) {
        start_from(degrees, 0.0);
    }
}

void test_starts_under_load_from_any_angle(void)
{
    for (double degrees = 15.0; degrees < 375.0; degrees += 45.0) {
        start_from(degrees, 0.06);
    }
}

void test_closes_the_loop_at_the_time_that_the_parameters_say(void)
{
    /* S2's 30 ms of debouncing, 10 ms bootstrap, align, ramp, 20 ms of agreement, and the unloaded ramp's current down to an eighth by 3/256 a slow step */
    double align_hz = PARAM_ALIGN_TURNS / (LOCK_TIME * LOOPTIME_SEC), early_hz = fmax(PARAM_EARLY_HZ, PARAM_EARLY_SHARE * MINIMUM_SPEED_RPM * NOPOLESPAIRS / 60.0);
    double ramp_s = (early_hz - align_hz) * LOOPTIME_SEC * 67108864.0 / OPENLOOP_RAMPSPEED_INCREASERATE * LOOPTIME_SEC;
    power_on();
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.03 + 0.010 + LOCK_TIME * LOOPTIME_SEC + ramp_s + 0.02 + 256.0 / 3.0 * log(8.0) * 8.0 * LOOPTIME_SEC, start());
}

void test_hand_over_is_bumpless_in_current_and_speed(void)
{
    measured_t before, after;
    double handed_over_rpm;
    set("state.theta_e_deg", 30.0);
    power_on();
    press("input.s2");
    wait_s(1.0);
    TEST_ASSERT_EQUAL_INT(DRIVE_RAMP, board_drive.state);
    before = measure(0.05);
    while (board_drive.state == DRIVE_RAMP) {
        wait_s(0.0005);
    }
    handed_over_rpm = get("plant.speed_rpm");
    after = measure(0.05);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, Q_CURRENT_REF_OPENLOOP, before.i_peak_a);
    TEST_ASSERT_TRUE(after.i_peak_a < 1.05 * Q_CURRENT_REF_OPENLOOP);
    TEST_ASSERT_TRUE(after.rpm_min > 0.95 * handed_over_rpm);
    TEST_ASSERT_TRUE(after.rpm_max < 1.05 * (handed_over_rpm + 0.05 * SPEEDREFRAMP_RPM_PER_S)); /* on the way to 1000 rpm */
}

void test_hand_over_overshoots_less_than_ten_percent_and_never_turns_back(void)
{
    power_on();
    (void)start();
    double handed_over_rpm = get("plant.speed_rpm");
    measured_t m = measure(1.0);
    TEST_ASSERT_TRUE(m.rpm_max < 1100.0);
    TEST_ASSERT_TRUE(m.rpm_min > 0.9 * handed_over_rpm);
}

void test_offset_of_the_hand_over_is_what_friction_asks_of_an_eighth_and_is_gone_after_its_decay(void)
{
    double offset_deg;
    power_on();
    (void)start();
    offset_deg = fabs(get("fw.offset_deg"));
    wait_s(0.95);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("fw.offset_deg"));
    measured_t m = measure(0.2);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 0.0, m.i_d_a);
    /* without load nothing but friction takes torque of the eighth that is left */
    TEST_ASSERT_DOUBLE_WITHIN(5.0, acos(m.i_q_a / (Q_CURRENT_REF_OPENLOOP / 8.0)) * 57.3, offset_deg);
}

void test_alignment_takes_the_rotor_along_without_throwing_it_back(void)
{
    static const double inertias[] = { 1.0, 9.0, 36.0 };
    for (int n = 0; n < 3; n++) {
        for (double degrees = 0.0; degrees < 360.0; degrees += 60.0) {
            char what[64];
            (void)snprintf(what, sizeof what, "from %g degrees, inertia x%g", degrees, inertias[n]);
            bench_set_up();
            set("state.theta_e_deg", degrees);
            set("mech.inertia_kgm2", inertias[n] * get("mech.inertia_kgm2"));
            power_on();
            press("input.s2");
            measured_t m = measure(0.04 + LOCK_TIME * LOOPTIME_SEC);
            TEST_ASSERT_TRUE_MESSAGE(m.rpm_min > -300.0, what);
            TEST_ASSERT_EQUAL_INT_MESSAGE(DRIVE_RAMP, board_drive.state, what);
        }
    }
}

void test_hands_over_below_300_rpm_with_the_load_that_it_can_start(void)
{
    for (double degrees = 0.0; degrees < 360.0; degrees += 60.0) {
        bench_set_up();
        set("state.theta_e_deg", degrees);
        set("load.constant_nm", 0.06);
        power_on();
        (void)start();
        TEST_ASSERT_EQUAL_INT(DRIVE_CLOSED, board_drive.state);
        TEST_ASSERT_TRUE(get("plant.speed_rpm") < 300.0);
    }
}

static void expect_a_failed_start(void)
{
    power_on();
    TEST_ASSERT_TRUE(start() < 2.0);
    assert_fault(FAULT_START_FAILED);
}

void test_blocked_shaft_and_a_load_beyond_the_start_current_fault_by_name_in_two_seconds(void)
{
    set("load.locked", 1.0);
    for (double degrees = 0.0; degrees < 360.0; degrees += 60.0) {
        set("state.theta_e_deg", degrees);
        expect_a_failed_start();
    }
    set("load.locked", 0.0);
    set("load.constant_nm", 0.12);
    expect_a_failed_start();
}

/** Starts and counts the moments, every millisecond of RAMP, in which the drive says that the start swings. */
static int swing_said_ms(void)
{
    int said = 0;
    press("input.s2");
    for (int ms = 0; ms < 3000 && board_drive.fault == 0 && board_drive.state != DRIVE_CLOSED; ms++) {
        wait_s(0.001);
        said += (board_drive.state == DRIVE_RAMP && ((int)get("fw.limits") & LIMIT_SWING) != 0);
    }
    return said;
}

void test_a_rotor_that_swings_is_said_to_and_a_calm_or_blocked_one_is_not(void)
{
    power_on();
    TEST_ASSERT_EQUAL_INT(0, swing_said_ms());
    TEST_ASSERT_EQUAL_INT(DRIVE_CLOSED, board_drive.state);
    bench_set_up();
    set("load.locked", 1.0);
    power_on();
    TEST_ASSERT_EQUAL_INT(0, swing_said_ms());
    assert_fault(FAULT_START_FAILED);
    bench_set_up();
    set("mech.inertia_kgm2", 4.0 * get("mech.inertia_kgm2"));
    set("mech.coulomb_nm", 0.0);
    set("mech.viscous_nms", 0.0);
    power_on();
    TEST_ASSERT_GREATER_THAN_INT(50, swing_said_ms());
}

void test_outputs_stay_off_until_s2(void)
{
    TEST_ASSERT_EQUAL_INT(0, vb_power_up(bench));
    for (int i = 0; i < 200; i++) {
        wait_s(0.002);
        TEST_ASSERT_EQUAL_INT(0, (int)get("pwm.outputs_seen"));
    }
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
}

void test_implausible_current_offset_forbids_the_start(void)
{
    set("shunt.offset_b_v", 0.4);
    power_on();
    assert_fault(FAULT_OFFSET);
    press("input.s2"); /* clears, calibrates anew, fails anew */
    wait_s(0.1);
    press("input.s2");
    wait_s(0.5);
    assert_fault(FAULT_OFFSET);
}

void test_amplifier_offset_is_calibrated_away(void)
{
    set("shunt.offset_a_v", 0.10);
    set("shunt.offset_b_v", -0.08);
    run_at(1000.0);
    measured_t m = assert_holds(1000.0, 0.3);
    TEST_ASSERT_TRUE(m.angle_rms_deg < 5.0);
    TEST_ASSERT_TRUE(m.i_rms_a < 0.12);
}

void test_s2_during_the_ramp_stops_at_once(void)
{
    power_on();
    press("input.s2");
    wait_s(1.0);
    TEST_ASSERT_EQUAL_INT(DRIVE_RAMP, board_drive.state);
    press("input.s2");
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
    assert_outputs_off();
}

void test_starts_again_after_a_stop(void)
{
    run_at(1500.0);
    press("input.s2");
    wait_s(1.0);
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
    turn_to_rpm(1000.0);
    TEST_ASSERT_TRUE(start() < 2.0);
    assert_running();
}

void test_starts_on_a_low_and_on_a_high_bus_and_with_ten_times_the_inertia(void)
{
    set("supply.voltage_v", 18.0);
    start_from(0.0, 0.03);
    supply_v(26.0);
    start_from(0.0, 0.03);
    supply_v(24.0);
    set("mech.inertia_kgm2", 55e-6);
    start_from(0.0, 0.0);
}
