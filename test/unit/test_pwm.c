/* PWM1's registers against the device facts: 20 kHz centre-aligned, 2 us dead time, fault input, trigger, outputs off. */
#include "hurst_params.h"

#include <xc.h>

/* Every access to P1TCON is seen: what the other registers hold when the module is switched on is part of the contract. */
static uint16_t accesses, time_base_then, override_then, dead_time_then, fault_input_then, pairs_then, first_period_then;

static volatile uint16_t *watch_time_base(volatile uint16_t *time_base)
{
    accesses++;
    time_base_then = *time_base;
    override_then = P1OVDCON;
    dead_time_then = P1DTCON1;
    fault_input_then = P1FLTACON;
    pairs_then = PWM1CON1;
    first_period_then = P1TPER;
    return time_base;
}

/* So is the moment when the pairs take their pins. */
static uint16_t override_at_pairs, running_at_pairs;

static volatile uint16_t *watch_pairs(volatile uint16_t *pairs)
{
    override_at_pairs = P1OVDCON;
    running_at_pairs = P1TCON;
    return pairs;
}

#define P1TCON (*watch_time_base(&P1TCON))
#define PWM1CON1 (*watch_pairs(&PWM1CON1))
#include "firmware/board/pwm.c"
#undef P1TCON
#undef PWM1CON1

#include "unity.h"

void setUp(void)
{
    host_registers_reset();
}

void tearDown(void)
{
}

void test_outputs_off_overrides_all_six(void)
{
    P1OVDCON = 0x3F15;
    pwm_outputs_off();
    TEST_ASSERT_EQUAL_HEX16(0x0000, P1OVDCON);
}

void test_init_leaves_all_outputs_off(void)
{
    P1DC1 = 1000;
    P1DC2 = 1000;
    P1DC3 = 1000;
    pwm_init();
    TEST_ASSERT_EQUAL_HEX16(0x0000, P1OVDCON);
    TEST_ASSERT_EQUAL_UINT16(0, P1DC1);
    TEST_ASSERT_EQUAL_UINT16(0, P1DC2);
    TEST_ASSERT_EQUAL_UINT16(0, P1DC3);
}

void test_module_is_switched_on_last_with_its_outputs_off(void)
{
    accesses = 0;
    P1TCON = 0xFFFF;
    pwm_init();
    TEST_ASSERT_EQUAL_UINT16(2, accesses); /* off first, on at the end */
    TEST_ASSERT_EQUAL_HEX16(0x0000, time_base_then);
    TEST_ASSERT_EQUAL_HEX16(0x0000, override_then);
    TEST_ASSERT_EQUAL_HEX16(0x0068, dead_time_then);
    TEST_ASSERT_EQUAL_HEX16(0x0087, fault_input_then);
    TEST_ASSERT_EQUAL_HEX16(0x0077, pairs_then);
    TEST_ASSERT_EQUAL_UINT16(999, first_period_then);
}

void test_pairs_take_their_pins_with_the_override_off_and_the_module_at_rest(void)
{
    P1OVDCON = 0x3F15;
    pwm_init();
    TEST_ASSERT_EQUAL_HEX16(0x0000, override_at_pairs);
    TEST_ASSERT_EQUAL_HEX16(0x0000, running_at_pairs);
}

void test_time_base_is_on_centre_aligned_at_20_kHz(void)
{
    pwm_init();
    TEST_ASSERT_EQUAL_HEX16(0x8002, P1TCON);
    TEST_ASSERT_EQUAL_UINT16(999, P1TPER);
}

void test_three_complementary_pairs(void)
{
    PWM1CON2 = 0xFFFF;
    pwm_init();
    TEST_ASSERT_EQUAL_HEX16(0x0077, PWM1CON1);
    TEST_ASSERT_EQUAL_HEX16(0x0000, PWM1CON2);
}

void test_dead_time_is_2_us_for_every_pair(void)
{
    P1DTCON2 = 0xFFFF;
    pwm_init();
    TEST_ASSERT_EQUAL_HEX16(0x0068, P1DTCON1); /* 40 counts of two clocks */
    TEST_ASSERT_EQUAL_HEX16(0x0000, P1DTCON2); /* unit A everywhere */
}

void test_fault_input_switches_all_pairs_inactive_every_cycle(void)
{
    pwm_init();
    TEST_ASSERT_EQUAL_HEX16(0x0087, P1FLTACON);
}

void test_trigger_is_1_5_us_after_the_peak_counting_down(void)
{
    pwm_init();
    TEST_ASSERT_EQUAL_HEX16(0x8000 | 939, P1SECMP);
}

void test_sample_lies_inside_the_low_sides_conduction_at_the_highest_duty(void)
{
    /* low side on from top/2 counts up, after dead time, to top/2 counts down; the shunt needs 1 us to settle */
    int16_t sample, low_on, low_off;
    pwm_init();
    sample = (int16_t)(2 * 999 - (int16_t)(P1SECMP & 0x7FFFu));
    low_on = (int16_t)(PWM_TOP_DUTY / 2 + 80);
    low_off = (int16_t)(2 * 999 - PWM_TOP_DUTY / 2);
    TEST_ASSERT_GREATER_OR_EQUAL_INT16(40, sample - low_on);
    TEST_ASSERT_GREATER_OR_EQUAL_INT16(0, low_off - sample);
}

void test_fault_interrupt_is_armed_with_the_control_interrupts_priority(void)
{
    IFS3bits.FLTA1IF = 1;
    pwm_init();
    TEST_ASSERT_EQUAL_UINT16(0, IFS3bits.FLTA1IF);
    TEST_ASSERT_EQUAL_UINT16(1, IEC3bits.FLTA1IE);
    TEST_ASSERT_EQUAL_UINT16(5, IPC15bits.FLTA1IP);
}
