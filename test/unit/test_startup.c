/* The start: requests, bootstrap, the turns of ALIGN, the ramp, and both of its ends, on the ideal motor. */
#include <string.h>

#include "ideal_motor.h"

#define LOCK_PERIODS 10000u  /* 0.5 s */
#define LOCK_SPEED_Q10 33554 /* 5 turns in them: 120 rpm */

void setUp(void)
{
    rig_power_up();
    ideal_motor_reset(1.0F, 0.0F);
}

/* ---- the request ---- */

void test_start_is_refused_in_every_state_but_STOPPED_and_a_second_one_changes_nothing(void)
{
    EACH(state, rig_outputs) {
        int16_t starts = (int16_t)(state == (uint16_t)DRIVE_STOPPED);
        rig_ready();
        drive.state = state;
        drive_start(&drive, &params, -1);
        TEST_ASSERT_EQUAL_INT16(starts, drive.command.run);
        TEST_ASSERT_EQUAL_INT16(starts ? -1 : 1, drive.direction);
        drive_start(&drive, &params, 1);
        TEST_ASSERT_EQUAL_INT16(starts ? -1 : 1, drive.direction);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.control.ref_q13.q); /* ALIGN's grows from nothing */
    }
}

void test_start_begins_without_memory_of_the_last_run(void)
{
    drive_t fresh;
    rig_start(1);
    fresh = drive;
    rig_ready();
    memset(&drive.run, 0x5A, sizeof drive.run);
    memset(&drive.forced, 0x5A, sizeof drive.forced);
    memset(&drive.dead, 0x5A, sizeof drive.dead);
    memset(&drive.dead_second, 0x5A, sizeof drive.dead_second);
    drive.angle = 0x5A5A;
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_MEMORY(&fresh, &drive, sizeof fresh);
    TEST_ASSERT_INT32_WITHIN(1, LOCK_SPEED_Q10, drive.forced.speed_q10);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.control.pi_q.sum);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.reference_erpm);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.estimator.omega_filtered_q16);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.handover.agreed_steps);
    TEST_ASSERT_EQUAL_INT16(NORM_INVKFIBASE, drive.run.model.inv_kfi);
    TEST_ASSERT_EQUAL_INT16(2 * KFILTER_ESDQ, drive.run.model.kfilter_esdq_q16);
    TEST_ASSERT_EQUAL_INT16(params.current_max_q13, drive.run.control.iq_limit_q13);
    TEST_ASSERT_EQUAL_INT16(limits_asked_most(&params), drive.run.control.brake_limit_q13);
}

void test_first_period_finds_the_frame_of_the_first_angle(void)
{
    EACH_DIRECTION(direction) {
        rig_ready();
        drive.angle = 0x1234;
        drive.frame.sin = 1;
        drive.frame.cos = 2;
        drive_start(&drive, &params, direction);
        TEST_ASSERT_EQUAL_HEX16(0, drive.angle);
        TEST_ASSERT_INT16_WITHIN(3, 0, drive.frame.sin);
        TEST_ASSERT_INT16_WITHIN(11, 32757, drive.frame.cos);
    }
}

void test_stop_switches_off_within_a_slow_step_before_the_loop_is_closed(void)
{
    static const drive_state_t states[] = { DRIVE_BOOTSTRAP, DRIVE_ALIGN, DRIVE_RAMP };
    EACH(n, states) {
        uint16_t bridge_is_off = (states[n] == DRIVE_BOOTSTRAP), periods = 0;
        rig_start(1);
        (void)ideal_motor_run_until(states[n], 300u + LOCK_PERIODS);
        ideal_motor_run(100);
        EXPECT_DRIVE(states[n], FAULT_NONE, golden_row(n));
        drive.ticks = (uint16_t)(drive.ticks & ~(SLOW_PERIODS - 1u)); /* its part of the slow work has just been */
        drive.command.run = 0;
        while (drive.state != (uint16_t)DRIVE_STOPPED && periods < 9u) {
            ideal_motor_run(1);
            periods++;
        }
        EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(bridge_is_off ? 1u : SLOW_PERIODS, periods, golden_row(n));
    }
}

/* ---- bootstrap and align ---- */

void test_over_current_is_found_while_the_drivers_charge(void)
{
    rig_start(1);
    rig_tick(10);
    rig_currents(CURRENT_Q13(3.9F), 0);
    rig_tick(10);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERCURRENT_SW, "3.8 A");
}

void test_bootstrap_charges_all_low_sides_for_ten_milliseconds(void)
{
    uint16_t n;
    rig_start(1);
    for (n = 0; n < 200u; n++) {
        rig_tick(1);
        EXPECT_DRIVE(DRIVE_BOOTSTRAP, FAULT_NONE, golden_row(n));
    }
    rig_tick(1);
    EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, "charged");
    TEST_ASSERT_EQUAL_UINT16(0, out.duty.a); /* the period of the change has no time for the law: the low sides stay on */
    TEST_ASSERT_EQUAL_UINT16(0, out.duty.b);
    TEST_ASSERT_EQUAL_UINT16(0, out.duty.c);
    rig_tick(1);
    TEST_ASSERT_NOT_EQUAL_UINT16(0, out.duty.a);
    TEST_ASSERT_NOT_EQUAL_UINT16(0, out.duty.b);
}

void test_align_turns_five_times_while_its_current_grows_from_nothing_and_ends_in_the_ramp(void)
{
    EACH_DIRECTION(direction) {
        uint16_t n;
        int32_t turned = 0;
        angle_t before = 0;
        rig_lock(direction); /* with the first period */
        for (n = 1; n < LOCK_PERIODS; n++) {
            turned += (int16_t)(angle_t)(drive.angle - before);
            before = drive.angle;
            TEST_ASSERT_INT16_WITHIN(4, (int16_t)(direction * (int16_t)(2625ul * n / LOCK_PERIODS)), drive.run.control.ref_q13.q);
            rig_tick(1);
        }
        (void)rig_tick_until(DRIVE_RAMP, 8); /* the slow work of every eighth period */
        TEST_ASSERT_INT32_WITHIN(70, direction * 5L * 65536, turned);
        EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, "in the ramp");
        TEST_ASSERT_EQUAL_INT16(direction * params.open_loop_q13, drive.run.control.ref_q13.q);
    }
}

void test_ramp_goes_on_from_the_speed_of_align_and_accelerates_by_its_rate_in_both_directions(void)
{
    EACH_DIRECTION(direction) {
        angle_t before;
        rig_lock(direction);
        (void)rig_tick_until(DRIVE_RAMP, LOCK_PERIODS);
        TEST_ASSERT_INT32_WITHIN(1, LOCK_SPEED_Q10 + 20, drive.forced.speed_q10); /* of the next two periods */
        before = drive.angle;
        rig_tick(1000);
        TEST_ASSERT_INT32_WITHIN(1, LOCK_SPEED_Q10 + 10020, drive.forced.speed_q10);
        /* 33554 / 1024 * 1000, and 20 / 1024 * 2 * 500 * 501 / 2 counts */
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(uint16_t)(direction * (32768L + 4893L)), (int16_t)(uint16_t)(drive.angle - before));
    }
}

void test_forced_angle_moves_every_period_though_its_speed_changes_every_second(void)
{
    EACH_DIRECTION(direction) {
        uint16_t n;
        rig_lock(direction);
        (void)rig_tick_until(DRIVE_RAMP, LOCK_PERIODS);
        for (n = 0; n < 100u; n++) {
            uint32_t angle_q32 = drive.forced.angle_q32;
            int32_t speed_q10 = drive.forced.speed_q10;
            rig_tick(1);
            TEST_ASSERT_EQUAL_HEX32(qm_turn_add(angle_q32, (uint32_t)(direction * speed_q10 * 64)), drive.forced.angle_q32);
            TEST_ASSERT_EQUAL_HEX16(drive.forced.angle_q32 >> 16, drive.angle);
            TEST_ASSERT_EQUAL_INT32(((drive.ticks & 1u) == 0u) ? speed_q10 + 20 : speed_q10, drive.forced.speed_q10);
        }
    }
}

/* Slow work at the end of BOOTSTRAP prepares what follows if its period is an even one; else the first period stands on what the start has left. */
void test_first_period_with_the_law_is_whole_in_an_even_and_an_odd_one(void)
{
    EACH_DIRECTION(direction) {
        for (uint16_t odd = 0; odd < 2u; odd++) {
            uint32_t step_q32 = (uint32_t)((int32_t)direction * params.align_speed_q10 * 64);
            rig_ready();
            drive.forced.step_q32 = 0x01000000u; /* of the last run */
            drive.dead = (dead_duties_t){ 40, -40, 0 };
            drive.ticks = (uint16_t)((drive.ticks & ~1u) + odd);
            drive_start(&drive, &params, direction);
            TEST_ASSERT_EQUAL_UINT16(params.bootstrap_periods + 1u, rig_tick_until(DRIVE_ALIGN, params.bootstrap_periods + 2u));
            TEST_ASSERT_EQUAL_UINT16((odd + params.bootstrap_periods + 1u) & 1u, drive.ticks & 1u);
            TEST_ASSERT_EQUAL_HEX32(0, drive.forced.angle_q32);
            TEST_ASSERT_EQUAL_HEX32((drive.ticks & 1u) ? 0 : step_q32, drive.forced.step_q32);
            TEST_ASSERT_EQUAL_INT16(0, drive.dead.a); /* no current is asked for */
            TEST_ASSERT_EQUAL_INT16(0, drive.dead.b);
            TEST_ASSERT_EQUAL_INT16(0, drive.dead.c);
            for (uint16_t n = 0; n < 2u; n++) {
                uint32_t moves_q32 = drive.forced.step_q32, angle_q32 = drive.forced.angle_q32;
                rig_tick(1);
                TEST_ASSERT_EQUAL_HEX32(qm_turn_add(angle_q32, moves_q32), drive.forced.angle_q32);
                TEST_ASSERT_NOT_EQUAL_UINT16(0, out.duty.a);
                TEST_ASSERT_NOT_EQUAL_UINT16(0, out.duty.b);
                EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, golden_row(n));
            }
            TEST_ASSERT_EQUAL_HEX32(step_q32, drive.forced.step_q32);
        }
    }
}

void test_ramp_of_a_rotor_that_turns_begins_a_quarter_turn_behind_its_angle(void)
{
    EACH_DIRECTION(direction) {
        angle_t estimated;
        rig_closed(direction, (int16_t)(direction * 5000));
        drive.state = (uint16_t)DRIVE_STOPPING;
        estimated = estimator_next_angle(&drive.run.estimator);
        startup_ramp_from_here(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
        TEST_ASSERT_EQUAL_HEX16((angle_t)(estimated - (angle_t)(direction * 0x4000)), (angle_t)(drive.forced.angle_q32 >> 16));
    }
}

void test_ramp_carries_the_open_loop_current(void)
{
    EACH_DIRECTION(direction) {
        ideal_motor_reset(1.0F, 0.0F);
        rig_start(direction);
        (void)ideal_motor_run_until(DRIVE_RAMP, 300u + LOCK_PERIODS);
        ideal_motor_run(1000);
        EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, "in the ramp");
        TEST_ASSERT_INT16_WITHIN(30, (int16_t)(direction * 2625), drive.run.control.i_q13.q); /* 1.41 A */
        TEST_ASSERT_INT16_WITHIN(30, 0, drive.run.control.i_q13.d);
    }
}

void test_speed_waits_once_the_estimator_agrees(void)
{
    int32_t waits_q10;
    uint16_t n;
    rig_start(1);
    (void)ideal_motor_run_until(DRIVE_RAMP, 300u + LOCK_PERIODS);
    for (n = 0; n < 30000u && drive.run.handover.agreed_steps < params.agree_steps; n++) {
        ideal_motor_run(1);
        EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, "on the way up");
    }
    waits_q10 = drive.forced.speed_q10;
    TEST_ASSERT_INT32_WITHIN(600, 174763 + 4000, waits_q10); /* from 625 rpm on 20 ms of agreement */
    ideal_motor_run(500);
    EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, "the current falls");
    TEST_ASSERT_EQUAL_INT32(waits_q10, drive.forced.speed_q10);
    TEST_ASSERT_LESS_THAN_INT16(params.open_loop_q13 / 2, drive.run.control.ref_q13.q);
}

/* ---- R from ALIGN ---- */

/** Change of R that ALIGN has found, of a motor with another R than the header's. @param share of the header's */
static float start_measures(int16_t direction, float share, float load_nm)
{
    rig_start(direction);
    ideal_motor_reset(0.0F, 1.0F);
    motor.rs *= share;
    motor.load_nm = load_nm;
    (void)ideal_motor_run_until(DRIVE_RAMP, 300u + LOCK_PERIODS);
    EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, "aligned");
    return (float)drive.run.adaptation.rs_q31 / 2147483648.0F;
}

void test_align_measures_R_in_both_directions(void)
{
    static const float shares[] = { 0.7F, 0.85F, 1.0F, 1.15F, 1.3F };
    EACH_DIRECTION(direction) {
        EACH(n, shares) {
            TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.05F, shares[n] - 1.0F, start_measures(direction, shares[n], 0.0F), golden_row(n));
        }
    }
}

void test_estimator_has_a_sixteenth_less_than_the_measured_R_from_the_begin_of_the_ramp(void)
{
    float change = start_measures(1, 0.75F, 0.0F);
    ideal_motor_run(SLOW_ROUND_STEPS * SLOW_PERIODS);
    TEST_ASSERT_FLOAT_WITHIN(0.001F, (1.0F + change) * 15.0F / 16.0F, (float)drive.run.model.rs_q16 / (float)params.adaptation.rs_base_q16);
}

void test_rotor_that_begins_to_follow_at_any_current_leaves_the_estimator_no_more_than_the_true_R(void)
{
    static const float loads_nm[] = { 0.0F, 0.01F, 0.02F, 0.03F, 0.04F, 0.05F, 0.06F, 0.07F, 0.2F };
    EACH(n, loads_nm) {
        float change = start_measures(1, 0.85F, loads_nm[n]);
        TEST_ASSERT_TRUE_MESSAGE((1.0F + change) * 15.0F / 16.0F < 0.85F, golden_row(n));
        TEST_ASSERT_TRUE_MESSAGE(change > 0.85F * 0.9F - 1.0F, golden_row(n));
    }
}

void test_measured_R_keeps_to_the_bounds_of_what_may_be_learnt(void)
{
    TEST_ASSERT_FLOAT_WITHIN(0.0001F, -0.4F, start_measures(1, 0.4F, 0.0F));
    TEST_ASSERT_FLOAT_WITHIN(0.0001F, 0.6F, start_measures(1, 1.8F, 0.0F));
    TEST_ASSERT_FLOAT_WITHIN(0.0001F, 0.6F, start_measures(1, 2.5F, 0.0F));
}

void test_voltage_at_its_limit_measures_nothing(void)
{
    rig_start(1);
    ideal_motor_reset(0.0F, 1.0F);
    motor.rs *= 0.8F;
    (void)ideal_motor_run_until(DRIVE_ALIGN, 300);
    ideal_motor_run(LOCK_PERIODS / 2u);
    drive.run.control.vq_limit_q14 = drive.run.control.v_q14.q; /* for a step */
    startup_align(&drive, &params);
    (void)ideal_motor_run_until(DRIVE_RAMP, LOCK_PERIODS);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
}

/* The state may begin with the slow step itself: there is no voltage yet, and no limit either. */
void test_first_step_of_align_meets_no_limit(void)
{
    rig_start(1);
    drive.state = (uint16_t)DRIVE_ALIGN;
    startup_align(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.align.is_limited);
    TEST_ASSERT_EQUAL_UINT16(1, drive.run.align.steps);
}

void test_R_stays_the_headers_where_the_parameters_say_that_align_cannot_tell(void)
{
    drive_params_t other = params;
    other.align_rise_q14 = 0;
    (void)start_measures(1, 0.8F, 0.0F);
    drive.state = (uint16_t)DRIVE_ALIGN;
    drive.periods = params.align_periods;
    drive.run.align.turns = PARAM_ALIGN_TURNS - 1u;
    drive.run.adaptation.rs_q31 = 0;
    startup_align(&drive, &other);
    EXPECT_DRIVE(DRIVE_RAMP, FAULT_NONE, "aligned");
    TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
}

/** ALIGN's last step, after turns with rises of voltage that the fifth one ends. */
static int32_t last_turn_teaches(int16_t least, int16_t second, uint16_t turns)
{
    rig_lock(1);
    drive.periods = params.align_periods;
    drive.run.align.turns = turns;
    drive.run.align.least_q14 = least;
    drive.run.align.second_q14 = second;
    drive.run.align.mean_q14 = 1000;
    drive.run.align.steps = 250;
    drive.run.align.sum_q14 = 250ul * 5000ul; /* a rise of 4000 */
    startup_align(&drive, &params);
    return drive.run.adaptation.rs_q31;
}

void test_rise_that_no_winding_makes_teaches_nothing(void)
{
    TEST_ASSERT_NOT_EQUAL_INT32(0, last_turn_teaches(100, 800, PARAM_ALIGN_TURNS - 1u));
    TEST_ASSERT_EQUAL_INT32(0, last_turn_teaches(-200, -100, PARAM_ALIGN_TURNS - 1u));
    TEST_ASSERT_EQUAL_INT32(0, last_turn_teaches(-200, 0, PARAM_ALIGN_TURNS - 1u));
    TEST_ASSERT_EQUAL_INT32(0, last_turn_teaches(100, 800, PARAM_ALIGN_TURNS - 2u)); /* a turn is missing */
}

void test_start_forgets_the_R_of_the_last_one(void)
{
    (void)start_measures(1, 0.7F, 0.0F);
    rig_start(1);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.align.turns);
}

/* ---- the whole start ---- */

void test_start_is_BOOTSTRAP_ALIGN_RAMP_CLOSED_in_the_times_of_the_parameters(void)
{
    rig_start(1);
    drive.command.target_erpm = params.end_erpm;
    ideal_motor_run(1);
    EXPECT_DRIVE(DRIVE_BOOTSTRAP, FAULT_NONE, "started");
    TEST_ASSERT_EQUAL_UINT32(200, ideal_motor_run_until(DRIVE_ALIGN, 60000));
    TEST_ASSERT_UINT32_WITHIN(8, LOCK_PERIODS, ideal_motor_run_until(DRIVE_RAMP, 60000));
    /* (174763 - 33554) / 10 periods to 625 rpm; 50 agreeing slow steps; nothing loads this motor, so the current falls to its end in 177 more,
     * and the last swing is waited for */
    TEST_ASSERT_UINT32_WITHIN(200, 14121u + (50u + 177u) * 8u + 200u, ideal_motor_run_until(DRIVE_CLOSED, 60000));
    EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, "handed over");
}

void test_starts_from_every_quarter_of_a_turn_in_both_directions(void)
{
    static const float cosines[] = { 1.0F, 0.0F, -1.0F, 0.0F };
    EACH_DIRECTION(direction) {
        EACH(quarter, cosines) {
            rig_start(direction);
            drive.command.target_erpm = (int16_t)(direction * params.end_erpm);
            ideal_motor_reset(cosines[quarter], cosines[(quarter + 3) & 3]);
            (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
            ideal_motor_run(10000);
            EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, golden_row(quarter));
            TEST_ASSERT_FLOAT_WITHIN(50.0F, (float)(direction * params.end_erpm), ideal_motor_erpm());
        }
    }
}

void test_blocked_shaft_is_START_FAILED_within_200_ms_after_the_ramp(void)
{
    motor.blocked = 1;
    EACH_DIRECTION(direction) {
        rig_start(direction);
        (void)ideal_motor_run_until(DRIVE_RAMP, 300u + LOCK_PERIODS);
        /* to one and a half times 625 rpm, three times as fast to 1000 rpm, and 0.2 s */
        TEST_ASSERT_UINT32_WITHIN(60, 22859u + 583u + 4000u, ideal_motor_run_until(DRIVE_FAULT, 40000));
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_START_FAILED, "blocked");
    }
}
