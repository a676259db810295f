/* The drive in TUNING: the reference ramps by itself from END_SPEED to MAXIMUM_SPEED. */
/* defines: -DTUNING */
#include "hurst_params.h"

#include "law.c"
#include "ideal_motor.h"

#include "drive/limits.h"

void setUp(void)
{
    rig_power_up();
    ideal_motor_reset(1.0F, 0.0F);
}

void test_ramp_is_one_erpm_every_16_periods_up_to_maximum_speed_whatever_the_potentiometer_says(void)
{
    static const struct {
        int16_t from_erpm, steps, reference_erpm;
    } cases[] = { { 5000, 1, 5000 }, { 5000, 2, 5001 }, { 5000, 1000, 5500 }, { 27400, 1000, 27500 } };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            int16_t step;
            rig_closed(direction, (int16_t)(direction * cases[n].from_erpm));
            drive.command.target_erpm = (int16_t)((n & 1u) ? 2500 : 0);
            for (step = 0; step < cases[n].steps; step++) {
                rig_speed(drive.run.control.reference_erpm); /* the motor follows */
                speed_reference_step(&drive, &params);
            }
            TEST_ASSERT_EQUAL_INT16_MESSAGE(direction * cases[n].reference_erpm, drive.run.control.reference_erpm, golden_row(n));
        }
    }
}

void test_ramp_waits_for_a_motor_that_cannot_follow_and_a_stop_ramps_down_as_ever(void)
{
    uint16_t n;
    rig_closed(1, 8000);
    rig_speed(6250);
    for (n = 0; n < 100u; n++) {
        speed_reference_step(&drive, &params);
    }
    TEST_ASSERT_EQUAL_INT16(8000, drive.run.control.reference_erpm);
    drive.state = (uint16_t)DRIVE_STOPPING;
    speed_reference_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(7992, drive.run.control.reference_erpm);
}

void test_motor_follows_at_250_rpm_per_second_from_the_hand_over(void)
{
    int16_t from_erpm;
    rig_start(1);
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    from_erpm = drive.run.control.reference_erpm;
    TEST_ASSERT_INT16_WITHIN(100, params.early_erpm + 71, from_erpm); /* 20 ms further up the ramp */
    ideal_motor_run(20000);
    TEST_ASSERT_INT16_WITHIN(10, (int16_t)(from_erpm + 1250), drive.run.control.reference_erpm);
    TEST_ASSERT_FLOAT_WITHIN(60.0F, (float)(from_erpm + 1250), ideal_motor_erpm());
}

void test_ramp_to_maximum_speed_is_the_reason_whatever_the_potentiometer_says(void)
{
    EACH_DIRECTION(direction) {
        rig_closed(direction, (int16_t)(direction * 8000));
        drive.run.control.vq_limit_q14 = 10000;
        drive.run.control.v_q14.q = 0;
        TEST_ASSERT_EQUAL_HEX16(LIMIT_RAMP, limits_reasons(&drive, &params));
        drive.run.control.reference_erpm = (int16_t)(direction * 27500);
        TEST_ASSERT_EQUAL_HEX16(LIMIT_NONE, limits_reasons(&drive, &params));
    }
}
