/* The seam of the application: what it is told, what comes of what it asks, and one that is late. The application is this test's own. */
#include "hurst_params.h"

#include "firmware/board/peripherals.c"
#include "firmware/board/application.c"
#include "firmware/board/firmware.c"
#include "firmware/board/isr.c"
#include "firmware/board/reset.c"
#include "firmware/board/selftest_run.c"
#include "firmware/board/status.c"
#include "firmware/board/watch.c"

#include "drive_rig.h"
#include "interrupts.h"
#include "unity.h"

static app_told_t seen;
static app_asks_t wanted, stood;
static uint16_t begun, stuck_ms, late_by_ticks, served;
static struct {
    uint16_t ms, state, served;
} ends, stops; /* of a stuck call: the first millisecond of the fault, and of a drive that is asked to stop */

static void period(void)
{
    ADC1BUF0 = (AD1CHS0 == 8u) ? 0x0000u : 0x8000u; /* the potentiometer in its middle; an input that is switched off */
    a_period();
}

void app_init(void)
{
    begun++;
}

/** Asks for what is wanted, and is stuck for so long: the interrupts come, the background does not. */
void app_ms(const app_told_t *told, app_asks_t *asks)
{
    uint16_t n;
    seen = *told;
    stood = *asks;
    *asks = wanted;
    board_drive.ticks = (uint16_t)(board_drive.ticks + late_by_ticks);
    application_watch();
    for (served = host_watchdog_serves; stuck_ms != 0u; stuck_ms--) {
        for (n = 0; n < 20u; n++) {
            const uint16_t state = board_drive.state;
            period();
            if (stops.ms == 0u && board_drive.command.run == 0) {
                stops.ms = (uint16_t)(ends.ms + 1u);
                stops.state = state;
            }
        }
        if (board_drive.fault == (uint16_t)FAULT_NONE) {
            ends.ms++;
            ends.state = board_drive.state;
            ends.served = host_watchdog_serves;
        }
    }
}

void setUp(void)
{
    static const app_asks_t nothing = { .target_erpm = 10000 };
    host_registers_reset();
    ADC1BUF3 = (uint16_t)(int16_t)(24.0F / 52.8F * 65536.0F - 32768.0F);
    wanted = nothing;
    stuck_ms = 0;
    late_by_ticks = 0;
    begun = 0;
    ends.ms = 0;
    stops.ms = 0;
    reset_keep(FAULT_NONE);
    firmware_init();
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
        firmware_background();
        firmware_background();
    }
}

/** A start is under way. */
static void starting(void)
{
    board_ms(60);
    wanted.run = 1;
    board_ms(30);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, board_drive.state);
}

/* ---- told ---- */

void test_the_application_begins_anew_with_each_reset_and_is_called_every_millisecond(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, begun);
    board_ms(1);
    TEST_ASSERT_EQUAL_UINT16(1, seen.elapsed_ms);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, seen.state);
    board_ms(60);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, seen.state);
}

void test_it_is_told_of_bus_buttons_ranges_and_potentiometer_in_counts_of_its_macros(void)
{
    board_ms(400);
    TEST_ASSERT_INT16_WITHIN(20, APP_VOLT(24.0), seen.bus_q15);
    TEST_ASSERT_UINT16_WITHIN(100, APP_SHARE(0.5), seen.pot_q16);
    TEST_ASSERT_EQUAL_INT16(APP_RPM(MINIMUM_SPEED_RPM), seen.slow.low);
    TEST_ASSERT_EQUAL_INT16(APP_RPM(NOMINAL_SPEED_RPM), seen.slow.high);
    TEST_ASSERT_EQUAL_INT16(APP_RPM(NOMINAL_SPEED_RPM), seen.fast.low);
    TEST_ASSERT_EQUAL_INT16(APP_RPM(MAXIMUM_SPEED_RPM), seen.fast.high);
    TEST_ASSERT_EQUAL_UINT16(0, seen.inputs);
    PORTAbits.RA8 = 0;
    board_ms(1);
    TEST_ASSERT_EQUAL_UINT16(APP_S2, seen.inputs);
    PORTAbits.RA8 = 1;
    PORTBbits.RB4 = 0;
    board_ms(1);
    TEST_ASSERT_EQUAL_UINT16(APP_S3, seen.inputs);
}

void test_units_of_the_macros(void)
{
    TEST_ASSERT_EQUAL_INT16(7500, APP_RPM(1500)); /* five pole pairs */
    TEST_ASSERT_EQUAL_INT16(-7500, APP_RPM(-1500));
    TEST_ASSERT_EQUAL_INT16(7500, APP_OF_RPM(1500));
    TEST_ASSERT_INT16_WITHIN(1, 1862, APP_AMPERE(1.0)); /* of 4.4 A full scale, 8192 counts */
    TEST_ASSERT_EQUAL_UINT16(65535, APP_SHARE(1.0));
    TEST_ASSERT_EQUAL_INT16(16384, APP_VOLT(BUS_FULL_SCALE_V / 2.0));
    TEST_ASSERT_EQUAL_INT16(32767, APP_VOLT(BUS_FULL_SCALE_V)); /* and not its negative */
    TEST_ASSERT_EQUAL_INT16(32767, APP_VOLT(2.0 * BUS_FULL_SCALE_V));
}

/* ---- asked ---- */

void test_a_run_that_is_asked_for_at_power_up_starts_when_the_drive_is_ready(void)
{
    wanted.run = 1;
    board_ms(40);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, board_drive.state);
    board_ms(20);
    TEST_ASSERT_TRUE(drive_conducts(&board_drive));
    TEST_ASSERT_EQUAL_INT16(1, stood.run);
    TEST_ASSERT_EQUAL_INT16(10000, board_drive.command.target_erpm);
    wanted.run = 0;
    board_ms(2);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
}

void test_a_target_is_brought_into_the_range_of_speeds_with_its_sign(void)
{
    static const int16_t cases[][2] = { { 0, 2500 }, { 100, 2500 }, { 27000, 27000 }, { 32767, 27500 }, { -1, -2500 }, { -9000, -9000 }, { -32768, -27500 } };
    EACH(n, cases) {
        wanted.target_erpm = cases[n][0];
        board_ms(1);
        TEST_ASSERT_EQUAL_INT16(cases[n][1], board_drive.command.target_erpm);
    }
}

void test_a_fault_ends_what_is_asked_and_neither_it_nor_its_end_is_a_start(void)
{
    starting();
    firmware_trip(FAULT_OVERCURRENT_SW);
    board_ms(50);
    TEST_ASSERT_EQUAL_INT16(0, stood.run);
    wanted.clear_fault = 1;
    board_ms(50);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state); /* run has been 1 all the time */
    wanted.run = 0;
    board_ms(1);
    wanted.run = 1;
    board_ms(2);
    TEST_ASSERT_TRUE(drive_conducts(&board_drive));
}

void test_a_fault_of_its_own_is_APPLICATION_but_for_a_lost_command_signal(void)
{
    static const uint16_t cases[][2] = { { FAULT_POTENTIOMETER, FAULT_POTENTIOMETER }, { FAULT_APPLICATION, FAULT_APPLICATION }, { FAULT_STALL, FAULT_APPLICATION }, { 999, FAULT_APPLICATION } };
    EACH(n, cases) {
        setUp();
        starting();
        wanted.fault = cases[n][0];
        board_ms(1);
        TEST_ASSERT_EQUAL_UINT16(cases[n][1], board_drive.fault);
        TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_OFF, P1OVDCON);
    }
}

void test_what_is_asked_once_is_asked_once(void)
{
    wanted.clear_fault = 1;
    wanted.take_command = 1;
    wanted.fault = (uint16_t)FAULT_APPLICATION;
    board_ms(2);
    TEST_ASSERT_EQUAL_UINT16(0, stood.clear_fault);
    TEST_ASSERT_EQUAL_UINT16(0, stood.take_command);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, stood.fault);
}

void test_outputs_are_on_their_pins(void)
{
    wanted.outputs = (uint16_t)APP_LED_ALIVE;
    board_ms(1);
    TEST_ASSERT_TRUE(BOARD_LED_ALIVE == 1u && BOARD_LED_RUN == 0u);
    wanted.outputs = (uint16_t)APP_LED_RUN;
    board_ms(1);
    TEST_ASSERT_TRUE(BOARD_LED_ALIVE == 0u && BOARD_LED_RUN == 1u);
}

/* ---- late ---- */

void test_an_application_that_returns_within_its_time_disturbs_nothing(void)
{
    starting();
    stuck_ms = APP_LATE_MS - 1;
    board_ms(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    TEST_ASSERT_EQUAL_INT16(1, board_drive.command.run);
}

void test_an_application_that_has_returned_serves_no_watchdog_and_is_not_late(void)
{
    starting();
    served = host_watchdog_serves;
    application_watch();
    board_drive.ticks = (uint16_t)(board_drive.ticks + STOP_TICKS);
    application_watch();
    TEST_ASSERT_EQUAL_UINT16(served, host_watchdog_serves);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    TEST_ASSERT_EQUAL_INT16(1, board_drive.command.run);
}

void test_a_late_application_ends_the_run_in_order_and_is_the_fault_once_the_drive_has_stopped(void)
{
    starting();
    stuck_ms = APP_LATE_MS + 10;
    board_ms(1);
    TEST_ASSERT_UINT16_WITHIN(1, APP_LATE_MS, stops.ms);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, stops.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_APPLICATION, board_drive.fault);
    TEST_ASSERT_TRUE(ends.ms + 1u >= stops.ms && (uint16_t)(ends.served - served) > 150u);
    TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_OFF, P1OVDCON);
}

void test_an_application_that_returns_late_ends_the_run_in_order_too(void)
{
    board_drive.state = (uint16_t)DRIVE_CLOSED; /* no interrupt comes: the rotor is far from a stop */
    board_drive.command.run = 1;
    board_request.wish_run = 1;
    board_request.asked_run = 1;
    wanted.run = 1;
    late_by_ticks = LATE_TICKS + 20u;
    application_tick(1);
    late_by_ticks = 0;
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
    application_tick(1); /* in time again */
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    application_tick(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_APPLICATION, board_drive.fault);
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
    board_drive.fault = (uint16_t)FAULT_NONE;
    application_tick(1); /* named once */
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

void test_the_watchdog_is_not_served_for_an_application_that_has_been_named_and_the_reset_tells_its_name(void)
{
    board_ms(60);
    stuck_ms = 100;
    board_ms(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_APPLICATION, board_drive.fault);
    TEST_ASSERT_UINT16_WITHIN(1, APP_LATE_MS, ends.ms);
    TEST_ASSERT_UINT16_WITHIN(25, ends.served, host_watchdog_serves);
    RCON = 1u << 4; /* WDTO */
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(FAULT_APPLICATION, board_drive.fault);
}

void test_a_drive_that_does_not_stop_within_three_seconds_goes_off(void)
{
    starting();
    board_drive.ticks = (uint16_t)(application_since + (uint16_t)(STOP_TICKS - 2));
    application_runs = 1;
    application_watch();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    board_drive.ticks = (uint16_t)(board_drive.ticks + 2u);
    reset_keep(FAULT_NONE);
    application_watch();
    TEST_ASSERT_EQUAL_UINT16(FAULT_APPLICATION, board_drive.fault);
    RCON = 1u << 4; /* WDTO: the background has not been there any more, and the reset tells the name all the same */
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(FAULT_APPLICATION, board_drive.fault);
}
