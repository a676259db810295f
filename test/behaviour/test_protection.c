/* Each fault: outputs off within a period, its code kept until S2, and no start by the same press. */
#include "bench.h"

void setUp(void)
{
    bench_set_up();
}

void test_each_cause_trips_in_time_and_its_fault_stays_until_s2(void)
{
    static const struct {
        const char *cause;
        double rpm, value, limit_s;
        drive_fault_t fault;
    } cases[] = {
        { "input.flta", 1500.0, 1.0, 0.00006, FAULT_OVERCURRENT_HW }, /* within a period */
        { "supply.voltage_v", 1500.0, OVER_VOLTAGE_V + 2.0, 0.05, FAULT_OVERVOLTAGE },
        { "supply.voltage_v", 800.0, UNDER_VOLTAGE_V - 2.0, 0.4, FAULT_UNDERVOLTAGE },
        { "cpu.isr_us", 1500.0, 24.0, 0.0005, FAULT_ISR_OVERRUN },
        { "shunt.gain_v_per_a", 1500.0, 0.375 * 5.0, 0.015, FAULT_OVERCURRENT_SW }, /* the amplifier shows five times the current */
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        if (cases[i].fault == FAULT_OVERCURRENT_SW) {
            set("load.constant_nm", 0.05);
            set("inverter.trip_a", 0.0);
        }
        run_at(cases[i].rpm);
        double before = get(cases[i].cause);
        set(cases[i].cause, cases[i].value);
        TEST_ASSERT_TRUE_MESSAGE(seconds_to_fault(2.0 * cases[i].limit_s) < cases[i].limit_s, cases[i].cause);
        assert_fault(cases[i].fault);
        set(cases[i].cause, before);
        set("bus.voltage_v", 24.0);
        wait_s(0.3);
        assert_fault(cases[i].fault);
        set("state.speed_rpm", 0.0);
        press("input.s2");
        TEST_ASSERT_EQUAL_INT_MESSAGE(FAULT_NONE, board_drive.fault, cases[i].cause);
        wait_s(0.3);
        TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
        assert_outputs_off();
    }
}

void test_a_bus_signal_that_falls_by_a_fifth_or_more_is_named_before_the_rotor_is_lost(void)
{
    for (uint16_t n = 0; n < 8u; n++) {
        bench_set_up();
        set("load.constant_nm", 0.03);
        run_at(1000.0 + 200.0 * n);
        wait_s(0.0002 * n); /* wherever the slow work is */
        set("fault.vbus_gain", (n & 1u) ? 0.7 : 0.8);
        TEST_ASSERT_TRUE(seconds_to_fault(0.1) < 0.004);
        assert_fault(FAULT_BUS_SENSOR);
    }
}

/** The bus falls by what the drive draws, or at once with a supply that takes current back. @param after_s negative: the load comes before the supply falls */
static void fall_by_a_third(double sinks, double load_nm, double after_s)
{
    bench_set_up();
    run_at(1500.0);
    set("supply.sinks", sinks);
    set("supply.resistance_ohm", 0.02);
    if (after_s < 0.0) {
        set("load.constant_nm", load_nm);
        wait_s(-after_s);
    }
    set("supply.voltage_v", 16.0);
    wait_s((after_s > 0.0) ? after_s : 0.0);
    set("load.constant_nm", load_nm);
    wait_s(0.1);
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, board_drive.fault);
}

void test_a_bus_that_falls_by_a_third_is_no_signals_even_where_a_load_comes_in_the_same_millisecond(void)
{
    for (int n = -4; n <= 4; n++) {
        fall_by_a_third(0.0, 0.1, 0.0005 * n);
    }
    fall_by_a_third(1.0, 0.0, 0.0);
    fall_by_a_third(1.0, 0.06, 0.01);
}

void test_under_voltage_at_rest_is_no_fault(void)
{
    power_on();
    supply_v(8.0);
    wait_s(0.3);
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, board_drive.fault);
}

void test_shaft_blocked_while_running_and_in_field_weakening_faults_as_stall_or_lost_lock(void)
{
    for (double rpm = 2000.0; rpm <= 5000.0; rpm += 3000.0) {
        run_at(rpm);
        set("load.locked", 1.0);
        TEST_ASSERT_TRUE(seconds_to_fault(1.0) < 0.5);
        TEST_ASSERT_TRUE(rpm > 2000.0 || board_drive.fault == FAULT_STALL || board_drive.fault == FAULT_LOST_LOCK);
        assert_outputs_off();
        set("load.locked", 0.0);
    }
}

void test_interrupt_that_stays_away_switches_off(void)
{
    run_at(1500.0);
    set("cpu.isr_dropped", 1.0);
    TEST_ASSERT_TRUE(seconds_to_fault(0.1) < 0.005);
    assert_fault(FAULT_ADC_LOST);
}

void test_broken_phase_wire_is_noticed(void)
{
    run_at(1500.0);
    ramp_load(0.04);
    set("fault.open_phase", 2.0);
    TEST_ASSERT_TRUE(seconds_to_fault(2.0) < 1.0);
    /* the rotor may stand before the wire is known */
    TEST_ASSERT_TRUE(board_drive.fault == FAULT_OPEN_PHASE || board_drive.fault == FAULT_STALL || board_drive.fault == FAULT_LOST_LOCK);
    assert_outputs_off();
}

void test_each_phase_that_opens_while_little_flows_or_the_voltage_ends_is_named(void)
{
    static const double speeds_rpm[] = { 3200.0, 2800.0 };
    for (size_t i = 0; i < 2; i++) {
        for (double phase = 1.0; phase <= 3.0; phase += 1.0) {
            run_at(speeds_rpm[i]);
            set("load.constant_nm", 0.02);
            wait_s(0.5);
            set("fault.open_phase", phase);
            TEST_ASSERT_TRUE(seconds_to_fault(1.0) < 0.3);
            assert_fault(FAULT_OPEN_PHASE);
            set("fault.open_phase", 0.0);
        }
    }
}

void test_a_noisy_current_signal_is_named(void)
{
    run_at(2000.0);
    set("fault.ib_noise_a", 0.5);
    TEST_ASSERT_TRUE(seconds_to_fault(4.0) < 3.0);
    assert_fault(FAULT_CURRENT_SENSOR);
}

void test_an_offset_that_swings_a_slow_loaded_rotor_is_named_and_a_third_of_it_is_ridden_through(void)
{
    static const char *const signals[] = { "fault.ia_error_a", "fault.ib_error_a" };
    for (size_t i = 0; i < 2; i++) {
        for (double offset_a = -0.075; offset_a < 0.1; offset_a += 0.15) {
            run_at(210.0);
            set("load.constant_nm", 0.028);
            wait_s(0.5);
            set(signals[i], offset_a / 3.0);
            TEST_ASSERT_EQUAL_INT(FAULT_NONE, (seconds_to_fault(1.5), board_drive.fault));
            set(signals[i], offset_a);
            TEST_ASSERT_TRUE(seconds_to_fault(1.5) < 0.95);
            assert_fault(FAULT_CURRENT_SENSOR);
            set(signals[i], 0.0);
        }
    }
}

void test_first_fault_is_the_one_that_is_kept(void)
{
    run_at(1500.0);
    set("input.flta", 1.0);
    wait_s(0.001);
    supply_v(40.0);
    wait_s(0.1);
    TEST_ASSERT_EQUAL_INT(FAULT_OVERCURRENT_HW, board_drive.fault);
}
