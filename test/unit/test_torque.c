/* TORQUE_MODE: the potentiometer commands the q current, speed is only guarded. */
/* defines: -DTORQUE_MODE */
#include "hurst_params.h"

#include "law.c"
#include "ideal_motor.h"
#include "panel_rig.h"

#include "drive/limits.h"
#include "drive/request.h"

void setUp(void)
{
    panel_reset();
    rig_ready();
    ideal_motor_reset(1.0F, 0.0F);
}

/** A command in a direction; none has one, too. */
static int16_t forward(int16_t direction, int16_t command_q13)
{
    return (int16_t)((direction > 0 || command_q13 != 0) ? direction * command_q13 : -1);
}

/** q current after a while at a speed, in the direction of rotation. @param steps of the controller */
static int16_t torque(int16_t direction, int16_t command_q13, int16_t speed_erpm, int16_t limit_q13, uint16_t steps)
{
    rig_closed(direction, (int16_t)(direction * speed_erpm));
    drive.command.target_erpm = forward(direction, command_q13);
    drive.run.control.iq_limit_q13 = limit_q13;
    while (steps-- != 0u) {
        speed_step(&drive, &params);
        speed_follow(&drive.run, &params);
    }
    /* field weakening and the rates follow the speed, but not below the minimum: without a gain nothing would hold the motor */
    TEST_ASSERT_EQUAL_INT16(direction * ((speed_erpm > 2500) ? speed_erpm : 2500), drive.run.control.reference_erpm);
    return (int16_t)(direction * drive.run.control.ref_q13.q);
}

void test_the_speed_controller_s_trim_is_left_alone(void)
{
    rig_closed(1, 10000);
    drive.run.control.iq_trim_q26 = 1000000;
    drive.run.control.trim_reference_erpm = 0;
    speed_trim_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT32(1000000, drive.run.control.iq_trim_q26);
    TEST_ASSERT_EQUAL_INT16(drive.run.control.reference_erpm, drive.run.control.trim_reference_erpm);
}

void test_a_start_that_asks_for_no_current_turns_forwards(void)
{
    drive_params_t small = params;
    small.current_max_q13 = 1000; /* half a step of the potentiometer's converter is less than a count */
    panel_turn_pot(0);
    drive_set_direction(&drive, -1); /* of the run before */
    the_request.wish_run = 1;
    inputs.elapsed_ms = 1;
    panel_pass(&small, &inputs);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.target_erpm);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
}

void test_command_is_the_q_current_between_minimum_and_maximum_speed_and_holds_below(void)
{
    static const struct {
        const char *what;
        int16_t command_q13, speed_erpm, limit_q13;
        uint16_t steps;
        int16_t least, most; /* in the direction of rotation */
    } cases[] = {
        { "as commanded", 1000, 10000, 5120, 400, 1000, 1000 },
        { "large", 3000, 10000, 5120, 400, 3000, 3000 },
        { "none", 0, 10000, 5120, 400, 0, 1 },
        { "limited by the circle", 5000, 10000, 2000, 1, 2000, 2000 },
        { "nothing that drives above maximum speed", 3000, 28000, 5120, 400, -5120, 0 },
        { "below minimum speed it holds the motor without a command", 0, 1500, 5120, 400, 1, 5120 },
        { "within the circle", 0, 1000, 100, 1, 100, 100 },
    };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            int16_t iq = torque(direction, cases[n].command_q13, cases[n].speed_erpm, cases[n].limit_q13, cases[n].steps);
            TEST_ASSERT_TRUE_MESSAGE(iq >= cases[n].least && iq <= cases[n].most, cases[n].what);
        }
        TEST_ASSERT_TRUE(torque(direction, 0, 1000, 5120, 400) > torque(direction, 0, 1500, 5120, 400));
    }
}

/** q current of a step, in the direction of rotation. @param load_q13 as observed, in that direction too */
static int16_t step(int16_t direction, int16_t command_q13, int16_t speed_erpm, int16_t load_q13)
{
    rig_closed(direction, (int16_t)(direction * speed_erpm));
    drive.command.target_erpm = forward(direction, command_q13);
    drive.run.observer.load_q16 = qm_mulsu((int16_t)(direction * load_q13), params.observer.per_current_q16);
    speed_step(&drive, &params);
    return (int16_t)(direction * drive.run.control.ref_q13.q);
}

/** The same of the speed controller with this target. */
static int16_t law(int16_t direction, int16_t target_erpm)
{
    return (int16_t)(direction * speed_current(&drive.run, &params, (int16_t)(direction * target_erpm)));
}

void test_command_gives_way_to_the_speed_law_at_both_speed_limits_and_only_there(void)
{
    static const struct {
        const char *what;
        int16_t command_q13, speed_erpm, load_q13, limit_erpm; /* 0: as commanded */
    } cases[] = {
        { "a load that the command does not hold, at minimum speed", 500, 2500, 1500, 2500 },
        { "the same below it", 500, 2300, 1500, 2500 },
        { "the same where the law for the minimum asks for less", 500, 8000, 1500, 0 },
        { "a command above the load, at maximum speed", 1500, 27500, 300, 27500 },
        { "the same above it", 1500, 27700, 300, 27500 },
        { "the same where the law for the maximum allows it", 1500, 18000, 300, 0 },
        { "the command that just holds the load, at maximum speed", 300, 27500, 300, 27500 },
    };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            int16_t iq = step(direction, cases[n].command_q13, cases[n].speed_erpm, cases[n].load_q13);
            TEST_ASSERT_INT16_WITHIN_MESSAGE(1, (cases[n].limit_erpm != 0) ? law(direction, cases[n].limit_erpm) : cases[n].command_q13, iq,
                                             cases[n].what);
        }
        TEST_ASSERT_INT16_WITHIN(2, 1500, step(direction, 500, 2500, 1500)); /* at a limit: what holds the load */
        TEST_ASSERT_INT16_WITHIN(2, 300, step(direction, 1500, 27500, 300));
    }
}

void test_limit_is_left_as_it_was_met_however_long_it_held(void)
{
    EACH_DIRECTION(direction) {
        (void)torque(direction, 3000, 27600, 5120, 2500);
        rig_speed((int16_t)(direction * 12000));
        speed_step(&drive, &params);
        TEST_ASSERT_EQUAL_INT16(direction * 3000, drive.run.control.ref_q13.q);
        (void)torque(direction, 0, 2000, 5120, 2500);
        rig_speed((int16_t)(direction * 10000));
        speed_step(&drive, &params);
        TEST_ASSERT_INT16_WITHIN(1, 0, drive.run.control.ref_q13.q);
    }
}

void test_command_in_the_other_direction_slows_down_first(void)
{
    EACH_DIRECTION(direction) {
        (void)step(direction, 1000, 10000, 0);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
        drive.command.target_erpm = (int16_t)(direction * -1000);
        speed_choose_state(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
        speed_step(&drive, &params);
        TEST_ASSERT_TRUE(direction * drive.run.control.reference_erpm < 10000);
        drive.command.target_erpm = (int16_t)(direction * 1000);
        speed_choose_state(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    }
}

void test_stop_while_torque_is_on_ramps_down_from_the_speed_and_the_load_that_are_there(void)
{
    EACH_DIRECTION(direction) {
        int16_t before = 1000, n;
        TEST_ASSERT_EQUAL_INT16(1000, step(direction, 1000, 10000, 900));
        drive.command.run = 0;
        rig_next_part(6);
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
        rig_speed((int16_t)(direction * 10000));
        for (n = 1; n <= 20; n++) { /* the speed stands still meanwhile */
            int16_t iq;
            speed_step(&drive, &params);
            iq = (int16_t)(direction * drive.run.control.ref_q13.q);
            TEST_ASSERT_EQUAL_INT16(direction * (10000 - 8 * n), drive.run.control.reference_erpm);
            TEST_ASSERT_INT16_WITHIN(2, law(direction, (int16_t)(10000 - 8 * n)), iq);
            TEST_ASSERT_TRUE(before - iq >= 0 && before - iq < 110); /* from the command to the load, then 8 erpm a step: no jump */
            before = iq;
        }
        TEST_ASSERT_GREATER_THAN_INT16(0, before); /* it has not begun to brake: the load does */
    }
}

void test_motor_accelerates_with_the_command_and_stops_in_order(void)
{
    rig_start(1);
    drive.command.target_erpm = 800;
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    ideal_motor_run(2000);
    EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, "accelerating");
    TEST_ASSERT_INT16_WITHIN(20, 800, drive.run.control.ref_q13.q);
    drive.command.run = 0;
    TEST_ASSERT_LESS_THAN_UINT32(40000, ideal_motor_run_until(DRIVE_STOPPED, 40000));
    ideal_motor_run(1);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "stopped");
}

void test_motor_stays_between_minimum_and_maximum_speed_whatever_the_command(void)
{
    static const struct {
        int16_t command_q13;
        float least_erpm, most_erpm;
    } cases[] = { { 0, 1900.0F, 3100.0F }, { 2000, 14000.0F, 28000.0F } };
    EACH(n, cases) {
        rig_ready();
        drive_start(&drive, &params, 1);
        ideal_motor_reset(1.0F, 0.0F);
        drive.command.target_erpm = cases[n].command_q13;
        (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
        ideal_motor_run(60000);
        EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, golden_row(n));
        TEST_ASSERT_TRUE(ideal_motor_erpm() > cases[n].least_erpm && ideal_motor_erpm() < cases[n].most_erpm);
    }
}

/* ---- panel ---- */

void test_pot_spans_zero_to_MAXIMUM_CURRENT_and_S3_does_not_change_it(void)
{
    static const int16_t cases[][2] = { { -32768, 0 }, { 32704, 5120 }, { 0, 2560 } };
    EACH(n, cases) {
        TEST_ASSERT_INT16_WITHIN(3, cases[n][1], panel_target(&params, cases[n][0], 0, 1));
        TEST_ASSERT_INT16_WITHIN(3, cases[n][1], panel_target(&params, cases[n][0], 1, 1));
    }
}

void test_pot_at_zero_still_starts_forward(void)
{
    panel_turn_pot(0);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
}

void test_speed_range_is_the_reason_while_it_and_no_other_limit_holds_the_command(void)
{
    static const struct {
        const char *what;
        int16_t command_q13, given_q13, limit_q13;
        uint16_t reasons;
    } cases[] = {
        { "as commanded", 1000, 1000, 5120, LIMIT_NONE }, { "its sign has no say", -1000, 1000, 5120, LIMIT_NONE },
        { "within 1/64 of the largest current", 1000, 920, 5120, LIMIT_NONE }, { "less, at the highest speed", 1000, 919, 5120, LIMIT_SPEED_RANGE },
        { "braking, above it", 1000, -500, 5120, LIMIT_SPEED_RANGE }, { "more, at the lowest speed", 0, 300, 5120, LIMIT_SPEED_RANGE },
        { "the circle", 4000, 2000, 2000, LIMIT_CURRENT },
    };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            rig_closed(direction, (int16_t)(direction * 10000));
            drive.command.target_erpm = cases[n].command_q13;
            drive.run.control.ref_q13.q = (int16_t)(direction * cases[n].given_q13);
            drive.run.control.iq_limit_q13 = cases[n].limit_q13;
            drive.run.control.vq_limit_q14 = 10000;
            drive.run.control.v_q14.q = 0;
            TEST_ASSERT_EQUAL_HEX16_MESSAGE(cases[n].reasons, limits_reasons(&drive, &params), cases[n].what);
        }
    }
    drive.state = (uint16_t)DRIVE_STOPPING;
    drive.run.control.iq_limit_q13 = 5120;
    TEST_ASSERT_EQUAL_HEX16(LIMIT_RAMP, limits_reasons(&drive, &params));
}
