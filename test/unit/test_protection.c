/* Protection: over-current in the same period, bus trips within a slow step, stall and lost lock only when they last. */
#include "drive_rig.h"

#include "drive/protection.h"
#include "drive/signals.h"

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

void test_the_check_of_the_current_tells_whether_it_has_tripped(void)
{
    rig_closed(1, 10000);
    drive.phases_q13.a = params.overcurrent_q13;
    TEST_ASSERT_EQUAL_UINT16(0, protection_check_current(&drive, &params));
    drive.phases_q13.a = (int16_t)(params.overcurrent_q13 + 1);
    TEST_ASSERT_EQUAL_UINT16(1, protection_check_current(&drive, &params));
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_SW, drive.fault);
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
    rig_next_part(1);
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
    samples.v_bus = raw_bus_q15(32639);
    rig_tick(800);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "nor below the end of what can be measured");
    samples.v_bus = raw_bus_q15(32640);
    rig_tick(8);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERVOLTAGE, "at its end");
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
    enum { NEVER = 2000, STALL = 289, LOST_LOCK = 38 }; /* 230 ms, 30 ms */
    static const struct {
        const char *what;
        int16_t reference_erpm, speed_erpm, e_d, e_q;
        uint16_t steps;
    } cases[] = {
        { "below half the reference", 10000, 4999, 0, 100, STALL },
        { "of a reverse reference", -10000, 4999, 0, 100, STALL },
        { "backwards", 10000, -4999, 0, 100, STALL }, { "backwards as fast as it should forwards", 10000, -10000, 0, 100, STALL },
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
        rig_closed((int16_t)((cases[n].reference_erpm < 0) ? -1 : 1), cases[n].reference_erpm);
        drive.run.control.ref_q13.q = (int16_t)((params.current_max_q13 >> STALL_ASKS_SHIFT) + 1);
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

void test_rotor_that_turns_at_more_than_a_quarter_of_the_reference_with_little_current_is_on_its_way(void)
{
    static const struct {
        const char *what;
        int16_t reference_erpm, speed_erpm, more_q13;
        uint16_t fault;
    } cases[] = {
        { "half of the current", 10000, 2500, 0, FAULT_NONE },
        { "more of it", 10000, 2500, 1, FAULT_STALL },
        { "a quarter of the reference", 10000, 2499, 0, FAULT_STALL },
        { "the other way round", -10000, -2500, 0, FAULT_NONE },
        { "more of it, the other way round", -10000, -2500, 1, FAULT_STALL },
        { "a quarter of the minimum speed", 2000, 625, 0, FAULT_NONE },
        { "less", 2000, 624, 0, FAULT_STALL },
        { "backwards", 10000, -2500, 0, FAULT_STALL },
    };
    EACH(n, cases) {
        const int16_t direction = (int16_t)((cases[n].reference_erpm < 0) ? -1 : 1);
        uint16_t count;
        rig_closed(direction, cases[n].reference_erpm);
        drive.run.control.ref_q13.q = (int16_t)(direction * ((params.current_max_q13 >> STALL_ASKS_SHIFT) + cases[n].more_q13));
        rig_speed(cases[n].speed_erpm);
        drive.run.estimator.e_q_q28 = 100L * 65536;
        for (count = 0; count < 2u * params.stall_steps && drive.state == (uint16_t)DRIVE_CLOSED; count++) {
            protection_check_rotor(&drive, &params);
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].fault, drive.fault, cases[n].what);
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
        steps(288, 1000, 0);
        steps(72, 6000, 0); /* a quarter of it */
        steps(31, 10000, 2000);
        steps(62, 10000, 0);
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_rotor_that_only_jerks_has_stalled_though_it_is_fast_now_and_then(void)
{
    uint16_t turn;
    rig_closed(1, 10000);
    for (turn = 0; turn < 4u; turn++) {
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
        steps(150, 1000, 0);
        steps(25, 10000, 0);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
}

void test_estimator_that_slips_past_the_rotor_has_lost_it_though_each_loss_is_short(void)
{
    static const struct {
        uint16_t lost, held; /* steps, in turn */
        drive_state_t state;
    } cases[] = { { 1, 1, DRIVE_FAULT }, { 10, 10, DRIVE_FAULT }, { 3, 5, DRIVE_FAULT }, { 1, 2, DRIVE_CLOSED }, { 10, 20, DRIVE_CLOSED } };
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

void test_of_a_lost_rotor_a_stall_is_named_only_where_it_has_lasted_too_long(void)
{
    rig_closed(1, 10000);
    rig_emf(2000, 1000);
    drive.run.stall_steps = (uint16_t)(params.stall_steps + STALL_FALL); /* falls to what is not too long */
    drive.run.lost_lock_steps = params.lost_lock_steps;
    protection_check_rotor(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(FAULT_LOST_LOCK, drive.fault);
}

void test_as_many_steps_out_of_lock_as_may_be_are_no_fault(void)
{
    rig_closed(1, 10000);
    rig_emf(1000, 2000);
    drive.run.lost_lock_steps = (uint16_t)(params.lost_lock_steps + 1u);
    protection_check_rotor(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(params.lost_lock_steps, drive.run.lost_lock_steps);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

/* ---- a rotor that may stand ---- */

/** Seldom steps of the probe with this back-EMF; the d current goes on. @return the largest d current seen */
static int16_t probe(uint16_t count, int16_t d_q12, int16_t q_q12)
{
    int16_t most = 0;
    rig_emf(d_q12, q_q12);
    while (count-- != 0u) {
        protection_probe_rotor(&drive, &params);
        most = (drive.run.probe_id_q13 > most) ? drive.run.probe_id_q13 : most;
    }
    return most;
}

/** Closed loop at the reference with a q current whose R i is that share of a back-EMF of 400. */
static void loaded(float ri)
{
    rig_closed(1, 10000);
    drive.run.control.i_q13.q = rig_current_of_ri(0.1F * ri);
    drive.run.control.ref_q13.q = drive.run.control.i_q13.q;
}

void test_rotor_is_probed_where_half_more_resistance_and_dead_time_would_explain_the_back_emf(void)
{
    const float dead = (float)params.adaptation.emf_least_q12 / 400.0F;
    loaded(2.0F * (1.0F - dead) - 0.02F);
    TEST_ASSERT_EQUAL_INT16(0, probe(300, 0, 400));
    loaded(2.0F * (1.0F - dead) + 0.02F);
    TEST_ASSERT_EQUAL_INT16(0, probe(13, 0, 400)); /* it seems to turn for 20 ms */
    TEST_ASSERT_EQUAL_INT16(drive.run.control.ref_q13.q, probe(15, 0, 400));
    TEST_ASSERT_EQUAL_INT16(0, (probe(20, 0, 400), drive.run.probe_id_q13)); /* 40 ms and the slope */
    loaded(2.2F);
    drive.run.adaptation.rs_q31 = INT32_MAX / 5; /* known: a fifth more */
    TEST_ASSERT_EQUAL_INT16(0, probe(300, 0, 400));
    loaded(2.2F);
    drive.run.handover.id_q13 = 100; /* the hand-over's d current would do the same */
    TEST_ASSERT_EQUAL_INT16(0, probe(300, 0, 400));
}

void test_probe_of_a_standing_rotor_stays_until_the_stall_and_that_of_a_turning_one_ends(void)
{
    loaded(2.2F);
    (void)probe(16, 0, 400);
    rig_speed(1000);
    TEST_ASSERT_GREATER_THAN_INT16(0, (probe(200, 30, 100), drive.run.probe_id_q13)); /* E has the current's direction */
    loaded(2.2F);
    (void)probe(16, 0, 400);
    rig_speed(1000);
    TEST_ASSERT_EQUAL_INT16(0, (probe(50, 20, 100), drive.run.probe_id_q13)); /* slow, but it turns */
}

void test_probe_of_a_rotor_at_exactly_half_of_the_reference_ends_and_of_one_below_stays(void)
{
    loaded(2.2F);
    (void)probe(16, 0, 400);
    rig_speed(5000);
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, (probe(22, 100, 100), drive.run.probe_phase));
    loaded(2.2F);
    (void)probe(16, 0, 400);
    rig_speed(4999);
    TEST_ASSERT_EQUAL_UINT16(PROBE_TEST, (probe(22, 100, 100), drive.run.probe_phase));
}

void test_probe_sees_no_turn_in_a_back_emf_whose_d_part_is_a_quarter(void)
{
    loaded(2.2F);
    (void)probe(16, 0, 400);
    rig_speed(4000);
    TEST_ASSERT_EQUAL_UINT16(PROBE_TEST, (probe(100, 25, 100), drive.run.probe_phase));
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, (probe(25, 24, 100), drive.run.probe_phase));
}

void test_without_current_a_rotor_is_doubtful_up_to_what_dead_time_may_make(void)
{
    loaded(0.0F);
    EACH_DIRECTION(sign) {
        rig_emf(0, (int16_t)(sign * params.adaptation.emf_least_q12));
        TEST_ASSERT_EQUAL_UINT16(1, protection_rotor_is_doubtful(&drive.run, &params));
        rig_emf(0, (int16_t)(sign * (params.adaptation.emf_least_q12 + 1)));
        TEST_ASSERT_EQUAL_UINT16(0, protection_rotor_is_doubtful(&drive.run, &params));
    }
}

void test_a_probe_waits_anew_after_a_step_below_half_of_the_reference(void)
{
    loaded(2.2F);
    rig_speed(5000);
    TEST_ASSERT_EQUAL_UINT16(PROBE_WAIT, (probe(12, 0, 400), drive.run.probe_phase));
    rig_speed(4999);
    (void)probe(1, 0, 400);
    rig_speed(5000);
    TEST_ASSERT_EQUAL_UINT16(PROBE_WAIT, (probe(12, 0, 400), drive.run.probe_phase));
    TEST_ASSERT_EQUAL_UINT16(PROBE_TEST, (probe(1, 0, 400), drive.run.probe_phase));
}

void test_three_quarters_of_the_reference_are_no_dip(void)
{
    loaded(2.2F);
    (void)probe(38, 0, 400);
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, drive.run.probe_phase);
    rig_speed(7500);
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, (probe(20, 0, 400), drive.run.probe_phase));
    rig_speed(7499);
    TEST_ASSERT_EQUAL_UINT16(PROBE_WAIT, (probe(6, 0, 400), drive.run.probe_phase));
}

void test_probe_of_a_rotor_without_q_current_has_no_d_current(void)
{
    loaded(2.2F);
    (void)probe(13, 0, 400);
    drive.run.control.ref_q13.q = 0;
    TEST_ASSERT_EQUAL_INT16(0, probe(5, 0, 400));
    TEST_ASSERT_EQUAL_UINT16(PROBE_TEST, drive.run.probe_phase);
}

void test_d_current_of_a_probe_rises_and_falls_by_an_eighth_of_the_largest_a_step(void)
{
    const int16_t slope = (int16_t)(params.current_max_q13 >> 3);
    int16_t most;
    loaded(3.4F);
    TEST_ASSERT_EQUAL_INT16(0, probe(13, 0, 400));
    most = drive.run.control.ref_q13.q;
    TEST_ASSERT_GREATER_THAN_INT16(4 * slope, most);
    TEST_ASSERT_EQUAL_INT16(slope, probe(1, 0, 400));
    TEST_ASSERT_EQUAL_INT16(3 * slope, probe(2, 0, 400));
    TEST_ASSERT_EQUAL_INT16(most, probe(22, 0, 400));
    (void)probe(2, 0, 400);
    TEST_ASSERT_INT16_WITHIN(slope, most - 2 * slope, drive.run.probe_id_q13);
}

void test_a_probe_goes_through_its_phases(void)
{
    loaded(2.2F);
    TEST_ASSERT_EQUAL_UINT16(PROBE_WAIT, (probe(12, 0, 400), drive.run.probe_phase));
    TEST_ASSERT_EQUAL_UINT16(PROBE_TEST, (probe(1, 0, 400), drive.run.probe_phase)); /* 13 steps, 20 ms */
    TEST_ASSERT_EQUAL_UINT16(PROBE_TEST, (probe(24, 0, 400), drive.run.probe_phase));
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, (probe(1, 0, 400), drive.run.probe_phase)); /* 25 steps, 40 ms */
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, (probe(3087, 0, 400), drive.run.probe_phase));
    TEST_ASSERT_EQUAL_UINT16(PROBE_WAIT, (probe(1, 0, 400), drive.run.probe_phase));
    (void)probe(13, 0, 400);
    drive.run.handover.id_q13 = 10; /* nothing to doubt */
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, (probe(1, 0, 400), drive.run.probe_phase));
}

void test_probe_comes_again_after_five_seconds_or_a_dip_of_10_ms(void)
{
    loaded(2.2F);
    (void)probe(50, 0, 400);
    TEST_ASSERT_EQUAL_INT16(0, probe(3075, 0, 400));
    TEST_ASSERT_GREATER_THAN_INT16(0, probe(50, 0, 400));
    rig_speed(7400);
    TEST_ASSERT_EQUAL_INT16(0, (probe(5, 0, 400), rig_speed(10000), probe(250, 0, 400)));
    rig_speed(7400);
    (void)probe(6, 0, 400);
    rig_speed(10000); /* the sixth step was the one */
    TEST_ASSERT_GREATER_THAN_INT16(0, probe(25, 0, 400));
}

void test_probe_comes_again_after_half_a_second_where_something_changed_fast_but_for_its_own_unrest(void)
{
    loaded(2.2F);
    (void)probe(38, 0, 400);
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, drive.run.probe_phase);
    drive.run.observer.fast_share_q15 = 32767; /* the gate opens within a tenth of a second: the probe's own doing */
    (void)probe(PROBE_CALM_STEPS, 0, 400);
    drive.run.observer.fast_share_q15 = 0;
    TEST_ASSERT_EQUAL_INT16(0, probe(600, 0, 400));
    loaded(2.2F);
    (void)probe(38, 0, 400);
    (void)probe(PROBE_CALM_STEPS, 0, 400);
    drive.run.observer.fast_share_q15 = 32767;
    (void)probe(1, 0, 400);
    drive.run.observer.fast_share_q15 = 0;
    (void)probe(PROBE_SOON_STEPS - PROBE_CALM_STEPS - 1u, 0, 400);
    TEST_ASSERT_EQUAL_UINT16(PROBE_PAUSE, drive.run.probe_phase);
    (void)probe(1, 0, 400);
    TEST_ASSERT_EQUAL_UINT16(PROBE_WAIT, drive.run.probe_phase);
    TEST_ASSERT_GREATER_THAN_INT16(0, probe(25, 0, 400));
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.probe_asked);
}

void test_a_dip_that_the_probe_itself_makes_brings_no_other(void)
{
    loaded(2.2F);
    (void)probe(25, 0, 400);
    rig_speed(7400);
    TEST_ASSERT_GREATER_THAN_INT16(0, probe(22, 0, 400));
    TEST_ASSERT_EQUAL_INT16(0, probe(50, 0, 400)); /* still low */
    rig_speed(7600);
    (void)probe(1, 0, 400);
    rig_speed(7400);
    TEST_ASSERT_GREATER_THAN_INT16(0, probe(25, 0, 400)); /* a new one */
}

void test_probe_leaves_the_q_current_that_flows_but_for_a_tenth(void)
{
    static const struct {
        float of_most, id;
    } cases[] = { { 0.3F, 0.3F }, { 0.6F, 0.6F }, { 0.72F, 0.6875F }, { 0.8F, 0.6F }, { 0.88F, 0.475F }, { 1.0F, 0.447F } };
    EACH(n, cases) {
        loaded(10.0F);
        drive.run.control.i_q13.q = (int16_t)(cases[n].of_most * params.current_max_q13);
        drive.run.control.ref_q13.q = drive.run.control.i_q13.q;
        TEST_ASSERT_INT16_WITHIN_MESSAGE(params.current_max_q13 / 64, (int16_t)(cases[n].id * params.current_max_q13), probe(140, 0, 100), golden_row(n));
    }
}

/* ---- what a motor cannot have ---- */

#define EMF_Q12 4000

static drive_params_t exact; /* the parameters with so much of dead time in the back-EMF: none but in its test */

/** Steps until a fault at this back-EMF with these changes of 1/Kphi and R, and header's R i_q and w L i_d in shares of it. */
static uint16_t impossible_until_fault(float kfi, float rs, float ri, float li, uint16_t most)
{
    enum { HALF_STEP = 2000 }; /* 0.06 rad a period */
    uint16_t steps = 0;
    const int16_t dead_q12 = exact.dead_emf_q12;
    exact = params;
    exact.dead_emf_q12 = dead_q12;
    rig_closed(1, 10000);
    drive.run.adaptation.kfi_q31 = (int32_t)(kfi * 2147483647.0);
    drive.run.adaptation.rs_q31 = (int32_t)(rs * 2147483647.0);
    drive.run.estimator.e_q_q28 = EMF_Q12 * 65536L;
    drive.run.estimator.half_step_q16_rad = HALF_STEP;
    drive.run.model.ls_q16 = params.fieldweak.ls_base_q16;
    drive.run.control.i_q13.q = (int16_t)(ri * EMF_Q12 * 65536.0F / (float)params.adaptation.rs_base_q16 / (float)(1 << params.estimator.rs_exp));
    drive.run.control.i_q13.d = (int16_t)(li * EMF_Q12 * 65536.0F / (float)params.fieldweak.ls_base_q16 / (16.0F * HALF_STEP / 65536.0F));
    while (drive.fault == (uint16_t)FAULT_NONE && steps < most) {
        protection_check_model(&drive, &exact);
        steps++;
    }
    return steps;
}

void test_flux_is_impossible_where_no_R_and_L_within_the_headers_tolerance_explain_it(void)
{
    static const struct {
        const char *what;
        float kfi, rs, ri, li;
        uint16_t fault;
    } cases[] = {
        { "a quarter more flux", -0.198F, 0.0F, 0.0F, 0.0F, FAULT_NONE }, { "and above", -0.202F, 0.0F, 0.0F, 0.0F, FAULT_BUS_SENSOR },
        { "less flux", 0.35F, 0.0F, 0.0F, 0.0F, FAULT_NONE },
        /* E (0.3 - 0.2) = R i (1.5 - 1 - rs) */
        { "R 50 % up explains it", -0.3F, 0.0F, 0.205F, 0.0F, FAULT_NONE }, { "too little current", -0.3F, 0.0F, 0.195F, 0.0F, FAULT_BUS_SENSOR },
        { "much of it is learnt", -0.3F, 0.4F, 0.95F, 0.0F, FAULT_BUS_SENSOR }, { "more current", -0.3F, 0.4F, 1.05F, 0.0F, FAULT_NONE },
        { "R beyond its end", -0.201F, 0.55F, 1.0F, 0.0F, FAULT_BUS_SENSOR },
        /* braking: R may be 30 % less */
        { "braking, R 30 % down explains it", -0.3F, 0.0F, -0.34F, 0.0F, FAULT_NONE }, { "it does not", -0.3F, 0.0F, -0.32F, 0.0F, FAULT_BUS_SENSOR },
        { "braking, R learnt", -0.3F, -0.3F, -1.0F, 0.0F, FAULT_BUS_SENSOR },
        /* L 30 % off */
        { "L explains it", -0.3F, 0.0F, 0.0F, -0.345F, FAULT_NONE }, { "it does not", -0.3F, 0.0F, 0.0F, -0.32F, FAULT_BUS_SENSOR },
        { "nor does R with it", -0.3F, 0.0F, 0.09F, -0.16F, FAULT_BUS_SENSOR }, { "both do", -0.3F, 0.0F, 0.11F, -0.18F, FAULT_NONE },
    };
    EACH(n, cases) {
        uint16_t steps = impossible_until_fault(cases[n].kfi, cases[n].rs, cases[n].ri, cases[n].li, 1000);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].fault, drive.fault, cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].fault ? 157 : 1000, steps, cases[n].what); /* 250 ms */
        drive.fault = (uint16_t)FAULT_NONE;
    }
}

void test_what_dead_time_may_put_into_the_back_emf_is_no_flux(void)
{
    exact.dead_emf_q12 = 400; /* a tenth of the back-EMF */
    TEST_ASSERT_EQUAL_UINT16(1000, impossible_until_fault(-0.298F, 0.0F, 0.0F, 0.0F, 1000));
    TEST_ASSERT_TRUE(impossible_until_fault(-0.302F, 0.0F, 0.0F, 0.0F, 1000) < 1000u);
    drive.run.estimator.e_q_q28 = EMF_Q12 * 65536L / 2;
    TEST_ASSERT_EQUAL_UINT16(0, protection_flux_is_impossible(&drive.run, &exact));
    exact.dead_emf_q12 = 0;
}

void test_flux_is_impossible_in_both_directions(void)
{
    (void)impossible_until_fault(-0.25F, 0.0F, 0.0F, 0.0F, 1);
    drive.run.estimator.e_q_q28 = -EMF_Q12 * 65536;
    TEST_ASSERT_EQUAL_UINT16(1, protection_flux_is_impossible(&drive.run, &exact));
    drive.run.control.i_q13.q = -3000; /* drives */
    TEST_ASSERT_EQUAL_UINT16(0, protection_flux_is_impossible(&drive.run, &exact));
}

void test_a_winding_too_hot_is_a_fault_after_a_quarter_of_a_second_without_a_gap(void)
{
    TEST_ASSERT_EQUAL_UINT16(1000, impossible_until_fault(0.0F, 0.599F, 0.1F, 0.0F, 1000));
    TEST_ASSERT_EQUAL_UINT16(157, impossible_until_fault(0.0F, 0.6F, 0.1F, 0.0F, 1000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERTEMPERATURE, drive.fault);
    drive.fault = (uint16_t)FAULT_NONE;
    TEST_ASSERT_EQUAL_UINT16(150, impossible_until_fault(-0.3F, 0.0F, 0.0F, 0.0F, 150));
    drive.run.adaptation.kfi_q31 = 0;
    protection_check_model(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.impossible_steps);
}

void test_both_at_once_are_a_wrong_bus_signal(void)
{
    TEST_ASSERT_EQUAL_UINT16(157, impossible_until_fault(-0.3F, 0.7F, 0.0F, 0.0F, 1000)); /* which makes R seem larger, too */
    TEST_ASSERT_EQUAL_UINT16(FAULT_BUS_SENSOR, drive.fault);
    drive.fault = (uint16_t)FAULT_NONE;
}

/* Much L i at once: the part ends at its format and does not come round. */
void test_what_L_may_explain_ends_at_its_format(void)
{
    (void)impossible_until_fault(-0.3F, 0.0F, 0.0F, 0.0F, 1);
    exact.dead_emf_q12 = 0;
    drive.run.estimator.e_q_q28 = 32000L * 65536L;
    drive.run.control.i_q13.d = -16000;
    drive.run.estimator.half_step_q16_rad = 8000;
    drive.run.model.ls_q16 = 65535;
    exact.estimator.ls_exp = 3;
    TEST_ASSERT_EQUAL_UINT16(0, protection_flux_is_impossible(&drive.run, &exact));
    exact.estimator.ls_exp = params.estimator.ls_exp;
}

void test_no_model_and_no_rotor_is_checked_outside_closed_loop(void)
{
    (void)impossible_until_fault(-0.3F, 0.0F, 0.0F, 0.0F, 150);
    drive.state = (uint16_t)DRIVE_RAMP;
    for (uint16_t n = 0; n < 100u; n++) {
        protection_check_model(&drive, &exact);
    }
    TEST_ASSERT_EQUAL_UINT16(150, drive.run.impossible_steps);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    loaded(2.2F);
    rig_emf(0, 400);
    drive.state = (uint16_t)DRIVE_RAMP;
    for (uint16_t n = 0; n < 200u; n++) {
        rig_slow(6);
    }
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.probe_steps);
    TEST_ASSERT_EQUAL_UINT16(PROBE_WAIT, drive.run.probe_phase);
}

void test_a_bus_signal_that_fell_stands_again_and_takes_the_back_emf_with_it_is_named(void)
{
    static const struct {
        int16_t behind, falls, beyond; /* the filter, in 1/4096; since the last step, in 1/1024; the gate, in counts */
        uint16_t wrong_steps;
        drive_fault_t fault;
    } cases[] = { { 260, 0, 1, 1, FAULT_BUS_SENSOR }, { 260, -300, 1, 1, FAULT_BUS_SENSOR }, { 260, 7, 1, 1, FAULT_BUS_SENSOR }, { 260, 9, 1, 1, FAULT_NONE }, { 260, 0, 1, 0, FAULT_NONE },
                  { 252, 0, 1000, 1, FAULT_NONE }, { -1000, 0, 1000, 1, FAULT_NONE }, { 1000, 0, 0, 1, FAULT_NONE } };
    EACH_DIRECTION(sign) {
        EACH(n, cases) {
            for (int16_t along = -1; along <= 1; along = (int16_t)(along + 2)) { /* it seems slower; faster */
                rig_closed(sign, (int16_t)(sign * 5000));
                const float now_v = (float)BUS_FULL_SCALE_V * (float)qm_hi(drive.bus_q31) / 32768.0F * (1.0F - (float)cases[n].behind / 4096.0F);
                samples.v_bus = rig_raw_bus(now_v * (1.0F + (float)cases[n].falls / 1024.0F));
                bus_update_gain(&drive, &params, bus_sample(samples.v_bus));
                samples.v_bus = rig_raw_bus(now_v);
                drive.run.observer.wrong_steps = cases[n].wrong_steps;
                drive.run.observer.innovation_erpm = (int16_t)(sign * along * (drive.run.observer.gate_erpm + cases[n].beyond));
                rig_slow((n & 1u) ? 3 : 11);
                TEST_ASSERT_EQUAL_UINT16_MESSAGE((along < 0) ? cases[n].fault : FAULT_NONE, drive.fault, golden_row(n));
                drive.fault = (uint16_t)FAULT_NONE;
            }
        }
    }
}

void test_signals_and_model_are_checked_in_closed_loop_only_signals_that_seem_wrong_in_slots_3_and_11(void)
{
    uint16_t part;
    for (part = 0; part < SLOW_PARTS; part++) {
        rig_closed(1, 10000);
        drive.run.observer.wrong_steps = 1000;
        drive.run.observer.innovation_erpm = 32000; /* more than any load makes */
        drive.run.impossible_steps = 1000;
        drive.run.adaptation.rs_q31 = INT32_MAX;
        rig_slow(part);
        TEST_ASSERT_EQUAL_UINT16(((part & 7u) == 3u) ? FAULT_CURRENT_SENSOR : (part == 14u) ? FAULT_OVERTEMPERATURE : FAULT_NONE, drive.fault);
        drive.fault = (uint16_t)FAULT_NONE;
    }
    for (part = 1; part < SLOW_PARTS; part = (uint16_t)(part + ((part & 3u) == 3u ? 2u : 1u))) { /* but the observer's own: what nothing explains begins every seldom step */
        rig_closed(1, 10000);
        rig_emf(30000, 10);
        rig_slow(part);
        TEST_ASSERT_EQUAL_UINT16((part == 14u) ? SIGNALS_UNEXPLAINED : 0u, drive.run.observer.wrong_steps);
    }
    rig_lock(1);
    drive.run.observer.wrong_steps = 1000;
    drive.run.impossible_steps = 1000;
    for (part = 0; part < SLOW_PARTS; part++) {
        rig_slow(part);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault); /* no estimate is used yet */
}
