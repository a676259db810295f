/* Timer 1: a millisecond of its own. */
#include "hurst_params.h"

#include <xc.h>

/* Every access to T1CON is seen: the timer stands still while it is set up. */
static uint16_t control_then, period_then;

static volatile uint16_t *watch_control(volatile uint16_t *control)
{
    control_then = *control;
    period_then = PR1;
    return control;
}

#define T1CON (*watch_control(&T1CON))
#include "firmware/board/timer.c"
#undef T1CON

#include "unity.h"

void setUp(void)
{
    host_registers_reset();
    TMR1 = 1234;
    T1CON = 0xFFFF;
    IFS0bits.T1IF = 1;
    timer_init();
}

void tearDown(void)
{
}

void test_period_is_one_millisecond_at_40_MIPS(void)
{
    TEST_ASSERT_EQUAL_UINT16(39999u, PR1);
    TEST_ASSERT_EQUAL_HEX16(0x8000, T1CON); /* on, internal clock, no prescaler */
    TEST_ASSERT_EQUAL_UINT16(0, TMR1);
}

void test_is_switched_on_last(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0000, control_then);
    TEST_ASSERT_EQUAL_UINT16(39999u, period_then);
}

void test_runs_without_an_interrupt(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, IEC0bits.T1IE);
}

void test_a_millisecond_is_reported_once(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, timer_ms_passed());
    IFS0bits.T1IF = 1;
    TEST_ASSERT_EQUAL_UINT16(1, timer_ms_passed());
    TEST_ASSERT_EQUAL_UINT16(0, IFS0bits.T1IF);
    TEST_ASSERT_EQUAL_UINT16(0, timer_ms_passed());
}

void test_watchdog_is_not_served_by_the_timer(void)
{
    IFS0bits.T1IF = 1;
    (void)timer_ms_passed();
    (void)timer_ms_passed();
    TEST_ASSERT_EQUAL_UINT16(0, host_watchdog_serves);
}

void test_other_flags_are_left_alone(void)
{
    IFS0 = 0xFFFF;
    (void)timer_ms_passed();
    TEST_ASSERT_EQUAL_HEX16(0xFFF7, IFS0);
}
