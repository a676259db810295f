/* The hand-over: when the estimator is ready, vectors that keep their place in the stator, controllers that go on, and the decay. */
#include "drive_rig.h"
#include "golden_hand_over.h"

#define FORCED_ERPM 4998 /* the forced angle's 5000 at the end of the ramp, as the drive counts them */

/** As at the end of the ramp: the forced speed has arrived and the test sets the estimate. */
static void at_the_end_of_the_ramp(int16_t direction)
{
    rig_lock(direction);
    drive.state = (uint16_t)DRIVE_RAMP;
    drive.periods = 0;
    drive.forced.speed_q10 = params.forced.end_speed_q10;
    drive.run.control.ref_q13.q = (int16_t)(direction * params.open_loop_q13);
    drive.command.target_erpm = (int16_t)(direction * 6000); /* the part that hands over looks at it too */
    rig_speed((int16_t)(direction * 4800));
}

void setUp(void)
{
    rig_power_up();
    at_the_end_of_the_ramp(1);
}

/* ---- readiness ---- */

/** The forced angle ahead of the estimated one by this: at 90 degrees the current has no torque. */
static void forced_ahead(int16_t offset)
{
    drive.run.estimator.next = 0;
    drive.angle = (angle_t)offset;
}

/** Slow steps of the readiness check with this estimated speed, until the state changes. The current pulls the rotor. */
static uint16_t ready_steps(int16_t speed_erpm, uint16_t most)
{
    uint16_t steps = 0;
    while (drive.state == (uint16_t)DRIVE_RAMP && steps < most) {
        rig_speed(speed_erpm);
        forced_ahead(0x2000);
        rig_slow(0);
        rig_slow(1); /* the next part carries it out */
        steps++;
    }
    return steps;
}

void test_estimate_within_a_quarter_of_the_forced_speed_for_20_ms_is_ready_and_no_other(void)
{
    enum { READY = 50, NEVER = 500 }; /* 20 ms, 200 ms */
    static const struct {
        int16_t direction, speed_erpm;
        uint16_t steps;
    } cases[] = {
        { 1, FORCED_ERPM - 1248, READY }, { 1, FORCED_ERPM + 1248, READY }, { -1, -FORCED_ERPM - 1248, READY }, { -1, -FORCED_ERPM + 1248, READY },
        { 1, FORCED_ERPM - 1249, NEVER }, { 1, FORCED_ERPM + 1249, NEVER }, { 1, -FORCED_ERPM, NEVER }, { -1, FORCED_ERPM, NEVER }, { 1, 0, NEVER },
    };
    EACH(n, cases) {
        rig_power_up();
        at_the_end_of_the_ramp(cases[n].direction);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].steps, ready_steps(cases[n].speed_erpm, 1000), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((cases[n].steps == (uint16_t)READY) ? DRIVE_CLOSED : DRIVE_FAULT, drive.state, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((cases[n].steps == (uint16_t)READY) ? FAULT_NONE : FAULT_START_FAILED, drive.fault, golden_row(n));
    }
}

/** Forced speed along the direction, electrical rpm. */
static void force(float erpm)
{
    drive.forced.speed_q10 = (int32_t)(erpm * 67108864.0F / 60.0F * PARAM_F(LOOPTIME_SEC));
}

void test_agreement_counts_from_the_early_speed_on_and_waiting_at_the_end_of_the_ramp_only(void)
{
    static const struct {
        float forced_erpm;
        uint16_t counts;
    } cases[] = { { -3200.0F, 0 }, { 0.0F, 0 }, { 3120.0F, 0 }, { 3132.0F, 1 }, { 4000.0F, 1 }, { 4990.0F, 1 } };
    TEST_ASSERT_EQUAL_INT16(3125, params.early_erpm); /* 1.25 times the minimum speed, which is more than 20 Hz */
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            uint16_t steps;
            at_the_end_of_the_ramp(direction);
            rig_agreed(0);
            drive.periods = (uint16_t)(cases[n].counts ? 3990 : 0); /* waited at an end that lies behind */
            for (steps = 1; steps <= 600u; steps++) {
                force(cases[n].forced_erpm);
                rig_speed((int16_t)((float)direction * cases[n].forced_erpm));
                forced_ahead(0x3800); /* not due: the drive goes on counting */
                rig_slow(0);
                TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].counts * steps, drive.run.handover.agreed_steps, golden_row(n));
                TEST_ASSERT_EQUAL_UINT16_MESSAGE(0, drive.periods, golden_row(n));
            }
            EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, golden_row(n));
        }
    }
}

void test_rotor_may_swing_by_half_the_speed_once_the_estimator_has_agreed(void)
{
    static const struct {
        int16_t before, speed_erpm;
        uint16_t after;
    } cases[] = { { 49, FORCED_ERPM - 1249, 0 }, { 50, FORCED_ERPM - 1249, 51 }, { 50, FORCED_ERPM - 2498, 51 }, { 50, FORCED_ERPM + 2498, 51 },
                  { 50, FORCED_ERPM - 2499, 0 }, { 50, FORCED_ERPM + 2499, 0 } };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            at_the_end_of_the_ramp(direction);
            rig_agreed((uint16_t)cases[n].before);
            rig_speed((int16_t)(direction * cases[n].speed_erpm));
            rig_slow(0);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].after, drive.run.handover.agreed_steps, golden_row(n));
        }
    }
}

void test_speed_that_is_off_in_the_mean_by_an_eighth_is_waited_for_until_the_ramp_s_end(void)
{
    static const struct {
        int16_t off_erpm, swing_erpm;
        uint16_t agrees;
    } cases[] = { { 440, 0, 1 }, { -440, 0, 1 }, { 560, 0, 0 }, { -560, 0, 0 }, { 0, 950, 1 }, { 440, 1010, 0 }, { -440, 1010, 0 } };
    EACH(n, cases) {
        uint16_t steps, most = 0;
        at_the_end_of_the_ramp(1);
        for (steps = 0; steps < 400u; steps++) {
            int16_t swing = (int16_t)(((steps & 16u) != 0u) ? cases[n].swing_erpm : -cases[n].swing_erpm);
            int16_t forced = (int16_t)((steps < 200u) ? 3100 : 4000); /* before and after the speed from which it counts */
            force((float)forced);
            rig_speed((int16_t)(forced + cases[n].off_erpm + swing));
            forced_ahead(0x3800);
            rig_slow(0);
            most = (drive.run.handover.agreed_steps > most) ? drive.run.handover.agreed_steps : most;
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].agrees, most >= params.agree_steps, golden_row(n));
    }
}

void test_mean_deviation_takes_a_32nd_of_it_a_step_and_of_16383_at_most_with_its_sign(void)
{
    static const struct {
        float forced_erpm;
        int16_t seen_erpm, mean_erpm;
    } cases[] = { { 4800.0F, 8000, 100 }, { 4800.0F, 1600, -100 }, { 20000.0F, -20000, -512 }, { -20000.0F, 20000, 511 } };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            at_the_end_of_the_ramp(direction);
            drive.run.handover.ahead_erpm = 0;
            force(cases[n].forced_erpm);
            rig_speed((int16_t)(direction * cases[n].seen_erpm));
            rig_slow(0);
            TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].mean_erpm, drive.run.handover.ahead_erpm, golden_row(n));
        }
    }
}

void test_end_of_the_ramp_counts_also_below_the_early_speed(void)
{
    drive_params_t p = params;
    p.early_erpm = FORCED_ERPM + 1;
    rig_agreed(0);
    rig_speed(FORCED_ERPM);
    handover_wait(&drive, &p);
    TEST_ASSERT_EQUAL_UINT16(1, drive.run.handover.agreed_steps);
    TEST_ASSERT_EQUAL_UINT16(SLOW_PERIODS, drive.periods);
}

void test_rest_of_the_ramp_is_three_times_as_quick_where_the_estimator_does_not_agree_in_time(void)
{
    static const struct {
        float forced_erpm;
        int16_t seen_erpm;
        int16_t increase_q10;
    } cases[] = { { 4680.0F, 0, 10 }, { 4710.0F, 0, 30 }, { 4710.0F, 4700, 30 } };
    EACH(n, cases) {
        at_the_end_of_the_ramp(1);
        force(cases[n].forced_erpm);
        rig_speed(cases[n].seen_erpm);
        rig_slow(0);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].increase_q10, drive.forced.increase_q10, golden_row(n));
    }
    at_the_end_of_the_ramp(1);
    rig_agreed(params.agree_steps);
    force(4710.0F);
    rig_speed(4700);
    rig_slow(0);
    TEST_ASSERT_EQUAL_INT16(0, drive.forced.increase_q10); /* it waits for the hand-over */
}

/** The hand-over at this forced and this estimated speed, where the current pulls the rotor. */
static void begin_closed_loop(float forced_erpm, int16_t speed_erpm)
{
    rig_agreed(params.agree_steps);
    force(forced_erpm);
    rig_speed(speed_erpm);
    forced_ahead(0);
    rig_slow(0);
    rig_slow(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_closed_loop_begins_with_the_faster_one_of_forced_and_estimated_speed(void)
{
    EACH_DIRECTION(direction) {
        at_the_end_of_the_ramp(direction);
        begin_closed_loop(4500.0F, (int16_t)(direction * 4300));
        TEST_ASSERT_INT16_WITHIN(8, (int16_t)(direction * 4496), drive.run.control.reference_erpm);
        at_the_end_of_the_ramp(direction);
        begin_closed_loop(4500.0F, (int16_t)(direction * 4800));
        TEST_ASSERT_EQUAL_INT16(direction * 4800, drive.run.control.reference_erpm);
    }
}

void test_agreement_must_be_without_a_gap(void)
{
    TEST_ASSERT_EQUAL_UINT16(49, ready_steps(5000, 49));
    TEST_ASSERT_EQUAL_UINT16(1, ready_steps(0, 1));
    TEST_ASSERT_EQUAL_UINT16(49, ready_steps(5000, 49));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
    TEST_ASSERT_EQUAL_UINT16(1, ready_steps(5000, 1));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    at_the_end_of_the_ramp(1);
    TEST_ASSERT_EQUAL_UINT16(450, ready_steps(0, 450));
    TEST_ASSERT_EQUAL_UINT16(50, ready_steps(5000, 1000)); /* the last moment */
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_rotor_that_never_comes_to_where_the_current_pulls_it_is_START_FAILED(void)
{
    EACH_DIRECTION(direction) {
        uint16_t steps;
        rig_power_up();
        at_the_end_of_the_ramp(direction);
        for (steps = 0; drive.state == (uint16_t)DRIVE_RAMP && steps < 6000u; steps++) {
            force(4000.0F);
            rig_speed((int16_t)(direction * 3800)); /* agrees, and slower than the current turns */
            forced_ahead((int16_t)(direction * 0x3800));
            rig_slow(0);
            rig_slow(1);
        }
        TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
        TEST_ASSERT_EQUAL_UINT16(FAULT_START_FAILED, drive.fault);
        TEST_ASSERT_EQUAL_UINT16(4050, steps); /* 20 ms of agreement and 1.6 s */
    }
}

void test_rotor_that_comes_in_the_last_step_is_handed_over(void)
{
    static const struct {
        int16_t offset;
        drive_state_t state;
    } cases[] = { { 0x2000, DRIVE_CLOSED }, { 0x3800, DRIVE_FAULT } };
    EACH(n, cases) {
        rig_power_up();
        at_the_end_of_the_ramp(1);
        rig_agreed((uint16_t)(params.agree_steps + HANDOVER_MOST_STEPS(&params) - 1u));
        force(4000.0F);
        rig_speed(3800);
        forced_ahead(cases[n].offset);
        rig_slow(0);
        rig_slow(1);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].state, drive.state, golden_row(n));
    }
}

/** The slow work of a period, where it is due. */
static void period(uint16_t ticks)
{
    drive.ticks = ticks;
    if (drive_slow_follows(&drive)) {
        (void)drive_slow(&drive, &params, &samples);
    }
}

void test_readiness_is_looked_at_every_eighth_period_and_acted_on_two_periods_later_only(void)
{
    uint16_t n;
    rig_agreed((uint16_t)(params.agree_steps - 1u));
    forced_ahead(0);
    for (n = 1; n <= 8u; n++) {
        period(n);
        TEST_ASSERT_EQUAL_UINT16(params.agree_steps - (n < 8u), drive.run.handover.agreed_steps);
        TEST_ASSERT_EQUAL_UINT16((n == 8u) ? 8 : 0, drive.periods);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state); /* both in one period would miss the deadline */
    }
    for (n = 8; n <= 18u; n++) {
        if (n != 10u) {
            period(n);
            TEST_ASSERT_EQUAL_UINT16((n == 18u) ? DRIVE_CLOSED : DRIVE_RAMP, drive.state);
        }
    }
}

void test_fault_or_stop_before_its_own_period_keeps_the_hand_over_from_happening(void)
{
    static const drive_state_t states[] = { DRIVE_STOPPED, DRIVE_FAULT, DRIVE_ALIGN };
    rig_agreed(params.agree_steps);
    EACH(n, states) {
        drive.state = (uint16_t)states[n];
        drive.fault = (uint16_t)((states[n] == DRIVE_FAULT) ? FAULT_STALL : FAULT_NONE);
        drive.command.run = (states[n] == DRIVE_ALIGN);
        rig_slow(1);
        TEST_ASSERT_EQUAL_UINT16(states[n], drive.state);
    }
}

/* ---- the phases of a start ---- */

void test_a_start_goes_through_its_phases_in_their_order_and_back_when_the_agreement_ends(void)
{
    handover_t *h = &drive.run.handover;
    rig_lock(1);
    TEST_ASSERT_EQUAL_UINT16(START_ALIGN, h->phase);
    (void)rig_tick_until(DRIVE_RAMP, (uint16_t)(params.align_periods + 8u));
    TEST_ASSERT_EQUAL_UINT16(START_RAMP, h->phase);
    at_the_end_of_the_ramp(1);
    handover_enter(h, START_RAMP);
    force(3000.0F);
    rig_speed(3000);
    rig_slow(0);
    TEST_ASSERT_EQUAL_UINT16(START_RAMP, h->phase); /* too slow to be asked */
    force(4000.0F);
    rig_speed(4000);
    forced_ahead(0x3800);
    for (uint16_t steps = 1; steps <= params.agree_steps; steps++) {
        rig_slow(0);
        TEST_ASSERT_EQUAL_UINT16((steps < params.agree_steps) ? START_AGREE : START_RELEASE, h->phase);
        rig_slow(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
    }
    rig_speed(0);
    rig_slow(0);
    TEST_ASSERT_EQUAL_UINT16(START_AGREE, h->phase);
    rig_agreed(params.agree_steps);
    h->ahead_erpm = 0;
    rig_speed(4000);
    forced_ahead(0);
    rig_slow(0);
    TEST_ASSERT_EQUAL_UINT16(START_HAND_OVER, h->phase);
    rig_slow(1);
    TEST_ASSERT_EQUAL_UINT16(START_OBSERVE, h->phase);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    handover_observe(&drive.run, &params);
    TEST_ASSERT_EQUAL_UINT16(START_DONE, h->phase);
}

/* ---- the fall of the ramp's current ---- */

/** Periods of RAMP from the moment the estimator agrees, with this angle between forced and estimated frame; the current at the end. */
static uint16_t fall(int16_t direction, int16_t offset, int16_t *current_q13)
{
    uint16_t steps = 0;
    rig_power_up();
    at_the_end_of_the_ramp(direction);
    rig_agreed((uint16_t)(params.agree_steps - 1u));
    while (drive.state == (uint16_t)DRIVE_RAMP && steps < 1000u) {
        rig_speed((int16_t)(direction * 5000));
        forced_ahead(offset);
        *current_q13 = (int16_t)(direction * drive.run.control.ref_q13.q);
        rig_slow(0);
        rig_slow(1);
        steps++;
    }
    return steps;
}

/* 1/128 + 1/256 a step, and a count: an eighth is left after 177 */
void test_current_falls_until_it_pulls_the_rotor_or_is_an_eighth(void)
{
    static const struct {
        int16_t offset;
        uint16_t steps, current_q13;
    } cases[] = { { 0x2000, 1, 2625 }, { -0x2000, 1, 2625 }, { 0, 1, 2625 }, { 0x2001, 178, 328 }, { -0x2001, 178, 328 }, { 0x3FFF, 178, 328 } };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            int16_t current_q13 = 0;
            TEST_ASSERT_UINT16_WITHIN_MESSAGE(2, cases[n].steps, fall(direction, cases[n].offset, &current_q13), golden_row(n));
            TEST_ASSERT_INT16_WITHIN_MESSAGE(8, (int16_t)cases[n].current_q13, current_q13, golden_row(n));
        }
    }
}

void test_rotor_that_falls_back_is_handed_over_with_the_current_that_is_left(void)
{
    uint16_t n;
    rig_agreed(params.agree_steps);
    for (n = 0; n < 80u; n++) {
        rig_speed(5000);
        forced_ahead(0x3800);
        rig_slow(0);
        rig_slow(1);
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
    TEST_ASSERT_INT16_WITHIN(20, 1021, drive.run.control.ref_q13.q); /* 2625 (253/256)^80, and a count a step */
    forced_ahead(0x1800);
    rig_slow(0);
    rig_slow(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_INT16_WITHIN(20, 1008, drive.run.handover.current_q13); /* a step later */
    TEST_ASSERT_INT16_WITHIN(20, (int16_t)(1008 * 0.831F), drive.run.control.ref_q13.q); /* cos 33.75 degrees */
}

void test_rotor_that_still_swings_back_at_the_floor_is_waited_for(void)
{
    static const struct {
        int16_t offset, speed_erpm;
        drive_state_t state;
    } cases[] = { { 0x3000, 4841, DRIVE_RAMP }, { 0x3000, 4842, DRIVE_CLOSED }, { -0x3000, 4841, DRIVE_RAMP }, { -0x3000, 4842, DRIVE_CLOSED }, { 0x2000, 4000, DRIVE_CLOSED } };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            at_the_end_of_the_ramp(direction);
            rig_agreed(params.agree_steps);
            drive.run.control.ref_q13.q = (int16_t)(direction * (params.open_loop_q13 >> 3));
            rig_speed((int16_t)(direction * cases[n].speed_erpm));
            forced_ahead(cases[n].offset);
            rig_slow(0);
            rig_slow(1);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].state, drive.state, golden_row(n));
        }
    }
}

void test_current_is_whole_again_when_the_agreement_ends(void)
{
    EACH_DIRECTION(direction) {
        int16_t current_q13;
        (void)fall(direction, 0x3000, &current_q13);
        at_the_end_of_the_ramp(direction);
        drive.run.control.ref_q13.q = (int16_t)(direction * 500);
        rig_agreed(params.agree_steps);
        rig_speed(0);
        rig_slow(0);
        TEST_ASSERT_EQUAL_INT16(direction * params.open_loop_q13, drive.run.control.ref_q13.q);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
    }
}

/* ---- the change of frame ---- */

/** @param forced,estimated angles @param v_d,v_q voltages in the forced frame */
static void hand_over(angle_t forced, angle_t estimated, int16_t v_d, int16_t v_q, int16_t direction)
{
    drive.direction = direction;
    drive.state = (uint16_t)DRIVE_RAMP;
    drive.angle = forced;
    drive.run.estimator.rho_q32 = (uint32_t)estimated << 16;
    drive.run.estimator.next = estimated;
    rig_speed((int16_t)(direction * 4800));
    drive.run.control.reference_erpm = (int16_t)(direction * FORCED_ERPM); /* as handover_wait() leaves it */
    drive.run.control.ref_q13.q = (int16_t)(direction * params.open_loop_q13);
    drive.run.control.v_q14.d = v_d;
    drive.run.control.v_q14.q = v_q;
    drive.run.handover.phase = (uint16_t)START_OBSERVE; /* as the start has left it */
    handover_now(&drive, &params);
    handover_observe(&drive.run, &params);
}

/** q current that keeps the observed speed. */
static int16_t held_current(void)
{
    drive.run.control.iq_limit_q13 = 5120;
    return speed_current(&drive.run, &params, observer_speed(&drive.run.observer));
}

void test_vectors_equal_the_reference_and_controllers_and_observer_go_on_from_them(void)
{
    GOLDEN_EACH(hand_over, v) {
        drive_control_t *c = &drive.run.control;
        int16_t direction = (int16_t)((v.i_q > 0) ? 1 : -1);
        hand_over(v.forced, v.estimated, v.v_d, v.v_q, direction);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(DRIVE_CLOSED, drive.state, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.offset, drive.run.handover.offset, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_v_d, c->v_q14.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_v_q, c->v_q14.q, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_i_d, c->ref_q13.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_i_q, c->ref_q13.q, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_i_d, drive.run.handover.id_q13, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(direction * FORCED_ERPM, c->reference_erpm, golden_row(n));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1, v.new_v_d, pi_tick(&c->pi_d, &params.pi_d, 0, 32767), golden_row(n));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1, v.new_v_q, pi_tick(&c->pi_q, &params.pi_q, 0, 32767), golden_row(n));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(2, v.new_i_q, held_current(), golden_row(n)); /* a unit of load */
        TEST_ASSERT_EQUAL_INT16_MESSAGE(direction * 4800, observer_speed(&drive.run.observer), golden_row(n));
        TEST_ASSERT_EQUAL_HEX32_MESSAGE((uint32_t)v.estimated << 16, drive.run.observer.rho_q32, golden_row(n));
    }
}

void test_estimated_angle_of_the_next_sample_takes_over_with_its_frame(void)
{
    sincos_t frame;
    drive.angle = 20000;
    drive.run.estimator.next = 16000;
    handover_now(&drive, &params);
    frame = trig_sincos(drive.angle);
    TEST_ASSERT_UINT16_WITHIN(1, 16000, drive.angle);
    TEST_ASSERT_EQUAL_HEX16(estimator_next_angle(&drive.run.estimator), drive.angle);
    TEST_ASSERT_INT16_WITHIN(1, 4000, drive.run.handover.offset);
    TEST_ASSERT_EQUAL_INT16(frame.sin, drive.frame.sin);
    TEST_ASSERT_EQUAL_INT16(frame.cos, drive.frame.cos);
}

void test_period_after_the_hand_over_has_the_dead_time_of_the_new_frame(void)
{
    EACH_DIRECTION(direction) {
        dq_t asked;
        dead_duties_t expected;
        at_the_end_of_the_ramp(direction);
        rig_agreed(params.agree_steps);
        drive.run.handover.phase = (uint16_t)START_HAND_OVER;
        drive.dead = (dead_duties_t){ 0, 0, 0 };
        drive.angle = 0x1000;
        drive.run.estimator.next = 0x3000;
        drive.run.estimator.half_step_q16_rad = (int16_t)(direction * 800);
        rig_slow(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
        asked = dq_turn(drive.run.control.ref_q13, (int16_t)(direction * 3 * 800));
        svm_compensation(&params.svm, phases_of(asked, trig_sincos(0x3000)), &expected);
        TEST_ASSERT_EQUAL_INT16(expected.a, drive.dead.a);
        TEST_ASSERT_EQUAL_INT16(expected.b, drive.dead.b);
        TEST_ASSERT_EQUAL_INT16(expected.c, drive.dead.c);
        TEST_ASSERT_TRUE(drive.dead.a != 0 || drive.dead.b != 0);
    }
}

void test_observer_is_preset_once_and_before_the_first_step_of_the_speed_controller(void)
{
    int16_t held_q13;
    handover_now(&drive, &params);
    drive.run.observer.omega_q16 = 12345;
    for (uint16_t part = 1; part < SLOW_PARTS / SLOW_ROUND_STEPS; part++) {
        rig_slow(part);
        TEST_ASSERT_EQUAL_INT32(12345, drive.run.observer.omega_q16);
    }
    held_q13 = drive.run.control.ref_q13.q;
    rig_slow(0);
    TEST_ASSERT_EQUAL_INT32(4800L * 65536, drive.run.observer.omega_q16);
    TEST_ASSERT_INT16_WITHIN(2, held_q13, held_current()); /* what the speed controller of this very part begins with */
    rig_speed(3000); /* the estimator and the observer: from here on the observer only follows the angle, which stands */
    rig_slow(0);
    TEST_ASSERT_LESS_THAN_INT32(3000L * 65536, drive.run.observer.omega_q16);
    TEST_ASSERT_GREATER_THAN_INT32(0, drive.run.observer.omega_q16);
}

void test_observer_steps_by_the_estimators_angle_and_the_measured_q_current(void)
{
    observer_t expected;
    handover_now(&drive, &params);
    rig_slow(0);
    speed_schedule(&drive.run, &params);
    expected = drive.run.observer;
    drive.run.estimator.rho_q32 += 0x0B000000ul; /* 48 degrees: faster than the 42 of 4800 erpm in 8 periods */
    drive.run.control.i_q13.q = 700;
    observer_step(&expected, &params.observer, drive.run.estimator.rho_q32, 700);
    rig_slow(0);
    TEST_ASSERT_EQUAL_INT32(expected.omega_q16, drive.run.observer.omega_q16);
    TEST_ASSERT_EQUAL_INT32(expected.load_q16, drive.run.observer.load_q16);
    TEST_ASSERT_GREATER_THAN_INT16(4800, observer_speed(&drive.run.observer));
}

void test_stop_right_after_the_hand_over_goes_on_from_its_q_current_too(void)
{
    EACH_DIRECTION(direction) {
        int16_t held_q13;
        at_the_end_of_the_ramp(direction);
        handover_now(&drive, &params);
        drive.state = (uint16_t)DRIVE_STOPPING; /* the very next period */
        held_q13 = drive.run.control.ref_q13.q;
        rig_slow(0);
        TEST_ASSERT_INT16_WITHIN(2, held_q13, held_current());
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
    }
}

/* ---- the decay ---- */

void test_offset_decays_by_a_count_a_period_from_both_signs_and_ends_at_zero(void)
{
    EACH_DIRECTION(sign) {
        int16_t n, odd;
        for (odd = 0; odd <= 3; odd = (int16_t)(odd + 3)) {
            drive.run.handover.offset = (int16_t)(sign * (1000 + odd));
            for (n = 1; n <= 61; n++) {
                handover_decay(&drive.run.handover); /* every sixteenth period */
                TEST_ASSERT_EQUAL_INT16(sign * (1000 + odd - 16 * n), drive.run.handover.offset);
            }
            handover_decay(&drive.run.handover);
            TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.offset);
            TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.id_q13);
        }
        drive.run.handover.offset = sign;
        handover_decay(&drive.run.handover);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.offset);
    }
}

/** Dead time shakes the estimate of an unloaded light rotor most while the d current falls; without this the unrest ends some 0.3 s after the hand-over. */
void test_unrest_of_the_hand_over_lasts_until_its_d_current_is_gone(void)
{
    at_the_end_of_the_ramp(1);
    hand_over(0x3000, 0, 0, 2000, 1);
    drive.run.observer.omega_q16 = 0; /* from here on the rotor stands and the observer knows it */
    drive.run.observer.load_q16 = 0;
    drive.run.control.i_q13.q = 0;
    drive.run.handover.offset = 1;
    for (uint16_t n = 0; n < 1000u; n++) {
        handover_observe(&drive.run, &params);
    }
    TEST_ASSERT_EQUAL_UINT16(OBSERVER_GATE_AT_START, drive.run.observer.gate_level);
    drive.run.observer.gate_level = OBSERVER_GATE_AT_START + 100;
    handover_observe(&drive.run, &params);
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(OBSERVER_GATE_AT_START + 99, drive.run.observer.gate_level, "more of it fades");
    drive.run.handover.offset = 0;
    handover_observe(&drive.run, &params);
    TEST_ASSERT_EQUAL_UINT16(OBSERVER_GATE_AT_START + 98, drive.run.observer.gate_level);
}

/** Where the current crosses zero the back-EMF is known to dead time's voltage only, and an estimate that dips there is no load. */
void test_current_that_brakes_lets_the_gate_take_as_little_for_a_load_as_at_the_hand_over(void)
{
    const struct {
        int16_t speed_erpm, current_q13;
        uint16_t level, then;
    } cases[] = {
        { 8000, -1, 0, OBSERVER_GATE_AT_START }, { -8000, 1, 0, OBSERVER_GATE_AT_START }, { 8000, -3000, 7, OBSERVER_GATE_AT_START },
        { 8000, 0, 7, 6 }, { -8000, 0, 7, 6 }, { -8000, -1, 7, 6 }, { 8000, 3000, 7, 6 },
        { 8000, -3000, OBSERVER_GATE_AT_START + 9, OBSERVER_GATE_AT_START + 8 }, /* more unrest fades as it does */
    };
    EACH(n, cases) {
        observer_t *o = &drive.run.observer;
        rig_closed(1, cases[n].speed_erpm);
        drive.run.handover.phase = (uint16_t)START_DONE;
        drive.run.handover.offset = 0;
        drive.run.control.ref_q13.q = cases[n].current_q13;
        drive.run.control.i_q13.q = 0;
        o->load_q16 = 0;
        o->rate_q16 = 0;
        o->fast_share_q15 = 0;
        o->gate_erpm = 32767;
        o->gate_level = cases[n].level;
        o->omega_q16 = (int32_t)cases[n].speed_erpm * 65536;
        handover_observe(&drive.run, &params);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].then, o->gate_level, golden_row(n));
    }
}

void test_current_follows_its_offset(void)
{
    EACH_DIRECTION(direction) { /* d = -Iq sin(offset), at 45 degrees after the step */
        drive.run.handover.current_q13 = (int16_t)(direction * params.open_loop_q13);
        drive.run.handover.offset = 8192 + 8;
        handover_decay(&drive.run.handover);
        TEST_ASSERT_INT16_WITHIN(3, (int16_t)(direction * -1856), drive.run.handover.id_q13);
        drive.run.handover.offset = -8192 - 8;
        handover_decay(&drive.run.handover);
        TEST_ASSERT_INT16_WITHIN(3, (int16_t)(direction * 1856), drive.run.handover.id_q13);
    }
}
