/* PWM1: switched on last and with its outputs off, and the place of its trigger. */
#include "registers.h"

/* The moment when the pairs take their pins; what all registers hold when the module is switched on is part of the contract, too. */
static uint16_t override_at_pairs, running_at_pairs;

static volatile uint16_t *watch_pairs(volatile uint16_t *pairs)
{
    override_at_pairs = P1OVDCON;
    running_at_pairs = P1TCON;
    return pairs;
}

#define P1TCON (*registers_watch(&P1TCON))
#define PWM1CON1 (*watch_pairs(&PWM1CON1))
#include "firmware/board/peripherals.c"
#undef P1TCON
#undef PWM1CON1

void setUp(void)
{
    host_registers_reset();
    P1TCON = 0xFFFF;
    P1OVDCON = 0x3F15;
    registers_accesses = 0;
    pwm_init();
}

void test_module_is_switched_on_last_with_its_outputs_off(void)
{
    TEST_ASSERT_EQUAL_UINT16(2, registers_accesses); /* off first, on at the end */
    TEST_ASSERT_EQUAL_HEX16(0x0000, register_then("P1TCON"));
    TEST_ASSERT_EQUAL_HEX16(0x0000, register_then("P1OVDCON"));
    TEST_ASSERT_EQUAL_HEX16(0x0068, register_then("P1DTCON1"));
    TEST_ASSERT_EQUAL_HEX16(0x0087, register_then("P1FLTACON"));
    TEST_ASSERT_EQUAL_HEX16(0x0077, register_then("PWM1CON1"));
    TEST_ASSERT_EQUAL_UINT16(999, register_then("P1TPER"));
    TEST_ASSERT_EQUAL_HEX16(0x0000, override_at_pairs);
    TEST_ASSERT_EQUAL_HEX16(0x0000, running_at_pairs);
}

void test_sample_lies_inside_the_low_sides_conduction_at_the_highest_duty(void)
{
    /* low side on from top/2 counts up, after dead time, to top/2 counts down; the shunt needs 1 us to settle */
    int16_t sample = (int16_t)(2 * 999 - (int16_t)(P1SECMP & 0x7FFFu));
    int16_t low_on = (int16_t)(PWM_TOP_DUTY / 2 + 80), low_off = (int16_t)(2 * 999 - PWM_TOP_DUTY / 2);
    TEST_ASSERT_GREATER_OR_EQUAL_INT16(40, sample - low_on);
    TEST_ASSERT_GREATER_OR_EQUAL_INT16(0, low_off - sample);
}
