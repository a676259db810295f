/* The drive in TORQUE_MODE: the command is the q current, speed is only guarded. */
/* defines: -DTORQUE_MODE */
#include "ideal_motor.h"
#include "unity.h"

void setUp(void)
{
    rig_power_up();
    ideal_motor_reset(1.0F, 0.0F);
}

void tearDown(void)
{
}

static int16_t torque_step(int16_t direction, int16_t command_q13, int16_t speed_erpm)
{
    uint16_t n;
    rig_closed(direction, (int16_t)(direction * speed_erpm));
    drive.command.target_erpm = command_q13;
    for (n = 0; n < 400u; n++) {
        speed_step(&drive, &params);
    }
    return drive.run.control.ref_q13.q;
}

void test_command_is_the_q_current_between_minimum_and_maximum_speed(void)
{
    TEST_ASSERT_EQUAL_INT16(1000, torque_step(1, 1000, 10000));
    TEST_ASSERT_EQUAL_INT16(3000, torque_step(1, 3000, 10000));
    TEST_ASSERT_EQUAL_INT16(0, torque_step(1, 0, 10000));
}

void test_reverse_commands_a_negative_current(void)
{
    TEST_ASSERT_EQUAL_INT16(-1000, torque_step(-1, -1000, 10000));
    TEST_ASSERT_EQUAL_INT16(-1000, torque_step(-1, 1000, 10000));
}

void test_command_is_limited_by_the_current_circle(void)
{
    rig_closed(1, 10000);
    drive.command.target_erpm = 5000;
    drive.run.control.iq_limit_q13 = 2000;
    speed_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(2000, drive.run.control.ref_q13.q);
}

void test_no_more_driving_current_above_maximum_speed(void)
{
    TEST_ASSERT_LESS_OR_EQUAL_INT16(0, torque_step(1, 3000, 28000));
    TEST_ASSERT_GREATER_OR_EQUAL_INT16(0, torque_step(-1, 3000, 28000));
}

void test_below_minimum_speed_current_holds_the_motor_without_a_command(void)
{
    TEST_ASSERT_GREATER_THAN_INT16(0, torque_step(1, 0, 1500));
    TEST_ASSERT_LESS_THAN_INT16(0, torque_step(-1, 0, 1500));
    TEST_ASSERT_TRUE(torque_step(1, 0, 1000) > torque_step(1, 0, 1500));
}

void test_holding_current_stays_within_the_circle(void)
{
    rig_closed(1, 0);
    drive.command.target_erpm = 0;
    drive.run.control.iq_limit_q13 = 700;
    speed_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(700, drive.run.control.ref_q13.q);
}

void test_field_weakening_follows_the_speed(void)
{
    (void)torque_step(1, 1000, 20000);
    TEST_ASSERT_EQUAL_INT16(20000, drive.run.control.reference_erpm);
}

void test_motor_accelerates_with_the_command_and_stops_in_order(void)
{
    rig_start(1);
    drive.command.target_erpm = 800;
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    ideal_motor_run(4000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_INT16_WITHIN(20, 800, drive.run.control.ref_q13.q);
    drive.command.run = 0;
    TEST_ASSERT_LESS_THAN_UINT32(40000, ideal_motor_run_until(DRIVE_STOPPED, 40000));
    ideal_motor_run(1);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_without_a_command_the_motor_stays_at_about_minimum_speed(void)
{
    rig_start(1);
    drive.command.target_erpm = 0;
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    ideal_motor_run(40000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_FLOAT_WITHIN(600.0F, 2500.0F, ideal_motor_erpm());
}

void test_unloaded_motor_does_not_pass_maximum_speed(void)
{
    rig_start(1);
    drive.command.target_erpm = 2000;
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    ideal_motor_run(60000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_TRUE(ideal_motor_erpm() < 28000.0F);
    TEST_ASSERT_TRUE(ideal_motor_erpm() > 14000.0F);
}
