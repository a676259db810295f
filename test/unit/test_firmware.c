/* Start-up order, the background loop, and the supervision of the control interrupt; the peripherals are mocks. */
#include "hurst_params.h"

#include "firmware/board/firmware.c"

#include "board/watch.h"
#include "mock_peripherals.h"
#include "unity.h"

void setUp(void)
{
    host_registers_reset();
}

void tearDown(void)
{
}

static void expect_start(uint16_t no_lock)
{
    RCON = 0; /* no first line on the UART */
    pwm_outputs_off_Expect();
    clock_init_ExpectAndReturn(no_lock);
    pins_init_Expect();
    uart_init_Expect();
    timer_init_Expect();
    pwm_init_Expect();
    if (no_lock) {
        pwm_outputs_off_Expect();
    }
    adc_init_Expect();
    firmware_init();
}

/** One pass of the loop. @param timer_ms what timer 1 says */
static void pass(uint16_t timer_ms)
{
    timer_ms_passed_ExpectAndReturn(timer_ms);
    firmware_background();
}

/** One pass that finds a fault. */
static void tripping_pass(void)
{
    timer_ms_passed_ExpectAndReturn(0);
    pwm_outputs_off_Expect();
    firmware_background();
}

/** Milliseconds in which both the control interrupt and timer 1 run. */
static void healthy_ms(uint16_t ms)
{
    while (ms-- != 0u) {
        board_drive.ticks = (uint16_t)(board_drive.ticks + 20u);
        pass(1);
    }
}

/* ---- start ---- */

void test_outputs_are_off_before_anything_else_and_the_control_interrupt_comes_last(void)
{
    expect_start(0); /* the mocks enforce the order */
}

static uint16_t state_at_adc_init, fault_at_adc_init, bus_known_at_adc_init;

static void look_at_the_drive(int calls)
{
    (void)calls;
    state_at_adc_init = board_drive.state;
    fault_at_adc_init = board_drive.fault;
    bus_known_at_adc_init = (uint16_t)(board_drive.duty_per_volt_q16 != 0u);
}

void test_drive_is_initialised_before_the_control_interrupt_can_come(void)
{
    board_drive.state = (uint16_t)DRIVE_CLOSED;
    board_drive.fault = (uint16_t)FAULT_TRAP;
    pwm_outputs_off_Ignore();
    clock_init_IgnoreAndReturn(1);
    pins_init_Ignore();
    uart_init_Ignore();
    timer_init_Ignore();
    pwm_init_Ignore();
    adc_init_Stub(look_at_the_drive);
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, state_at_adc_init);
    TEST_ASSERT_EQUAL_UINT16(FAULT_CLOCK, fault_at_adc_init);
    TEST_ASSERT_EQUAL_UINT16(1, bus_known_at_adc_init);
}

static void start_with_clock(uint16_t (*clock_starts)(int calls))
{
    pwm_outputs_off_Ignore();
    clock_init_Stub(clock_starts);
    pins_init_Ignore();
    uart_init_Ignore();
    timer_init_Ignore();
    pwm_init_Ignore();
    adc_init_Ignore();
    firmware_init();
}

static uint16_t trap_while_the_clock_starts(int calls)
{
    (void)calls;
    drive_raise(&board_drive, FAULT_TRAP); /* as isr.c does; traps have no enable bit */
    return 0;
}

void test_trap_during_the_start_is_not_forgotten(void)
{
    start_with_clock(trap_while_the_clock_starts);
    TEST_ASSERT_EQUAL_UINT16(FAULT_TRAP, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, board_drive.state);
}

static uint16_t crystal_fails_while_the_clock_starts(int calls)
{
    (void)calls;
    board_clock_failed = 1; /* as isr.c does */
    return 0;
}

void test_crystal_that_fails_during_the_start_is_a_clock_fault_for_good(void)
{
    start_with_clock(crystal_fails_while_the_clock_starts);
    TEST_ASSERT_EQUAL_UINT16(FAULT_CLOCK, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(1, board_clock_failed);
}

void test_healthy_clock_starts_in_CALIBRATE(void)
{
    expect_start(0);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

void test_failed_clock_is_a_fault_with_outputs_off(void)
{
    expect_start(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_CLOCK, board_drive.fault);
}

void test_failed_clock_cannot_be_cleared(void)
{
    expect_start(1);
    board_drive.fault = (uint16_t)FAULT_NONE; /* what the control interrupt makes of S2 */
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    board_drive.command.run = 1;
    tripping_pass();
    TEST_ASSERT_EQUAL_UINT16(FAULT_CLOCK, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, board_drive.state);
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
}

void test_fault_that_was_kept_over_a_watchdog_reset_is_there_at_the_start(void)
{
    expect_start(0);
    board_drive.fault = (uint16_t)FAULT_STALL;
    healthy_ms(1);
    pwm_outputs_off_Ignore();
    clock_init_IgnoreAndReturn(0);
    pins_init_Ignore();
    uart_init_Ignore();
    timer_init_Ignore();
    pwm_init_Ignore();
    adc_init_Ignore();
    RCON = 0x0010u;
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, board_drive.fault);
}

void test_watchdog_starts_afresh_when_the_start_is_done(void)
{
    uint16_t before = host_watchdog_serves;
    expect_start(0);
    TEST_ASSERT_EQUAL_UINT16(before + 1u, host_watchdog_serves);
}

void test_watchdog_is_served_only_while_background_and_interrupt_are_alive(void)
{
    uint16_t served;
    expect_start(0);
    served = host_watchdog_serves;
    healthy_ms(3);
    TEST_ASSERT_EQUAL_UINT16(served + 3u, host_watchdog_serves);
    board_drive.ticks = (uint16_t)(board_drive.ticks + 20u); /* the interrupt alone */
    TEST_ASSERT_EQUAL_UINT16(served + 3u, host_watchdog_serves);
    pass(0);
    pass(0); /* the background alone */
    pass(0);
    TEST_ASSERT_EQUAL_UINT16(served + 4u, host_watchdog_serves);
}

void test_clock_that_fails_later_cannot_be_cleared_either(void)
{
    expect_start(0);
    healthy_ms(1);
    board_clock_failed = 1; /* as the trap says */
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    board_drive.command.run = 1;
    tripping_pass();
    TEST_ASSERT_EQUAL_UINT16(FAULT_CLOCK, board_drive.fault);
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
}

void test_healthy_restart_forgets_a_failed_clock(void)
{
    expect_start(1);
    expect_start(0);
    pass(0);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

void test_arithmetic_mode_and_nesting_are_set_explicitly(void)
{
    CORCON = 0xFFFF;
    INTCON1 = 0xFFFF;
    expect_start(0);
    TEST_ASSERT_EQUAL_HEX16(0x0024, CORCON);
    TEST_ASSERT_EQUAL_UINT16(0, INTCON1bits.NSTDIS);
}

void test_start_forgets_what_the_panel_wanted(void)
{
    board_panel.wish_run = 1;
    board_panel.fast_range = 1;
    expect_start(0);
    TEST_ASSERT_EQUAL_INT16(0, board_panel.wish_run);
    TEST_ASSERT_EQUAL_INT16(0, board_panel.fast_range);
}

/* ---- background ---- */

void test_fault_input_that_is_low_is_a_fault_that_cannot_be_cleared(void)
{
    expect_start(0);
    PORTBbits.RB8 = 0;
    tripping_pass();
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_HW, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, board_drive.state);
    PORTBbits.RB8 = 1;
    board_drive.fault = (uint16_t)FAULT_NONE;
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    pass(0);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

void test_milliseconds_are_the_nearest_number_of_periods(void)
{
    TEST_ASSERT_EQUAL_UINT16(20, PERIODS_PER_MS);
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.0000666667 /* 15 kHz */
    TEST_ASSERT_EQUAL_UINT16(15, PERIODS_PER_MS);
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.0000555556 /* 18 kHz */
    TEST_ASSERT_EQUAL_UINT16(18, PERIODS_PER_MS);
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.00005
}

void test_panel_runs_once_a_millisecond_of_control_time(void)
{
    expect_start(0);
    board_drive.ticks = 19;
    pass(0);
    TEST_ASSERT_EQUAL_UINT16(0, board_panel.blink_ms);
    board_drive.ticks = 20;
    pass(0);
    TEST_ASSERT_EQUAL_UINT16(1, board_panel.blink_ms);
    pass(0);
    TEST_ASSERT_EQUAL_UINT16(1, board_panel.blink_ms);
}

void test_a_slow_pass_catches_up_without_losing_periods(void)
{
    expect_start(0);
    board_drive.ticks = 70;
    pass(0);
    TEST_ASSERT_EQUAL_UINT16(3, board_panel.blink_ms);
    board_drive.ticks = 80;
    pass(0);
    TEST_ASSERT_EQUAL_UINT16(4, board_panel.blink_ms);
}

void test_time_goes_on_over_the_wrap_of_the_period_counter(void)
{
    uint16_t n;
    expect_start(0);
    for (n = 0; n < 400u; n++) {
        uint16_t before = board_panel.blink_ms;
        board_drive.ticks = (uint16_t)(65536ul - 4000ul + 20ul * n); /* over the wrap at n = 200 */
        if (n == 0u) {
            last_ms_tick = board_drive.ticks;
        }
        pass(0);
        TEST_ASSERT_EQUAL_UINT16(n == 0u ? 0 : 1, board_panel.blink_ms - before);
    }
}

void test_S2_held_for_30_ms_starts_and_bounces_do_not(void)
{
    uint16_t ms;
    expect_start(0);
    uart_send_IgnoreAndReturn(0);
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    for (ms = 0; ms < 100u; ms++) {
        PORTAbits.RA8 = (ms % 20u) == 0u; /* bounces */
        healthy_ms(1);
    }
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
    PORTAbits.RA8 = 1;
    healthy_ms(1);
    PORTAbits.RA8 = 0;
    healthy_ms(29);
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
    healthy_ms(1);
    TEST_ASSERT_EQUAL_INT16(1, board_drive.command.run);
    healthy_ms(1000); /* a long press acts once */
    TEST_ASSERT_EQUAL_INT16(1, board_drive.command.run);
}

void test_S3_changes_the_range_of_a_running_motor(void)
{
    expect_start(0);
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    PORTAbits.RA8 = 0;
    healthy_ms(30);
    PORTAbits.RA8 = 1;
    PORTBbits.RB4 = 0;
    healthy_ms(30);
    TEST_ASSERT_EQUAL_INT16(1, board_panel.fast_range);
}

void test_lights_reach_their_pins(void)
{
    expect_start(0);
    uart_send_IgnoreAndReturn(0);
    board_drive.state = (uint16_t)DRIVE_ALIGN;
    healthy_ms(1);
    TEST_ASSERT_EQUAL_UINT16(1, LATCbits.LATC6); /* alive: lit in the first half second */
    TEST_ASSERT_EQUAL_UINT16(1, LATCbits.LATC7); /* running */
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    healthy_ms(500);
    TEST_ASSERT_EQUAL_UINT16(0, LATCbits.LATC6);
    TEST_ASSERT_EQUAL_UINT16(0, LATCbits.LATC7);
}

void test_watch_variables_are_refreshed_in_the_background(void)
{
    expect_start(0);
    board_drive.run.control.reference_erpm = 4321;
    healthy_ms(1);
    TEST_ASSERT_EQUAL_INT16(4321, CtrlParm.qVelRef);
}

void test_status_line_goes_out_twice_a_second_a_character_a_pass(void)
{
    static const char expected[] = "state 0 fault 0 speed 0 rpm\r\n";
    uint16_t n;
    expect_start(0);
    healthy_ms(499);
    board_drive.ticks = (uint16_t)(board_drive.ticks + 20u);
    timer_ms_passed_ExpectAndReturn(1);
    uart_send_ExpectAndReturn('s', 1);
    firmware_background();
    for (n = 1; n < sizeof expected - 1u; n++) {
        timer_ms_passed_ExpectAndReturn(0);
        uart_send_ExpectAndReturn(expected[n], 1);
        firmware_background();
    }
    pass(0); /* nothing left */
}

/* ---- supervision ---- */

static uint32_t times_off;

static void count_off(int calls)
{
    (void)calls;
    times_off++;
}

void test_missing_control_interrupt_switches_off_after_two_milliseconds(void)
{
    expect_start(0);
    healthy_ms(10);
    board_drive.state = (uint16_t)DRIVE_CLOSED;
    pass(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    timer_ms_passed_ExpectAndReturn(1);
    pwm_outputs_off_Expect();
    firmware_background();
    TEST_ASSERT_EQUAL_UINT16(FAULT_ADC_LOST, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, board_drive.state);
}

void test_control_interrupt_that_never_comes_is_found_too(void)
{
    expect_start(0);
    pass(1);
    timer_ms_passed_ExpectAndReturn(1);
    pwm_outputs_off_Expect();
    firmware_background();
    TEST_ASSERT_EQUAL_UINT16(FAULT_ADC_LOST, board_drive.fault);
}

void test_outputs_are_held_off_while_the_interrupt_stays_away(void)
{
    uint16_t n;
    expect_start(0);
    pass(1);
    for (n = 0; n < 5u; n++) {
        timer_ms_passed_ExpectAndReturn(1);
        pwm_outputs_off_Expect();
        firmware_background();
    }
}

void test_outputs_are_held_off_for_ever_while_the_interrupt_stays_away(void)
{
    uint32_t n;
    expect_start(0);
    pass(1);
    pwm_outputs_off_Stub(count_off);
    times_off = 0;
    timer_ms_passed_IgnoreAndReturn(1);
    for (n = 0; n < 70000u; n++) {
        firmware_background();
    }
    TEST_ASSERT_EQUAL_UINT32(70000u, times_off);
}

void test_one_silent_millisecond_is_forgiven(void)
{
    uint16_t n;
    expect_start(0);
    for (n = 0; n < 20u; n++) {
        pass(1);
        healthy_ms(1);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

void test_without_timer_milliseconds_nothing_is_supervised(void)
{
    uint16_t n;
    expect_start(0);
    for (n = 0; n < 100u; n++) {
        pass(0);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

void test_supervision_starts_anew_after_a_reset(void)
{
    expect_start(0);
    pass(1);
    expect_start(0);
    pass(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}
