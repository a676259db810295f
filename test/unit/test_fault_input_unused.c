/* FAULT_INPUT_USED 0: the fault input's pin stays free, and nothing follows it. */
#include "registers.h"

#undef FAULT_INPUT_USED
#define FAULT_INPUT_USED 0

#include "firmware/board/peripherals.c"

void setUp(void)
{
    host_registers_reset();
    pins_init();
    pwm_init();
}

void test_no_pair_no_interrupt_and_no_pin_belong_to_it(void)
{
    TEST_ASSERT_EQUAL_HEX16(0, P1FLTACON & 0x3F07u);
    TEST_ASSERT_EQUAL_HEX16(0, IEC3 & 0x8000u);
    TEST_ASSERT_EQUAL_HEX16(0x1F, RPINR12 & 0x1Fu);
}

void test_a_low_pin_is_no_fault(void)
{
    PORTBbits.RB8 = 0;
    TEST_ASSERT_EQUAL_INT(0, BOARD_FLTA_LOW());
}

void test_the_pairs_are_switched_on_as_ever(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0077, PWM1CON1);
    TEST_ASSERT_EQUAL_HEX16(0x8002, P1TCON);
}
