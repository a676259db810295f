/* The identification in closed loop with motors that it does not know: what it measures, what it refuses by name, how it stops. */
/* defines: -DIDENTIFY */
#include "hurst_params.h"

#include "law.c"
#include "identify_rig.h"

#include "drive/request.h"

static identify_values_t *const values = &drive.run.identify.values;

void setUp(void)
{
    unknown_set(2.67F, 1.92F, 1.92F, 7.24F);
}

static void expect_off(void)
{
    unknown_ms();
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "ended");
    TEST_ASSERT_EQUAL_INT16(0, the_request.wish_run);
}

void test_measures_motors_of_every_kind(void)
{
    static const struct {
        float rs, ld_mh, lq_mh, kphi;
        identify_result_t result;
    } cases[] = {
        { 2.67F, 1.92F, 1.92F, 7.24F, IDENTIFY_RESULT_DONE },       /* AN1292's */
        { 0.3F, 0.1F, 0.1F, 2.0F, IDENTIFY_RESULT_NOT_ACCELERATING }, /* less back-EMF than dead time takes */
        { 4.0F, 5.0F, 5.0F, 6.0F, IDENTIFY_RESULT_DONE },
        { 0.1F, 1.0F, 1.0F, 5.0F, IDENTIFY_RESULT_DONE },           /* rings for long */
        { 1.0F, 0.8F, 1.6F, 6.0F, IDENTIFY_RESULT_DONE },           /* salient */
        { 1.0F, 1.6F, 1.2F, 6.0F, IDENTIFY_RESULT_DONE },
    };
    EACH(n, cases) {
        unknown_set(cases[n].rs, cases[n].ld_mh, cases[n].lq_mh, cases[n].kphi);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].result, unknown_identify(), golden_row(n));
        TEST_ASSERT_FLOAT_WITHIN(0.01F * cases[n].rs + 0.0005F, cases[n].rs, (float)values->rs_uohm * 0.000001F);
        TEST_ASSERT_FLOAT_WITHIN(0.015F * cases[n].ld_mh, cases[n].ld_mh, (float)values->ld_nh * 0.000001F);
        TEST_ASSERT_FLOAT_WITHIN(0.015F * cases[n].lq_mh, cases[n].lq_mh, (float)values->lq_nh * 0.000001F);
        TEST_ASSERT_FLOAT_WITHIN(0.01F * cases[n].kphi, cases[n].kphi, (float)values->kphi_uv_per_krpm * 0.000001F);
        TEST_ASSERT_UINT32_WITHIN_MESSAGE(550, (cases[n].result == IDENTIFY_RESULT_DONE) ? 5500 : 0, values->inertia_1e9_kgm2, golden_row(n));
        expect_off();
        TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.15F * PARAM_F(Q_CURRENT_REF_OPENLOOP), PARAM_F(Q_CURRENT_REF_OPENLOOP), motor.highest_a, golden_row(n));
    }
}

void test_follows_rotors_of_little_resistance(void)
{
    static const float cases[][4] = { /* ohm, mH, V/krpm, N m */
        { 0.1F, 1.0F, 4.0F, 0.002F }, { 0.1F, 1.0F, 7.0F, 0.005F }, { 0.1F, 0.6F, 5.0F, 0.002F },
        { 0.2F, 1.0F, 5.0F, 0.005F }, { 0.2F, 0.6F, 4.0F, 0.002F }, { 0.2F, 2.0F, 7.0F, 0.002F }
    };
    EACH(n, cases) {
        unknown_set(cases[n][0], cases[n][1], cases[n][1], cases[n][2]);
        motor.friction_nm = cases[n][3];
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(IDENTIFY_RESULT_DONE, unknown_identify(), golden_row(n));
        TEST_ASSERT_UINT32_WITHIN_MESSAGE(550, 5500, values->inertia_1e9_kgm2, golden_row(n));
    }
}

void test_a_rotor_that_is_too_heavy_for_the_ramp_gets_a_slower_one(void)
{
    motor.inertia = 1.5e-2F;
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, unknown_identify());
    TEST_ASSERT_TRUE(drive.run.identify.ramps > 0u);
    TEST_ASSERT_UINT32_WITHIN(750000ul, 15000000ul, values->inertia_1e9_kgm2);
    TEST_ASSERT_TRUE(motor.highest_a < 1.15F * PARAM_F(Q_CURRENT_REF_OPENLOOP));
}

void test_a_blocked_shaft_is_not_tried_with_slower_ramps(void)
{
    motor.blocked = 1;
    unknown_begin();
    TEST_ASSERT_UINT32_WITHIN(2000, 7000, unknown_until(IDENTIFY_IDLE));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, drive.run.identify.result);
}

void test_finds_the_rotor_wherever_it_stands(void)
{
    static const float at[4][2] = { { 1.0F, 0.0F }, { -1.0F, 0.0F }, { -0.5F, 0.8660254F }, { 0.5F, -0.8660254F } };
    EACH(n, at) {
        unknown_set(2.67F, 1.0F, 2.0F, 7.24F);
        motor.cos_e = at[n][0];
        motor.sin_e = at[n][1];
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, unknown_identify());
        TEST_ASSERT_UINT32_WITHIN(20000, 1000000, values->ld_nh);
        TEST_ASSERT_UINT32_WITHIN(40000, 2000000, values->lq_nh);
    }
}

void test_a_rotor_that_swings_does_not_change_the_back_emf(void)
{
    motor.friction_nm = 0.0F;
    unknown_begin();
    (void)unknown_until(IDENTIFY_SPIN_FULL);
    motor.omega *= 0.9F; /* a knock */
    (void)unknown_until(IDENTIFY_IDLE);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, drive.run.identify.result);
    TEST_ASSERT_UINT32_WITHIN(72000, 7240000, values->kphi_uv_per_krpm);
}

void test_a_bus_that_sags_with_the_current_does_not_change_R(void)
{
    unknown_begin();
    (void)unknown_until(IDENTIFY_RESISTANCE);
    motor.bus_v += 0.5F; /* the second level takes less from the supply */
    (void)unknown_until(IDENTIFY_BIAS);
    TEST_ASSERT_UINT32_WITHIN(27000, 2670000, values->rs_uohm);
}

void test_each_motor_that_cannot_be_measured_is_refused_by_name(void)
{
    static const struct {
        const char *what;
        float rs, l_mh, kphi, inertia;
        int16_t blocked;
        uint16_t open_phase;
        identify_result_t result;
    } cases[] = {
        { "blocked shaft", 2.67F, 1.92F, 7.24F, 5.5e-6F, 1, 0, IDENTIFY_RESULT_NOT_TURNING },
        { "too heavy for the slowest ramp", 2.67F, 1.92F, 7.24F, 1.0F, 0, 0, IDENTIFY_RESULT_NOT_TURNING },
        { "phase A open", 2.67F, 1.92F, 7.24F, 5.5e-6F, 0, 1, IDENTIFY_RESULT_NO_CURRENT },
        { "phase B open", 2.67F, 1.92F, 7.24F, 5.5e-6F, 0, 2, IDENTIFY_RESULT_NO_CURRENT },
        { "phase C open", 2.67F, 1.92F, 7.24F, 5.5e-6F, 0, 3, IDENTIFY_RESULT_NO_CURRENT },
        { "no motor", 2.67F, 1.92F, 7.24F, 5.5e-6F, 0, 4, IDENTIFY_RESULT_NO_CURRENT },
        { "the bus cannot drive half of the current", 18.0F, 10.0F, 7.24F, 5.5e-6F, 0, 0, IDENTIFY_RESULT_CURRENT_NOT_REACHED },
        { "nor all of it", 9.0F, 10.0F, 7.24F, 5.5e-6F, 0, 0, IDENTIFY_RESULT_CURRENT_NOT_REACHED },
        { "the current hardly changes", 5.0F, 400.0F, 7.24F, 5.5e-6F, 0, 0, IDENTIFY_RESULT_L_RANGE },
        { "the bus cannot reach the speed", 2.67F, 1.92F, 21.0F, 5.5e-6F, 0, 0, IDENTIFY_RESULT_VOLTAGE_LIMIT },
    };
    EACH(n, cases) {
        unknown_set(cases[n].rs, cases[n].l_mh, cases[n].l_mh, cases[n].kphi);
        motor.inertia = cases[n].inertia;
        motor.blocked = cases[n].blocked;
        motor.open_phase = cases[n].open_phase;
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].result, unknown_identify(), cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(IDENTIFY_IDLE, drive.run.identify.step, cases[n].what);
        expect_off();
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(0, values->kphi_uv_per_krpm, cases[n].what);
        TEST_ASSERT_TRUE_MESSAGE(cases[n].open_phase == 0u || motor.highest_a < PARAM_F(Q_CURRENT_REF_OPENLOOP), cases[n].what);
        if (cases[n].blocked) { /* what standstill tells is kept */
            TEST_ASSERT_UINT32_WITHIN(27000, 2670000, values->rs_uohm);
            TEST_ASSERT_UINT32_WITHIN(20000, 1920000, values->ld_nh);
        }
    }
}

/** The procedure has reached a step. */
static void begin_until(identify_step_t step)
{
    setUp();
    unknown_begin();
    (void)unknown_until(step);
    TEST_ASSERT_EQUAL_UINT16(step, drive.run.identify.step);
}

void test_what_happens_during_a_step_ends_it_by_name(void)
{
    static const struct {
        identify_step_t step;
        uint16_t open_phase;
        float bus_v;
        identify_result_t result;
        drive_fault_t fault;
    } cases[] = {
        { IDENTIFY_RESISTANCE, 4, 24.0F, IDENTIFY_RESULT_R_RANGE, FAULT_NONE },
        { IDENTIFY_ALIGN, 4, 24.0F, IDENTIFY_RESULT_NO_CURRENT, FAULT_NONE },
        { IDENTIFY_INDUCTANCE_D, 0, 10.0F, IDENTIFY_RESULT_STOPPED, FAULT_UNDERVOLTAGE },
        { IDENTIFY_SPIN_HALF, 0, 36.0F, IDENTIFY_RESULT_STOPPED, FAULT_OVERVOLTAGE },
    };
    EACH(n, cases) {
        begin_until(cases[n].step);
        motor.open_phase = cases[n].open_phase;
        motor.bus_v = cases[n].bus_v;
        (void)unknown_until(IDENTIFY_IDLE);
        TEST_ASSERT_EQUAL_UINT16(cases[n].result, drive.run.identify.result);
        TEST_ASSERT_EQUAL_UINT16(cases[n].fault, drive.fault);
    }
}

void test_S2_and_overcurrent_in_any_step_switch_off_at_once(void)
{
    uint16_t step;
    for (step = IDENTIFY_RISE; step < IDENTIFY_STEP_COUNT; step++) {
        begin_until((identify_step_t)step);
        inputs.s2_down = 1;
        panel_ms(BUTTON_DEBOUNCE_MS);
        rig_tick(1);
        EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, golden_row(step));
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_STOPPED, drive.run.identify.result);
        inputs.s2_down = 0;
        expect_off();
        begin_until((identify_step_t)step);
        rig_currents(CURRENT_Q13(3.9), 0);
        rig_tick(1);
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERCURRENT_SW, golden_row(step));
        panel_ms(1);
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_STOPPED, drive.run.identify.result);
        TEST_ASSERT_EQUAL_INT16(0, the_request.wish_run);
    }
}

void test_does_not_start_again_by_itself_but_with_S2_which_forgets_the_old_values(void)
{
    int16_t n;
    motor.open_phase = 4;
    (void)unknown_identify();
    for (n = 0; n < 500; n++) {
        unknown_ms();
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    motor.open_phase = 0;
    unknown_press_s2();
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, drive.run.identify.result);
    (void)unknown_until(IDENTIFY_IDLE);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, drive.run.identify.result);
    motor.omega = 0.0F;
    unknown_press_s2();
    TEST_ASSERT_EQUAL_UINT32(0, values->rs_uohm);
    TEST_ASSERT_EQUAL_UINT32(0, values->kphi_uv_per_krpm);
}
