/* From power-up to the hand-over: calibration, start requests, the order and the times of the start, and how it fails. */
#include "ideal_motor.h"
#include "unity.h"

#define LOCK_PERIODS 4000u   /* 0.2 s */
#define RAMP_PERIODS 27962u  /* 1.398 s: 279620 / 10 */

void setUp(void)
{
    rig_power_up();
    ideal_motor_reset(1.0F, 0.0F);
}

void tearDown(void)
{
}

/* ---- calibration ---- */

void test_power_up_is_CALIBRATE_with_outputs_off_and_no_fault(void)
{
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_INT16(0, drive.calibration.done);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
}

void test_init_forgets_everything_of_an_earlier_run(void)
{
    rig_currents(300, 200);
    rig_tick(1024);
    drive_start(&drive, &params, -1);
    rig_tick(500);
    drive_raise(&drive, FAULT_STALL);
    drive_init(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_INT16(0, drive.calibration.done);
    TEST_ASSERT_EQUAL_INT16(0, drive.calibration.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.control.pi_q.sum);
    TEST_ASSERT_EQUAL_UINT16(0, drive.ticks);
}

void test_init_knows_bus_gain_and_circle_of_the_nominal_supply(void)
{
    uint16_t gain = drive.duty_per_volt_q16;
    int16_t radius = drive.circle.limit_q14;
    uint16_t reciprocal = drive.circle.reciprocal;
    rig_tick(200); /* the same from the measured bus */
    TEST_ASSERT_UINT16_WITHIN(gain / 500u, drive.duty_per_volt_q16, gain);
    TEST_ASSERT_INT16_WITHIN(radius / 500, drive.circle.limit_q14, radius);
    TEST_ASSERT_UINT16_WITHIN(reciprocal / 500u, drive.circle.reciprocal, reciprocal);
}

void test_init_gives_the_estimator_the_base_constants(void)
{
    TEST_ASSERT_EQUAL_INT16(NORM_INVKFIBASE, drive.run.model.inv_kfi);
    TEST_ASSERT_EQUAL_INT16(2 * KFILTER_ESDQ, drive.run.model.kfilter_esdq_q16);
    TEST_ASSERT_UINT16_WITHIN(1, params.fieldweak.ls_base_q16, drive.run.model.ls_q16);
}

void test_calibration_takes_1024_samples_with_outputs_off(void)
{
    uint16_t n;
    for (n = 0; n < 1023; n++) {
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
        TEST_ASSERT_EQUAL_INT16(0, drive.calibration.done);
    }
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    TEST_ASSERT_EQUAL_INT16(1, drive.calibration.done);
}

void test_calibrated_offset_is_removed_from_each_phase(void)
{
    rig_currents(400, -250);
    rig_tick(1024);
    TEST_ASSERT_EQUAL_INT16(400, drive.calibration.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(-250, drive.calibration.offset_b_q13);
    rig_currents(400 + 1000, -250 + 300);
    rig_tick(1);
    TEST_ASSERT_EQUAL_INT16(1000, drive.i_a_q13);
    TEST_ASSERT_EQUAL_INT16(300, drive.i_b_q13);
    TEST_ASSERT_EQUAL_INT16(-1300, drive.i_c_q13);
}

void test_calibration_averages_noise_away(void)
{
    uint16_t n;
    for (n = 0; n < 1024; n++) {
        int16_t noise = (int16_t)((n & 1u) ? 64 : -64);
        rig_currents((int16_t)(100 + noise), (int16_t)(-100 - noise));
        rig_tick(1);
    }
    TEST_ASSERT_INT16_WITHIN(1, 100, drive.calibration.offset_a_q13);
    TEST_ASSERT_INT16_WITHIN(1, -100, drive.calibration.offset_b_q13);
}

void test_calibration_weighs_all_1024_samples_alike(void)
{
    uint16_t n;
    for (n = 0; n < 1024; n++) {
        int16_t step = (int16_t)((n < 512) ? 0 : 800);
        rig_currents(step, (int16_t)-step);
        rig_tick(1);
    }
    TEST_ASSERT_EQUAL_INT16(400, drive.calibration.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(-400, drive.calibration.offset_b_q13);
}

void test_negative_gain_means_a_shunt_in_the_low_leg(void)
{
    rig_tick(1024);
    samples.i_a = -4000; /* amplifier below its middle: current into the motor */
    samples.i_b = 8000;
    rig_tick(1);
    TEST_ASSERT_EQUAL_INT16(1000, drive.i_a_q13);
    TEST_ASSERT_EQUAL_INT16(-2000, drive.i_b_q13);
    TEST_ASSERT_EQUAL_INT16(1000, drive.i_c_q13);
}

void test_offset_up_to_an_eighth_of_full_scale_is_accepted(void)
{
    rig_currents(1024, -1024);
    rig_tick(1024);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_INT16(1, drive.calibration.done);
}

static void expect_offset_fault(int16_t a_q13, int16_t b_q13)
{
    rig_power_up();
    rig_currents(a_q13, b_q13);
    rig_tick(1024);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OFFSET, drive.fault);
    TEST_ASSERT_EQUAL_INT16(0, drive.calibration.done);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

void test_implausible_offset_of_either_phase_and_sign_faults(void)
{
    expect_offset_fault(1025, 0);
    expect_offset_fault(-1025, 0);
    expect_offset_fault(0, 1025);
    expect_offset_fault(0, -1025);
    expect_offset_fault(8000, -8000);
}

void test_implausible_offset_is_not_used(void)
{
    expect_offset_fault(2000, -3000);
    TEST_ASSERT_EQUAL_INT16(0, drive.calibration.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(0, drive.calibration.offset_b_q13);
}

void test_no_start_after_an_implausible_offset(void)
{
    expect_offset_fault(2000, 0);
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    rig_tick(3000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

void test_clearing_an_offset_fault_calibrates_again_from_the_start(void)
{
    expect_offset_fault(2000, -1500);
    rig_currents(100, 50);
    drive.command.clear_fault = 1;
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    rig_tick(1023);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_INT16(100, drive.calibration.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(50, drive.calibration.offset_b_q13);
}

void test_offset_that_is_still_implausible_faults_again(void)
{
    expect_offset_fault(2000, 0);
    drive.command.clear_fault = 1;
    rig_tick(1 + 1024);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OFFSET, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
}

void test_a_fault_during_calibration_calibrates_again_after_clearing(void)
{
    rig_tick(500);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    rig_tick(2000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    drive.command.clear_fault = 1;
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
    rig_tick(1023);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}

void test_a_fault_after_calibration_keeps_the_offsets(void)
{
    rig_currents(200, 100);
    rig_tick(1024);
    drive_raise(&drive, FAULT_STALL);
    rig_tick(1);
    drive.command.clear_fault = 1;
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_INT16(200, drive.calibration.offset_a_q13);
}

/* ---- the request ---- */

void test_outputs_stay_off_until_a_start_is_requested(void)
{
    uint16_t n;
    rig_ready();
    for (n = 0; n < 20000u; n++) {
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    }
}

void test_a_stopped_drive_shows_neither_speed_nor_reference(void)
{
    rig_closed(1, 5000);
    drive.state = (uint16_t)DRIVE_STOPPED;
    drive.command.run = 0;
    rig_tick(1);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.estimator.omega_filtered_q16);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.reference_erpm);
}

void test_a_request_to_clear_a_fault_does_not_disturb_a_start(void)
{
    rig_start(1);
    rig_tick(5);
    drive.command.clear_fault = 1;
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_BOOTSTRAP, drive.state);
    TEST_ASSERT_EQUAL_UINT16(5, drive.periods); /* the first of the six ended STOPPED */
    TEST_ASSERT_EQUAL_INT16(0, drive.command.clear_fault);
}

void test_start_is_refused_before_calibration_is_done(void)
{
    rig_tick(1000);
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    rig_tick(1000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}

void test_start_is_refused_in_every_state_but_STOPPED(void)
{
    uint16_t state;
    for (state = 0; state < (uint16_t)DRIVE_STATE_COUNT; state++) {
        rig_ready();
        drive.state = state;
        drive.direction = 1;
        drive_start(&drive, &params, -1);
        TEST_ASSERT_EQUAL_INT16((state == (uint16_t)DRIVE_STOPPED) ? 1 : 0, drive.command.run);
        TEST_ASSERT_EQUAL_INT16((state == (uint16_t)DRIVE_STOPPED) ? -1 : 1, drive.direction);
    }
}

void test_second_start_request_does_not_change_the_first(void)
{
    rig_start(1);
    drive_start(&drive, &params, -1);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    TEST_ASSERT_EQUAL_INT16(params.open_loop_q13, drive.run.control.ref_q13.q);
}

void test_start_begins_without_memory_of_the_last_run(void)
{
    rig_ready();
    drive.run.control.pi_q.sum = 123456;
    drive.run.control.reference_erpm = 9000;
    drive.run.handover.offset = 77;
    drive.run.estimator.omega_filtered_q16 = 99999999;
    drive.run.estimator.rho_q32 = 12345678ul;
    drive.run.fieldweak.trim_q13 = -100;
    drive.run.model.inv_kfi = 1;
    drive.run.model.kfilter_esdq_q16 = 1;
    drive.forced.speed_q10 = 5000;
    drive.run.handover.agreed_steps = 49;
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.control.pi_q.sum);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.reference_erpm);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.offset);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.estimator.omega_filtered_q16);
    TEST_ASSERT_EQUAL_UINT32(0, drive.run.estimator.rho_q32);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.fieldweak.trim_q13);
    TEST_ASSERT_EQUAL_INT16(NORM_INVKFIBASE, drive.run.model.inv_kfi);
    TEST_ASSERT_EQUAL_INT16(2 * KFILTER_ESDQ, drive.run.model.kfilter_esdq_q16);
    TEST_ASSERT_EQUAL_INT32(0, drive.forced.speed_q10);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.handover.agreed_steps);
    TEST_ASSERT_EQUAL_INT16(params.current_max_q13, drive.run.control.iq_limit_q13);
    TEST_ASSERT_EQUAL_INT16(params.current_max_q13, drive.run.control.brake_limit_q13);
}

/* ---- bootstrap ---- */

void test_bootstrap_charges_all_low_sides_for_ten_milliseconds(void)
{
    uint16_t n;
    rig_start(1);
    for (n = 0; n < 200u; n++) {
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_BOOTSTRAP, drive.state);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_BOOTSTRAP, out.outputs);
    }
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_PWM, out.outputs);
}

void test_first_lock_period_already_has_the_duties_of_the_law(void)
{
    rig_start(1);
    (void)rig_tick_until(DRIVE_ALIGN, 300);
    TEST_ASSERT_NOT_EQUAL_UINT16(0, out.duty.a);
    TEST_ASSERT_NOT_EQUAL_UINT16(0, out.duty.b);
}

void test_stop_during_bootstrap_switches_off_at_once(void)
{
    rig_start(1);
    rig_tick(50);
    drive.command.run = 0;
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

void test_overcurrent_during_bootstrap_is_a_fault_that_stays(void)
{
    rig_start(1);
    rig_tick(50);
    rig_currents(8000, 0);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_SW, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
}

void test_overcurrent_during_bootstrap_can_be_cleared(void)
{
    rig_start(1);
    rig_tick(50);
    rig_currents(8000, 0);
    rig_tick(1);
    rig_currents(0, 0);
    rig_tick(10);
    drive.command.clear_fault = 1;
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}

/* ---- lock ---- */

void test_lock_lasts_LOCK_TIME(void)
{
    rig_lock(1);
    TEST_ASSERT_EQUAL_UINT16(LOCK_PERIODS - 1u, rig_tick_until(DRIVE_RAMP, 5000)); /* rig_lock() ran the first */
}

void test_lock_sweeps_a_quarter_turn_in_its_first_half_and_then_holds(void)
{
    rig_lock(1);
    TEST_ASSERT_UINT16_WITHIN(9, 0xC000u, drive.angle);
    rig_tick(999);
    TEST_ASSERT_UINT16_WITHIN(2, 0xE000u, drive.angle);
    rig_tick(1000);
    TEST_ASSERT_INT16_WITHIN(2, 0, (int16_t)drive.angle);
    {
        angle_t held = drive.angle;
        rig_tick(1999);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, drive.state);
        TEST_ASSERT_EQUAL_HEX16(held, drive.angle);
    }
}

void test_lock_sweeps_the_other_way_in_reverse(void)
{
    rig_lock(-1);
    TEST_ASSERT_UINT16_WITHIN(9, 0x4000u, drive.angle);
    rig_tick(999);
    TEST_ASSERT_UINT16_WITHIN(2, 0x2000u, drive.angle);
    rig_tick(1000);
    TEST_ASSERT_INT16_WITHIN(2, 0, (int16_t)drive.angle);
}

void test_lock_and_ramp_carry_the_open_loop_current(void)
{
    rig_start(1);
    (void)ideal_motor_run_until(DRIVE_ALIGN, 300);
    ideal_motor_run(3000);
    TEST_ASSERT_INT16_WITHIN(30, 2625, drive.run.control.i_q13.q); /* 1.41 A */
    TEST_ASSERT_INT16_WITHIN(30, 0, drive.run.control.i_q13.d);
    ideal_motor_run(10000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
    TEST_ASSERT_INT16_WITHIN(30, 2625, drive.run.control.i_q13.q);
    TEST_ASSERT_INT16_WITHIN(30, 0, drive.run.control.i_q13.d);
}

void test_reverse_start_carries_the_negative_open_loop_current(void)
{
    rig_start(-1);
    (void)ideal_motor_run_until(DRIVE_ALIGN, 300);
    ideal_motor_run(3000);
    TEST_ASSERT_INT16_WITHIN(30, -2625, drive.run.control.i_q13.q);
}

void test_stop_during_lock_switches_off_at_once(void)
{
    rig_lock(1);
    rig_tick(100);
    drive.command.run = 0;
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

/* ---- ramp ---- */

void test_ramp_accelerates_by_its_rate_every_period(void)
{
    angle_t before;
    rig_lock(1);
    (void)rig_tick_until(DRIVE_RAMP, 5000);
    before = drive.angle;
    rig_tick(1000);
    TEST_ASSERT_EQUAL_INT32(10000, drive.forced.speed_q10);
    /* 10 / 1024 * 1000 * 1001 / 2 counts */
    TEST_ASSERT_INT16_WITHIN(2, 4888, (int16_t)(uint16_t)(drive.angle - before));
}

void test_ramp_turns_backwards_in_reverse(void)
{
    angle_t before;
    rig_lock(-1);
    (void)rig_tick_until(DRIVE_RAMP, 5000);
    before = drive.angle;
    rig_tick(1000);
    TEST_ASSERT_INT16_WITHIN(2, -4888, (int16_t)(uint16_t)(drive.angle - before));
}

void test_ramp_reaches_END_SPEED_after_1398_milliseconds(void)
{
    uint16_t n;
    rig_start(1);
    (void)ideal_motor_run_until(DRIVE_RAMP, 5000);
    for (n = 1; n < RAMP_PERIODS; n++) {
        ideal_motor_run(1);
        TEST_ASSERT_TRUE(drive.forced.speed_q10 < 279620);
    }
    ideal_motor_run(1);
    TEST_ASSERT_INT32_WITHIN(1, 279620, drive.forced.speed_q10); /* 1000 rpm, 5 pole pairs */
    ideal_motor_run(100);
    TEST_ASSERT_INT32_WITHIN(1, 279620, drive.forced.speed_q10);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
}

void test_stop_during_ramp_switches_off_at_once(void)
{
    rig_start(1);
    (void)ideal_motor_run_until(DRIVE_RAMP, 5000);
    ideal_motor_run(5000);
    drive.command.run = 0;
    ideal_motor_run(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

void test_whole_start_is_BOOTSTRAP_LOCK_RAMP_CLOSED(void)
{
    uint32_t ready;
    rig_start(1);
    drive.command.target_erpm = params.end_erpm;
    ideal_motor_run(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_BOOTSTRAP, drive.state);
    TEST_ASSERT_EQUAL_UINT32(200, ideal_motor_run_until(DRIVE_ALIGN, 60000));
    TEST_ASSERT_EQUAL_UINT32(LOCK_PERIODS - 1u, ideal_motor_run_until(DRIVE_RAMP, 60000));
    ready = ideal_motor_run_until(DRIVE_CLOSED, 60000);
    /* the end of the ramp and 50 agreeing slow steps, on a grid of eight periods */
    TEST_ASSERT_UINT32_WITHIN(8, RAMP_PERIODS + 50u * 8u, ready);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_PWM, out.outputs);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_starts_from_every_quarter_of_a_turn_in_both_directions(void)
{
    static const float cosines[] = { 1.0F, 0.0F, -1.0F, 0.0F };
    int16_t quarter, direction;
    for (direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        for (quarter = 0; quarter < 4; quarter++) {
            rig_start(direction);
            drive.command.target_erpm = (int16_t)(direction * params.end_erpm);
            ideal_motor_reset(cosines[quarter], cosines[(quarter + 3) & 3]);
            (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
            ideal_motor_run(10000);
            TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
            TEST_ASSERT_FLOAT_WITHIN(50.0F, (float)(direction * params.end_erpm), ideal_motor_erpm());
        }
    }
}

void test_blocked_shaft_is_START_FAILED_within_200_ms_after_the_ramp(void)
{
    uint32_t periods;
    motor.blocked = 1;
    rig_start(1);
    (void)ideal_motor_run_until(DRIVE_RAMP, 5000);
    ideal_motor_run(RAMP_PERIODS);
    periods = ideal_motor_run_until(DRIVE_FAULT, 10000);
    TEST_ASSERT_UINT32_WITHIN(16, 4000, periods);
    TEST_ASSERT_EQUAL_UINT16(FAULT_START_FAILED, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

void test_blocked_shaft_in_reverse_is_START_FAILED_too(void)
{
    motor.blocked = 1;
    rig_start(-1);
    (void)ideal_motor_run_until(DRIVE_FAULT, 40000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_START_FAILED, drive.fault);
}

/* ---- readiness, with a forced speed that has arrived and an estimate that the test sets ---- */

static void at_the_end_of_the_ramp(int16_t direction)
{
    rig_lock(direction);
    drive.state = (uint16_t)DRIVE_RAMP;
    drive.run.handover.waited_steps = 0;
    drive.forced.speed_q10 = params.forced.end_speed_q10;
}

/** Slow steps of the readiness check with this estimated speed, until the state changes. */
static uint16_t ready_steps(int16_t speed_erpm, uint16_t most)
{
    uint16_t steps = 0;
    while (drive.state == (uint16_t)DRIVE_RAMP && steps < most) {
        drive.run.estimator.omega_filtered_q16 = (int32_t)speed_erpm * 65536;
        drive.ticks = (uint16_t)(drive.ticks & ~7u);
        handover_wait(&drive, &params);
        drive.ticks = (uint16_t)(drive.ticks + 1u);
        drive_slow(&drive, &params, 0); /* the next period carries it out */
        steps++;
    }
    return steps;
}

void test_hand_over_comes_in_the_period_after_the_decision_and_in_no_other(void)
{
    uint16_t n;
    at_the_end_of_the_ramp(1);
    drive.run.handover.agreed_steps = (uint16_t)(params.ready_slots - 1u);
    drive.run.estimator.omega_filtered_q16 = 5000L * 65536;
    drive.ticks = 8;
    handover_wait(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state); /* both in one period would miss the deadline */
    for (n = 8; n <= 16; n++) {
        drive.ticks = n;
        if ((n & 7u) != 1u && (n & 7u) != 2u) {
            drive_slow(&drive, &params, 0);
            TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
        }
    }
    drive.ticks = 17;
    drive_slow(&drive, &params, 0);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_hand_over_leaves_the_frame_of_the_estimated_angle(void)
{
    sincos_t frame;
    at_the_end_of_the_ramp(1);
    drive.run.estimator.rho_q32 = 0x30000000ul;
    handover_now(&drive, &params);
    frame = trig_sincos(drive.angle);
    TEST_ASSERT_EQUAL_HEX16(estimator_next_angle(&drive.run.estimator), drive.angle);
    TEST_ASSERT_EQUAL_INT16(frame.sin, drive.frame.sin);
    TEST_ASSERT_EQUAL_INT16(frame.cos, drive.frame.cos);
}

void test_estimate_within_a_quarter_of_END_SPEED_for_20_ms_is_ready(void)
{
    at_the_end_of_the_ramp(1);
    TEST_ASSERT_EQUAL_UINT16(50, ready_steps(5000 - 1249, 1000));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    at_the_end_of_the_ramp(1);
    TEST_ASSERT_EQUAL_UINT16(50, ready_steps(5000 + 1249, 1000));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    at_the_end_of_the_ramp(-1);
    TEST_ASSERT_EQUAL_UINT16(50, ready_steps(-5000 - 1249, 1000));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_estimate_a_quarter_off_is_not_ready(void)
{
    at_the_end_of_the_ramp(1);
    TEST_ASSERT_EQUAL_UINT16(500, ready_steps(5000 - 1250, 1000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_START_FAILED, drive.fault);
    at_the_end_of_the_ramp(1);
    (void)ready_steps(5000 + 1250, 1000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
}

void test_estimate_of_the_wrong_direction_is_not_ready(void)
{
    at_the_end_of_the_ramp(1);
    (void)ready_steps(-5000, 1000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_START_FAILED, drive.fault);
    rig_power_up();
    at_the_end_of_the_ramp(-1);
    (void)ready_steps(5000, 1000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_START_FAILED, drive.fault);
}

void test_agreement_must_be_without_a_gap(void)
{
    at_the_end_of_the_ramp(1);
    TEST_ASSERT_EQUAL_UINT16(49, ready_steps(5000, 49));
    TEST_ASSERT_EQUAL_UINT16(1, ready_steps(0, 1));
    TEST_ASSERT_EQUAL_UINT16(49, ready_steps(5000, 49));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
    TEST_ASSERT_EQUAL_UINT16(1, ready_steps(5000, 1));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_readiness_is_looked_at_every_eighth_period_only(void)
{
    uint16_t n;
    at_the_end_of_the_ramp(1);
    drive.run.estimator.omega_filtered_q16 = 5000L * 65536;
    for (n = 1; n < 8; n++) {
        drive.ticks = n;
        handover_wait(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(0, drive.run.handover.agreed_steps);
        TEST_ASSERT_EQUAL_UINT16(0, drive.run.handover.waited_steps);
    }
    drive.ticks = 8;
    handover_wait(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(1, drive.run.handover.agreed_steps);
}
