/* The one machine: which state may follow which, codes of faults that never change, the first fault wins and stays until it is cleared. */
#include <stdio.h>
#include <string.h>

#include "drive_rig.h"

void setUp(void)
{
    rig_ready();
}

/** The state alone, as if the drive had come there. */
static void put_in(uint16_t state)
{
    rig_ready();
    drive.state = state;
}

/* ---- the table of faults ---- */

#define FAULT_ROW(code, name, passes, decided_by, cause, remedy) { (code), FAULT_##name, #name, cause, remedy },
static const struct {
    int16_t code, constant;
    const char *name, *cause, *remedy;
} rows[] = { DRIVE_FAULT_TABLE(FAULT_ROW) };

void test_codes_never_change_their_meaning(void)
{
    static const char *const names[] = {
        "NONE", "OVERCURRENT_HW", "OVERCURRENT_SW", "OVERVOLTAGE", "UNDERVOLTAGE", "START_FAILED", "STALL", "LOST_LOCK",
        "ISR_OVERRUN", "OFFSET", "ADC_LOST", "CLOCK", "TRAP", "WATCHDOG",
        "CURRENT_SENSOR", "BUS_SENSOR", "OPEN_PHASE", "POTENTIOMETER", "INTERRUPT_RATE", "OVERTEMPERATURE", "SELFTEST"
    };
    TEST_ASSERT_EQUAL_INT(FAULT_COUNT, sizeof rows / sizeof rows[0]);
    EACH(n, names) {
        TEST_ASSERT_EQUAL_STRING(names[n], rows[n].name);
    }
    EACH(n, rows) {
        TEST_ASSERT_EQUAL_INT16(n, rows[n].code);
        TEST_ASSERT_EQUAL_INT16(n, rows[n].constant);
    }
}

void test_every_fault_names_cause_and_remedy_once(void)
{
    EACH(n, rows) {
        uint16_t k;
        TEST_ASSERT_TRUE(strlen(rows[n].cause) > 5u);
        TEST_ASSERT_TRUE(strlen(rows[n].remedy) > 5u);
        for (k = 0; k < n; k++) {
            TEST_ASSERT_NOT_EQUAL_INT(0, strcmp(rows[k].name, rows[n].name));
            TEST_ASSERT_NOT_EQUAL_INT(0, strcmp(rows[k].cause, rows[n].cause));
        }
    }
}

/* ---- the gate ---- */

#define NAME_OF(name, meaning) #name,
static const char *const state_names[] = { DRIVE_STATE_TABLE(NAME_OF) };

/* A row each, and in it an x for each state that may follow, in the order of the table. */
static const char *const follow[DRIVE_STATE_COUNT] = {
    ".x.....x.." /* CALIBRATE */,
    "..x....xx." /* STOPPED */,
    ".x.x...xx." /* BOOTSTRAP */,
    ".x..x..x.." /* ALIGN */,
    ".x...x.x.." /* RAMP */,
    ".x....xx.x" /* CLOSED */,
    ".x..xx.x.x" /* STOPPING */,
    "xx.....x.." /* FAULT */,
    ".xx.xx.x.." /* CATCH */,
    ".x.....x.." /* BRAKE */
};

void test_a_legal_transition_enters_the_state_at_period_0_and_each_other_is_a_fault_of_the_program(void)
{
    EACH(from, state_names) {
        EACH(to, state_names) {
            uint16_t legal = (uint16_t)(follow[from][to] == 'x');
            char what[40];
            (void)snprintf(what, sizeof what, "%s to %s", state_names[from], state_names[to]);
            put_in(from);
            drive.periods = 77;
            drive.command.run = 1;
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(legal, drive_may_follow(from, (drive_state_t)to), what);
            drive_enter(&drive, (drive_state_t)to);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(legal ? to : (uint16_t)DRIVE_FAULT, drive.state, what);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(legal ? FAULT_NONE : FAULT_SELFTEST, drive.fault, what);
            TEST_ASSERT_EQUAL_INT16_MESSAGE(legal, drive.command.run, what);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(0, drive.periods, what);
            TEST_ASSERT_TRUE_MESSAGE(legal || drive_outputs(&drive) == (uint16_t)OUTPUTS_OFF, what);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(1, selftest_variables_hold(&drive), what);
        }
    }
}

void test_no_transition_leaves_a_state_that_there_is_not(void)
{
    EACH(to, state_names) {
        for (uint16_t from = DRIVE_STATE_COUNT; from < 3000u; from++) {
            TEST_ASSERT_EQUAL_UINT16(0, drive_may_follow(from, (drive_state_t)to));
        }
        put_in(DRIVE_STATE_COUNT);
        drive_enter(&drive, (drive_state_t)to);
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_SELFTEST, state_names[to]);
    }
}

void test_a_fault_enters_FAULT_from_every_state_and_keeps_every_other_out(void)
{
    EACH(from, state_names) {
        EACH(to, state_names) {
            put_in(from);
            drive.command.run = 1;
            drive_raise(&drive, FAULT_TRAP);
            EXPECT_DRIVE(DRIVE_FAULT, FAULT_TRAP, state_names[from]);
            TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
            drive_enter(&drive, (drive_state_t)to);
            EXPECT_DRIVE(DRIVE_FAULT, FAULT_TRAP, state_names[to]);
        }
    }
}

void test_the_fault_of_a_trap_that_comes_before_a_wrong_transition_is_the_one_that_is_kept(void)
{
    EACH(to, state_names) {
        put_in(DRIVE_RAMP);
        drive.fault = (uint16_t)FAULT_TRAP; /* its state is not written yet */
        drive_enter(&drive, (drive_state_t)to);
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_TRAP, state_names[to]);
    }
}

void test_outputs_of_every_state(void)
{
    EACH(state, rig_outputs) {
        uint16_t fault = (uint16_t)((state == (uint16_t)DRIVE_FAULT) ? FAULT_STALL : FAULT_NONE);
        if (state == (uint16_t)DRIVE_BRAKE) { /* of STOP_MODE 2: test_stop_short.c */
            continue;
        }
        rig_closed(1, 8000);
        drive.periods = 0;
        drive.state = state;
        drive.fault = fault;
        drive.run.catching.pause = 5;
        if (state == (uint16_t)DRIVE_STOPPED || state == (uint16_t)DRIVE_STOPPING) {
            drive.command.run = 0;
        }
        rig_tick(1);
        EXPECT_DRIVE(state, fault, golden_row(state));
        TEST_ASSERT_EQUAL_INT16(rig_outputs[state] == (uint16_t)OUTPUTS_PWM, drive_is_running(&drive));
        TEST_ASSERT_EQUAL_INT16(state == (uint16_t)DRIVE_CLOSED || state == (uint16_t)DRIVE_STOPPING, drive_is_closed(&drive));
        if (rig_outputs[state] != (uint16_t)OUTPUTS_PWM) {
            TEST_ASSERT_EQUAL_UINT16(0, out.duty.a);
            TEST_ASSERT_EQUAL_UINT16(0, out.duty.b);
            TEST_ASSERT_EQUAL_UINT16(0, out.duty.c);
        }
    }
}

void test_a_fault_that_came_in_the_middle_of_a_period_outlives_it(void)
{
    drive.state = (uint16_t)DRIVE_CLOSED;
    drive.fault = (uint16_t)FAULT_TRAP; /* a trap, just after the period has looked and before it entered CLOSED */
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, drive_outputs(&drive));
    TEST_ASSERT_EQUAL_UINT16(1, drive_latch_fault(&drive));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    drive.fault = (uint16_t)FAULT_NONE;
    drive.state = (uint16_t)DRIVE_CLOSED;
    TEST_ASSERT_EQUAL_UINT16(0, drive_latch_fault(&drive));
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CLOSED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_PWM, drive_outputs(&drive));
}

/* ---- a fault's life ---- */

void test_the_first_fault_stays_with_outputs_off_whatever_follows(void)
{
    uint16_t n;
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    drive_raise(&drive, FAULT_CLOCK);
    drive.command.run = 1;
    for (n = 0; n < 40000u; n++) {
        rig_tick(1);
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERVOLTAGE, golden_row(n));
    }
}

void test_clearing_returns_to_STOPPED_is_served_once_and_a_start_must_be_asked_for(void)
{
    drive_start(&drive, &params, 1);
    rig_tick(50);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    rig_tick(10);
    drive.command.clear_fault = 1;
    rig_tick(1);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "cleared");
    TEST_ASSERT_EQUAL_INT16(0, drive.command.clear_fault);
    rig_tick(1000);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "no start by itself");
    drive_start(&drive, &params, 1);
    rig_tick(202);
    EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, "asked for");
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    rig_tick(100);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERVOLTAGE, "the request does not wait for the next one");
}

void test_a_clear_request_without_a_fault_is_taken_back_and_disturbs_nothing(void)
{
    drive.command.clear_fault = 1;
    rig_tick(1);
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    rig_tick(100);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERVOLTAGE, "asked for while stopped");
    rig_start(1);
    rig_tick(5);
    drive.command.clear_fault = 1;
    rig_tick(1);
    EXPECT_DRIVE(DRIVE_BOOTSTRAP, FAULT_NONE, "asked for in a start");
    TEST_ASSERT_EQUAL_UINT16(5, drive.periods); /* the first of the six ended STOPPED */
    TEST_ASSERT_EQUAL_INT16(0, drive.command.clear_fault);
}

void test_a_fault_whose_cause_remains_comes_back(void)
{
    uint16_t n;
    rig_bus(10.0F);
    for (n = 0; n < 3u; n++) {
        rig_tick(8);
        drive.command.clear_fault = 1;
        rig_tick(1);
        EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, golden_row(n));
        drive_start(&drive, &params, 1);
        rig_tick(80);
        EXPECT_DRIVE(DRIVE_FAULT, FAULT_UNDERVOLTAGE, "still 10 V");
    }
}

void test_a_cleared_fault_before_the_calibration_calibrates_anew(void)
{
    drive.calibration.done = 0;
    drive_raise(&drive, FAULT_CLOCK);
    TEST_ASSERT_EQUAL_INT(DRIVE_CALIBRATE, drive_clear_fault(&drive));
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_a_fault_that_loses_a_bit_in_memory_is_not_cleared_by_it(void)
{
    drive_raise(&drive, FAULT_OVERCURRENT_HW); /* its number has one bit */
    drive.fault = (uint16_t)FAULT_NONE;
    rig_tick(100);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_NONE, "the copy does not agree");
    TEST_ASSERT_FALSE(selftest_variables_hold(&drive));
    drive_raise(&drive, FAULT_SELFTEST); /* by the background */
    rig_tick(100);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_SELFTEST, "named");
}

void test_state_FAULT_never_stays_without_a_fault(void)
{
    drive.state = (uint16_t)DRIVE_FAULT; /* the background raised while the interrupt cleared */
    rig_tick(1);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "left");
}
