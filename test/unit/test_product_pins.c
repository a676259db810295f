/* A product's pins on the host's registers: the direction input, the relays for fault and running, the brake resistor's switch. */
#include "hurst_params.h"

#undef DIRECTION_INPUT_USED
#undef FAULT_OUTPUT_USED
#undef RUNNING_OUTPUT_USED
#undef BRAKE_CHOPPER_V
#define DIRECTION_INPUT_USED 1
#define FAULT_OUTPUT_USED 1
#define RUNNING_OUTPUT_USED 1
#define BRAKE_CHOPPER_V 26

#include "firmware/board/peripherals.c"
#include "firmware/app/panel.c"
#include "firmware/board/application.c"
#include "firmware/board/firmware.c"
#include "firmware/board/isr.c"
#include "firmware/board/reset.c"
#include "firmware/board/selftest_run.c"
#include "firmware/board/status.c"
#include "firmware/board/watch.c"
#include "firmware/drive/limits.c"
#include "firmware/drive/modes/modes.c"

#include "interrupts.h"
#include "press_s2.h"
#include "transmitter.h"
#include "unity.h"

#define DIRECTION (1u << 4)
#define FAULT_RELAY (1u << 7)
#define CHOPPER (1u << 9)
#define RUNNING_RELAY (1u << 10)

static void bus_volts(float bus_v)
{
    ADC1BUF3 = (uint16_t)(int16_t)(bus_v / 52.8F * 65536.0F - 32768.0F);
}

/** Registers as after a reset, then the start. The direction's contact is open. */
static void power_up(void)
{
    host_registers_reset();
    PORTA = 0xFFFFu;
    bus_volts(24.0F);
    firmware_init();
}

void setUp(void)
{
    static const chopper_t cold = { 0 };
    transmitter_begins();
    owed_ms = 0;
    board_chopper = cold;
    reset_keep(FAULT_NONE);
    power_up();
}

static void period(void)
{
    ADC1BUF0 = (AD1CHS0 == 8u) ? 0x0000u : 0x8000u; /* the potentiometer in its middle; an input that is switched off */
    a_period();
}

/** Milliseconds of a healthy board: 20 control interrupts, timer 1's flag, some passes of the loop. */
static void board_ms(uint16_t ms)
{
    while (ms-- != 0u) {
        uint16_t n;
        for (n = 0; n < 20u; n++) {
            period();
        }
        IFS0bits.T1IF = 1;
        for (n = 0; n < 5u; n++) {
            firmware_background();
            transmitter_takes();
        }
    }
}

static void run_motor(void)
{
    board_ms(100);
    press_s2();
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, board_drive.state);
}

/** The outputs' latches of port A, no others. */
static void expect(uint16_t high, const char *what)
{
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(high, LATA, what);
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(SELFTEST_NONE, board_selftest_failed, what);
}

/* ---- the start ---- */

void test_from_power_up_the_relays_tell_of_a_fault_and_of_no_run_until_the_first_period(void)
{
    TEST_ASSERT_EQUAL_HEX16(0, (FAULT_RELAY | RUNNING_RELAY | CHOPPER) & TRISA);
    TEST_ASSERT_EQUAL_HEX16(0xFFFFu & ~(FAULT_RELAY | RUNNING_RELAY | CHOPPER), TRISA);
    TEST_ASSERT_EQUAL_HEX16(0xFFFF, TRISB);
    TEST_ASSERT_EQUAL_HEX16(0xFF37, TRISC);
    expect(0, "low is a fault");
    period();
    expect(FAULT_RELAY, "and high is none");
}

void test_only_the_direction_input_has_the_chip_s_pull_up(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0001, CNPU1); /* CN0 is RA4 */
    TEST_ASSERT_EQUAL_HEX16(0x0000, CNPU2);
    TEST_ASSERT_EQUAL_HEX16(0x0000, CNEN1 | CNEN2);
}

void test_a_pull_up_that_goes_is_a_fault(void)
{
    board_ms(60);
    CNPU1 = 0;
    board_ms(20);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_REGISTERS, board_selftest_failed);
    TEST_ASSERT_EQUAL_HEX16(0, LATA & (FAULT_RELAY | RUNNING_RELAY));
    power_up();
    board_ms(60);
    CNPU2 = 0x0010u;
    board_ms(20);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_REGISTERS, board_selftest_failed);
}

void test_an_output_that_becomes_an_input_is_a_fault(void)
{
    static const uint16_t bits[] = { FAULT_RELAY, RUNNING_RELAY, CHOPPER };
    for (size_t n = 0; n < sizeof bits / sizeof bits[0]; n++) {
        power_up();
        board_ms(60);
        TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
        TRISA |= bits[n];
        board_ms(20);
        TEST_ASSERT_EQUAL_UINT16(SELFTEST_REGISTERS, board_selftest_failed);
    }
}

/* ---- relays ---- */

void test_running_is_on_from_the_drivers_charge_to_the_last_current(void)
{
    board_ms(100);
    expect(FAULT_RELAY, "stopped");
    PORTAbits.RA8 = 0;
    for (uint16_t n = 0; n < 2000u && board_drive.state != (uint16_t)DRIVE_BOOTSTRAP; n++) {
        if (n % 20u == 0u) {
            IFS0bits.T1IF = 1;
            firmware_background();
        }
        period();
    }
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_BOOTSTRAP, board_drive.state);
    expect(FAULT_RELAY | RUNNING_RELAY, "the low sides are on");
    PORTAbits.RA8 = 1;
    board_ms(100);
    expect(FAULT_RELAY | RUNNING_RELAY, "ALIGN");
    press_s2();
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
    expect(FAULT_RELAY, "stopped again");
}

void test_a_fault_drops_both_relays_in_its_period_and_clearing_it_brings_its_own_back(void)
{
    run_motor();
    drive_raise(&board_drive, FAULT_STALL);
    period();
    expect(0, "a fault");
    board_ms(500);
    expect(0, "it stays");
    press_s2();
    expect(FAULT_RELAY, "cleared");
}

void test_a_fault_that_a_trap_or_the_fault_input_raises_drops_the_relays(void)
{
    run_motor();
    _MathError();
    period();
    expect(0, "a trap");
    power_up();
    run_motor();
    _FLTA1Interrupt();
    period();
    expect(0, "the fault input");
}

void test_a_fault_drops_the_relays_though_the_background_stands(void)
{
    run_motor();
    expect(FAULT_RELAY | RUNNING_RELAY, "runs");
    bus_volts(40.0F);
    for (uint16_t n = 0; n < 40u; n++) {
        period();
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, board_drive.fault);
    expect(CHOPPER, "and the brake resistor takes the bus down");
}

void test_a_watchdog_reset_tells_of_its_fault_from_the_start_on(void)
{
    run_motor();
    host_registers_reset();
    PORTA = 0xFFFFu;
    bus_volts(24.0F);
    RCON = 0x0010u;
    firmware_init();
    expect(0, "before the first period");
    board_ms(100);
    TEST_ASSERT_EQUAL_UINT16(FAULT_WATCHDOG, board_drive.fault);
    expect(0, "and after it");
    press_s2();
    expect(FAULT_RELAY, "cleared");
}

/* ---- brake resistor ---- */

void test_the_resistor_follows_the_bus_with_the_bridge_off_and_on(void)
{
    board_ms(60);
    bus_volts(26.1F);
    period();
    expect(FAULT_RELAY | CHOPPER, "stopped");
    bus_volts(25.0F);
    period();
    expect(FAULT_RELAY, "stopped, low again");
    run_motor();
    bus_volts(26.1F);
    period();
    period();
    expect(FAULT_RELAY | RUNNING_RELAY | CHOPPER, "running: two periods at the latest");
    bus_volts(25.0F);
    period();
    period();
    expect(FAULT_RELAY | RUNNING_RELAY, "running, low again");
}

void test_a_resistor_that_rests_is_a_reason_of_the_limits_and_of_the_status_line(void)
{
    board_ms(60);
    TEST_ASSERT_EQUAL_HEX16(0, LimitParm.now);
    bus_volts(28.0F);
    board_ms(1000);
    TEST_ASSERT_EQUAL_HEX16(0, LimitParm.now);
    board_ms(200);
    expect(FAULT_RELAY, "off, though the bus is high");
    TEST_ASSERT_EQUAL_HEX16(LIMIT_CHOPPER, LimitParm.now);
    sent_count = 0;
    board_ms(1000);
    TEST_ASSERT_NOT_NULL(strstr(sent, " limit CHOPPER\r\n"));
    board_ms(200);
    TEST_ASSERT_EQUAL_HEX16(0, LimitParm.now);
    expect(FAULT_RELAY | CHOPPER, "it has rested");
}

/* ---- direction ---- */

static app_told_t told_now(void)
{
    app_told_t told;
    app_asks_t asks;
    application_tell(&told, &asks, 1);
    return told;
}

void test_a_closed_contact_turns_the_target_round_after_30_ms(void)
{
    board_ms(100);
    TEST_ASSERT_EQUAL_HEX16(0, told_now().inputs);
    TEST_ASSERT_TRUE(board_drive.command.target_erpm > 0);
    PORTA &= (uint16_t)~DIRECTION;
    board_ms(28);
    TEST_ASSERT_TRUE(board_drive.command.target_erpm > 0);
    board_ms(3);
    TEST_ASSERT_EQUAL_HEX16(APP_DIRECTION, told_now().inputs);
    TEST_ASSERT_EQUAL_INT16(-1, told_now().towards);
    TEST_ASSERT_TRUE(board_drive.command.target_erpm < 0);
    press_s2();
    TEST_ASSERT_EQUAL_INT16(-1, board_drive.direction);
    TEST_ASSERT_EQUAL_INT16(-1, told_now().towards); /* and does not turn with the drive's */
    PORTA |= DIRECTION;
    board_ms(31);
    TEST_ASSERT_EQUAL_HEX16(0, told_now().inputs);
    TEST_ASSERT_TRUE(board_drive.command.target_erpm > 0);
}

void test_a_contact_that_is_closed_at_power_up_counts_at_once(void)
{
    PORTA &= (uint16_t)~DIRECTION;
    board_ms(1);
    TEST_ASSERT_TRUE(board_drive.command.target_erpm < 0);
}

void test_a_contact_settles_when_its_level_has_stood_for_30_ms(void)
{
    contact_t contact;
    contact_init(&contact);
    TEST_ASSERT_EQUAL_UINT16(0, contact_settled(&contact, 0, 1));
    for (uint16_t ms = 0; ms < 500u; ms++) { /* never long enough */
        TEST_ASSERT_EQUAL_UINT16(0, contact_settled(&contact, (uint16_t)(ms % 30u != 0u), 1));
    }
    (void)contact_settled(&contact, 0, 1);
    TEST_ASSERT_EQUAL_UINT16(0, contact_settled(&contact, 0x0100u, 29));
    TEST_ASSERT_EQUAL_UINT16(1, contact_settled(&contact, 0x0100u, 1));
    TEST_ASSERT_EQUAL_UINT16(1, contact_settled(&contact, 0, 29));
    TEST_ASSERT_EQUAL_UINT16(1, contact_settled(&contact, 1, 1));
    TEST_ASSERT_EQUAL_UINT16(1, contact_settled(&contact, 0, 29));
    TEST_ASSERT_EQUAL_UINT16(0, contact_settled(&contact, 0, 1));
}

void test_the_direction_during_a_start_lets_go_and_starts_the_other_way(void)
{
    run_motor();
    TEST_ASSERT_EQUAL_INT16(1, board_drive.direction);
    PORTA &= (uint16_t)~DIRECTION;
    board_ms(60);
    TEST_ASSERT_EQUAL_INT16(-1, board_drive.direction);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, board_drive.state);
}
