/* BRINGUP step by step with a bridge of ohms and dead time behind the drive: answers, limits of the current, trips, the end. */
/* defines: -DBRINGUP */
#include "hurst_params.h"

#include "law.c"
#include "bringup_rig.h"

#include "drive/request.h"

void setUp(void)
{
    bringup_reset();
}

void test_nothing_is_summed_before_a_measurement_begins(void)
{
    rig_ready();
    rig_currents(1000, -500);
    rig_tick(10);
    TEST_ASSERT_EQUAL_INT16(1000, drive.phases_q13.a);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.bringup.sum_a);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.bringup.off_b);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.bringup.left);
}

void test_a_measurement_waits_for_the_amplitude_and_keeps_its_sums(void)
{
    int32_t sum;
    rig_ready();
    rig_currents(1000, -500);
    bringup_measure(&drive, 0);
    bringup_add(&drive, 0);
    TEST_ASSERT_EQUAL_UINT16(SUM_PERIODS, drive.run.bringup.left);
    rig_tick(SUM_PERIODS);
    TEST_ASSERT_TRUE(drive.run.bringup.ready);
    sum = drive.run.bringup.sum_a;
    drive.run.bringup.left = 5;
    rig_tick(3);
    TEST_ASSERT_EQUAL_INT32(sum, drive.run.bringup.sum_a);
}

void test_the_amplitudes_bound_is_1_6_times_what_the_resistance_takes_and_dead_time(void)
{
    float volts = 1.6F * 0.3F * 2.75F * (2.67F + 0.05F) + 1.5F * 4.0F / 3.0F * 2e-6F * 20000.0F * 24.0F;
    TEST_ASSERT_INT16_WITHIN(2, (int16_t)(volts / 24.0F * 2000.0F), BRINGUP_MOST_AMPLITUDE);
}

void test_the_amplitude_goes_down_half_as_much_again_above_the_current_that_is_asked_for(void)
{
    bringup_run_t *t = &drive.run.bringup;
    t->stop_q13 = 1000;
    t->amplitude = 100;
    t->most = 100;
    TEST_ASSERT_EQUAL_INT16(0, bringup_direction(t, 1490));
    TEST_ASSERT_EQUAL_INT16(-1, bringup_direction(t, 1510));
    t->keeps_current = 1;
    t->most = 100;
    TEST_ASSERT_EQUAL_INT16(-1, bringup_direction(t, 900)); /* at its bound, whatever the signals say */
    t->most = 101;
    TEST_ASSERT_EQUAL_INT16(1, bringup_direction(t, 900));
}

void test_to_the_six_directions_and_no_further_than_the_share_of_the_current(void)
{
    until(BRINGUP_STEP_AMMETER);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_AMMETER, guide.step);
    TEST_ASSERT_EQUAL_UINT16(0, guide.found);
    TEST_ASSERT_INT16_WITHIN(BRINGUP_FULL_Q13 / 8, BRINGUP_FULL_Q13, carried_most_q13);
}

void test_a_dead_signal_leaves_the_amplitude_at_its_bound(void)
{
    gain_a = 0.0F;
    gain_b = 0.0F;
    until(BRINGUP_STEP_END);
    TEST_ASSERT_TRUE(found(BRINGUP_NO_CURRENT));
    TEST_ASSERT_EQUAL_INT16(BRINGUP_MOST_AMPLITUDE, guide.full.amplitude[0]);
    TEST_ASSERT_TRUE(carried_most_q13 < CURRENT_Q13(1.5F * 2.75F * 0.3F * 2.0F));
}

void test_current_that_grows_by_itself_lowers_the_amplitude(void)
{
    int16_t before;
    until(BRINGUP_STEP_DRIVE);
    ms(500);
    before = drive.run.bringup.amplitude;
    rs_ohm = 1.0F;
    ms(50);
    TEST_ASSERT_TRUE(drive.run.bringup.amplitude < before);
}

/** In a step in which current flows. */
static void expect_that_a_press_ends(bringup_step_t step, uint16_t button)
{
    until(step);
    ms(100);
    TEST_ASSERT_TRUE(drive_is_running(&drive));
    guide.button = button;
    ms(5);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_END, guide.step);
    TEST_ASSERT_FALSE(drive_is_running(&drive));
}

void test_a_press_while_current_flows_ends_it(void)
{
    expect_that_a_press_ends(BRINGUP_STEP_DRIVE, 3);
}

void test_a_press_before_the_ammeters_question_ends_it(void)
{
    expect_that_a_press_ends(BRINGUP_STEP_AMMETER, 2);
}

void test_a_trip_ends_it_with_its_name(void)
{
    static const struct {
        drive_fault_t fault;
        bringup_finding_t finding;
    } cases[] = { { FAULT_OVERCURRENT_HW, BRINGUP_SHORT_CIRCUIT }, { FAULT_OVERCURRENT_SW, BRINGUP_OVERCURRENT }, { FAULT_UNDERVOLTAGE, BRINGUP_FAULT } };
    EACH(n, cases) {
        setUp();
        until(BRINGUP_STEP_DRIVE);
        ms(100);
        drive_raise(&drive, cases[n].fault);
        ms(5);
        TEST_ASSERT_TRUE(found(cases[n].finding));
        TEST_ASSERT_EQUAL_INT32(cases[n].fault, said[said_count - 2u].value);
        TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_END, guide.step);
    }
}

void test_over_current_protects_as_ever(void)
{
    until(BRINGUP_STEP_DRIVE);
    ms(100);
    rs_ohm = 0.05F;
    ms(300);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_SW, drive.fault);
    TEST_ASSERT_TRUE(found(BRINGUP_OVERCURRENT));
}

void test_nobody_answers_while_current_flows(void)
{
    no_answer = BRINGUP_ASK_AMMETER;
    until(BRINGUP_STEP_AMMETER);
    ms(1000);
    TEST_ASSERT_TRUE(drive_is_running(&drive));
    guide.waited_ms = CURRENT_MS - 2u;
    ms(5);
    TEST_ASSERT_FALSE(drive_is_running(&drive));
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_END, guide.step);
}

void test_what_is_wrong_at_rest_keeps_the_current_away(void)
{
    rig_bus(19.0F);
    until(BRINGUP_STEP_END);
    TEST_ASSERT_TRUE(found(BRINGUP_BUS_DIVIDER));
    TEST_ASSERT_EQUAL_INT16(0, carried_most_q13);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_ENDS, said[said_count - 1u].kind);
    TEST_ASSERT_EQUAL_INT32(1, said[said_count - 1u].value);
}

void test_s2_at_the_end_begins_anew(void)
{
    answers[BRINGUP_ASK_CURRENT] = 3;
    until(BRINGUP_STEP_END);
    guide.button = 2;
    ms(1);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_BEGIN, guide.step);
    TEST_ASSERT_EQUAL_UINT16(0, guide.found);
}
