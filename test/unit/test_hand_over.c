/* The hand-over: the measured offset, and voltage and current vectors that keep their place in the stator. */
#include "drive/param_scaling.h"

#include "drive/tick.h"
#include "golden.h"
#include "golden_hand_over.h"
#include "unity.h"

static drive_t drive;
static drive_params_t params;

void setUp(void)
{
    static const drive_t zero;
    static const drive_params_t no_params;
    static const pi_gains_t current = { 6538, 455, 32735, 10 }, speed = { 3000, 40, 32735, 13 };
    drive = zero;
    params = no_params;
    params.pi_d = current;
    params.pi_q = current;
    params.pi_speed = speed;
    params.end_erpm = 5000;
    params.open_loop_q13 = 2625;
    drive.state = (uint16_t)DRIVE_RAMP;
    drive.direction = 1;
}

void tearDown(void)
{
}

/** @param forced,estimated angles @param v_d,v_q voltages in the forced frame */
static void hand_over(angle_t forced, angle_t estimated, int16_t v_d, int16_t v_q, int16_t direction)
{
    drive.direction = direction;
    drive.angle = forced;
    drive.run.estimator.rho_q32 = (uint32_t)estimated << 16;
    drive.run.estimator.omega_filtered_q16 = (int32_t)direction * 4800 * 65536;
    drive.run.control.v_q14.d = v_d;
    drive.run.control.v_q14.q = v_q;
    drive.run.handover.agreed_steps = 50;
    drive.run.handover.speed_is_preset = 0; /* as the start has left it */
    handover_now(&drive, &params);
    drive.ticks = 7;
    drive_slow(&drive, &params, 0);
}

static alphabeta_t stator_voltage(angle_t angle)
{
    return inverse_park(drive.run.control.v_q14, trig_sincos(angle));
}

void test_vectors_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_HAND_OVER_ROWS; n++) {
        golden_hand_over_t v = golden_hand_over_row(n);
        hand_over(v.forced, v.estimated, v.v_d, v.v_q, (int16_t)((v.i_q > 0) ? 1 : -1));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.offset, drive.run.handover.offset, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_v_d, drive.run.control.v_q14.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_v_q, drive.run.control.v_q14.q, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_i_d, drive.run.control.ref_q13.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.new_i_q, drive.run.control.ref_q13.q, golden_row(n));
    }
}

void test_offset_is_forced_less_estimated_angle_with_its_sign(void)
{
    hand_over(20000, 15000, 0, 0, 1);
    TEST_ASSERT_EQUAL_INT16(5000, drive.run.handover.offset);
    hand_over(15000, 20000, 0, 0, 1);
    TEST_ASSERT_EQUAL_INT16(-5000, drive.run.handover.offset);
    hand_over(1000, 65000, 0, 0, 1); /* across zero */
    TEST_ASSERT_EQUAL_INT16(1536, drive.run.handover.offset);
}

void test_estimated_angle_of_the_next_sample_takes_over(void)
{
    drive.run.estimator.half_step_q16_rad = 6283; /* 1000 counts */
    hand_over(20000, 15000, 0, 0, 1);
    TEST_ASSERT_UINT16_WITHIN(1, 16000, drive.angle);
    TEST_ASSERT_INT16_WITHIN(1, 4000, drive.run.handover.offset);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_voltage_vector_keeps_its_place_in_the_stator(void)
{
    uint32_t estimated;
    for (estimated = 0; estimated < UINT32_C(65536); estimated += 3001u) {
        alphabeta_t before, after;
        drive.run.control.v_q14.d = -3000;
        drive.run.control.v_q14.q = 9000;
        before = stator_voltage(12345);
        hand_over(12345, (angle_t)estimated, -3000, 9000, 1);
        after = stator_voltage((angle_t)estimated);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(6, before.alpha, after.alpha, golden_row(estimated));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(6, before.beta, after.beta, golden_row(estimated));
    }
}

void test_current_vector_keeps_its_place_in_the_stator_in_both_directions(void)
{
    int16_t direction;
    for (direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        dq_t forced_ref;
        alphabeta_t before, after;
        forced_ref.d = 0;
        forced_ref.q = (int16_t)(direction * 2625);
        before = inverse_park(forced_ref, trig_sincos(40000));
        hand_over(40000, 31000, 0, 0, direction);
        after = inverse_park(drive.run.control.ref_q13, trig_sincos(31000));
        TEST_ASSERT_INT16_WITHIN(3, before.alpha, after.alpha);
        TEST_ASSERT_INT16_WITHIN(3, before.beta, after.beta);
    }
}

void test_rotor_ahead_of_the_forced_frame_gives_a_negative_offset_and_positive_d_current(void)
{
    hand_over(0, 10923, 0, 0, 1); /* 60 degrees ahead: the current is mostly on the rotor's d axis */
    TEST_ASSERT_EQUAL_INT16(-10923, drive.run.handover.offset);
    TEST_ASSERT_INT16_WITHIN(4, 2273, drive.run.control.ref_q13.d);
    TEST_ASSERT_INT16_WITHIN(4, 1312, drive.run.control.ref_q13.q);
    TEST_ASSERT_EQUAL_INT16(drive.run.control.ref_q13.d, drive.run.handover.id_q13);
}

void test_current_controllers_go_on_from_the_voltage_of_the_forced_frame(void)
{
    int16_t v_d, v_q;
    hand_over(20000, 15000, -3000, 9000, 1);
    v_d = drive.run.control.v_q14.d;
    v_q = drive.run.control.v_q14.q;
    TEST_ASSERT_EQUAL_INT16(v_d, pi_tick(&drive.run.control.pi_d, &params.pi_d, 0, 32767));
    TEST_ASSERT_EQUAL_INT16(v_q, pi_tick(&drive.run.control.pi_q, &params.pi_q, 0, 32767));
}

void test_speed_controller_is_preset_once_and_before_its_first_step(void)
{
    uint16_t slot;
    int32_t preset;
    drive.run.handover.agreed_steps = 50;
    drive.run.handover.speed_is_preset = 0; /* as the start has left it */
    handover_now(&drive, &params);
    drive.run.control.pi_speed.sum = 12345;
    for (slot = 6; slot <= 7u; slot++) {
        TEST_ASSERT_EQUAL_INT32(12345, drive.run.control.pi_speed.sum);
        drive.ticks = slot;
        drive_slow(&drive, &params, 0);
    }
    preset = drive.run.control.pi_speed.sum;
    TEST_ASSERT_NOT_EQUAL_INT32(12345, preset);
    drive.run.control.pi_speed.sum = 0;
    drive.ticks = 15;
    drive_slow(&drive, &params, 0);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.control.pi_speed.sum);
}

void test_stop_right_after_the_hand_over_goes_on_from_its_q_current_too(void)
{
    int16_t direction;
    for (direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        setUp();
        drive.run.handover.agreed_steps = 50;
        drive.direction = direction;
        drive.run.estimator.omega_filtered_q16 = (int32_t)direction * 4800 * 65536;
        handover_now(&drive, &params);
        drive.state = (uint16_t)DRIVE_STOPPING; /* the very next period */
        drive.ticks = 7;
        drive_slow(&drive, &params, 0);
        TEST_ASSERT_EQUAL_INT16(drive.run.control.ref_q13.q, pi_tick(&drive.run.control.pi_speed, &params.pi_speed, (int16_t)(direction * 200), 5120));
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
    }
}

void test_fault_or_stop_in_its_own_period_keeps_the_hand_over_from_happening(void)
{
    static const drive_state_t states[] = { DRIVE_STOPPED, DRIVE_FAULT, DRIVE_ALIGN };
    uint16_t n;
    for (n = 0; n < 3u; n++) {
        drive.run.handover.agreed_steps = 50;
        drive.state = (uint16_t)states[n];
        drive.ticks = 1;
        drive_slow(&drive, &params, 0);
        TEST_ASSERT_EQUAL_UINT16(states[n], drive.state);
    }
}

void test_speed_controller_starts_from_the_q_current_in_both_directions(void)
{
    hand_over(20000, 15000, 0, 0, 1); /* reference 5000, estimate 4800 */
    TEST_ASSERT_EQUAL_INT16(5000, drive.run.control.reference_erpm);
    TEST_ASSERT_EQUAL_INT16(drive.run.control.ref_q13.q, pi_tick(&drive.run.control.pi_speed, &params.pi_speed, 200, 5120));
    hand_over(20000, 15000, 0, 0, -1);
    TEST_ASSERT_EQUAL_INT16(-5000, drive.run.control.reference_erpm);
    TEST_ASSERT_EQUAL_INT16(drive.run.control.ref_q13.q, pi_tick(&drive.run.control.pi_speed, &params.pi_speed, -200, 5120));
}


/** Steps of the hand-over's decay until nothing is left. */
static uint16_t decay(void)
{
    uint16_t steps = 0;
    int16_t last = qm_abs(drive.run.handover.offset);
    while (drive.run.handover.offset != 0 && steps < 10000u) {
        handover_decay(&drive, &params);
        TEST_ASSERT_TRUE(qm_abs(drive.run.handover.offset) < last);
        TEST_ASSERT_TRUE(last - qm_abs(drive.run.handover.offset) < 16);
        last = qm_abs(drive.run.handover.offset);
        steps++;
    }
    return steps;
}

void test_45_degrees_decay_in_410_milliseconds_for_both_signs(void)
{
    hand_over(8192, 0, 0, 0, 1);
    TEST_ASSERT_UINT16_WITHIN(1, 1024, decay()); /* a count a period, in steps of 8 periods */
    TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.id_q13);
    hand_over(0, 8192, 0, 0, 1);
    TEST_ASSERT_UINT16_WITHIN(1, 1024, decay());
    TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.id_q13);
}

void test_decay_begins_with_the_d_current_of_the_hand_over(void)
{
    int16_t direction;
    for (direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        int16_t at_hand_over;
        hand_over(8192, 0, 0, 0, direction);
        at_hand_over = drive.run.handover.id_q13;
        TEST_ASSERT_INT16_WITHIN(3, (int16_t)(direction * -1856), at_hand_over);
        handover_decay(&drive, &params);
        TEST_ASSERT_INT16_WITHIN(4, at_hand_over, drive.run.handover.id_q13);
        hand_over(0, 8192, 0, 0, direction);
        handover_decay(&drive, &params);
        TEST_ASSERT_INT16_WITHIN(4, (int16_t)(direction * 1856), drive.run.handover.id_q13);
    }
}
