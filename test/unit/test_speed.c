/* Speed: the reference's ramp that waits for the motor, the controller within its limit, and the end of a stop. */
#include "drive_rig.h"

void setUp(void)
{
    rig_power_up();
}

/* ---- the reference: 4000 rpm/s = 20000 erpm/s = 8 erpm in 400 us ---- */

/** Reference after one step from 10000, in the direction of rotation. */
static int16_t step(int16_t direction, int16_t target_erpm, int16_t speed_erpm)
{
    rig_closed(direction, (int16_t)(direction * 10000));
    drive.command.target_erpm = (int16_t)(direction * target_erpm);
    rig_speed((int16_t)(direction * speed_erpm));
    speed_reference_step(&drive, &params);
    return (int16_t)(direction * drive.run.control.reference_erpm);
}

void test_reference_waits_while_the_motor_is_350_rpm_behind_or_ahead(void)
{
    static const struct {
        const char *what;
        int16_t target_erpm, speed_erpm, next_erpm;
    } cases[] = {
        { "up, nearly too far behind", 20000, 10000 - 1749, 10008 },
        { "up, too far behind", 20000, 10000 - 1750, 10000 },
        { "up, far ahead", 20000, 20000, 10008 },
        { "down, nearly too far ahead", 3000, 10000 + 1749, 9992 },
        { "down, too far ahead", 3000, 10000 + 1750, 10000 },
        { "down, far behind", 3000, 2000, 9992 },
        { "a near target", 10013, 10000, 10013 },
        { "at its target", 10000, 10000, 10000 },
    };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].next_erpm, step(direction, cases[n].target_erpm, cases[n].speed_erpm), cases[n].what);
        }
    }
}

/* ---- the controller ---- */

void test_speed_below_the_reference_asks_for_driving_current_up_to_its_limit(void)
{
    EACH_DIRECTION(direction) {
        uint16_t n;
        rig_closed(direction, (int16_t)(direction * 10000));
        drive.run.control.iq_limit_q13 = 1234;
        rig_speed((int16_t)(direction * 8500));
        for (n = 0; n < 200u; n++) {
            speed_step(&drive, &params);
            TEST_ASSERT_TRUE(direction * drive.run.control.ref_q13.q > 0);
            TEST_ASSERT_TRUE(direction * drive.run.control.ref_q13.q <= 1234);
        }
        TEST_ASSERT_EQUAL_INT16(direction * 1234, drive.run.control.ref_q13.q);
    }
}

/* ---- the end of a stop ---- */

void test_stop_ends_when_speed_and_reference_are_below_the_minimum(void)
{
    static const struct {
        drive_state_t from, to;
        int16_t speed_erpm, reference_erpm;
    } cases[] = {
        { DRIVE_STOPPING, DRIVE_STOPPED, 2499, 2499 }, { DRIVE_STOPPING, DRIVE_STOPPED, -2499, -2499 },
        { DRIVE_STOPPING, DRIVE_STOPPING, 2500, 2400 }, { DRIVE_STOPPING, DRIVE_STOPPING, -2500, 2400 },
        { DRIVE_STOPPING, DRIVE_STOPPING, 2400, 2600 }, { DRIVE_STOPPING, DRIVE_STOPPING, 2400, -2600 },
        { DRIVE_STOPPING, DRIVE_STOPPING, 2400, 2508 }, /* a step from there is the minimum */
        { DRIVE_CLOSED, DRIVE_CLOSED, 2000, 2000 }, /* low speed alone */
    };
    EACH(n, cases) {
        rig_closed(1, cases[n].reference_erpm);
        drive.state = (uint16_t)cases[n].from;
        rig_speed(cases[n].speed_erpm);
        speed_step(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].to, drive.state, golden_row(n));
    }
}
