/* The scope: rows of variables, their rhythm, the trigger and what is kept around it, and settings that are refused. */
/* defines: -DSCOPE=1 */
#include "lnet_rig.h"

#include "firmware/board/scope.c"

static uint8_t setting[100];
static uint16_t setting_size;
static uint8_t channels = 4;

static void put_bytes(const uint8_t *bytes, uint16_t count)
{
    memcpy(setting + setting_size, bytes, count);
    setting_size = (uint16_t)(setting_size + count);
}
#define put(...) put_bytes((const uint8_t[]){ __VA_ARGS__ }, sizeof((const uint8_t[]){ __VA_ARGS__ }))

/** The begin of a setting: service, parameter, state, channels, periods less one; and its channels, neighbours of `bytes` each. */
static void set_channels(uint8_t state, uint8_t count, uint16_t factor, uint8_t bytes)
{
    uint16_t n;
    setting_size = 0;
    put(18, 1, 0, state, count, LOW(factor));
    for (n = 0; n < count; n++) {
        put(0, LONG(ADDRESS(variable[0]) + n * bytes), bytes);
    }
}

/** The end: a trigger on variable 0. @param type 0x82 unsigned, 0xA2 signed @param before bytes that are kept */
static void set_trigger(uint8_t type, int16_t level, int32_t before, uint8_t rises, uint8_t mode)
{
    put(type, 0, LONG(ADDRESS(variable[0])), LOW(level), LONG(before), rises, mode);
}

static uint8_t start(void)
{
    return rig_ask_of(setting, setting_size);
}

static uint8_t record(uint8_t count, uint16_t factor)
{
    set_channels(SCOPE_AUTO, count, factor, 2);
    set_trigger(0x82, 0, 0, 1, 0);
    return start();
}

/** A period in which variable 0 has this value. */
static void period(int16_t value)
{
    variable[0] = value;
    scope_tick(&board_lnet.scope, board_scope_array);
}

/** It looks for the trigger. */
static void expect_looks(void)
{
    TEST_ASSERT_EQUAL_INT16(SCOPE_LOOKS_UNUSUAL, board_lnet.scope.mode);
}

/** The trigger has come with the last row. */
static void expect_triggered(void)
{
    TEST_ASSERT_EQUAL_INT16(SCOPE_TRIGGERED, board_lnet.scope.mode);
    TEST_ASSERT_EQUAL_UINT16(SCOPE_ARRAY_WORDS - 1u, board_lnet.scope.left);
}

static uint16_t long_at(uint16_t at)
{
    TEST_ASSERT_EQUAL_HEX8(0, answered[at + 2u]);
    return (uint16_t)(answered[at] | answered[at + 1u] << 8);
}

static uint16_t state(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(17, 1, 0));
    TEST_ASSERT_EQUAL_UINT16(31, answered_size);
    TEST_ASSERT_EQUAL_HEX8(0x82, answered[30]);
    TEST_ASSERT_EQUAL_UINT16(ADDRESS(board_scope_array), long_at(10));
    return answered[2];
}

void setUp(void)
{
    rig_up();
    memset(board_scope_array, 0x11, sizeof board_scope_array);
}

void test_nothing_is_recorded_before_it_is_asked_for(void)
{
    period(1);
    TEST_ASSERT_EQUAL_HEX16(0x1111, board_scope_array[0]);
    TEST_ASSERT_EQUAL_UINT16(SCOPE_IDLE, state());
    TEST_ASSERT_EACH_EQUAL_UINT8(0, answered + 2, 8); /* neither channels nor a place */
    TEST_ASSERT_EACH_EQUAL_UINT8(0, answered + 14, 8);
    TEST_ASSERT_EQUAL_UINT16(SCOPE_BYTES, long_at(26));
}

void test_four_channels_are_recorded_until_the_array_is_full(void)
{
    uint16_t n, rows = SCOPE_ARRAY_WORDS / 4u;
    TEST_ASSERT_EQUAL_UINT8(0, record(4, 0));
    for (n = 0; n < rows; n++) {
        TEST_ASSERT_EQUAL_UINT16(SCOPE_AUTO, state());
        TEST_ASSERT_EQUAL_UINT16(8u * n, long_at(6));
        period((int16_t)n);
    }
    TEST_ASSERT_EQUAL_UINT16(SCOPE_IDLE, state());
    TEST_ASSERT_EQUAL_UINT8(4, answered[3]);
    TEST_ASSERT_EQUAL_UINT16(0, long_at(6));
    TEST_ASSERT_EQUAL_UINT16(8u * rows, long_at(22));
    TEST_ASSERT_EQUAL_UINT16(8u * rows, long_at(26));
    for (n = 0; n < rows; n++) {
        TEST_ASSERT_EQUAL_INT16((int16_t)n, board_scope_array[4u * n]);
        TEST_ASSERT_EQUAL_INT16_ARRAY(&variable[1], &board_scope_array[4u * n + 1u], 3);
    }
    period(77);
    TEST_ASSERT_EQUAL_INT16(0, board_scope_array[0]);
}

/** Rows of any length: whole ones, and nothing behind the array. */
void test_one_to_eight_channels(void)
{
    for (channels = 1; channels <= 8u; channels++) {
        uint16_t n, rows = (uint16_t)(SCOPE_ARRAY_WORDS / channels);
        TEST_ASSERT_EQUAL_UINT8(0, record(channels, 0));
        for (n = 0; n < rows; n++) {
            TEST_ASSERT_EQUAL_UINT16(SCOPE_AUTO, board_lnet.scope.mode);
            period((int16_t)n);
        }
        TEST_ASSERT_EQUAL_UINT16(SCOPE_IDLE, state());
        TEST_ASSERT_EQUAL_UINT16(2u * channels * rows, long_at(26));
        for (n = 0; n < rows; n++) {
            TEST_ASSERT_EQUAL_INT16((int16_t)n, board_scope_array[n * channels]);
            TEST_ASSERT_EQUAL_INT(0, memcmp(&variable[1], &board_scope_array[n * channels + 1u], 2u * channels - 2u));
        }
    }
    channels = 4;
}

void test_a_long_variable_takes_two_words(void)
{
    set_channels(SCOPE_AUTO, 4, 0, 4);
    set_trigger(0x82, 0, 0, 1, 0);
    TEST_ASSERT_EQUAL_UINT8(0, start());
    period(5);
    TEST_ASSERT_EQUAL_INT16_ARRAY(variable, board_scope_array, 8);
    set_channels(SCOPE_AUTO, 5, 0, 4);
    set_trigger(0x82, 0, 0, 1, 0);
    TEST_ASSERT_EQUAL_UINT8(20, start());
}

void test_a_row_every_so_many_periods(void)
{
    int16_t n;
    TEST_ASSERT_EQUAL_UINT8(0, record(1, 2));
    for (n = 0; n < 30; n++) {
        period(n);
    }
    for (n = 0; n < 10; n++) {
        TEST_ASSERT_EQUAL_INT16(3 * n, board_scope_array[n]);
    }
    TEST_ASSERT_EQUAL_INT16(0x1111, board_scope_array[10]);
    TEST_ASSERT_EQUAL_UINT16(SCOPE_AUTO, state());
    TEST_ASSERT_EQUAL_UINT8(2, answered[4]);
}

/* ---- trigger ---- */

/** Starts with a trigger on the channels and lets the variable climb (or fall) from 0 until the scope has ended. @return its value at the end */
static int16_t run_to_trigger(uint8_t type, int16_t level, int32_t before_rows, uint8_t rises, int16_t step)
{
    int16_t value = 0;
    set_channels(SCOPE_TRIGGERED, channels, 0, 2);
    set_trigger(type, level, before_rows * 2 * channels, rises, 1);
    TEST_ASSERT_EQUAL_UINT8(0, start());
    for (value = 0; board_lnet.scope.mode != SCOPE_IDLE; value = (int16_t)(value + step)) {
        TEST_ASSERT_TRUE(value < 30000 && value > -30000);
        period(value);
    }
    TEST_ASSERT_EQUAL_UINT16(SCOPE_IDLE, state());
    return value;
}

/** The rows as a client puts them into order: what is kept begins `before` bytes before the trigger's row; without such, at the array's begin. */
static void expect_rows(int16_t first, int16_t step, uint16_t before_rows)
{
    uint16_t row = (uint16_t)(2u * channels), rows = (uint16_t)(long_at(26) / row), event = (uint16_t)(long_at(18) / row), n;
    uint16_t begin = (uint16_t)((uint16_t)(event + rows - before_rows) % rows);
    for (n = 0; n < rows; n++) {
        const int16_t *at = &board_scope_array[(uint16_t)(begin + n) % rows * channels];
        TEST_ASSERT_EQUAL_INT16(first + (int16_t)n * step, at[0]);
        TEST_ASSERT_EQUAL_INT(0, memcmp(&variable[1], &at[1], row - 2u));
    }
    TEST_ASSERT_EQUAL_UINT16(begin * row, long_at(6)); /* the next row would be the oldest one's place */
}

void test_the_triggers_row_is_the_first(void)
{
    (void)run_to_trigger(0xA2, 500, 0, 1, 1);
    expect_rows(500, 1, 0);
    (void)run_to_trigger(0xA2, -500, 0, 0, -1);
    expect_rows(-500, -1, 0);
}

void test_rows_before_the_trigger_are_kept(void)
{
    for (channels = 1; channels <= 8u; channels++) {
        const uint16_t kept[] = { 1, 10, (uint16_t)(SCOPE_ARRAY_WORDS / channels - 1u) };
        uint16_t n;
        for (n = 0; n < sizeof kept / sizeof kept[0]; n++) {
            (void)run_to_trigger(0xA2, 500, kept[n], 1, 1);
            expect_rows((int16_t)(500 - kept[n]), 1, kept[n]);
        }
    }
    channels = 4;
}

/** It must not come before the rows that are to be kept are there. */
void test_a_trigger_that_comes_too_early_is_waited_for_again(void)
{
    int16_t n;
    set_channels(SCOPE_TRIGGERED, 4, 0, 2);
    set_trigger(0xA2, 500, 20 * 8, 1, 1);
    TEST_ASSERT_EQUAL_UINT8(0, start());
    for (n = 0; n < 19; n++) {
        period((n < 10) ? 0 : 600);
    }
    for (n = 0; n < 300; n++) {
        period(600);
    }
    TEST_ASSERT_EQUAL_UINT16(SCOPE_TRIGGERED, state());
    for (n = 499; board_lnet.scope.mode != SCOPE_IDLE; n++) {
        period(n);
    }
    TEST_ASSERT_EQUAL_UINT16(SCOPE_IDLE, state());
    TEST_ASSERT_EQUAL_INT16(500, board_scope_array[long_at(18) / 2u]);
}

void test_rows_after_the_trigger_are_left_out(void)
{
    static const uint16_t skipped[] = { 1, 10, SCOPE_ARRAY_WORDS / 4u - 1u, SCOPE_ARRAY_WORDS / 4u, SCOPE_ARRAY_WORDS / 4u + 1u, 3000 };
    uint16_t n, rows = SCOPE_ARRAY_WORDS / 4u, row;
    for (n = 0; n < sizeof skipped / sizeof skipped[0]; n++) {
        (void)run_to_trigger(0xA2, 500, -(int32_t)skipped[n], 1, 1);
        TEST_ASSERT_EQUAL_UINT16(0, long_at(6));
        for (row = 0; row < rows; row++) {
            TEST_ASSERT_EQUAL_INT16(500 + skipped[n] + row, board_scope_array[4u * row]);
        }
    }
}

/** In bytes; positive is before the trigger, as in the request. */
void test_the_delay_is_told_as_it_was_asked_for(void)
{
    static const int16_t delays[] = { 0, 8, 160, -8, -800, -32768 };
    uint16_t n;
    for (n = 0; n < sizeof delays / sizeof delays[0]; n++) {
        set_channels(SCOPE_TRIGGERED, 4, 0, 2);
        set_trigger(0xA2, 500, delays[n], 1, 1);
        TEST_ASSERT_EQUAL_UINT8(0, start());
        TEST_ASSERT_EQUAL_UINT16(SCOPE_TRIGGERED, state());
        TEST_ASSERT_EQUAL_HEX8_ARRAY(((uint8_t[]){ LONG(delays[n]) }), answered + 14, 4);
    }
}

void test_unsigned_variables_are_compared_as_such(void)
{
    int16_t n;
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0x82, (int16_t)0x9000, 0, 1, 1);
    TEST_ASSERT_EQUAL_UINT8(0, start());
    for (n = 0; n < 10; n++) {
        period(0x7000);
    }
    expect_looks();
    period((int16_t)0x9000);
    expect_triggered();
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0x82, 0x7000, 0, 0, 1);
    TEST_ASSERT_EQUAL_UINT8(0, start());
    period((int16_t)0x9000);
    expect_looks();
    period(0x7000);
    expect_triggered();
}

void test_a_level_that_has_always_been_passed_is_no_trigger(void)
{
    int16_t n;
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0xA2, 5, 0, 1, 1);
    TEST_ASSERT_EQUAL_UINT8(0, start());
    for (n = 0; n < 2000; n++) {
        period(10);
    }
    TEST_ASSERT_EQUAL_UINT16(SCOPE_TRIGGERED, state());
    period(4);
    period(5);
    expect_triggered();
}

/** The lowest level cannot be risen to, nor the highest be fallen to: there is no other side. */
void test_a_level_without_another_side_is_no_trigger(void)
{
    static const struct {
        uint8_t type;
        int16_t level;
        uint8_t rises;
    } without[] = { { 0xA2, INT16_MIN, 1 }, { 0xA2, INT16_MAX, 0 }, { 0x82, 0, 1 }, { 0x82, -1, 0 } };
    uint16_t n;
    for (n = 0; n < 4u; n++) {
        set_channels(SCOPE_TRIGGERED, 1, 0, 2);
        set_trigger(without[n].type, without[n].level, 0, without[n].rises, 1);
        TEST_ASSERT_EQUAL_UINT8(0, start());
        period(without[n].level);
        period((int16_t)~without[n].level);
        period(without[n].level);
        expect_looks();
    }
}

void test_the_outermost_levels_are_reached(void)
{
    static const struct {
        uint8_t type;
        int16_t level;
        uint8_t rises;
    } reached[] = { { 0xA2, INT16_MAX, 1 }, { 0xA2, INT16_MIN, 0 }, { 0x82, -1, 1 }, { 0x82, 0, 0 } };
    uint16_t n;
    for (n = 0; n < 4u; n++) {
        set_channels(SCOPE_TRIGGERED, 1, 0, 2);
        set_trigger(reached[n].type, reached[n].level, 0, reached[n].rises, 1);
        TEST_ASSERT_EQUAL_UINT8(0, start());
        period((int16_t)(reached[n].level ^ 1));
        expect_looks();
        period(reached[n].level);
        expect_triggered();
    }
}

void test_a_trigger_that_is_switched_off_is_none(void)
{
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0xA2, 5, 0, 1, 0);
    TEST_ASSERT_EQUAL_UINT8(0, start());
    period(3);
    TEST_ASSERT_EQUAL_INT16(3, board_scope_array[0]);
    TEST_ASSERT_EQUAL_UINT16(SCOPE_ARRAY_WORDS - 1u, board_lnet.scope.left);
}

/* ---- what is refused ---- */

void test_a_client_stops_the_scope(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, record(1, 0));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(18, 1, 0, 0));
    TEST_ASSERT_EQUAL_UINT16(SCOPE_IDLE, state());
    period(3);
    TEST_ASSERT_EQUAL_HEX16(0x1111, board_scope_array[0]);
}

#define USED 22
#define SIZE 26

/** A client that does not look at the error is ready at once, and there is nothing to read. */
static void expect_refused(void)
{
    TEST_ASSERT_EQUAL_UINT8(20, start());
    TEST_ASSERT_EQUAL_UINT16(SCOPE_IDLE, state());
    TEST_ASSERT_EQUAL_UINT32(0, long_at(USED));
    TEST_ASSERT_EQUAL_UINT32(0, long_at(SIZE));
    TEST_ASSERT_EQUAL_UINT32(0, long_at(6)); /* the next row's place is the used bytes' end: ready */
    period(3);
    TEST_ASSERT_EQUAL_HEX16(0x1111, board_scope_array[0]);
}

void test_settings_that_the_scope_cannot_have_are_refused(void)
{
    TEST_ASSERT_EQUAL_UINT8(20, record(0, 0));
    TEST_ASSERT_EQUAL_UINT8(20, record(9, 0));
    set_channels(SCOPE_AUTO, 1, 0, 1);
    set_trigger(0x82, 0, 0, 1, 0);
    expect_refused();
    set_channels(SCOPE_AUTO, 1, 0, 6);
    set_trigger(0x82, 0, 0, 1, 0);
    expect_refused();
    set_channels(SCOPE_AUTO, 4, 0, 4);
    setting[4] = 5; /* a ninth word */
    put(0, LONG(ADDRESS(variable[20])), 2);
    set_trigger(0x82, 0, 0, 1, 0);
    expect_refused();
    set_channels(SCOPE_AUTO, 1, 0, 2);
    set_trigger(0x82, 0, 0, 1, 0);
    put(0); /* one too many */
    expect_refused();
    set_channels(SCOPE_AUTO, 2, 0, 3);
    set_trigger(0x82, 0, 0, 1, 0);
    expect_refused();
    set_channels(SCOPE_AUTO, 1, 0, 2);
    expect_refused(); /* its end is missing */
    set_channels(3, 1, 0, 2);
    set_trigger(0x82, 0, 0, 1, 0);
    expect_refused();
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0xC2, 0, 0, 1, 1); /* a float */
    expect_refused();
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0x84, 0, 0, 1, 1); /* four bytes, with two of them missing */
    expect_refused();
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0x82, 0, 2 * SCOPE_ARRAY_WORDS, 1, 1); /* no room for the trigger's row */
    expect_refused();
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0x82, 0, -40000, 1, 1);
    expect_refused();
    set_channels(SCOPE_TRIGGERED, 1, 0, 2);
    set_trigger(0x82, 0, 0x10000, 1, 1);
    expect_refused();
}

void test_after_a_refused_setting_a_good_one_and_a_client_that_connects_see_the_whole_array_again(void)
{
    TEST_ASSERT_EQUAL_UINT8(20, record(9, 0));
    TEST_ASSERT_EQUAL_UINT8(0, record(1, 0));
    (void)state();
    TEST_ASSERT_EQUAL_UINT32(2u * SCOPE_ARRAY_WORDS, long_at(SIZE));
    TEST_ASSERT_EQUAL_UINT8(20, record(9, 0));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
    TEST_ASSERT_EQUAL_UINT16(SCOPE_IDLE, state());
    TEST_ASSERT_EQUAL_UINT32(2u * SCOPE_ARRAY_WORDS, long_at(SIZE));
    TEST_ASSERT_EQUAL_UINT8(0, record(1, 0));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
    TEST_ASSERT_EQUAL_UINT16(SCOPE_AUTO, state()); /* a record that runs goes on */
}

void test_addresses_that_cannot_be_recorded_are_refused(void)
{
    static const uint32_t bad[] = { 0x02C2, 0x0000, 0xFFFE, 0x00010800, 0x80000800 };
    uint16_t n;
    for (n = 0; n < sizeof bad / sizeof bad[0]; n++) {
        setting_size = 0;
        put(18, 1, 0, SCOPE_AUTO, 1, 0, 0, 0, LONG(bad[n]), 2);
        set_trigger(0x82, 0, 0, 1, 0);
        expect_refused();
        set_channels(SCOPE_TRIGGERED, 1, 0, 2);
        put(0x82, 0, LONG(bad[n]), 0, 0, 0, 0, 0, 0, 1, 1);
        expect_refused();
    }
    setting_size = 0;
    put(18, 1, 0, SCOPE_AUTO, 1, 0, 0, 0, LONG(ADDRESS(variable[0]) + 1u), 2);
    set_trigger(0x82, 0, 0, 1, 0);
    expect_refused();
}
