/* ADC1: switched on when all is set, and its interrupt. */
#include "registers.h"

static volatile AD1CON1BITS *const control_bits = &AD1CON1bits;

/* The access to the bits switches the converter on. */
#define AD1CON1bits (*((void)registers_watch(&AD1CON1), control_bits))
#include "firmware/board/adc.c"
#undef AD1CON1bits

void setUp(void)
{
    host_registers_reset();
    adc_init();
}

void test_converter_is_switched_on_last(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0200, register_then("AD1CON2"));
    TEST_ASSERT_EQUAL_HEX16(0x0002, register_then("AD1CON3"));
    TEST_ASSERT_EQUAL_HEX16(0x0008, register_then("AD1CHS0"));
    TEST_ASSERT_EQUAL_HEX16(1u << 13, register_then("IEC0")); /* AD1IE */
}

void test_control_interrupt_is_enabled_at_priority_5_with_its_flag_clear(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, IEC0bits.AD1IE);
    TEST_ASSERT_EQUAL_UINT16(5, IPC3bits.AD1IP);
    IFS0bits.AD1IF = 1;
    adc_init();
    TEST_ASSERT_EQUAL_UINT16(0, IFS0bits.AD1IF);
}
