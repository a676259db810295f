/* BRINGUP's lines on the serial line, and the pins that they are sent by. */
/* defines: -DBRINGUP */
#include "hurst_params.h"

#include "firmware/board/modes/mode_board.c"

#include "board/modes/mode_board.h"
#include "unity.h"

#include "law.c"

#define EACH(n, table) for (uint16_t n = 0; n < sizeof(table) / sizeof(table)[0]; n++)

static char line[MODE_LINE_SIZE];
static bringup_message_t *const message = &board_bringup.message;

void setUp(void)
{
    static const bringup_guide_t zero;
    board_bringup = zero;
    host_registers_reset();
}

void tearDown(void)
{
}

static void set(bringup_kind_t kind, uint16_t code, uint16_t part, int32_t value, int32_t low, int32_t high)
{
    bringup_message_t m = { (uint16_t)kind, code, part, value, low, high };
    *message = m;
}

void test_each_kind_of_line(void)
{
    static const struct {
        bringup_message_t m;
        const char *text;
    } cases[] = {
        { { BRINGUP_SILENT, 0, 0, 0, 0, 0 }, "" },
        { { BRINGUP_ASKS, BRINGUP_ASK_BEGIN, 0, 0, 0, 0 }, "ask BEGIN: foc33 BRINGUP, sent by RC3. Press S2\r\n" },
        { { BRINGUP_ASKS, BRINGUP_ASK_BEGIN, 1, 0, 0, 0 }, "ask BEGIN: foc33 BRINGUP, sent by RC5. Press S2\r\n" },
        { { BRINGUP_ASKS, BRINGUP_ASK_AMMETER, 0, 538, 0, 0 },
          "ask AMMETER: an ammeter in wire A shows 0.538 A within 10 %? S2 = yes or no ammeter, S3 = no\r\n" },
        { { BRINGUP_TELLS, BRINGUP_VALUE_BUS, 0, 2398, 2160, 2640 }, "ok BUS: bus 23.98 V, expected 21.60 .. 26.40 V\r\n" },
        { { BRINGUP_TELLS, BRINGUP_VALUE_BUS, 0, 2641, 2160, 2640 }, "WRONG BUS: bus 26.41 V, expected 21.60 .. 26.40 V\r\n" },
        { { BRINGUP_TELLS, BRINGUP_VALUE_BUS, 0, 2160, 2160, 2640 }, "ok BUS: bus 21.60 V, expected 21.60 .. 26.40 V\r\n" },
        { { BRINGUP_TELLS, BRINGUP_VALUE_BUS, 0, 2640, 2160, 2640 }, "ok BUS: bus 26.40 V, expected 21.60 .. 26.40 V\r\n" },
        { { BRINGUP_TELLS, BRINGUP_VALUE_BUS, 0, 2159, 2160, 2640 }, "WRONG BUS: bus 21.59 V, expected 21.60 .. 26.40 V\r\n" },
        { { BRINGUP_TELLS, BRINGUP_VALUE_OFFSET, 1, -7, -550, 550 }, "ok OFFSET B: offset of current B -0.007 A, expected -0.550 .. 0.550 A\r\n" },
        { { BRINGUP_TELLS, BRINGUP_VALUE_POLE_PAIRS, 0, 4, 5, 5 }, "WRONG POLE_PAIRS: electrical turns of one turn of the shaft 4, expected 5\r\n" },
        { { BRINGUP_TELLS, BRINGUP_VALUE_RESISTANCE, 0, 60000, 0, 60100 },
          "ok RESISTANCE: phase resistance with bridge 60.000 ohm, expected 0.000 .. 60.100 ohm\r\n" },
        { { BRINGUP_SHOWS, 1, 0, 353, -407, 411 }, "see -C: 3.53 V, current A -0.407 A, B 0.411 A, expected 1 : 1\r\n" },
        { { BRINGUP_FINDS, BRINGUP_PHASE_OPEN, 2, 0, 0, 0 }, "FIX PHASE_OPEN C: the wire of phase C, or its driver\r\n" },
        { { BRINGUP_FINDS, BRINGUP_FAULT, 0, 9, 0, 0 }, "FIX FAULT: the drive stopped with the fault OFFSET of docs/faults.md\r\n" },
        { { BRINGUP_ENDS, 0, 0, 3, 0, 0 }, "end: findings 3\r\n" },
    };
    EACH(n, cases) {
        *message = cases[n].m;
        *bringup_line(line) = '\0';
        TEST_ASSERT_EQUAL_STRING(cases[n].text, line);
        TEST_ASSERT_EQUAL_UINT16(BRINGUP_SILENT, message->kind);
    }
}

void test_the_longest_lines_fit(void)
{
    uint16_t code;
    for (code = 0; code < (uint16_t)BRINGUP_FINDINGS; code++) {
        set(BRINGUP_FINDS, code, 2, 65535, 0, 0);
        TEST_ASSERT_TRUE(bringup_line(line) < line + sizeof line);
    }
    for (code = 0; code < (uint16_t)BRINGUP_VALUES; code++) {
        set(BRINGUP_TELLS, code, 1, -65535, -65535, -65534);
        TEST_ASSERT_TRUE(bringup_line(line) < line + sizeof line);
    }
    for (code = 0; code < (uint16_t)BRINGUP_QUESTIONS; code++) {
        set(BRINGUP_ASKS, code, 1, 65535, 0, 0);
        TEST_ASSERT_TRUE(bringup_line(line) < line + sizeof line);
    }
}

void test_lines_go_out_by_one_pin_the_other_or_both(void)
{
    static const uint16_t first[3] = { 3, 0, 3 }, other[3] = { 0, 3, 3 };
    uint16_t sender;
    for (sender = 0; sender <= BRINGUP_LINES_BOTH; sender++) {
        board_bringup.sender = sender;
        set(BRINGUP_ENDS, 0, 0, 0, 0, 0);
        (void)bringup_line(line);
        TEST_ASSERT_EQUAL_UINT16(first[sender], RPOR9bits.RP19R);
        TEST_ASSERT_EQUAL_UINT16(other[sender], RPOR10bits.RP21R);
    }
}
