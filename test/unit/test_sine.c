/* The sine that a client on the serial line adds to measure the loops: what the controllers and the load observer get, and that it ends by itself. */
/* defines: -DSCOPE=1 */
#include "hurst_params.h"

#include "law.c"
#include "drive_rig.h"

#include <math.h>

#define TURN 6.283185307
#define SINE (&drive.run.sine)
#define OBSERVER_PERIODS 8u

void setUp(void)
{
    rig_closed(1, 8000);
    drive.run.control.ref_q13.d = -300;
    drive.run.control.ref_q13.q = 1200;
    SINE->angle = 5000;
    SINE->step = 3000;
    SINE->size_iq_q16 = -4000;
    SINE->size_rho_q17 = 2000;
}

void test_references_and_angle_are_as_they_are_without_a_sine(void)
{
    dq_t asked = mode_asked(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(-300, asked.d);
    TEST_ASSERT_EQUAL_INT16(1200, asked.q);
    TEST_ASSERT_EQUAL_UINT32(drive.run.estimator.rho_q32, mode_observed(&drive.run));
    TEST_ASSERT_EQUAL_UINT16(5000, SINE->angle);
}

void test_each_period_has_the_next_value_beside_the_q_current_an_eighth_of_a_count_a_unit(void)
{
    uint16_t n;
    SINE->left = 1;
    for (n = 1; n <= 60u; n++) {
        const dq_t asked = mode_asked(&drive.run, &params);
        const double sine = sin(TURN * (uint16_t)(5000u + n * 3000u) / 65536.0);
        TEST_ASSERT_EQUAL_UINT16((uint16_t)(5000u + n * 3000u), SINE->angle);
        TEST_ASSERT_EQUAL_INT16(-300, asked.d);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1 + 500 / 40, lround(1200.0 - 500.0 * sine), asked.q, golden_row(n));
    }
}

void test_reference_and_sine_stay_within_the_largest_current(void)
{
    EACH_DIRECTION(direction) {
        uint16_t n;
        int16_t most = 0;
        SINE->left = 1;
        SINE->step = 256;
        SINE->size_iq_q16 = 32767;
        drive.run.control.ref_q13.q = (int16_t)(direction * (params.current_max_q13 - 100));
        for (n = 0; n < 256u; n++) {
            const int16_t asked = (int16_t)(direction * mode_asked(&drive.run, &params).q);
            most = (asked > most) ? asked : most;
            TEST_ASSERT_INT16_WITHIN(4097, params.current_max_q13 - 100, asked);
        }
        TEST_ASSERT_EQUAL_INT16(params.current_max_q13, most);
    }
}

void test_load_observer_sees_the_estimators_angle_and_the_sines(void)
{
    const uint32_t rho_q32 = drive.run.estimator.rho_q32;
    uint16_t n;
    SINE->left = 1;
    for (n = 0; n < 24u; n++) {
        const double sine = sin(TURN * SINE->angle / 65536.0) * 2000.0 / 131072.0 * 4294967296.0;
        TEST_ASSERT_INT32_WITHIN_MESSAGE(40000, (int32_t)lround(sine), (int32_t)(mode_observed(&drive.run) - rho_q32), golden_row(n));
        SINE->angle = (angle_t)(SINE->angle + 2731u);
    }
    SINE->size_rho_q17 = 32767;
    SINE->angle = 16384;
    TEST_ASSERT_INT32_WITHIN(500000, 1073741824, (int32_t)(mode_observed(&drive.run) - rho_q32)); /* a quarter of a turn */
}

/** Innovation of a step of the load observer that begins at the estimator's angle. */
static int16_t innovation(void)
{
    observer_preset(&drive.run.observer, &params.observer, drive.run.estimator.rho_q32, 8000, 0);
    drive.run.handover.phase = (uint16_t)START_DONE;
    handover_observe(&drive.run, &params);
    return drive.run.observer.innovation_erpm;
}

void test_observer_takes_the_sines_angle_for_one_that_the_rotor_has_turned(void)
{
    const int16_t without = innovation();
    SINE->size_rho_q17 = 300;
    SINE->angle = 16384;
    SINE->left = 1;
    /* 300/2^17 of a turn in 0.4 ms are 343 rpm; the observer's speed counts are electrical rpm */
    TEST_ASSERT_INT16_WITHIN(4, (int16_t)(without + 343), innovation());
    SINE->angle = 49152;
    TEST_ASSERT_INT16_WITHIN(4, (int16_t)(without - 343), innovation());
}

void test_controllers_follow_the_currents_with_the_sine(void)
{
    int16_t without, with;
    rig_tick(1);
    without = drive.run.control.v_q14.q;
    rig_closed(1, 8000);
    SINE->size_iq_q16 = -8000;
    SINE->angle = 16384;
    SINE->step = 0;
    SINE->left = 2;
    rig_tick(1);
    with = drive.run.control.v_q14.q;
    TEST_ASSERT_LESS_THAN_INT16(without - 500, with);
}

void test_sine_ends_after_so_many_slow_steps_whatever_the_state(void)
{
    static const drive_state_t states[] = { DRIVE_RAMP, DRIVE_CLOSED };
    EACH(n, states) {
        uint16_t steps;
        rig_closed(1, 8000);
        drive.state = (uint16_t)states[n];
        drive.ticks = 0;
        SINE->size_iq_q16 = 0;
        SINE->size_rho_q17 = 0;
        SINE->left = 3;
        for (steps = 0; steps < 3u; steps++) {
            TEST_ASSERT_EQUAL_UINT16(3u - steps, SINE->left);
            rig_tick(OBSERVER_PERIODS);
        }
        TEST_ASSERT_EQUAL_UINT16(0, SINE->left);
        rig_tick(4u * OBSERVER_PERIODS);
        TEST_ASSERT_EQUAL_UINT16(0, SINE->left);
    }
}

void test_a_new_run_begins_without_a_sine(void)
{
    rig_ready();
    SINE->left = 1000;
    SINE->size_iq_q16 = 100;
    drive_start(&drive, &params, 1);
    rig_tick(4);
    TEST_ASSERT_EQUAL_UINT16(0, SINE->left);
    TEST_ASSERT_EQUAL_INT16(0, SINE->size_iq_q16);
}
