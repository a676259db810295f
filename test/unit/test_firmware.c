/* Start-up order, the background loop, and the supervision of the control interrupt; the peripherals are mocks. */
#include "hurst_params.h"

#include "firmware/app/panel.c"
#include "firmware/board/application.c"
#include "firmware/board/firmware.c"

#include "board/watch.h"
#include "mock_selftest_run.h"
#include "mock_peripherals.h"
#include "peripherals_on_registers.h"
#include "unity.h"

volatile uint16_t board_selftest_failed;
uint16_t board_selftest_parts;

static uint16_t same_cause(uint16_t rcon, int calls)
{
    (void)calls;
    return rcon;
}

static char *nothing_more(char *at, int calls)
{
    (void)calls;
    return at;
}

void setUp(void)
{
    peripherals_on_registers();
    host_registers_reset();
    selftest_reset_cause_Stub(same_cause); /* its own test: test_selftest_board.c */
    selftest_start_Ignore();
    selftest_pass_Ignore();
    selftest_ms_Ignore();
    selftest_put_Stub(nothing_more);
    selftest_put_marked_Stub(nothing_more);
    board_recorder.check = 0; /* what RAM may hold */
}

static void outputs_on(void)
{
    P1OVDCON = BOARD_OUTPUTS_PWM;
}

static uint16_t outputs_are_off(void)
{
    return (uint16_t)(P1OVDCON == BOARD_OUTPUTS_OFF);
}

/** What a start finds of the PLL, and whether its outputs were off by then. */
static uint16_t pll_fails, off_before_the_clock;

static uint16_t look_at_the_outputs(int calls)
{
    (void)calls;
    off_before_the_clock = outputs_are_off();
    outputs_on();
    return pll_fails;
}

/** A start, in its order. */
static void start(uint16_t no_lock)
{
    RCON = 0; /* no first line on the UART */
    pll_fails = no_lock;
    outputs_on();
    clock_init_ExpectAndReturn(no_lock);
    clock_init_AddCallback(look_at_the_outputs);
    pins_init_Expect();
    uart_init_Expect();
    timer_init_Expect();
    pwm_init_Expect();
    adc_init_Expect();
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(1, off_before_the_clock);
    TEST_ASSERT_EQUAL_UINT16(no_lock, outputs_are_off()); /* what pwm_init() does is its own test */
}

static struct {
    uint16_t state, fault, bus_is_known;
} at_adc_init;

static void look_at_the_drive(int calls)
{
    (void)calls;
    at_adc_init.state = board_drive.state;
    at_adc_init.fault = board_drive.fault;
    at_adc_init.bus_is_known = (uint16_t)(board_drive.duty_per_volt_q16 != 0u);
}

/** A start with something that happens while the clock comes up; its order does not matter. */
static void start_with(uint16_t (*clock_starts)(int calls))
{
    clock_init_Stub(clock_starts);
    pins_init_Ignore();
    uart_init_Ignore();
    timer_init_Ignore();
    pwm_init_Ignore();
    adc_init_Stub(look_at_the_drive);
    firmware_init();
}

/** One pass of the loop. @param timer_ms what timer 1 says */
static void pass(uint16_t timer_ms)
{
    IFS0bits.T1IF = (timer_ms != 0u);
    firmware_background();
}

/** One pass that switches off. */
static void tripping_pass(uint16_t timer_ms)
{
    outputs_on();
    pass(timer_ms);
    TEST_ASSERT_EQUAL_UINT16(1, outputs_are_off());
}

/** Milliseconds in which both the control interrupt and timer 1 run. */
static void healthy_ms(uint16_t ms)
{
    while (ms-- != 0u) {
        board_drive.ticks = (uint16_t)(board_drive.ticks + 20u);
        pass(1);
    }
}

static void expect_fault(drive_fault_t fault)
{
    TEST_ASSERT_EQUAL_UINT16(fault, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, board_drive.state);
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
}

/** What the control interrupt makes of S2, and a person who wants to run. */
static void clear_and_run(void)
{
    board_drive.fault = (uint16_t)FAULT_NONE;
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    board_drive.command.run = 1;
}

/* ---- start ---- */

void test_outputs_are_off_before_anything_else_and_the_control_interrupt_comes_last(void)
{
    uint16_t served = host_watchdog_serves;
    CORCON = 0xFFFF;
    INTCON1 = 0xFFFF;
    board_request.wish_run = 1;
    app_panel.fast_range = 1;
    start(0); /* the mocks enforce the order */
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(served + 1u, host_watchdog_serves); /* it starts afresh */
    TEST_ASSERT_EQUAL_HEX16(0x0024, CORCON);
    TEST_ASSERT_EQUAL_UINT16(0, INTCON1bits.NSTDIS);
    TEST_ASSERT_EQUAL_INT16(0, board_request.wish_run);
    TEST_ASSERT_EQUAL_INT16(0, app_panel.fast_range);
}

static uint16_t no_lock(int calls)
{
    (void)calls;
    return 1;
}

static uint16_t lock(int calls)
{
    (void)calls;
    return 0;
}

static uint16_t trap(int calls)
{
    (void)calls;
    drive_raise(&board_drive, FAULT_TRAP); /* as isr.c does; traps have no enable bit */
    return 0;
}

static uint16_t crystal_fails(int calls)
{
    (void)calls;
    board_clock_failed = 1; /* as isr.c does */
    return 0;
}

void test_a_fault_that_is_there_is_not_raised_again_for_the_code_that_raises_may_be_damaged(void)
{
    board_drive.fault = (uint16_t)FAULT_TRAP;
    board_drive.command.run = 1; /* what raising would write */
    firmware_trip(FAULT_SELFTEST);
    TEST_ASSERT_EQUAL_UINT16(FAULT_TRAP, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(1, board_drive.command.run);
    board_drive.fault = (uint16_t)FAULT_NONE;
    firmware_trip(FAULT_SELFTEST);
    TEST_ASSERT_EQUAL_UINT16(FAULT_SELFTEST, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(0, board_drive.command.run);
}

void test_drive_is_initialised_before_the_control_interrupt_can_come_and_keeps_a_fault_of_the_start(void)
{
    static const struct {
        uint16_t (*clock_starts)(int calls);
        drive_fault_t fault;
    } cases[] = { { no_lock, FAULT_CLOCK }, { trap, FAULT_TRAP }, { crystal_fails, FAULT_CLOCK } };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        RCON = 0;
        board_drive.state = (uint16_t)DRIVE_CLOSED;
        board_drive.fault = (uint16_t)FAULT_STALL; /* of the last run */
        start_with(cases[n].clock_starts);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, at_adc_init.state);
        TEST_ASSERT_EQUAL_UINT16(cases[n].fault, at_adc_init.fault);
        TEST_ASSERT_EQUAL_UINT16(1, at_adc_init.bus_is_known);
        expect_fault(cases[n].fault);
        TEST_ASSERT_EQUAL_UINT16(cases[n].fault == FAULT_CLOCK, board_clock_failed);
    }
}

/** A STALL, and a reset by the watchdog. */
static void reset_after_a_stall(void)
{
    start(0);
    board_drive.fault = (uint16_t)FAULT_STALL;
    healthy_ms(1);
    RCON = 0x0010u;
    start_with(lock);
}

void test_fault_that_was_kept_over_a_watchdog_reset_is_there_at_the_start(void)
{
    reset_after_a_stall();
    expect_fault(FAULT_STALL);
}

void test_the_fault_that_a_watchdog_reset_kept_is_that_of_the_record(void)
{
    reset_after_a_stall();
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, board_recorder.fault);
    TEST_ASSERT_EQUAL_UINT16(0, board_recorder.left); /* complete */
}

void test_failed_clock_cannot_be_cleared_until_a_healthy_restart(void)
{
    start(1);
    expect_fault(FAULT_CLOCK);
    clear_and_run();
    tripping_pass(0);
    expect_fault(FAULT_CLOCK);
    start(0);
    healthy_ms(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    board_clock_failed = 1; /* as the trap says */
    clear_and_run();
    tripping_pass(0);
    expect_fault(FAULT_CLOCK);
}

/* ---- background ---- */

void test_watchdog_is_served_only_while_background_and_interrupt_are_alive(void)
{
    uint16_t served;
    start(0);
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

void test_fault_input_that_is_low_is_a_fault_that_cannot_be_cleared(void)
{
    start(0);
    PORTBbits.RB8 = 0;
    tripping_pass(0);
    expect_fault(FAULT_OVERCURRENT_HW);
    PORTBbits.RB8 = 1;
    clear_and_run();
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

void test_panel_runs_once_a_millisecond_of_control_time_and_a_slow_pass_catches_up(void)
{
    static const uint16_t cases[][2] = { { 19, 0 }, { 20, 1 }, { 20, 1 }, { 90, 4 }, { 100, 5 } }; /* periods, milliseconds */
    uint32_t begin;
    for (begin = 0; begin < 65536ul; begin += 65486ul) { /* the second one over the wrap of the period counter */
        start(0);
        last_ms_tick = (uint16_t)(last_ms_tick + begin);
        for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
            board_drive.ticks = (uint16_t)(begin + cases[n][0]);
            pass(0);
            TEST_ASSERT_EQUAL_UINT16(cases[n][1], app_panel.blink_ms);
        }
    }
}

void test_lights_reach_their_pins_and_the_watch_variables_are_refreshed(void)
{
    start(0);
    board_drive.state = (uint16_t)DRIVE_ALIGN;
    board_drive.run.control.reference_erpm = 4321;
    healthy_ms(1);
    TEST_ASSERT_EQUAL_UINT16(1, LATCbits.LATC6); /* alive: lit in the first half second */
    TEST_ASSERT_EQUAL_UINT16(1, LATCbits.LATC7); /* running */
    TEST_ASSERT_EQUAL_INT16(4321, CtrlParm.qVelRef);
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    healthy_ms(500);
    TEST_ASSERT_EQUAL_UINT16(0, LATCbits.LATC6);
    TEST_ASSERT_EQUAL_UINT16(0, LATCbits.LATC7);
}

void test_status_line_goes_out_twice_a_second_a_character_a_pass(void)
{
    static const char expected[] = "state 0 fault NONE speed 0 rpm\r\n";
    uint16_t n;
    start(0);
    healthy_ms(499);
    board_drive.ticks = (uint16_t)(board_drive.ticks + 20u);
    for (n = 0; n < sizeof expected - 1u; n++) {
        pass(n == 0u);
        TEST_ASSERT_EQUAL_UINT16(expected[n], U1TXREG);
        U1TXREG = HOST_U1TXREG_EMPTY;
    }
    pass(0);
    TEST_ASSERT_EQUAL_HEX16(HOST_U1TXREG_EMPTY, U1TXREG); /* nothing left */
}

/* ---- supervision ---- */

void test_control_interrupt_that_stays_away_for_two_milliseconds_switches_off(void)
{
    start(0);
    pass(1); /* it never came */
    start(0); /* supervision begins anew */
    pass(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    tripping_pass(1);
    expect_fault(FAULT_ADC_LOST);
    start(0);
    healthy_ms(10); /* it came and then no more */
    board_drive.state = (uint16_t)DRIVE_CLOSED;
    pass(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    tripping_pass(1);
    expect_fault(FAULT_ADC_LOST);
}

void test_outputs_are_held_off_for_ever_while_the_interrupt_stays_away(void)
{
    uint32_t n;
    start(0);
    pass(1);
    for (n = 0; n < 70000u; n++) {
        tripping_pass(1);
    }
}

void test_one_silent_millisecond_is_forgiven_and_passes_without_one_do_not_count(void)
{
    uint16_t n;
    start(0);
    for (n = 0; n < 20u; n++) {
        pass(1);
        healthy_ms(1);
        pass(0);
        pass(0);
    }
    for (n = 0; n < 100u; n++) {
        pass(0);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

/* ---- what flows against what is asked for ---- */

/** Passes in closed loop, 23 periods apart, on a turning motor whose phase A is open or not. */
static void turning_passes(uint16_t passes, uint16_t a_is_open)
{
    static angle_t angle;
    while (passes-- != 0u) {
        angle = (angle_t)(angle + 5000u);
        board_drive.frame = trig_sincos(angle);
        board_drive.phases_q13 = phases_of(board_drive.run.control.ref_q13, board_drive.frame);
        board_drive.phases_q13.a = (int16_t)(a_is_open ? 0 : board_drive.phases_q13.a);
        board_drive.ticks = (uint16_t)(board_drive.ticks + 23u);
        pass(0);
    }
}

/** In closed loop with this current asked for. */
static void start_closed(int16_t iq_q13)
{
    start(0);
    board_drive.state = (uint16_t)DRIVE_CLOSED;
    board_drive.run.control.ref_q13.q = iq_q13;
}

void test_phase_that_carries_nothing_switches_off(void)
{
    start_closed(4000);
    turning_passes(200, 0);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    outputs_on();
    turning_passes(128, 1); /* two counts: the first may have begun whole */
    expect_fault(FAULT_OPEN_PHASE);
    TEST_ASSERT_EQUAL_UINT16(1, outputs_are_off());
}

void test_d_current_that_stays_off_switches_off(void)
{
    start_closed(0);
    healthy_ms(300);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    board_drive.run.control.i_q13.d = 3000;
    outputs_on();
    healthy_ms(400);
    expect_fault(FAULT_CURRENT_SENSOR);
    TEST_ASSERT_EQUAL_UINT16(1, outputs_are_off());
}
