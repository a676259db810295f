/* ADC1's registers against the device facts: four channels at once, signed fractional, started by the PWM. */
#include "registers.h"

static volatile AD1CON1BITS *const control_bits = &AD1CON1bits;

/* The access to the bits switches the converter on. */
#define AD1CON1bits (*((void)registers_watch(&AD1CON1), control_bits))
#include "firmware/board/adc.c"
#undef AD1CON1bits

void setUp(void)
{
    host_registers_reset();
    AD1CON1 = AD1CON2 = AD1CON3 = AD1CHS0 = AD1CHS123 = AD1CSSL = 0x5555; /* nothing may depend on what was there */
    adc_init();
}

void test_registers_hold_the_boards_conversion(void)
{
    static const register_value_t expected[] = {
        { "AD1CON1", 0x836C },   /* ADON, FORM 3: signed fractional, SSRC 3: started by the PWM, SIMSAM, ASAM: all channels at once */
        { "AD1CON2", 0x0200 },   /* CHPS 2: four channels, SMPI 0: an interrupt after each conversion, supply as reference */
        { "AD1CON3", 0x0002 },   /* 75 ns */
        { "AD1CHS0", 0x0008 },   /* CH0 = AN8, the potentiometer */
        { "AD1CHS123", 0x0000 }, /* CH1..3 = AN0..2, currents and bus, against ground */
        { "AD1CSSL", 0x0000 },
    };
    EXPECT_REGISTERS(expected);
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
