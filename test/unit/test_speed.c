/* Speed: the reference's ramp that waits for the motor, the law and its gain, what a sample misses, and the end of a stop. */
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

void test_reference_falls_by_its_own_slope_in_both_directions_and_in_a_stop(void)
{
    static const struct {
        int16_t target_erpm, next_erpm;
        drive_state_t state;
    } cases[] = { { 20000, 10008, DRIVE_CLOSED }, { 3000, 9998, DRIVE_CLOSED }, { 3000, 9998, DRIVE_STOPPING }, { 20000, 9998, DRIVE_STOPPING },
                  { 9997, 9997, DRIVE_CLOSED } /* two steps */ };
    drive_params_t gentle = params;
    gentle.speed_decel_q16 = 2 * 65536;
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            rig_closed(direction, (int16_t)(direction * 10000));
            drive.command.target_erpm = (int16_t)(direction * cases[n].target_erpm);
            drive.state = (uint16_t)cases[n].state;
            speed_reference_step(&drive, &gentle);
            TEST_ASSERT_EQUAL_INT16_MESSAGE(direction * cases[n].next_erpm, drive.run.control.reference_erpm, golden_row(n));
        }
    }
}

void test_the_slope_is_that_of_a_fall_only_on_the_way_to_less_speed(void)
{
    static const struct {
        int16_t reference_erpm, target_erpm, falls;
    } cases[] = { { 10000, 9999, 1 }, { 10000, 10000, 0 }, { 10000, 10001, 0 }, { -10000, -9999, 1 }, { -10000, -10000, 0 }, { -10000, -10001, 0 },
                  { 0, 100, 0 }, { 1, 100, 0 }, { -1, -100, 0 }, { 1, 0, 1 }, { -1, 0, 1 } };
    drive_params_t gentle = params;
    gentle.speed_decel_q16 = 2 * 65536;
    EACH(n, cases) {
        TEST_ASSERT_EQUAL_INT32_MESSAGE(cases[n].falls ? 2 * 65536 : params.speed_ramp_q16,
                                        reference_slope(&gentle, cases[n].reference_erpm, cases[n].target_erpm), golden_row(n));
    }
}

void test_a_reference_says_that_it_waits_and_one_at_its_target_waits_for_nobody(void)
{
    (void)step(1, 20000, 10000 - 1750);
    TEST_ASSERT_EQUAL_UINT16(1, drive.run.control.ramp_waits);
    drive.command.target_erpm = 10000;
    speed_reference_step(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.control.ramp_waits);
}

void test_without_a_slope_of_its_own_the_reference_falls_as_it_rises(void)
{
    TEST_ASSERT_EQUAL_INT32(params.speed_ramp_q16, params.speed_decel_q16);
}

/* ---- the law ---- */

/** q current for a target, at an observed speed and load. */
static int16_t current(int16_t target_erpm, int16_t speed_erpm, int16_t load_q13)
{
    rig_speed(speed_erpm);
    drive.run.observer.load_q16 = qm_mulsu(load_q13, params.observer.per_current_q16);
    return speed_current(&drive.run, &params, target_erpm);
}

void test_current_is_the_gain_times_the_missing_speed_and_the_observed_load(void)
{
    static const struct {
        int16_t target_erpm, speed_erpm, load_q13, kp_q13, iq_q13;
    } cases[] = {
        { 10000, 10000, 0, 2048, 0 }, { 10000, 9000, 0, 2048, 250 }, { 10000, 11000, 0, 2048, -250 }, { 10000, 9000, 0, 4096, 500 },
        { 10000, 10000, 700, 2048, 700 }, { 10000, 9000, 700, 2048, 950 }, { 10000, 11000, 700, 2048, 450 },
        { 10000, 12000, -700, 2048, -1200 }, { 32000, -32000, 0, 2048, 4096 /* the difference ends at 16383 */ },
    };
    rig_closed(1, 10000);
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            drive.run.control.speed_kp_q13 = cases[n].kp_q13;
            TEST_ASSERT_INT16_WITHIN_MESSAGE(2, (int16_t)(direction * cases[n].iq_q13),
                                             current((int16_t)(direction * cases[n].target_erpm), (int16_t)(direction * cases[n].speed_erpm),
                                                     (int16_t)(direction * cases[n].load_q13)),
                                             golden_row(n));
        }
    }
}

/* Rounded down, the mean current would be half a count short, which a slow motor's small gain turns into per cents of speed. */
void test_current_is_rounded_to_the_nearest_count(void)
{
    static const int16_t cases[][2] = { /* missing speed, current: 1024 is an eighth of a count an erpm */
                                        { 3, 0 }, { 4, 1 }, { 11, 1 }, { 12, 2 }, { -3, 0 }, { -5, -1 }, { -11, -1 }, { -13, -2 } };
    rig_closed(1, 10000);
    drive.run.control.speed_kp_q13 = 1024;
    EACH(n, cases) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n][1], current((int16_t)(10000 + cases[n][0]), 10000, 0), golden_row(n));
    }
}

void test_current_is_rounded_where_exactly_half_a_count_is_reached(void)
{
    rig_closed(1, 10000);
    drive.run.control.speed_kp_q13 = 1;
    TEST_ASSERT_EQUAL_INT16(0, current(10000 + 4095, 10000, 0));
    TEST_ASSERT_EQUAL_INT16(1, current(10000 + 4096, 10000, 0));
}

void test_current_reaches_its_limit_to_the_count(void)
{
    rig_closed(1, 10000);
    drive.run.control.speed_kp_q13 = 32767;
    drive.run.control.iq_limit_q13 = 5120;
    TEST_ASSERT_EQUAL_INT16(5120, current(20000, 10000, 0));
    TEST_ASSERT_EQUAL_INT16(-5120, current(0, 10000, 0));
}

void test_steps_hand_on_the_last_bit(void)
{
    int16_t sum = 0;
    rig_closed(1, 10000);
    drive.run.control.speed_kp_q13 = 1;
    (void)current(10000, 10000, 0);
    for (uint16_t n = 0; n < 8192u; n++) {
        sum = (int16_t)(sum + speed_current_step(&drive.run, &params, 10001));
    }
    TEST_ASSERT_EQUAL_INT16(1, sum);
}

/* A count of current turns a light rotor out of its speed: the mean of the steps is finer than a count. */
void test_steps_hand_on_what_is_below_a_count_and_never_pass_the_limit(void)
{
    static const int16_t cases[][2] = { /* missing speed, eight steps: 1024 is an eighth of a count an erpm */
                                        { 1, 1 }, { 3, 3 }, { 8, 8 }, { -1, -1 }, { -3, -3 }, { -13, -13 } };
    int16_t step, sum;
    EACH(n, cases) {
        rig_closed(1, 10000);
        drive.run.control.speed_kp_q13 = 1024;
        (void)current(10000, 10000, 0);
        for (step = sum = 0; step < 8; step++) {
            sum = (int16_t)(sum + speed_current_step(&drive.run, &params, (int16_t)(10000 + cases[n][0])));
        }
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n][1], sum, golden_row(n));
    }
    drive.run.control.iq_rest_q26 = 8191;
    drive.run.control.speed_kp_q13 = 32767;
    TEST_ASSERT_EQUAL_INT16(drive.run.control.iq_limit_q13, speed_current_step(&drive.run, &params, 32000));
    TEST_ASSERT_EQUAL_INT16(-drive.run.control.iq_limit_q13, speed_current_step(&drive.run, &params, -32000));
}

/* ---- the trim ---- */

static void turn_at(int16_t observed_erpm, int16_t estimated_erpm)
{
    drive.run.observer.omega_q16 = observed_erpm * 65536L;
    drive.run.estimator.omega_filtered_q16 = estimated_erpm * 65536L;
}

/** Trim after so many steps with these speeds, in whole counts; the reference rests at 10000. Where the speed swings the gain is twice that of rest. */
static int16_t trim_after_at(uint16_t steps, int16_t observed_erpm, int16_t estimated_erpm)
{
    static drive_params_t swinging;
    swinging = params;
    swinging.speed_kp_q13 = 16384;
    drive.run.control.speed_kp_q13 = 8192; /* a count an erpm */
    drive.run.control.vq_limit_q14 = 30000;
    while (steps-- != 0u) {
        turn_at(observed_erpm, estimated_erpm);
        speed_trim(&drive.run, &swinging, drive.run.control.reference_erpm, 0);
    }
    return (int16_t)(drive.run.control.iq_trim_q26 / 8192);
}

static int16_t trim_after(uint16_t steps, int16_t speed_erpm)
{
    return trim_after_at(steps, speed_erpm, speed_erpm);
}

void test_trim_takes_up_what_the_speed_lacks_at_rest_and_ends_at_an_eighth_of_the_current(void)
{
    EACH_DIRECTION(sign) {
        rig_closed(1, 10000);
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(sign * 100), trim_after(256, (int16_t)(10000 - sign * 100))); /* 1/256 a step */
        TEST_ASSERT_EQUAL_INT16(sign * 640, trim_after(10000, (int16_t)(10000 - sign * 600)));
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(sign * 540), trim_after(256, (int16_t)(10000 + sign * 100)));
    }
}

void test_trim_waits_while_the_load_s_estimate_moves_against_the_error(void)
{
    EACH_DIRECTION(sign) {
        const int16_t slow_erpm = (int16_t)(10000 - sign * 100);
        rig_closed(1, 10000);
        TEST_ASSERT_EQUAL_INT16(0, trim_after_at(1000, slow_erpm, (int16_t)(slow_erpm - sign)));
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(sign * 100), trim_after_at(256, slow_erpm, (int16_t)(slow_erpm + sign)));
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(sign * 100), trim_after_at(256, slow_erpm, (int16_t)(slow_erpm - sign))); /* it is kept */
    }
}

void test_trim_waits_for_the_load_s_estimate_at_an_error_of_one_too(void)
{
    rig_closed(1, 10000);
    (void)trim_after_at(100, 9999, 9998);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.control.iq_trim_q26);
    (void)trim_after_at(100, 9999, 10000);
    TEST_ASSERT_GREATER_THAN_INT32(0, drive.run.control.iq_trim_q26);
}

void test_trim_stands_still_where_nothing_lacks_and_takes_up_nearly_an_eighth_of_the_speed(void)
{
    EACH_DIRECTION(sign) {
        rig_closed(1, 10000);
        (void)trim_after(1000, 10000);
        TEST_ASSERT_EQUAL_INT32(0, drive.run.control.iq_trim_q26);
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(sign * 312), trim_after(64, (int16_t)(10000 - sign * 1249)));
    }
}

void test_trim_step_goes_by_the_q_current_that_is_asked_for(void)
{
    rig_closed(1, 10000);
    turn_at(9900, 9900);
    drive.run.control.trim_reference_erpm = 10000;
    drive.run.control.vq_limit_q14 = 30000;
    speed_trim_step(&drive, &params);
    TEST_ASSERT_GREATER_THAN_INT32(0, drive.run.control.iq_trim_q26);
    drive.run.control.iq_trim_q26 = 256L * 8192;
    drive.run.control.ref_q13.q = drive.run.control.iq_limit_q13;
    speed_trim_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT32(254L * 8192, drive.run.control.iq_trim_q26);
}

/** A speed that is far off to one side and the other, so many steps each. @return the trim in whole counts */
static int16_t trim_of_swings(uint16_t swings, uint16_t steps, int16_t low_erpm, int16_t high_erpm)
{
    int16_t trim = 0;
    while (swings-- != 0u) {
        trim = trim_after(steps, ((swings & 1u) != 0u) ? high_erpm : low_erpm);
    }
    return trim;
}

void test_a_speed_that_swings_is_held_in_the_mean_however_far_it_swings_and_whatever_the_gate_and_the_limits_are(void)
{
    int16_t mean;
    EACH_DIRECTION(sign) {
        rig_closed(1, 10000);
        drive.run.control.iq_limit_q13 = 0;
        drive.run.observer.fast_share_q15 = 32767;
        drive.run.observer.innovation_erpm = -1;
        TEST_ASSERT_EQUAL_INT16(0, trim_of_swings(2, 10, (int16_t)(10000 - sign * 4000), (int16_t)(10000 + sign * 4000)));
        TEST_ASSERT_FALSE(speed_swings(&drive.run));
        mean = trim_of_swings(10, 10, (int16_t)(10000 - sign * 4000), (int16_t)(10000 + sign * 4000));
        TEST_ASSERT_TRUE(speed_swings(&drive.run));
        TEST_ASSERT_INT16_WITHIN(3, mean, trim_of_swings(100, 10, (int16_t)(10000 - sign * 4000), (int16_t)(10000 + sign * 4000)));
        mean = (int16_t)(mean + sign * 195); /* 500 steps of a mean of 50 less, 2/256 each */
        TEST_ASSERT_INT16_WITHIN(3, mean, trim_of_swings(50, 10, (int16_t)(10000 - sign * 4100), (int16_t)(10000 + sign * 4000)));
    }
}

void test_at_rest_the_trim_goes_by_the_observer_s_speed_and_the_gain_in_use_and_while_it_swings_by_the_estimator_s_and_a_constant_gain(void)
{
    EACH_DIRECTION(sign) {
        rig_closed(1, 10000);
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(sign * 100), trim_after_at(256, (int16_t)(10000 - sign * 100), (int16_t)(10000 - sign * 50)));
        drive.run.control.swing_steps = 4u * SPEED_SWING_STEPS;
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(sign * 300), trim_after_at(128, (int16_t)(10000 + sign * 100), (int16_t)(10000 - sign * 200)));
    }
}

void test_a_load_step_is_no_swing_and_neither_are_small_errors_or_one_side(void)
{
    static const struct {
        const char *what;
        int16_t low_erpm, high_erpm;
        uint16_t swings, steps;
    } cases[] = {
        { "three large errors", 5000, 15000, 3, 100 },   { "small errors", 9376, 10624, 50, 10 }, { "one side", 5000, 8000, 50, 10 },
        { "one side that counts", 9000, 10600, 50, 10 }, { "slow swings", 5000, 15000, 50, 400 }, { "a frame that is asked for", 5000, 15000, 9, 3 },
    };
    EACH(n, cases) {
        rig_closed(1, 10000);
        (void)trim_of_swings(cases[n].swings, cases[n].steps, cases[n].low_erpm, cases[n].high_erpm);
        TEST_ASSERT_FALSE_MESSAGE(speed_swings(&drive.run), cases[n].what);
    }
}

void test_a_swing_is_one_whatever_its_bits_and_counts_to_four(void)
{
    rig_closed(1, 10000);
    drive.run.control.swung_erpm = 1000;
    (void)trim_after(1, 10000 + 1001);
    TEST_ASSERT_EQUAL_UINT16(SPEED_SWING_STEPS, drive.run.control.swing_steps);
    TEST_ASSERT_EQUAL_INT16(-1001, drive.run.control.swung_erpm);
    drive.run.control.swing_steps = 4u * SPEED_SWING_STEPS;
    (void)trim_after(1, 10000 - 1000);
    TEST_ASSERT_EQUAL_INT16(1000, drive.run.control.swung_erpm);
    TEST_ASSERT_EQUAL_UINT16(4u * SPEED_SWING_STEPS, drive.run.control.swing_steps);
}

void test_swings_are_forgotten_in_an_eighth_of_a_second_and_not_remembered_for_longer(void)
{
    uint16_t steps = 0;
    rig_closed(1, 10000);
    (void)trim_of_swings(100, 10, 9000, 11000);
    while (speed_swings(&drive.run) && steps < 2u * SPEED_SWING_STEPS) {
        (void)trim_after(1, 10000);
        steps++;
    }
    TEST_ASSERT_EQUAL_UINT16(3u * SPEED_SWING_STEPS, drive.run.control.swing_steps);
    TEST_ASSERT_UINT16_WITHIN(15, SPEED_SWING_STEPS, steps);
    (void)trim_after(5u * SPEED_SWING_STEPS, 10000);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.control.swing_steps);
}

void test_swings_are_remembered_while_the_reference_moves_and_the_trim_is_forgotten_then(void)
{
    rig_closed(1, 10000);
    (void)trim_of_swings(100, 10, 9000, 11000);
    drive.run.control.iq_trim_q26 = 256L * 8192;
    speed_trim(&drive.run, &params, 9990, 0);
    TEST_ASSERT_EQUAL_INT32(254L * 8192, drive.run.control.iq_trim_q26);
    TEST_ASSERT_TRUE(speed_swings(&drive.run));
}

void test_trim_is_in_the_current_and_within_its_limit(void)
{
    rig_closed(1, 10000);
    drive.run.control.iq_trim_q26 = 300L * 8192;
    TEST_ASSERT_INT16_WITHIN(1, 300, current(10000, 10000, 0));
    drive.run.control.iq_limit_q13 = 200;
    TEST_ASSERT_EQUAL_INT16(200, current(10000, 10000, 0));
}

void test_trim_is_forgotten_while_the_speed_is_not_at_rest(void)
{
    static const struct {
        const char *what;
        int16_t before_erpm, observed_erpm, iq_q13;
        q15_t quick;
        int16_t v_q_q14;
    } cases[] = {
        { "at the voltage limit", 10000, 9990, 0, 0, 20000 },
        { "reference moves", 9992, 9990, 0, 0, 0 },         { "far behind", 10000, 8749, 0, 0, 0 }, { "far ahead", 10000, 11251, 0, 0, 0 },
        { "after a large innovation", 10000, 9990, 0, 32767, 0 }, { "at the current limit", 10000, 9990, 5120, 0, 0 }, { "while braking at it", 10000, 9990, -5120, 0, 0 },
    };
    EACH(n, cases) {
        rig_closed(1, 10000);
        turn_at(cases[n].observed_erpm, cases[n].observed_erpm);
        drive.run.control.iq_limit_q13 = 5120;
        drive.run.control.iq_trim_q26 = 256L * 8192;
        drive.run.observer.fast_share_q15 = cases[n].quick;
        drive.run.control.vq_limit_q14 = 20000;
        drive.run.control.v_q14.q = cases[n].v_q_q14;
        speed_trim(&drive.run, &params, cases[n].before_erpm, cases[n].iq_q13);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(254L * 8192, drive.run.control.iq_trim_q26, cases[n].what);
    }
}

void test_current_ends_at_its_limit_and_leaves_it_at_once(void)
{
    rig_closed(1, 10000);
    drive.run.control.iq_limit_q13 = 1234;
    drive.run.control.speed_kp_q13 = 8192; /* a count an erpm */
    EACH_DIRECTION(direction) {
        TEST_ASSERT_EQUAL_INT16(direction * 1233, current((int16_t)(direction * 10000), (int16_t)(direction * 8767), 0));
        TEST_ASSERT_EQUAL_INT16(direction * 1234, current((int16_t)(direction * 10000), (int16_t)(direction * 8765), 0));
        TEST_ASSERT_EQUAL_INT16(direction * 1234, current((int16_t)(direction * 10000), 0, (int16_t)(direction * 3000)));
        TEST_ASSERT_EQUAL_INT16(0, current((int16_t)(direction * 10000), (int16_t)(direction * 10000), 0));
    }
    drive.run.control.iq_limit_q13 = 0;
    TEST_ASSERT_EQUAL_INT16(0, current(10000, 9000, 500));
    TEST_ASSERT_EQUAL_INT16(0, current(10000, 11000, -500));
}

void test_gain_follows_reference_or_speed_whichever_is_more_and_rises_after_a_large_innovation(void)
{
    int16_t full = params.observer.full_erpm, half = (int16_t)(full / 2), fourth = (int16_t)(full / 4), kp = params.speed_kp_q13, quick = params.speed_kp_fast_q13;
    const struct {
        int16_t reference_erpm, fast_share_q15, kp_q13, speed_erpm;
    } cases[] = {
        { full, 0, kp, 0 }, { 32000, 0, kp, 0 }, { half, 0, kp, 0 }, { fourth, 0, (int16_t)(kp / 2), 0 }, { (int16_t)-full, 0, kp, 0 }, { (int16_t)-fourth, 0, (int16_t)(kp / 2), 0 },
        { 0, 0, 0, 0 }, { half, 32767, quick, 0 }, { fourth, 32767, (int16_t)(quick / 2), 0 }, { full, 16384, (int16_t)((kp + quick) / 2), 0 },
        { 0, 0, (int16_t)(kp / 2), fourth }, { (int16_t)-fourth, 0, (int16_t)(kp / 2), 100 }, { 100, 0, (int16_t)(kp / 2), (int16_t)-fourth }, { 32000, 0, kp, fourth },
    };
    EACH(n, cases) {
        rig_closed(1, 10000);
        rig_speed(cases[n].speed_erpm);
        drive.run.control.reference_erpm = cases[n].reference_erpm;
        drive.run.observer.fast_share_q15 = cases[n].fast_share_q15;
        speed_schedule(&drive.run, &params);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(3, cases[n].kp_q13, drive.run.control.speed_kp_q13, golden_row(n));
    }
    TEST_ASSERT_GREATER_THAN_INT16(kp + kp / 2, quick);
}

void test_stop_never_asks_for_a_speed_without_a_gain(void)
{
    EACH_DIRECTION(direction) {
        uint16_t n;
        rig_closed(direction, (int16_t)(direction * 4000));
        drive.state = (uint16_t)DRIVE_STOPPING;
        drive.command.run = 0;
        for (n = 0; n < 1000u; n++) {
            rig_speed((int16_t)(direction * 3800)); /* a load that drives keeps it above the minimum */
            speed_step(&drive, &params);
            speed_choose_state(&drive, &params);
            TEST_ASSERT_TRUE(direction * drive.run.control.reference_erpm >= 1875);
        }
        speed_follow(&drive.run, &params);
        TEST_ASSERT_GREATER_THAN_INT16(params.speed_kp_q13 / 2, drive.run.control.speed_kp_q13);
        TEST_ASSERT_TRUE(direction * drive.run.control.ref_q13.q < 0); /* it goes on braking */
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
    }
}

void test_there_is_no_gain_where_neither_reference_nor_rotor_turns(void)
{
    rig_closed(1, 10000);
    drive.run.control.reference_erpm = 0;
    rig_speed(0);
    speed_schedule(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.speed_kp_q13);
}

/* ---- the sample's delay ---- */

void test_q_current_is_raised_by_what_the_back_emf_took_before_the_sample(void)
{
    /* delay psi w / L: 1.5 us * 5.5 mWb * 1885 rad/s / 1.92 mH = 8.1 mA at 18000 erpm */
    float missed = 1.5e-6F * (PARAM_F(MOTOR_KPHI_V_PER_KRPM) / PARAM_SQRT3 / 1000.0F * 3600.0F) / (PARAM_F(MOTOR_LS_MH) * 0.001F);
    int16_t shift_q13 = (int16_t)(missed / PARAM_F(NORM_CURRENT_CONST) / 4.0F);
    TEST_ASSERT_GREATER_THAN_INT16(15, shift_q13);
    EACH_DIRECTION(direction) {
        rig_closed(direction, (int16_t)(direction * 18000));
        TEST_ASSERT_INT16_WITHIN(1, (int16_t)(direction * shift_q13), drive.run.control.sample_shift_q13);
        rig_tick(1); /* no current at all */
        TEST_ASSERT_INT16_WITHIN(1, (int16_t)(direction * shift_q13), drive.run.control.i_q13.q);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.control.i_q13.d);
    }
}

/** A part of the slow work with the rates forgotten, the rotor as fast as the observer sees it or so many electrical rpm faster. @return 1: they are known */
static uint16_t rates_come(uint16_t part, int16_t faster_erpm)
{
    drive.run.control.sample_shift_q13 = 0;
    drive.run.control.speed_kp_q13 = 0;
    drive.run.estimator.rho_q32 = drive.run.observer.rho_q32 + 8u * (uint32_t)qm_mulss((int16_t)(observer_speed(&drive.run.observer) + faster_erpm), params.observer.deltat_q32);
    rig_slow(part);
    TEST_ASSERT_EQUAL_UINT16_MESSAGE((part & 7u) == 3u && drive.run.control.speed_kp_q13 > 0, drive.run.control.sample_shift_q13 > 0, "the sample's delay in its own slots");
    return (uint16_t)(drive.run.control.speed_kp_q13 > 0);
}

void test_schedule_of_the_speed_comes_every_sixteenth_period_in_closed_loop_only(void)
{
    rig_closed(1, 18000);
    for (uint16_t part = 0; part < SLOW_PARTS; part++) {
        TEST_ASSERT_EQUAL_UINT16((part & 7u) == 3u, rates_come(part, 0));
    }
    drive.state = (uint16_t)DRIVE_RAMP;
    TEST_ASSERT_EQUAL_UINT16(0, rates_come(3, 0));
}

void test_after_a_large_innovation_the_rates_come_in_each_slow_step_until_it_fades(void)
{
    rig_closed(1, 18000);
    TEST_ASSERT_EQUAL_UINT16(0, rates_come(7, 0));
    TEST_ASSERT_EQUAL_UINT16(0, rates_come(4, 4000));
    TEST_ASSERT_EQUAL_UINT16(1, rates_come(7, 0));
    TEST_ASSERT_GREATER_THAN_INT16(params.speed_kp_q13, drive.run.control.speed_kp_q13);
    TEST_ASSERT_EQUAL_UINT16(0, rates_come(8, 0));
    TEST_ASSERT_EQUAL_UINT16(1, rates_come(15, 0));
    drive.run.observer.fast_share_q15 = 4095;
    TEST_ASSERT_EQUAL_UINT16(0, rates_come(7, 0));
}

/* ---- the end of a stop ---- */

void test_stop_ends_when_the_reference_is_below_the_minimum_and_the_speed_near_it(void)
{
    static const struct {
        drive_state_t from, to;
        int16_t speed_erpm, reference_erpm;
    } cases[] = {
        { DRIVE_STOPPING, DRIVE_STOPPED, 3749, 2499 }, { DRIVE_STOPPING, DRIVE_STOPPED, -3749, -2499 },
        { DRIVE_STOPPING, DRIVE_STOPPING, 3750, 2400 }, { DRIVE_STOPPING, DRIVE_STOPPING, -3750, 2400 },
        { DRIVE_STOPPING, DRIVE_STOPPING, 2400, 2600 }, { DRIVE_STOPPING, DRIVE_STOPPING, 2400, -2600 },
        { DRIVE_STOPPING, DRIVE_STOPPING, 2400, 2508 }, /* a step from there is the minimum */
        { DRIVE_CLOSED, DRIVE_CLOSED, 2000, 2000 }, /* low speed alone */
    };
    EACH(n, cases) {
        rig_closed(1, cases[n].reference_erpm);
        drive.state = (uint16_t)cases[n].from;
        drive.command.run = (int16_t)(cases[n].from == DRIVE_CLOSED);
        rig_speed(cases[n].speed_erpm);
        speed_step(&drive, &params);
        speed_choose_state(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].to, drive.state, golden_row(n));
    }
}

/* A slow motor's slope is less than an electrical rpm a step. */
void test_reference_keeps_the_fraction_of_a_slow_ramp(void)
{
    drive_params_t slow = params;
    int16_t step;
    slow.speed_ramp_q16 = 65536 * 3 / 8;
    EACH_DIRECTION(direction) {
        rig_closed(direction, (int16_t)(direction * 5000));
        drive.run.control.ramp_q16 = 0;
        drive.command.target_erpm = (int16_t)(direction * 6000);
        for (step = 0; step < 800; step++) {
            rig_speed(drive.run.control.reference_erpm);
            speed_reference_step(&drive, &slow);
        }
        TEST_ASSERT_EQUAL_INT16(direction * 5300, drive.run.control.reference_erpm);
    }
}

/* ---- a stop goes on, a run is to turn ---- */

void test_a_run_is_to_turn_by_the_sign_of_its_target_alone(void)
{
    static const struct {
        int16_t direction, target_erpm;
        drive_state_t state;
    } cases[] = { { 1, 1, DRIVE_CLOSED }, { 1, 0, DRIVE_CLOSED }, { 1, -1, DRIVE_STOPPING }, { 1, -2, DRIVE_STOPPING },
                  { -1, -1, DRIVE_CLOSED }, { -1, 0, DRIVE_STOPPING }, { -1, 1, DRIVE_STOPPING } };
    EACH(n, cases) {
        rig_closed(cases[n].direction, (int16_t)(cases[n].direction * 10000));
        drive.command.run = 1;
        drive.command.target_erpm = cases[n].target_erpm;
        speed_choose_state(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].state, drive.state, golden_row(n));
    }
}

void test_a_stop_that_goes_on_forgets_a_load_that_drove_and_no_other(void)
{
    EACH_DIRECTION(direction) {
        const struct {
            int32_t load_q16, after_q16;
        } cases[] = { { direction * -65536L, 0 }, { direction * -700L * 65536, 0 }, { direction * 65536L, direction * 65536L }, { 30000, 30000 } };
        EACH(n, cases) {
            rig_closed(direction, (int16_t)(direction * 10000));
            drive.state = (uint16_t)DRIVE_STOPPING;
            drive.command.run = 1;
            drive.run.observer.load_q16 = cases[n].load_q16;
            speed_choose_state(&drive, &params);
            TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
            TEST_ASSERT_EQUAL_INT32_MESSAGE(cases[n].after_q16, drive.run.observer.load_q16, golden_row(n));
        }
    }
}
