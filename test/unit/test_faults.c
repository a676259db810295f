/* Faults: codes that never change, the first one wins, and a fault stays until it is cleared. */
#include <string.h>

#include "drive_rig.h"
#include "unity.h"

void setUp(void)
{
    rig_ready();
}

void tearDown(void)
{
}

void test_codes_never_change_their_meaning(void)
{
    TEST_ASSERT_EQUAL_INT(0, FAULT_NONE);
    TEST_ASSERT_EQUAL_INT(1, FAULT_OVERCURRENT_HW);
    TEST_ASSERT_EQUAL_INT(2, FAULT_OVERCURRENT_SW);
    TEST_ASSERT_EQUAL_INT(3, FAULT_OVERVOLTAGE);
    TEST_ASSERT_EQUAL_INT(4, FAULT_UNDERVOLTAGE);
    TEST_ASSERT_EQUAL_INT(5, FAULT_START_FAILED);
    TEST_ASSERT_EQUAL_INT(6, FAULT_STALL);
    TEST_ASSERT_EQUAL_INT(7, FAULT_LOST_LOCK);
    TEST_ASSERT_EQUAL_INT(8, FAULT_ISR_OVERRUN);
    TEST_ASSERT_EQUAL_INT(9, FAULT_OFFSET);
    TEST_ASSERT_EQUAL_INT(10, FAULT_ADC_LOST);
    TEST_ASSERT_EQUAL_INT(11, FAULT_CLOCK);
    TEST_ASSERT_EQUAL_INT(12, FAULT_TRAP);
}

#define FAULT_ROW(code, name, cause, remedy) { (code), #name, cause, remedy },
static const struct {
    int16_t code;
    const char *name, *cause, *remedy;
} rows[] = { DRIVE_FAULT_TABLE(FAULT_ROW) };
#define ROWS ((int16_t)(sizeof rows / sizeof rows[0]))

void test_table_is_in_order_without_gaps(void)
{
    int16_t n;
    for (n = 0; n < ROWS; n++) {
        TEST_ASSERT_EQUAL_INT16(n, rows[n].code);
    }
    TEST_ASSERT_EQUAL_INT16(ROWS, FAULT_COUNT);
}

void test_every_fault_names_cause_and_remedy_once(void)
{
    int16_t n, k;
    for (n = 0; n < ROWS; n++) {
        TEST_ASSERT_TRUE(strlen(rows[n].cause) > 5u);
        TEST_ASSERT_TRUE(strlen(rows[n].remedy) > 5u);
        for (k = 0; k < n; k++) {
            TEST_ASSERT_NOT_EQUAL_INT(0, strcmp(rows[k].name, rows[n].name));
            TEST_ASSERT_NOT_EQUAL_INT(0, strcmp(rows[k].cause, rows[n].cause));
        }
    }
}

void test_raise_stops_and_takes_the_run_request_back_in_every_state(void)
{
    uint16_t state;
    for (state = 0; state < (uint16_t)DRIVE_STATE_COUNT; state++) {
        rig_ready();
        drive.state = state;
        drive.command.run = 1;
        drive_raise(&drive, FAULT_TRAP);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
        TEST_ASSERT_EQUAL_UINT16(FAULT_TRAP, drive.fault);
        TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    }
}

void test_first_fault_wins(void)
{
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    drive_raise(&drive, FAULT_CLOCK);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
}

void test_fault_stays_with_outputs_off_until_it_is_cleared(void)
{
    uint16_t n;
    drive_raise(&drive, FAULT_STALL);
    for (n = 0; n < 40000u; n++) {
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    }
}

void test_run_request_does_not_leave_a_fault(void)
{
    drive_raise(&drive, FAULT_STALL);
    drive.command.run = 1;
    rig_tick(100);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

void test_clearing_returns_to_STOPPED_and_does_not_start(void)
{
    drive_raise(&drive, FAULT_STALL);
    rig_tick(1);
    drive.command.clear_fault = 1;
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    rig_tick(1000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
}

void test_a_clear_request_is_taken_back_once_served(void)
{
    drive_raise(&drive, FAULT_STALL);
    drive.command.clear_fault = 1;
    rig_tick(1);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.clear_fault);
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    rig_tick(100);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
}

void test_a_clear_request_without_a_fault_does_not_wait_for_one(void)
{
    drive.command.clear_fault = 1;
    rig_tick(1);
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    rig_tick(100);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
}

void test_a_fault_whose_cause_remains_comes_back(void)
{
    rig_bus(40.0F);
    rig_tick(8);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
    drive.command.clear_fault = 1;
    rig_tick(9);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
}

void test_drive_starts_again_after_a_cleared_fault(void)
{
    drive_start(&drive, &params, 1);
    rig_tick(50);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    rig_tick(10);
    drive.command.clear_fault = 1;
    rig_tick(1);
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    rig_tick(201);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, drive.state);
}

/* ---- the gate ---- */

void test_no_state_is_entered_past_a_fault(void)
{
    uint16_t next;
    for (next = 0; next < (uint16_t)DRIVE_STATE_COUNT; next++) {
        rig_ready();
        drive_raise(&drive, FAULT_STALL);
        drive_enter(&drive, (drive_state_t)next);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    }
}

void test_every_state_is_entered_without_a_fault_and_begins_at_period_0(void)
{
    uint16_t next;
    for (next = 0; next < (uint16_t)DRIVE_STATE_COUNT; next++) {
        drive.periods = 77;
        drive_enter(&drive, (drive_state_t)next);
        TEST_ASSERT_EQUAL_UINT16(next, drive.state);
        TEST_ASSERT_EQUAL_UINT16(0, drive.periods);
    }
}

void test_a_cleared_fault_before_the_calibration_calibrates_anew(void)
{
    drive.calibration.done = 0;
    drive_raise(&drive, FAULT_CLOCK);
    TEST_ASSERT_EQUAL_INT(DRIVE_CALIBRATE, drive_clear_fault(&drive));
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    drive.calibration.done = 1;
    drive_raise(&drive, FAULT_CLOCK);
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, drive_clear_fault(&drive));
}

void test_a_fault_that_came_in_the_middle_of_a_period_outlives_it(void)
{
    drive.state = (uint16_t)DRIVE_CLOSED;
    drive.fault = (uint16_t)FAULT_TRAP; /* a trap, just after the period has looked and before it entered CLOSED */
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, drive_outputs(&drive));
    TEST_ASSERT_EQUAL_UINT16(1, drive_settle(&drive));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    drive.fault = (uint16_t)FAULT_NONE;
    drive.state = (uint16_t)DRIVE_CLOSED;
    TEST_ASSERT_EQUAL_UINT16(0, drive_settle(&drive));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_PWM, drive_outputs(&drive));
}

void test_state_FAULT_never_stays_without_a_fault(void)
{
    drive.state = (uint16_t)DRIVE_FAULT; /* the background raised while the interrupt cleared */
    rig_tick(1);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}
