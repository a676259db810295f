/* Each fault: outputs off within a period, its code kept until S2, and no start by the same press. */
#include "bench.h"

void setUp(void)
{
    bench_set_up();
}

void tearDown(void)
{
    bench_tear_down();
}

static void cause_away_fault_stays_until_s2(drive_fault_t fault)
{
    wait_s(0.3);
    assert_fault(fault);
    set("state.speed_rpm", 0.0);
    press_s2();
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, board_drive.fault);
    wait_s(0.3);
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
    assert_outputs_off();
}

void test_fault_input_switches_off_within_a_period(void)
{
    run_at(1500.0);
    set("input.flta", 1.0);
    wait_s(0.00005);
    assert_fault(FAULT_OVERCURRENT_HW);
    set("input.flta", 0.0);
    cause_away_fault_stays_until_s2(FAULT_OVERCURRENT_HW);
}

void test_phase_current_above_the_threshold_trips_in_software(void)
{
    run_at(1500.0);
    ramp_load(0.08);
    set("inverter.trip_a", 0.0);
    set("shunt.gain_v_per_a", 0.375 * 4.0); /* the amplifier shows four times the current */
    TEST_ASSERT_TRUE(seconds_to_fault(0.02) < 0.015);
    set("shunt.gain_v_per_a", 0.375);
    cause_away_fault_stays_until_s2(FAULT_OVERCURRENT_SW);
}

void test_over_voltage_trips(void)
{
    run_at(1500.0);
    set("supply.voltage_v", OVER_VOLTAGE_V + 2.0);
    TEST_ASSERT_TRUE(seconds_to_fault(0.1) < 0.05);
    supply_v(24.0);
    cause_away_fault_stays_until_s2(FAULT_OVERVOLTAGE);
}

void test_under_voltage_trips_while_running(void)
{
    run_at(800.0);
    set("supply.voltage_v", UNDER_VOLTAGE_V - 2.0);
    TEST_ASSERT_TRUE(seconds_to_fault(0.5) < 0.4);
    set("supply.voltage_v", 24.0);
    cause_away_fault_stays_until_s2(FAULT_UNDERVOLTAGE);
}

void test_under_voltage_at_rest_is_no_fault(void)
{
    power_on();
    supply_v(8.0);
    wait_s(0.3);
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, board_drive.fault);
}

void test_shaft_blocked_while_running_faults_as_stall_or_lost_lock(void)
{
    run_at(2000.0);
    set("load.locked", 1.0);
    TEST_ASSERT_TRUE(seconds_to_fault(1.0) < 0.5);
    TEST_ASSERT_TRUE(board_drive.fault == FAULT_STALL || board_drive.fault == FAULT_LOST_LOCK);
    assert_outputs_off();
}

void test_shaft_blocked_in_field_weakening_faults(void)
{
    run_at(5000.0);
    set("load.locked", 1.0);
    TEST_ASSERT_TRUE(seconds_to_fault(1.0) < 0.5);
    assert_outputs_off();
}

void test_late_interrupt_trips(void)
{
    run_at(1500.0);
    set("cpu.isr_us", 24.0);
    TEST_ASSERT_TRUE(seconds_to_fault(0.01) < 0.0005);
    set("cpu.isr_us", 13.0);
    cause_away_fault_stays_until_s2(FAULT_ISR_OVERRUN);
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
    TEST_ASSERT_TRUE(board_drive.fault == FAULT_STALL || board_drive.fault == FAULT_LOST_LOCK || board_drive.fault == FAULT_OVERCURRENT_SW);
    assert_outputs_off();
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
