/* What can be broken while the board runs: sensors, transistors, interrupts, the clock. */
#include "fake_firmware.inc"

void setUp(void); /* both in fake_firmware.inc */
void tearDown(void);

#define R 2.67
#define BUS_V 24.0

/* A blocked rotor under a tenth of the bus voltage along phase A: i_a = 2/3 of 2.4 V over R. */
static void hold_vector(void)
{
    make_ideal();
    at_init("P1DTCON1", 0); /* no dead time */
    set("load.locked", 1.0);
    set_duties(1100, 900, 900);
    start(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.006, 2.4 * 2.0 / 3.0 / R, get("plant.i_a"));
}

static void set_and_run(const char *key, double value)
{
    set(key, value);
    run(2);
}

/* ---- sensors ---- */

void test_a_stuck_current_sensor_keeps_its_reading_while_the_current_changes(void)
{
    hold_vector();
    double before_a = get("adc.ia_a");
    set("fault.ia_stuck", 1.0);
    set_duties(850, 1150, 1150);
    run(400);
    TEST_ASSERT_TRUE(get("plant.i_a") < -0.5);
    TEST_ASSERT_EQUAL_DOUBLE(before_a, get("adc.ia_a"));
    set_and_run("fault.ia_stuck", 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, get("plant.i_a"), get("adc.ia_a"));
}

void test_a_current_sensor_sticks_at_ground_supply_or_the_middle(void)
{
    hold_vector();
    set_and_run("fault.ib_stuck", 2.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 1.65 / 0.375, get("adc.ib_a"));
    set_and_run("fault.ib_stuck", 3.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, -1.65 / 0.375, get("adc.ib_a"));
    set_and_run("fault.ib_stuck", 4.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.0, get("adc.ib_a"));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, get("plant.i_a"), get("adc.ia_a")); /* the other one works */
}

void test_gain_and_error_of_a_current_sensor_act_on_its_reading_only(void)
{
    hold_vector();
    double true_a = get("plant.i_a");
    set_and_run("fault.ia_gain", 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.5 * true_a, get("adc.ia_a"));
    set_and_run("fault.ia_error_a", 0.4);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.5 * true_a + 0.4, get("adc.ia_a"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, true_a, get("plant.i_a"));
}

void test_noise_of_a_sensor_has_the_deviation_that_was_set(void)
{
    hold_vector();
    set("fault.ia_noise_a", 0.2);
    double true_a = get("plant.i_a"), sum = 0.0, squares = 0.0;
    for (unsigned n = 0; n < 2000; n++) {
        run(1);
        double error_a = get("adc.ia_a") - true_a;
        sum += error_a;
        squares += error_a * error_a;
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.0, sum / 2000.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.2, sqrt(squares / 2000.0));
}

/* Volts at the pin of the channel that ADC1BUF<n> holds: signed fractional, 3.3 V full scale. */
static double pin_v(const char *buffer)
{
    return ((double)(int16_t)(uint16_t)get(buffer) / 65536.0 + 0.5) * 3.3;
}

void test_the_reading_of_the_bus_can_be_half_off_or_stand_still(void)
{
    hold_vector();
    TEST_ASSERT_DOUBLE_WITHIN(0.004, BUS_V / 16.0, pin_v("reg.ADC1BUF3"));
    set_and_run("fault.vbus_gain", 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(0.004, BUS_V / 32.0, pin_v("reg.ADC1BUF3"));
    set_and_run("fault.vbus_error_v", 8.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.004, BUS_V / 32.0 + 0.5, pin_v("reg.ADC1BUF3"));
    set_and_run("fault.vbus_stuck", 1.0);
    set_and_run("bus.voltage_v", 12.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.004, BUS_V / 32.0 + 0.5, pin_v("reg.ADC1BUF3"));
}

void test_a_broken_wire_of_the_potentiometer_reads_a_rail(void)
{
    set("input.pot", 0.5);
    hold_vector();
    TEST_ASSERT_DOUBLE_WITHIN(0.004, 1.65, pin_v("reg.ADC1BUF0"));
    set_and_run("fault.pot_stuck", 2.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.004, 0.0, pin_v("reg.ADC1BUF0"));
    set_and_run("fault.pot_stuck", 3.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.004, 3.3, pin_v("reg.ADC1BUF0"));
}

/* ---- wiring ---- */

void test_swapped_current_signals_read_each_other_s_phase(void)
{
    hold_vector();
    double a = get("plant.i_a"), b = get("plant.i_b");
    set_and_run("wiring.currents", 1.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, b, get("adc.ia_a"));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, a, get("adc.ib_a"));
}

void test_a_signal_of_a_driver_comes_to_the_other_leg(void)
{
    static const char *const driven[4] = { "plant.i_a", "plant.i_b", "plant.i_a", "plant.i_c" };
    for (int swap = 0; swap < 4; swap++) {
        fake_restart();
        make_ideal();
        at_init("P1DTCON1", 0); /* no dead time */
        set("wiring.drivers", swap);
        run_blocked(400, 1100, 900, 900);
        TEST_ASSERT_TRUE_MESSAGE(get(driven[swap]) > 0.5, driven[swap]);
    }
}

void test_with_two_motor_wires_swapped_the_rotor_aligns_to_another_phase_and_turns_the_other_way_round(void)
{
    static const double at_leg_a_deg[4] = { 0.0, 120.0, 0.0, 240.0 };
    for (int swap = 0; swap < 4; swap++) {
        fake_restart();
        make_ideal();
        set("wiring.motor", swap);
        set("mech.viscous_nms", 5e-4);
        set("mech.coulomb_nm", 0.0);
        set("state.theta_e_deg", at_leg_a_deg[swap] + 30.0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, at_leg_a_deg[swap] + 30.0, get("state.theta_e_deg"));
        set_duties(1100, 900, 900);
        start(20000);
        TEST_ASSERT_DOUBLE_WITHIN(1.0, 0.0, remainder(get("plant.theta_e_deg") - at_leg_a_deg[swap], 360.0));
        double before = get("plant.turns");
        set_duties(1100, 1100, 900); /* from A to -C */
        run(1000);
        TEST_ASSERT_TRUE((get("plant.turns") - before) * (swap == 0 ? 1.0 : -1.0) > 0.01);
        set("state.speed_rpm", 300.0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 300.0, get("state.speed_rpm"));
    }
}

void test_fault_input_is_dead_or_of_the_wrong_polarity(void)
{
    start(1);
    set_and_run("input.flta", 1.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("pin.RB8"));
    set_and_run("wiring.flta", 1.0);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, get("pin.RB8"));
    set_and_run("wiring.flta", 2.0);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, get("pin.RB8"));
    set_and_run("input.flta", 0.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("pin.RB8"));
}

void test_buttons_swapped_or_dead(void)
{
    static const double s2_then[4] = { 0.0, 1.0, 1.0, 0.0 }, s3_then[4] = { 1.0, 0.0, 1.0, 1.0 }; /* levels of the pins while S2 is pressed */
    set("input.s2", 1.0);
    start(1);
    for (int wiring = 0; wiring < 4; wiring++) {
        set_and_run("wiring.buttons", wiring);
        TEST_ASSERT_EQUAL_DOUBLE(s2_then[wiring], get("pin.RA8"));
        TEST_ASSERT_EQUAL_DOUBLE(s3_then[wiring], get("pin.RB4"));
    }
}

void test_leds_swapped_or_dark(void)
{
    static const double first[4] = { 1.0, 0.0, 0.0, 1.0 }, second[4] = { 0.0, 1.0, 0.0, 0.0 }; /* with RC6 high and RC7 low */
    start(1);
    LATC = 0x0040;
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("led.alive")); /* an input */
    TRISC = 0xFF3F;
    for (int wiring = 0; wiring < 4; wiring++) {
        set("wiring.leds", wiring);
        TEST_ASSERT_EQUAL_DOUBLE(first[wiring], get("led.alive"));
        TEST_ASSERT_EQUAL_DOUBLE(second[wiring], get("led.run"));
    }
}

/* ---- transistors ---- */

void test_through_a_high_transistor_that_never_turns_on_no_current_enters_the_motor(void)
{
    hold_vector();
    set("fault.never_on", 2.0); /* 1H; against its current the high diode still carries the leg */
    run(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.0, get("plant.i_a"));
    set_duties(900, 1100, 1100);
    run(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.006, -2.4 * 2.0 / 3.0 / R, get("plant.i_a"));
    set_duties(1100, 900, 900);
    set("fault.never_on", 0.0);
    run(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.012, 2.4 * 2.0 / 3.0 / R, get("plant.i_a"));
}

void test_a_low_transistor_that_never_turns_on_leaves_the_current_to_the_high_diode(void)
{
    hold_vector();
    set("fault.never_on", 1.0); /* 1L; the current into A goes on through the low diode */
    run(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.006, 2.4 * 2.0 / 3.0 / R, get("plant.i_a"));
    set_duties(900, 1100, 1100); /* out of A: the high diode holds the leg at bus plus */
    run(400);
    TEST_ASSERT_TRUE(get("plant.i_a") > -0.01);
}

void test_a_high_transistor_that_never_turns_off_brakes_a_coasting_motor(void)
{
    fake_override = 0x0000; /* all outputs off */
    set("mech.inertia_kgm2", 100.0);
    power_up();
    set("state.speed_rpm", 2000.0);
    run(400);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("stat.i_peak_a"));
    set("fault.never_off", 2.0); /* 1H */
    set("stat.reset", 1.0);
    double least_a = 0.0;
    for (unsigned n = 0; n < 400; n++) {
        run(1);
        least_a = fmin(least_a, get("plant.i_a"));
    }
    TEST_ASSERT_TRUE(get("stat.i_peak_a") > 1.0);
    TEST_ASSERT_TRUE(get("stat.torque_mean_nm") < -0.005);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.0, least_a); /* out of the others' high diodes into A */
}

void test_a_transistor_that_never_turns_off_shorts_the_bus_when_the_other_turns_on(void)
{
    start(10);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("inverter.trip_count"));
    set("fault.never_off", 1.0); /* 1L */
    run(2);
    TEST_ASSERT_TRUE(get("inverter.trip_count") > 0.0);
    TEST_ASSERT_TRUE(fake_fault_calls > 0 || get("pwm.fault_active") == 1.0);
}

void test_what_is_broken_before_the_power_up_is_broken_in_the_first_period(void)
{
    set("fault.never_off", 1.0);
    set("fault.open_phase", 2.0);
    start(1);
    TEST_ASSERT_TRUE(get("inverter.trip_count") > 0.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("plant.i_b"));
}

/* ---- interrupts and clock ---- */

void test_a_share_of_the_control_interrupts_never_comes(void)
{
    start(10);
    set("fault.isr_lost_share", 0.1);
    unsigned before = fake_adc_calls;
    run(1000);
    TEST_ASSERT_EQUAL_UINT(900, fake_adc_calls - before);
    TEST_ASSERT_EQUAL_DOUBLE(100.0, get("fault.isr_lost_count"));
    set("fault.isr_lost_share", 0.0);
    before = fake_adc_calls;
    run(100);
    TEST_ASSERT_EQUAL_UINT(100, fake_adc_calls - before);
}

static double late_after_s, late_sum_s;
static unsigned late_calls;

static void note_lateness(void)
{
    double late_s = get("time_s") - get("plant.time_s") - late_after_s;
    if (late_s > 1e-6) {
        late_calls++;
        late_sum_s += late_s;
    }
}

void test_a_share_of_the_control_interrupts_comes_late(void)
{
    start(10);
    late_after_s = 1e-6 * (get("adc.conversion_us") + get("cpu.isr_us"));
    late_calls = 0;
    late_sum_s = 0.0;
    fake_adc_hook = note_lateness;
    run(100);
    TEST_ASSERT_EQUAL_UINT(0, late_calls);
    set("fault.isr_late_share", 0.25);
    set("fault.isr_late_us", 5.0);
    run(100);
    TEST_ASSERT_EQUAL_UINT(25, late_calls);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 5e-6, late_sum_s / 25.0);
}

void test_a_crystal_that_goes_off_frequency_takes_the_pwm_along(void)
{
    start(10);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 20000.0, get("pwm.frequency_hz"));
    set_and_run("cpu.crystal_hz", 7.2e6);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 18000.0, get("pwm.frequency_hz"));
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 36e6, get("cpu.fcy_hz"));
}
