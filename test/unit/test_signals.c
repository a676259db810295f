/* Both rules of the signals: what flows against what is asked for, and voltages and currents against the motor. */
#include "drive_rig.h"

#define PI 3.14159265
#define ROOT_OF_3 1.7320508
#define ROOT_OF_HALF 0.70710678

#include "drive/signals.h"

static signals_t signals;

void setUp(void)
{
    rig_power_up();
    rig_closed(1, 10000);
    drive.run.control.ref_q13.d = 0;
    drive.run.control.i_q13.d = 0;
    signals = (signals_t){ 0 };
}

/** Milliseconds until this fault is found, at most 3000. */
static uint16_t ms_until(drive_fault_t fault)
{
    uint16_t ms = 0, found = (uint16_t)FAULT_NONE;
    while (ms < 3000u && found == (uint16_t)FAULT_NONE) {
        found = signals_d_current(&signals, &drive, &params);
        ms++;
    }
    TEST_ASSERT_EQUAL_UINT16((ms < 3000u) ? fault : FAULT_NONE, found);
    return ms;
}

void test_the_mean_of_the_deviation_is_exact_to_its_last_bit(void)
{
    static const struct {
        int16_t i_d;
        int32_t before_q16;
    } cases[] = { { 0, 1 }, { 0, 0x12345 }, { 3, 0xFFFF }, { 40, 0x2FFFF }, { 40, 0x7FFFFF }, { 1, 0 } };
    EACH(n, cases) {
        drive.run.control.i_q13.d = cases[n].i_d;
        signals.id_q16 = cases[n].before_q16;
        (void)signals_d_current(&signals, &drive, &params);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(
            cases[n].before_q16 + (((int32_t)cases[n].i_d * 65536 - cases[n].before_q16) >> SIGNALS_MEAN_SHIFT), signals.id_q16, golden_row(n));
    }
}

/* ---- the d current ---- */

void test_d_current_that_stays_further_off_than_noise_and_dead_time_is_found_whatever_its_sign(void)
{
    const int16_t limit = params.id_off_q13;
    uint16_t ms = 0, found = (uint16_t)FAULT_NONE;
    drive.run.control.i_q13.d = limit;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until(FAULT_CURRENT_SENSOR));
    setUp();
    while (ms < 3000u && found == (uint16_t)FAULT_NONE) { /* noise */
        drive.run.control.i_q13.d = (int16_t)((ms & 1u) ? 4 * limit : -4 * limit);
        found = signals_d_current(&signals, &drive, &params);
        ms++;
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_CURRENT_SENSOR, found);
    TEST_ASSERT_UINT16_WITHIN(10, 356, ms);
}

void test_d_current_is_judged_in_closed_loop_after_the_hand_over_and_not_forgotten_in_a_reversal_s_ramp(void)
{
    drive.run.control.i_q13.d = (int16_t)(4 * params.id_off_q13);
    drive.run.handover.id_q13 = 10;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until(FAULT_CURRENT_SENSOR));
    drive.run.handover.id_q13 = 0;
    drive.state = (uint16_t)DRIVE_RAMP;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until(FAULT_CURRENT_SENSOR));
    drive.state = (uint16_t)DRIVE_STOPPING;
    TEST_ASSERT_UINT16_WITHIN(10, 356, ms_until(FAULT_CURRENT_SENSOR));
    drive.state = (uint16_t)DRIVE_RAMP;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until(FAULT_CURRENT_SENSOR));
    drive.state = (uint16_t)DRIVE_CLOSED;
    TEST_ASSERT_EQUAL_UINT16(1, ms_until(FAULT_CURRENT_SENSOR));
    drive.state = (uint16_t)DRIVE_STOPPED;
    (void)signals_d_current(&signals, &drive, &params);
    drive.state = (uint16_t)DRIVE_CLOSED;
    TEST_ASSERT_UINT16_WITHIN(10, 356, ms_until(FAULT_CURRENT_SENSOR)); /* anew */
}

void test_d_current_that_follows_its_reference_is_none_however_large(void)
{
    drive.run.control.ref_q13.d = (int16_t)(-4 * params.id_off_q13);
    drive.run.control.i_q13.d = drive.run.control.ref_q13.d;
    drive.phases_q13 = phases_of(drive.run.control.ref_q13, drive.frame);
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until(FAULT_CURRENT_SENSOR));
    drive.run.control.i_q13.d = 0;
    TEST_ASSERT_UINT16_WITHIN(10, 356, ms_until(FAULT_CURRENT_SENSOR));
}

void test_deviations_of_a_quarter_of_a_second_ride_through(void)
{
    uint16_t n, ms;
    for (n = 0; n < 3u; n++) {
        drive.run.control.i_q13.d = 3000;
        for (ms = 0; ms < 250u; ms++) {
            TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, signals_d_current(&signals, &drive, &params));
        }
        drive.run.control.i_q13.d = 0;
        for (ms = 0; ms < 1500u; ms++) {
            (void)signals_d_current(&signals, &drive, &params);
        }
    }
}

/* ---- the phases ---- */

#define COUNT 1248u /* periods of 64 samples, 16 to 23 apart */

/** Periods until an open phase is found on a rotor that turns by `step` a period; what is asked for goes by the next period's angle.
 *  @param iq_q13 asked for @param share256 of it that flows
 *  @param open 0..2: carries `left` of 256 of what is asked of it, and the others the rest; 3: none does */
static uint16_t periods_until_open(int16_t iq_q13, int16_t share256, uint16_t open, int16_t left, uint16_t step)
{
    uint16_t periods = 0, found = (uint16_t)FAULT_NONE;
    angle_t angle = 0x1000;
    drive.run.control.ref_q13.q = iq_q13;
    while (periods < 20000u && found == (uint16_t)FAULT_NONE) {
        dq_t flowing = drive.run.control.ref_q13;
        flowing.q = (int16_t)(iq_q13 * (int32_t)share256 / 256);
        drive.phases_q13 = phases_of(flowing, trig_sincos(angle));
        angle = (angle_t)(angle + step);
        drive.frame = trig_sincos(angle);
        if (open == 0u) {
            drive.phases_q13.a = (int16_t)(drive.phases_q13.a * (int32_t)left / 256);
        } else if (open == 1u) {
            drive.phases_q13.b = (int16_t)(drive.phases_q13.b * (int32_t)left / 256);
        } else if (open == 2u) {
            drive.phases_q13.c = (int16_t)(drive.phases_q13.c * (int32_t)left / 256);
        } else {
            /* whole */
        }
        drive.ticks++;
        found = signals_phases(&signals, &drive, &params);
        periods++;
    }
    TEST_ASSERT_EQUAL_UINT16((periods < 20000u) ? FAULT_OPEN_PHASE : FAULT_NONE, found);
    return periods;
}

#define EXPECT_FOUND(...) TEST_ASSERT_UINT16_WITHIN(32, COUNT, periods_until_open(__VA_ARGS__))
#define EXPECT_WHOLE(...) TEST_ASSERT_EQUAL_UINT16(20000, periods_until_open(__VA_ARGS__))

void test_a_phase_that_carries_nearly_none_of_what_is_asked_of_it_is_open_within_two_counts(void)
{
    const int16_t little = (int16_t)(2 * params.id_off_q13);
    uint16_t phase;
    EACH_DIRECTION(sign) {
        for (phase = 0; phase < 3u; phase++) {
            setUp();
            EXPECT_FOUND((int16_t)(sign * 4000), 256, phase, 0, 257);
            EXPECT_FOUND((int16_t)(sign * little), 256, phase, 0, 257);
            EXPECT_FOUND((int16_t)(sign * 4000), 256, phase, 56, 257);
            EXPECT_WHOLE((int16_t)(sign * 4000), 256, phase, 72, 257);
            setUp();
            EXPECT_FOUND((int16_t)(sign * 4000), 128, phase, 0, 257); /* at the voltage's limit half of it flows */
        }
    }
}

void test_a_whole_motor_has_no_open_phase_at_any_angle_or_speed_or_limit(void)
{
    static const uint16_t steps[] = { 1, 3, 257, 1638, 1639, 819, 3277, 3276, 1092, 1820, 2048, 4096, 64260u };
    static const int16_t shares[] = { 256, 40, 0, 300 };
    EACH(n, steps) {
        EACH(k, shares) {
            setUp();
            EXPECT_WHOLE(4000, shares[k], 3, 256, steps[n]);
        }
    }
}

void test_a_current_as_small_as_noise_says_nothing_of_an_open_phase(void)
{
    EXPECT_WHOLE(params.id_off_q13, 256, 1, 0, 257);
}

void test_noise_of_one_phase_opens_no_other(void)
{
    uint16_t n;
    for (n = 0; n < 256u; n++) {
        drive.run.control.ref_q13.q = (int16_t)(2 * params.id_off_q13);
        drive.frame = trig_sincos((angle_t)(n * 5000u));
        drive.phases_q13 = phases_of(drive.run.control.ref_q13, drive.frame);
        drive.phases_q13.b = (int16_t)(drive.phases_q13.b + ((n & 1u) ? 4000 : -4000));
        drive.phases_q13.c = (int16_t)(-drive.phases_q13.a - drive.phases_q13.b);
        drive.ticks = (uint16_t)(drive.ticks + 23u);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, signals_phases(&signals, &drive, &params));
    }
}

/* ---- what whole turns leave of the back-EMF ---- */

#define TURN_STEP 1147u /* angle counts a millisecond: 17.5 turns a second */
#define TURNS_MS 256u   /* and the rest of a turn is a sum */
#define EMF_Q12 700
#define ENDS_Q12 (2 * EMF_Q12 / (int16_t)TURNS_MS) /* what the sum's ends may leave */

/** The look of a millisecond at a rotor with this back-EMF of its own, and one that stands in the stator's frame. */
static uint16_t offset_look(angle_t angle, int16_t emf_q12, alphabeta_t stands_q12)
{
    const sincos_t at = trig_sincos(angle);
    drive.frame = at;
    drive.run.estimator.e_d_q28 = (stands_q12.alpha * (int32_t)at.cos + stands_q12.beta * (int32_t)at.sin) * 2;
    drive.run.estimator.e_q_q28 = (stands_q12.beta * (int32_t)at.cos - stands_q12.alpha * (int32_t)at.sin) * 2 + emf_q12 * 65536;
    return signals_offset(&signals, &drive, &params);
}

/** Milliseconds until it is found, at most 3000. */
static uint16_t ms_until_offset_at(int16_t omega_erpm, int16_t alpha_q12, int16_t beta_q12, uint16_t step)
{
    const alphabeta_t stands_q12 = { alpha_q12, beta_q12 };
    uint16_t ms = 0, found = (uint16_t)FAULT_NONE;
    drive.run.observer.omega_q16 = omega_erpm * 65536;
    while (ms < 3000u && found == (uint16_t)FAULT_NONE) {
        ms++;
        found = offset_look((angle_t)(ms * step), EMF_Q12, stands_q12);
    }
    TEST_ASSERT_EQUAL_UINT16((ms < 3000u) ? FAULT_CURRENT_SENSOR : FAULT_NONE, found);
    return ms;
}

static uint16_t ms_until_offset(int16_t alpha_q12, int16_t beta_q12, uint16_t step)
{
    return ms_until_offset_at(1050, alpha_q12, beta_q12, step);
}

/** Half of the range: a step of the converter is nothing beside it. */
static void current_flows(void)
{
    drive.run.control.i_q13.q = 4096;
}

/** Two sums, or three where the first one began within a turn. */
static void expect_offset_found(int16_t alpha_q12, int16_t beta_q12, uint16_t step)
{
    const uint16_t ms = ms_until_offset(alpha_q12, beta_q12, step);
    TEST_ASSERT_TRUE(ms >= 2u * TURNS_MS && ms <= 3u * (TURNS_MS + 58u));
}

void test_a_back_emf_that_stands_in_the_stator_is_found_within_a_second_whatever_its_direction_and_the_rotor_s(void)
{
    const int16_t limit = params.adaptation.emf_least_q12, above = (int16_t)(limit + ENDS_Q12 + 6), below = (int16_t)(limit - 6);
    EACH_DIRECTION(sign) {
        const uint16_t step = (sign > 0) ? TURN_STEP : (uint16_t)(0u - TURN_STEP);
        EACH_DIRECTION(side) {
            setUp();
            current_flows();
            expect_offset_found((int16_t)(side * above), 0, step);
            setUp();
            current_flows();
            expect_offset_found(0, (int16_t)(side * above), step);
            setUp();
            current_flows();
            TEST_ASSERT_EQUAL_UINT16(3000, ms_until_offset((int16_t)(side * below), 0, step));
            setUp();
            current_flows();
            TEST_ASSERT_EQUAL_UINT16(3000, ms_until_offset(0, (int16_t)(side * below), step));
        }
    }
}

/** A step of the converter then is up to a third of the current, and an offset by half of it leaves another fifth of dead time's voltage. */
void test_where_hardly_any_current_flows_twice_as_much_may_stand(void)
{
    const int16_t between = (int16_t)(params.adaptation.emf_least_q12 + ENDS_Q12 + 6), above = (int16_t)(between + params.adaptation.emf_least_q12);
    EACH_DIRECTION(sign) {
        drive.run.control.i_q13.q = (int16_t)(sign * SIGNALS_FLOWS_Q13);
        TEST_ASSERT_EQUAL_UINT16(3000, ms_until_offset(between, 0, TURN_STEP));
        setUp();
        drive.run.control.i_q13.q = (int16_t)(sign * SIGNALS_FLOWS_Q13);
        expect_offset_found(above, 0, TURN_STEP);
        setUp();
        drive.run.control.i_q13.q = (int16_t)(sign * (SIGNALS_FLOWS_Q13 + 1));
        expect_offset_found(between, 0, TURN_STEP);
    }
}

/** The speed swings with the turn by half of itself, as a load or an offset makes it: the back-EMF follows, and none of it stands. */
void test_a_speed_that_swings_with_the_turn_leaves_none(void)
{
    static const alphabeta_t none = { 0, 0 };
    uint32_t angle_q16 = 0;
    uint16_t ms;
    drive.run.observer.omega_q16 = 1050 * 65536;
    for (ms = 0; ms < 3000u; ms++) {
        const int16_t swing_q15 = trig_sincos((angle_t)(angle_q16 >> 16)).sin / 2;
        const uint32_t step_q16 = (uint32_t)TURN_STEP * (uint32_t)(65536 + 2 * swing_q15);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, offset_look((angle_t)((angle_q16 + step_q16 / 2u) >> 16), (int16_t)(700 + 700 * (int32_t)swing_q15 / 32768), none));
        angle_q16 += step_q16;
    }
}

/** A slow motor's largest back-EMF, far beyond dead time's voltage, in turns that end anywhere in a millisecond, at a constant speed and on a ramp. */
void test_a_millisecond_more_or_less_of_a_turn_is_no_offset_however_large_the_back_emf(void)
{
    static const alphabeta_t none = { 0, 0 };
    uint16_t step, ms;
    for (step = 400; step < 6500u; step = (uint16_t)(step + 381u)) {
        uint32_t angle_q8 = 0, step_q8 = 256u * step;
        const uint32_t ramp_q8 = (step & 1u) ? 20u : 0u;
        setUp();
        drive.run.observer.omega_q16 = 1050 * 65536;
        for (ms = 0; ms < 1000u; ms++) {
            const int16_t emf_q12 = (int16_t)((uint64_t)16000u * step_q8 / (256u * step));
            TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, offset_look((angle_t)((angle_q8 + step_q8 / 2u) >> 8), emf_q12, none));
            angle_q8 += step_q8;
            step_q8 += ramp_q8;
        }
    }
}

void test_a_turn_is_whole_where_its_sine_leaves_the_negative_side_and_not_before(void)
{
    static const struct {
        int16_t sine_q15;
        uint16_t sums_ms;
    } cases[] = { { -1, SIGNALS_TURNS_MS + 1u }, { 0, 0 } };
    EACH(n, cases) {
        drive.run.observer.omega_q16 = 1050 * 65536;
        signals.sine_q15 = -100;
        signals.emf_ms = SIGNALS_TURNS_MS;
        drive.frame.sin = cases[n].sine_q15;
        (void)signals_offset(&signals, &drive, &params);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].sums_ms, signals.emf_ms, golden_row(n));
    }
}

void test_turns_that_a_millisecond_cannot_tell_from_a_standing_field_are_not_summed(void)
{
    const int16_t above = (int16_t)(4 * params.adaptation.emf_least_q12);
    EACH_DIRECTION(sign) {
        TEST_ASSERT_EQUAL_UINT16(3000, ms_until_offset_at((int16_t)(sign * 6010), above, 0, TURN_STEP));
        TEST_ASSERT_TRUE(ms_until_offset_at((int16_t)(sign * 5990), above, 0, TURN_STEP) < 1000u);
    }
}

void test_one_sum_alone_is_none_and_the_next_is_summed_anew(void)
{
    const alphabeta_t stands_q12[] = { { (int16_t)(3 * params.adaptation.emf_least_q12), 0 }, { 0, 0 } };
    uint16_t ms;
    current_flows();
    drive.run.observer.omega_q16 = 1050 * 65536;
    for (ms = 0; ms < 3000u; ms++) {
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, offset_look((angle_t)(ms * TURN_STEP), 700, stands_q12[(ms / 286u) & 1u]));
    }
}

void test_a_start_s_d_current_an_angle_that_stands_and_a_turn_without_end_are_no_whole_turns(void)
{
    const int16_t above = (int16_t)(2 * params.adaptation.emf_least_q12);
    current_flows();
    drive.run.handover.id_q13 = 10;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until_offset(above, 0, TURN_STEP));
    drive.run.handover.id_q13 = 0;
    drive.run.held.phase = (uint16_t)HELD_SETTLES;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until_offset(above, 0, TURN_STEP));
    drive.run.held.phase = (uint16_t)HELD_NOT;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until_offset(above, 0, 0));
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until_offset(above, 0, 65536 / 1100));
    setUp();
    current_flows();
    TEST_ASSERT_UINT16_WITHIN(300, 1800, ms_until_offset(above, 0, 65536 / 900));
}

/* ---- signals that do not fit the motor ---- */

/** What the innovations are like. */
typedef struct {
    int16_t amplitude_erpm, constant_erpm;
    uint16_t step;  /**< the electrical angle between two checks, angle counts */
    uint16_t order; /**< how often the innovation swings in an electrical turn, in fifths */
} beat_t;

static const beat_t offset_like = { 600, 0, 7001, 5 }, gain_like = { 600, 0, 7001, 10 };

/** Checks with these phase currents and innovations, all of them large, until a fault. @return checks, most if there is none */
static uint16_t wrong_until_fault(int16_t a_q13, int16_t b_q13, beat_t beat, uint16_t most)
{
    uint16_t checks = 0;
    rig_closed(1, 10000);
    while (drive.fault == (uint16_t)FAULT_NONE && checks < most) {
        const uint32_t turned = (uint32_t)checks * beat.step;
        drive.phases_q13.a = a_q13;
        drive.phases_q13.b = b_q13;
        drive.phases_q13.c = (int16_t)(-a_q13 - b_q13);
        drive.frame = trig_sincos((angle_t)turned);
        drive.run.observer.innovation_erpm =
            (int16_t)(beat.constant_erpm + qm_mulhi(beat.amplitude_erpm, trig_sincos((angle_t)(turned * beat.order / 5u + 5000u)).cos) * 2);
        drive.run.observer.wrong_steps++;
        signals_check(&drive, &params);
        signals_judge(&drive, &params);
        checks++;
    }
    return checks;
}

void test_innovations_in_time_with_the_electrical_angle_are_a_sensor_or_an_open_phase_after_100_ms(void)
{
    static const struct {
        int16_t a_q13, b_q13;
        drive_fault_t fault;
    } cases[] = {
        { 1000, -500, FAULT_CURRENT_SENSOR }, { -1000, 500, FAULT_CURRENT_SENSOR }, { 1000, -700, FAULT_CURRENT_SENSOR },
        { 10, 1000, FAULT_OPEN_PHASE }, { 1000, -10, FAULT_OPEN_PHASE }, { -1000, 990, FAULT_OPEN_PHASE }, { 7000, 70, FAULT_OPEN_PHASE },
        { 7000, -7000, FAULT_OPEN_PHASE }, { 0, 0, FAULT_CURRENT_SENSOR }, { 4192, -7000, FAULT_CURRENT_SENSOR }, /* no sum wraps */
    };
    EACH(n, cases) {
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(251, wrong_until_fault(cases[n].a_q13, cases[n].b_q13, (n & 1u) ? offset_like : gain_like, 1000), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16(cases[n].fault, drive.fault);
        drive.fault = (uint16_t)FAULT_NONE;
    }
}

void test_innovations_in_time_with_the_shaft_accuse_nobody_however_long_they_last(void)
{
    static const uint16_t orders[] = { 1, 2, 3, 4, 6, 7 }; /* of the shaft, at five pole pairs */
    EACH(n, orders) {
        const beat_t load = { (int16_t)params.load_erpm, 0, 7001, orders[n] };
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(5000, wrong_until_fault(1000, -10, load, 5000), golden_row(n));
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(params.wrong_steps, drive.run.observer.wrong_steps);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(params.wrong_steps, drive.run.evidence.checks);
    }
}

void test_innovations_that_no_load_makes_that_the_motor_can_carry_are_a_wrong_signal(void)
{
    const beat_t beyond = { 0, (int16_t)(params.load_erpm + 1u), 7001, 0 }, most = { 0, (int16_t)params.load_erpm, 7001, 0 };
    TEST_ASSERT_EQUAL_UINT16(251, wrong_until_fault(1000, -500, beyond, 1000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_CURRENT_SENSOR, drive.fault);
    drive.fault = (uint16_t)FAULT_NONE;
    TEST_ASSERT_EQUAL_UINT16(1000, wrong_until_fault(1000, -500, most, 1000));
}

void test_five_eighths_of_the_innovations_size_in_time_with_the_electrical_angle_are_enough_and_less_is_not(void)
{
    static const uint16_t orders[] = { 5, 10 };
    EACH(n, orders) {
        const beat_t more = { 580, 600, 7001, orders[n] }, less = { 530, 600, 7001, orders[n] }; /* 0.67 of their quotient */
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(251, wrong_until_fault(1000, -500, more, 1000), golden_row(n));
        drive.fault = (uint16_t)FAULT_NONE;
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(1000, wrong_until_fault(1000, -500, less, 1000), golden_row(n));
    }
}

void test_half_of_it_with_each_of_the_two_pointers_proves_nothing(void)
{
    uint16_t checks;
    rig_closed(1, 10000);
    drive.run.evidence.size = 200000;
    drive.run.evidence.checks = 1000;
    drive.run.evidence.once.cosine = -120000;
    drive.run.evidence.twice.sine = 120000;
    drive.frame = trig_sincos(0);
    for (checks = 0; checks <= params.wrong_steps; checks++) {
        drive.run.observer.wrong_steps++;
        signals_judge(&drive, &params);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_an_innovation_counts_in_full_with_both_pointers_up_to_half_of_the_format(void)
{
    static const int16_t cases[][2] = { { 16382, 16382 }, { 16383, 16383 }, { 16384, 16383 }, { 32767, 16383 }, { -16383, -16383 }, { -32767, -16383 } };
    EACH(n, cases) {
        rig_closed(1, 10000);
        drive.frame.cos = 0;
        drive.frame.sin = -32768; /* half a turn of the second pointer: all of it along -cosine */
        drive.run.observer.innovation_erpm = cases[n][0];
        drive.run.observer.wrong_steps = 1;
        signals_check(&drive, &params);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(-cases[n][1], drive.run.evidence.twice.cosine, golden_row(n));
        TEST_ASSERT_EQUAL_INT32_MESSAGE(-cases[n][0], drive.run.evidence.once.sine, golden_row(n));
    }
}

void test_a_rotor_that_all_but_stands_turns_with_no_pointer(void)
{
    rig_closed(1, 10000);
    EACH_DIRECTION(sign) {
        rig_speed((int16_t)(sign * 2499));
        drive.frame = trig_sincos(0);
        drive.run.observer.innovation_erpm = 500;
        drive.run.observer.wrong_steps = 1;
        signals_check(&drive, &params);
        TEST_ASSERT_EQUAL_INT32(0, drive.run.evidence.once.cosine);
        TEST_ASSERT_EQUAL_INT32(0, drive.run.evidence.twice.cosine);
    }
    TEST_ASSERT_EQUAL_UINT16(2, drive.run.evidence.checks);
    TEST_ASSERT_EQUAL_UINT32(1000, drive.run.evidence.size);
    rig_speed(2499);
    drive.run.observer.omega_q16 = 2600L * 65536; /* as a load that swings stops the rotor, the observer lags */
    signals_check(&drive, &params);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.evidence.once.cosine);
    rig_speed(-2500);
    signals_check(&drive, &params);
    TEST_ASSERT_INT32_WITHIN(2, 500, drive.run.evidence.once.cosine);
}

void test_the_innovation_that_a_load_can_make_follows_from_current_torque_inertia_and_the_observer_s_rate(void)
{
    const double acceleration = 1.5 * 5.0 * PARAM_F(MOTOR_KPHI_V_PER_KRPM) / ROOT_OF_3 * 60.0 / (2.0 * PI * 1000.0 * 5.0)
                                * PARAM_F(MAXIMUM_CURRENT_A) / 2.0 / PARAM_F(MOTOR_INERTIA_KGM2); /* rad/s2 of half the largest current */
    const double rate = PARAM_F(PARAM_LOADED_SHARE) * 2.0 * PI * PARAM_F(LOAD_BANDWIDTH_HZ);
    const double mean_erpm = 2.0 / PI * acceleration / (2.0 * rate) * 5.0 * 60.0 / (2.0 * PI);
    TEST_ASSERT_UINT16_WITHIN((uint16_t)(mean_erpm / 100.0), (uint16_t)mean_erpm, params.load_erpm);
}

/** Mean innovation of a step of the load, in Kt/J i / r of the rate under load, in the record of WRONG_SEC around its peak: t r exp(-r t), at the quick
 *  rate where that ends within the record, for then the gate is open. */
static float step_s_mean(float load_hz)
{
    const float quick = 2.0F * (float)PI * load_hz, loaded = PARAM_F(PARAM_LOADED_SHARE) * quick, rate = (quick * PARAM_F(WRONG_SEC) > 1.0F) ? quick : loaded;
    const float dt = PARAM_F(WRONG_SEC) / 256.0F, from = 1.0F / rate - PARAM_F(WRONG_SEC) / 2.0F, first = (from > 0.0F) ? from : 0.0F;
    float t, decay = 1.0F, sum = 0.0F;
    for (t = 0.0F; t < first + PARAM_F(WRONG_SEC); t += dt) {
        sum += (t < first) ? 0.0F : t * loaded * decay;
        decay /= 1.0F + rate * dt;
    }
    return sum / 256.0F;
}

void test_a_slow_observer_s_innovation_after_a_load_s_step_accuses_no_signal(void)
{
    const float quick_most = PARAM_LOAD_MEAN;
#pragma push_macro("LOAD_BANDWIDTH_HZ")
#undef LOAD_BANDWIDTH_HZ
#define LOAD_BANDWIDTH_HZ 1.0 /* a vehicle of a hundred times the rotor's inertia */
    const float slow_most = PARAM_LOAD_MEAN;
#pragma pop_macro("LOAD_BANDWIDTH_HZ")
    TEST_ASSERT_TRUE(step_s_mean(PARAM_F(LOAD_BANDWIDTH_HZ)) < quick_most);
    TEST_ASSERT_FLOAT_WITHIN(1e-6F, 0.5F / (float)PI, quick_most);
    TEST_ASSERT_FLOAT_WITHIN(0.01F * slow_most, step_s_mean(1.0F), slow_most);
}

void test_what_proves_nothing_is_halved_and_what_has_ended_is_forgotten(void)
{
    const beat_t load = { 0, 300, 7001, 0 };
    TEST_ASSERT_EQUAL_UINT16(250, wrong_until_fault(1000, -10, load, 250));
    TEST_ASSERT_EQUAL_UINT16(250, drive.run.evidence.checks);
    TEST_ASSERT_EQUAL_UINT32(250ul * 300ul, drive.run.evidence.size);
    TEST_ASSERT_EQUAL_UINT16(251, wrong_until_fault(1000, -10, load, 251));
    TEST_ASSERT_EQUAL_UINT16(126, drive.run.evidence.checks);
    TEST_ASSERT_EQUAL_UINT32(251ul * 300ul / 2ul, drive.run.evidence.size);
    TEST_ASSERT_EQUAL_UINT16(125, drive.run.observer.wrong_steps);
    drive.run.observer.wrong_steps = 0;
    signals_check(&drive, &params);
    signals_judge(&drive, &params);
    TEST_ASSERT_EACH_EQUAL_UINT8(0, &drive.run.evidence, sizeof drive.run.evidence);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_evidence_that_comes_and_goes_for_long_is_halved_and_ends_in_no_fault(void)
{
    EACH_DIRECTION(sign) {
        rig_closed(1, 5000);
        drive.frame = trig_sincos(0x2000);
        int32_t expected;
        for (uint32_t n = 0; n < 140000ul; n++) { /* a minute */
            drive.run.observer.innovation_erpm = (int16_t)(sign * (int16_t)(params.load_erpm - 1u));
            drive.run.observer.wrong_steps = (uint16_t)(1u + n % 4u);
            signals_check(&drive, &params);
            signals_judge(&drive, &params);
            TEST_ASSERT_LESS_OR_EQUAL_UINT16(513, drive.run.evidence.checks);
            TEST_ASSERT_GREATER_OR_EQUAL_UINT16((n < 256u) ? n : 256u, drive.run.evidence.checks);
        }
        expected = (int32_t)(drive.run.evidence.checks * ROOT_OF_HALF * drive.run.observer.innovation_erpm);
        TEST_ASSERT_INT32_WITHIN(params.load_erpm * 4, expected, drive.run.evidence.once.sine);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    }
}

void test_what_is_wrong_on_and_off_in_time_with_the_angle_is_judged_after_100_ms_of_fast_turns(void)
{
    static const struct {
        int16_t erpm;
        uint16_t order; /* in fifths */
        drive_fault_t fault;
    } cases[] = { { 6100, 5, FAULT_CURRENT_SENSOR }, { -6100, 10, FAULT_CURRENT_SENSOR }, { 6100, 4, FAULT_NONE }, { 6100, 1, FAULT_NONE }, { 5900, 5, FAULT_NONE }, { -5900, 5, FAULT_NONE } };
    EACH(n, cases) {
        uint16_t checks = 0;
        rig_closed(1, 10000);
        rig_speed(cases[n].erpm);
        while (drive.fault == (uint16_t)FAULT_NONE && checks < 5000u) {
            const uint32_t turned = (uint32_t)checks * 7001u;
            drive.frame = trig_sincos((angle_t)turned);
            drive.run.observer.innovation_erpm = qm_mulhi(600, trig_sincos((angle_t)(turned * cases[n].order / 5u)).cos);
            drive.run.observer.wrong_steps = (uint16_t)(1u + checks % 4u);
            signals_check(&drive, &params);
            signals_judge(&drive, &params);
            checks++;
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].fault, drive.fault, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((cases[n].fault == FAULT_NONE) ? 5000u : 251u, checks, golden_row(n));
        drive.fault = (uint16_t)FAULT_NONE;
    }
}

void test_what_is_wrong_on_and_off_and_swings_with_no_field_accuses_nobody_however_large_it_is(void)
{
    rig_closed(1, 10000); /* as after a held shaft, while the observer stood still */
    for (uint16_t checks = 0; checks < 5000u; checks++) {
        drive.frame = trig_sincos((angle_t)((uint32_t)checks * 7001u));
        drive.run.observer.innovation_erpm = (int16_t)(params.load_erpm + 500u);
        drive.run.observer.wrong_steps = (uint16_t)(1u + checks % 4u);
        signals_check(&drive, &params);
        drive.run.evidence.unexplained = drive.run.evidence.checks;
        signals_judge(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    }
}

void test_evidence_that_is_never_judged_is_forgotten(void)
{
    rig_closed(1, 10000);
    drive.run.observer.wrong_steps = 1;
    for (uint32_t n = 0; n < 100000ul; n++) {
        drive.run.observer.innovation_erpm = 16000;
        signals_check(&drive, &params);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(528, drive.run.evidence.checks);
        TEST_ASSERT_EQUAL_UINT32(16000ul * drive.run.evidence.checks, drive.run.evidence.size);
    }
}

void test_voltage_that_neither_speed_nor_resistance_nor_dead_time_explains_is_a_wrong_signal(void)
{
    const int16_t dead_q12 = (int16_t)(5 * params.adaptation.emf_least_q12);
    static const struct {
        const char *what;
        float ri_d, ri_q;
        int16_t q_q12;
    } cases[] = { { "no current", 0.0F, 0.0F, 0 }, { "q current", 0.0F, 0.5F, 0 }, { "d current", -0.5F, 0.0F, 0 }, { "speed", 0.0F, 0.0F, 2000 },
                  { "reverse speed", 0.0F, 0.0F, -2000 }, { "all", 0.25F, -0.25F, 1000 } };
    EACH(n, cases) {
        int16_t explained = (int16_t)(dead_q12 + 4000.0F * (qm_abs((int16_t)(100 * cases[n].ri_d)) + qm_abs((int16_t)(100 * cases[n].ri_q))) / 100.0F
                                      + (float)qm_abs(cases[n].q_q12));
        EACH_DIRECTION(sign) {
            rig_closed(1, 10000);
            drive.run.control.i_q13.d = rig_current_of_ri(cases[n].ri_d);
            drive.run.control.i_q13.q = rig_current_of_ri(cases[n].ri_q);
            rig_emf((int16_t)(sign * (explained - 8)), cases[n].q_q12);
            signals_check(&drive, &params);
            signals_judge(&drive, &params);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(0, drive.run.observer.wrong_steps, cases[n].what);
            rig_emf((int16_t)(sign * (explained + 8)), cases[n].q_q12);
            signals_check(&drive, &params);
            signals_judge(&drive, &params);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(2, drive.run.observer.wrong_steps, cases[n].what);
        }
    }
}

void test_voltage_without_current_on_a_rotor_that_stands_is_an_open_phase_within_100_ms(void)
{
    uint16_t steps = 0;
    rig_closed(1, 10000);
    rig_emf(8000, 10);
    drive.phases_q13.a = 0;
    drive.phases_q13.b = 500;
    drive.phases_q13.c = -500;
    while (drive.fault == (uint16_t)FAULT_NONE && steps < 1000u) {
        if (drive.run.observer.wrong_steps != 0u) {
            drive.run.observer.wrong_steps--; /* the observer sees nothing wrong */
        }
        signals_check(&drive, &params);
        signals_judge(&drive, &params);
        steps++;
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_OPEN_PHASE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(250, steps);
}

void test_innovations_at_the_end_of_a_stop_that_dead_time_explains_end_it_without_a_fault(void)
{
    const int16_t blurred_q12 = (int16_t)(4 * params.dead_emf_q12);
    static const struct {
        const char *what;
        drive_state_t state;
        int16_t run, clear_q12, more_q13;
        drive_state_t next;
    } cases[] = { { "stop", DRIVE_STOPPING, 0, 0, 0, DRIVE_STOPPED },
                  { "stop from above", DRIVE_STOPPING, 0, 1, 0, DRIVE_FAULT },
                  { "with current", DRIVE_STOPPING, 0, 0, 1, DRIVE_FAULT },
                  { "reversal", DRIVE_STOPPING, 1, 0, 0, DRIVE_FAULT },
                  { "run", DRIVE_CLOSED, 0, 0, 0, DRIVE_FAULT } };
    EACH(n, cases) {
        EACH_DIRECTION(sign) {
            rig_closed((int16_t)sign, 10000);
            drive.state = (uint16_t)cases[n].state;
            drive.command.run = cases[n].run;
            rig_emf(0, (int16_t)(sign * (blurred_q12 - 1 + cases[n].clear_q12)));
            drive.run.control.ref_q13.q = (int16_t)(sign * (params.id_off_q13 - 1 + cases[n].more_q13));
            drive.run.observer.wrong_steps = params.wrong_steps;
            drive.run.observer.innovation_erpm = INT16_MAX;
            signals_check(&drive, &params);
            signals_judge(&drive, &params);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].state, drive.state, cases[n].what);
            drive.run.observer.wrong_steps++;
            signals_check(&drive, &params);
            signals_judge(&drive, &params);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].next, drive.state, cases[n].what);
            drive.fault = (uint16_t)FAULT_NONE;
        }
    }
}
