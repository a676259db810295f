/* Protection: over-current in the same period, bus trips within a slow step, stall and lost lock only when they last. */
#include "drive_rig.h"

void setUp(void)
{
    rig_power_up();
}

/* ---- over-current: 3.8 A = 7075 counts ---- */

void test_overcurrent_of_any_phase_and_sign_trips_above_3_8_A_in_the_same_period(void)
{
    static const struct {
        int16_t a_q13, b_q13; /* c is not measured: -a - b */
        uint16_t fault;
    } cases[] = {
        { 7075, -3537, FAULT_NONE }, { 7076, -3538, FAULT_OVERCURRENT_SW },
        { -7075, 3537, FAULT_NONE }, { -7076, 3538, FAULT_OVERCURRENT_SW },
        { -3537, 7075, FAULT_NONE }, { -3538, 7076, FAULT_OVERCURRENT_SW },
        { 3537, -7075, FAULT_NONE }, { 3538, -7076, FAULT_OVERCURRENT_SW },
        { 3537, 3538, FAULT_NONE }, { 3538, 3538, FAULT_OVERCURRENT_SW },
        { -3537, -3538, FAULT_NONE }, { -3538, -3538, FAULT_OVERCURRENT_SW },
    };
    EACH(n, cases) {
        rig_lock(1);
        rig_currents(cases[n].a_q13, cases[n].b_q13);
        rig_tick(1);
        EXPECT_DRIVE(cases[n].fault ? DRIVE_FAULT : DRIVE_ALIGN, cases[n].fault, golden_row(n));
    }
}

void test_overcurrent_trips_in_every_state_with_the_bridge_on_and_in_no_other(void)
{
    uint16_t state;
    for (state = DRIVE_BOOTSTRAP; state <= (uint16_t)DRIVE_STOPPING; state++) {
        rig_lock(1);
        drive.state = state;
        drive.periods = 50;
        rig_currents(7076, 0);
        rig_tick(1);
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERCURRENT_SW, golden_row(state));
    }
    rig_currents(0, 0);
    rig_tick(10);
    drive.command.clear_fault = 1;
    rig_tick(1);
    rig_currents(8000, 0);
    rig_tick(100);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "bridge off");
}

void test_overcurrent_uses_the_current_without_its_offset(void)
{
    rig_currents(1000, 0);
    rig_tick(1024);
    drive_start(&drive, &params, 1);
    (void)rig_tick_until(DRIVE_ALIGN, 300);
    rig_currents(1000 + 7075, -3537);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    rig_currents(-7075, 3537);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_SW, drive.fault);
}

/* ---- bus: 34 V = 21101 counts of 52.8 V / 32768, 12 V = 7447 ---- */

/** Sample whose 15 bits are exactly this. */
static int16_t raw_bus_q15(uint16_t bus_q15)
{
    return (int16_t)((uint16_t)(bus_q15 << 1) ^ 0x8000u);
}

/** In a state, healthy, then this bus for some periods. */
static void bus_in_state(uint16_t state, uint16_t bus_q15, uint16_t periods)
{
    rig_bus(PARAM_F(NOMINAL_BUS_V));
    rig_lock(1);
    rig_next_slot(2);
    drive.state = state;
    rig_speed(10000);
    drive.run.control.reference_erpm = 10000;
    samples.v_bus = raw_bus_q15(bus_q15);
    rig_tick(periods);
}

void test_overvoltage_trips_on_one_sample_in_every_state_that_has_something_on(void)
{
    uint16_t state;
    for (state = DRIVE_BOOTSTRAP; state <= (uint16_t)DRIVE_STOPPING; state++) {
        bus_in_state(state, 21102, 1);
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERVOLTAGE, golden_row(state));
    }
    rig_ready();
    samples.v_bus = raw_bus_q15(21102);
    rig_tick(800);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "at rest there is nothing to switch off");
    bus_in_state(DRIVE_ALIGN, 21101, 800);
    EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, "at the level");
}

void test_undervoltage_trips_while_the_bridge_is_on(void)
{
    uint16_t state;
    for (state = DRIVE_BOOTSTRAP; state <= (uint16_t)DRIVE_STOPPING; state++) {
        bus_in_state(state, 0, 32);
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_UNDERVOLTAGE, golden_row(state));
    }
    bus_in_state(DRIVE_ALIGN, 7447, 800);
    EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, "at the level");
    samples.v_bus = raw_bus_q15(7446);
    rig_tick(800);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_UNDERVOLTAGE, "a count below");
    bus_in_state(DRIVE_ALIGN, 0, 8);
    rig_bus(24.0F);
    rig_tick(80);
    EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, "one low sample rides through");
}

void test_undervoltage_waits_for_a_start_and_comes_before_the_first_pulse(void)
{
    samples.v_bus = raw_bus_q15(0);
    rig_tick(1024);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "calibration");
    rig_tick(2000);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "rest");
    drive_start(&drive, &params, 1);
    rig_tick(200);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_UNDERVOLTAGE, "start");
}

/* ---- stall and lost lock: steps of 400 us ---- */

void test_stall_and_lost_lock_are_faults_when_they_last(void)
{
    enum { NEVER = 2000, STALL = 751, LOST_LOCK = 63 }; /* 300 ms, 25 ms */
    static const struct {
        const char *what;
        int16_t reference_erpm, speed_erpm, e_d, e_q;
        uint16_t steps;
    } cases[] = {
        { "below half the reference", 10000, 4999, 0, 100, STALL },
        { "of a reverse reference", -10000, 4999, 0, 100, STALL },
        { "backwards", 10000, -4999, 0, 100, STALL },
        { "half the reference", 10000, 5000, 0, 100, NEVER },
        { "half of a reverse reference", -10000, -5000, 0, -100, NEVER },
        { "of a low reference", 4000, 1999, 0, 100, STALL },
        { "below half the minimum speed", 0, 1249, 0, 100, STALL },
        { "whatever the reference", 2000, 1249, 0, 100, STALL },
        { "half the minimum speed", 0, 1250, 0, 100, NEVER },
        { "d EMF above q EMF", 10000, 10000, 1001, 1000, LOST_LOCK },
        { "negative d EMF", 10000, 10000, -1001, 1000, LOST_LOCK },
        { "negative q EMF", -10000, -10000, 1001, -1000, LOST_LOCK },
        { "of a standing rotor the d EMF says nothing: it stalls", 10000, 1249, 1001, 1000, STALL },
        { "d EMF above q EMF at half the minimum speed", 2000, 1250, 1001, 1000, LOST_LOCK },
        { "d EMF as large as q EMF", 10000, 10000, 1000, 1000, NEVER },
        { "negative d EMF as large", 10000, 10000, -1000, 1000, NEVER },
        { "d EMF as large as a negative q EMF", -10000, -10000, 1000, -1000, NEVER },
        { "impossible speed", 27500, 32701, 0, 1000, LOST_LOCK }, /* 1.25 * 27500 does not fit the format */
        { "impossible reverse speed", -27500, -32701, 0, 1000, LOST_LOCK },
        { "highest speed", 27500, 32700, 0, 1000, NEVER },
    };
    EACH(n, cases) {
        uint16_t steps = 0, fault;
        rig_closed(1, cases[n].reference_erpm);
        rig_speed(cases[n].speed_erpm);
        drive.run.estimator.e_d_q28 = (int32_t)cases[n].e_d * 65536;
        drive.run.estimator.e_q_q28 = (int32_t)cases[n].e_q * 65536;
        while (drive.state == (uint16_t)DRIVE_CLOSED && steps < (uint16_t)NEVER) {
            protection_check_rotor(&drive, &params);
            steps++;
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].steps, steps, cases[n].what);
        fault = (uint16_t)((steps == (uint16_t)STALL) ? FAULT_STALL : (steps == (uint16_t)LOST_LOCK) ? FAULT_LOST_LOCK : FAULT_NONE);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(fault, drive.fault, cases[n].what);
    }
}

/** Protection steps with this speed and d EMF, q EMF 1000. */
static void steps(uint16_t count, int16_t speed_erpm, int16_t e_d)
{
    rig_speed(speed_erpm);
    drive.run.estimator.e_d_q28 = (int32_t)e_d * 65536;
    drive.run.estimator.e_q_q28 = 1000L * 65536;
    while (count-- != 0u) {
        protection_check_rotor(&drive, &params);
    }
}

void test_short_dips_of_speed_and_short_losses_of_lock_ride_through(void)
{
    uint16_t n;
    rig_closed(1, 10000);
    for (n = 0; n < 3u; n++) {
        steps(750, 1000, 0);
        steps(1, 6000, 0);
        steps(62, 10000, 2000);
        steps(124, 10000, 0);
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_estimator_that_slips_past_the_rotor_has_lost_it_though_each_loss_is_short(void)
{
    static const struct {
        uint16_t lost, held; /* steps, in turn */
        drive_state_t state;
    } cases[] = { { 1, 1, DRIVE_FAULT }, { 20, 20, DRIVE_FAULT }, { 3, 5, DRIVE_FAULT }, { 1, 2, DRIVE_CLOSED }, { 20, 40, DRIVE_CLOSED } };
    EACH(n, cases) {
        uint16_t turn;
        rig_closed(1, 10000);
        for (turn = 0; turn < 2000u; turn++) {
            steps(cases[n].lost, 10000, 2000);
            steps(cases[n].held, 10000, 0);
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].state, drive.state, golden_row(n));
    }
}

/* ---- signals that do not fit the motor ---- */

/** Slow steps with these phase currents and innovations that do not end, until a fault. @return steps */
static uint16_t wrong_until_fault(int16_t a_q13, int16_t b_q13)
{
    uint16_t steps = 0;
    rig_closed(1, 10000);
    while (drive.fault == (uint16_t)FAULT_NONE && steps < 1000u) {
        drive.phases_q13.a = a_q13;
        drive.phases_q13.b = b_q13;
        drive.phases_q13.c = (int16_t)(-a_q13 - b_q13);
        drive.run.observer.wrong_steps++;
        protection_check_signals(&drive, &params);
        steps++;
    }
    return steps;
}

void test_innovations_that_do_not_end_are_a_sensor_or_an_open_phase_after_100_ms(void)
{
    static const struct {
        int16_t a_q13, b_q13;
        drive_fault_t fault;
    } cases[] = {
        { 1000, -500, FAULT_CURRENT_SENSOR }, { -1000, 500, FAULT_CURRENT_SENSOR }, { 1000, -700, FAULT_CURRENT_SENSOR },
        { 10, 1000, FAULT_OPEN_PHASE }, { 1000, -10, FAULT_OPEN_PHASE }, { -1000, 990, FAULT_OPEN_PHASE }, { 7000, 70, FAULT_OPEN_PHASE },
        { 7000, -7000, FAULT_OPEN_PHASE }, { 0, 0, FAULT_CURRENT_SENSOR },
    };
    EACH(n, cases) {
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(251, wrong_until_fault(cases[n].a_q13, cases[n].b_q13), golden_row(n));
        TEST_ASSERT_EQUAL_UINT16(cases[n].fault, drive.fault);
        drive.fault = (uint16_t)FAULT_NONE;
    }
}

void test_phase_currents_are_summed_anew_when_the_innovations_have_ended(void)
{
    rig_closed(1, 10000);
    drive.run.phase_sums[1] = 77;
    protection_check_signals(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.phase_sums[1]);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

/* ---- what a motor cannot have ---- */

/** Steps until a fault with these changes of 1/Kphi and R, and q current. */
static uint16_t impossible_until_fault(float kfi, float rs, int16_t iq_q13, uint16_t most)
{
    uint16_t steps = 0;
    rig_closed(1, 10000);
    drive.run.adaptation.kfi_q31 = (int32_t)(kfi * 2147483647.0);
    drive.run.adaptation.rs_q31 = (int32_t)(rs * 2147483647.0);
    drive.run.estimator.e_q_q28 = 4000L * 65536;
    drive.run.control.i_q13.q = iq_q13;
    while (drive.fault == (uint16_t)FAULT_NONE && steps < most) {
        protection_check_model(&drive, &params);
        steps++;
    }
    return steps;
}

void test_flux_that_no_magnet_has_and_a_winding_too_hot_are_faults_after_a_quarter_of_a_second(void)
{
    TEST_ASSERT_EQUAL_UINT16(1000, impossible_until_fault(-0.249F, 0.0F, 100, 1000)); /* a third more flux */
    TEST_ASSERT_EQUAL_UINT16(626, impossible_until_fault(-0.251F, 0.0F, 100, 1000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_BUS_SENSOR, drive.fault);
    drive.fault = (uint16_t)FAULT_NONE;
    TEST_ASSERT_EQUAL_UINT16(1000, impossible_until_fault(0.0F, 0.599F, 100, 1000));
    TEST_ASSERT_EQUAL_UINT16(626, impossible_until_fault(0.0F, 0.6F, 100, 1000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERTEMPERATURE, drive.fault);
    drive.fault = (uint16_t)FAULT_NONE;
    TEST_ASSERT_EQUAL_UINT16(1000, impossible_until_fault(-0.251F, 0.0F, 5000, 1000)); /* R may be mistaken for flux there */
    TEST_ASSERT_EQUAL_UINT16(600, impossible_until_fault(-0.251F, 0.0F, 100, 600));
    drive.run.adaptation.kfi_q31 = 0;
    protection_check_model(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.impossible_steps); /* without a gap */
}

void test_signals_and_model_are_checked_in_slow_steps_of_closed_loop_only(void)
{
    uint16_t slot;
    for (slot = 0; slot < 8u; slot++) {
        rig_closed(1, 10000);
        drive.run.observer.wrong_steps = 1000;
        drive.run.impossible_steps = 1000;
        drive.run.adaptation.rs_q31 = INT32_MAX;
        drive.ticks = slot;
        drive_slow(&drive, &params, rig_raw_bus(24.0F));
        TEST_ASSERT_EQUAL_UINT16((slot == 4u) ? FAULT_CURRENT_SENSOR : (slot == 6u) ? FAULT_OVERTEMPERATURE : FAULT_NONE, drive.fault);
        drive.fault = (uint16_t)FAULT_NONE;
    }
    rig_lock(1);
    drive.run.observer.wrong_steps = 1000;
    drive.run.impossible_steps = 1000;
    for (slot = 0; slot < 8u; slot++) {
        drive.ticks = slot;
        drive_slow(&drive, &params, rig_raw_bus(24.0F));
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault); /* no estimate is used yet */
}
