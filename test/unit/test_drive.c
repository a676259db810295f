/* The running drive: limits and trips, references, slow steps, hand-over, orderly stop, and both directions alike. */
#include "ideal_motor.h"
#include "unity.h"

void setUp(void)
{
    rig_power_up();
    ideal_motor_reset(1.0F, 0.0F);
}

void tearDown(void)
{
}

/* ---- over-current: 3.8 A = 7075 counts ---- */

static void expect_overcurrent(int16_t direction, int16_t a_q13, int16_t b_q13, uint16_t fault)
{
    rig_lock(direction);
    rig_currents(a_q13, b_q13);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(fault, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(fault ? DRIVE_FAULT : DRIVE_ALIGN, drive.state);
    TEST_ASSERT_EQUAL_UINT16(fault ? OUTPUTS_OFF : OUTPUTS_PWM, out.outputs);
}

void test_overcurrent_threshold_is_3_8_A(void)
{
    TEST_ASSERT_EQUAL_INT16(7075, params.overcurrent_q13);
}

void test_current_at_the_threshold_does_not_trip(void)
{
    expect_overcurrent(1, 7075, -3537, FAULT_NONE);
    expect_overcurrent(1, -7075, 3537, FAULT_NONE);
    expect_overcurrent(1, -3537, 7075, FAULT_NONE);
    expect_overcurrent(1, 3537, -7075, FAULT_NONE);
    expect_overcurrent(1, 3537, 3538, FAULT_NONE);
    expect_overcurrent(1, -3537, -3538, FAULT_NONE);
}

void test_overcurrent_of_phase_a_trips_in_the_same_period(void)
{
    expect_overcurrent(1, 7076, -3538, FAULT_OVERCURRENT_SW);
    expect_overcurrent(1, -7076, 3538, FAULT_OVERCURRENT_SW);
}

void test_overcurrent_of_phase_b_trips_in_the_same_period(void)
{
    expect_overcurrent(1, -3538, 7076, FAULT_OVERCURRENT_SW);
    expect_overcurrent(1, 3538, -7076, FAULT_OVERCURRENT_SW);
}

void test_overcurrent_of_phase_c_trips_though_it_is_not_measured(void)
{
    expect_overcurrent(1, 3538, 3538, FAULT_OVERCURRENT_SW);
    expect_overcurrent(1, -3538, -3538, FAULT_OVERCURRENT_SW);
}

void test_overcurrent_trips_in_every_running_state(void)
{
    uint16_t state;
    for (state = DRIVE_ALIGN; state <= (uint16_t)DRIVE_STOPPING; state++) {
        rig_lock(1);
        drive.state = state;
        rig_currents(7076, 0);
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_SW, drive.fault);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    }
}

void test_overcurrent_uses_the_current_without_its_offset(void)
{
    rig_power_up();
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

void test_current_is_not_watched_while_the_bridge_is_off(void)
{
    rig_ready();
    rig_currents(8000, 0);
    rig_tick(100);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

/* ---- bus trips ---- */

/** Sample whose 15 bits are exactly this. */
static int16_t raw_bus_q15(uint16_t bus_q15)
{
    return (int16_t)((uint16_t)(bus_q15 << 1) ^ 0x8000u);
}

void test_trip_levels_are_34_and_12_volts(void)
{
    TEST_ASSERT_EQUAL_INT16(21101, params.bus_over_q15);  /* 34 / 52.8 * 32768 */
    TEST_ASSERT_EQUAL_INT16(7447, params.bus_under_q15);
}

void test_overvoltage_trips_in_every_state_within_a_slow_step(void)
{
    uint16_t state;
    for (state = 0; state < (uint16_t)DRIVE_FAULT; state++) {
        rig_lock(1);
        drive.state = state;
        samples.v_bus = raw_bus_q15(21102);
        rig_tick(8);
        TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    }
}

void test_bus_at_the_overvoltage_level_does_not_trip(void)
{
    rig_lock(1);
    samples.v_bus = raw_bus_q15(21101);
    rig_tick(800);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_overvoltage_trips_on_one_sample(void)
{
    rig_lock(1);
    rig_next_slot(2);
    samples.v_bus = raw_bus_q15(21102);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
}

void test_undervoltage_trips_while_the_bridge_is_on(void)
{
    uint16_t state;
    for (state = DRIVE_BOOTSTRAP; state <= (uint16_t)DRIVE_STOPPING; state++) {
        rig_lock(1);
        drive.state = state;
        drive.run.estimator.omega_filtered_q16 = 10000L * 65536;
        drive.run.control.reference_erpm = 10000;
        samples.v_bus = raw_bus_q15(0);
        rig_tick(32);
        TEST_ASSERT_EQUAL_UINT16(FAULT_UNDERVOLTAGE, drive.fault);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    }
}

void test_undervoltage_does_not_trip_while_the_bridge_is_off(void)
{
    samples.v_bus = raw_bus_q15(0);
    rig_tick(1024);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    rig_tick(2000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}

void test_start_without_a_supply_is_undervoltage_before_the_first_pulse(void)
{
    rig_ready();
    samples.v_bus = raw_bus_q15(0);
    rig_tick(100);
    drive_start(&drive, &params, 1);
    rig_tick(200);
    TEST_ASSERT_EQUAL_UINT16(FAULT_UNDERVOLTAGE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

void test_undervoltage_level_is_exact(void)
{
    rig_lock(1);
    samples.v_bus = raw_bus_q15(7447);
    rig_tick(800);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    samples.v_bus = raw_bus_q15(7446);
    rig_tick(800);
    TEST_ASSERT_EQUAL_UINT16(FAULT_UNDERVOLTAGE, drive.fault);
}

void test_one_low_bus_sample_rides_through(void)
{
    rig_lock(1);
    rig_tick(16);
    samples.v_bus = raw_bus_q15(0);
    rig_tick(8);
    rig_bus(24.0F);
    rig_tick(80);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

/* ---- the bus in the law ---- */

/** Voltage between phases a and b that the modulator makes of a command, at a bus. */
static float line_voltage(float bus_v, int16_t alpha_q13, int16_t beta_q13)
{
    alphabeta_t v;
    duties_t duty;
    v.alpha = alpha_q13;
    v.beta = beta_q13;
    rig_bus(bus_v);
    rig_tick(400);
    duty = svm(&params.svm, v, drive.duty_per_volt_q16, 0, 0, 0);
    return ((float)duty.a - (float)duty.b) / (float)PWM_FULL_DUTY * bus_v;
}

void test_commanded_volts_arrive_whatever_the_bus(void)
{
    /* 4 V in alpha: 6 V between a and b */
    int16_t alpha = (int16_t)(VOLTAGE_Q14(4.0) / 2);
    rig_ready();
    TEST_ASSERT_FLOAT_WITHIN(0.05F, 6.0F, line_voltage(24.0F, alpha, 0));
    TEST_ASSERT_FLOAT_WITHIN(0.05F, 6.0F, line_voltage(13.0F, alpha, 0));
    TEST_ASSERT_FLOAT_WITHIN(0.05F, 6.0F, line_voltage(18.0F, alpha, 0));
    TEST_ASSERT_FLOAT_WITHIN(0.05F, 6.0F, line_voltage(33.0F, alpha, 0));
    TEST_ASSERT_FLOAT_WITHIN(0.05F, -6.0F, line_voltage(30.0F, (int16_t)-alpha, 0));
}

void test_duty_scales_inversely_with_the_bus(void)
{
    uint32_t at_24, at_16;
    rig_ready();
    rig_bus(24.0F);
    rig_tick(400);
    at_24 = drive.duty_per_volt_q16;
    rig_bus(16.0F);
    rig_tick(400);
    at_16 = drive.duty_per_volt_q16;
    TEST_ASSERT_UINT32_WITHIN(at_24 / 500u, 3u * at_24, 2u * at_16);
}

void test_voltage_circle_follows_the_bus(void)
{
    int16_t at_24;
    rig_ready();
    rig_bus(24.0F);
    rig_tick(400);
    at_24 = drive.circle.limit_q14;
    /* 93.6 % of 24 V / sqrt(3) */
    TEST_ASSERT_INT16_WITHIN(20, VOLTAGE_Q14(12.970), at_24);
    rig_bus(12.5F);
    rig_tick(400);
    TEST_ASSERT_INT16_WITHIN(20, (int16_t)(at_24 * 12.5F / 24.0F), drive.circle.limit_q14);
    rig_bus(33.0F);
    rig_tick(400);
    TEST_ASSERT_INT16_WITHIN(20, (int16_t)(at_24 * 33.0F / 24.0F), drive.circle.limit_q14);
}

void test_bus_above_the_trip_level_keeps_the_circle_in_its_format(void)
{
    int16_t at_34;
    rig_ready();
    rig_bus(34.0F);
    rig_tick(400);
    at_34 = drive.circle.limit_q14;
    rig_bus(52.7F);
    rig_tick(400);
    TEST_ASSERT_INT16_WITHIN(20, at_34, drive.circle.limit_q14);
    TEST_ASSERT_GREATER_THAN_INT16(0, drive.circle.limit_q14);
}

void test_bus_below_the_trip_level_keeps_the_division_in_range(void)
{
    uint16_t at_12;
    rig_ready();
    rig_bus(12.0F);
    rig_tick(400);
    at_12 = drive.duty_per_volt_q16;
    rig_bus(0.0F);
    rig_tick(400);
    TEST_ASSERT_UINT16_WITHIN(at_12 / 200u, at_12, drive.duty_per_volt_q16);
}

void test_bus_is_filtered_over_four_slow_steps(void)
{
    int16_t at_24;
    rig_ready();
    rig_tick(400);
    at_24 = qm_hi(drive.bus_q31);
    rig_bus(30.0F);
    rig_tick(8);
    TEST_ASSERT_INT16_WITHIN(4, (int16_t)(at_24 + BUS_Q15(6.0) / 4), qm_hi(drive.bus_q31));
    rig_tick(400);
    TEST_ASSERT_INT16_WITHIN(2, BUS_Q15(30.0), qm_hi(drive.bus_q31));
}

/* ---- slow steps: one block a period, each every eighth ---- */

void test_each_slow_block_runs_in_its_own_period_of_eight(void)
{
    uint16_t n;
    rig_closed(1, 8000);
    for (n = 0; n < 32u; n++) {
        uint16_t slot;
        drive.run.control.reference_erpm = 7000;
        drive.command.target_erpm = 8000;
        drive.run.fieldweak.index = 99;
        drive.duty_per_volt_q16 = 1;
        drive.circle.reciprocal = 1;
        drive.run.control.iq_limit_q13 = 1;
        drive.run.stall_steps = 99;
        drive.run.control.brake_limit_q13 = 1;
        drive.run.estimator.omega_filtered_q16 = 8000L * 65536;
        drive.run.estimator.e_q_q28 = 10000L * 65536;
        rig_tick(1);
        slot = drive.ticks & 7u;
        TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slot == 0u, drive.run.control.reference_erpm != 7000, "speed");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slot == 1u, drive.run.fieldweak.index != 99u, "field weakening");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slot == 2u, drive.duty_per_volt_q16 != 1u, "bus");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slot == 3u, drive.circle.reciprocal != 1u, "circle");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slot == 4u, drive.run.control.iq_limit_q13 != 1, "current limit");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slot == 5u, drive.run.stall_steps != 99u, "protection");
        TEST_ASSERT_EQUAL_INT16_MESSAGE(slot == 6u, drive.run.control.brake_limit_q13 != 1, "hand-over");
    }
}

void test_ticks_count_every_period_in_every_state(void)
{
    uint16_t state;
    for (state = 0; state < (uint16_t)DRIVE_STATE_COUNT; state++) {
        drive.state = state;
        drive.ticks = 65535u;
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(0, drive.ticks);
    }
}

/* ---- speed reference ---- */

void test_reference_ramps_at_4000_rpm_per_second(void)
{
    uint16_t n;
    rig_closed(1, 5000);
    drive.command.target_erpm = 10000;
    drive.run.estimator.omega_filtered_q16 = 7000L * 65536;
    for (n = 1; n <= 100u; n++) {
        speed_reference_step(&drive, &params);
        TEST_ASSERT_EQUAL_INT16(5000 + 8 * (int16_t)n, drive.run.control.reference_erpm); /* 20000 erpm/s * 400 us */
    }
    drive.command.target_erpm = 2500;
    drive.run.estimator.omega_filtered_q16 = 5000L * 65536;
    speed_reference_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(5800 - 8, drive.run.control.reference_erpm);
}

void test_reference_arrives_at_its_target_and_stays(void)
{
    rig_closed(1, 5000);
    drive.command.target_erpm = 5013;
    speed_reference_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(5013, drive.run.control.reference_erpm);
    speed_reference_step(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(5013, drive.run.control.reference_erpm);
}

/** Reference after one step from 10000 to 20000 (times direction) at a real speed. */
static int16_t step_up(int16_t direction, int16_t speed_erpm)
{
    rig_closed(direction, (int16_t)(direction * 10000));
    drive.command.target_erpm = (int16_t)(direction * 20000);
    drive.run.estimator.omega_filtered_q16 = (int32_t)(direction * speed_erpm) * 65536;
    speed_reference_step(&drive, &params);
    return (int16_t)(direction * drive.run.control.reference_erpm);
}

static int16_t step_down(int16_t direction, int16_t speed_erpm)
{
    rig_closed(direction, (int16_t)(direction * 10000));
    drive.command.target_erpm = (int16_t)(direction * 3000);
    drive.run.estimator.omega_filtered_q16 = (int32_t)(direction * speed_erpm) * 65536;
    speed_reference_step(&drive, &params);
    return (int16_t)(direction * drive.run.control.reference_erpm);
}

void test_reference_waits_while_the_motor_is_350_rpm_behind(void)
{
    int16_t direction;
    for (direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        TEST_ASSERT_EQUAL_INT16(10008, step_up(direction, 10000 - 1749));
        TEST_ASSERT_EQUAL_INT16(10000, step_up(direction, 10000 - 1750));
        TEST_ASSERT_EQUAL_INT16(10008, step_up(direction, 20000));
    }
}

void test_reference_waits_while_a_slowing_motor_is_350_rpm_ahead(void)
{
    int16_t direction;
    for (direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        TEST_ASSERT_EQUAL_INT16(9992, step_down(direction, 10000 + 1749));
        TEST_ASSERT_EQUAL_INT16(10000, step_down(direction, 10000 + 1750));
        TEST_ASSERT_EQUAL_INT16(9992, step_down(direction, 2000));
    }
}

/* ---- speed controller and its limits ---- */

void test_speed_below_the_reference_asks_for_driving_current(void)
{
    rig_closed(1, 8000);
    drive.run.estimator.omega_filtered_q16 = 7000L * 65536;
    speed_step(&drive, &params);
    TEST_ASSERT_GREATER_THAN_INT16(0, drive.run.control.ref_q13.q);
    rig_closed(-1, -8000);
    drive.run.estimator.omega_filtered_q16 = -7000L * 65536;
    speed_step(&drive, &params);
    TEST_ASSERT_LESS_THAN_INT16(0, drive.run.control.ref_q13.q);
}

void test_speed_controller_stays_within_the_q_current_limit(void)
{
    uint16_t n;
    rig_closed(1, 10000);
    drive.run.control.iq_limit_q13 = 1234;
    drive.run.estimator.omega_filtered_q16 = 8500L * 65536;
    for (n = 0; n < 200u; n++) {
        speed_step(&drive, &params);
        TEST_ASSERT_LESS_OR_EQUAL_INT16(1234, drive.run.control.ref_q13.q);
    }
    TEST_ASSERT_EQUAL_INT16(1234, drive.run.control.ref_q13.q);
}

/** q current after a step with the motor much too fast, at a braking limit. */
static int16_t braking_current(int16_t direction, int16_t limit_q13)
{
    rig_closed(direction, (int16_t)(direction * 5000));
    drive.run.control.brake_limit_q13 = limit_q13;
    drive.run.estimator.omega_filtered_q16 = (int32_t)(direction * 20000) * 65536;
    speed_step(&drive, &params);
    return drive.run.control.ref_q13.q;
}

void test_braking_current_is_held_to_the_brake_limit_in_both_directions(void)
{
    TEST_ASSERT_EQUAL_INT16(-700, braking_current(1, 700));
    TEST_ASSERT_EQUAL_INT16(700, braking_current(-1, 700));
    TEST_ASSERT_EQUAL_INT16(0, braking_current(1, 0));
    TEST_ASSERT_EQUAL_INT16(0, braking_current(-1, 0));
}

void test_brake_limit_does_not_touch_driving_current(void)
{
    rig_closed(1, 20000);
    drive.run.control.brake_limit_q13 = 0;
    drive.run.estimator.omega_filtered_q16 = 5000L * 65536;
    speed_step(&drive, &params);
    TEST_ASSERT_GREATER_THAN_INT16(1000, drive.run.control.ref_q13.q);
}

void test_brake_limit_does_not_wind_the_speed_controller_up(void)
{
    uint16_t n;
    rig_closed(1, 5000);
    drive.run.control.brake_limit_q13 = 300;
    drive.run.estimator.omega_filtered_q16 = 9000L * 65536;
    for (n = 0; n < 2500u; n++) {
        speed_step(&drive, &params);
    }
    TEST_ASSERT_EQUAL_INT16(-300, drive.run.control.ref_q13.q);
    drive.run.estimator.omega_filtered_q16 = 4990L * 65536; /* just below: the current must turn at once */
    speed_step(&drive, &params);
    speed_step(&drive, &params);
    TEST_ASSERT_GREATER_THAN_INT16(0, drive.run.control.ref_q13.q);
}

/** Brake limit at a bus voltage. */
static int16_t brake_limit(float bus_v)
{
    drive.bus_q31 = (int32_t)(bus_v / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F) * 65536;
    limits_braking(&drive.run, &params, qm_hi(drive.bus_q31));
    return drive.run.control.brake_limit_q13;
}

void test_braking_current_fades_between_27_and_29_volts(void)
{
    rig_closed(1, 8000);
    TEST_ASSERT_EQUAL_INT16(params.current_max_q13, brake_limit(24.0F));
    TEST_ASSERT_EQUAL_INT16(params.current_max_q13, brake_limit(27.0F));
    TEST_ASSERT_INT16_WITHIN(20, 4864, brake_limit(27.1F)); /* 95 % */
    TEST_ASSERT_INT16_WITHIN(20, 2560, brake_limit(28.0F));
    TEST_ASSERT_INT16_WITHIN(20, 0, brake_limit(29.0F));
    TEST_ASSERT_EQUAL_INT16(0, brake_limit(29.2F));
    TEST_ASSERT_EQUAL_INT16(0, brake_limit(52.0F));
    TEST_ASSERT_EQUAL_INT16(params.current_max_q13, brake_limit(26.0F));
}

/* ---- current circle ---- */

static int16_t iq_limit(int16_t id_q13)
{
    drive.run.handover.id_q13 = id_q13;
    drive.run.fieldweak.table_q13 = 0;
    drive.run.fieldweak.trim_q13 = 0;
    drive.run.control.vq_limit_q14 = 16000;
    limits_current(&drive.run, &params);
    return drive.run.control.iq_limit_q13;
}

void test_q_current_limit_is_what_the_d_current_leaves_of_the_circle(void)
{
    /* sqrt(5120^2 - Id^2) */
    rig_closed(1, 8000);
    TEST_ASSERT_INT16_WITHIN(3, 5120, iq_limit(0));
    TEST_ASSERT_INT16_WITHIN(6, 4729, iq_limit(-1962));
    TEST_ASSERT_INT16_WITHIN(6, 4149, iq_limit(-3000));
    TEST_ASSERT_INT16_WITHIN(6, 4149, iq_limit(3000));
    TEST_ASSERT_INT16_WITHIN(12, 3196, iq_limit(-4000));
    TEST_ASSERT_INT16_WITHIN(25, 1770, iq_limit(-4804));
}

void test_current_vector_never_leaves_its_circle(void)
{
    int16_t id;
    rig_closed(1, 8000);
    for (id = -5120; id <= 5120; id = (int16_t)(id + 37)) {
        int32_t d_q, q_q;
        (void)iq_limit(id);
        d_q = drive.run.control.ref_q13.d;
        q_q = drive.run.control.iq_limit_q13;
        TEST_ASSERT_LESS_OR_EQUAL_INT32(5120L * 5120L, d_q * d_q + q_q * q_q);
        TEST_ASSERT_GREATER_THAN_INT32(0, q_q);
    }
}

void test_d_reference_is_handover_plus_table_plus_trim(void)
{
    rig_closed(1, 8000);
    drive.run.handover.id_q13 = 500;
    drive.run.fieldweak.table_q13 = -900;
    drive.run.fieldweak.trim_q13 = -100;
    drive.run.control.vq_limit_q14 = 16000; /* plenty of voltage: the trim goes back by one step */
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(500 - 900 - 100 + params.fieldweak.trim_step_q13, drive.run.control.ref_q13.d);
}

void test_d_reference_leaves_the_q_axis_a_share(void)
{
    rig_closed(1, 8000);
    (void)iq_limit(-6000);
    TEST_ASSERT_EQUAL_INT16(-4960, drive.run.control.ref_q13.d); /* 31/32 of 5120 */
    (void)iq_limit(6000);
    TEST_ASSERT_EQUAL_INT16(4960, drive.run.control.ref_q13.d);
}

void test_voltage_trim_acts_when_the_q_axis_runs_out_of_voltage(void)
{
    rig_closed(1, 16000);
    drive.run.control.vq_limit_q14 = 10000;
    drive.run.control.v_q14.q = 9990;
    limits_current(&drive.run, &params);
    TEST_ASSERT_LESS_THAN_INT16(0, drive.run.fieldweak.trim_q13);
    rig_closed(-1, -16000);
    drive.run.control.vq_limit_q14 = 10000;
    drive.run.control.v_q14.q = -9990;
    limits_current(&drive.run, &params);
    TEST_ASSERT_LESS_THAN_INT16(0, drive.run.fieldweak.trim_q13);
}

void test_field_weakening_is_indexed_by_the_reference_and_not_the_speed(void)
{
    rig_closed(1, 8000);
    drive.run.estimator.omega_filtered_q16 = 25000L * 65536;
    rig_next_slot(1);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.fieldweak.index);
    drive.run.control.reference_erpm = 13000 + 3 * 1024 + 5;
    drive.run.estimator.omega_filtered_q16 = 8000L * 65536;
    rig_next_slot(1);
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(3, drive.run.fieldweak.index);
}

/* ---- stall and lost lock: steps of 400 us ---- */

/** Protection steps until a fault, with a back-EMF that is healthy. */
static uint16_t steps_to_fault(int16_t reference_erpm, int16_t speed_erpm, int16_t e_d, int16_t e_q, uint16_t most)
{
    uint16_t steps = 0;
    rig_closed(1, reference_erpm);
    drive.run.estimator.omega_filtered_q16 = (int32_t)speed_erpm * 65536;
    drive.run.estimator.e_d_q28 = (int32_t)e_d * 65536;
    drive.run.estimator.e_q_q28 = (int32_t)e_q * 65536;
    while (drive.state == (uint16_t)DRIVE_CLOSED && steps < most) {
        protection_check_rotor(&drive, &params);
        steps++;
    }
    return steps;
}

void test_speed_below_half_the_reference_for_300_ms_is_a_stall(void)
{
    TEST_ASSERT_EQUAL_UINT16(751, steps_to_fault(10000, 4999, 0, 100, 2000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(751, steps_to_fault(-10000, 4999, 0, 100, 2000));
    TEST_ASSERT_EQUAL_UINT16(751, steps_to_fault(10000, -4999, 0, 100, 2000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
}

void test_half_the_reference_is_no_stall(void)
{
    TEST_ASSERT_EQUAL_UINT16(2000, steps_to_fault(10000, 5000, 0, 100, 2000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(2000, steps_to_fault(-10000, -5000, 0, -100, 2000));
}

void test_below_half_the_minimum_speed_is_a_stall_whatever_the_reference(void)
{
    TEST_ASSERT_EQUAL_UINT16(751, steps_to_fault(0, 1249, 0, 100, 2000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(2000, steps_to_fault(0, 1250, 0, 100, 2000));
}

void test_a_short_dip_of_speed_is_no_stall(void)
{
    uint16_t n;
    rig_closed(1, 10000);
    drive.run.estimator.e_q_q28 = 100L * 65536;
    for (n = 0; n < 3u; n++) {
        uint16_t k;
        drive.run.estimator.omega_filtered_q16 = 1000L * 65536;
        for (k = 0; k < 750u; k++) {
            protection_check_rotor(&drive, &params);
        }
        drive.run.estimator.omega_filtered_q16 = 6000L * 65536;
        protection_check_rotor(&drive, &params);
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_d_emf_above_q_emf_for_50_ms_is_a_lost_lock(void)
{
    TEST_ASSERT_EQUAL_UINT16(126, steps_to_fault(10000, 10000, 1001, 1000, 2000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_LOST_LOCK, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(126, steps_to_fault(10000, 10000, -1001, 1000, 2000));
    TEST_ASSERT_EQUAL_UINT16(126, steps_to_fault(-10000, -10000, 1001, -1000, 2000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_LOST_LOCK, drive.fault);
}

void test_d_emf_no_larger_than_q_emf_is_no_lost_lock(void)
{
    TEST_ASSERT_EQUAL_UINT16(2000, steps_to_fault(10000, 10000, 1000, 1000, 2000));
    TEST_ASSERT_EQUAL_UINT16(2000, steps_to_fault(10000, 10000, -1000, 1000, 2000));
    TEST_ASSERT_EQUAL_UINT16(2000, steps_to_fault(-10000, -10000, 1000, -1000, 2000));
}

void test_impossible_speed_for_50_ms_is_a_lost_lock(void)
{
    TEST_ASSERT_EQUAL_INT16(32700, params.overspeed_erpm); /* 1.25 * 27500 does not fit the format */
    TEST_ASSERT_EQUAL_UINT16(126, steps_to_fault(27500, 32701, 0, 1000, 2000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_LOST_LOCK, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(126, steps_to_fault(-27500, -32701, 0, 1000, 2000));
    TEST_ASSERT_EQUAL_UINT16(2000, steps_to_fault(27500, 32700, 0, 1000, 2000));
}

void test_a_short_loss_of_lock_rides_through(void)
{
    uint16_t n;
    rig_closed(1, 10000);
    for (n = 0; n < 3u; n++) {
        uint16_t k;
        drive.run.estimator.e_d_q28 = 2000L * 65536;
        drive.run.estimator.e_q_q28 = 1000L * 65536;
        for (k = 0; k < 125u; k++) {
            protection_check_rotor(&drive, &params);
        }
        drive.run.estimator.e_d_q28 = 0;
        protection_check_rotor(&drive, &params);
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

/* ---- hand-over ---- */

/** A hand-over with a forced angle, an estimate behind it by `offset`, and a voltage. */
static void hand_over(int16_t direction, angle_t forced, int16_t offset, int16_t v_d, int16_t v_q)
{
    rig_lock(direction);
    drive.state = (uint16_t)DRIVE_RAMP;
    drive.angle = forced;
    drive.run.estimator.rho_q32 = (uint32_t)(angle_t)(forced - (uint16_t)offset) << 16;
    drive.run.estimator.half_step_q16_rad = 0;
    drive.run.estimator.omega_filtered_q16 = (int32_t)(direction * 4900) * 65536;
    drive.run.control.v_q14.d = v_d;
    drive.run.control.v_q14.q = v_q;
    drive.run.stall_steps = 700;
    drive.run.lost_lock_steps = 100;
    drive.run.handover.agreed_steps = 50;
    handover_now(&drive, &params);
    drive.ticks = 7;
    drive_slow(&drive, &params, 0);
}

static void expect_the_same_stator_voltage(int16_t direction, angle_t forced, int16_t offset)
{
    dq_t before;
    alphabeta_t was, is;
    before.d = (int16_t)(direction * -1500);
    before.q = (int16_t)(direction * 6000);
    hand_over(direction, forced, offset, before.d, before.q);
    was = inverse_park(before, trig_sincos(forced));
    is = inverse_park(drive.run.control.v_q14, trig_sincos(drive.angle));
    TEST_ASSERT_INT16_WITHIN(6, was.alpha, is.alpha);
    TEST_ASSERT_INT16_WITHIN(6, was.beta, is.beta);
    TEST_ASSERT_EQUAL_INT16(offset, drive.run.handover.offset);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_hand_over_keeps_the_voltage_in_the_stator(void)
{
    int32_t offset;
    for (offset = -16000; offset <= 16000; offset += 4000) {
        expect_the_same_stator_voltage(1, 12345, (int16_t)offset);
        expect_the_same_stator_voltage(-1, 54321u, (int16_t)offset);
    }
}

void test_hand_over_keeps_the_current_in_the_stator(void)
{
    int32_t offset;
    for (offset = -16000; offset <= 16000; offset += 4000) {
        dq_t open_loop;
        alphabeta_t was, is;
        open_loop.d = 0;
        open_loop.q = params.open_loop_q13;
        hand_over(1, 30000, (int16_t)offset, 0, 5000);
        was = inverse_park(open_loop, trig_sincos(30000));
        is = inverse_park(drive.run.control.ref_q13, trig_sincos(drive.angle));
        TEST_ASSERT_INT16_WITHIN(4, was.alpha, is.alpha);
        TEST_ASSERT_INT16_WITHIN(4, was.beta, is.beta);
        TEST_ASSERT_EQUAL_INT16(drive.run.control.ref_q13.d, drive.run.handover.id_q13);
    }
}

void test_hand_over_presets_all_three_controllers_without_a_bump(void)
{
    int16_t direction;
    for (direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        int16_t err;
        hand_over(direction, 7000, (int16_t)(direction * -9000), 200, (int16_t)(direction * 6000));
        TEST_ASSERT_INT16_WITHIN(1, drive.run.control.v_q14.d, pi_tick(&drive.run.control.pi_d, &params.pi_d, 0, 16000));
        TEST_ASSERT_INT16_WITHIN(1, drive.run.control.v_q14.q, pi_tick(&drive.run.control.pi_q, &params.pi_q, 0, 16000));
        err = (int16_t)(direction * (5000 - 4900));
        TEST_ASSERT_INT16_WITHIN(1, drive.run.control.ref_q13.q, pi_tick(&drive.run.control.pi_speed, &params.pi_speed, err, 5120));
    }
}

void test_hand_over_starts_from_END_SPEED(void)
{
    hand_over(1, 7000, 0, 0, 5000);
    TEST_ASSERT_EQUAL_INT16(5000, drive.run.control.reference_erpm);
    hand_over(-1, 7000, 0, 0, -5000);
    TEST_ASSERT_EQUAL_INT16(-5000, drive.run.control.reference_erpm);
}

void test_hand_over_offset_decays_one_count_a_period_from_both_signs(void)
{
    int16_t sign;
    for (sign = -1; sign <= 1; sign = (int16_t)(sign + 2)) {
        int16_t n;
        rig_closed(1, 8000);
        drive.run.handover.offset = (int16_t)(sign * 1000);
        for (n = 1; n < 124; n++) {
            handover_decay(&drive, &params); /* every eighth period */
            TEST_ASSERT_EQUAL_INT16(sign * (1000 - 8 * n), drive.run.handover.offset);
        }
        handover_decay(&drive, &params);
        handover_decay(&drive, &params);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.offset);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.handover.id_q13);
    }
}

void test_hand_over_current_follows_its_offset(void)
{
    /* d = -Iq sin(offset) */
    rig_closed(1, 8000);
    drive.run.handover.offset = 8192 + 8; /* 45 degrees after the step */
    handover_decay(&drive, &params);
    TEST_ASSERT_INT16_WITHIN(3, -1856, drive.run.handover.id_q13);
    drive.run.handover.offset = -8192 - 8;
    handover_decay(&drive, &params);
    TEST_ASSERT_INT16_WITHIN(3, 1856, drive.run.handover.id_q13);
    rig_closed(-1, -8000);
    drive.run.handover.offset = 8192 + 8;
    handover_decay(&drive, &params);
    TEST_ASSERT_INT16_WITHIN(3, 1856, drive.run.handover.id_q13);
}

void test_finished_hand_over_leaves_no_current_behind(void)
{
    uint32_t n = 0;
    rig_start(1);
    drive.command.target_erpm = 5000;
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    while (drive.run.handover.offset != 0 && n++ < 20000u) {
        ideal_motor_run(1);
    }
    ideal_motor_run(400);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.ref_q13.d);
}

/* ---- stop ---- */

/** Start the model and bring it to a speed. */
static void run_at(int16_t direction, int16_t speed_erpm)
{
    rig_start(direction);
    ideal_motor_reset(1.0F, 0.0F);
    drive.command.target_erpm = (int16_t)(direction * speed_erpm);
    (void)ideal_motor_run_until(DRIVE_CLOSED, 40000);
    ideal_motor_run(30000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_stop_ramps_down_to_the_minimum_speed_and_then_switches_off(void)
{
    uint32_t periods;
    run_at(1, 10000);
    drive.command.run = 0;
    ideal_motor_run(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_PWM, out.outputs);
    periods = ideal_motor_run_until(DRIVE_STOPPED, 20000);
    /* 7500 erpm at 20000 erpm/s */
    TEST_ASSERT_UINT32_WITHIN(1000, 7500, periods);
    ideal_motor_run(1);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    TEST_ASSERT_FLOAT_WITHIN(300.0F, 2500.0F, ideal_motor_erpm());
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_stop_in_reverse_does_the_same(void)
{
    run_at(-1, 10000);
    drive.command.run = 0;
    TEST_ASSERT_UINT32_WITHIN(1000, 7500, ideal_motor_run_until(DRIVE_STOPPED, 20000));
    ideal_motor_run(1);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    TEST_ASSERT_FLOAT_WITHIN(300.0F, -2500.0F, ideal_motor_erpm());
}

static uint16_t stops(int16_t speed_erpm, int16_t reference_erpm)
{
    rig_closed(1, reference_erpm);
    drive.state = (uint16_t)DRIVE_STOPPING;
    drive.command.run = 0;
    drive.run.estimator.omega_filtered_q16 = (int32_t)speed_erpm * 65536;
    speed_step(&drive, &params);
    return (uint16_t)(drive.state == (uint16_t)DRIVE_STOPPED);
}

void test_stop_ends_when_speed_and_reference_are_below_the_minimum(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, stops(2499, 2499));
    TEST_ASSERT_EQUAL_UINT16(1, stops(-2499, -2499));
    TEST_ASSERT_EQUAL_UINT16(0, stops(2500, 2400));
    TEST_ASSERT_EQUAL_UINT16(0, stops(-2500, 2400));
    TEST_ASSERT_EQUAL_UINT16(0, stops(2400, 2600));
    TEST_ASSERT_EQUAL_UINT16(0, stops(2400, -2600));
}

void test_low_speed_alone_does_not_end_closed_loop(void)
{
    rig_closed(1, 2000);
    speed_step(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
}

void test_withdrawn_request_in_every_state(void)
{
    static const uint16_t next[DRIVE_STATE_COUNT] = {
        DRIVE_CALIBRATE, DRIVE_STOPPED, DRIVE_STOPPED, DRIVE_STOPPED, DRIVE_STOPPED, DRIVE_STOPPING, DRIVE_STOPPING, DRIVE_FAULT
    };
    uint16_t state;
    for (state = 0; state < (uint16_t)DRIVE_STATE_COUNT; state++) {
        rig_closed(1, 8000);
        drive.state = state;
        drive.fault = (uint16_t)((state == (uint16_t)DRIVE_FAULT) ? FAULT_STALL : FAULT_NONE);
        drive.periods = 0;
        drive.command.run = 0;
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(next[state], drive.state);
    }
}

void test_restart_request_while_stopping_waits_for_the_stop(void)
{
    run_at(1, 8000);
    drive.command.run = 0;
    ideal_motor_run(100);
    drive_start(&drive, &params, -1);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    (void)ideal_motor_run_until(DRIVE_STOPPED, 20000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}

void test_target_is_ignored_while_stopping(void)
{
    run_at(1, 8000);
    drive.command.run = 0;
    drive.command.target_erpm = 20000;
    TEST_ASSERT_LESS_THAN_UINT32(12000, ideal_motor_run_until(DRIVE_STOPPED, 20000));
}

/* ---- outputs ---- */

void test_outputs_of_every_state(void)
{
    static const uint16_t outputs[DRIVE_STATE_COUNT] = {
        OUTPUTS_OFF, OUTPUTS_OFF, OUTPUTS_BOOTSTRAP, OUTPUTS_PWM, OUTPUTS_PWM, OUTPUTS_PWM, OUTPUTS_PWM, OUTPUTS_OFF
    };
    uint16_t state;
    for (state = 0; state < (uint16_t)DRIVE_STATE_COUNT; state++) {
        rig_closed(1, 8000);
        drive.periods = 0;
        drive.state = state;
        drive.fault = (uint16_t)((state == (uint16_t)DRIVE_FAULT) ? FAULT_STALL : FAULT_NONE);
        if (state == (uint16_t)DRIVE_STOPPED || state == (uint16_t)DRIVE_STOPPING) {
            drive.command.run = 0;
        }
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(state, drive.state);
        TEST_ASSERT_EQUAL_UINT16(outputs[state], out.outputs);
        TEST_ASSERT_EQUAL_INT16(outputs[state] == (uint16_t)OUTPUTS_PWM, drive_is_running(&drive));
        if (outputs[state] != (uint16_t)OUTPUTS_PWM) {
            TEST_ASSERT_EQUAL_UINT16(0, out.duty.a);
            TEST_ASSERT_EQUAL_UINT16(0, out.duty.b);
            TEST_ASSERT_EQUAL_UINT16(0, out.duty.c);
        }
    }
}

/* ---- both directions ---- */

void test_reverse_is_the_mirror_image_phases_b_and_c_swapped(void)
{
    static duty_t a[100], b[100], c[100]; /* longer, and open integrators collect rounding */
    uint16_t n;
    int16_t direction;
    for (direction = 1; direction >= -1; direction = (int16_t)(direction - 2)) {
        rig_lock(direction);
        for (n = 0; n < 100u; n++) {
            int16_t i_a = (int16_t)(n * 16), i_b = (int16_t)(300 - (int16_t)n * 12);
            rig_currents(i_a, (direction > 0) ? i_b : (int16_t)(-i_a - i_b));
            rig_tick(1);
            if (direction > 0) {
                a[n] = out.duty.a;
                b[n] = out.duty.b;
                c[n] = out.duty.c;
            } else {
                TEST_ASSERT_UINT16_WITHIN(4, a[n], out.duty.a);
                TEST_ASSERT_UINT16_WITHIN(4, b[n], out.duty.c);
                TEST_ASSERT_UINT16_WITHIN(4, c[n], out.duty.b);
            }
        }
    }
}

void test_reverse_runs_like_forward(void)
{
    float forward, forward_error;
    run_at(1, 9000);
    motor.load_nm = 0.03F;
    ideal_motor_run(10000);
    forward = ideal_motor_erpm();
    forward_error = ideal_motor_angle_error();
    run_at(-1, 9000);
    motor.load_nm = 0.03F;
    ideal_motor_run(10000);
    TEST_ASSERT_FLOAT_WITHIN(30.0F, -forward, ideal_motor_erpm());
    TEST_ASSERT_FLOAT_WITHIN(0.02F, -forward_error, ideal_motor_angle_error());
}

/* ---- closed loop on the model ---- */

void test_speed_follows_the_reference_with_a_small_angle_error(void)
{
    uint16_t n;
    run_at(1, 10000);
    for (n = 0; n < 200u; n++) {
        ideal_motor_run(10);
        TEST_ASSERT_FLOAT_WITHIN(50.0F, 10000.0F, ideal_motor_erpm()); /* 0.5 % */
        TEST_ASSERT_FLOAT_WITHIN(0.035F, 0.0F, ideal_motor_angle_error()); /* 2 degrees */
    }
}

void test_speed_comes_back_after_a_load_step(void)
{
    run_at(1, 10000);
    motor.load_nm = 0.05F;
    ideal_motor_run(6000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_FLOAT_WITHIN(50.0F, 10000.0F, ideal_motor_erpm());
    TEST_ASSERT_GREATER_THAN_INT16(1300, drive.run.control.i_q13.q); /* (0.05 + 0.004) / 0.0599 A = 1678 counts */
}

void test_field_weakening_doubles_the_base_speed(void)
{
    run_at(1, 10000);
    drive.command.target_erpm = 27500;
    ideal_motor_run(30000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_FLOAT_WITHIN(140.0F, 27500.0F, ideal_motor_erpm());
    TEST_ASSERT_EQUAL_UINT16(14, drive.run.fieldweak.index);
}

void test_blocked_shaft_in_closed_loop_ends_in_a_fault_within_a_second(void)
{
    run_at(1, 8000);
    motor.blocked = 1;
    TEST_ASSERT_LESS_THAN_UINT32(20000, ideal_motor_run_until(DRIVE_FAULT, 30000));
    TEST_ASSERT_TRUE(drive.fault == (uint16_t)FAULT_STALL || drive.fault == (uint16_t)FAULT_LOST_LOCK);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}
