/* The cause of a reset, the fault that is kept over it, and who may serve the watchdog. */
#include "firmware/board/reset.c"

#include "unity.h"

#define POWER_UP 0x0003u
#define WATCHDOG 0x0010u
#define OPCODE 0x4000u
#define TRAP_CONFLICT 0x8000u
#define PIN 0x0080u
#define SOFTWARE 0x0040u

void setUp(void)
{
    host_registers_reset();
    kept_fault = 0x5A5Au; /* what RAM may hold */
    kept_inverse = 0x1234u;
    board_trap_intcon1 = 0x0008u;
}

static drive_fault_t start(uint16_t rcon)
{
    RCON = rcon;
    return reset_take();
}

void test_power_up_starts_without_a_fault_and_without_an_old_trap(void)
{
    reset_keep(FAULT_STALL);
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, start(POWER_UP));
    TEST_ASSERT_EQUAL_HEX16(0, board_trap_intcon1);
    reset_keep(FAULT_STALL);
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, start(0x0002u));
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, start(0x0013u)); /* a watchdog flag beside power-up means nothing */
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, start(0x0011u));
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, start(0x0012u));
}

void test_cause_is_kept_for_the_reader_and_rcon_is_cleared_for_the_next_reset(void)
{
    (void)start(PIN);
    TEST_ASSERT_EQUAL_HEX16(PIN, board_reset_cause);
    TEST_ASSERT_EQUAL_HEX16(0, RCON);
}

void test_pin_and_software_resets_forget_the_fault_but_not_the_trap(void)
{
    reset_keep(FAULT_TRAP);
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, start(PIN));
    TEST_ASSERT_EQUAL_INT(FAULT_NONE, start(SOFTWARE));
    TEST_ASSERT_EQUAL_HEX16(0x0008u, board_trap_intcon1);
}

void test_trap_that_ends_in_a_watchdog_reset_is_still_a_trap(void)
{
    reset_keep(FAULT_TRAP);
    TEST_ASSERT_EQUAL_INT(FAULT_TRAP, start(WATCHDOG));
    TEST_ASSERT_EQUAL_HEX16(0x0008u, board_trap_intcon1);
}

void test_each_kept_fault_comes_back_after_a_watchdog_reset(void)
{
    uint16_t fault;
    for (fault = (uint16_t)FAULT_NONE + 1u; fault < (uint16_t)FAULT_COUNT; fault++) {
        reset_keep(fault);
        TEST_ASSERT_EQUAL_INT(fault, start(WATCHDOG));
    }
}

void test_watchdog_reset_out_of_a_healthy_run_is_WATCHDOG(void)
{
    reset_keep(FAULT_NONE);
    TEST_ASSERT_EQUAL_INT(FAULT_WATCHDOG, start(WATCHDOG));
}

void test_what_ram_happens_to_hold_is_no_kept_fault(void)
{
    TEST_ASSERT_EQUAL_INT(FAULT_WATCHDOG, start(WATCHDOG));
    kept_fault = FAULT_STALL; /* a plausible code, the check word is not */
    TEST_ASSERT_EQUAL_INT(FAULT_WATCHDOG, start(WATCHDOG));
    kept_inverse = 0xFFFFu;
    TEST_ASSERT_EQUAL_INT(FAULT_WATCHDOG, start(WATCHDOG));
    reset_keep(FAULT_COUNT); /* a code that does not exist */
    TEST_ASSERT_EQUAL_INT(FAULT_WATCHDOG, start(WATCHDOG));
}

void test_illegal_opcode_and_trap_conflict_are_traps(void)
{
    reset_keep(FAULT_NONE);
    TEST_ASSERT_EQUAL_INT(FAULT_TRAP, start(OPCODE));
    TEST_ASSERT_EQUAL_INT(FAULT_TRAP, start(TRAP_CONFLICT));
    reset_keep(FAULT_OVERCURRENT_HW);
    TEST_ASSERT_EQUAL_INT(FAULT_OVERCURRENT_HW, start(OPCODE));
}

void test_watchdog_is_served_once_for_each_new_period_and_never_without_one(void)
{
    served_tick = 77;
    (void)start(POWER_UP);
    reset_serve_watchdog(0); /* no interrupt has come yet */
    TEST_ASSERT_EQUAL_UINT16(0, host_watchdog_serves);
    reset_serve_watchdog(1);
    TEST_ASSERT_EQUAL_UINT16(1, host_watchdog_serves);
    reset_serve_watchdog(1);
    reset_serve_watchdog(1);
    TEST_ASSERT_EQUAL_UINT16(1, host_watchdog_serves);
    reset_serve_watchdog(0); /* the tick counter wraps */
    TEST_ASSERT_EQUAL_UINT16(2, host_watchdog_serves);
}
