/* What must switch the bridge off in its own period, whether the duties are written after the law or a period later. */
#ifndef TEST_OVERRUN_CASES_H
#define TEST_OVERRUN_CASES_H

#include "board/firmware.h"
#include "interrupts.h"
#include "unity.h"

static const struct {
    const char *what;
    uint16_t timer, sample_arrives, slow_waits, i_a;
    drive_fault_t fault;
} overrun_cases[] = {
    { "duties just before the boundary", 0x8001, 0, 0, 0, FAULT_NONE },
    { "duties after the boundary: counting up, they have been loaded", 0x0001, 0, 0, 0, FAULT_ISR_OVERRUN },
    { "the next sample during the interrupt", 0x8001, 1, 0, 0, FAULT_ISR_OVERRUN },
    { "the slow work of the period before is not done", 0x8001, 0, 1, 0, FAULT_ISR_OVERRUN },
    { "too much current", 0x8001, 0, 0, (uint16_t)(-4 * 7076), FAULT_OVERCURRENT_SW },
};
#define OVERRUN_CASES (sizeof overrun_cases / sizeof overrun_cases[0])

/** A period of the case, with the bridge switching; then, after a fault, many that change nothing any more. @param sample_arrives,slow_waits what the test lets come
 *  during the law @return the fault expected */
static inline drive_fault_t overrun_case(unsigned n, uint16_t *sample_arrives, uint16_t *slow_waits)
{
    uint16_t periods;
    drive_fault_t fault = overrun_cases[n].fault;
    uint16_t off = (uint16_t)(fault != FAULT_NONE);
    P1TMR = overrun_cases[n].timer;
    *sample_arrives = overrun_cases[n].sample_arrives;
    *slow_waits = overrun_cases[n].slow_waits;
    ADC1BUF1 = overrun_cases[n].i_a;
    IFS0bits.AD1IF = 1;
    a_period();
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(fault, board_drive.fault, overrun_cases[n].what);
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(off ? 0x0000 : 0x3F00, P1OVDCON, overrun_cases[n].what);
    P1TMR = 0x81F4;
    *sample_arrives = 0;
    *slow_waits = 0;
    if (off != 0u) {
        for (periods = 0; periods < 1000u; periods++) {
            IFS0bits.AD1IF = 1;
            a_period();
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(fault, board_drive.fault, overrun_cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(0x0000, P1OVDCON, overrun_cases[n].what);
    }
    return fault;
}

#endif
