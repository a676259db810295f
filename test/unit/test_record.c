/* The recorder's lines on the UART: head and rows of a complete record, once after a fault and once after a reset that kept one. */
#include "hurst_params.h"

#include "firmware/board/status.c"

#include "mock_selftest_run.h"
#include "unity.h"

#include <stdio.h>
#include <string.h>

drive_t board_drive;
request_t board_request;
const drive_params_t board_params;
retry_t board_retry;
tLimitParm LimitParm;
uint16_t board_selftest_parts;
volatile uint16_t board_reset_cause;

static char line[128];

#define POWER_UP 0x0003u
#define PIN 0x0080u

void setUp(void)
{
    static const drive_t zero;
    board_drive = zero;
    board_reset_cause = POWER_UP;
    record_init(FAULT_NONE);
}

/** Rows that differ in every byte, the first one with `first`. */
static void rows(uint16_t count, int16_t first)
{
    uint16_t n;
    for (n = 0; n < count; n++) {
        int16_t x = (int16_t)(first + (int16_t)n), upper = (int16_t)(256 * x);
        board_drive.run.control.v_q14.d = (int16_t)(upper + 0x0100);
        board_drive.run.control.v_q14.q = (int16_t)(-upper - 1);
        board_drive.angle = (uint16_t)(uint32_t)(16 * upper);
        board_drive.run.estimator.omega_filtered_q16 = (0x3456 + upper) * 65536;
        if (board_drive.fault != (uint16_t)FAULT_NONE) {
            recorder_in_fault(&board_recorder, &board_drive);
        }
        if (recorder_is_due(&board_drive)) {
            recorder_write(&board_recorder, &board_drive, upper, (int16_t)-upper, (int16_t)(0x1200 + upper));
        }
    }
}

static void record(uint16_t before)
{
    board_drive.state = (uint16_t)DRIVE_CLOSED;
    rows(before, 0);
    board_drive.fault = (uint16_t)FAULT_STALL;
    board_drive.state = (uint16_t)DRIVE_FAULT;
    rows(30, -20);
}

static void expect_line(const char *text)
{
    char *end = record_line(line);
    *end = '\0';
    TEST_ASSERT_EQUAL_STRING(text, line);
}

static uint16_t lines(void)
{
    uint16_t count = 0;
    while (record_line(line) != line) {
        count++;
    }
    return count;
}

void test_lines_tell_head_and_rows_from_the_oldest_on(void)
{
    board_drive.calibration.offset_a_q13 = -40;
    board_drive.calibration.offset_b_q13 = 3;
    record_tick();
    record(4);
    record_tick();
    expect_line("record fault STALL rows 20 every 2 offsets -40 3\r\n");
    expect_line("row 63 0 1 0 -1 5 0\r\n"); /* CLOSED, and nothing yet of what changes slowly */
    expect_line("row 62 1 2 -1 -2 5 16\r\n");
    expect_line("row 61 2 3 -2 -3 5 32\r\n");
    expect_line("row 60 3 4 -3 -4 101 48\r\n");        /* 0x65: the speed, 0x3756 */
    expect_line("row 59 -20 -19 20 19 87 -64\r\n");    /* 0x57: FAULT */
    TEST_ASSERT_EQUAL_UINT16(15, lines());
    expect_line("");
}

void test_the_ring_s_end_is_in_the_middle_of_a_full_record(void)
{
    uint16_t n;
    record(90);
    record_tick();
    expect_line("record fault STALL rows 64 every 2 offsets 0 0\r\n");
    for (n = 42; n < 42 + 64; n++) {
        unsigned place = 63u - n % 64u;
        char begin[20];
        (void)snprintf(begin, sizeof begin, "row %u %d ", place, (n < 90u) ? n : n - 110);
        TEST_ASSERT_TRUE(record_line(line) > line);
        TEST_ASSERT_EQUAL_STRING_LEN(begin, line, strlen(begin));
    }
    expect_line("");
}

void test_the_longest_line_fits_a_status_line(void)
{
    TEST_ASSERT_TRUE(sizeof "record fault OVERTEMPERATURE rows 64 every 64 offsets -1024 -1024\r\n" < sizeof line);
}

void test_nothing_is_sent_before_the_last_row_and_nothing_twice(void)
{
    record_tick();
    expect_line("");
    board_drive.fault = (uint16_t)FAULT_STALL;
    rows(16, 0);
    record_tick();
    expect_line("");
    rows(1, 0); /* the period after the last row says that it was the last */
    record_tick();
    TEST_ASSERT_EQUAL_UINT16(17, lines());
    rows(5, 0);
    record_tick();
    record_tick();
    expect_line("");
}

void test_a_kept_record_is_sent_again_after_a_reset(void)
{
    record(90);
    record_tick();
    TEST_ASSERT_EQUAL_UINT16(65, lines());
    board_reset_cause = PIN;
    record_init(FAULT_NONE);
    record_tick();
    TEST_ASSERT_EQUAL_UINT16(65, lines());
    board_reset_cause = POWER_UP;
    record_init(FAULT_NONE);
    record_tick();
    expect_line("");
    record(90);
    board_reset_cause = 0x0002u; /* a supply that dipped */
    record_init(FAULT_NONE);
    record_tick();
    expect_line("");
}

void test_a_start_ends_the_sending_and_the_next_fault_begins_it_anew(void)
{
    record(90);
    record_tick();
    expect_line("record fault STALL rows 64 every 2 offsets 0 0\r\n");
    board_drive.fault = (uint16_t)FAULT_NONE;
    board_drive.command.run = 1;
    record_tick();
    expect_line("");
    board_drive.command.run = 0;
    record(1);
    record_tick();
    expect_line("record fault STALL rows 17 every 2 offsets 0 0\r\n");
}
