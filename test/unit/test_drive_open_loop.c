/* The drive in OPEN_LOOP_FUNCTIONING: it never leaves the forced angle; the estimator can be watched. */
/* defines: -DOPEN_LOOP_FUNCTIONING */
#include "ideal_motor.h"
#include "unity.h"

void setUp(void)
{
    rig_start(1);
    ideal_motor_reset(1.0F, 0.0F);
}

void tearDown(void)
{
}

void test_stays_on_the_ramps_end_speed_for_ever(void)
{
    ideal_motor_run(60000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
    TEST_ASSERT_EQUAL_INT32(params.forced.end_speed_q10, drive.forced.speed_q10);
    TEST_ASSERT_FLOAT_WITHIN(25.0F, 5000.0F, ideal_motor_erpm());
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_PWM, out.outputs);
}

void test_estimator_runs_along(void)
{
    ideal_motor_run(50000);
    TEST_ASSERT_INT16_WITHIN(60, 5000, estimator_speed(&drive.run.estimator));
}

void test_an_estimator_that_disagrees_is_no_fault(void)
{
    motor.blocked = 1;
    ideal_motor_run(50000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_stop_switches_off(void)
{
    ideal_motor_run(40000);
    drive.command.run = 0;
    ideal_motor_run(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}
