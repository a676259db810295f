/* STOP_MODE 2: a requested stop ramps down to where the winding's short circuit fits, and shorts it until the rotor stands. */
#include "hurst_params.h"

#undef STOP_MODE
#define STOP_MODE 2

#include "law.c"
#include "drive_rig.h"

#define FITS_ERPM 8780 /* 2.75 A * 2.67 ohm / (7.24 V/krpm / sqrt(3)) = 1756.6 rpm, 5 pole pairs */
#define STANDS_PERIODS 400 /* 20 ms */

static void stop_at(int16_t direction, int16_t speed_erpm)
{
    rig_closed(direction, (int16_t)(direction * speed_erpm));
    drive.command.run = 0;
    speed_choose_state(&drive, &params);
}

/** In BRAKE, its first period over. */
static void brake(void)
{
    stop_at(1, 5000);
    rig_tick(1);
}

void setUp(void)
{
    brake();
}

void test_short_circuit_begins_only_below_the_speed_whose_current_fits(void)
{
    EACH_DIRECTION(direction) {
        stop_at(direction, FITS_ERPM + 5);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
        rig_speed((int16_t)(direction * (FITS_ERPM + 5)));
        speed_choose_state(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
        rig_speed((int16_t)(direction * (FITS_ERPM - 5)));
        speed_choose_state(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_BRAKE, drive.state);
        stop_at(direction, FITS_ERPM - 5);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_BRAKE, drive.state);
    }
}

void test_outputs_are_off_for_a_period_before_the_low_sides_conduct(void)
{
    stop_at(1, 5000);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, drive_outputs(&drive));
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_BOOTSTRAP, drive_outputs(&drive));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_BRAKE, drive.state);
    TEST_ASSERT_EQUAL_UINT16(0, drive_is_running(&drive));
}

void test_it_lasts_as_long_as_current_flows_and_20_ms_more(void)
{
    static const int16_t currents[][2] = { { 65, 0 }, { -65, 0 }, { 0, 65 }, { 0, -65 } };
    EACH(n, currents) {
        brake();
        rig_currents(currents[n][0], currents[n][1]);
        rig_tick(3 * STANDS_PERIODS);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(DRIVE_BRAKE, drive.state, golden_row(n));
        rig_currents((int16_t)(currents[n][0] * 64 / 65), (int16_t)(currents[n][1] * 64 / 65));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(STANDS_PERIODS, rig_tick_until(DRIVE_STOPPED, 1000), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, drive_outputs(&drive));
    }
}

void test_it_goes_by_the_currents_that_are_measured(void)
{
    rig_currents(40, 40); /* 80 in the third phase, which has no shunt */
    TEST_ASSERT_LESS_OR_EQUAL_UINT16(STANDS_PERIODS, rig_tick_until(DRIVE_STOPPED, 1000));
    brake();
    rig_currents(40, -80);
    TEST_ASSERT_EQUAL_UINT16(1001, rig_tick_until(DRIVE_STOPPED, 1000));
}

void test_a_load_that_turns_the_rotor_too_fast_is_an_over_current(void)
{
    rig_currents(params.overcurrent_q13, 0);
    rig_tick(10);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_BRAKE, drive.state);
    rig_currents((int16_t)(params.overcurrent_q13 + 1), 0);
    rig_tick(1);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERCURRENT_SW, "a phase");
}

void test_its_current_is_half_the_stator_s_vector_in_each_axis(void)
{
    rig_currents(2000, 0); /* alpha twice the current, beta over the root of three */
    rig_tick(1);
    TEST_ASSERT_EQUAL_INT16(2000, drive.run.control.i_q13.d);
    TEST_ASSERT_INT16_WITHIN(2, 1155, drive.run.control.i_q13.q);
}

void test_its_current_heats_the_winding_in_I2t(void)
{
    static overload_t heat;
    drive_params_t with_i2t = params;
    with_i2t.i2t_most_q25 = 1000L * 1000;
    with_i2t.i2t_rate_q16 = 32768;
    rig_currents(2000, -1000); /* a vector of 2000 along a */
    rig_tick(2);
    TEST_ASSERT_EQUAL_UINT16(0, overload_tick(&heat, &drive, &with_i2t, 500));
    TEST_ASSERT_EQUAL_UINT16(0, overload_tick(&heat, &drive, &with_i2t, OVERLOAD_STEP_MS - 500u));
    TEST_ASSERT_INT32_WITHIN(10000, 1000000, heat.heat_q25); /* half of 2000^2 / 2 */
    TEST_ASSERT_EQUAL_UINT16(1, overload_tick(&heat, &drive, &with_i2t, OVERLOAD_STEP_MS));
}

void test_a_start_waits_until_the_rotor_stands(void)
{
    rig_currents(500, 0);
    drive_start(&drive, &params, 1);
    rig_tick(1000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_BRAKE, drive.state);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
}

void test_a_target_in_the_other_direction_ramps_down_and_through_zero(void)
{
    rig_closed(1, 5000);
    drive.command.target_erpm = -5000;
    speed_choose_state(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
    speed_choose_state(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
}

void test_a_request_to_run_before_the_short_circuit_goes_on(void)
{
    stop_at(1, 20000);
    drive.command.run = 1;
    speed_choose_state(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}
