/* defines: -DAPP_SERIAL=1 */
/* The application text: what each line does, what is answered, and what happens when the lines stay away. With the board's part of the line. */
#include "firmware/board/app_calls.c"

#include "firmware/app/text.c"

#include "app_rig.h"

#include <string.h>

static const char *coming;
static char sent[APP_LINE_SIZE + 3];

/** Instead of status.c's and the UART's. */
int16_t uart_receive(void)
{
    return (int16_t)((*coming != '\0') ? *coming++ : -1);
}

int16_t status_rpm(speed_erpm_t speed)
{
    return (int16_t)((int32_t)speed * SPEED_UNIT / NOPOLESPAIRS);
}

char *text_put(char *at, const char *text)
{
    size_t size = strlen(text);
    memcpy(at, text, size);
    return at + size;
}

char *text_end(char *at)
{
    return text_put(at, "\r\n");
}

char *text_put_named(char *at, const char *name, int16_t number)
{
    char *next = text_put(at, name);
    if (number < 0) {
        *next++ = '-';
    }
    if (qm_abs(number) > 9) {
        next = text_put_named(next, "", (int16_t)(qm_abs(number) / 10));
    }
    *next++ = (char)('0' + qm_abs(number) % 10);
    return next;
}

char *text_put_fault(char *at, const char *before, uint16_t fault)
{
    return text_put(text_put(at, before), fault ? "STALL" : "NONE");
}

/** A line comes, one character a pass; the application is called. @return what is sent */
static const char *says(const char *line)
{
    coming = line;
    do {
        app_line_hear();
    } while (*coming != '\0' && !is_heard);
    told.heard = app_line_heard();
    asks.say = 0;
    rig_ms();
    app_line_say(asks.say);
    memset(sent, 0, sizeof sent);
    *app_line_next(sent) = '\0';
    return sent;
}

void setUp(void)
{
    rig_fresh();
    told.slow.low = APP_RPM(200);
    told.fast.high = APP_RPM(5000);
    app_line_init();
    coming = "";
}

void tearDown(void)
{
}

void test_run_starts_and_stop_stops(void)
{
    TEST_ASSERT_EQUAL_STRING("ok run 0 speed 0 fault NONE*6A\r\n", says("run*69\n"));
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
    told.is_running = 1;
    told.speed_erpm = APP_RPM(-1500);
    TEST_ASSERT_EQUAL_STRING("ok run 1 speed -1500 fault NONE*72\r\n", says("stop*18\r\n"));
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
}

void test_speed_sets_the_target_with_its_direction(void)
{
    (void)says("speed 1500*43\n");
    TEST_ASSERT_EQUAL_INT16(APP_RPM(1500), asks.target_erpm);
    (void)says("speed -1500*6E\n");
    TEST_ASSERT_EQUAL_INT16(APP_RPM(-1500), asks.target_erpm);
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0, asks.run, "a speed alone starts nothing");
}

void test_a_speed_outside_the_range_changes_nothing(void)
{
    static const char *const lines[] = { "speed 5001*43\n", "speed 199*76\n", "speed -5001*6E\n" };
    (void)says("speed 1500*43\n");
    EACH(n, lines) {
        TEST_ASSERT_EQUAL_STRING_LEN("range ", says(lines[n]), 6);
        TEST_ASSERT_EQUAL_INT16(APP_RPM(1500), asks.target_erpm);
    }
}

void test_the_fault_is_told_by_a_line_of_its_own_as_by_each_other(void)
{
    TEST_ASSERT_EQUAL_STRING_LEN("ok run 0 speed 0 fault NONE*", says("fault*6A\n"), 28);
    told.fault = (uint16_t)FAULT_STALL;
    TEST_ASSERT_EQUAL_STRING_LEN("ok run 0 speed 0 fault STALL*", says("fault*6A\n"), 29);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
}

void test_a_line_that_is_no_command_is_unknown(void)
{
    static const char *const lines[] = { "hello*62\n", "speed*67\n", "speed *47\n", "speed 15x*3B\n", "speed -*6A\n", "speed 99999*7E\n", "runs*1A\n", "*00\n" };
    EACH(n, lines) {
        TEST_ASSERT_EQUAL_STRING_LEN("unknown ", says(lines[n]), 8);
        TEST_ASSERT_EQUAL_INT16(0, asks.run);
    }
}

void test_a_line_without_its_checksum_does_nothing(void)
{
    static const char *const lines[] = { "run\n", "run*68\n", "run*6\n", "run*699\n", "run*\n", "ruN*69\n", "run*69*69\n",
                                         "run and so on and on, much longer than any line that the board has room for*69\n" };
    EACH(n, lines) {
        TEST_ASSERT_EQUAL_STRING_LEN("checksum ", says(lines[n]), 9);
        TEST_ASSERT_EQUAL_INT16(0, asks.run);
    }
}

void test_empty_lines_are_not_answered(void)
{
    TEST_ASSERT_EQUAL_STRING("", says("\r\n\n"));
}

void test_without_lines_the_motor_stops_after_two_seconds(void)
{
    uint16_t ms = 0;
    (void)says("run*69\n");
    told.heard = 0;
    while (asks.run && ms < 10000u) {
        rig_ms();
        ms++;
    }
    TEST_ASSERT_UINT16_WITHIN(1, TEXT_SILENT_MS, ms);
    (void)says("status*14\n");
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0, asks.run, "a line that comes later is no start");
}

void test_wrong_lines_do_not_keep_the_motor_running(void)
{
    uint16_t n;
    (void)says("run*69\n");
    for (n = 0; n < TEXT_SILENT_MS; n++) {
        (void)says("status*15\n");
    }
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
}

void test_questions_keep_the_motor_running(void)
{
    uint16_t n;
    (void)says("run*69\n");
    for (n = 0; n < 2u * TEXT_SILENT_MS; n++) {
        (void)says("status*14\n");
    }
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_a_fault_ends_the_run_refuses_another_one_and_clear_clears_it(void)
{
    (void)says("run*69\n");
    told.fault = FAULT_STALL;
    TEST_ASSERT_EQUAL_STRING_LEN("ok ", says("status*14\n"), 3);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    TEST_ASSERT_EQUAL_STRING("refused run 0 speed 0 fault STALL*54\r\n", says("run*69\n"));
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    (void)says("clear*79\n");
    TEST_ASSERT_EQUAL_UINT16(1, asks.clear_fault);
    told.fault = FAULT_NONE;
    TEST_ASSERT_EQUAL_STRING_LEN("ok ", says("status*14\n"), 3);
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0, asks.run, "cleared is not started");
    TEST_ASSERT_EQUAL_UINT16(0, asks.clear_fault);
}

void test_what_comes_while_a_line_waits_stays_in_the_receiver(void)
{
    coming = "run*69\nstop*18\n";
    while (!is_heard) {
        app_line_hear();
    }
    app_line_hear();
    TEST_ASSERT_EQUAL_STRING("stop*18\n", coming);
    TEST_ASSERT_EQUAL_STRING("run*69", app_line_heard());
}

void test_an_answer_that_is_too_long_is_cut_and_not_written_beyond_the_lines_end(void)
{
    static char line[2u * APP_LINE_SIZE];
    static char longer[2u * APP_LINE_SIZE];
    memset(longer, 'x', sizeof longer - 1u);
    app_line_say(longer);
    TEST_ASSERT_EQUAL_PTR(&line[APP_LINE_SIZE + 1u], app_line_next(line));
}
