/* Timer 1: a millisecond of its own. */
#include "registers.h"

#define T1CON (*registers_watch(&T1CON)) /* the timer stands still while it is set up */
#include "firmware/board/peripherals.c"
#undef T1CON

void setUp(void)
{
    host_registers_reset();
    T1CON = 0xFFFF;
    timer_init();
}

void test_is_switched_on_last(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0000, register_then("T1CON"));
    TEST_ASSERT_EQUAL_UINT16(39999u, register_then("PR1"));
}

void test_a_millisecond_is_reported_once_and_nothing_else_is_touched(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, timer_ms_passed());
    IFS0 = 0xFFFF;
    TEST_ASSERT_EQUAL_UINT16(1, timer_ms_passed());
    TEST_ASSERT_EQUAL_HEX16(0xFFF7, IFS0);
    TEST_ASSERT_EQUAL_UINT16(0, timer_ms_passed());
    TEST_ASSERT_EQUAL_UINT16(0, host_watchdog_serves);
}
