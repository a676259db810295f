/* Duties that act a period later, at 40 kHz: the pulse's frame, the voltage that acts, dead time's compensation, and a slow step of 16 periods. */
#include "hurst_params.h"

#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.000025

#include "law.c"
#include "drive_rig.h"

void setUp(void)
{
    rig_closed(1, 8000);
    drive.run.estimator.half_step_q16_rad = 300;
}

static alphabeta_t waiting(void)
{
    return drive.run.deferred_v_q13;
}

static void expect_vector(alphabeta_t expected, alphabeta_t actual)
{
    TEST_ASSERT_EQUAL_INT16(expected.alpha, actual.alpha);
    TEST_ASSERT_EQUAL_INT16(expected.beta, actual.beta);
}

void test_a_pulse_is_turned_a_step_further_than_the_next_sample_also_where_the_angle_wraps(void)
{
    static const struct {
        angle_t before, next, pulse;
    } cases[] = { { 1000, 1500, 2000 }, { 65000, 200, 936 }, { 200, 65000, 64264 }, { 5, 5, 5 } };
    EACH(n, cases) {
        sincos_t expected = trig_sincos(cases[n].pulse), frame;
        drive.angle = cases[n].next;
        frame = deferred_frame(&drive, cases[n].before);
        TEST_ASSERT_EQUAL_INT16(expected.sin, frame.sin);
        TEST_ASSERT_EQUAL_INT16(expected.cos, frame.cos);
    }
}

void test_the_estimator_sees_the_vectors_of_the_period_before_and_of_two_before(void)
{
    alphabeta_t first, second;
    drive.run.control.ref_q13.q = 1000;
    rig_tick(3);
    first = waiting();
    rig_tick(1);
    second = waiting();
    TEST_ASSERT_TRUE(first.alpha != second.alpha || first.beta != second.beta);
    expect_vector(first, drive.run.estimator.v_last_q13);
    rig_tick(1);
    expect_vector(second, drive.run.estimator.v_last_q13);
    TEST_ASSERT_EQUAL_INT16((first.alpha + second.alpha) >> 1, drive.run.estimator.v_mean_q13.alpha);
    TEST_ASSERT_EQUAL_INT16((first.beta + second.beta) >> 1, drive.run.estimator.v_mean_q13.beta);
}

void test_a_caught_rotor_begins_as_if_its_vector_had_acted_all_the_time(void)
{
    drive.run.estimator.omega_erpm = 8000;
    drive.run.control.v_q14.q = 9000;
    catch_close(&drive, &params);
    expect_vector(inverse_park(drive.run.control.v_q14, drive.frame), waiting());
    expect_vector(waiting(), drive.run.estimator.v_last_q13);
    expect_vector(waiting(), drive.run.estimator.v_mean_q13);
}

void test_dead_time_is_compensated_for_the_currents_five_half_steps_ahead_of_the_frame(void)
{
    dq_t asked = { 0, 900 };
    dead_duties_t expected;
    drive.frame = trig_sincos(7000);
    drive.run.control.ref_q13 = asked;
    svm_compensation(&params.svm, phases_of(dq_turn(asked, 5 * 300), drive.frame), &expected);
    drive_prepare(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(expected.a, drive.dead.a);
    TEST_ASSERT_EQUAL_INT16(expected.b, drive.dead.b);
    TEST_ASSERT_EQUAL_INT16(expected.c, drive.dead.c);
}

void test_a_slow_step_lasts_as_long_as_with_duties_in_time(void)
{
    uint16_t n, steps = 0;
    TEST_ASSERT_EQUAL_UINT16(16, SLOW_PERIODS);
    TEST_ASSERT_EQUAL_FLOAT(0.0004F, PARAM_STEP_SEC);
    drive.command.target_erpm = 12000;
    for (n = 0; n < 10u * SLOW_PERIODS; n++) {
        speed_erpm_t before = drive.run.control.reference_erpm;
        rig_speed(before); /* the rotor follows */
        rig_tick(1);
        steps = (uint16_t)(steps + (drive.run.control.reference_erpm != before));
    }
    TEST_ASSERT_EQUAL_UINT16(10, steps);
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.00004
    TEST_ASSERT_EQUAL_UINT16(0, DEFER_DUTIES);
    TEST_ASSERT_EQUAL_UINT16(8, SLOW_PERIODS);
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.000025
}

/** Else they would see one rotor at two speeds, and the speed's trim would take the difference for a load that moves. */
void test_estimator_and_observer_turn_a_speed_into_the_same_angle(void)
{
    TEST_ASSERT_EQUAL_INT16(2 * params.estimator.deltat_q32, params.observer.deltat_q32);
}

void test_each_half_of_a_part_comes_in_its_turn_and_leaves_its_mark(void)
{
    uint16_t n;
    rig_power_up();
    for (n = 0; n < 1100u; n++) {
        TEST_ASSERT_EQUAL_UINT16(1, selftest_flow_holds(&drive));
        rig_tick(1);
    }
    drive_start(&drive, &params, 1);
    for (n = 0; n < 30000u; n++) {
        TEST_ASSERT_EQUAL_UINT16(1, selftest_flow_holds(&drive));
        rig_tick(1);
    }
    drive.ticks = (uint16_t)(drive.ticks + 2u); /* one is left out */
    TEST_ASSERT_EQUAL_UINT16(0, selftest_flow_holds(&drive));
}

void test_the_forced_speed_is_counted_as_the_estimated_one(void)
{
    drive.forced.speed_q10 = (int32_t)(5000.0F * 67108864.0F / 60.0F * PARAM_F(LOOPTIME_SEC));
    TEST_ASSERT_INT16_WITHIN(5, 5000, handover_forced_erpm(&drive, &params));
}

void test_a_window_holds_where_the_current_may_change_for_two_periods(void)
{
    TEST_ASSERT_EQUAL_INT16((int16_t)PARAM_DI(MAXIMUM_SPEED_RPM), params.svm.turn_q13);
}
