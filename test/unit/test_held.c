/* A shaft that is held and let go: when the drive asks, where the angle stops, what a rotor that stands tells, and how the estimator goes on. */
#include "drive_rig.h"

#include "drive/held.h"
#include "drive/limits.h"
#include "drive/protection.h"

#define FAST_ERPM 10000 /* reference, and the speed before */

static held_t *shaft;

void setUp(void)
{
    rig_power_up();
}

/** In closed loop at a reference, the observer at a speed, the filtered back-EMF as given. */
static void at(int16_t direction, int16_t reference_erpm, int16_t speed_erpm, int16_t d_q12, int16_t q_q12)
{
    rig_closed(direction, (int16_t)(direction * reference_erpm));
    rig_speed((int16_t)(direction * speed_erpm));
    rig_emf(d_q12, (int16_t)(direction * q_q12));
    drive.run.estimator.sign = direction;
    drive.run.control.ref_q13.q = (int16_t)(direction * rig_current_of_ri(1.0F));
    drive.run.control.i_q13.q = drive.run.control.ref_q13.q;
    drive.run.observer.fast_share_q15 = 32767; /* the gate is open */
    shaft = &drive.run.held;
    shaft->emf_q12 = estimator_emf(&drive.run.estimator);
}

static void steps(uint16_t count)
{
    while (count-- != 0u) {
        held_step(&drive, &params);
        held_act(&drive, &params);
    }
}

/** A rotor that has been stopped: far below its reference, R i alone in the back-EMF. @param more_q12 that R is off */
static void asked(int16_t direction, int16_t more_q12)
{
    at(direction, FAST_ERPM, 100, 0, more_q12);
    steps(HELD_DOUBTS_MOST / HELD_DOUBTS_FAR + 1u);
    TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
}

/** To the question's end: it stands. Returns the steps. */
static uint16_t answered(void)
{
    uint16_t count = 0;
    while (shaft->phase != (uint16_t)HELD_STANDS && count < 100u) {
        steps(1);
        count++;
    }
    TEST_ASSERT_LESS_THAN_UINT16(100, count);
    return count;
}

static void stands(int16_t direction, int16_t more_q12)
{
    asked(direction, more_q12);
    steps(HELD_SETTLE_STEPS - 1u);
    TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
    (void)answered();
    steps(1); /* the frame a step later */
}

/* ---- when it is asked ---- */

void test_the_angle_stops_after_two_steps_far_below_the_reference_and_after_five_below_half_of_it(void)
{
    EACH_DIRECTION(direction) {
        static const struct {
            int16_t speed_erpm;
            uint16_t steps;
        } cases[] = { { FAST_ERPM / 8 - 10, 2 }, { FAST_ERPM / 8 - 1, 2 }, { -FAST_ERPM, 2 }, { FAST_ERPM / 8, 5 }, { FAST_ERPM / 8 + 10, 5 }, { FAST_ERPM / 2 - 10, 5 }, { FAST_ERPM / 2 + 10, 1000 } };
        EACH(n, cases) {
            uint16_t count = 0;
            at(direction, FAST_ERPM, cases[n].speed_erpm, 0, 200);
            while (!held_angle_stands(shaft) && count < 1000u) {
                steps(1);
                count++;
            }
            TEST_ASSERT_EQUAL_UINT16(cases[n].steps, count);
            TEST_ASSERT_EQUAL_INT16((count < 1000u) ? 0 : 1, drive.run.model.inv_kfi != 0);
        }
    }
}

void test_a_rotor_that_a_known_load_slows_down_is_not_asked_before_it_is_far_below(void)
{
    at(1, FAST_ERPM, FAST_ERPM / 2 - 10, 0, 200);
    drive.run.observer.fast_share_q15 = 0; /* the gate is closed */
    steps(100);
    TEST_ASSERT_FALSE(held_angle_stands(shaft));
    rig_speed(FAST_ERPM / 8 - 10);
    drive.run.stall_steps = 1;
    steps(2);
    TEST_ASSERT_TRUE(held_angle_stands(shaft));
}

void test_a_rotor_is_not_asked_where_no_resistance_explains_its_back_emf_nor_before_the_observer_runs(void)
{
    at(1, FAST_ERPM, 100, 0, 4000); /* R i is 4000: half more of it would be 2000 */
    steps(100);
    TEST_ASSERT_FALSE(held_angle_stands(shaft));
    at(1, FAST_ERPM, 100, 0, 200);
    drive.run.handover.phase = (uint16_t)START_OBSERVE;
    steps(100);
    TEST_ASSERT_FALSE(held_angle_stands(shaft));
}

void test_a_rotor_at_exactly_half_of_the_reference_is_not_asked(void)
{
    EACH_DIRECTION(direction) {
        at(direction, FAST_ERPM, FAST_ERPM / 2, 0, 200);
        steps(100);
        TEST_ASSERT_FALSE(held_angle_stands(shaft));
        at(direction, FAST_ERPM, FAST_ERPM / 2 - 1, 0, 200);
        steps(5);
        TEST_ASSERT_TRUE(held_angle_stands(shaft));
    }
}

void test_a_speed_that_is_half_the_reference_now_and_then_is_no_doubt(void)
{
    at(1, FAST_ERPM, FAST_ERPM / 2 - 10, 0, 200);
    for (uint16_t n = 0; n < 100u; n++) {
        rig_speed((n % 5u == 4u) ? FAST_ERPM : FAST_ERPM / 2 - 10);
        drive.run.observer.fast_share_q15 = 32767;
        steps(1);
    }
    TEST_ASSERT_FALSE(held_angle_stands(shaft));
}

/* ---- where the angle stops ---- */

void test_the_frame_is_ahead_by_the_speed_times_the_filter_s_time(void)
{
    rig_closed(1, 1000);
    drive.run.held.inv_kfi = drive.run.model.inv_kfi;
    drive.run.held.emf_sum_max_q12 = drive.run.model.emf_sum_max_q12;
    EACH_DIRECTION(direction) {
        for (int16_t lag_q12 = 100; lag_q12 <= 3000; lag_q12 = (int16_t)(lag_q12 + 290)) {
            const float erpm = (float)lag_q12 * (float)drive.run.model.inv_kfi / 2048.0F;
            const float turns = erpm / 60.0F * PARAM_F(LOOPTIME_SEC) * 65536.0F / (float)drive.run.model.kfilter_esdq_q16;
            const float expected = 65536.0F * ((turns > 0.5F) ? 0.5F : turns);
            TEST_ASSERT_INT16_WITHIN(2 + (int16_t)(expected / 200.0F), (int16_t)((float)direction * expected),
                                     held_lead(&drive.run, &params, (int16_t)(direction * lag_q12)));
        }
    }
    drive.run.model.kfilter_esdq_q16 = 256;
    TEST_ASSERT_EQUAL_INT16(32767, held_lead(&drive.run, &params, 30000)); /* never more than half a turn */
    TEST_ASSERT_EQUAL_INT16(0, held_lead(&drive.run, &params, 0));
}

void test_neither_observer_nor_estimator_has_a_speed_where_the_angle_stops_and_both_turn_back(void)
{
    EACH_DIRECTION(direction) {
        uint32_t rho_q32;
        angle_t next;
        at(direction, FAST_ERPM, 100, 0, 0);
        shaft->emf_q12.q = (int16_t)(direction * 900);
        drive.run.observer.innovation_erpm = (int16_t)(direction * -900);
        rho_q32 = drive.run.estimator.rho_q32;
        next = estimator_next_angle(&drive.run.estimator);
        steps(2);
        TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
        TEST_ASSERT_EQUAL_INT32(0, drive.run.observer.omega_q16);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.observer.innovation_erpm);
        TEST_ASSERT_EQUAL_INT32(0, drive.run.estimator.omega_filtered_q16);
        TEST_ASSERT_EQUAL_HEX32((uint32_t)(angle_t)(next - estimator_next_angle(&drive.run.estimator)) << 16,
                                qm_turn_sub(rho_q32, drive.run.estimator.rho_q32));
    }
}

void test_an_estimator_that_goes_on_has_neither_a_lag_nor_an_innovation_in_the_gate(void)
{
    EACH_DIRECTION(direction) {
        stands(direction, 200);
        steps(HELD_ASK_STEPS);
        shaft->lag_q12 = 500;
        drive.run.observer.gate_level = 50;
        rig_emf(0, (int16_t)(direction * (params.adaptation.emf_least_q12 + 20)));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_EQUAL_INT16(0, shaft->lag_q12);
        TEST_ASSERT_EQUAL_INT32(0, drive.run.observer.gate_level);
        rig_speed((int16_t)(direction * (FAST_ERPM / 2 - 1)));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        rig_speed((int16_t)(direction * (FAST_ERPM / 2)));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_NOT, shaft->phase); /* it is back */
    }
}

void test_a_step_at_its_speed_in_which_nothing_changes_fast_forgets_lag_and_doubts(void)
{
    at(1, FAST_ERPM, FAST_ERPM, 30, 3000);
    drive.run.observer.fast_share_q15 = 0;
    drive.run.observer.load_q16 = 77 * 65536;
    shaft->lag_q12 = 500;
    shaft->doubts = 3;
    shaft->emf_q12.d = 0;
    shaft->emf_q12.q = 0;
    held_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(77, shaft->load);
    TEST_ASSERT_EQUAL_INT16(0, shaft->lag_q12);
    TEST_ASSERT_EQUAL_UINT16(0, shaft->doubts);
    TEST_ASSERT_EQUAL_INT16(30, shaft->emf_q12.d);
    TEST_ASSERT_EQUAL_INT16(3000, shaft->emf_q12.q);
    TEST_ASSERT_EQUAL_UINT16(0, shaft->steps);
}

void test_a_shaft_that_is_forgotten_has_neither_stood_nor_anything_to_do(void)
{
    stands(1, 200);
    shaft->act = (uint16_t)HELD_LEARN;
    shaft->doubts = 3;
    held_forget(shaft);
    TEST_ASSERT_EQUAL_UINT16(HELD_NOT, shaft->phase);
    TEST_ASSERT_EQUAL_UINT16(HELD_WAITS, shaft->act);
    TEST_ASSERT_EQUAL_UINT16(0, shaft->stood);
    TEST_ASSERT_EQUAL_UINT16(0, shaft->doubts);
    TEST_ASSERT_EQUAL_UINT16(0, shaft->steps);
}

void test_the_field_is_weakened_for_the_reference_once_half_of_it_is_reached_and_for_twice_the_speed_before(void)
{
    const int16_t from = params.fieldweak.on_speed_erpm;
    const int16_t cases[][3] = { /* reference, speed, what the field is weakened for */
                                 { from, 0, from }, { (int16_t)(from - 1), 0, (int16_t)(from - 1) }, { 20000, 0, from }, { 20000, (int16_t)(from >> 1), from },
                                 { 20000, (int16_t)((from >> 1) + 1), (int16_t)(2 * ((from >> 1) + 1)) }, { 20001, 9999, 19998 }, { 20001, 10000, 20001 },
                                 { 20001, 15000, 20001 }, { 20001, -15000, from } };
    EACH(n, cases) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n][2], held_weakened_for(&params, cases[n][0], cases[n][1]), golden_row(n));
    }
}

void test_a_back_emf_that_is_lost_at_once_turns_the_frame_back_by_its_lag_and_the_commanded_vector_stays(void)
{
    EACH_DIRECTION(direction) {
        alphabeta_t before, after;
        angle_t angle;
        int16_t back, expected;
        at(direction, FAST_ERPM, 100, 0, 0);
        shaft->emf_q12.q = (int16_t)(direction * 900); /* was there a step ago */
        drive.run.control.v_q14.d = -3000;
        drive.run.control.v_q14.q = (int16_t)(direction * 8000);
        before = inverse_park(drive.run.control.v_q14, trig_sincos(estimator_next_angle(&drive.run.estimator)));
        angle = estimator_next_angle(&drive.run.estimator);
        steps(2);
        TEST_ASSERT_TRUE(held_angle_stands(shaft));
        back = (int16_t)(angle_t)(angle - estimator_next_angle(&drive.run.estimator));
        drive.run.model.inv_kfi = shaft->inv_kfi;
        expected = held_lead(&drive.run, &params, (int16_t)(direction * 900));
        TEST_ASSERT_INT16_WITHIN(20, expected, back);
        TEST_ASSERT_GREATER_THAN_INT16(2000, (int16_t)(direction * back));
        TEST_ASSERT_EQUAL_UINT16(estimator_next_angle(&drive.run.estimator), drive.angle);
        after = inverse_park(drive.run.control.v_q14, drive.frame);
        TEST_ASSERT_INT16_WITHIN(8, before.alpha, after.alpha);
        TEST_ASSERT_INT16_WITHIN(8, before.beta, after.beta);
    }
}

void test_a_rotor_that_a_probe_finds_standing_is_where_the_frame_was_when_its_speed_fell_below_three_quarters(void)
{
    EACH_DIRECTION(direction) {
        static const struct {
            int16_t speed_erpm; /* while R i turns the frame on */
            int16_t d_q12;      /* of the back-EMF, with 200 in q: less than half of it is no R i */
            int16_t back;       /* turns the frame back by */
        } cases[] = { { FAST_ERPM / 4 * 3 - 10, 150, 20000 }, { FAST_ERPM / 4 * 3 - 10, 101, 20000 }, { FAST_ERPM / 4 * 3 - 10, 100, 0 }, { FAST_ERPM / 4 * 3 + 10, 150, 0 } };
        EACH(n, cases) {
            uint32_t rho_q32;
            at(direction, FAST_ERPM, FAST_ERPM - 10, 0, 200);
            steps(1);
            rho_q32 = drive.run.estimator.rho_q32;
            drive.run.estimator.rho_q32 += (uint32_t)(uint16_t)(direction * 20000) << 16;
            rig_speed((int16_t)(direction * cases[n].speed_erpm));
            drive.run.observer.omega_q16 = (int32_t)(direction * FAST_ERPM) * 65536; /* follows the current, too */
            steps(1);
            drive.run.probe_phase = (uint16_t)PROBE_TEST;
            rig_speed((int16_t)(direction * 100));
            rig_emf(cases[n].d_q12, (int16_t)(direction * 200));
            steps(2);
            TEST_ASSERT_TRUE(held_angle_stands(shaft));
            TEST_ASSERT_INT16_WITHIN(2 * HELD_CLEAR_ANGLE, direction * (20000 - cases[n].back), (int16_t)((drive.run.estimator.rho_q32 - rho_q32) >> 16));
        }
    }
}

void test_a_rotor_that_turns_in_a_probe_has_its_frame_back_by_the_filter_s_lag(void)
{
    EACH_DIRECTION(direction) {
        angle_t angle;
        int16_t back;
        at(direction, FAST_ERPM, 100, 0, 0);
        shaft->emf_q12.q = (int16_t)(direction * 900); /* was there a step ago */
        drive.run.probe_phase = (uint16_t)PROBE_TEST;
        angle = estimator_next_angle(&drive.run.estimator);
        steps(2);
        TEST_ASSERT_TRUE(held_angle_stands(shaft));
        back = (int16_t)(angle_t)(angle - estimator_next_angle(&drive.run.estimator));
        TEST_ASSERT_INT16_WITHIN(20, held_lead(&drive.run, &params, (int16_t)(direction * 900)), back);
        TEST_ASSERT_GREATER_THAN_INT16(2000, (int16_t)(direction * back));
    }
}

void test_the_angle_stands_where_each_phase_carries_a_current_that_does_not_hide_in_dead_time(void)
{
    EACH_DIRECTION(direction) {
        uint32_t angle;
        for (angle = 0; angle < 65536u; angle += 331u) {
            int16_t moved, from_zero;
            at(direction, FAST_ERPM, 100, 0, 0);
            drive.run.estimator.next = (angle_t)angle;
            steps(2);
            TEST_ASSERT_TRUE(held_angle_stands(shaft));
            moved = (int16_t)(angle_t)(drive.run.estimator.next - angle);
            from_zero = (int16_t)((drive.run.estimator.next + 5461u) % 10923u) - 5461;
            TEST_ASSERT_INT16_WITHIN(HELD_CLEAR_ANGLE + 1, 0, moved);
            TEST_ASSERT_GREATER_OR_EQUAL_INT16(HELD_CLEAR_ANGLE - 7, qm_abs(from_zero));
            TEST_ASSERT_EQUAL_INT16((qm_abs((int16_t)((angle + 5461u) % 10923u) - 5461) > HELD_CLEAR_ANGLE + 6) ? 0 : HELD_CLEAR_ANGLE, qm_abs(moved));
        }
    }
}

void test_what_the_estimator_took_back_by_itself_is_no_lag(void)
{
    const int16_t k_q16 = drive.run.model.kfilter_esdq_q16;
    at(1, FAST_ERPM, FAST_ERPM, 200, 1000);
    steps(1);
    TEST_ASSERT_INT16_WITHIN(1, (int16_t)(-200.0F * 16.0F * (float)k_q16 / 65536.0F), shaft->lag_q12);
    at(-1, FAST_ERPM, FAST_ERPM, -200, 1000);
    steps(1);
    TEST_ASSERT_INT16_WITHIN(1, (int16_t)(-200.0F * 16.0F * (float)k_q16 / 65536.0F), shaft->lag_q12);
}

/* ---- does it stand? ---- */

/** What an electrical rpm turns in a step, angle counts. */
static float counts_per_erpm(void)
{
    return 16.0F * PARAM_F(LOOPTIME_SEC) / 60.0F * 65536.0F;
}

/** The angle that a sum of back-EMFs is, along the direction. */
static int16_t angle_of(int32_t sum_q12)
{
    return (int16_t)((float)sum_q12 * (float)shaft->inv_kfi / 2048.0F * counts_per_erpm());
}

/** By how much more than its direction a back-EMF says that the rotor is ahead of a frame that stands: what the filter is behind, angle counts. */
static float behind(float emf_q12)
{
    return emf_q12 * (float)shaft->inv_kfi / 2048.0F * counts_per_erpm() / 16.0F * 65536.0F / (float)drive.run.model.kfilter_esdq_q16;
}

/** By how much rounding to counts has turned a back-EMF of this size that is so far ahead of the frame, along the direction, angle counts. */
static float rounded(int16_t direction, sincos_t at_angle, float size_q12)
{
    const dq_t emf = estimator_emf(&drive.run.estimator);
    const float sine = (float)at_angle.sin / 32768.0F, cosine = (float)at_angle.cos / 32768.0F;
    return (-(float)emf.d * cosine - (float)(direction * emf.q) * sine) / size_q12 * 65536.0F / 6.2831853F;
}

void test_a_back_emf_that_stands_still_is_resistance_and_turns_the_frame_back_by_what_it_had_turned(void)
{
    static const int16_t more_q12[] = { 0, 40, 400, 1000, -400, -1000 }; /* of 4000 */
    EACH_DIRECTION(direction) {
        EACH(n, more_q12) {
            angle_t before;
            int16_t back, turned;
            asked(direction, more_q12[n]);
            before = estimator_next_angle(&drive.run.estimator);
            turned = (int16_t)(3.0F * 16.0F * (float)more_q12[n] * (float)shaft->inv_kfi / 2048.0F / 60.0F * PARAM_F(LOOPTIME_SEC) * 65536.0F);
            (void)answered();
            steps(1); /* the frame a step later */
            TEST_ASSERT_INT16_WITHIN(30, (int16_t)((float)more_q12[n] / 4000.0F * 32768.0F), qm_hi(drive.run.adaptation.rs_q31));
            back = (int16_t)(angle_t)(before - estimator_next_angle(&drive.run.estimator));
            TEST_ASSERT_INT16_WITHIN(40 + qm_abs(turned) / 50, (int16_t)(direction * turned), back);
            TEST_ASSERT_EQUAL_INT16(0, drive.run.model.inv_kfi);
        }
    }
}

void test_a_rotor_that_came_to_its_stop_while_the_angle_stood_was_no_frame_that_r_i_had_turned(void)
{
    const int16_t falls_q12 = params.adaptation.emf_least_q12;
    EACH_DIRECTION(direction) {
        for (uint16_t falls = HELD_PATIENCE_STEPS - 1u; falls <= HELD_PATIENCE_STEPS; falls++) {
            angle_t stopped;
            int16_t back;
            asked(direction, 400);
            shaft->emf_q12.q = (int16_t)(direction * (400 + falls * falls_q12));
            shaft->lag_q12 = shaft->emf_q12.q;
            stopped = estimator_next_angle(&drive.run.estimator);
            for (uint16_t n = falls; n-- != 0u;) {
                rig_emf(0, (int16_t)(direction * (400 + n * falls_q12)));
                steps(1);
                TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
            }
            (void)answered();
            steps(1);
            back = (int16_t)(direction * (int16_t)(angle_t)(stopped - estimator_next_angle(&drive.run.estimator)));
            back = (int16_t)(back + angle_of((int32_t)falls * falls * falls_q12 / 2) - (int16_t)behind((float)(falls * falls_q12))); /* it came so far, and that puts the frame right */
            TEST_ASSERT_INT16_WITHIN(50, (falls < HELD_PATIENCE_STEPS) ? angle_of(3 * 400) : 0, back);
        }
    }
}

/** A rotor that stops at once, and one that comes to its stop: the back-EMF falls as the filter does, or by so much a step. @return the frame's turn along the direction */
static int16_t comes_to_its_stop(int16_t direction, int16_t from_q12, int16_t falls_q12)
{
    float stays, emf_q12 = (float)from_q12;
    angle_t stopped;
    asked(direction, from_q12);
    stays = 1.0F - (float)drive.run.model.kfilter_esdq_q16 / 65536.0F;
    for (uint16_t n = 0; n < 4u; n++) {
        stays *= stays; /* of 16 periods */
    }
    stopped = estimator_next_angle(&drive.run.estimator);
    while (shaft->phase != (uint16_t)HELD_STANDS) {
        emf_q12 = (falls_q12 == 0) ? emf_q12 * stays : (emf_q12 > (float)falls_q12) ? emf_q12 - (float)falls_q12 : 0.0F;
        rig_emf(0, (int16_t)((float)direction * (emf_q12 + 0.5F)));
        steps(1);
    }
    steps(1);
    return (int16_t)(direction * (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - stopped));
}

void test_the_frame_goes_on_by_what_a_rotor_turned_that_came_to_its_stop_and_not_where_the_filter_alone_had_a_back_emf(void)
{
    EACH_DIRECTION(direction) {
        const int16_t at_once = comes_to_its_stop(direction, 600, 0), in_eight = comes_to_its_stop(direction, 600, 75);
        const int16_t came = angle_of(8 * 600 / 2), rest = angle_of(3 * params.adaptation.emf_least_q12); /* the tail's rest is taken for R i */
        TEST_ASSERT_INT16_WITHIN(rest, 0, at_once);
        TEST_ASSERT_INT16_WITHIN(rest, (int16_t)(came - (int16_t)behind(600.0F)), in_eight);
        TEST_ASSERT_EQUAL_INT16(0, shaft->came_q12);
        TEST_ASSERT_EQUAL_INT16(0, shaft->lag_q12);
    }
}

void test_the_frame_is_turned_back_by_a_quarter_turn_at_most_however_long_r_i_has_turned_it(void)
{
    EACH_DIRECTION(direction) {
        angle_t stopped;
        asked(direction, 400);
        shaft->doubted_steps = 100; /* times 400: more than a word has */
        stopped = estimator_next_angle(&drive.run.estimator);
        (void)answered();
        steps(1);
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(direction * 16383), (int16_t)(angle_t)(stopped - estimator_next_angle(&drive.run.estimator)));
    }
}

void test_what_a_rotor_came_is_of_this_question_alone_and_of_all_of_it(void)
{
    EACH_DIRECTION(direction) {
        angle_t stopped;
        int16_t came;
        at(direction, FAST_ERPM, 100, 0, 0);
        shaft->came_q12 = 3000; /* of before */
        shaft->run_on = 2000;
        shaft->turned_q12 = 5000;
        steps(HELD_DOUBTS_MOST / HELD_DOUBTS_FAR + 1u);
        stopped = estimator_next_angle(&drive.run.estimator);
        while (shaft->phase != (uint16_t)HELD_ASKED) {
            steps(1);
        }
        TEST_ASSERT_EQUAL_INT16(0, shaft->came_q12);
        came = (int16_t)(direction * 8 * params.adaptation.emf_least_q12);
        shaft->came_q12 = came;
        shaft->act = (uint16_t)HELD_LEARN;
        rig_emf(0, (int16_t)(direction * params.adaptation.emf_least_q12)); /* nor did it stand: it settles anew */
        held_act(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
        rig_emf(0, 0);
        (void)answered();
        steps(1);
        TEST_ASSERT_INT16_WITHIN(2, angle_of(direction * came), (int16_t)(direction * (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - stopped)));
    }
}

void test_resistance_is_learnt_within_the_adaptation_s_bounds_and_not_without_current(void)
{
    stands(1, 1900);
    TEST_ASSERT_INT16_WITHIN(400, (int16_t)(1900.0F / 4000.0F * 32768.0F), qm_hi(drive.run.adaptation.rs_q31));
    asked(1, -1200);
    drive.run.adaptation.rs_q31 = (int32_t)(params.adaptation.rs_least / 2) * 65536;
    (void)answered();
    TEST_ASSERT_EQUAL_INT16(params.adaptation.rs_least, qm_hi(drive.run.adaptation.rs_q31));
    asked(1, 40);
    drive.run.control.i_q13.q = 0;
    (void)answered();
    TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
}

void test_resistance_that_has_risen_rises_to_its_bound_and_not_beyond(void)
{
    EACH_DIRECTION(direction) {
        asked(direction, 1900);
        drive.run.control.i_q13.q = (int16_t)(direction * rig_current_of_ri(0.45F)); /* R i is 1800 */
        drive.run.adaptation.rs_q31 = (int32_t)qm_abs(params.adaptation.rs_least) * 65536;
        (void)answered();
        TEST_ASSERT_EQUAL_INT16(params.adaptation.rs_most, qm_hi(drive.run.adaptation.rs_q31));
    }
}

void test_a_speed_that_swings_is_asked_later(void)
{
    static const struct {
        uint16_t swing_steps, asked;
    } cases[] = { { 0, HELD_DOUBTS_MOST }, { 2u * SPEED_SWING_STEPS, HELD_DOUBTS_MOST }, { 2u * SPEED_SWING_STEPS + 1u, HELD_DOUBTS_SWINGS }, { 4u * SPEED_SWING_STEPS, HELD_DOUBTS_SWINGS } };
    EACH(n, cases) {
        at(1, FAST_ERPM, 1500, 0, 400);
        drive.run.control.swing_steps = cases[n].swing_steps;
        steps((uint16_t)(cases[n].asked - 1u));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(HELD_NOT, shaft->phase, golden_row(n));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(HELD_SETTLES, shaft->phase, golden_row(n));
    }
}

void test_of_a_back_emf_that_falls_slowly_the_frame_is_turned_back_by_the_last_steps_alone(void)
{
    int32_t lag = 0;
    at(1, FAST_ERPM, FAST_ERPM, 0, 1000);
    for (int16_t n = 1; n <= 20; n++) {
        lag += 10 - (lag >> HELD_LAG_SHIFT);
        rig_emf(0, (int16_t)(1000 - 10 * n));
        steps(1);
    }
    TEST_ASSERT_EQUAL_UINT16(HELD_NOT, shaft->phase);
    TEST_ASSERT_EQUAL_INT16((int16_t)lag, shaft->lag_q12);
    TEST_ASSERT_LESS_THAN_INT16(50, shaft->lag_q12);
}

void test_what_the_filter_alone_has_of_a_back_emf_is_not_forgotten_while_the_speed_follows(void)
{
    EACH_DIRECTION(direction) {
        static const struct {
            int16_t before_q12, after_q12, lag_q12; /* three steps after it */
        } cases[] = { { 900, 0, 900 }, { 900, -80, 980 }, { 1000, 199, 801 }, { 1000, 204, 336 }, { 0, 900, -380 } }; /* the last one speeds up */
        EACH(n, cases) {
            at(direction, FAST_ERPM, FAST_ERPM / 4 * 3, 0, cases[n].before_q12);
            rig_emf(0, (int16_t)(direction * cases[n].after_q12));
            steps(4);
            TEST_ASSERT_EQUAL_UINT16(0, shaft->doubted_steps);
            TEST_ASSERT_INT16_WITHIN(2, direction * cases[n].lag_q12, shaft->lag_q12);
        }
    }
}

void test_a_back_emf_against_the_direction_is_doubted_as_far_as_the_winding_may_have_less_resistance(void)
{
    const int16_t r_less = (int16_t)qm_mulhi(2 * 4000, (int16_t)-params.rs_off_least), most = (int16_t)(r_less + params.adaptation.emf_least_q12);
    EACH_DIRECTION(direction) {
        at(direction, FAST_ERPM, -1500, 0, (int16_t)(20 - most));
        steps(2);
        TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
        at(direction, FAST_ERPM, -1500, 0, (int16_t)(-20 - most));
        held_forget(shaft);
        steps(20);
        TEST_ASSERT_EQUAL_UINT16(HELD_NOT, shaft->phase);
    }
}

void test_a_back_emf_that_stands_by_chance_as_the_frame_is_turned_has_not_settled(void)
{
    asked(1, 40);
    steps(HELD_SETTLE_STEPS - 1u);
    TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
    rig_emf(0, (int16_t)(40 + params.adaptation.emf_least_q12)); /* now it moves */
    steps(1);
    TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
    steps(1);
    TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
}

void test_a_back_emf_that_falls_as_that_of_a_rotor_that_comes_to_its_stop_is_waited_for(void)
{
    const int16_t moves = params.adaptation.emf_least_q12;
    EACH_DIRECTION(direction) {
        for (uint16_t turns = 0; turns < 2u; turns++) { /* 1: it turns by two thirds of what it falls */
            uint16_t count = 0;
            asked(direction, 0);
            while (shaft->phase == (uint16_t)HELD_SETTLES && count < 3u * HELD_PATIENCE_STEPS) {
                const int16_t falls = (int16_t)((3 * (int16_t)HELD_PATIENCE_STEPS - (int16_t)count) * moves);
                rig_emf(turns ? (int16_t)(2 * (3 * (int16_t)HELD_PATIENCE_STEPS * moves - falls) / 3) : 0, (int16_t)(direction * falls));
                steps(1);
                count++;
            }
            TEST_ASSERT_EQUAL_UINT16(turns ? HELD_PATIENCE_STEPS + 1u : 3u * HELD_PATIENCE_STEPS, count);
            TEST_ASSERT_EQUAL_UINT16(turns ? HELD_TURNS : HELD_SETTLES, shaft->phase);
        }
    }
}

void test_a_back_emf_that_grows_ends_the_longer_patience(void)
{
    const int16_t grows = (int16_t)(params.adaptation.emf_least_q12 + 1);
    for (int16_t less = 0; less <= 1; less++) { /* 1: it grows no more than dead time shakes it */
        uint16_t count = 0;
        at(1, FAST_ERPM, 100, 0, 200);
        drive.run.control.ref_q13.d = (int16_t)(-(params.current_max_q13 >> HELD_FAR_SHIFT) - 1);
        steps(HELD_DOUBTS_MOST / HELD_DOUBTS_FAR + 1u);
        TEST_ASSERT_EQUAL_UINT16(2u * HELD_PATIENCE_STEPS, shaft->patience);
        while (shaft->phase == (uint16_t)HELD_SETTLES && count < 100u) {
            const dq_t emf = estimator_emf(&drive.run.estimator);
            rig_emf(0, (int16_t)(emf.q + grows - less));
            steps(1);
            count++;
        }
        TEST_ASSERT_EQUAL_UINT16(((less == 0) ? HELD_PATIENCE_STEPS : 2u * HELD_PATIENCE_STEPS) + 1u, count);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    }
}

void test_a_d_part_that_falls_to_zero_is_a_filter_s_tail_and_below_zero_the_rotor_s_turn(void)
{
    const int16_t tail = (int16_t)(params.adaptation.emf_least_q12 / 2);
    EACH_DIRECTION(direction) {
        for (uint16_t turns = 0; turns < 2u; turns++) {
            int16_t half;
            asked(direction, 400);
            half = (int16_t)(3.0F * 400.0F * (float)HELD_ASK_STEPS * counts_per_erpm() * 400.0F * (float)shaft->inv_kfi / 2048.0F / 65536.0F);
            TEST_ASSERT_GREATER_THAN_INT16(tail, half); /* it tells */
            rig_emf(tail, (int16_t)(direction * 400));
            steps(HELD_SETTLE_STEPS);
            TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
            steps(HELD_ASK_STEPS - 1u);
            rig_emf((int16_t)(-half + (turns ? -4 : tail / 2)), (int16_t)(direction * 400));
            steps(1);
            TEST_ASSERT_EQUAL_INT16(turns, shaft->phase == (uint16_t)HELD_TURNS);
        }
    }
}

void test_a_rotor_whose_back_emf_was_against_the_direction_has_not_turned_all_the_time(void)
{
    EACH_DIRECTION(direction) {
        angle_t stopped;
        asked(direction, -80); /* R is less than the model's */
        steps(HELD_SETTLE_STEPS);
        TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
        stopped = estimator_next_angle(&drive.run.estimator);
        rig_emf(0, (int16_t)(direction * (2 * params.adaptation.emf_least_q12 - 78))); /* at once it is let go */
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_EQUAL_UINT16(2, shaft->stood);
        TEST_ASSERT_GREATER_OR_EQUAL_INT16(0, (int16_t)(direction * (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - stopped)));
    }
}

void test_a_rotor_that_goes_on_turns_in_the_drive_s_direction(void)
{
    EACH_DIRECTION(direction) {
        stands(direction, 200);
        drive.run.estimator.sign = (int16_t)-direction; /* of a back-EMF around zero */
        steps(HELD_ASK_STEPS);
        rig_emf(-60, (int16_t)(direction * (params.adaptation.emf_least_q12 + 20)));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_EQUAL_INT16(direction, drive.run.estimator.sign);
        TEST_ASSERT_EQUAL_INT16(observer_speed(&drive.run.observer), estimator_speed(&drive.run.estimator));
        TEST_ASSERT_GREATER_THAN_INT16(0, (int16_t)(direction * estimator_speed(&drive.run.estimator)));
        estimator_follow(&drive.run.estimator, &params.estimator);
        TEST_ASSERT_EQUAL_INT16(direction, drive.run.estimator.sign);
    }
}

void test_while_the_d_current_of_field_weakening_goes_a_back_emf_gets_twice_the_patience(void)
{
    static const int16_t less_q13[] = { 0, 1 };
    EACH(n, less_q13) {
        const uint16_t patience = (n == 0u) ? 2u * HELD_PATIENCE_STEPS : HELD_PATIENCE_STEPS;
        at(1, FAST_ERPM, 100, 0, 0);
        drive.run.control.ref_q13.d = (int16_t)(-(params.current_max_q13 >> HELD_FAR_SHIFT) - 1 + less_q13[n]);
        steps(2);
        TEST_ASSERT_EQUAL_UINT16(patience, shaft->patience);
    }
}

void test_a_frame_that_is_turned_far_back_gives_a_back_emf_twice_the_patience(void)
{
    static const uint16_t patience[] = { HELD_PATIENCE_STEPS, 2u * HELD_PATIENCE_STEPS };
    EACH(n, patience) {
        at(1, FAST_ERPM, 100, 0, 0);
        shaft->inv_kfi = drive.run.model.inv_kfi;
        shaft->emf_sum_max_q12 = drive.run.model.emf_sum_max_q12;
        while (held_lead(&drive.run, &params, shaft->emf_q12.q) <= HELD_FAR_LEAD) { /* a step ago there was more */
            shaft->emf_q12.q++;
        }
        shaft->emf_q12.q = (int16_t)(shaft->emf_q12.q + 2 * (int16_t)n - 2);
        steps(2);
        TEST_ASSERT_EQUAL_UINT16(patience[n], shaft->patience);
    }
}

void test_weakened_is_the_field_for_the_reference_or_twice_the_speed_but_not_below_where_weakening_begins(void)
{
    const speed_erpm_t from = params.fieldweak.on_speed_erpm;
    static const struct {
        int16_t more_erpm, half_more_erpm, used_erpm; /* reference and used beyond where weakening begins, twice the speed, too */
    } cases[] = { { 6000, 6000, 6000 }, { 6000, 5998, 5998 }, { 6000, 2, 2 }, { 6000, 0, 0 }, { 6000, -4000, 0 }, { 0, -4000, 0 }, { -1000, -4000, -1000 } };
    EACH(n, cases) {
        const speed_erpm_t speed = (int16_t)((from + cases[n].half_more_erpm) / 2);
        TEST_ASSERT_EQUAL_INT16(from + cases[n].used_erpm, held_weakened_for(&params, (int16_t)(from + cases[n].more_erpm), speed));
    }
}

void test_field_weakening_follows_at_once_what_the_question_has_found(void)
{
    const speed_erpm_t reference = (int16_t)(params.fieldweak.on_speed_erpm + 6 * 1024);
    at(1, reference, 100, 0, 0);
    rig_slow(14);
    TEST_ASSERT_EQUAL_UINT16(6, drive.run.fieldweak.index);
    steps(2);
    (void)answered();
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.fieldweak.index); /* it stands */
    at(1, reference, 100, 0, 4000);
    rig_slow(14);
    shaft->phase = (uint16_t)HELD_ASKED;
    shaft->act = (uint16_t)HELD_HAS_TURNED;
    shaft->inv_kfi = drive.run.model.inv_kfi;
    shaft->emf_sum_max_q12 = drive.run.model.emf_sum_max_q12;
    held_act(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    TEST_ASSERT_GREATER_THAN_INT16(params.fieldweak.on_speed_erpm / 2 + 1024, observer_speed(&drive.run.observer));
    TEST_ASSERT_GREATER_THAN_UINT16(1, drive.run.fieldweak.index);
}

void test_a_back_emf_that_turns_as_a_rotor_would_lets_the_estimator_go_on_where_the_rotor_is(void)
{
    EACH_DIRECTION(direction) {
        angle_t stopped;
        float per_step;
        int16_t ahead;
        int32_t load_q16;
        float turned = 0.0F;
        sincos_t at_angle;
        uint16_t count = 0;
        at(direction, FAST_ERPM, 1500, 0, 220); /* so slow that its turn hides in the steps in which it settles */
        drive.run.observer.load_q16 = (int32_t)direction * 77 * 65536;
        load_q16 = drive.run.observer.load_q16;
        steps(HELD_DOUBTS_MOST);
        TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
        stopped = estimator_next_angle(&drive.run.estimator);
        per_step = 220.0F * counts_per_erpm() * (float)shaft->inv_kfi / 2048.0F;
        steps(HELD_SETTLE_STEPS);
        TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
        while (shaft->phase == (uint16_t)HELD_ASKED && count < 2u * HELD_ASK_STEPS) {
            count++;
            at_angle = trig_sincos((angle_t)((float)count * per_step));
            rig_emf(qm_mulhi(-440, at_angle.sin), (int16_t)(direction * qm_mulhi(440, at_angle.cos)));
            turned = rounded(direction, at_angle, 220.0F);
            steps(1);
        }
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_GREATER_OR_EQUAL_UINT16(HELD_ASK_STEPS, count);
        ahead = (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - stopped);
        TEST_ASSERT_INT16_WITHIN(50, (int16_t)((float)direction * ((float)count * per_step + turned + behind(220.0F))), ahead);
        TEST_ASSERT_INT16_WITHIN(10, (int16_t)((float)direction * 220.0F * (float)shaft->inv_kfi / 2048.0F), observer_speed(&drive.run.observer));
        TEST_ASSERT_EQUAL_INT16(0, estimator_emf(&drive.run.estimator).d);
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(direction * 220), estimator_emf(&drive.run.estimator).q);
        TEST_ASSERT_EQUAL_INT32(load_q16, drive.run.observer.load_q16);
        TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
        TEST_ASSERT_NOT_EQUAL(0, drive.run.model.inv_kfi);
    }
}

void test_a_back_emf_that_turns_by_less_than_half_of_what_it_says_or_by_what_dead_time_does_is_one_that_stands(void)
{
    static const int16_t emf_q12[] = { 280, 40 }; /* half of its turn in three steps is more than dead time's, and less */
    EACH(n, emf_q12) {
        const int16_t half = (int16_t)(3.14F * (float)emf_q12[n] * 3.0F * 16.0F * (float)emf_q12[n] * (float)drive.run.model.inv_kfi / 2048.0F / 60.0F
                                       * PARAM_F(LOOPTIME_SEC));
        const int16_t most = (n == 0u) ? half : params.adaptation.emf_least_q12;
        asked(1, emf_q12[n]);
        steps((uint16_t)(HELD_SETTLE_STEPS + 2u + ((n == 0u) ? 0u : 2u * HELD_ASK_STEPS))); /* settled, and two steps asked; of little after the filter's tail */
        rig_emf((int16_t)(-most + 8), emf_q12[n]);
        steps((n == 0u) ? 1u : HELD_ASK_STEPS);
        TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
        rig_emf((int16_t)(-2 * most), emf_q12[n]);
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    }
}

void test_a_back_emf_with_a_d_part_is_asked_for_as_long_as_the_speed_tells_that_both_parts_say(void)
{
    EACH_DIRECTION(direction) {
        uint16_t alone, with;
        asked(direction, 150);
        alone = answered();
        at(direction, FAST_ERPM, 100, 50, 150); /* Eq - Ed is 100 */
        steps(HELD_DOUBTS_MOST / HELD_DOUBTS_FAR + 1u);
        with = answered();
        TEST_ASSERT_GREATER_THAN_UINT16(alone + 2u, with);
        TEST_ASSERT_LESS_THAN_UINT16(HELD_SETTLE_STEPS + HELD_ASK_MOST_STEPS, with);
    }
}

void test_a_back_emf_whose_turn_dead_time_would_hide_is_asked_for_longer(void)
{
    static const struct {
        int16_t emf_q12;
        uint16_t steps;
    } cases[] = { { 400, HELD_ASK_STEPS }, { -400, HELD_ASK_STEPS }, { 40, HELD_ASK_MOST_STEPS }, { 0, HELD_ASK_MOST_STEPS }, { -40, HELD_ASK_STEPS } }; /* against the direction it is R i */
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            asked(direction, cases[n].emf_q12);
            TEST_ASSERT_EQUAL_UINT16(HELD_SETTLE_STEPS + cases[n].steps, answered());
        }
        asked(direction, 150); /* between: when half of its turn is more than dead time's */
        TEST_ASSERT_UINT16_WITHIN((HELD_ASK_MOST_STEPS - HELD_ASK_STEPS) / 2u - 2u, (HELD_ASK_MOST_STEPS + HELD_ASK_STEPS) / 2u, answered());
    }
}

void test_the_noise_of_one_step_does_not_add_up_to_a_turn_in_a_long_question(void)
{
    const int16_t dip_q12 = (int16_t)(params.adaptation.turned_q12 / (int16_t)(HELD_ASK_MOST_STEPS - 2u * HELD_ASK_STEPS) + 2); /* so far below the rest, each would count */
    TEST_ASSERT_EQUAL_UINT16(2u * HELD_ASK_STEPS, 1u << HELD_MEAN_SHIFT);
    EACH_DIRECTION(direction) {
        for (uint16_t step = HELD_SETTLE_STEPS; step < HELD_SETTLE_STEPS + HELD_ASK_MOST_STEPS; step++) {
            asked(direction, 60);
            steps((uint16_t)(step - 1u));
            rig_emf(0, (int16_t)(direction * (60 - dip_q12)));
            steps(1);
            rig_emf(0, (int16_t)(direction * 60));
            TEST_ASSERT_EQUAL_UINT16(HELD_SETTLE_STEPS + HELD_ASK_MOST_STEPS - step, answered());
            TEST_ASSERT_EQUAL_UINT16(1, shaft->stood);
        }
    }
}

void test_a_rotor_that_is_let_go_in_the_first_steps_of_a_question_is_found_before_it_is_compared_anew(void)
{
    const int16_t gains_q12 = (int16_t)(2 * params.adaptation.emf_least_q12 - 4); /* at once it may be noise */
    EACH_DIRECTION(direction) {
        uint16_t count = 0;
        asked(direction, 60);
        steps(HELD_SETTLE_STEPS + 2u);
        rig_emf(0, (int16_t)(direction * (60 + gains_q12)));
        while (shaft->phase == (uint16_t)HELD_ASKED) {
            steps(1);
            count++;
        }
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_EQUAL_UINT16(params.adaptation.turned_q12 / gains_q12 + 1, count);
        TEST_ASSERT_LESS_THAN_UINT16(2u * HELD_ASK_STEPS - 2u, count);
        TEST_ASSERT_EQUAL_UINT16(2, shaft->stood);
    }
}

void test_a_back_emf_that_turns_backwards_is_no_rotor_that_turns_forwards(void)
{
    const int16_t more = (int16_t)(params.adaptation.emf_least_q12 + 8); /* than dead time shakes it by */
    EACH_DIRECTION(direction) {
        asked(direction, 40);
        steps(HELD_SETTLE_STEPS + 2u * HELD_ASK_STEPS + 2u);
        rig_emf(more, (int16_t)(direction * 40));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
        rig_emf((int16_t)-more, (int16_t)(direction * 40));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    }
}

void test_a_back_emf_that_changes_before_the_fourth_step_of_a_question_had_turned_all_the_time_and_then_it_was_let_go(void)
{
    EACH_DIRECTION(direction) {
        for (uint16_t step = HELD_ASK_STEPS - 1u; step <= HELD_ASK_STEPS; step++) {
            asked(direction, 20);
            steps(HELD_SETTLE_STEPS + step - 1u);
            TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
            rig_emf(0, (int16_t)(direction * (20 + 3 * params.adaptation.emf_least_q12)));
            steps(1);
            TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
            TEST_ASSERT_EQUAL_UINT16((step < HELD_ASK_STEPS) ? 0 : 2, shaft->stood);
        }
    }
}

void test_a_back_emf_that_changes_late_in_a_long_question_turns_the_frame_by_what_it_gained_alone(void)
{
    const int16_t gains_q12 = (int16_t)(3 * params.adaptation.emf_least_q12);
    EACH_DIRECTION(direction) {
        angle_t stopped;
        asked(direction, 20);
        steps(HELD_SETTLE_STEPS + HELD_ASK_MOST_STEPS / 2u);
        TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
        stopped = estimator_next_angle(&drive.run.estimator);
        rig_emf(0, (int16_t)(direction * (20 + gains_q12)));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)((float)(direction * gains_q12) * (float)shaft->inv_kfi / 2048.0F * counts_per_erpm()),
                                 (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - stopped));
        TEST_ASSERT_GREATER_THAN_INT16(100, (int16_t)(direction * observer_speed(&drive.run.observer)));
    }
}

void test_a_back_emf_that_does_not_settle_is_a_rotor_that_turns(void)
{
    asked(1, 200);
    for (uint16_t n = 0; held_angle_stands(shaft) && n < 20u; n++) {
        rig_emf((n & 1u) ? 300 : -300, 200);
        steps(1);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(HELD_PATIENCE_STEPS, n);
    }
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    rig_speed(100);
    rig_emf(0, 10);
    steps(HELD_AGAIN_STEPS - 1u);
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase); /* not asked again at once */
    TEST_ASSERT_EQUAL_UINT16(HELD_AGAIN_STEPS - 1u, shaft->doubted_steps); /* but R i may turn the frame meanwhile */
    steps(3);
    TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
}

/* ---- it stands, and is let go ---- */

void test_while_the_rotor_stands_the_load_is_the_current_that_flows_and_nothing_else_is_learnt(void)
{
    stands(1, 200);
    steps(3);
    TEST_ASSERT_INT16_WITHIN(2, drive.run.control.ref_q13.q, observer_load(&drive.run.observer, &params.observer));
    TEST_ASSERT_EQUAL_INT16(0, observer_speed(&drive.run.observer));
    rig_slow(14); /* the model follows the reference */
    TEST_ASSERT_EQUAL_INT16(0, drive.run.model.inv_kfi);
    drive.run.adaptation.kfi_q31 = 0;
    rig_emf(3000, 3000);
    drive.run.observer.fast_share_q15 = 0;
    rig_slow(10); /* it would learn */
    TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.kfi_q31);
}

void test_a_rotor_that_stands_gets_the_d_current_of_a_probe_alone_and_the_probe_waits_for_the_answer(void)
{
    asked(1, 200);
    drive.run.fieldweak.table_q13 = -1000;
    drive.run.probe_id_q13 = 321;
    drive.run.probe_phase = (uint16_t)PROBE_TEST;
    drive.run.probe_steps = 3;
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(321, drive.run.control.ref_q13.d);
    protection_probe_rotor(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(PROBE_TEST, drive.run.probe_phase);
    TEST_ASSERT_EQUAL_UINT16(3, drive.run.probe_steps);
    TEST_ASSERT_EQUAL_INT16(321, drive.run.probe_id_q13);
    (void)answered();
    protection_probe_rotor(&drive, &params); /* it has the answer: all of the current is torque */
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, drive.run.probe_phase);
    TEST_ASSERT_LESS_THAN_INT16(321, drive.run.probe_id_q13);
    shaft->phase = (uint16_t)HELD_NOT;
    drive.run.probe_id_q13 = 0;
    drive.run.control.ref_q13.d = 0;
    drive.run.fieldweak.table_q13 = -1000;
    limits_current(&drive.run, &params);
    TEST_ASSERT_LESS_THAN_INT16(0, drive.run.control.ref_q13.d);
}

void test_the_observer_rests_while_the_angle_stands(void)
{
    stands(1, 0);
    drive.run.observer.omega_q16 = 0;
    drive.run.observer.rho_q32 = 12345;
    rig_slow(0);
    TEST_ASSERT_EQUAL_UINT32(12345, drive.run.observer.rho_q32);
}

/** It is asked, stands, and turns again. */
static void lets_go(int16_t direction)
{
    (void)answered();
    steps(HELD_ASK_STEPS);
    rig_emf(0, (int16_t)(direction * (params.adaptation.emf_least_q12 + 20)));
    steps(1);
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
}

void test_a_rotor_that_turns_again_takes_the_load_of_before_and_the_second_time_the_one_that_flows(void)
{
    EACH_DIRECTION(direction) {
        at(direction, FAST_ERPM, FAST_ERPM, 0, 3000);
        drive.run.observer.fast_share_q15 = 0;
        drive.run.observer.load_q16 = (int32_t)direction * 55 * 65536;
        steps(1); /* the load is remembered */
        drive.run.observer.fast_share_q15 = 32767;
        drive.run.observer.load_q16 = (int32_t)direction * 5000 * 65536;
        rig_speed((int16_t)(direction * 100));
        rig_emf(0, 0);
        shaft->emf_q12.q = 0;
        lets_go(direction);
        TEST_ASSERT_EQUAL_INT16((int16_t)(direction * 55), qm_hi(drive.run.observer.load_q16));
        TEST_ASSERT_GREATER_THAN_INT16(0, (int16_t)(direction * observer_speed(&drive.run.observer)));
        TEST_ASSERT_EQUAL_INT16(32767, drive.run.observer.fast_share_q15);
        rig_emf(0, 0); /* the load of before was too little */
        shaft->emf_q12.q = 0;
        lets_go(direction);
        TEST_ASSERT_INT16_WITHIN(2, drive.run.control.ref_q13.q, observer_load(&drive.run.observer, &params.observer));
    }
}

void test_a_rotor_that_turns_slowly_in_a_long_question_turns_again_after_ten_degrees_along_with_the_load_that_was_seen(void)
{
    const int16_t gains_q12 = (int16_t)(params.adaptation.emf_least_q12 / 2); /* what dead time may shake it by */
    EACH_DIRECTION(direction) {
        const uint16_t expected = (uint16_t)(params.adaptation.turned_q12 / gains_q12) + 1u;
        angle_t stopped;
        uint16_t count = 0;
        int16_t ahead;
        TEST_ASSERT_LESS_THAN_UINT16(HELD_ASK_MOST_STEPS - 2u * HELD_ASK_STEPS, expected);
        asked(direction, 20);
        shaft->load = 0;
        drive.run.observer.load_q16 = (int32_t)direction * 700 * 65536;
        steps(HELD_SETTLE_STEPS + 2u * HELD_ASK_STEPS);
        stopped = estimator_next_angle(&drive.run.estimator);
        rig_emf(0, (int16_t)(direction * (20 + gains_q12)));
        while (shaft->phase == (uint16_t)HELD_ASKED && count < 100u) {
            steps(1);
            count++;
        }
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_EQUAL_UINT16(expected, count);
        ahead = (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - stopped);
        TEST_ASSERT_INT16_WITHIN(3, (int16_t)(direction * angle_of((int16_t)count * gains_q12)), ahead);
        TEST_ASSERT_INT16_WITHIN(180, (int16_t)(direction * 1820), ahead); /* the flux is the header's */
        TEST_ASSERT_EQUAL_INT16((int16_t)(direction * 700), qm_hi(drive.run.observer.load_q16));
        asked(direction, (int16_t)(20 + gains_q12));
        steps(HELD_SETTLE_STEPS + 2u * HELD_ASK_STEPS);
        rig_emf(0, (int16_t)(direction * 20)); /* against the direction it does not go */
        (void)answered();
    }
}

void test_a_rotor_that_speeds_up_in_a_long_question_is_not_taken_for_one_that_stands_when_the_question_begins_anew(void)
{
    EACH_DIRECTION(direction) {
        float angle = 0.0F;
        asked(direction, 75);
        steps(HELD_SETTLE_STEPS);
        for (int16_t n = 1; shaft->phase == (uint16_t)HELD_ASKED && n < 40; n++) {
            const int16_t q_q12 = (int16_t)(75 + 10 * n); /* fast enough to tell after eight steps, and one more would say that it stands */
            angle += (n > (int16_t)(2u * HELD_ASK_STEPS)) ? (float)q_q12 * (float)shaft->inv_kfi / 2048.0F * counts_per_erpm() : 0.0F;
            rig_emf(qm_mulhi((int16_t)(-2 * q_q12), trig_sincos((angle_t)angle).sin), (int16_t)(direction * q_q12));
            steps(1);
        }
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
    }
}

void test_the_first_steps_turn_right_after_a_question_began_anew_may_be_dead_time_s(void)
{
    const int16_t more = (int16_t)(params.adaptation.emf_least_q12 + 8);
    asked(1, (int16_t)(more + 8)); /* else it would be one that is ahead */
    steps(HELD_SETTLE_STEPS + 2u * HELD_ASK_STEPS - 1u);
    rig_emf((int16_t)-more, (int16_t)(more + 8));
    steps(1); /* nor in the step in which it begins anew */
    TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
    asked(1, (int16_t)(more + 8));
    steps(HELD_SETTLE_STEPS + 2u * HELD_ASK_STEPS);
    rig_emf((int16_t)-more, (int16_t)(more + 8));
    steps(HELD_ASK_STEPS - 1u);
    TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
    steps(1);
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
}

void test_a_rotor_that_has_turned_all_the_time_is_where_its_back_emf_points_to_wherever_that_is(void)
{
    EACH_DIRECTION(direction) {
        for (int16_t degrees = -170; degrees <= 170; degrees = (int16_t)(degrees + 20)) {
            const sincos_t at_angle = trig_sincos((angle_t)(degrees * 182));
            const int16_t d_q12 = qm_mulhi(-1600, at_angle.sin), q_q12 = (int16_t)(direction * qm_mulhi(1600, at_angle.cos));
            angle_t stopped;
            asked(direction, 100);
            shaft->turned_q12 = 5000; /* of a question before */
            shaft->act = (uint16_t)HELD_HAS_TURNED;
            stopped = estimator_next_angle(&drive.run.estimator);
            rig_emf(d_q12, q_q12);
            held_act(&drive, &params);
            TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
            TEST_ASSERT_EQUAL_UINT16(0, shaft->stood);
            TEST_ASSERT_INT16_WITHIN(60, (int16_t)((float)direction * ((float)degrees * 182.0F + behind(800.0F))), (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - stopped));
            TEST_ASSERT_EQUAL_INT16(0, estimator_emf(&drive.run.estimator).d);
            TEST_ASSERT_INT16_WITHIN(3, (int16_t)(direction * 800), estimator_emf(&drive.run.estimator).q);
            TEST_ASSERT_INT16_WITHIN(40, (int16_t)((float)direction * 800.0F * (float)shaft->inv_kfi / 2048.0F), observer_speed(&drive.run.observer));
            TEST_ASSERT_EQUAL_INT16(shaft->inv_kfi, drive.run.model.inv_kfi);
            TEST_ASSERT_EQUAL_HEX32(drive.run.estimator.rho_q32, drive.run.observer.rho_q32);
            TEST_ASSERT_EQUAL_INT32(drive.run.estimator.omega_filtered_q16, drive.run.observer.omega_q16);
        }
    }
}

void test_a_back_emf_with_more_in_the_d_axis_than_in_q_is_a_rotor_that_is_ahead_but_for_one_that_stood_or_falls(void)
{
    const int16_t least = params.adaptation.emf_least_q12;
    const struct {
        int16_t d_q12, q_q12, fell_q12;
        uint16_t stood, turns;
    } cases[] = {
        { (int16_t)-(least + 1), 0, 0, 0, 1 }, { (int16_t)-least, 0, 0, 0, 0 },              /* dead time shakes it by as much */
        { -301, 300, 0, 0, 1 }, { -300, 300, 0, 0, 0 },                                        /* 45 degrees */
        { -300, -900, 0, 0, 1 },                                                               /* more than a quarter turn */
        { 301, 0, 0, 0, 0 },                                                                   /* behind */
        { -301, 0, 1, 0, 0 },                                                                 /* it comes to its stop */
        { -301, 0, 0, 1, 0 },                                                                  /* R is known, and the frame was right */
    };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            for (uint16_t settles = 0; settles < 2u; settles++) {
                asked(direction, 0);
                shaft->stood = cases[n].stood;
                shaft->phase = (uint16_t)(settles ? HELD_SETTLES : HELD_ASKED);
                shaft->steps = HELD_SETTLE_STEPS - 1u;
                rig_emf(cases[n].d_q12, (int16_t)(direction * cases[n].q_q12));
                shaft->emf_q12 = estimator_emf(&drive.run.estimator);
                held_step(&drive, &params);
                TEST_ASSERT_EQUAL_UINT16_MESSAGE(HELD_WAITS, shaft->act, golden_row(n)); /* the frame's turn may shake it */
                shaft->phase = (uint16_t)(settles ? HELD_SETTLES : HELD_ASKED);
                shaft->steps = HELD_SETTLE_STEPS;
                shaft->emf_q12.d = (int16_t)(cases[n].d_q12 - cases[n].fell_q12);
                held_step(&drive, &params);
                TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].turns ? HELD_HAS_TURNED : HELD_WAITS, shaft->act, golden_row(n));
            }
        }
    }
}

void test_a_back_emf_that_is_small_says_nothing_of_a_rotor_that_turns_on(void)
{
    const int16_t least = params.adaptation.emf_least_q12;
    for (int16_t more = 0; more < 2; more++) {
        asked(1, 0);
        shaft->steps = shaft->patience;
        rig_emf(least, (int16_t)(least + more));
        held_step(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16((more != 0) ? HELD_HAS_TURNED : HELD_WAITS, shaft->act);
    }
}

void test_late_in_a_question_only_a_back_emf_that_turned_by_what_it_said_had_turned_all_the_time(void)
{
    const int16_t more = (int16_t)(params.adaptation.emf_least_q12 + 8); /* than dead time shakes it by */
    uint16_t count;
    asked(1, (int16_t)(more + 8)); /* too little to tell: it turns, or was let go */
    steps(HELD_SETTLE_STEPS + 2u * HELD_ASK_STEPS);
    rig_emf((int16_t)-more, (int16_t)(more + 8));
    steps(HELD_ASK_STEPS - 1u);
    TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
    steps(1);
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    TEST_ASSERT_EQUAL_UINT16(2, shaft->stood);
    asked(1, 150); /* tells in this step */
    count = answered();
    TEST_ASSERT_GREATER_THAN_UINT16(1u + HELD_ASK_STEPS, count);
    asked(1, 150);
    steps((uint16_t)(count - 1u));
    TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
    rig_emf(0, (int16_t)(150 + 3 * params.adaptation.emf_least_q12));
    steps(1);
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    TEST_ASSERT_EQUAL_UINT16(2, shaft->stood);
}

void test_what_r_i_is_off_while_a_rotor_stands_for_long_turns_no_frame_when_it_is_let_go(void)
{
    const int16_t off_q12 = (int16_t)(params.adaptation.emf_least_q12 / 2);
    EACH_DIRECTION(direction) {
        angle_t stood;
        stands(direction, 0);
        drive.run.control.iq_limit_q13 = 32767;
        rig_emf(0, (int16_t)(direction * off_q12));
        steps(200);
        TEST_ASSERT_EQUAL_UINT16(HELD_STANDS, shaft->phase);
        stood = estimator_next_angle(&drive.run.estimator);
        rig_emf(0, (int16_t)(direction * (params.adaptation.emf_least_q12 + 1)));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(direction * angle_of(params.adaptation.emf_least_q12 + 1)),
                                 (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - stood));
    }
}

void test_the_tail_of_the_filter_is_no_turn_of_a_rotor(void)
{
    const int16_t gains_q12 = (int16_t)(params.adaptation.emf_least_q12 / 2);
    asked(1, 20);
    steps(HELD_SETTLE_STEPS + 1u);
    rig_emf((int16_t)-gains_q12, (int16_t)(20 + gains_q12));
    steps(2u * HELD_ASK_STEPS - 1u);
    TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
    TEST_ASSERT_EQUAL_INT16(20 + 7 * gains_q12 / 8, shaft->emf_q12.q); /* the mean: one of eight steps was of before */
    TEST_ASSERT_EQUAL_INT16(0, shaft->turned_q12);
    rig_emf((int16_t)(-2 * gains_q12 + 8), (int16_t)(20 + gains_q12));
    (void)answered();
}

/** How far the frame turns in so many steps, along the direction. */
static int16_t pulled(int16_t direction, uint16_t count)
{
    const angle_t before = estimator_next_angle(&drive.run.estimator);
    steps(count);
    return (int16_t)(direction * (int16_t)(angle_t)(estimator_next_angle(&drive.run.estimator) - before));
}

void test_all_of_the_current_pulls_a_rotor_that_stands_by_less_than_half_a_right_angle_ahead_and_back(void)
{
    EACH_DIRECTION(direction) {
        stands(direction, 0);
        drive.run.control.iq_limit_q13 = (int16_t)(qm_abs(drive.run.control.ref_q13.q) + 1);
        TEST_ASSERT_EQUAL_INT16(0, pulled(direction, 4));
        drive.run.control.iq_limit_q13 = qm_abs(drive.run.control.ref_q13.q);
        TEST_ASSERT_EQUAL_INT16(4 * HELD_PULL_ANGLE, pulled(direction, 4));
        TEST_ASSERT_INT16_WITHIN(HELD_PULL_ANGLE, (int16_t)(HELD_PULL_STEPS - 9u) * HELD_PULL_ANGLE, pulled(direction, HELD_PULL_STEPS - 9u));
        TEST_ASSERT_INT16_WITHIN(HELD_PULL_ANGLE, -(int16_t)HELD_PULL_STEPS * HELD_PULL_ANGLE, pulled(direction, 500));
        TEST_ASSERT_EQUAL_UINT16(HELD_STANDS, shaft->phase);
    }
}

void test_a_rotor_that_is_let_go_while_the_answer_waits_teaches_no_resistance(void)
{
    asked(1, 40);
    shaft->phase = (uint16_t)HELD_ASKED;
    shaft->act = (uint16_t)HELD_LEARN;
    rig_emf(0, (int16_t)(40 + params.adaptation.emf_least_q12 / 2 + 1));
    held_act(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase); /* and the question begins anew */
    TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
    shaft->phase = (uint16_t)HELD_ASKED;
    shaft->act = (uint16_t)HELD_LEARN;
    rig_emf(0, (int16_t)(40 + params.adaptation.emf_least_q12 / 2));
    held_act(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(HELD_STANDS, shaft->phase);
}

void test_a_rotor_whose_resistance_is_known_is_held_again_only_without_back_emf_until_it_is_fast(void)
{
    stands(1, 200);
    steps(HELD_ASK_STEPS);
    rig_emf(0, (int16_t)(params.adaptation.emf_least_q12 + 20));
    steps(1);
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    rig_speed(100);
    steps(50); /* slow, but it turns */
    TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    rig_emf(0, 10);
    steps(2);
    TEST_ASSERT_EQUAL_UINT16(HELD_SETTLES, shaft->phase);
    stands(1, 200);
    steps(HELD_ASK_STEPS);
    rig_emf(0, (int16_t)(params.adaptation.emf_least_q12 + 20));
    steps(1);
    rig_speed(FAST_ERPM / 2 + 10);
    steps(1);
    TEST_ASSERT_EQUAL_UINT16(HELD_NOT, shaft->phase);
    TEST_ASSERT_EQUAL_UINT16(0, shaft->stood);
}

void test_a_reversal_in_which_the_rotor_stands_begins_a_ramp_that_sees_the_rotor(void)
{
    EACH_DIRECTION(direction) {
        stands(direction, 200);
        drive.state = (uint16_t)DRIVE_STOPPING;
        drive.run.control.reference_erpm = 0;
        drive.command.run = 1;
        drive.command.target_erpm = (int16_t)(direction * -FAST_ERPM);
        rig_slow(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
        TEST_ASSERT_FALSE(held_angle_stands(shaft));
        rig_slow(14);
        TEST_ASSERT_NOT_EQUAL(0, drive.run.model.inv_kfi);
    }
}

void test_a_back_emf_that_moves_as_the_frame_has_been_turned_back_is_a_rotor_that_turns_only_if_it_moves_on(void)
{
    EACH_DIRECTION(direction) {
        stands(direction, 200);
        TEST_ASSERT_EQUAL_UINT16(1, shaft->steps);
        rig_emf(0, (int16_t)(direction * 2 * params.adaptation.emf_least_q12));
        steps(HELD_REST_STEPS - 1u);
        TEST_ASSERT_EQUAL_UINT16(HELD_STANDS, shaft->phase);
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    }
}

void test_a_back_emf_against_the_direction_that_comes_while_the_current_grows_is_resistance_that_is_less_and_one_at_once_is_a_rotor(void)
{
    EACH_DIRECTION(direction) {
        const int16_t against_q12 = (int16_t)(-direction * (params.adaptation.emf_least_q12 + 20));
        int16_t known;
        stands(direction, 200);
        known = qm_hi(drive.run.adaptation.rs_q31);
        steps(HELD_REST_STEPS + HELD_ASK_STEPS - 1u);
        rig_emf(0, against_q12);
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_STANDS, shaft->phase);
        TEST_ASSERT_LESS_THAN_INT16(known, qm_hi(drive.run.adaptation.rs_q31));
        TEST_ASSERT_EQUAL_INT16(0, estimator_emf(&drive.run.estimator).d);
        TEST_ASSERT_EQUAL_INT16(0, estimator_emf(&drive.run.estimator).q);
        steps(HELD_REST_STEPS + HELD_ASK_STEPS - 1u);
        rig_emf(0, against_q12);
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
    }
}

void test_a_back_emf_that_fell_in_a_question_is_asked_for_again_and_then_stands(void)
{
    const int16_t fallen_q12 = (int16_t)(400 - params.adaptation.emf_least_q12); /* too far to have stood, too little to have turned */
    EACH_DIRECTION(direction) {
        asked(direction, 400);
        steps(2);
        TEST_ASSERT_EQUAL_UINT16(HELD_ASKED, shaft->phase);
        rig_emf(0, (int16_t)(direction * fallen_q12));
        for (uint16_t n = 0; shaft->phase != (uint16_t)HELD_STANDS && n < 40u; n++) {
            steps(1);
        }
        TEST_ASSERT_EQUAL_UINT16(HELD_STANDS, shaft->phase);
        TEST_ASSERT_NOT_EQUAL(0, drive.run.adaptation.rs_q31);
    }
}

void test_the_speed_of_a_rotor_that_is_let_go_is_limited_by_the_flux_of_when_the_angle_stopped(void)
{
    EACH_DIRECTION(direction) {
        stands(direction, 200);
        steps(HELD_ASK_STEPS);
        shaft->inv_kfi = 32767; /* in field weakening; the model has left it since */
        shaft->emf_sum_max_q12 = 2000;
        drive.run.model.emf_sum_max_q12 = 32767;
        rig_emf(0, (int16_t)(direction * 2500));
        steps(1);
        TEST_ASSERT_EQUAL_UINT16(HELD_TURNS, shaft->phase);
        TEST_ASSERT_GREATER_THAN_INT16(31900, (int16_t)(direction * observer_speed(&drive.run.observer)));
        TEST_ASSERT_LESS_THAN_INT16(32100, (int16_t)(direction * observer_speed(&drive.run.observer)));
    }
}

void test_a_step_comes_in_slots_5_and_13_and_what_follows_in_slots_1_and_9_of_closed_loop(void)
{
    uint16_t part, before;
    at(1, FAST_ERPM, FAST_ERPM, 0, 3000);
    for (part = 0; part < SLOW_PARTS; part++) {
        before = shaft->steps;
        rig_slow(part);
        TEST_ASSERT_EQUAL_UINT16(before + (((part & 7u) == 5u) ? 1u : 0u), shaft->steps);
    }
    for (uint16_t stops = 0; stops < 2u; stops++) {
        for (part = 0; part < SLOW_PARTS; part++) {
            asked(1, 0);
            drive.state = (uint16_t)(stops ? DRIVE_STOPPING : DRIVE_CLOSED);
            shaft->act = (uint16_t)HELD_HAS_TURNED;
            rig_slow(part);
            TEST_ASSERT_EQUAL_UINT16(((part & 7u) == 1u) ? HELD_WAITS : HELD_HAS_TURNED, shaft->act);
        }
    }
    rig_lock(1);
    for (part = 0; part < SLOW_PARTS; part++) {
        rig_slow(part);
    }
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.held.steps);
}
