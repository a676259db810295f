/* The interrupts: one PWM period from converter to duties, the deadline, the fault input and the traps. */
#include "hurst_params.h"

#include <xc.h>

#include "control/current_control.h"
#include "drive/tick.h"

/* A trap may come anywhere in the tick; here in the middle of the hand-over, before it writes the next state. */
static uint16_t trap_comes_in_the_hand_over;

static void maybe_trap(void)
{
    if (trap_comes_in_the_hand_over) {
        trap_comes_in_the_hand_over = 0;
        _MathError();
    }
}

#define pi_preset(pi, gains, err, output) (maybe_trap(), pi_preset(pi, gains, err, output))
#include "firmware/drive/startup.c"
#undef pi_preset

/* The real tick, with what the hardware may do meanwhile behind it. */
static uint16_t sample_arrives_meanwhile, slow_work_waits, trap_comes_meanwhile, flag_during_tick, sample_comes_in_slow_work,
    trap_comes_after_slow_work;

static uint16_t tick_and_meanwhile(drive_t *d, const drive_params_t *p, const drive_samples_t *raw, duties_t *duty);
static uint16_t slow_and_look(drive_t *d, const drive_params_t *p, const drive_samples_t *raw);
#define drive_tick(d, p, raw, duty) tick_and_meanwhile(d, p, raw, duty)
#define drive_slow(d, p, raw) slow_and_look(d, p, raw)
#include "firmware/board/isr.c"
#undef drive_tick
#undef drive_slow
#include "firmware/drive/recorder.c"

/* What the duties were when the slow work began, and how often it did. */
static struct {
    uint16_t duty_a, duty_b, duty_c, calls;
} at_slow;

static uint16_t slow_and_look(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)
{
    uint16_t goes_on;
    at_slow.duty_a = P1DC1;
    at_slow.duty_b = P1DC2;
    at_slow.duty_c = P1DC3;
    at_slow.calls++;
    goes_on = drive_slow(d, p, raw);
    if (sample_comes_in_slow_work) {
        sample_comes_in_slow_work = 0;
        _ADC1Interrupt();
    }
    if (trap_comes_after_slow_work && goes_on) {
        trap_comes_after_slow_work = 0;
        _MathError();
    }
    return goes_on;
}

static uint16_t tick_and_meanwhile(drive_t *d, const drive_params_t *p, const drive_samples_t *raw, duties_t *duty)
{
    uint16_t switches;
    flag_during_tick = IFS0bits.AD1IF;
    if (slow_work_waits) {
        IFS0bits.T2IF = 1;
    }
    if (sample_arrives_meanwhile) {
        IFS0bits.AD1IF = 1;
    }
    switches = drive_tick(d, p, raw, duty);
    if (trap_comes_meanwhile) {
        trap_comes_meanwhile = 0;
        _MathError();
    }
    return switches;
}

#include "interrupts.h"
#include "overrun_cases.h"
#include "unity.h"

static int16_t raw_bus(float bus_v)
{
    return (int16_t)(bus_v / 52.8F * 65536.0F - 32768.0F);
}

static void control_interrupts(uint16_t periods)
{
    while (periods-- != 0u) {
        IFS0bits.AD1IF = 1;
        a_period();
    }
}

static void expect_off(drive_fault_t fault)
{
    TEST_ASSERT_EQUAL_HEX16(0x0000, P1OVDCON);
    TEST_ASSERT_EQUAL_UINT16(fault, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, board_drive.state);
}

void setUp(void)
{
    host_registers_reset();
    P1OVDCON = 0;
    ADC1BUF3 = (uint16_t)raw_bus(24.0F);
    drive_init(&board_drive, &board_params);
    sample_arrives_meanwhile = 0;
    slow_work_waits = 0;
    trap_comes_meanwhile = 0;
    trap_comes_in_the_hand_over = 0;
    sample_comes_in_slow_work = 0;
    trap_comes_after_slow_work = 0;
}

/** Running: ALIGN has begun. */
static void bring_to_align(void)
{
    setUp();
    control_interrupts(1024);
    drive_start(&board_drive, &board_params, 1);
    control_interrupts(202); /* with a first period of the law */
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, board_drive.state);
}

void test_samples_come_from_the_channels_of_the_facts(void)
{
    ADC1BUF0 = (uint16_t)-11111; /* potentiometer */
    ADC1BUF1 = (uint16_t)-4000;  /* phase a */
    ADC1BUF2 = 8000u;            /* phase b */
    ADC1BUF3 = (uint16_t)raw_bus(30.0F);
    control_interrupts(400);
    TEST_ASSERT_EQUAL_INT16(-11111, board_pot.now_q15);
    TEST_ASSERT_EQUAL_INT16(1000, board_drive.phases_q13.a);
    TEST_ASSERT_EQUAL_INT16(-2000, board_drive.phases_q13.b);
    TEST_ASSERT_INT16_WITHIN(2, BUS_Q15(30.0), qm_hi(board_drive.bus_q31));
}

void test_outputs_stay_overridden_off_until_a_start_then_bootstrap_then_pwm(void)
{
    static const uint16_t expected[][2] = { /* periods, 0: the start; override */
        { 1, 0x0000 }, { 3000, 0x0000 }, { 0, 0x0000 }, { 1, 0x0015 }, { 200, 0x0015 }, { 2, 0x3F00 }
    };
    P1OVDCON = 0x3F00;
    for (unsigned n = 0; n < sizeof expected / sizeof expected[0]; n++) {
        if (expected[n][0] == 0u) {
            drive_start(&board_drive, &board_params, 1);
        }
        control_interrupts(expected[n][0]);
        TEST_ASSERT_EQUAL_HEX16(expected[n][1], P1OVDCON);
        TEST_ASSERT_EQUAL_UINT16(0, flag_during_tick); /* cleared before the work, so that a late sample shows */
        TEST_ASSERT_EQUAL_UINT16(0, IFS0bits.AD1IF);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    }
}

void test_each_duty_reaches_its_own_pair(void)
{
    drive_t twin;
    drive_samples_t raw = { -800, 400, 0 };
    duties_t expected;
    bring_to_align();
    control_interrupts(300);
    P1DC1 = 0xFFFFu;
    P1DC2 = 0xFFFFu;
    P1DC3 = 0xFFFFu;
    raw.v_bus = (int16_t)ADC1BUF3;
    ADC1BUF1 = (uint16_t)raw.i_a;
    ADC1BUF2 = (uint16_t)raw.i_b;
    twin = board_drive;
    drive_tick(&twin, &board_params, &raw, &expected);
    control_interrupts(1);
    TEST_ASSERT_EQUAL_UINT16(expected.a, P1DC1);
    TEST_ASSERT_EQUAL_UINT16(expected.b, P1DC2);
    TEST_ASSERT_EQUAL_UINT16(expected.c, P1DC3);
    TEST_ASSERT_TRUE(P1DC1 != P1DC2 && P1DC2 != P1DC3 && P1DC1 != P1DC3);
}

void test_slow_work_waits_until_duties_are_written_and_they_fit_the_timer(void)
{
    uint16_t n;
    control_interrupts(1024);
    drive_start(&board_drive, &board_params, 1);
    for (n = 0; n < 4200u; n++) {
        uint16_t calls = at_slow.calls, switches = drive_is_running(&board_drive);
        control_interrupts(1);
        if (!switches || board_drive.ticks % 2u == 0u) {
            TEST_ASSERT_EQUAL_UINT16(calls + 1u, at_slow.calls);
            TEST_ASSERT_EQUAL_UINT16(P1DC1, at_slow.duty_a);
            TEST_ASSERT_EQUAL_UINT16(P1DC2, at_slow.duty_b);
            TEST_ASSERT_EQUAL_UINT16(P1DC3, at_slow.duty_c);
        } else {
            TEST_ASSERT_EQUAL_UINT16(calls, at_slow.calls);
        }
        TEST_ASSERT_TRUE(P1DC1 <= 2000u && P1DC2 <= 2000u && P1DC3 <= 2000u);
    }
    TEST_ASSERT_EQUAL_HEX16(0x3F00, P1OVDCON);
    TEST_ASSERT_TRUE(P1DC1 != 0);
}

void test_bridge_begins_to_switch_only_with_duties_of_the_law(void)
{
    bring_to_align();
    board_drive.state = (uint16_t)DRIVE_CATCH; /* a rotor that turns has been seen; its current is gone */
    board_drive.run.catching.phase = (uint16_t)CATCH_SEEN;
    board_drive.run.estimator.omega_erpm = 10000;
    board_drive.periods = 1000;
    control_interrupts(1);
    while (board_drive.state == (uint16_t)DRIVE_CATCH) {
        TEST_ASSERT_EQUAL_HEX16(0x0000, P1OVDCON);
        control_interrupts(1);
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, board_drive.state);
    TEST_ASSERT_EQUAL_HEX16(0x0000, P1OVDCON); /* the duties are still those of the low sides */
    TEST_ASSERT_EQUAL_UINT16(0, P1DC1);
    for (uint16_t n = 0; n < 2u && P1OVDCON == 0u; n++) { /* with the slow work, which is due in the second one at the latest */
        control_interrupts(1);
        TEST_ASSERT_TRUE(P1DC1 != 0u && P1DC1 != P1DC2);
    }
    TEST_ASSERT_EQUAL_HEX16(0x3F00, P1OVDCON);
}

void test_slow_work_is_raised_every_second_period_while_the_bridge_switches_and_else_by_each(void)
{
    for (uint16_t n = 0; n < 20u; n++) {
        _ADC1Interrupt();
        TEST_ASSERT_EQUAL_UINT16(1, IFS0bits.T2IF);
        _T2Interrupt();
        TEST_ASSERT_EQUAL_UINT16(0, IFS0bits.T2IF);
    }
    bring_to_align();
    recorder_restart(&board_recorder, 1, FAULT_NONE);
    for (uint16_t n = 0; n < 20u; n++) {
        int16_t next = board_recorder.next;
        _ADC1Interrupt();
        TEST_ASSERT_EQUAL_UINT16(board_drive.ticks % 2u == 0u, IFS0bits.T2IF);
        if (IFS0bits.T2IF) {
            _T2Interrupt();
        }
        TEST_ASSERT_EQUAL_UINT16(board_drive.ticks % 2u == 0u, next != board_recorder.next); /* a row with each */
        TEST_ASSERT_EQUAL_UINT16(0, IFS0bits.T2IF);
    }
}

void test_late_control_interrupt_raises_the_slow_work_at_once(void)
{
    for (uint16_t odd = 0; odd < 2u; odd++) {
        bring_to_align();
        while (board_drive.ticks % 2u == odd) {
            control_interrupts(1);
        }
        P1TMR = 0x0001; /* counts up: the duties come too late */
        _ADC1Interrupt();
        TEST_ASSERT_EQUAL_UINT16(odd, board_drive.ticks % 2u);
        TEST_ASSERT_EQUAL_HEX16(0x0000, P1OVDCON);
        TEST_ASSERT_EQUAL_UINT16(1, IFS0bits.T2IF);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault); /* told by the slow work, which has the time */
        P1TMR = 0x81F4;
        _T2Interrupt();
        expect_off(FAULT_ISR_OVERRUN);
        control_interrupts(10);
        expect_off(FAULT_ISR_OVERRUN);
    }
}

void test_fault_of_the_slow_work_switches_off_in_its_own_interrupt(void)
{
    uint16_t periods = 0;
    bring_to_align();
    ADC1BUF3 = (uint16_t)raw_bus(36.0F);
    while (board_drive.fault == (uint16_t)FAULT_NONE && periods < 9u) {
        TEST_ASSERT_EQUAL_HEX16(0x3F00, P1OVDCON);
        control_interrupts(1);
        periods++;
    }
    expect_off(FAULT_OVERVOLTAGE);
}

void test_overrun_and_overcurrent_are_off_within_the_period_and_stay(void)
{
    for (unsigned n = 0; n < OVERRUN_CASES; n++) {
        drive_fault_t fault;
        bring_to_align();
        fault = overrun_case(n, &sample_arrives_meanwhile, &slow_work_waits);
        if (fault != FAULT_NONE) {
            expect_off(fault);
        }
    }
}

void test_outputs_are_off_before_the_slow_work_tells_of_too_much_current(void)
{
    for (uint16_t odd = 0; odd < 2u; odd++) {
        bring_to_align();
        control_interrupts((uint16_t)(2u + odd));
        TEST_ASSERT_EQUAL_HEX16(0x3F00, P1OVDCON);
        ADC1BUF1 = (uint16_t)(-4 * 7076);
        _ADC1Interrupt();
        TEST_ASSERT_EQUAL_HEX16(0x0000, P1OVDCON);
        TEST_ASSERT_EQUAL_UINT16(1, IFS0bits.T2IF);
        TEST_ASSERT_EQUAL_UINT16(0, P1DC1);
    }
}

void test_slow_work_that_outlasts_its_period_comes_again_at_once_and_says_so(void)
{
    bring_to_align();
    while (board_drive.ticks % 2u == 0u) {
        control_interrupts(1);
    }
    sample_comes_in_slow_work = 1;
    _ADC1Interrupt();
    TEST_ASSERT_EQUAL_UINT16(1, IFS0bits.T2IF);
    _T2Interrupt();
    TEST_ASSERT_EQUAL_UINT16(1, IFS0bits.T2IF); /* raised meanwhile; its own end must not take that back */
    _T2Interrupt();
    expect_off(FAULT_ISR_OVERRUN);
    TEST_ASSERT_EQUAL_UINT16(0, IFS0bits.T2IF);
    control_interrupts(10);
    expect_off(FAULT_ISR_OVERRUN);
}

void test_fault_input_switches_off_and_keeps_its_code_through_later_faults(void)
{
    bring_to_align();
    IFS3bits.FLTA1IF = 1;
    _FLTA1Interrupt();
    expect_off(FAULT_OVERCURRENT_HW);
    TEST_ASSERT_EQUAL_UINT16(0, IFS3bits.FLTA1IF);
    _MathError();
    P1TMR = 0;
    control_interrupts(100);
    expect_off(FAULT_OVERCURRENT_HW);
}

void test_each_trap_clears_its_flag_and_is_kept_over_the_reset_that_follows(void)
{
    static const struct {
        void (*trap)(void);
        drive_fault_t fault;
        uint16_t flags_left;
    } cases[] = {
        { _OscillatorFail, FAULT_CLOCK, 0x001C },
        { _AddressError, FAULT_TRAP, 0x0002 }, /* the clock's is not theirs */
        { _StackError, FAULT_TRAP, 0x0002 },
        { _MathError, FAULT_TRAP, 0x0002 },
        { _DefaultInterrupt, FAULT_TRAP, 0x0002 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        bring_to_align();
        board_clock_failed = 0;
        reset_keep(FAULT_NONE);
        INTCON1 = 0x001E; /* all four causes */
        cases[n].trap();
        RCON = 0x0010u; /* the background does not come back: the watchdog's reset follows */
        TEST_ASSERT_EQUAL_UINT16(cases[n].fault, reset_take());
        expect_off(cases[n].fault);
        TEST_ASSERT_EQUAL_HEX16(cases[n].flags_left, INTCON1);
        TEST_ASSERT_EQUAL_HEX16(0x001E, board_trap_intcon1); /* the cause stays readable */
        TEST_ASSERT_EQUAL_UINT16(cases[n].fault == FAULT_CLOCK, board_clock_failed); /* no S2 makes the clock right again */
        control_interrupts(10);
        expect_off(cases[n].fault);
        _FLTA1Interrupt();
        TEST_ASSERT_EQUAL_UINT16(0, host_watchdog_serves); /* by no interrupt and no trap */
    }
}

void test_trap_inside_the_control_interrupt_is_off_within_one_period(void)
{
    bring_to_align();
    trap_comes_meanwhile = 1;
    control_interrupts(2); /* the one that was interrupted, and the next */
    expect_off(FAULT_TRAP);
    control_interrupts(100);
    expect_off(FAULT_TRAP);
}

void test_trap_between_the_slow_work_and_its_outputs_ends_with_them_off(void)
{
    bring_to_align();
    trap_comes_after_slow_work = 1;
    _T2Interrupt();
    TEST_ASSERT_EQUAL_UINT16(0, trap_comes_after_slow_work);
    expect_off(FAULT_TRAP);
}

void test_trap_in_the_middle_of_the_hand_over_is_not_overwritten(void)
{
    uint16_t n;
    bring_to_align();
    board_drive.state = (uint16_t)DRIVE_RAMP;
    board_drive.periods = 0;
    board_drive.forced.speed_q10 = board_params.forced.end_speed_q10;
    trap_comes_in_the_hand_over = 1;
    for (n = 0; n < 16u && trap_comes_in_the_hand_over; n++) {
        board_drive.run.estimator.omega_filtered_q16 = 5000L * 65536;
        board_drive.run.handover.agreed_steps = board_params.agree_steps;
        board_drive.run.control.ref_q13.q = 0; /* the current has fallen */
        control_interrupts(1);
    }
    TEST_ASSERT_EQUAL_UINT16(0, trap_comes_in_the_hand_over);
    control_interrupts(1);
    expect_off(FAULT_TRAP);
}
