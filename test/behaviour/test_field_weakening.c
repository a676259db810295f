/* Above base speed: field weakening reaches twice the base speed and survives what users do to it. */
#include "bench.h"

#include "drive/param_init.h"

#define IDREF_ENTRY(i) IDREF_SPEED##i
static const double idref_a[] = PARAM_18(IDREF_ENTRY);

/* Where a speed lies in the tables, in entries. */
static double place_in_table(double rpm)
{
    return (rpm - FW_START_SPEED_RPM) * NOPOLESPAIRS / 1024.0;
}

void setUp(void)
{
    bench_set_up();
}

void test_reaches_5500_rpm_without_load(void)
{
    run_at(5500.0);
    measured_t m = assert_holds(5500.0, 0.5);
    TEST_ASSERT_TRUE(m.angle_rms_deg < 5.0);
    TEST_ASSERT_EQUAL_INT((int)place_in_table(5500.0), board_drive.run.fieldweak.index);
}

void test_voltage_never_leaves_its_circle(void)
{
    run_at(2800.0);
    press("input.s3");
    turn_to_rpm(5500.0);
    measured_t m = measure(1.5);
    TEST_ASSERT_TRUE(m.v_max_share > 0.9); /* it is used */
    TEST_ASSERT_TRUE(m.v_max_share <= 1.001);
}

void test_d_current_follows_the_table(void)
{
    double place = place_in_table(4000.0);
    int index = (int)place;
    run_at(4000.0);
    measured_t m = measure(0.3);
    TEST_ASSERT_EQUAL_INT(index, board_drive.run.fieldweak.index);
    TEST_ASSERT_DOUBLE_WITHIN(0.06, idref_a[index] + (place - index) * (idref_a[index + 1] - idref_a[index]), m.i_d_a);
}

void test_field_weakening_survives_throttle_release(void)
{
    run_at(5500.0);
    turn_to_rpm(2800.0);
    measured_t m = measure(1.2);
    assert_running();
    TEST_ASSERT_TRUE(m.bus_max_v < 30.0);
    (void)assert_holds(2800.0, 0.3);
    turn_to_rpm(5500.0);
    wait_s(1.2);
    (void)assert_holds(5500.0, 0.3);
}

void test_bus_sag_of_30_percent_at_top_speed(void)
{
    run_at(5500.0);
    set("supply.voltage_v", 16.8);
    measured_t m = measure(0.6);
    assert_running();
    TEST_ASSERT_TRUE(m.rpm_min > 2800.0); /* what 16.8 V and the current limit allow */
    set("supply.voltage_v", 24.0);
    wait_s(1.0);
    (void)assert_holds(5500.0, 0.3);
}

void test_speed_range_switched_at_the_upper_end_follows_the_ramp(void)
{
    run_at(2800.0);
    press("input.s3"); /* the potentiometer stays at its end: straight to maximum speed */
    measured_t m = measure(1.5);
    TEST_ASSERT_TRUE(m.rpm_max < 1.03 * MAXIMUM_SPEED_RPM);
    (void)assert_holds(5500.0, 0.3);
}

void test_load_beyond_the_torque_at_top_speed_lowers_the_speed_or_faults_but_never_over_currents(void)
{
    run_at(5500.0);
    ramp_load(0.03);
    measured_t m = measure(0.5);
    TEST_ASSERT_TRUE(board_drive.fault == FAULT_NONE || board_drive.fault == FAULT_STALL);
    TEST_ASSERT_TRUE(m.i_peak_a < OVER_CURRENT_THRESHOLD_A);
    TEST_ASSERT_TRUE(m.bus_max_v < 30.0);
}

void test_AN1292_table_2_torques_are_held_above_base_speed(void)
{
    TEST_ASSERT_TRUE(assert_holds_under_load(3000.0, 0.020).angle_rms_deg < 5.0);
    TEST_ASSERT_TRUE(assert_holds_under_load(3500.0, 0.019).angle_rms_deg < 5.0);
    TEST_ASSERT_TRUE(assert_holds_under_load(4000.0, 0.015).angle_rms_deg < 5.0);
}

void test_voltage_feedback_covers_a_weaker_table(void)
{
    set("motor.psi_vs", 7.983e-3 * 1.1); /* needs more d current than the table has */
    run_at(4000.0);
    (void)assert_holds(4000.0, 0.5);
    TEST_ASSERT_TRUE(get("fw.id_trim_a") < -0.05);
}

void test_shunts_see_the_current_in_field_weakening(void)
{
    run_at(5500.0);
    assert_shunts_see_the_current();
}

void test_back_emf_neither_wraps_nor_saturates_at_top_speed(void)
{
    run_at(5500.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.6, 7.983e-3 * 5500.0 * 5.0 * M_PI / 30.0, get("fw.e_q_v"));
}
