/* ADC1's registers against the device facts: four channels at once, signed fractional, started by the PWM. */
#include "hurst_params.h"

#include <xc.h>

/* Every access to AD1CON1 is seen: the last one switches the converter on. */
static uint16_t enabled_then, channels_then, clock_then, input_then;

static volatile uint16_t *watch_control(volatile uint16_t *control)
{
    enabled_then = IEC0bits.AD1IE;
    channels_then = AD1CON2;
    clock_then = AD1CON3;
    input_then = AD1CHS0;
    return control;
}

#define AD1CON1 (*watch_control(&AD1CON1))
#include "firmware/board/adc.c"
#undef AD1CON1

#include "unity.h"

void setUp(void)
{
    uint16_t n;
    host_registers_reset();
    for (n = 0; n < host_sfr_count; n++) { /* nothing may depend on what was there */
        if (host_sfr_table[n].pointer == &AD1CON1 || host_sfr_table[n].pointer == &AD1CON2 || host_sfr_table[n].pointer == &AD1CON3
            || host_sfr_table[n].pointer == &AD1CHS0 || host_sfr_table[n].pointer == &AD1CHS123 || host_sfr_table[n].pointer == &AD1CSSL) {
            *host_sfr_table[n].pointer = 0x5555;
        }
    }
    adc_init();
}

void tearDown(void)
{
}

void test_signed_fractional_started_by_the_pwm_all_channels_at_once(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x836C, AD1CON1); /* ADON, FORM 3, SSRC 3, SIMSAM, ASAM */
}

void test_four_channels_and_an_interrupt_after_each_conversion(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0200, AD1CON2); /* CHPS 2, SMPI 0, supply as reference */
}

void test_conversion_clock_is_75_ns(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0002, AD1CON3);
}

void test_channels_are_pot_currents_and_bus(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0008, AD1CHS0);   /* CH0 = AN8 */
    TEST_ASSERT_EQUAL_HEX16(0x0000, AD1CHS123); /* CH1..3 = AN0..2 against ground */
    TEST_ASSERT_EQUAL_HEX16(0x0000, AD1CSSL);
}

void test_converter_is_switched_on_last(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, enabled_then);
    TEST_ASSERT_EQUAL_HEX16(0x0200, channels_then);
    TEST_ASSERT_EQUAL_HEX16(0x0002, clock_then);
    TEST_ASSERT_EQUAL_HEX16(0x0008, input_then);
}

void test_control_interrupt_is_enabled_at_priority_5_with_its_flag_clear(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, IEC0bits.AD1IE);
    TEST_ASSERT_EQUAL_UINT16(5, IPC3bits.AD1IP);
    IFS0bits.AD1IF = 1;
    adc_init();
    TEST_ASSERT_EQUAL_UINT16(0, IFS0bits.AD1IF);
}
