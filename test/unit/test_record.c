/* The recorder's lines on the UART: head and rows of a complete record, once after a fault and once after a reset that kept one. */
#include "hurst_params.h"

#include "firmware/board/record.c"

#include "unity.h"

#include <stdio.h>
#include <string.h>

drive_t board_drive;
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

/** Rows that differ in every word, the first one with `first`. */
static void rows(uint16_t count, int16_t first)
{
    uint16_t n;
    for (n = 0; n < count; n++) {
        int16_t x = (int16_t)(first + (int16_t)n);
        board_drive.phases_q13.a = x;
        board_drive.phases_q13.b = (int16_t)-x;
        board_drive.run.control.v_q14.d = (int16_t)(x + 1000);
        board_drive.run.control.v_q14.q = (int16_t)(-x - 1000);
        board_drive.angle = (uint16_t)(16u * (uint16_t)x);
        board_drive.run.estimator.omega_filtered_q16 = x * 65536;
        if (board_drive.fault != (uint16_t)FAULT_NONE) {
            recorder_in_fault(&board_recorder, &board_drive);
        }
        recorder_tick(&board_recorder, &board_drive, (int16_t)(3 * x));
    }
}

static void record(uint16_t before)
{
    board_drive.state = (uint16_t)DRIVE_CLOSED;
    rows(before, 0);
    board_drive.fault = (uint16_t)FAULT_STALL;
    board_drive.state = (uint16_t)DRIVE_FAULT;
    rows(30, 500);
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
    record(2);
    record_tick();
    expect_line("record fault 6 rows 18 every 2\r\n");
    expect_line("row 71 0 0 1000 -1000 5 0\r\n");    /* odd: the speed */
    expect_line("row 70 1 -1 1001 -1001 21 3\r\n");  /* even: the bus */
    expect_line("row 69 500 -500 1500 -1500 8007 500\r\n");
    TEST_ASSERT_EQUAL_UINT16(15, lines());
    expect_line("");
}

void test_the_ring_s_end_is_in_the_middle_of_a_full_record(void)
{
    uint16_t n;
    record(90);
    record_tick();
    expect_line("record fault 6 rows 72 every 2\r\n");
    for (n = 34; n < 34 + 72; n++) {
        unsigned place = 71u - n % 72u;
        char begin[20];
        (void)snprintf(begin, sizeof begin, "row %u %d ", place, (n < 90u) ? n : n + 410u);
        TEST_ASSERT_TRUE(record_line(line) > line);
        TEST_ASSERT_EQUAL_STRING_LEN(begin, line, strlen(begin));
    }
    expect_line("");
}

void test_the_longest_row_fits_a_status_line(void)
{
    TEST_ASSERT_TRUE(sizeof "row 71 -32768 -32768 -32768 -32768 -32768 -32768\r\n" < sizeof line);
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
    TEST_ASSERT_EQUAL_UINT16(73, lines());
    board_reset_cause = PIN;
    record_init(FAULT_NONE);
    expect_line("");
    record_tick();
    TEST_ASSERT_EQUAL_UINT16(73, lines());
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
    expect_line("record fault 6 rows 72 every 2\r\n");
    board_drive.fault = (uint16_t)FAULT_NONE;
    board_drive.command.run = 1;
    record_tick();
    expect_line("");
    board_drive.command.run = 0;
    record(1);
    record_tick();
    expect_line("record fault 6 rows 17 every 2\r\n");
}
