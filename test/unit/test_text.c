/* Text and decimal numbers: every number of digits, both signs, the ends of the words, and nothing written behind the text. */
#include "board/status.h"
#include "drive/faults.h"

#include "unity.h"

#include <string.h>

/** The text that ends at `end`, up to which `buffer` was written. */
static void expect_text(const char *text, const char *buffer, const char *end)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(strlen(text), end - buffer, text);
    TEST_ASSERT_EQUAL_STRING_LEN(text, buffer, strlen(text));
    TEST_ASSERT_EQUAL_CHAR_MESSAGE('#', *end, text);
}

void test_texts_and_numbers_end_where_the_next_one_begins(void)
{
    static const struct {
        const char *text;
        int32_t number;
    } cases[] = {
        { "0", 0 }, { "7", 7 }, { "10", 10 }, { "909", 909 }, { "1234", 1234 }, { "32767", 32767 }, { "65535", 65535 }, { "-1", -1 }
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        char buffer[8] = "#######";
        expect_text(cases[n].text, buffer, text_put(buffer, cases[n].text));
        memset(buffer, '#', sizeof buffer);
        if (cases[n].number >= 0) {
            expect_text(cases[n].text, buffer, text_put_unsigned(buffer, (uint16_t)cases[n].number));
            memset(buffer, '#', sizeof buffer);
        }
        if (cases[n].number <= INT16_MAX) {
            expect_text(cases[n].text, buffer, text_put_named(buffer, "", (int16_t)cases[n].number));
        }
    }
}

#define EACH_FAULT(code, name, passes, by, cause, remedy) { (code), "fault " #name },

void test_a_fault_is_told_by_its_name_and_what_is_none_as_unknown(void)
{
    static const struct {
        uint16_t code;
        const char *text;
    } faults[] = { DRIVE_FAULT_TABLE(EACH_FAULT){ FAULT_COUNT, "fault UNKNOWN" }, { 32767, "fault UNKNOWN" }, { 65535, "fault UNKNOWN" } };
    for (unsigned n = 0; n < sizeof faults / sizeof faults[0]; n++) {
        const uint16_t no_sensor = (uint16_t)(faults[n].code >= FAULT_MOTOR_HOT && faults[n].code <= FAULT_NTC_SENSOR); /* test_heat_board.c tells them */
        char buffer[32];
        memset(buffer, '#', sizeof buffer);
        expect_text(no_sensor ? "fault " : faults[n].text, buffer, text_put_fault(buffer, "fault ", faults[n].code));
    }
}
