/* What the ADC and the board's measuring circuits deliver: formats, channels, trigger, shunt window, noise, and the warnings. */
#define FAKE_OWN_SETUP
#include "fake_firmware.inc"

void tearDown(void);

static uint16_t buffer[4];

static void keep_buffers(void)
{
    buffer[0] = ADC1BUF0;
    buffer[1] = ADC1BUF1;
    buffer[2] = ADC1BUF2;
    buffer[3] = ADC1BUF3;
}

void setUp(void)
{
    fake_setup();
    memset(buffer, 0, sizeof buffer);
    fake_adc_hook = keep_buffers;
    set("adc.noise_lsb", 0.0);
}

/* Current of phase A held by a DC voltage on a blocked rotor. */
static void hold_current(uint16_t spread)
{
    set("load.locked", 1.0);
    set("motor.rs_ohm", 1.0);
    set_duties((uint16_t)(1000 + spread), (uint16_t)(1000 - spread), (uint16_t)(1000 - spread));
    start(1000);
}

void test_zero_current_reads_zero_in_signed_fractional_format(void)
{
    start(2);
    TEST_ASSERT_EQUAL_HEX16(0x0000, buffer[1]);
    TEST_ASSERT_EQUAL_HEX16(0x0000, buffer[2]);
}

void test_current_into_the_motor_lowers_the_reading_by_375_mv_per_ampere(void)
{
    hold_current(250);
    double i_a = get("plant.i_a");
    TEST_ASSERT_TRUE(i_a > 1.0);
    double counts = (double)(int16_t)buffer[1] / 64.0;
    TEST_ASSERT_DOUBLE_WITHIN(0.51, -i_a * 0.375 / 3.3 * 1024.0, counts);
    counts = (double)(int16_t)buffer[2] / 64.0;
    TEST_ASSERT_DOUBLE_WITHIN(0.51, -get("plant.i_b") * 0.375 / 3.3 * 1024.0, counts);
    TEST_ASSERT_DOUBLE_WITHIN(0.0045, i_a, get("adc.ia_a"));
}

void test_readings_saturate_at_4_4_ampere(void)
{
    set("inverter.trip_a", 0.0);
    hold_current(500);
    TEST_ASSERT_TRUE(get("plant.i_a") > 4.6);
    TEST_ASSERT_EQUAL_HEX16(0x8000, buffer[1]);
}

void test_bus_and_potentiometer_readings(void)
{
    set("input.pot", 0.25);
    set("bus.load_a", 0.0);
    set("supply.resistance_ohm", 1e-3);
    start(10);
    TEST_ASSERT_EQUAL_HEX16((uint16_t)((256u << 6) ^ 0x8000u), buffer[0]);
    double volts = (double)((buffer[3] ^ 0x8000u) >> 6) / 1024.0 * 3.3 * 16.0;
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 24.0, volts);
}

void test_offset_and_gain_errors_show_in_the_reading(void)
{
    set("shunt.offset_a_v", 0.0330); /* 10.24 counts */
    set("adc.gain_error", 0.01);
    start(2);
    TEST_ASSERT_EQUAL_INT(15, (int16_t)buffer[1] / 64); /* (512 + 10.24) * 1.01 - 512 */
    TEST_ASSERT_EQUAL_INT(5, (int16_t)buffer[2] / 64);
}

void test_each_result_format_has_its_bits_in_place(void)
{
    static const uint16_t expected[4] = { 0x0100, 0xFF00, 0x4000, 0xC000 }; /* code 256 */
    set("input.pot", 0.25);
    for (unsigned format = 0; format < 4; format++) {
        at_init("AD1CON1", (uint16_t)(0x806C | (format << 8)));
        start(2);
        TEST_ASSERT_EQUAL_HEX16(expected[format], buffer[0]);
    }
    TEST_ASSERT_TRUE(warned_about("AD1CON1"));
}

void test_a_trigger_under_the_high_sides_reads_no_current_and_is_named(void)
{
    at_init("P1SECMP", 0x0000); /* counter at zero: the high sides conduct */
    hold_current(250);
    TEST_ASSERT_TRUE(get("plant.i_a") > 1.0);
    TEST_ASSERT_EQUAL_HEX16(0x0000, buffer[1]);
    TEST_ASSERT_TRUE(get("adc.ia_invalid_count") > 900.0);
    TEST_ASSERT_TRUE(warned_about("P1SECMP"));
}

void test_a_high_duty_closes_the_window_of_its_shunt(void)
{
    set("inverter.trip_a", 0.0);
    run_blocked(400, 1960, 1500, 1500); /* low for 1 us, dead time included */
    TEST_ASSERT_TRUE(get("adc.ia_invalid_count") > 350.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("adc.ib_invalid_count"));
    TEST_ASSERT_TRUE(fabs((double)(int16_t)buffer[1] / 64.0 * 3.3 / 1024.0 / 0.375) < 0.7 * get("plant.i_a"));
}

void test_the_low_diode_keeps_the_window_open_through_the_dead_time(void)
{
    run_blocked(400, 1900, 1500, 1500); /* low path of A from 47.5/2 us on: 1.25 us before the middle, on its diode (i > 0) */
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("adc.ia_invalid_count"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, get("plant.i_a"), get("adc.ia_a"));
}

/* Part of phase A's current that a sample at the given compare value shows. */
static double shown_part(uint16_t secmp)
{
    at_init("P1SECMP", secmp);
    set("shunt.settle_s", 1e-6);
    set("load.locked", 1.0);
    set("motor.rs_ohm", 1.0);
    set_duties(1000, 500, 500);
    start(1000);
    return get("adc.ia_a") / get("plant.i_a");
}

void test_a_sample_just_after_a_side_took_over_shows_part_of_the_current(void)
{
    /* A's low diode carries from 12.5 us + turn-off delay 0.15 us on */
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.0, shown_part(505));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.5, shown_part(526));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 1.0, shown_part(548));
    /* A's low diode gives up at 37.5 us + dead time 2 us + turn-on delay 0.1 us */
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 1.0, shown_part(0x8000 | (2000 - 1583)));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.5, shown_part(0x8000 | (2000 - 1604)));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.0, shown_part(0x8000 | (2000 - 1626)));
}

void test_interrupts_wait_while_the_cpu_masks_them(void)
{
    at_init("SR", 0x00E0); /* level 7 */
    start(10);
    TEST_ASSERT_EQUAL_UINT(0, fake_adc_calls);
    set("reg.SR", 0.0);
    run(10);
    TEST_ASSERT_EQUAL_UINT(11, fake_adc_calls); /* the one that waited, and ten new ones */
}

void test_a_handler_slower_than_the_period_overruns_and_is_named(void)
{
    set("cpu.isr_us", 70.0);
    start(100);
    TEST_ASSERT_UINT_WITHIN(1, 71, fake_adc_calls); /* 5 ms in handlers of 70 us, one after the other */
    TEST_ASSERT_TRUE(get("adc.overrun_count") > 90.0);
    TEST_ASSERT_TRUE(warned_about("IFS0"));
}

static void forget_the_flag(void)
{
    IFS0bits.AD1IF = 1;
}

void test_a_handler_that_leaves_its_flag_set_starves_the_main_loop_and_is_named(void)
{
    fake_adc_hook = forget_the_flag;
    start(100);
    TEST_ASSERT_EQUAL_UINT(0, fake_background_calls);
    TEST_ASSERT_TRUE(warned_about("IFS0"));
}

void test_a_dropped_handler_leaves_the_outputs_as_they_were(void)
{
    start(10);
    set("cpu.isr_dropped", 1.0);
    set_duties(0, 0, 0);
    run(10);
    TEST_ASSERT_EQUAL_UINT(10, fake_adc_calls);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5, get("pwm.duty1"));
}

static double noise_sum, noise_square;

static void collect_noise(void)
{
    double counts = (double)(int16_t)ADC1BUF1 / 64.0;
    noise_sum += counts;
    noise_square += counts * counts;
}

void test_noise_has_the_set_deviation_and_no_mean(void)
{
    set("adc.noise_lsb", 2.0);
    fake_override = 0x0000;
    fake_adc_hook = collect_noise;
    noise_sum = 0.0;
    noise_square = 0.0;
    start(20000);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.0, noise_sum / 20000.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, sqrt(4.0 + 1.0 / 12.0), sqrt(noise_square / 20000.0));
}

static double sum_with_seed(double seed)
{
    set("adc.noise_lsb", 2.0);
    set("rng.seed", seed);
    fake_adc_hook = collect_noise;
    noise_square = 0.0;
    start(200);
    return noise_square;
}

void test_the_seed_decides_the_noise(void)
{
    double first = sum_with_seed(5.0);
    TEST_ASSERT_EQUAL_DOUBLE(first, sum_with_seed(5.0));
    TEST_ASSERT_TRUE(first != sum_with_seed(6.0));
}

void test_a_free_running_converter_ignores_the_pwm_and_is_named(void)
{
    at_init("AD1CON1", 0x83EC); /* SSRC = 7 */
    at_init("AD1CON3", 0x1F02);
    set("cpu.isr_us", 1.0);
    start(100);
    TEST_ASSERT_TRUE(fake_adc_calls > 500);
    TEST_ASSERT_TRUE(warned_about("AD1CON1"));
}

/* A test of the converter: an input that is switched off reads AVSS. For a few periods that is meant, for longer it is a mistake. */
void test_an_input_that_is_switched_off_reads_ground_and_is_a_warning_after_a_while(void)
{
    set("input.pot", 0.75);
    start(10);
    TEST_ASSERT_EQUAL_HEX16(0x4000, buffer[0]);
    AD1CHS0 = 6;
    run(3);
    TEST_ASSERT_EQUAL_HEX16(0x8000, buffer[0]);
    TEST_ASSERT_EQUAL_HEX16(0x0000, buffer[1]);
    AD1CHS0 = 8;
    run(10);
    TEST_ASSERT_EQUAL_HEX16(0x4000, buffer[0]);
    TEST_ASSERT_FALSE(warned_about("AD1CHS0"));
    TEST_ASSERT_FALSE(warned_about("AD1PCFGL"));
    AD1CHS0 = 6;
    run(10);
    TEST_ASSERT_TRUE(warned_about("AD1CHS0"));
    TEST_ASSERT_TRUE(warned_about("AD1PCFGL"));
}

/* The thermistors are CH0's in turn with the potentiometer. */
void test_thermistors_give_the_share_of_their_temperature_and_are_no_mistake_where_they_are_analogue(void)
{
    at_init("AD1PCFGL", 0xFE38);
    set("adc.noise_lsb", 0.0);
    set("motor.temp_c", 25.0);
    set("ntc.bridge_c", 70.0); /* 2.204 kohm of 10 */
    start(10);
    AD1CHS0 = 6;
    run(10);
    TEST_ASSERT_EQUAL_HEX16(0x0000, buffer[0]);
    AD1CHS0 = 7;
    run(10);
    TEST_ASSERT_UINT16_WITHIN(64, 0x8000u + (unsigned)(65536.0 * 2.204 / 12.204), buffer[0]);
    set("fault.bridge_ntc_stuck", 3.0);
    run(3);
    TEST_ASSERT_EQUAL_HEX16(0x7FC0, buffer[0]);
    set("fault.motor_ntc_stuck", 2.0);
    AD1CHS0 = 6;
    run(10);
    TEST_ASSERT_EQUAL_HEX16(0x8000, buffer[0]);
    TEST_ASSERT_FALSE(warned_about("AD1CHS0"));
    TEST_ASSERT_FALSE(warned_about("AD1PCFGL"));
    AD1CHS0 = 5;
    run(10);
    TEST_ASSERT_TRUE(warned_about("AD1CHS0"));
}

void test_the_motor_s_thermistor_follows_the_winding_with_its_lag(void)
{
    set("ntc.motor_lag_s", 0.01);
    set("motor.temp_c", 25.0);
    start(10);
    set("motor.temp_c", 125.0);
    run(200);
    TEST_ASSERT_DOUBLE_WITHIN(0.5, 125.0 - 100.0 * exp(-1.0), get("ntc.motor_c"));
    set("ntc.motor_lag_s", 0.0);
    run(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 125.0, get("ntc.motor_c"));
}
