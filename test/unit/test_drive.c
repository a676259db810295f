/* The whole drive: power-up, a part of the slow work every second period, controlled stop, both directions alike, and the closed loop on the ideal motor. */
#include "ideal_motor.h"

void setUp(void)
{
    rig_power_up();
    ideal_motor_reset(1.0F, 0.0F);
}

void test_power_up_forgets_everything_of_an_earlier_run(void)
{
    drive_t fresh = drive;
    rig_currents(300, 200);
    rig_tick(1024);
    drive_start(&drive, &params, -1);
    rig_tick(500);
    drive_raise(&drive, FAULT_STALL);
    drive_init(&drive, &params);
    TEST_ASSERT_EQUAL_MEMORY(&fresh, &drive, sizeof fresh);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(0, drive.calibration.done);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    TEST_ASSERT_EQUAL_UINT16(0, drive.ticks);
    TEST_ASSERT_EQUAL_INT16(NORM_INVKFIBASE, drive.run.model.inv_kfi); /* the estimator has the base constants */
    TEST_ASSERT_EQUAL_INT16(2 * KFILTER_ESDQ, drive.run.model.kfilter_esdq_q16);
    TEST_ASSERT_UINT16_WITHIN(1, params.fieldweak.ls_base_q16, drive.run.model.ls_q16);
}

void test_a_stopped_drive_stays_off_and_shows_neither_speed_nor_reference(void)
{
    uint16_t n;
    rig_closed(1, 5000);
    drive.state = (uint16_t)DRIVE_STOPPED;
    drive.command.run = 0;
    for (n = 0; n < 20000u; n++) {
        rig_tick(1);
        EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, golden_row(n));
        TEST_ASSERT_EQUAL_INT32(0, drive.run.estimator.omega_filtered_q16);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.control.reference_erpm);
    }
}

/* ---- what a flipped bit leaves ---- */

void test_a_flipped_bit_in_the_d_current_of_a_hand_over_that_is_over_does_not_stay(void)
{
    rig_closed(1, 8000);
    drive.run.handover.id_q13 = 0x4000;
    rig_tick(32);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.id_q13);
    TEST_ASSERT_TRUE(qm_abs(drive.run.control.ref_q13.d) < 100);
}

void test_a_flipped_bit_in_the_sample_s_shift_does_not_stay_while_the_rotor_is_aligned(void)
{
    rig_lock(1);
    drive.run.control.sample_shift_q13 = 0x1000;
    rig_tick(8);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.sample_shift_q13);
}

/* ---- the slow work: a part every second period, speed and bus every eighth, limits and rates every sixteenth, the others every 32nd ---- */

void test_each_part_of_the_slow_work_runs_in_its_own_period_of_eight_sixteen_or_thirty_two(void)
{
    uint16_t n;
    rig_closed(1, 8000);
    for (n = 0; n < 128u; n++) {
        uint16_t period, rare, slow;
        drive.run.control.reference_erpm = 7000;
        drive.command.target_erpm = 8000;
        drive.run.fieldweak.index = 99;
        drive.duty_per_volt_q16 = 1;
        drive.circle.reciprocal = 1;
        drive.run.control.iq_limit_q13 = 1;
        drive.run.stall_steps = 99;
        drive.run.probe_most_q13 = 1;
        drive.run.control.trim_reference_erpm = 1;
        drive.run.observer.wrong_erpm = 1;
        drive.run.control.brake_limit_q13 = 1;
        drive.run.estimator.old_turn_q16_rad = 1;
        rig_speed(8000);
        drive.run.estimator.e_q_q28 = 10000L * 65536;
        rig_tick(1);
        period = drive.ticks & 31u;
        rare = drive.ticks & 15u;
        slow = drive.ticks & 7u;
        TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slow == 0u, drive.run.control.reference_erpm != 7000, "speed");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(period == 28u, drive.run.fieldweak.index != 99u, "field weakening");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slow == 2u, drive.duty_per_volt_q16 != 1u, "bus");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(rare == 4u, drive.circle.reciprocal != 1u, "circle");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(rare == 4u, drive.run.control.iq_limit_q13 != 1, "current limit");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(rare == 14u, drive.run.stall_steps != 99u, "protection");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(rare == 14u, drive.run.control.trim_reference_erpm != 1, "trim");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(rare == 6u || (slow == 6u && !observer_gate_is_closed(&drive.run.observer)), drive.run.observer.wrong_erpm != 1, "rates");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(rare == 14u, drive.run.estimator.old_turn_q16_rad != 1, "the estimator's sign");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slow == 2u, drive.run.control.brake_limit_q13 != 1, "braking");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(period == 12u, drive.run.probe_most_q13 != 1, "probe");
    }
}

void test_field_weakening_is_indexed_by_the_reference_or_by_twice_the_speed_of_a_rotor_that_was_held(void)
{
    static const struct {
        int16_t reference_erpm, speed_erpm;
        uint16_t index;
        held_phase_t phase;
    } cases[] = { { 8000, 25000, 0, HELD_NOT },
                  { 13000 + 3 * 1024 + 5, 8000, 3, HELD_NOT },
                  { 13000 + 3 * 1024 + 5, 13000 / 2 + 3 * 512 + 3, 3, HELD_TURNS },
                  { -13000 - 3 * 1024 - 5, -13000 / 2 - 3 * 512 - 3, 3, HELD_TURNS },
                  { 13000 + 3 * 1024 + 5, 13000 / 2 + 520, 1, HELD_TURNS },
                  { 13000 + 3 * 1024 + 5, -13000 / 2 - 520, 1, HELD_TURNS },
                  { 13000 + 3 * 1024 + 5, 0, 0, HELD_TURNS },
                  { -13000 - 3 * 1024 - 5, 0, 0, HELD_TURNS },
                  { 8000, 0, 0, HELD_TURNS } };
    EACH(n, cases) {
        rig_closed((int16_t)((cases[n].reference_erpm < 0) ? -1 : 1), cases[n].reference_erpm);
        rig_speed(cases[n].speed_erpm);
        drive.run.held.phase = (uint16_t)cases[n].phase;
        rig_next_part(14);
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(cases[n].index, drive.run.fieldweak.index);
    }
}

void test_slow_work_is_due_every_second_period_while_the_bridge_switches_and_else_in_each(void)
{
    EACH(state, rig_outputs) {
        for (uint16_t n = 0; n < 16u; n++) {
            rig_power_up();
            drive.state = state;
            drive.ticks = n;
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(n % 2u == 0u, drive_slow_follows(&drive), golden_row(state));
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(rig_outputs[state] == (uint16_t)OUTPUTS_PWM, drive_tick(&drive, &params, &samples, &out.duty), golden_row(state));
        }
    }
}

/* The bus' filter stands for the parts, the estimator's history for what comes every second period, the offsets' sum for the bridge that is off. */
void test_a_period_with_the_bridge_off_has_its_own_work_and_every_second_a_part(void)
{
    rig_currents(100, 50);
    rig_bus(20.0F);
    drive.run.estimator.history_q14[0].alpha = 7777;
    for (uint16_t n = 0; n < 32u; n++) {
        int32_t sum_a = drive.calibration.sum_a, bus_q31 = drive.bus_q31;
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
        TEST_ASSERT_TRUE_MESSAGE(sum_a != drive.calibration.sum_a, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(drive.ticks % 8u == 2u, bus_q31 != drive.bus_q31, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(7777, drive.run.estimator.history_q14[0].alpha, golden_row(n));
    }
}

void test_filter_history_and_dead_time_follow_every_second_period_of_the_law(void)
{
    rig_closed(1, 8000);
    for (uint16_t n = 0; n < 32u; n++) {
        uint16_t even;
        int16_t newest = drive.run.estimator.history_q14[0].alpha;
        int32_t filtered_q16 = drive.run.estimator.omega_filtered_q16;
        drive.run.control.ref_q13.q = (int16_t)(2000 + n);
        drive.dead.a = 9999;
        rig_currents((int16_t)(100 + n), 50);
        drive.run.estimator.omega_erpm = (int16_t)(7000 + n);
        rig_tick(1);
        even = (uint16_t)((drive.ticks & 1u) == 0u);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(even, newest != drive.run.estimator.history_q14[0].alpha, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(even, filtered_q16 != drive.run.estimator.omega_filtered_q16, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(even, drive.dead.a != 9999, golden_row(n));
    }
}

/* Their centres are one and two periods of angle ahead of the frame that the slow work finds: three half steps in the mean. */
void test_dead_time_is_that_of_the_current_asked_for_in_the_middle_of_the_two_pulses_to_come(void)
{
    drive_params_t p = params;
    p.svm.knee_q13 = 810; /* beyond the current: so that the dead time is the current, 40 counts for 256 */
    p.svm.dead_slope_q8 = 40;
    EACH_DIRECTION(direction) {
        for (uint16_t n = 0; n < 40u; n++) {
            dead_duties_t expected;
            rig_closed(direction, (int16_t)(direction * 8000));
            drive.run.control.ref_q13.d = -480;
            drive.run.control.ref_q13.q = (int16_t)(direction * 640);
            drive.run.estimator.half_step_q16_rad = (int16_t)(direction * 2000); /* three are 0.0916 rad, 955 counts */
            drive.angle = (angle_t)(n * 1638u);
            drive.frame = trig_sincos(drive.angle);
            drive_prepare(&drive, &p);
            svm_compensation(&p.svm, phases_of(drive.run.control.ref_q13, trig_sincos((angle_t)(drive.angle + (uint16_t)(direction * 955)))), &expected);
            /* the tangent makes 800 counts longer by 0.4 %, the turn and the phases are rounded by 3 in all: 7 of current, 2 of the duty; a half step is 24 and 4 */
            TEST_ASSERT_INT16_WITHIN(2, expected.a, drive.dead.a);
            TEST_ASSERT_INT16_WITHIN(2, expected.b, drive.dead.b);
            TEST_ASSERT_INT16_WITHIN(2, expected.c, drive.dead.c);
        }
    }
}

void test_ticks_count_every_period_in_every_state(void)
{
    EACH(state, rig_outputs) {
        drive.state = state;
        drive.ticks = 65535u;
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(0, drive.ticks);
    }
}

/* ---- stop ---- */

void test_withdrawn_request_in_every_state(void)
{
    static const uint16_t next[DRIVE_STATE_COUNT] = {
        DRIVE_CALIBRATE, DRIVE_STOPPED, DRIVE_STOPPED, DRIVE_STOPPED, DRIVE_STOPPED, DRIVE_STOPPING, DRIVE_STOPPING, DRIVE_FAULT,
        DRIVE_STOPPED, DRIVE_STOPPED
    };
    EACH(state, next) {
        rig_closed(1, 8000);
        drive.state = state;
        drive.fault = (uint16_t)((state == (uint16_t)DRIVE_FAULT) ? FAULT_STALL : FAULT_NONE);
        drive.periods = 0;
        drive.command.run = 0;
        rig_tick(SLOW_ROUND_STEPS * SLOW_PERIODS);
        TEST_ASSERT_EQUAL_UINT16(next[state], drive.state);
    }
}

/** Start the model and bring it to a speed. */
static void run_at(int16_t direction, int16_t speed_erpm)
{
    rig_start(direction);
    ideal_motor_reset(1.0F, 0.0F);
    drive.command.target_erpm = (int16_t)(direction * speed_erpm);
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    ideal_motor_run(30000);
    EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, "running");
}

void test_stop_ramps_down_to_the_minimum_speed_and_then_switches_off_in_both_directions(void)
{
    EACH_DIRECTION(direction) {
        run_at(direction, 10000);
        drive.command.run = 0;
        ideal_motor_run(SLOW_ROUND_STEPS * SLOW_PERIODS);
        EXPECT_DRIVE(DRIVE_STOPPING, FAULT_NONE, "asked to stop");
        drive_start(&drive, &params, (int16_t)-direction); /* waits for the stop */
        TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
        TEST_ASSERT_EQUAL_INT16(direction, drive.direction);
        /* 7500 erpm at 20000 erpm/s */
        TEST_ASSERT_UINT32_WITHIN(1000, 7500, ideal_motor_run_until(DRIVE_STOPPED, 20000));
        ideal_motor_run(1);
        EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "stopped");
        TEST_ASSERT_FLOAT_WITHIN(300.0F, (float)direction * 2500.0F, ideal_motor_erpm());
    }
}

/* ---- both directions ---- */

void test_reverse_is_the_mirror_image_phases_b_and_c_swapped(void)
{
    static duties_t mirror[100]; /* longer, and open integrators collect rounding */
    EACH_DIRECTION(direction) {
        rig_lock(direction);
        drive.periods = (uint16_t)(params.align_periods - 200u); /* dead time's compensation would show a count of a small current */
        drive.forced.angle_q32 = (direction > 0) ? 0xC0000000u : 0x40000000u;
        drive.angle = forced_angle(&drive.forced);
        drive.frame = trig_sincos(drive.angle);
        EACH(n, mirror) {
            int16_t i_a = (int16_t)(n * 16), i_b = (int16_t)(300 - (int16_t)n * 12);
            rig_currents(i_a, (direction > 0) ? i_b : (int16_t)(-i_a - i_b));
            rig_tick(1);
            if (direction < 0) {
                mirror[n] = out.duty;
            } else {
                TEST_ASSERT_UINT16_WITHIN(4, mirror[n].a, out.duty.a);
                TEST_ASSERT_UINT16_WITHIN(4, mirror[n].b, out.duty.c);
                TEST_ASSERT_UINT16_WITHIN(4, mirror[n].c, out.duty.b);
            }
        }
    }
}

/* ---- closed loop on the model ---- */

void test_speed_and_angle_hold_with_and_without_load_in_both_directions(void)
{
    EACH_DIRECTION(direction) {
        uint16_t n;
        run_at(direction, 10000);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.control.ref_q13.d); /* nothing is left of the hand-over */
        for (n = 0; n < 200u; n++) {
            ideal_motor_run(10);
            TEST_ASSERT_FLOAT_WITHIN(50.0F, (float)direction * 10000.0F, ideal_motor_erpm()); /* 0.5 % */
            TEST_ASSERT_FLOAT_WITHIN(0.035F, 0.0F, ideal_motor_angle_error()); /* 2 degrees */
        }
        motor.load_nm = 0.05F;
        ideal_motor_run(6000);
        EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, "loaded");
        TEST_ASSERT_FLOAT_WITHIN(50.0F, (float)direction * 10000.0F, ideal_motor_erpm());
        TEST_ASSERT_TRUE(direction * drive.run.control.i_q13.q > 1300); /* (0.05 + 0.004) / 0.0599 A = 1678 counts */
    }
}
