/* ADC1: switched on when all is set. */
#include "registers.h"

static volatile AD1CON1BITS *const control_bits = &AD1CON1bits;

/* The access to the bits switches the converter on. */
#define AD1CON1bits (*((void)registers_watch(&AD1CON1), control_bits))
#include "firmware/board/peripherals.c"
#undef AD1CON1bits

void setUp(void)
{
    host_registers_reset();
    adc_init();
}

void test_converter_is_switched_on_last(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0200, register_then("AD1CON2"));
    TEST_ASSERT_EQUAL_HEX16(0x0003, register_then("AD1CON3"));
    TEST_ASSERT_EQUAL_HEX16(0x0008, register_then("AD1CHS0"));
    TEST_ASSERT_EQUAL_HEX16(1u << 13, register_then("IEC0") & (1u << 13)); /* AD1IE */
}
