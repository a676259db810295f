/* The drive in TUNING: the reference ramps by itself from END_SPEED to MAXIMUM_SPEED. */
/* defines: -DTUNING */
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

/** Reference after slow steps with a motor that follows. */
static int16_t reference_after(int16_t direction, int16_t from_erpm, uint16_t steps)
{
    rig_closed(direction, (int16_t)(direction * from_erpm));
    drive.command.target_erpm = 0;
    while (steps-- != 0u) {
        drive.run.estimator.omega_filtered_q16 = (int32_t)drive.run.control.reference_erpm * 65536;
        speed_reference_step(&drive, &params);
    }
    return (int16_t)(direction * drive.run.control.reference_erpm);
}

void test_ramp_is_one_erpm_every_16_periods(void)
{
    TEST_ASSERT_EQUAL_INT16(5000, reference_after(1, 5000, 1));
    TEST_ASSERT_EQUAL_INT16(5001, reference_after(1, 5000, 2));
    TEST_ASSERT_EQUAL_INT16(5500, reference_after(1, 5000, 1000));
    TEST_ASSERT_EQUAL_INT16(5500, reference_after(-1, 5000, 1000));
}

void test_ramp_ends_at_maximum_speed(void)
{
    TEST_ASSERT_EQUAL_INT16(27500, reference_after(1, 27400, 1000));
    TEST_ASSERT_EQUAL_INT16(27500, reference_after(-1, 27400, 1000));
}

void test_ramp_ignores_the_potentiometer(void)
{
    rig_closed(1, 8000);
    drive.command.target_erpm = 2500;
    speed_reference_step(&drive, &params);
    speed_reference_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(8001, drive.run.control.reference_erpm);
}

void test_ramp_waits_for_a_motor_that_cannot_follow(void)
{
    uint16_t n;
    rig_closed(1, 8000);
    drive.run.estimator.omega_filtered_q16 = 6250L * 65536;
    for (n = 0; n < 100u; n++) {
        speed_reference_step(&drive, &params);
    }
    TEST_ASSERT_EQUAL_INT16(8000, drive.run.control.reference_erpm);
}

void test_stop_ramps_down_as_ever(void)
{
    rig_closed(1, 8000);
    drive.state = (uint16_t)DRIVE_STOPPING;
    speed_reference_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(7992, drive.run.control.reference_erpm);
}

void test_motor_follows_at_250_rpm_per_second_from_END_SPEED(void)
{
    int16_t at_start;
    rig_start(1);
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    at_start = drive.run.control.reference_erpm;
    TEST_ASSERT_EQUAL_INT16(5000, at_start);
    ideal_motor_run(20000);
    TEST_ASSERT_INT16_WITHIN(10, 5000 + 1250, drive.run.control.reference_erpm);
    TEST_ASSERT_FLOAT_WITHIN(60.0F, 6250.0F, ideal_motor_erpm());
}
