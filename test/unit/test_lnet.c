/* The serial line's protocol: frames, services, what is refused, and how it finds its way back after anything else. */
/* defines: -DSCOPE=1 */
#include "lnet_rig.h"

#include "firmware/board/scope.c"

/** The last of them, so that the end is not the link's own. */
static int16_t last_variable[8] REACHED = { 1 };

void setUp(void)
{
    rig_up();
}

/* ---- services ---- */

void test_device_info_tells_a_dspic_that_runs(void)
{
    static const uint8_t told[46] = { [2] = 5, [4] = 1, [6] = 255, [7] = 0x10, [8] = 0x82, [35] = 1 };
    memset(line_memory, 0x5A, sizeof line_memory);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
    TEST_ASSERT_EQUAL_UINT16(46, answered_size);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(told, answered, 46);
}

void test_memory_is_read_bytes_in_order(void)
{
    variable[1] = 0x1234;
    variable[2] = 0x0255; /* both need fill bytes */
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(9, LOW(ADDRESS(variable[1])), 4, 2));
    TEST_ASSERT_EQUAL_UINT16(6, answered_size);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((uint8_t[]){ 0x34, 0x12, 0x55, 0x02 }), answered + 2, 4);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(9, LOW(ADDRESS(variable[1]) + 1u), 2, 1));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((uint8_t[]){ 0x12, 0x55 }), answered + 2, 2);
}

/** Longer than the memory for answers: it is fetched piece by piece. */
void test_a_long_answer_is_all_there(void)
{
    static const uint8_t sizes[] = { 1, 2, 3, LNET_ROOM - 5, LNET_ROOM - 4, LNET_ROOM - 3, LNET_ROOM, 253 };
    uint16_t n;
    for (n = 0; n < sizeof sizes; n++) {
        TEST_ASSERT_EQUAL_UINT8(0, rig_ask(9, LOW(ADDRESS(variable[0])), sizes[n], 1));
        TEST_ASSERT_EQUAL_UINT16(sizes[n] + 2u, answered_size);
        TEST_ASSERT_EQUAL_HEX8_ARRAY(variable, answered + 2, sizes[n]);
    }
}

void test_variables_are_written_and_nothing_beside_them(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(10, LOW(ADDRESS(variable[5])), 2, 0x55, 0xAA));
    TEST_ASSERT_EQUAL_HEX16(0xAA55, (uint16_t)variable[5]);
    TEST_ASSERT_EQUAL_INT16(0x0100 + 12, variable[4]);
    TEST_ASSERT_EQUAL_INT16(0x0100 + 18, variable[6]);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(10, LOW(ADDRESS(variable[5]) + 1u), 1, 0x07));
    TEST_ASSERT_EQUAL_HEX16(0x0755, variable[5]);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(10, LOW(ADDRESS(variable[8])), 5, 1, 2, 3, 4, 5));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((uint8_t[]){ 1, 2, 3, 4, 5, 0x01 }), (uint8_t *)&variable[8], 6);
    TEST_ASSERT_EQUAL_UINT16(2, answered_size);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(10, LOW(ADDRESS(variable[12]) + 1u), 2, 6, 7)); /* words at odd addresses are none */
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((uint8_t[]){ 0x24, 6, 7, 0x01 }), (uint8_t *)&variable[12], 4);
}

void test_other_services_are_not_available(void)
{
    uint16_t service;
    for (service = 0; service < 256u; service++) {
        if (service != 0u && service != 9u && service != 10u && service != 17u && service != 18u) {
            TEST_ASSERT_EQUAL_UINT8(33, rig_ask((uint8_t)service, 1, 2, 3));
        }
    }
}

/* ---- what is refused ---- */

void test_requests_of_a_wrong_length_are_refused(void)
{
    uint16_t address = ADDRESS(variable[0]);
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(9, LOW(address), 2));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(9, LOW(address), 2, 1, 0));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(9, LOW(address), 0, 1));
    TEST_ASSERT_EQUAL_UINT8(21, rig_ask(9, LOW(address), 254, 1));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(10, LOW(address), 2, 7));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(10, LOW(address), 2, 7, 7, 7));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(10, LOW(address), 0));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(17, 1));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(17, 2, 0));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(18, 1, 0));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(18, 0, 0, 0));
    TEST_ASSERT_EQUAL_INT16(0x0100, variable[0]);
}

void test_what_is_longer_than_the_memory_for_it_is_refused_by_its_size(void)
{
    uint8_t data[LNET_ROOM] = { 10, LOW(ADDRESS(variable[0])), LNET_ROOM - 6u, 9, 9 }; /* size and node are in that memory, too */
    memset(line_memory + LNET_ROOM, 0x5A, 2);
    TEST_ASSERT_EQUAL_UINT8(21, rig_ask_of(data, LNET_ROOM - 1u));
    TEST_ASSERT_EQUAL_UINT8(21, rig_ask_of(data, LNET_ROOM));
    TEST_ASSERT_EQUAL_INT16(0x0100, variable[0]);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask_of(data, LNET_ROOM - 2u));
    TEST_ASSERT_EQUAL_INT16(0x0909, variable[0]);
    TEST_ASSERT_EACH_EQUAL_HEX8(0x5A, line_memory + LNET_ROOM, 2);
}

/** Two bytes, which keep what they are. */
static void expect_writable(uint16_t address)
{
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(9, LOW(address), 2, 1));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(10, LOW(address), 2, answered[2], answered[3]));
}

void test_addresses_outside_of_the_variables_are_refused(void)
{
    uint16_t end = (uint16_t)(MEMORY_RAM_START + MEMORY_RAM_BYTES), own = ADDRESS(board_lnet);
    static const uint16_t others[] = { 0, 0x02C2, 0x07FE, 0x8000, 0xFFFE };
    uint16_t n;
    for (n = 0; n < sizeof others / sizeof others[0]; n++) {
        TEST_ASSERT_EQUAL_UINT8(20, rig_ask(9, LOW(others[n]), 4, 1));
        TEST_ASSERT_EQUAL_UINT8(20, rig_ask(10, LOW(others[n]), 4, 0, 0, 0, 0));
    }
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(9, LOW(MEMORY_RAM_START - 1u), 2, 1));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(9, LOW(MEMORY_RAM_START), 2, 1));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(9, LOW(end - 2u), 2, 1));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(9, LOW(end - 2u), 3, 1));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(10, LOW(end - 2u), 4, 0, 0, 0, 0));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(10, LOW(ADDRESS(last_variable[7])), 2, 0, 0));
    /* the link's own variables say where the scope writes */
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(10, LOW(own), 2, 0, 0));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(10, LOW(own - 2u), 4, 0, 0, 0, 0));
    TEST_ASSERT_EQUAL_UINT8(20, rig_ask(10, LOW(own + sizeof board_lnet - 1u), 1, 0));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(9, LOW(own), 2, 1));
    expect_writable((uint16_t)(own - 2u));
    expect_writable((uint16_t)(own + sizeof board_lnet));
    expect_writable((uint16_t)(end - 2u));
}

void test_a_wrong_checksum_changes_nothing_and_is_told(void)
{
    const uint8_t request[] = { 10, LOW(ADDRESS(variable[0])), 2, 1, 1 };
    uint16_t error;
    for (error = 1; error < 256u; error++) {
        rig_send_as(sizeof request, 1, request, sizeof request, (uint8_t)error);
        lnet_tick(LNET_QUIET_MS); /* one of the checksums looks like the begin of a frame */
        if (rig_answer()) {
            TEST_ASSERT_EQUAL_UINT16(2, answered_size);
            TEST_ASSERT_EQUAL_UINT8(10, answered[0]);
            TEST_ASSERT_EQUAL_UINT8(19, answered[1]);
        }
        TEST_ASSERT_EQUAL_INT16(0x0100, variable[0]);
    }
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask_of(request, sizeof request));
}

void test_another_node_is_not_answered(void)
{
    const uint8_t request[] = { 10, LOW(ADDRESS(variable[0])), 2, 1, 1 };
    rig_send_as(sizeof request, 3, request, sizeof request, 0);
    TEST_ASSERT_FALSE(rig_answer());
    rig_send_as(sizeof request, 0, request, sizeof request, 0);
    TEST_ASSERT_FALSE(rig_answer());
    TEST_ASSERT_EQUAL_INT16(0x0100, variable[0]);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
}

/* ---- the way back ---- */

void test_a_frame_that_broke_off_is_forgotten_where_the_next_one_begins(void)
{
    const uint8_t request[] = { 9, LOW(ADDRESS(variable[0])), 2, 1 };
    uint16_t length;
    for (length = 0; length < 8u; length++) {
        uint8_t sum = 0x55;
        uint16_t n;
        lnet_receive(0x55);
        for (n = 0; n < length; n++) {
            static const uint8_t begun[] = { 200, 1, 10, 0, 8, 4, 7, 7 };
            rig_put(begun[n], &sum);
        }
        TEST_ASSERT_EQUAL_UINT8(0, rig_ask_of(request, sizeof request));
    }
}

void test_a_frame_whose_sum_is_missing_is_forgotten_where_the_next_one_begins(void)
{
    uint8_t sum = 0x55;
    lnet_receive(0x55);
    rig_put(1, &sum);
    rig_put(1, &sum);
    rig_put(0, &sum);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
}

void test_a_frame_whose_fill_byte_is_missing_is_dropped(void)
{
    lnet_receive(0x55);
    lnet_receive(0x02);
    lnet_receive(0x01); /* no fill byte */
    lnet_receive(0x00);
    lnet_receive(0x58);
    TEST_ASSERT_FALSE(rig_answer());
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
}

void test_silence_ends_a_frame(void)
{
    lnet_receive(0x55);
    lnet_receive(200);
    lnet_receive(1);
    lnet_receive(0);
    lnet_tick(LNET_QUIET_MS - 1u);
    TEST_ASSERT_EQUAL_UINT8(PART_DATA, board_lnet.part);
    lnet_tick(1);
    TEST_ASSERT_EQUAL_UINT8(PART_SYN, board_lnet.part);
    lnet_receive(0x55);
    lnet_receive(0x55); /* as a size, before silence */
    lnet_tick(LNET_QUIET_MS);
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
}

void test_silence_does_not_end_an_answer(void)
{
    const uint8_t request[] = { 0 };
    rig_send_as(1, 1, request, 1, 0);
    TEST_ASSERT_EQUAL_INT16(0x55, lnet_next());
    lnet_tick(2 * LNET_QUIET_MS);
    TEST_ASSERT_EQUAL_INT16(46, lnet_next());
}

void test_what_comes_in_during_an_answer_is_dropped(void)
{
    const uint8_t request[] = { 9, LOW(ADDRESS(variable[0])), 100, 1 };
    uint16_t n;
    rig_send_as(sizeof request, 1, request, sizeof request, 0);
    for (n = 0; n < 30u; n++) {
        lnet_receive((uint8_t)(0x55u + n));
    }
    TEST_ASSERT_TRUE(rig_answer());
    TEST_ASSERT_EQUAL_HEX8_ARRAY(variable, answered + 2, 100);
}

void test_a_frame_without_data_is_none(void)
{
    const uint8_t none[] = { 0 };
    rig_send_as(0, 1, none, 0, 0);
    TEST_ASSERT_FALSE(rig_answer());
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
}

/* ---- the first frame ---- */

void test_noise_before_the_first_frame_is_not_answered_and_does_not_take_the_line(void)
{
    uint16_t n, seed = 1;
    lnet_init(line_memory);
    memset(line_memory, 0x5A, sizeof line_memory);
    for (n = 0; n < 20000u; n++) {
        seed = (uint16_t)(seed * 25173u + 13849u);
        lnet_receive((uint8_t)(seed >> 8));
        TEST_ASSERT_EQUAL_INT16(-1, lnet_next());
    }
    TEST_ASSERT_EACH_EQUAL_HEX8(0x5A, line_memory, sizeof line_memory); /* the status line is still in it */
    lnet_tick(LNET_QUIET_MS);
    TEST_ASSERT_FALSE(lnet_is_busy());
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
    TEST_ASSERT_TRUE(lnet_is_busy());
    lnet_tick(LNET_QUIET_MS);
    TEST_ASSERT_TRUE(lnet_is_busy());
}

void test_a_wrong_first_frame_is_not_answered(void)
{
    const uint8_t request[] = { 0 };
    lnet_init(line_memory);
    rig_send_as(1, 1, request, 1, 0x40);
    TEST_ASSERT_FALSE(rig_answer());
    TEST_ASSERT_FALSE(lnet_is_busy());
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
}

void test_the_line_is_kept_free_while_the_first_frame_comes_in(void)
{
    lnet_init(line_memory);
    lnet_receive('x');
    TEST_ASSERT_FALSE(lnet_is_busy());
    lnet_receive(0x55);
    TEST_ASSERT_TRUE(lnet_is_busy());
}

void test_a_long_first_frame_is_answered_by_its_size(void)
{
    const uint8_t request[] = { 10, LOW(ADDRESS(variable[0])), 5, 1, 2, 3, 4, 5 };
    lnet_init(line_memory);
    TEST_ASSERT_EQUAL_UINT8(21, rig_ask_of(request, sizeof request));
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask_of(request, sizeof request));
}

/* ---- anything ---- */

static uint32_t seed = 1;

static uint16_t chance(uint16_t most)
{
    seed = seed * 1664525u + 1013904223u;
    return (uint16_t)((seed >> 16) % (most + 1u));
}

/** What a writing frame does to a copy of the reachable memory, in plain words: nothing, if any byte of it lies outside or is the link's own. */
static uint16_t expected_write(uint8_t *copy, uint16_t address, const uint8_t *bytes, uint16_t count)
{
    uint32_t from = (uint32_t)address - MEMORY_RAM_START, own = (uint32_t)ADDRESS(board_lnet) - MEMORY_RAM_START;
    if (count == 0u || address < MEMORY_RAM_START || from + count > MEMORY_RAM_BYTES || (from + count > own && from < own + sizeof board_lnet)) {
        return 20;
    }
    memcpy(copy + from, bytes, count);
    return 0;
}

/** Thousands of writing frames at any address, whole, broken off, with a byte changed, left out or too many: only what is valid writes, and it writes what
 *  it says and nothing else; whatever came before, the next request is answered. */
void test_any_frame_writes_what_it_may_and_nothing_else(void)
{
    static uint8_t copy[8192];
    uint16_t n, written = 0;
    TEST_ASSERT_TRUE(MEMORY_RAM_BYTES <= sizeof copy);
    for (n = 0; n < 6000u; n++) {
        uint8_t data[24], damaged = (uint8_t)chance(3);
        uint16_t count = chance(12), k, address = (uint16_t)(chance(1) ? MEMORY_RAM_START - 8u + chance((uint16_t)(MEMORY_RAM_BYTES + 16u)) : chance(65535)), error;
        data[0] = 10;
        data[1] = (uint8_t)address;
        data[2] = (uint8_t)(address >> 8);
        data[3] = (uint8_t)count;
        for (k = 0; k < count; k++) {
            data[4u + k] = (uint8_t)(chance(3) == 0u ? 0x55u : chance(255));
        }
        memcpy(copy, host_window(), MEMORY_RAM_BYTES);
        if (damaged == 0u) {
            error = expected_write(copy, address, data + 4, count);
            TEST_ASSERT_EQUAL_UINT16(error, rig_ask_of(data, (uint16_t)(4u + count)));
            written = (uint16_t)(written + (error == 0u));
        } else if (damaged == 1u) { /* the sum is wrong */
            rig_send_as((uint8_t)(4u + count), 1, data, (uint16_t)(4u + count), (uint8_t)(1u + chance(254)));
        } else if (damaged == 2u) { /* more is promised than comes */
            rig_send_as((uint8_t)(5u + count + chance(100)), 1, data, (uint16_t)(4u + count), 0);
        } else {
            uint16_t length = chance(30);
            for (k = 0; k < length; k++) {
                lnet_receive((uint8_t)(chance(2) == 0u ? 0x55u : chance(255)));
            }
        }
        while (lnet_next() >= 0) {
        }
        lnet_tick(LNET_QUIET_MS);
        memcpy(copy + (ADDRESS(board_lnet) - MEMORY_RAM_START), &board_lnet, sizeof board_lnet); /* its own affair */
        TEST_ASSERT_EQUAL_INT(0, memcmp(copy, host_window(), MEMORY_RAM_BYTES));
        TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
    }
    TEST_ASSERT_TRUE(written > 300u);
}
