/* The status line with retries: how many are left, and the first cause, as long as there is one. */
#include "hurst_params.h"

#undef RETRY_COUNT
#define RETRY_COUNT 3

#include "firmware/board/status.c"

#include <string.h>

#include "mock_selftest_run.h"
#include "mock_peripherals.h"
#include "peripherals_on_registers.h"
#include "unity.h"

drive_t board_drive;
request_t board_request;
const drive_params_t board_params;
volatile uint16_t board_reset_cause;
uint16_t board_selftest_parts;
tLimitParm LimitParm;
retry_t board_retry;

static char *nothing_more(char *at, int calls)
{
    (void)calls;
    return at;
}

void setUp(void)
{
    peripherals_on_registers();
    selftest_put_Stub(nothing_more);
    LimitParm.seen = 0;
}

static void expect_line(uint16_t left, uint16_t first, const char *text)
{
    board_drive.state = (uint16_t)DRIVE_FAULT;
    board_drive.fault = (uint16_t)FAULT_START_FAILED;
    board_retry.left = left;
    board_retry.first = first;
    *put_line() = '\0';
    TEST_ASSERT_EQUAL_STRING(text, sent_line);
}

void test_line_tells_retries_and_first_cause(void)
{
    expect_line(2, FAULT_STALL, "state 7 fault START_FAILED speed 0 rpm retries 2 first STALL\r\n");
    expect_line(0, FAULT_STALL, "state 7 fault START_FAILED speed 0 rpm retries 0 first STALL\r\n");
    expect_line(3, FAULT_NONE, "state 7 fault START_FAILED speed 0 rpm\r\n");
    LimitParm.seen = LIMIT_CURRENT;
    expect_line(2, FAULT_STALL, "state 7 fault START_FAILED speed 0 rpm retries 2 first STALL limit CURRENT\r\n");
}

void test_the_longest_line_has_room(void)
{
    static const char longest[] = "state 7 fault OVERTEMPERATURE speed -32767 rpm retries 20 first OVERTEMPERATURE limit FIELD_WEAKENING";
    TEST_ASSERT_TRUE(sizeof longest <= LIMITS_END); /* a reason and more */
}
