/* NTC thermistors on the board: CH0's inputs in turn, each sample to its own input, beside the self-tests; what trips, and who is told. */
#include "hurst_params.h"

#undef MOTOR_NTC_USED
#undef BRIDGE_NTC_USED
#define MOTOR_NTC_USED 1
#define BRIDGE_NTC_USED 1

#include "firmware/board/peripherals.c"
#include "firmware/board/application.c"
#include "firmware/board/firmware.c"
#include "firmware/board/isr.c"
#include "firmware/board/reset.c"
#include "firmware/board/selftest_run.c"
#include "firmware/board/status.c"
#include "firmware/board/watch.c"
#include "law.c"

#include <math.h>
#include <string.h>

#include "interrupts.h"
#include "transmitter.h"
#include "unity.h"

#define AN_MOTOR 6u
#define AN_BRIDGE 7u
#define AN_POT 8u

static struct {
    uint16_t raw[16];  /* of each input */
    uint16_t input;    /* that the sample which comes next has followed */
    uint16_t seen;     /* bits of inputs that were chosen */
} adc;

static app_told_t told;
static int16_t asks_run;
static uint16_t asks_clear;

void app_init(void)
{
}

void app_ms(const app_told_t *now, app_asks_t *asks)
{
    told = *now;
    asks->run = asks_run;
    asks->clear_fault = asks_clear;
}

/** Share of the reference of 10 kohm, B = 3435 K and 10 kohm, as the converter has it. */
static uint16_t raw_at(double celsius)
{
    const double r = exp(3435.0 * (1.0 / (celsius + 273.15) - 1.0 / 298.15));
    return (uint16_t)((uint16_t)(1024.0 * r / (r + 1.0) + 0.5) * 64u ^ 0x8000u);
}

static void warm(double motor_c, double bridge_c)
{
    adc.raw[AN_MOTOR] = raw_at(motor_c);
    adc.raw[AN_BRIDGE] = raw_at(bridge_c);
}

static void power_up(void)
{
    host_registers_reset();
    ADC1BUF3 = (uint16_t)(int16_t)(24.0F / 52.8F * 65536.0F - 32768.0F);
    firmware_init();
    adc.input = AN_POT;
}

void setUp(void)
{
    memset(&adc, 0x80, sizeof adc);
    adc.raw[BOARD_AN_OFF] = 0x8000u;
    adc.raw[AN_POT] = 0x1230u;
    adc.seen = 0;
    warm(60.0, 40.0);
    asks_run = 0;
    asks_clear = 0;
    host_watchdog_counts = 10000;
    transmitter_begins();
    owed_ms = 0;
    power_up();
}

void tearDown(void)
{
}

/** A period whose sample still belongs to the input from before a change: the worst that there is. */
static void a_sample(void)
{
    ADC1BUF0 = adc.raw[adc.input];
    adc.input = AD1CHS0;
    adc.seen |= (uint16_t)(1u << AD1CHS0);
    a_period();
}

static void board_ms(uint16_t count)
{
    while (count-- != 0u) {
        for (uint16_t n = 0; n < 20u; n++) {
            a_sample();
            if (n % 4u == 3u) {
                IFS0bits.T1IF = (n == 19u);
                firmware_background();
                transmitter_takes();
            }
        }
    }
}

static int16_t celsius(const ntc_t *ntc)
{
    return (int16_t)((ntc->celsius_q4 + 8) / 16);
}

void test_each_sample_goes_to_its_own_input(void)
{
    TEST_ASSERT_EQUAL_INT16(INT16_MIN, board_pot.now_q15);
    for (uint16_t ms = 0; ms < 1500u; ms++) {
        board_ms(1);
        TEST_ASSERT_TRUE(ms < 2u || board_pot.now_q15 == 0x1230);
        TEST_ASSERT_TRUE(ms < 8u || (celsius(&board_drive.heat.motor) - 60) / 2 == 0);
        TEST_ASSERT_TRUE(ms < 8u || (celsius(&board_drive.heat.bridge) - 40) / 2 == 0);
    }
    TEST_ASSERT_EQUAL_HEX16(1u << AN_POT | 1u << AN_MOTOR | 1u << AN_BRIDGE | 1u << BOARD_AN_OFF, adc.seen);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

void test_a_sample_soon_after_the_change_is_not_taken(void)
{
    board_ms(20);
    adc.raw[AN_POT] = 0x4440u;
    firmware_choose_input(AN_POT);
    for (uint16_t n = 0; n < CH0_SETTLES_TICKS - 1u; n++) {
        a_sample();
        firmware_turn_input();
        TEST_ASSERT_EQUAL_HEX16(0x1230, board_pot.now_q15);
    }
    a_sample();
    firmware_turn_input();
    TEST_ASSERT_EQUAL_HEX16(0x4440, board_pot.now_q15);
}

void test_potentiometer_is_read_every_second_millisecond_and_each_sensor_every_fourth(void)
{
    uint16_t count[16] = { 0 };
    board_ms(100);
    for (uint16_t ms = 0; ms < 400u; ms++) {
        count[AD1CHS0]++;
        board_ms(1);
    }
    TEST_ASSERT_UINT16_WITHIN(3, 200, count[AN_POT]);
    TEST_ASSERT_UINT16_WITHIN(3, 100, count[AN_MOTOR]);
    TEST_ASSERT_UINT16_WITHIN(3, 100, count[AN_BRIDGE]);
}

void test_inputs_are_analogue_and_an_input_for_the_self_test_is_left(void)
{
    TEST_ASSERT_EQUAL_HEX16(0xFE38, AD1PCFGL);
    TEST_ASSERT_EQUAL_UINT16(5, BOARD_AN_OFF);
    TEST_ASSERT_EQUAL_HEX16(0x0003, TRISC & 0x0003u);
}

/* ---- self-tests ---- */

void test_a_bit_of_AD1CHS0_that_flips_is_found_before_its_sample_is_used(void)
{
    for (uint16_t bit = 0; bit < 5u; bit++) {
        setUp();
        board_ms(200);
        AD1CHS0 ^= (uint16_t)(1u << bit);
        board_ms(1);
        TEST_ASSERT_EQUAL_UINT16(SELFTEST_REGISTERS, board_selftest_failed);
        TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_OFF, P1OVDCON);
        TEST_ASSERT_INT16_WITHIN(1, 60, celsius(&board_drive.heat.motor));
    }
}

void test_a_converter_that_does_not_read_ground_is_found(void)
{
    adc.raw[BOARD_AN_OFF] = 0xA000u;
    board_ms(1100);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_ADC, board_selftest_failed);
}

/* ---- faults ---- */

static void expect(drive_state_t state, drive_fault_t fault)
{
    TEST_ASSERT_EQUAL_UINT16(fault, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(state, board_drive.state);
}

void test_a_hot_motor_trips_whatever_runs_and_cannot_be_started_again_until_it_is_cooler(void)
{
    board_ms(100);
    asks_run = 1;
    board_ms(100);
    TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_PWM, P1OVDCON);
    warm(140.0, 40.0);
    board_ms(400);
    expect(DRIVE_FAULT, FAULT_MOTOR_HOT);
    TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_OFF, P1OVDCON);
    asks_run = 0;
    asks_clear = 1;
    board_ms(100);
    expect(DRIVE_FAULT, FAULT_MOTOR_HOT);
    warm(100.0, 40.0);
    asks_clear = 0;
    board_ms(400);
    expect(DRIVE_FAULT, FAULT_MOTOR_HOT);
    asks_clear = 1;
    board_ms(100);
    expect(DRIVE_STOPPED, FAULT_NONE);
}

void test_a_hot_bridge_and_a_broken_wire_stop_a_drive_at_rest_too(void)
{
    board_ms(100);
    warm(60.0, 110.0);
    board_ms(400);
    expect(DRIVE_FAULT, FAULT_BRIDGE_HOT);
    setUp();
    board_ms(100);
    adc.raw[AN_BRIDGE] = 0x7FC0u;
    board_ms(NTC_BROKEN_SAMPLES * 4u - 8u);
    expect(DRIVE_STOPPED, FAULT_NONE);
    board_ms(16);
    expect(DRIVE_FAULT, FAULT_NTC_SENSOR);
    adc.raw[AN_BRIDGE] = raw_at(40.0);
    asks_clear = 1;
    board_ms(100);
    expect(DRIVE_STOPPED, FAULT_NONE);
}

void test_a_sensor_that_is_broken_from_the_beginning_is_told(void)
{
    adc.raw[AN_MOTOR] = 0x8000u;
    board_ms(200);
    expect(DRIVE_FAULT, FAULT_NTC_SENSOR);
    TEST_ASSERT_EQUAL_INT16(0, board_drive.heat.motor.celsius_q4);
}

/* ---- who is told ---- */

void test_application_is_told_both_temperatures_in_counts(void)
{
    board_ms(100);
    TEST_ASSERT_INT16_WITHIN(16, APP_CELSIUS(60), told.motor_q4);
    TEST_ASSERT_INT16_WITHIN(16, APP_CELSIUS(40), told.bridge_q4);
}

void test_status_line_has_the_temperatures_and_the_names(void)
{
#define HEAT_LINE "state 1 fault NONE speed 0 rpm motor -12 C bridge 131 C\r\n"
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    board_drive.heat.motor.celsius_q4 = APP_CELSIUS(-12.5);
    board_drive.heat.bridge.celsius_q4 = APP_CELSIUS(131.5);
    LimitParm.seen = 0;
    *put_line() = '\0';
    TEST_ASSERT_EQUAL_STRING(HEAT_LINE, sent_line);
    LimitParm.seen = LIMIT_TEMPERATURE;
    board_drive.fault = FAULT_NTC_SENSOR;
    *put_line() = '\0';
    TEST_ASSERT_EQUAL_STRING("state 1 fault NTC_SENSOR speed 0 rpm motor -12 C bridge 131 C limit TEMPERATURE\r\n", sent_line);
}

void test_every_fault_and_limit_has_its_name_and_the_longest_line_has_room(void)
{
#define FAULT_TOLD(code, name, passes, decided_by, cause, remedy) #name,
    static const char *const faults[] = { DRIVE_FAULT_TABLE(FAULT_TOLD) };
    char text[40];
    for (uint16_t code = 0; code < FAULT_COUNT; code++) {
        *text_put_fault(text, "", code) = '\0';
        TEST_ASSERT_EQUAL_STRING(faults[code], text);
    }
    board_drive.state = 32767;
    board_drive.fault = FAULT_OVERTEMPERATURE;
    board_drive.run.estimator.omega_filtered_q16 = -32767L * 65536;
    board_drive.heat.motor.celsius_q4 = APP_CELSIUS(152);
    board_drive.heat.bridge.celsius_q4 = APP_CELSIUS(152);
    board_selftest_failed = 10;
    LimitParm.seen = 0x1FFFu;
    while (LimitParm.seen != 0u) {
        const uint16_t seen = LimitParm.seen;
        *put_line() = '\0';
        TEST_ASSERT_TRUE(strlen(sent_line) < sizeof sent_line);
        TEST_ASSERT_TRUE(LimitParm.seen < seen);
    }
}
