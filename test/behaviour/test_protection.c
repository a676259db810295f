/* Each fault: outputs off within a period, its code kept until S2, and no start by the same press. */
#include "bench.h"

static void cause_away_fault_stays_until_s2(drive_fault_t fault)
{
    wait_s(0.3);
    assert_fault(fault);
    set("state.speed_rpm", 0.0);
    press("input.s2");
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, board_drive.fault);
    wait_s(0.3);
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
    assert_outputs_off();
}

/** At a speed, a cause makes its fault in time; the fault stays when the cause is gone, until S2. */
static void trips(double rpm, const char *cause, double value, double limit_s, drive_fault_t fault)
{
    run_at(rpm);
    double before = get(cause);
    set(cause, value);
    TEST_ASSERT_TRUE(seconds_to_fault(2.0 * limit_s) < limit_s);
    assert_fault(fault);
    set(cause, before);
    set("bus.voltage_v", 24.0);
    cause_away_fault_stays_until_s2(fault);
}

void test_fault_input_switches_off_within_a_period(void)
{
    trips(1500.0, "input.flta", 1.0, 0.00006, FAULT_OVERCURRENT_HW);
}

void test_phase_current_above_the_threshold_trips_in_software(void)
{
    set("load.constant_nm", 0.05);
    set("inverter.trip_a", 0.0);
    trips(1500.0, "shunt.gain_v_per_a", 0.375 * 5.0, 0.015, FAULT_OVERCURRENT_SW); /* the amplifier shows five times the current */
}

void test_over_voltage_trips(void)
{
    trips(1500.0, "supply.voltage_v", OVER_VOLTAGE_V + 2.0, 0.05, FAULT_OVERVOLTAGE);
}

void test_under_voltage_trips_while_running(void)
{
    trips(800.0, "supply.voltage_v", UNDER_VOLTAGE_V - 2.0, 0.4, FAULT_UNDERVOLTAGE);
}

void test_late_interrupt_trips(void)
{
    trips(1500.0, "cpu.isr_us", 24.0, 0.0005, FAULT_ISR_OVERRUN);
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
