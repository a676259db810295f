/* The status line: its text, its rhythm, and a transmitter that is sometimes full. */
#include "hurst_params.h"

#undef BRAKE_CHOPPER_V
#define BRAKE_CHOPPER_V 26 /* with its reason */

#include "firmware/board/status.c"

#include <string.h>

#include "mock_selftest_run.h"
#include "mock_peripherals.h"
#include "peripherals_on_registers.h"
#include "transmitter.h"
#include "unity.h"

drive_t board_drive;
request_t board_request;
const drive_params_t board_params;
retry_t board_retry;
uint16_t board_selftest_parts;
volatile uint16_t board_reset_cause;
tLimitParm LimitParm;

/** No self-test has failed, and the flash has its CRC. */
static char *nothing_more(char *at, int calls)
{
    (void)calls;
    return at;
}

void setUp(void)
{
    peripherals_on_registers();
    selftest_put_Stub(nothing_more);
    selftest_put_marked_Stub(nothing_more);
    static const drive_t zero;
    board_drive = zero;
    transmitter_begins();
    LimitParm.seen = 0;
    board_reset_cause = 0;
    status_init();
}

static void send_passes(uint16_t passes)
{
    while (passes-- != 0u) {
        status_send();
        transmitter_takes();
    }
}

static void expect_line(uint16_t state, uint16_t fault, int16_t speed_erpm, const char *text)
{
    setUp();
    board_drive.state = state;
    board_drive.fault = fault;
    board_drive.run.estimator.omega_filtered_q16 = (int32_t)speed_erpm * 65536;
    status_tick(500);
    send_passes(60);
    TEST_ASSERT_EQUAL_STRING(text, sent);
}

void test_line_tells_state_fault_and_mechanical_speed(void)
{
    expect_line(DRIVE_CLOSED, FAULT_NONE, 5000, "state 5 fault NONE speed 1000 rpm\r\n");
    expect_line(DRIVE_FAULT, FAULT_TRAP, 0, "state 7 fault TRAP speed 0 rpm\r\n");
    expect_line(DRIVE_CLOSED, FAULT_NONE, -27500, "state 5 fault NONE speed -5500 rpm\r\n");
    expect_line(DRIVE_STOPPED, FAULT_ADC_LOST, 49, "state 1 fault ADC_LOST speed 9 rpm\r\n");
    expect_line(DRIVE_FAULT, FAULT_TRAP, -32768, "state 7 fault TRAP speed -6553 rpm\r\n");
}

void test_line_tells_why_the_drive_was_limited_since_the_line_before(void)
{
    status_tick(0);
    LimitParm.seen = LIMIT_CURRENT | LIMIT_RAMP;
    status_tick(500);
    send_passes(100);
    TEST_ASSERT_EQUAL_STRING("state 0 fault NONE speed 0 rpm limit CURRENT RAMP\r\n", sent);
    sent_count = 0;
    status_tick(500);
    send_passes(100);
    TEST_ASSERT_EQUAL_STRING("state 0 fault NONE speed 0 rpm\r\n", sent);
}

/** The line's end is a self-test's code and CR LF. */
static char *a_selftest(char *at, int calls)
{
    (void)calls;
    return strcpy(at, " selftest 10") + 12;
}

void test_each_reason_is_told_by_its_name_and_what_finds_no_room_is_told_in_the_next_line(void)
{
#define EACH_NAME(bit, name, cause, remedy) { (bit), #name },
    static const struct {
        uint16_t bit;
        const char *name;
    } names[] = { DRIVE_LIMIT_TABLE(EACH_NAME) };
    uint16_t lines = 0;
    for (uint16_t n = 0; n < sizeof names / sizeof names[0]; n++) {
        char text[64] = "state 0 fault NONE speed 0 rpm limit ";
        if (names[n].bit == LIMIT_TEMPERATURE) { /* not in this build: test_heat_board.c */
            continue;
        }
        LimitParm.seen = names[n].bit;
        sent_count = 0;
        status_tick(500);
        send_passes(100);
        TEST_ASSERT_EQUAL_STRING(strcat(strcat(text, names[n].name), "\r\n"), sent);
        TEST_ASSERT_LESS_OR_EQUAL(sizeof LONGEST_LIMIT - sizeof " ", strlen(names[n].name));
    }
    selftest_put_Stub(a_selftest);
    board_drive.state = 32767;
    board_drive.fault = FAULT_OVERTEMPERATURE; /* the longest name */
    board_drive.run.estimator.omega_filtered_q16 = -32767L * 65536;
    LimitParm.seen = (1u << (sizeof names / sizeof names[0])) - 1u;
    while (LimitParm.seen != 0u) {
        sent_count = 0;
        status_tick(500);
        send_passes(200);
        TEST_ASSERT_TRUE(sent_count < sizeof sent_line);
        TEST_ASSERT_EQUAL_STRING(" selftest 10\r\n", sent + sent_count - 14);
        lines++;
    }
    TEST_ASSERT_EQUAL_UINT16(2, lines);
}

static void expect_first_line(uint16_t rcon, const char *text)
{
    setUp();
    board_reset_cause = rcon;
    status_init();
    send_passes(60);
    TEST_ASSERT_EQUAL_STRING(text, sent);
}

void test_first_line_tells_the_version_and_the_cause_of_the_reset(void)
{
    expect_first_line(0x0003u, "foc33 " FOC33_VERSION " reset BOR POR\r\n");
    expect_first_line(0x0010u, "foc33 " FOC33_VERSION " reset WDTO\r\n");
    expect_first_line(0x0200u, "foc33 " FOC33_VERSION " reset CM\r\n");
    expect_first_line(0xFFFFu, "foc33 " FOC33_VERSION " reset TRAPR IOPUWR CM EXTR SWR WDTO BOR POR\r\n");
    TEST_ASSERT_TRUE(sizeof sent_line > strlen(sent));
}

void test_a_character_a_pass_is_sent_from_the_first_lines_time_on(void)
{
    status_tick(499);
    send_passes(10);
    TEST_ASSERT_EQUAL_UINT16(0, sent_count);
    status_tick(1);
    send_passes(1);
    TEST_ASSERT_EQUAL_STRING("s", sent);
    send_passes(1);
    TEST_ASSERT_EQUAL_STRING("st", sent);
}

void test_lines_follow_every_500_ms(void)
{
    uint16_t ms, lines = 0, n;
    for (ms = 0; ms < 2500u; ms++) {
        status_tick(1);
        send_passes(4);
        if (sent_count > 100u) {
            break;
        }
    }
    for (n = 0; n < sent_count; n++) {
        lines = (uint16_t)(lines + (sent[n] == '\n'));
    }
    TEST_ASSERT_EQUAL_UINT16(3, lines); /* 29 characters each, the fourth is under way */
    TEST_ASSERT_UINT16_WITHIN(3, 2000, ms);
}

void test_full_transmitter_loses_no_character(void)
{
    uint16_t n;
    status_tick(500);
    for (n = 0; n < 40u; n++) {
        U1STAbits.UTXBF = 1;
        send_passes(3);
        U1STAbits.UTXBF = 0;
        send_passes(1);
    }
    TEST_ASSERT_EQUAL_STRING("state 0 fault NONE speed 0 rpm\r\n", sent);
}

void test_a_line_that_is_not_out_yet_is_not_overwritten(void)
{
    status_tick(500);
    send_passes(8);
    board_drive.fault = FAULT_STALL;
    status_tick(500);
    send_passes(60);
    TEST_ASSERT_EQUAL_STRING("state 0 fault NONE speed 0 rpm\r\n", sent);
    status_tick(1);
    send_passes(60);
    TEST_ASSERT_EQUAL_STRING("state 0 fault NONE speed 0 rpm\r\nstate 0 fault STALL speed 0 rpm\r\n", sent);
}

void test_init_drops_a_half_sent_line(void)
{
    status_tick(500);
    send_passes(5);
    status_init();
    send_passes(20);
    TEST_ASSERT_EQUAL_STRING("state", sent);
}
