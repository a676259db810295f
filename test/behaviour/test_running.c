/* The motor runs below base speed: speed, angle, current, load steps, a wrong motor file. */
#include "bench.h"

void setUp(void)
{
    bench_set_up();
}

void test_holds_every_speed_to_half_a_percent(void)
{
    static const double speeds[] = { 500.0, 750.0, 1000.0, 1500.0, 2000.0, 2500.0, 2800.0 };
    run_at(1000.0);
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        turn_to_rpm(speeds[i]);
        wait_s(1.2);
        (void)assert_holds(speeds[i], 0.5);
    }
}

void test_angle_error_is_below_five_degrees_from_1000_rpm_up(void)
{
    run_at(1000.0);
    for (double rpm = 1000.0; rpm <= 2800.0; rpm += 450.0) {
        for (double load = 0.0; load <= 0.041; load += 0.02) {
            turn_to_rpm(rpm);
            set("load.constant_nm", load);
            wait_s(1.0);
            measured_t m = measure(0.3);
            TEST_ASSERT_TRUE_MESSAGE(m.angle_rms_deg < 5.0, "angle");
        }
    }
    assert_running();
}

void test_phase_currents_are_sinusoidal_enough_to_hold_the_torque(void)
{
    run_at(1500.0);
    ramp_load(0.06);
    wait_s(0.5);
    measured_t m = measure(0.3);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.0, m.i_d_a); /* the angle is right */
    TEST_ASSERT_DOUBLE_WITHIN(0.03, (0.06 + 0.004 + 15.3e-6 * 157.1) / 0.0599, m.i_q_a);
    TEST_ASSERT_DOUBLE_WITHIN(10.0, 0.0, m.rpm_max - m.rpm_min);
}

void test_holds_speed_through_load_step(void)
{
    run_at(2000.0);
    set("load.constant_nm", 0.05);
    measured_t m = measure(0.5);
    TEST_ASSERT_TRUE(m.rpm_min > 1000.0);
    (void)assert_holds(2000.0, 0.5);
    set("load.constant_nm", 0.0);
    m = measure(0.5);
    TEST_ASSERT_TRUE(m.rpm_max < 2900.0);
    (void)assert_holds(2000.0, 0.5);
}

void test_speed_follows_the_ramp(void)
{
    run_at(1000.0);
    turn_to_rpm(2500.0);
    wait_s(0.25); /* 30 ms of filter, then 4000 rpm/s */
    measured_t m = measure(0.01);
    TEST_ASSERT_DOUBLE_WITHIN(150.0, 1000.0 + SPEEDREFRAMP_RPM_PER_S * 0.235, m.rpm);
}

void test_current_stays_below_its_maximum_while_accelerating_a_heavy_rotor(void)
{
    set("mech.inertia_kgm2", 400e-6);
    run_at(1000.0);
    turn_to_rpm(2800.0);
    measured_t m = measure(2.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.15 * MAXIMUM_CURRENT_A, MAXIMUM_CURRENT_A, m.i_peak_a);
    assert_running();
}

void test_overload_at_the_current_limit_faults_as_stall(void)
{
    run_at(1000.0);
    set("load.constant_nm", 0.25);
    TEST_ASSERT_TRUE(seconds_to_fault(1.0) < 0.6);
    assert_fault(FAULT_STALL);
}

void test_AN1292_table_2_torques_are_held_below_base_speed(void)
{
    (void)assert_holds_under_load(500.0, 0.148);
    (void)assert_holds_under_load(1000.0, 0.111);
    (void)assert_holds_under_load(1500.0, 0.083);
    (void)assert_holds_under_load(2000.0, 0.062);
    (void)assert_holds_under_load(2500.0, 0.031);
}

void test_bus_sag_of_30_percent_is_invisible_in_speed_when_voltage_suffices(void)
{
    run_at(1500.0);
    set("supply.voltage_v", 16.8);
    measured_t m = measure(0.4);
    TEST_ASSERT_TRUE(m.rpm_min > 1470.0);
    set("supply.voltage_v", 24.0);
    m = measure(0.4);
    TEST_ASSERT_TRUE(m.rpm_max < 1530.0);
    assert_running();
}

void test_ripple_on_the_bus_does_not_reach_the_speed(void)
{
    run_at(2000.0);
    for (int i = 0; i < 40; i++) {
        set("supply.voltage_v", 24.0 + ((i % 2) ? 2.0 : -2.0));
        wait_s(0.005);
    }
    (void)assert_holds(2000.0, 0.2);
}

void test_tolerates_a_motor_and_a_board_that_differ_from_what_it_assumes(void)
{
    static const struct {
        const char *key;
        double times, nm, angle_limit_deg;
    } cases[] = {
        { "motor.rs_ohm", 0.7, 0.03, 12.0 },
        { "motor.rs_ohm", 1.3, 0.03, 12.0 },
        { "motor.lq_h", 0.7, 0.03, 8.0 },
        { "motor.lq_h", 1.3, 0.03, 8.0 },
        { "motor.psi_vs", 0.85, 0.03, 16.0 },
        { "motor.psi_vs", 1.15, 0.03, 16.0 },
        { "adc.noise_lsb", 3.0, 0.0, 5.0 },
        { "motor.temp_c", 4.0, 0.04, 20.0 }, /* 100 degrees */
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char what[64];
        double nominal = get(cases[i].key);
        set(cases[i].key, nominal * cases[i].times);
        (void)snprintf(what, sizeof what, "%s = %g", cases[i].key, nominal * cases[i].times);
        TEST_ASSERT_TRUE_MESSAGE(assert_holds_under_load(1400.0, cases[i].nm).angle_rms_deg < cases[i].angle_limit_deg, what);
        set(cases[i].key, nominal);
    }
}

void test_wrong_kphi_is_learnt_and_the_angle_comes_back(void)
{
    static const double ratio[] = { 0.8, 0.9, 1.1, 1.2 };
    for (size_t i = 0; i < sizeof ratio / sizeof ratio[0]; i++) {
        set("motor.psi_vs", 7.983e-3 * ratio[i]);
        measured_t m = assert_holds_under_load(2000.0, 0.03);
        TEST_ASSERT_DOUBLE_WITHIN(1.0, 0.0, m.angle_rms_deg);
        TEST_ASSERT_DOUBLE_WITHIN(3.0, 100.0 * (ratio[i] - 1.0), get("fw.kphi_change_percent"));
    }
}

void test_wrong_resistance_is_learnt_where_a_load_shows_it(void)
{
    static const double ratio[] = { 0.7, 1.5 };
    double rs = get("motor.rs_ohm");
    for (size_t i = 0; i < sizeof ratio / sizeof ratio[0]; i++) {
        set("motor.rs_ohm", rs * ratio[i]);
        (void)assert_holds_under_load(500.0, 0.06);
        wait_s(1.0);
        TEST_ASSERT_DOUBLE_WITHIN(2.0, 0.0, measure(0.3).angle_rms_deg);
        TEST_ASSERT_TRUE(get("fw.rs_change_percent") * (ratio[i] - 1.0) > 0.0);
    }
}

/* A resistance that is too high by 43 % lets a growing load swing the loop once it is quick: what turns back must not be answered quickly again. */
void test_load_that_grows_on_a_winding_with_less_resistance_never_stalls_it(void)
{
    set("motor.rs_ohm", 0.7 * get("motor.rs_ohm"));
    for (int phase = 0; phase < 4; phase++) {
        run_at(500.0);
        wait_s(0.07 * phase);
        for (int i = 1; i <= 200; i++) {
            set("load.constant_nm", 0.06 * fmin(i / 100.0, 1.0));
            wait_s(0.01);
            TEST_ASSERT_TRUE_MESSAGE(get("state.speed_rpm") > 250.0, "half the speed");
        }
        assert_running();
        set("load.constant_nm", 0.0);
    }
}

void test_load_observer_shows_speed_and_load_without_delay_of_an_integral(void)
{
    run_at(1500.0);
    measured_t unloaded = measure(0.2);
    set("load.constant_nm", 0.05);
    wait_s(0.05);
    measured_t m = measure(0.2);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, m.i_q_a, get("fw.load_a"));
    TEST_ASSERT_DOUBLE_WITHIN(0.08, unloaded.i_q_a + 0.05 / 0.0599, m.i_q_a);
    TEST_ASSERT_DOUBLE_WITHIN(30.0, get("state.speed_rpm"), get("fw.speed_obs_rpm"));
}

void test_shunts_see_the_current_at_full_voltage(void)
{
    run_at(2800.0);
    ramp_load(0.03);
    assert_shunts_see_the_current();
    TEST_ASSERT_TRUE(get("fw.v_limit_v") - hypot(get("fw.v_d_v"), get("fw.v_q_v")) < 0.6);
}

void test_no_configuration_warnings(void)
{
    run_at(2000.0);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, vb_warning_count(bench), vb_warning_count(bench) ? vb_warning(bench, 0) : "");
}
