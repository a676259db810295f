/* The clock: 8 MHz crystal through the PLL to 40 MIPS, and waits that end when the hardware does not answer. */
#include "registers.h"

/* A stubborn oscillator: what the firmware writes is recorded, the switch happens only if the test says so. */
static uint16_t oscillator_answers, written_high, written_low, writes, pll_at_first_switch;

static void oscillator_high(uint16_t value)
{
    written_high = value;
    writes = (uint16_t)(writes * 10u + 1u);
    if (oscillator_answers) {
        host_write_oscconh(value);
    }
}

static void oscillator_low(uint16_t value)
{
    written_low = value;
    if (writes == 1u) {
        pll_at_first_switch = PLLFBD;
    }
    writes = (uint16_t)(writes * 10u + 2u);
    if (oscillator_answers) {
        host_write_oscconl(value);
    }
}

#undef __builtin_write_OSCCONH
#undef __builtin_write_OSCCONL
#define __builtin_write_OSCCONH(value) oscillator_high((uint16_t)(value))
#define __builtin_write_OSCCONL(value) oscillator_low((uint16_t)(value))
#include "firmware/board/peripherals.c"

void setUp(void)
{
    host_registers_reset();
    OSCCON = 0x0000; /* running on the internal FRC, as after reset */
    oscillator_answers = 1;
    writes = 0;
    written_high = 0xFFFF;
}

void test_switches_to_the_crystal_with_pll_and_reports_success(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, clock_init());
    TEST_ASSERT_EQUAL_UINT16(3, OSCCONbits.COSC);
    TEST_ASSERT_EQUAL_UINT16(1, OSCCONbits.LOCK);
    TEST_ASSERT_EQUAL_UINT16(12, writes); /* source first, then the switch */
    TEST_ASSERT_EQUAL_UINT16(3, written_high);
    TEST_ASSERT_EQUAL_UINT16(1, written_low & 1u);
}

void test_after_a_reset_that_kept_the_pll_running_the_frc_takes_over_before_the_pll_is_changed(void)
{
    OSCCON = 0x3320; /* crystal with PLL, locked: watchdog or RESET instruction */
    PLLFBD = 0x0030;
    TEST_ASSERT_EQUAL_UINT16(0, clock_init());
    TEST_ASSERT_EQUAL_UINT16(1212, writes);
    TEST_ASSERT_EQUAL_HEX16(0x0030, pll_at_first_switch);
    TEST_ASSERT_EQUAL_UINT16(38, PLLFBD);
    TEST_ASSERT_EQUAL_UINT16(3, OSCCONbits.COSC);
}

void test_a_running_pll_that_cannot_be_left_is_not_changed(void)
{
    oscillator_answers = 0;
    OSCCON = 0x3320;
    PLLFBD = 0x0030;
    TEST_ASSERT_EQUAL_UINT16(1, clock_init());
    TEST_ASSERT_EQUAL_HEX16(0x0030, PLLFBD);
    TEST_ASSERT_EQUAL_UINT16(0, written_high);
}

void test_an_oscillator_that_never_gets_there_ends_the_wait_and_is_reported(void)
{
    static const struct {
        const char *what;
        uint16_t osccon;
    } cases[] = { { "never switches", 0x0000 }, { "switched, never locks", 0x3300 }, { "locked PLL of the FRC", 0x1120 } };
    oscillator_answers = 0;
    for (unsigned n = 0; n < 3u; n++) {
        OSCCON = cases[n].osccon;
        host_watchdog_serves = 0;
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(1, clock_init(), cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(BOARD_WAIT_LOOPS, host_watchdog_serves, cases[n].what);
    }
}

void test_the_wait_is_long_enough_for_crystal_and_lock(void)
{
    /* a loop takes at least 3 clocks; 2 ms are needed, at 40 MIPS at worst */
    TEST_ASSERT_GREATER_OR_EQUAL_UINT32(2ul * 40000ul, 3ul * BOARD_WAIT_LOOPS);
}

void test_a_source_that_shares_bits_with_the_one_asked_for_is_another(void)
{
    static const uint16_t sources[] = { 0x7020, 0x2020, 0x1020, 0x3000 };
    uint16_t n;
    oscillator_answers = 0;
    for (n = 0; n < 4u; n++) {
        OSCCON = sources[n];
        TEST_ASSERT_EQUAL_UINT16(1, clock_switch(3, 0x0020));
    }
    OSCCON = 0x3020;
    TEST_ASSERT_EQUAL_UINT16(0, clock_switch(3, 0x0020));
}
