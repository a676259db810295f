/* The interrupts at 40 kHz: duties of a period are written at the next one's begin, in time, and the bridge begins with the law's. */
#include "hurst_params.h"

#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.000025

#include <xc.h>

#include "drive/tick.h"

/* The real tick, with what the hardware may do meanwhile, and the duties that it has computed. */
static uint16_t sample_arrives_meanwhile, slow_work_waits;
static duties_t computed;

static uint16_t tick_and_meanwhile(drive_t *d, const drive_params_t *p, const drive_samples_t *raw, duties_t *duty)
{
    uint16_t switches;
    if (slow_work_waits) {
        IFS0bits.T2IF = 1;
    }
    if (sample_arrives_meanwhile) {
        IFS0bits.AD1IF = 1;
    }
    switches = drive_tick(d, p, raw, duty);
    computed = *duty;
    return switches;
}

#define drive_tick(d, p, raw, duty) tick_and_meanwhile(d, p, raw, duty)
#include "firmware/board/isr.c"
#undef drive_tick

#include "law.c"
#include "interrupts.h"
#include "overrun_cases.h"
#include "unity.h"

static void control_interrupts(uint16_t periods)
{
    while (periods-- != 0u) {
        IFS0bits.AD1IF = 1;
        a_period();
    }
}

void setUp(void)
{
    host_registers_reset();
    P1OVDCON = 0;
    P1TMR = 0x8100;
    ADC1BUF3 = (uint16_t)(int16_t)(24.0F / 52.8F * 65536.0F - 32768.0F);
    drive_init(&board_drive, &board_params);
    sample_arrives_meanwhile = 0;
    slow_work_waits = 0;
    control_interrupts(1024);
}

/** ALIGN has begun, and its first duties have been computed. @param extra periods before the start, which shift the slow work's turn */
static void bring_to_align(uint16_t extra)
{
    uint16_t most = 500;
    setUp();
    control_interrupts(extra);
    drive_start(&board_drive, &board_params, 1);
    while (board_drive.state != (uint16_t)DRIVE_ALIGN && most-- != 0u) {
        control_interrupts(1);
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, board_drive.state);
}

void test_duties_of_a_period_are_written_at_the_begin_of_the_next(void)
{
    uint16_t n;
    bring_to_align(0);
    control_interrupts(300);
    for (n = 0; n < 20u; n++) {
        duties_t before = computed;
        control_interrupts(1);
        TEST_ASSERT_EQUAL_UINT16(before.a, P1DC1);
        TEST_ASSERT_EQUAL_UINT16(before.b, P1DC2);
        TEST_ASSERT_EQUAL_UINT16(before.c, P1DC3);
    }
    TEST_ASSERT_TRUE(P1DC1 != 0u && P1DC1 <= 1000u);
}

void test_the_bridge_begins_to_switch_when_the_laws_first_duties_are_written_in_either_phase_of_the_slow_work(void)
{
    uint16_t extra, n;
    for (extra = 0; extra < 2u; extra++) {
        bring_to_align(extra);
        for (n = 0; n < 4u && P1OVDCON == 0x0015u; n++) {
            TEST_ASSERT_EQUAL_UINT16(0, P1DC1);
            control_interrupts(1);
        }
        TEST_ASSERT_EQUAL_HEX16(0x3F00, P1OVDCON);
        TEST_ASSERT_EQUAL_UINT16(2, n); /* computed in the first period of the law, written in the second */
        TEST_ASSERT_TRUE(P1DC1 != 0u && P1DC2 != 0u && P1DC3 != 0u);
    }
}

void test_a_stop_lets_no_old_duties_out(void)
{
    bring_to_align(0);
    control_interrupts(100);
    board_drive.command.run = 0;
    while (board_drive.state == (uint16_t)DRIVE_ALIGN) {
        TEST_ASSERT_EQUAL_HEX16(0x3F00, P1OVDCON);
        control_interrupts(1);
    }
    TEST_ASSERT_EQUAL_HEX16(0x0000, P1OVDCON); /* in the period that stops: those that wait never reach a pin */
    control_interrupts(2);
    TEST_ASSERT_EQUAL_UINT16(0, P1DC1 | P1DC2 | P1DC3);
}

void test_an_overrun_and_too_much_current_are_off_within_the_period_and_stay(void)
{
    for (unsigned n = 0; n < OVERRUN_CASES; n++) {
        bring_to_align(0);
        control_interrupts(10);
        (void)overrun_case(n, &sample_arrives_meanwhile, &slow_work_waits);
    }
}
