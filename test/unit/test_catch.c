/* The flying start: what two looks at a turning rotor tell, and what follows from it, on the ideal motor. */
#include "ideal_motor.h"

#include "drive/limits.h"

#define TURNS 8
#define MOST_A (1.1F * PARAM_F(MAXIMUM_CURRENT_A))

static const sincos_t *angle(uint16_t n)
{
    static sincos_t sc;
    sc = trig_sincos((angle_t)(n * (65536u / TURNS) + 1234u));
    return &sc;
}

/** A drive that is ready, and a rotor that turns at a speed. @param inertia times the header's */
static void turning(float erpm, float inertia, uint16_t n)
{
    rig_ready();
    ideal_motor_reset((float)angle(n)->cos / 32767.0F, (float)angle(n)->sin / 32767.0F);
    motor.inertia *= inertia;
    motor.omega = erpm * 2.0F * PARAM_PI / 60.0F;
}

static uint32_t start_to(int16_t direction, drive_state_t state, uint32_t most)
{
    drive_start(&drive, &params, direction);
    drive.command.target_erpm = (int16_t)(direction * 6000);
    return ideal_motor_run_until(state, most);
}

void setUp(void)
{
    rig_power_up();
}

/* ---- the look ---- */

void test_a_rotor_at_any_angle_and_speed_is_in_closed_loop_within_15_ms_with_angle_and_speed(void)
{
    static const int16_t speeds[] = { 2600, 4000, 7000, 12500, 17500 };
    EACH_DIRECTION(direction) {
        EACH(k, speeds) {
            uint16_t n;
            for (n = 0; n < TURNS; n++) {
                turning((float)(direction * speeds[k]), 36.0F, n);
                TEST_ASSERT_LESS_OR_EQUAL_UINT32_MESSAGE(300, start_to(direction, DRIVE_CLOSED, 300), golden_row(k));
                TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.02F * (float)speeds[k], ideal_motor_erpm(), (float)drive.run.control.reference_erpm, golden_row(k));
                TEST_ASSERT_EQUAL_INT16(direction, drive.direction);
                ideal_motor_run(20);
                TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.1F, 0.0F, ideal_motor_angle_error(), golden_row(k));
                ideal_motor_run(4000);
                EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, golden_row(k));
                TEST_ASSERT_TRUE_MESSAGE(motor.highest_a < MOST_A, golden_row(k));
            }
        }
    }
}

void test_two_looks_cost_a_heavy_rotor_next_to_no_speed(void)
{
    turning(10000.0F, 36.0F, 3);
    motor.friction_nm = 0.0F;
    motor.viscous_nms = 0.0F;
    (void)start_to(1, DRIVE_CLOSED, 300);
    TEST_ASSERT_FLOAT_WITHIN(30.0F, 10000.0F, ideal_motor_erpm());
}

void test_a_look_ends_at_a_tenth_of_the_largest_current(void)
{
    turning(3000.0F, 36.0F, 1);
    drive_start(&drive, &params, 1);
    (void)ideal_motor_run_until(DRIVE_CATCH, 300);
    TEST_ASSERT_FLOAT_WITHIN(0.04F, 0.1F * PARAM_F(MAXIMUM_CURRENT_A) + 0.03F, motor.highest_a); /* within a period */
}

void test_speed_follows_from_turn_and_time_in_its_format(void)
{
    static const struct {
        int16_t turn;
        uint16_t half_periods;
        int16_t erpm;
    } cases[] = {
        { 16384, 20, 30000 }, { -16384, 20, -30000 }, { 16384, 40, 15000 }, { 1638, 2100, 28 }, { 32767, 2, 32767 }, { -32767, 2, -32767 },
        { 8192, 10, 30000 }, { 1820, 2000, 33 },
    };
    EACH(n, cases) {
        /* 20 kHz: a turn of 2^16 in a period is 1 200 000 erpm */
        int16_t speed = catch_speed(&params, qm_abs(cases[n].turn), cases[n].half_periods);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(2, cases[n].erpm, qm_with_sign(speed, cases[n].turn), golden_row(n));
    }
}

void test_a_flux_beyond_its_format_keeps_its_direction(void)
{
    rig_ready();
    drive.run.model.rs_q16 = 65535u;
    EACH_DIRECTION(sign) {
        const alphabeta_t large_q11 = { (int16_t)(sign * 30000), (int16_t)(sign * 30000) };
        drive.run.catching.phase = (uint16_t)CATCH_FIRST_LOOK;
        drive.run.catching.sum_q11 = large_q11;
        drive.phases_q13.a = (int16_t)(sign * 3000);
        drive.periods = 1;
        TEST_ASSERT_TRUE(catch_look(&drive, &params));
        TEST_ASSERT_INT16_WITHIN(200, (sign > 0) ? -24576 : 8192, (int16_t)drive.run.catching.direction); /* -135, 45 degrees */
    }
}

void test_a_whole_look_s_sum_of_two_steps_of_the_converter_in_the_mean_turns_and_a_count_less_stands(void)
{
    const uint16_t periods = CATCH_LOOK_STEPS * SLOW_PERIODS;
    const int16_t turns_q11 = (int16_t)(CATCH_STANDS * periods);
    static const struct {
        int16_t alpha, beta, less;
    } cases[] = { { 1, 0, 0 }, { 0, 1, 0 }, { -1, 0, 0 }, { 0, -1, 0 }, { 1, 1, 1 }, { -1, -1, 1 } };
    EACH(n, cases) {
        const int16_t size_q11 = (int16_t)(turns_q11 - cases[n].less);
        const alphabeta_t sum_q11 = { (int16_t)(cases[n].alpha * size_q11), (int16_t)(cases[n].beta * size_q11) };
        rig_ready();
        drive.run.catching.phase = (uint16_t)CATCH_FIRST_LOOK;
        drive.run.catching.sum_q11 = sum_q11;
        drive.periods = periods;
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(!cases[n].less, catch_look(&drive, &params), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].less ? CATCH_NO_LOOK : CATCH_PAUSE, drive.run.catching.phase, golden_row(n));
    }
}

/* ---- what follows ---- */

void test_the_pause_between_two_looks_falls_with_the_rotor_s_speed_between_its_ends(void)
{
    uint16_t taken, before, pause = 0;
    rig_ready();
    for (taken = 1; taken <= 20u; taken++) {
        int16_t flux;
        before = CATCH_PAUSE_MOST;
        for (flux = 0; flux <= 16000; flux++) {
            const alphabeta_t flux_q11 = { (int16_t)-flux, 0 };
            pause = catch_pause(&drive.run, &params, flux_q11, taken);
            TEST_ASSERT_TRUE_MESSAGE(pause <= before && pause >= CATCH_PAUSE_LEAST, golden_row(taken));
            before = pause;
        }
        TEST_ASSERT_TRUE_MESSAGE(taken > 8u || pause < 20u, golden_row(taken));
    }
}

void test_the_voltage_of_a_rotor_beyond_the_circle_is_the_circle_s(void)
{
    static const int16_t speeds[] = { 16500, 20000, 32000 };
    drive_params_t strong = params;
    uint16_t n;
    rig_ready();
    for (n = 0; n < FIELDWEAK_ENTRIES; n++) {
        strong.fieldweak.inv_kfi[n] = 2048;
    }
    EACH_DIRECTION(direction) {
        EACH(k, speeds) {
            drive.run.estimator.omega_erpm = (int16_t)(direction * speeds[k]);
            catch_preset_estimator(&drive, &strong);
            TEST_ASSERT_EQUAL_INT16_MESSAGE(direction * drive.circle.limit_q14, drive.run.control.v_q14.q, golden_row(k));
        }
    }
}

void test_a_rotor_that_turns_the_wrong_way_is_slowed_down_and_reversed_without_an_alignment(void)
{
    EACH_DIRECTION(direction) {
        static const drive_state_t way[] = { DRIVE_STOPPING, DRIVE_RAMP, DRIVE_CLOSED }; /* the first CLOSED ends in the part that enters it */
        turning((float)(direction * -10000), 1.0F, 2);
        drive_start(&drive, &params, direction);
        drive.command.target_erpm = (int16_t)(direction * 6000);
        EACH(n, way) {
            TEST_ASSERT_TRUE_MESSAGE(ideal_motor_run_until(way[n], 60000) <= 60000u, golden_row(n));
            TEST_ASSERT_EQUAL_INT16((n < 1u) ? -direction : direction, drive.direction);
        }
        ideal_motor_run(20000);
        EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, "reversed");
        TEST_ASSERT_FLOAT_WITHIN(60.0F, (float)direction * 6000.0F, ideal_motor_erpm());
        TEST_ASSERT_TRUE(motor.highest_a < MOST_A);
    }
}

void test_below_the_minimum_speed_the_ramp_goes_on_from_the_rotor_whichever_way_it_turns(void)
{
    static const int16_t speeds[] = { 2300, 600, -600, -2300 };
    EACH_DIRECTION(direction) {
        EACH(n, speeds) {
            int32_t rotor_q10;
            turning((float)(direction * speeds[n]), 36.0F, n);
            TEST_ASSERT_TRUE_MESSAGE(start_to(direction, DRIVE_RAMP, 1200) <= 1200u, golden_row(n));
            rotor_q10 = (int32_t)((float)direction * ideal_motor_erpm() / 60.0F * PARAM_F(LOOPTIME_SEC) * 67108864.0F);
            TEST_ASSERT_INT32_WITHIN_MESSAGE(rotor_q10 / 16 + 4000, rotor_q10, drive.forced.speed_q10, golden_row(n));
            TEST_ASSERT_EQUAL_INT16(direction, drive.direction);
            TEST_ASSERT_TRUE_MESSAGE(ideal_motor_run_until(DRIVE_CLOSED, 60000) <= 60000u, golden_row(n));
            EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, golden_row(n));
            TEST_ASSERT_FLOAT_WITHIN(500.0F, (float)(direction * params.early_erpm), ideal_motor_erpm());
        }
    }
}

void test_a_rotor_at_rest_or_nearly_is_aligned_after_the_same_ten_milliseconds(void)
{
    static const float speeds[] = { 0.0F, 40.0F, -40.0F };
    EACH(n, speeds) {
        turning(speeds[n], 36.0F, n);
        TEST_ASSERT_EQUAL_UINT32(201, start_to(1, DRIVE_ALIGN, 300));
    }
}

void test_a_rotor_that_stops_before_the_second_look_is_aligned(void)
{
    turning(1000.0F, 36.0F, 0);
    drive_start(&drive, &params, 1);
    (void)ideal_motor_run_until(DRIVE_CATCH, 300);
    motor.blocked = 1;
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(1300, ideal_motor_run_until(DRIVE_ALIGN, 1300));
    EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, "stopped");
}

void test_a_rotor_that_is_too_fast_is_waited_for_with_the_outputs_off_and_then_caught(void)
{
    uint32_t on = 0, n;
    turning(30000.0F, 36.0F, 5);
    drive_start(&drive, &params, 1);
    drive.command.target_erpm = 6000;
    ideal_motor_run(300);
    for (n = 0; n < 6000u; n++) {
        ideal_motor_run(1);
        on += (uint32_t)(out.outputs != (uint16_t)OUTPUTS_OFF);
        TEST_ASSERT_TRUE(drive.state == (uint16_t)DRIVE_CATCH || drive.state == (uint16_t)DRIVE_BOOTSTRAP);
    }
    TEST_ASSERT_UINT32_WITHIN(18, 18, on); /* 50 ms from two looks to the next two: some periods */
    (void)ideal_motor_run_until(DRIVE_CATCH, 100);
    ideal_motor_run(100);
    TEST_ASSERT_EQUAL_HEX16(LIMIT_TOO_FAST, limits_reasons(&drive, &params));
    motor.omega *= 0.8F; /* 24000 erpm: below MAXIMUM_SPEED_RPM */
    motor.bus_v = 32.0F;
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(1300, ideal_motor_run_until(DRIVE_CLOSED, 1300));
    ideal_motor_run(2000);
    EXPECT_DRIVE(DRIVE_CLOSED, FAULT_NONE, "caught");
    TEST_ASSERT_TRUE(motor.highest_a < MOST_A);
}

void test_a_start_waits_for_a_bus_that_would_trip_and_no_longer(void)
{
    rig_ready();
    rig_bus(33.5F);
    rig_tick(800);
    drive_start(&drive, &params, 1);
    rig_tick(4000);
    EXPECT_DRIVE(DRIVE_CATCH, FAULT_NONE, "33.5 V of 34");
    TEST_ASSERT_EQUAL_HEX16(LIMIT_TOO_FAST, limits_reasons(&drive, &params));
    rig_bus(32.5F);
    rig_tick(400);
    EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, "32.5 V");
}

void test_a_bus_that_stays_where_a_rotor_would_let_it_fall_is_the_supply_s(void)
{
    static const struct {
        const char *what;
        float fall_v_per_s;
        drive_fault_t fault;
    } cases[] = { { "supply", 0.0F, FAULT_OVERVOLTAGE }, { "flywheel", 0.15F, FAULT_OVERVOLTAGE }, { "rotor", 0.4F, FAULT_NONE } };
    EACH(n, cases) {
        float bus_v = 33.9F;
        uint16_t part;
        rig_power_up();
        rig_ready();
        rig_bus(bus_v);
        rig_tick(800);
        drive_start(&drive, &params, 1);
        for (part = 0; part < 160u; part++) { /* of 10 ms: the count wraps too */
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(FAULT_NONE, (part <= 80u) ? drive.fault : (uint16_t)FAULT_NONE, cases[n].what);
            bus_v -= 0.01F * cases[n].fall_v_per_s;
            rig_bus(bus_v);
            rig_tick(200);
        }
        EXPECT_DRIVE((cases[n].fault == FAULT_NONE) ? DRIVE_CATCH : DRIVE_FAULT, cases[n].fault, cases[n].what);
    }
}

void test_a_request_that_is_withdrawn_between_two_looks_stops(void)
{
    turning(4000.0F, 36.0F, 6);
    drive_start(&drive, &params, 1);
    (void)ideal_motor_run_until(DRIVE_CATCH, 300);
    drive.command.run = 0;
    ideal_motor_run(1);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "withdrawn");
}

/** The phases that a start goes through on this rotor until a state, or in so many periods; none of them twice in a row. */
static void expect_phases(const char *expected, float bus_v, drive_state_t until, uint16_t most)
{
    static const char letters[] = "-12b.f!"; /* no look, first, second, bus high, pause, too fast, seen */
    char seen[12] = "";
    size_t count = 0;
    drive_start(&drive, &params, 1);
    motor.bus_v = bus_v;
    while (drive.state != (uint16_t)until && most-- != 0u) {
        const char now = letters[drive.run.catching.phase];
        if ((count == 0u || seen[count - 1u] != now) && count + 1u < sizeof seen) {
            seen[count] = now;
            count++;
        }
        ideal_motor_run(1);
        motor.bus_v = (most < 3000u) ? PARAM_F(NOMINAL_BUS_V) : bus_v;
    }
    TEST_ASSERT_EQUAL_STRING(expected, seen);
}

void test_a_catch_goes_through_its_phases(void)
{
    turning(6000.0F, 36.0F, 3);
    expect_phases("1.2!", PARAM_F(NOMINAL_BUS_V), DRIVE_CLOSED, 1000);
    TEST_ASSERT_EQUAL_UINT16(START_OBSERVE, drive.run.handover.phase); /* the hand-over's part of it is done */
    turning(0.0F, 36.0F, 3);
    expect_phases("1-", PARAM_F(NOMINAL_BUS_V), DRIVE_ALIGN, 1000);
    turning(30000.0F, 36.0F, 3);
    expect_phases("1.2f1.2f", PARAM_F(NOMINAL_BUS_V), DRIVE_CLOSED, 1500);
    turning(0.0F, 36.0F, 3);
    motor.bus_v = 33.5F;
    ideal_motor_run(2000); /* the filter follows */
    expect_phases("1b1-", 33.5F, DRIVE_ALIGN, 5000);
}

void test_without_FLYING_START_every_start_is_aligned(void)
{
    turning(10000.0F, 36.0F, 4);
    drive_start(&drive, &params, 1);
    drive.run.catching.phase = (uint16_t)CATCH_NO_LOOK;
    motor.omega = 0.0F;
    TEST_ASSERT_EQUAL_UINT32(201, ideal_motor_run_until(DRIVE_ALIGN, 300));
}

void test_FLYING_START_is_what_asks_for_the_first_look(void)
{
    drive_params_t none = params;
    rig_ready();
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_UINT16(CATCH_FIRST_LOOK, drive.run.catching.phase);
    rig_ready();
    none.flying_start = 0;
    drive_start(&drive, &none, 1);
    TEST_ASSERT_EQUAL_UINT16(CATCH_NO_LOOK, drive.run.catching.phase);
}

/* ---- a stop goes on, a run is reversed ---- */

void test_a_stop_goes_on_from_the_present_speed_and_a_target_the_other_way_slows_down(void)
{
    EACH_DIRECTION(direction) {
        rig_closed(direction, (int16_t)(direction * 10000));
        drive.state = (uint16_t)DRIVE_STOPPING;
        drive.command.run = 0;
        speed_choose_state(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
        drive.command.run = 1;
        rig_next_part(6);
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
        TEST_ASSERT_INT16_WITHIN(20, (int16_t)(direction * 10000), drive.run.control.reference_erpm);
        drive.command.target_erpm = (int16_t)(direction * -10000);
        rig_next_part(6);
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
        TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
        TEST_ASSERT_EQUAL_INT16(direction, drive.direction);
    }
}

void test_a_stop_that_goes_on_forgets_a_load_that_drives_and_keeps_one_that_brakes(void)
{
    EACH_DIRECTION(direction) {
        static const int16_t loads[] = { 300, -300 };
        EACH(n, loads) {
            rig_closed(direction, (int16_t)(direction * 10000));
            drive.run.control.reference_erpm = (int16_t)(direction * 7000); /* far ahead of the rotor */
            drive.run.observer.load_q16 = (int32_t)direction * loads[n] * 65536;
            drive.state = (uint16_t)DRIVE_STOPPING;
            speed_choose_state(&drive, &params);
            TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
            TEST_ASSERT_EQUAL_INT16(direction * 10000, drive.run.control.reference_erpm);
            TEST_ASSERT_EQUAL_INT32((loads[n] > 0) ? (int32_t)direction * loads[n] * 65536 : 0, drive.run.observer.load_q16);
        }
    }
}

void test_a_stop_turns_round_only_at_its_end_for_a_target_the_other_way_while_the_run_is_wished(void)
{
    static const struct {
        int16_t speed, reference, target, run;
        drive_state_t after;
    } cases[] = {
        { 4000, 2400, -6000, 1, DRIVE_STOPPING }, { 2400, 2600, -6000, 1, DRIVE_STOPPING },
        { 2400, 2400, -6000, 0, DRIVE_STOPPED }, { 2400, 2400, 6000, 1, DRIVE_CLOSED }
    };
    EACH(n, cases) {
        EACH_DIRECTION(direction) {
            rig_closed(direction, (int16_t)(direction * cases[n].speed));
            drive.run.control.reference_erpm = (int16_t)(direction * cases[n].reference);
            drive.state = (uint16_t)DRIVE_STOPPING;
            drive.command.target_erpm = (int16_t)(direction * cases[n].target);
            drive.command.run = cases[n].run;
            rig_slow(2);
            rig_slow(3);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(DRIVE_STOPPING, drive.state, golden_row(n));
            rig_slow(1);
            rig_slow(6);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].after, drive.state, golden_row(n));
        }
    }
}

void test_the_end_of_a_stop_is_a_ramp_the_other_way_if_the_run_is_still_wished(void)
{
    EACH_DIRECTION(direction) {
        const dq_t v_q14 = { -900, (int16_t)(direction * 2500) };
        alphabeta_t before, after;
        rig_closed(direction, (int16_t)(direction * 2400));
        drive.state = (uint16_t)DRIVE_STOPPING;
        drive.command.target_erpm = (int16_t)(direction * -6000);
        drive.run.handover.agreed_steps = 99; /* of the start long ago */
        drive.run.handover.phase = (uint16_t)START_HAND_OVER;
        drive.run.estimator.rho_q32 = 0x12340000ul;
        drive.run.control.v_q14 = v_q14;
        drive.run.control.flux_brake_q13 = 2000;
        drive.run.handover.ahead_erpm = 300;
        drive.run.handover.offset = 500;
        drive.run.handover.id_q13 = -30;
        before = inverse_park(v_q14, trig_sincos(estimator_next_angle(&drive.run.estimator)));
        rig_slow(1);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_RAMP, drive.state);
        after = inverse_park(drive.run.control.v_q14, drive.frame);
        TEST_ASSERT_INT16_WITHIN(2, before.alpha, after.alpha); /* the voltage does not jump */
        TEST_ASSERT_INT16_WITHIN(2, before.beta, after.beta);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.control.flux_brake_q13);
        TEST_ASSERT_EQUAL_INT16(-direction, drive.direction);
        TEST_ASSERT_INT32_WITHIN(100, -2400L * 3579 / 64, drive.forced.speed_q10);
        TEST_ASSERT_EQUAL_HEX32((uint32_t)(-direction * drive.forced.speed_q10 * 64), drive.forced.step_q32); /* of the very next period */
        TEST_ASSERT_EQUAL_INT16(-direction * params.open_loop_q13, drive.run.control.ref_q13.q);
        TEST_ASSERT_EQUAL_UINT16(0, drive.run.handover.agreed_steps);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.ahead_erpm);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.offset);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.id_q13);
        TEST_ASSERT_EQUAL_UINT16(START_RAMP, drive.run.handover.phase); /* the next hand-over presets the observer anew */
        /* the current lies along the rotor's flux */
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)estimator_next_angle(&drive.run.estimator), (int16_t)(angle_t)(drive.angle - (angle_t)(direction * 0x4000)));
    }
}
