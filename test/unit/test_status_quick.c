/* The status line of a motor whose count of speed is 4 electrical rpm: mechanical rpm, within a word. */
#include "hurst_params.h"

#undef NOPOLESPAIRS
#define NOPOLESPAIRS 3
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 24000

#include "firmware/board/status.c"

#include "mock_selftest_run.h"
#include "mock_peripherals.h"
#include "peripherals_on_registers.h"
#include "unity.h"

drive_t board_drive;
request_t board_request;
const drive_params_t board_params;
retry_t board_retry;
uint16_t board_selftest_parts;
volatile uint16_t board_reset_cause;
tLimitParm LimitParm;

static char *nothing_more(char *at, int calls)
{
    (void)calls;
    return at;
}

static void expect_rpm(int16_t counts, const char *text)
{
    selftest_put_Stub(nothing_more);
    board_drive.run.estimator.omega_filtered_q16 = (int32_t)counts * 65536;
    *put_line() = '\0';
    TEST_ASSERT_EQUAL_STRING(text, sent_line);
}

void test_speed_is_in_mechanical_rpm(void)
{
    TEST_ASSERT_EQUAL_INT(4, SPEED_UNIT);
    expect_rpm(18000, "state 0 fault NONE speed 24000 rpm\r\n");
    expect_rpm(-13125, "state 0 fault NONE speed -17500 rpm\r\n");
    expect_rpm(1, "state 0 fault NONE speed 1 rpm\r\n");
}

void test_what_a_lost_estimator_sees_ends_with_the_word(void)
{
    expect_rpm(32767, "state 0 fault NONE speed 32767 rpm\r\n");
    expect_rpm(INT16_MIN, "state 0 fault NONE speed -32767 rpm\r\n");
}
