/* The retry on the virtual board: a shaft that is blocked for a while, one that stays blocked, and a supply that dips. */
#include "bench.h"

#include "board/watch.h"

#undef RETRY_COUNT
#define RETRY_COUNT 3

#include "firmware/board/firmware.c"
#include "firmware/drive/request.c"

void setUp(void)
{
    bench_set_up();
}

void test_a_shaft_that_is_freed_in_time_turns_again(void)
{
    run_at(1500.0);
    set("load.locked", 1.0);
    TEST_ASSERT_TRUE(seconds_to(DRIVE_FAULT, 1.0) < 1.0);
    drive_fault_t first = (drive_fault_t)board_drive.fault;
    TEST_ASSERT_TRUE(first == FAULT_STALL || first == FAULT_LOST_LOCK);
    assert_outputs_off();
    wait_s(1.0);
    assert_outputs_off();
    TEST_ASSERT_DOUBLE_WITHIN(0.1, RETRY_PAUSE_SEC - 1.0, seconds_to(DRIVE_ALIGN, 5.0));
    wait_s(0.1);
    TEST_ASSERT_EQUAL_UINT16(2, RetryParm.left);
    TEST_ASSERT_EQUAL_UINT16(first, RetryParm.first);
    (void)seconds_to(DRIVE_FAULT, 3.0); /* still blocked */
    TEST_ASSERT_EQUAL_UINT16(FAULT_START_FAILED, board_drive.fault);
    set("load.locked", 0.0);
    (void)seconds_to(DRIVE_CLOSED, 6.0);
    wait_s(1.5);
    (void)assert_holds(1500.0, 0.5);
    TEST_ASSERT_EQUAL_UINT16(1, RetryParm.left);
    TEST_ASSERT_EQUAL_UINT16(first, RetryParm.first);
    wait_s(RETRY_FORGET_SEC);
    assert_running();
    TEST_ASSERT_EQUAL_UINT16(3, RetryParm.left);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, RetryParm.first);
}

void test_a_shaft_that_stays_blocked_ends_after_the_stated_number_of_starts(void)
{
    unsigned starts = 0;
    run_at(1500.0);
    set("load.locked", 1.0);
    (void)seconds_to(DRIVE_FAULT, 1.0);
    drive_fault_t first = (drive_fault_t)board_drive.fault;
    while (starts < 10u && seconds_to(DRIVE_ALIGN, 5.0) < 5.0) {
        starts++;
        TEST_ASSERT_TRUE(seconds_to(DRIVE_FAULT, 3.0) < 3.0);
    }
    TEST_ASSERT_EQUAL_UINT(3, starts);
    assert_fault(FAULT_START_FAILED);
    TEST_ASSERT_EQUAL_UINT16(0, RetryParm.left);
    TEST_ASSERT_EQUAL_UINT16(first, RetryParm.first);
    set("load.locked", 0.0);
    press("input.s2");
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(3, RetryParm.left);
    wait_s(5.0);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
}

void test_s2_in_the_pause_ends_the_retry(void)
{
    run_at(1500.0);
    set("load.locked", 1.0);
    (void)seconds_to(DRIVE_FAULT, 1.0);
    wait_s(1.0);
    press("input.s2");
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    wait_s(5.0);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
    assert_outputs_off();
}

void test_a_supply_that_dips_is_ridden_through(void)
{
    run_at(800.0);
    supply_v(UNDER_VOLTAGE_V - 2.0);
    TEST_ASSERT_TRUE(seconds_to(DRIVE_FAULT, 1.0) < 1.0);
    TEST_ASSERT_EQUAL_UINT16(FAULT_UNDERVOLTAGE, board_drive.fault);
    supply_v(24.0);
    TEST_ASSERT_TRUE(seconds_to(DRIVE_CLOSED, 6.0) < 6.0);
    wait_s(1.0);
    (void)assert_holds(800.0, 0.5);
}

void test_a_short_circuit_is_not_tried_again(void)
{
    run_at(1500.0);
    set("input.flta", 1.0);
    wait_s(0.01);
    set("input.flta", 0.0);
    wait_s(10.0);
    assert_fault(FAULT_OVERCURRENT_HW);
}
