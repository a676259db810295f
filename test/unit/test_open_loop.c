/* The drive in OPEN_LOOP_FUNCTIONING: it never leaves the forced angle; the estimator can be watched. */
/* defines: -DOPEN_LOOP_FUNCTIONING */
#include "hurst_params.h"

#include "law.c"
#include "ideal_motor.h"

void setUp(void)
{
    rig_start(1);
    ideal_motor_reset(1.0F, 0.0F);
}

void test_stays_on_the_ramps_end_speed_with_the_estimator_beside_it_until_the_stop(void)
{
    ideal_motor_run(60000);
    EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, "turning");
    TEST_ASSERT_EQUAL_INT32(params.forced.end_speed_q10, drive.forced.speed_q10);
    TEST_ASSERT_FLOAT_WITHIN(25.0F, 5000.0F, ideal_motor_erpm());
    TEST_ASSERT_INT16_WITHIN(60, 5000, estimator_speed(&drive.run.estimator));
    drive.command.run = 0;
    ideal_motor_run(SLOW_PERIODS);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "stopped");
}

void test_an_estimator_that_disagrees_is_no_fault(void)
{
    motor.blocked = 1;
    ideal_motor_run(50000);
    EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, "blocked");
}
