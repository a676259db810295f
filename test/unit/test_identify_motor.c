/* The identification in closed loop with motors that it does not know: what it measures, what it refuses by name, how it stops. */
/* defines: -DIDENTIFY */
#include "ideal_motor.h"

#include "identify_rig.h"
#include "unity.h"

#include "firmware/drive/drive.c"
#include "firmware/drive/modes/identify.c"
#include "firmware/drive/panel.c"

void setUp(void)
{
    unknown_set(2.67F, 1.92F, 1.92F, 7.24F);
}

void tearDown(void)
{
}

static void expect_measured(float rs, float ld_mh, float lq_mh, float kphi)
{
    unknown_set(rs, ld_mh, lq_mh, kphi);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, unknown_identify());
    TEST_ASSERT_FLOAT_WITHIN(0.01F * rs + 0.0005F, rs, (float)drive.run.identify.values.rs_mohm * 0.001F);
    TEST_ASSERT_FLOAT_WITHIN(0.015F * ld_mh, ld_mh, (float)drive.run.identify.values.ld_uh * 0.001F);
    TEST_ASSERT_FLOAT_WITHIN(0.015F * lq_mh, lq_mh, (float)drive.run.identify.values.lq_uh * 0.001F);
    TEST_ASSERT_FLOAT_WITHIN(0.01F * kphi, kphi, (float)drive.run.identify.values.kphi_mv_per_krpm * 0.001F);
    unknown_ms();
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    TEST_ASSERT_EQUAL_INT16(0, the_panel.wish_run);
    TEST_ASSERT_TRUE(highest_a < 1.15F * PARAM_F(Q_CURRENT_REF_OPENLOOP));
}

void test_measures_the_motor_of_the_note(void)
{
    expect_measured(2.67F, 1.92F, 1.92F, 7.24F);
}

void test_measures_a_motor_of_low_resistance_and_inductance(void)
{
    expect_measured(0.3F, 0.1F, 0.1F, 2.0F);
}

void test_measures_a_motor_of_high_resistance_and_inductance(void)
{
    expect_measured(4.0F, 5.0F, 5.0F, 6.0F);
}

void test_measures_a_motor_that_rings_for_long(void)
{
    expect_measured(0.1F, 1.0F, 1.0F, 5.0F);
}

void test_tells_both_inductances_of_a_salient_motor(void)
{
    expect_measured(1.0F, 0.8F, 1.6F, 6.0F);
    expect_measured(1.0F, 1.6F, 1.2F, 6.0F);
}

void test_finds_the_rotor_wherever_it_stands(void)
{
    int16_t n;
    static const float at[4][2] = { { 1.0F, 0.0F }, { -1.0F, 0.0F }, { -0.5F, 0.8660254F }, { 0.5F, -0.8660254F } };
    for (n = 0; n < 4; n++) {
        unknown_set(2.67F, 1.0F, 2.0F, 7.24F);
        ideal_motor_reset(at[n][0], at[n][1]);
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, unknown_identify());
        TEST_ASSERT_UINT16_WITHIN(20, 1000, drive.run.identify.values.ld_uh);
        TEST_ASSERT_UINT16_WITHIN(40, 2000, drive.run.identify.values.lq_uh);
    }
}

void test_a_rotor_that_swings_does_not_change_the_back_emf(void)
{
    unknown_set(2.67F, 1.92F, 1.92F, 7.24F);
    unknown.friction_nm = 0.0F;
    unknown_begin();
    (void)unknown_until(IDENTIFY_SPIN_FULL);
    motor.omega *= 0.9F; /* a knock */
    (void)unknown_until(IDENTIFY_IDLE);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, drive.run.identify.result);
    TEST_ASSERT_UINT16_WITHIN(72, 7240, drive.run.identify.values.kphi_mv_per_krpm);
}

void test_a_bus_that_sags_with_the_current_does_not_change_R(void)
{
    unknown_set(2.67F, 1.92F, 1.92F, 7.24F);
    unknown_begin();
    (void)unknown_until(IDENTIFY_RESISTANCE);
    motor.bus_v += 0.5F; /* the second level takes less from the supply */
    (void)unknown_until(IDENTIFY_BIAS);
    TEST_ASSERT_UINT16_WITHIN(27, 2670, drive.run.identify.values.rs_mohm);
}

static void expect_refused(identify_result_t result)
{
    TEST_ASSERT_EQUAL_UINT16(result, unknown_identify());
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_IDLE, drive.run.identify.step);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    unknown_ms();
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.identify.values.kphi_mv_per_krpm);
}

void test_blocked_shaft_is_not_turning(void)
{
    unknown.blocked = 1;
    expect_refused(IDENTIFY_RESULT_NOT_TURNING);
    TEST_ASSERT_UINT16_WITHIN(27, 2670, drive.run.identify.values.rs_mohm); /* what standstill tells is kept */
    TEST_ASSERT_UINT16_WITHIN(20, 1920, drive.run.identify.values.ld_uh);
}

void test_shaft_too_heavy_for_the_ramp_is_not_turning(void)
{
    unknown.inertia = 5.5e-3F;
    expect_refused(IDENTIFY_RESULT_NOT_TURNING);
}

void test_each_open_phase_and_a_missing_motor_are_named(void)
{
    uint16_t phase;
    for (phase = 1; phase <= 4u; phase++) {
        unknown_set(2.67F, 1.92F, 1.92F, 7.24F);
        unknown.open_phase = phase;
        expect_refused(IDENTIFY_RESULT_NO_CURRENT);
        TEST_ASSERT_TRUE(highest_a < PARAM_F(Q_CURRENT_REF_OPENLOOP));
    }
}

void test_wire_that_opens_later_is_named_too(void)
{
    unknown_begin();
    (void)unknown_until(IDENTIFY_RESISTANCE);
    unknown.open_phase = 4;
    (void)unknown_until(IDENTIFY_IDLE);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_R_RANGE, drive.run.identify.result);
    unknown_set(2.67F, 1.92F, 1.92F, 7.24F);
    unknown_begin();
    (void)unknown_until(IDENTIFY_ALIGN);
    unknown.open_phase = 4;
    (void)unknown_until(IDENTIFY_IDLE);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NO_CURRENT, drive.run.identify.result);
}

void test_current_that_the_bus_cannot_drive_is_named(void)
{
    unknown_set(18.0F, 10.0F, 10.0F, 7.24F); /* not even half of it */
    expect_refused(IDENTIFY_RESULT_CURRENT_NOT_REACHED);
    unknown_set(9.0F, 10.0F, 10.0F, 7.24F); /* not all of it */
    expect_refused(IDENTIFY_RESULT_CURRENT_NOT_REACHED);
}

void test_inductance_that_hardly_lets_the_current_change_is_refused(void)
{
    unknown_set(5.0F, 400.0F, 400.0F, 7.24F);
    expect_refused(IDENTIFY_RESULT_L_RANGE);
}

void test_speed_that_the_bus_cannot_reach_is_named(void)
{
    unknown_set(2.67F, 1.92F, 1.92F, 21.0F);
    expect_refused(IDENTIFY_RESULT_VOLTAGE_LIMIT);
}

void test_S2_in_any_step_stops_at_once(void)
{
    uint16_t step;
    for (step = IDENTIFY_RISE; step < IDENTIFY_STEP_COUNT; step++) {
        setUp();
        unknown_begin();
        (void)unknown_until((identify_step_t)step);
        TEST_ASSERT_EQUAL_UINT16(step, drive.run.identify.step);
        inputs.s2_down = 1;
        panel_ms(PANEL_DEBOUNCE_MS);
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_STOPPED, drive.run.identify.result);
        inputs.s2_down = 0;
        unknown_ms();
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    }
}

void test_overcurrent_in_any_step_is_a_fault_and_switches_off_in_the_same_period(void)
{
    uint16_t step;
    for (step = IDENTIFY_RISE; step < IDENTIFY_STEP_COUNT; step++) {
        setUp();
        unknown_begin();
        (void)unknown_until((identify_step_t)step);
        rig_currents(CURRENT_Q13(3.9), 0);
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_SW, drive.fault);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
        panel_ms(1);
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_STOPPED, drive.run.identify.result);
        TEST_ASSERT_EQUAL_INT16(0, the_panel.wish_run);
    }
}

void test_undervoltage_and_overvoltage_end_it(void)
{
    unknown_begin();
    (void)unknown_until(IDENTIFY_INDUCTANCE_D);
    motor.bus_v = 10.0F;
    (void)unknown_until(IDENTIFY_IDLE);
    TEST_ASSERT_EQUAL_UINT16(FAULT_UNDERVOLTAGE, drive.fault);
    setUp();
    unknown_begin();
    (void)unknown_until(IDENTIFY_SPIN_HALF);
    motor.bus_v = 36.0F;
    (void)unknown_until(IDENTIFY_IDLE);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
}

void test_does_not_start_again_by_itself_but_with_S2(void)
{
    int16_t n;
    unknown.open_phase = 4;
    (void)unknown_identify();
    for (n = 0; n < 500; n++) {
        unknown_ms();
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    unknown.open_phase = 0;
    unknown_press_s2();
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, drive.run.identify.result);
    (void)unknown_until(IDENTIFY_IDLE);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, drive.run.identify.result);
}

void test_a_new_start_forgets_the_old_values(void)
{
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, unknown_identify());
    motor.omega = 0.0F;
    unknown_press_s2();
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.identify.values.rs_mohm);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.identify.values.kphi_mv_per_krpm);
}
