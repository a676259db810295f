/* The plant against closed-form answers: currents, torque, friction, short circuit, rectifier, energy. */
#include "fake_firmware.inc"

void setUp(void); /* both in fake_firmware.inc */
void tearDown(void);

#define PI 3.14159265358979323846
#define PSI 7.983e-3
#define POLES 5.0
#define R 2.67
#define L 1.92e-3

static double omega_e(double rpm)
{
    return rpm * PI / 30.0 * POLES;
}

/* Shaft that keeps its speed whatever the torque. */
static void drive_shaft(double rpm)
{
    set("mech.inertia_kgm2", 100.0);
    set("state.speed_rpm", rpm);
}

/* What a key shows, within a part of the expected value. */
static void expect_part(double part, double expected, const char *key)
{
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(part * fabs(expected), expected, get(key), key);
}

static void no_friction(void)
{
    set("mech.viscous_nms", 0.0);
    set("mech.coulomb_nm", 0.0);
    set("mech.stiction_nm", 0.0);
}

/* A shaft that coasts with this speed, all outputs off. */
static void coast(double rpm)
{
    fake_override = 0x0000;
    power_up();
    set("state.speed_rpm", rpm);
}

/* A blocked rotor in a bridge without losses and dead time, under a tenth of the bus voltage along phase A. */
static void hold_vector(void)
{
    make_ideal();
    at_init("P1DTCON1", 0); /* no dead time */
    set("load.locked", 1.0);
    set_duties(1100, 900, 900);
    power_up();
}

void test_dc_current_of_a_blocked_rotor_is_voltage_over_resistance(void)
{
    hold_vector();
    run(400);
    double v_alpha = 24.0 * 0.1 * 2.0 / 3.0;
    expect_part(0.001, v_alpha / R, "plant.i_a");
    TEST_ASSERT_DOUBLE_WITHIN(0.001, -0.5 * v_alpha / R, get("plant.i_b"));
    TEST_ASSERT_DOUBLE_WITHIN(0.001, -0.5 * v_alpha / R, get("plant.i_c"));
}

void test_current_rises_with_the_time_constant_of_the_winding(void)
{
    hold_vector();
    run(10);
    set("reg.AD1CON1", 0.0); /* without the ADC the plant is latched at the end of a period, where the ripple is zero */
    run(1);
    double v_alpha = 24.0 * 0.1 * 2.0 / 3.0;
    expect_part(0.005, v_alpha / R * (1.0 - exp(-0.55e-3 * R / L)), "plant.i_a");
}

/* Td/Ts * Vdc; legs B and C carry the opposite sign. */
static void expect_dead_time_current(double dead_us)
{
    run_blocked(400, 1400, 600, 600);
    double leg_error = 24.0 * dead_us / 50.0;
    expect_part(0.003, (24.0 * 0.4 * 2.0 / 3.0 - leg_error * 4.0 / 3.0) / R, "plant.i_a");
    TEST_ASSERT_DOUBLE_WITHIN(0.003, 2.0, get("pwm.dead_time_us"));
}

void test_dead_time_and_switching_delays_cost_each_leg_their_share_of_the_bus_against_the_current(void)
{
    make_ideal();
    expect_dead_time_current(2.0);
    fake_restart();
    make_ideal();
    set("inverter.turn_on_s", 2e-7);
    set("inverter.turn_off_s", 6e-7);
    expect_dead_time_current(1.6);
}

void test_transistor_and_shunt_drops_act_like_added_resistance(void)
{
    hold_vector();
    set("inverter.rds_on_ohm", 0.3);
    run(400);
    expect_part(0.002, 24.0 * 0.1 * 2.0 / 3.0 / (R + 0.3), "plant.i_a");
}

void test_temperature_changes_resistance_and_flux(void)
{
    set("motor.temp_c", 125.0);
    hold_vector();
    set("state.theta_e_deg", -90.0);
    run(600);
    double i = 24.0 * 0.1 * 2.0 / 3.0 / (R * 1.39);
    expect_part(0.002, i, "plant.i_q");
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1.5 * POLES * PSI * 0.8 * i, get("plant.torque_nm"));
}

void test_torque_is_largest_when_the_current_leads_the_rotor_by_ninety_degrees(void)
{
    hold_vector();
    set("state.theta_e_deg", 0.0);
    run(400);
    double i = 24.0 * 0.1 * 2.0 / 3.0 / R;
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, get("plant.torque_nm"));
    TEST_ASSERT_DOUBLE_WITHIN(0.001, i, get("plant.i_d"));
    set("state.theta_e_deg", -90.0);
    run(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, i, get("plant.i_q"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1.5 * POLES * PSI * i, get("plant.torque_nm"));
}

void test_saliency_adds_reluctance_torque(void)
{
    set("motor.ld_h", 1.5e-3);
    set("motor.lq_h", 3.0e-3);
    hold_vector();
    set("state.theta_e_deg", -135.0);
    run(800);
    double i = 24.0 * 0.1 * 2.0 / 3.0 / R * sqrt(0.5);
    double torque = 1.5 * POLES * (PSI * i + (1.5e-3 - 3.0e-3) * -i * i);
    TEST_ASSERT_DOUBLE_WITHIN(0.002, -i, get("plant.i_d"));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, i, get("plant.i_q"));
    expect_part(0.002, torque, "plant.torque_nm");
    set("stat.reset", 1.0);
    run(10);
    expect_part(0.002, torque, "stat.torque_mean_nm");
}

void test_a_saturated_winding_has_the_remaining_inductance(void)
{
    set("motor.sat_ld_ratio", 0.5);
    set("motor.sat_lq_ratio", 0.5);
    set("motor.sat_current_a", 0.01);
    hold_vector();
    run(5);
    set("reg.AD1CON1", 0.0); /* without the ADC the plant is latched at the end of a period */
    run(1);
    double final = 24.0 * 0.1 * 2.0 / 3.0 / R;
    /* six periods; the first one starts without current and has the full inductance, which counts half */
    expect_part(0.01, final * (1.0 - exp(-0.275e-3 * R / (0.5 * L))), "plant.i_a");
}

void test_short_circuited_windings_carry_the_current_of_the_phasor_diagram(void)
{
    const double rpm = 2000.0;
    make_ideal();
    fake_override = 0x0015; /* all low sides on */
    power_up();
    drive_shaft(rpm);
    run(2000);
    double w = omega_e(rpm);
    double z2 = R * R + w * w * L * L;
    TEST_ASSERT_DOUBLE_WITHIN(0.003, -w * w * L * PSI / z2, get("plant.i_d"));
    TEST_ASSERT_DOUBLE_WITHIN(0.003, -w * PSI * R / z2, get("plant.i_q"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1.5 * POLES * PSI * -w * PSI * R / z2, get("plant.torque_nm"));
}

void test_back_emf_follows_the_rotor_in_the_order_a_b_c(void)
{
    make_ideal();
    fake_override = 0x0015;
    set("motor.rs_ohm", 1000.0); /* the current shows the back-EMF */
    power_up();
    drive_shaft(1000.0);
    run(500);
    double amplitude = omega_e(1000.0) * PSI / 1000.0;
    double theta = get("plant.theta_e_deg") * PI / 180.0;
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * amplitude, amplitude * sin(theta), get("plant.i_a"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * amplitude, amplitude * sin(theta - 2.0 * PI / 3.0), get("plant.i_b"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * amplitude, amplitude * sin(theta + 2.0 * PI / 3.0), get("plant.i_c"));
}

/* Largest speed of the next tenth of a second. */
static double swing_rpm(void)
{
    double most = 0.0;
    for (int k = 0; k < 2000; k++) {
        run(1);
        most = fmax(most, fabs(get("plant.speed_rpm")));
    }
    return most;
}

void test_a_rotor_that_swings_in_a_fixed_field_loses_what_its_back_emf_takes_and_no_more(void)
{
    const double psi = 2e-5, inertia = 3.6e-8, volts = 24.0 * 0.5 * 2.0 / 3.0;
    const double swing = sqrt(POLES * 1.5 * POLES * psi * volts / R / inertia); /* 250 rad/s */
    const double damping = 1.5 * POLES * POLES * psi * psi * R / (R * R + swing * swing * L * L);
    make_ideal();
    at_init("P1DTCON1", 0); /* no dead time */
    set("motor.psi_vs", psi);
    set("mech.inertia_kgm2", inertia);
    no_friction();
    set_duties(1500, 500, 500);
    power_up();
    set("state.theta_e_deg", 20.0);
    run(200);
    double first = swing_rpm();
    run(16000);
    double last = swing_rpm();
    double expected = exp(-0.9 * damping / (2.0 * inertia));
    TEST_ASSERT_TRUE(expected > 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, expected, last / first);
}

void test_a_power_up_forgets_the_torque_of_the_period_before(void)
{
    make_ideal();
    at_init("P1DTCON1", 0); /* no dead time */
    no_friction();
    set_duties(1500, 500, 500);
    power_up();
    set("state.theta_e_deg", 270.0);
    run(40);
    TEST_ASSERT_TRUE(fabs(get("plant.torque_nm")) > 0.01);
    fake_override = 0x0000;
    set("state.speed_rpm", 100.0);
    start(2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 100.0, get("plant.speed_rpm"));
}

void test_coasting_below_the_bus_voltage_carries_no_current(void)
{
    fake_override = 0x0000;
    power_up();
    drive_shaft(2800.0); /* line to line 20.3 V peak */
    run(2000);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("stat.i_peak_a"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("stat.torque_mean_nm"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("pwm.outputs_seen"));
}

void test_coasting_above_the_bus_voltage_rectifies_up_to_the_peak_of_the_line_voltage(void)
{
    const double rpm = 5500.0;
    fake_override = 0x0000;
    set("bus.load_a", 0.0);
    set("inverter.trip_a", 0.0);
    power_up();
    drive_shaft(rpm);
    run(1);
    run(40);
    TEST_ASSERT_TRUE(get("stat.i_peak_a") > 0.2);
    TEST_ASSERT_TRUE(get("stat.torque_mean_nm") < 0.0);
    run(40000);
    double line_peak = sqrt(3.0) * PSI * omega_e(rpm);
    TEST_ASSERT_DOUBLE_WITHIN(0.15, line_peak - 2.0 * 0.8, get("bus.voltage_v"));
}

void test_one_held_terminal_lets_the_line_voltage_open_the_other_diodes(void)
{
    fake_override = 0x0001; /* low side of A only */
    power_up();
    drive_shaft(100.0); /* line to line 0.72 V peak, diodes 0.8 V */
    run(8000);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("stat.i_peak_a"));
    drive_shaft(150.0); /* line to line 1.09 V, phase 0.63 V */
    run(8000);
    TEST_ASSERT_TRUE(get("stat.i_peak_a") > 0.01);
}

static double worst_float_error;
static unsigned float_samples;

/* With A and B at ground, C's open terminal is at one and a half times its back-EMF. */
static void compare_floating_terminal(void)
{
    double theta = get("plant.theta_e_deg") * PI / 180.0;
    double e_c = -PSI * omega_e(2000.0) * sin(theta + 2.0 * PI / 3.0);
    double v_c = (double)((ADC1BUF3 ^ 0x8000u) >> 6) / 1024.0 * 3.3 * 16.0;
    if (get("plant.i_c") == 0.0 && get("time_s") > 0.05) { /* its low diode carries it for the rest of the turn */
        worst_float_error = fmax(worst_float_error, fabs(v_c - 1.5 * e_c));
        float_samples++;
    }
}

void test_a_floating_terminal_shows_the_back_emf_while_the_others_carry_current(void)
{
    make_ideal();
    fake_override = 0x0005;
    at_init("AD1CHS123", 1); /* AN3..5: the terminals through the bus divider */
    at_init("AD1PCFGL", 0x0000);
    fake_adc_hook = compare_floating_terminal;
    worst_float_error = 0.0;
    float_samples = 0;
    power_up();
    drive_shaft(2000.0);
    run(4000);
    TEST_ASSERT_TRUE(get("stat.i_peak_a") > 1.0);
    TEST_ASSERT_TRUE(float_samples > 500);
    TEST_ASSERT_DOUBLE_WITHIN(0.08, 0.0, worst_float_error); /* an LSB is 0.05 V; 5 us of turning */
}

void test_the_bus_capacitor_feeds_the_board_when_the_supply_is_off(void)
{
    fake_override = 0x0000;
    power_up();
    set("supply.voltage_v", 0.0);
    set("bus.load_a", 0.1);
    run(1000);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 24.0 - 0.1 * 0.05 / 1e-3, get("bus.voltage_v"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, get("supply.current_a"));
}

void test_a_rectifying_bridge_feeds_a_load_with_six_pulses(void)
{
    const double rpm = 5500.0;
    make_ideal();
    fake_override = 0x0000;
    set("motor.rs_ohm", 0.01);
    set("motor.ld_h", 2e-5);
    set("motor.lq_h", 2e-5);
    set("supply.sinks", 1.0);
    set("supply.voltage_v", 30.0);
    power_up();
    drive_shaft(rpm);
    run(100);
    TEST_ASSERT_TRUE(get("bus.current_a") < 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 30.0, get("bus.voltage_v"));
}

static double vector_angle;
static double vector_step;
static double vector_share;

static void turning_vector(void)
{
    vector_angle += vector_step;
    for (int k = 0; k < 3; k++) {
        fake_duty[k] = (uint16_t)lrint(1000.0 + 1000.0 * vector_share * cos(vector_angle - k * 2.0 * PI / 3.0));
    }
}

/* Turn the motor synchronously with a rotating voltage, from a shaft that already has the speed. */
static void run_synchronously(double rpm, double share, uint32_t periods)
{
    vector_step = omega_e(rpm) * 50e-6;
    vector_share = share;
    vector_angle = 0.5 * PI;
    fake_adc_hook = turning_vector;
    power_up();
    set("state.theta_e_deg", 0.0);
    set("state.speed_rpm", rpm);
    run(periods);
}

/* Largest bus voltage while a motor with a flywheel, at 2000 rpm, meets a voltage of half its back-EMF. */
static double braking_bus_v(double sinks)
{
    set("supply.sinks", sinks);
    set("inverter.trip_a", 0.0);
    set("mech.inertia_kgm2", 1e-4);
    run_synchronously(2000.0, 0.35, 1000);
    return get("stat.bus_max_v");
}

void test_braking_a_spinning_motor_raises_a_bus_whose_supply_cannot_sink(void)
{
    double rising_v = braking_bus_v(0.0);
    fake_restart();
    double held_v = braking_bus_v(1.0);
    TEST_ASSERT_TRUE(rising_v > 26.0);
    TEST_ASSERT_TRUE(held_v < 24.2);
}

/** The brake's switch is RA9. */
static void set_brake(bool on)
{
    set("reg.TRISA", 0x079F & ~(1 << 9));
    set("reg.LATA", on ? 1 << 9 : 0);
}

void test_a_brake_resistor_takes_V_over_R_while_its_pin_drives_high(void)
{
    fake_override = 0x0000;
    power_up();
    set("bus.brake_ohm", 12.0);
    set_brake(true);
    run(400);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, get("bus.voltage_v") / 12.0, get("bus.brake_a"));
    TEST_ASSERT_DOUBLE_WITHIN(0.001, 2.0, get("bus.brake_a") * 24.0 / get("bus.voltage_v"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, get("bus.brake_a") + 0.05, get("supply.current_a"));
    set_brake(false);
    run(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, get("bus.brake_a"));
    set("reg.LATA", 1 << 9);
    set("reg.TRISA", 0x079F); /* a pull-down holds it */
    run(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, get("bus.brake_a"));
}

void test_a_brake_resistor_discharges_the_bus_as_R_and_C_do_and_its_heat_is_the_capacitor_s_energy(void)
{
    fake_override = 0x0000;
    power_up();
    set("bus.load_a", 0.0);
    set("supply.voltage_v", 0.0);
    set("bus.brake_ohm", 10.0);
    set_brake(true);
    set("stat.reset", 1.0);
    run(200); /* 10 ms, R C */
    double v = get("bus.voltage_v");
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 24.0 / 2.71828, v);
    TEST_ASSERT_DOUBLE_WITHIN(0.003, 0.5e-3 * (24.0 * 24.0 - v * v), get("stat.energy_brake_j"));
}

void test_energy_from_the_supply_is_found_again_as_heat_work_and_stored_energy(void)
{
    make_ideal();
    set("bus.capacitance_f", 1e-4);
    run_synchronously(1000.0, 0.5, 4000);
    set("stat.reset", 1.0);
    double bus_before = get("bus.voltage_v");
    run(20000);
    double stored = 0.5 * 1e-4 * (pow(get("bus.voltage_v"), 2.0) - pow(bus_before, 2.0));
    double in = get("stat.energy_bus_j");
    double out = get("stat.energy_copper_j") + get("stat.energy_shaft_j");
    TEST_ASSERT_TRUE(in > 1.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.002 * in, in, out);
    TEST_ASSERT_DOUBLE_WITHIN(0.002 * in, in + stored, get("stat.energy_supply_j"));
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 1000.0, get("stat.speed_mean_rpm"));
}

void test_shaft_work_is_torque_times_speed(void)
{
    make_ideal();
    run_synchronously(1000.0, 0.5, 8000);
    set("stat.reset", 1.0);
    run(20000);
    double w = 1000.0 * PI / 30.0;
    double friction = 0.004 + 15.3e-6 * w;
    expect_part(0.01, friction, "stat.torque_mean_nm");
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * friction * w, friction * w, get("stat.energy_shaft_j"));
}

static void record_run(double max_step_s, double lq_h, double result[5])
{
    static const char *const key[5] = { "plant.i_a", "plant.i_d", "plant.i_q", "plant.v_q", "stat.energy_bus_j" };
    set("sim.max_step_s", max_step_s);
    set("adc.noise_lsb", 0.0);
    set("motor.lq_h", lq_h);
    run_synchronously(2000.0, 0.8, 4000);
    for (int k = 0; k < 5; k++) {
        result[k] = get(key[k]);
    }
}

static void compare_steps(double lq_h)
{
    double coarse[5], fine[5];
    record_run(1.0, lq_h, coarse);
    fake_restart();
    record_run(2e-7, lq_h, fine);
    for (int k = 0; k < 5; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(0.001 * fabs(fine[k]) + 1e-4, fine[k], coarse[k]);
    }
}

void test_results_do_not_depend_on_the_integration_step(void)
{
    compare_steps(L);
    fake_restart();
    compare_steps(1.5 * L); /* a salient motor */
}

void test_dry_friction_slows_the_shaft_at_a_constant_rate_and_holds_it(void)
{
    set("mech.viscous_nms", 0.0);
    coast(1000.0);
    run(1000); /* 50 ms */
    double expected = 1000.0 - 0.004 / 5.5e-6 * 0.05 * 30.0 / PI;
    TEST_ASSERT_DOUBLE_WITHIN(0.5, expected, get("state.speed_rpm"));
    run(4000);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("state.speed_rpm"));
}

void test_viscous_friction_slows_the_shaft_exponentially(void)
{
    set("mech.coulomb_nm", 0.0);
    coast(1000.0);
    run(4000);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 1000.0 * exp(-0.2 * 15.3e-6 / 5.5e-6), get("state.speed_rpm"));
}

void test_quadratic_load_slows_with_the_square_of_speed(void)
{
    no_friction();
    set("load.quadratic_nms2", 1e-6);
    coast(1000.0);
    run(2000);
    double w0 = 1000.0 * PI / 30.0;
    double w = w0 / (1.0 + w0 * 1e-6 / 5.5e-6 * 0.1);
    TEST_ASSERT_DOUBLE_WITHIN(0.005 * w, w, get("state.speed_rpm") * PI / 30.0);
}

void test_stiction_holds_until_it_is_exceeded(void)
{
    fake_override = 0x0000;
    set("mech.stiction_nm", 0.01);
    power_up();
    set("load.active_nm", 0.0099);
    run(200);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("state.speed_rpm"));
    set("load.active_nm", 0.0101);
    run(200);
    TEST_ASSERT_TRUE(get("state.speed_rpm") > 0.0);
    set("load.active_nm", 0.005); /* still above Coulomb friction: it keeps turning */
    run(200);
    TEST_ASSERT_TRUE(get("state.speed_rpm") > 0.0);
}

void test_a_brake_load_never_turns_the_shaft_backwards(void)
{
    set("load.constant_nm", 0.1);
    coast(-500.0);
    set("stat.reset", 1.0);
    run(1000);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("state.speed_rpm"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("stat.speed_max_rpm"));
}

/* A shaft without friction whose only load swings with its angle. */
static void pulsing_shaft(double nm, double order, double deg)
{
    fake_override = 0x0000;
    no_friction();
    set("mech.inertia_kgm2", 1e-4);
    set("load.pulse2_nm", nm);
    set("load.pulse2_order", order);
    set("load.pulse2_deg", deg);
    power_up();
}

void test_a_load_by_angle_takes_and_gives_the_energy_of_its_potential(void)
{
    const double nm = 0.05, order = 2.0, w0 = 600.0 * PI / 30.0;
    pulsing_shaft(nm, order, 0.0);
    set("state.speed_rpm", 600.0);
    double worst = 0.0, slowest = w0;
    for (int k = 0; k < 20000; k++) { /* ten turns */
        run(1);
        double taken = nm / order * (1.0 - cos(order * 2.0 * PI * get("plant.turns")));
        double expected = sqrt(w0 * w0 - 2.0 * taken / 1e-4);
        double w = get("plant.speed_rpm") * PI / 30.0;
        worst = fmax(worst, fabs(w / expected - 1.0));
        slowest = fmin(slowest, w);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.01, sqrt(w0 * w0 - 4.0 * nm / order / 1e-4), slowest);
    TEST_ASSERT_DOUBLE_WITHIN(5e-4, 0.0, worst);
}

void test_a_load_by_angle_swings_a_standing_shaft_about_its_valley_and_neither_dies_nor_grows(void)
{
    pulsing_shaft(0.02, 1.0, 10.0); /* 10 degrees beside the valley */
    for (int k = 0; k < 20; k++) {
        double low = 1e3, high = -1e3;
        for (int n = 0; n < 18000; n++) { /* two swings */
            run(1);
            low = fmin(low, get("plant.turns") * 360.0);
            high = fmax(high, get("plant.turns") * 360.0);
        }
        TEST_ASSERT_DOUBLE_WITHIN(0.02, -20.0, low);
        TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.0, high);
    }
}

void test_a_load_by_angle_pushes_a_standing_shaft_backwards_unless_dry_friction_holds_it(void)
{
    pulsing_shaft(0.02, 1.0, 90.0);
    set("mech.coulomb_nm", 0.0201);
    run(200);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("state.speed_rpm"));
    set("mech.coulomb_nm", 0.0199);
    run(200);
    TEST_ASSERT_TRUE(get("state.speed_rpm") < 0.0);
}

void test_a_load_by_angle_holds_a_standing_shaft_that_something_drives(void)
{
    pulsing_shaft(0.02, 1.0, 90.0);
    set("load.active_nm", 0.02); /* just what the pulse takes */
    run(2000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, get("state.speed_rpm"));
    set("load.active_nm", 0.03);
    run(200);
    TEST_ASSERT_TRUE(get("state.speed_rpm") > 0.0);
}

void test_loads_by_angle_add_up(void)
{
    static const char *const phase[3] = {"load.pulse1_deg", "load.pulse2_deg", "load.pulse3_deg"};
    static const char *const amplitude[3] = {"load.pulse1_nm", "load.pulse2_nm", "load.pulse3_nm"};
    fake_override = 0x0000;
    no_friction();
    set("mech.inertia_kgm2", 100.0);
    for (int k = 0; k < 3; k++) {
        set(phase[k], -90.0);
        set(amplitude[k], 1.0 + k);
    }
    power_up();
    run(2000); /* 0.1 s under 6 N m, forwards */
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 6.0 / 100.0 * 0.1, get("state.speed_rpm") * PI / 30.0);
}

void test_with_two_wires_swapped_a_load_by_angle_is_still_that_of_the_shaft(void)
{
    set("wiring.motor", 1.0);
    pulsing_shaft(0.02, 1.0, 90.0);
    run(200);
    TEST_ASSERT_TRUE(get("state.speed_rpm") < 0.0);
}

void test_a_locked_shaft_stands_still_at_any_torque(void)
{
    set("load.locked", 1.0);
    set("load.active_nm", 10.0);
    power_up();
    set("state.speed_rpm", 500.0);
    run(10);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("state.speed_rpm"));
}

void test_an_open_phase_carries_nothing_and_the_others_carry_the_same_current(void)
{
    hold_vector();
    set("fault.open_phase", 3.0);
    run(400);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("plant.i_c"));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 24.0 * 0.1 / (2.0 * R), get("plant.i_a"));
    set("fault.open_phase", 0.0);
    run(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 24.0 * 0.1 * 2.0 / 3.0 / R, get("plant.i_a"));
}

void test_current_in_the_diodes_dies_out_after_the_outputs_go_off(void)
{
    run_blocked(400, 1400, 700, 700);
    TEST_ASSERT_TRUE(get("plant.i_a") > 1.0);
    set("reg.P1OVDCON", 0.0);
    run(4);
    set("reg.AD1CON1", 0.0);
    run(10);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("plant.i_a"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("plant.i_b"));
}

void test_diode_current_falls_at_the_rate_of_the_reversed_bus_voltage(void)
{
    set("motor.rs_ohm", 0.5);
    hold_vector();
    run(800);
    set("reg.AD1CON1", 0.0);
    run(1);
    double before = get("plant.i_a");
    set("reg.P1OVDCON", 0.0);
    run(1); /* phase A hangs on the low diode, B and C on the high diodes: -2/3 Vdc */
    double tau = L / 0.5;
    double aim = -24.0 * 2.0 / 3.0 / 0.5;
    double expected = aim + (before - aim) * exp(-50e-6 / tau);
    TEST_ASSERT_DOUBLE_WITHIN(0.002 * before, expected, get("plant.i_a"));
}
