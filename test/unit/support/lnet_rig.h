/* A client of the serial line for unit tests: frames as the protocol has them, sent and received byte by byte; and variables that it can reach. */
#ifndef TEST_LNET_RIG_H
#define TEST_LNET_RIG_H

#include "hurst_params.h"

#include "board/scope.h"

#define REACHED __attribute__((section("fw_ram")))

/** The first of them, so that the link's own are neither the first nor the last in any order. */
static int16_t first_variable[8] REACHED __attribute__((used)) = { 1 };

#ifdef __clang__
#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wsection" /* nothing has used them yet */
#endif
extern lnet_t board_lnet REACHED;
extern int16_t board_scope_array[SCOPE_ARRAY_WORDS] REACHED;
#ifdef __clang__
#pragma clang diagnostic pop
#endif

#include "unity.h"

#include <string.h>

/** The firmware's variables; guard words on both sides are others'. */
static int16_t variable[140] REACHED = { 1 };

static uint8_t line_memory[LNET_ROOM + 2u]; /* of the status line, and what lies behind it */
static uint8_t answered[300]; /* the data of the last answer */
static uint16_t answered_size;

#define ADDRESS(thing) MEMORY_ADDRESS(&(thing))
#define LOW(word) (uint8_t)(word), (uint8_t)((uint16_t)(word) >> 8)
#define LONG(word) LOW(word), (uint8_t)((uint32_t)(word) >> 16), (uint8_t)((uint32_t)(word) >> 24)

static inline uint8_t rig_sum(uint8_t sum)
{
    return (uint8_t)((sum == 0x55u || sum == 0x02u) ? ~sum : sum);
}

/** A byte between SYN and checksum. */
static inline void rig_put(uint8_t byte, uint8_t *sum)
{
    *sum = (uint8_t)(*sum + byte);
    lnet_receive(byte);
    if (byte == 0x55u || byte == 0x02u) {
        lnet_receive(0);
    }
}

/** A frame with a size of its own, a node, and an error in its checksum. */
static inline void rig_send_as(uint8_t size, uint8_t node, const uint8_t *data, uint16_t bytes, uint8_t error)
{
    uint8_t sum = 0x55;
    uint16_t n;
    lnet_receive(0x55);
    rig_put(size, &sum);
    rig_put(node, &sum);
    for (n = 0; n < bytes; n++) {
        rig_put(data[n], &sum);
    }
    lnet_receive((uint8_t)(rig_sum(sum) ^ error));
}

/** The next byte of the answer and its fill byte. */
static inline uint8_t rig_take(uint8_t *sum)
{
    int16_t byte = lnet_next();
    TEST_ASSERT_TRUE(byte >= 0);
    *sum = (uint8_t)(*sum + byte);
    if (byte == 0x55 || byte == 0x02) {
        TEST_ASSERT_EQUAL_INT16(0, lnet_next());
    }
    return (uint8_t)byte;
}

/** Receives an answer. @return 0 if there is none */
static inline uint16_t rig_answer(void)
{
    uint8_t sum = 0x55;
    uint16_t n;
    int16_t byte = lnet_next();
    answered_size = 0;
    if (byte < 0) {
        return 0;
    }
    TEST_ASSERT_EQUAL_INT16(0x55, byte);
    answered_size = rig_take(&sum);
    TEST_ASSERT_EQUAL_UINT8(1, rig_take(&sum));
    for (n = 0; n < answered_size; n++) {
        answered[n] = rig_take(&sum);
    }
    TEST_ASSERT_EQUAL_INT16(rig_sum(sum), lnet_next());
    TEST_ASSERT_EQUAL_INT16(-1, lnet_next());
    return 1;
}

/** A request and its answer. @return the error that it tells */
static inline uint8_t rig_ask_of(const uint8_t *data, uint16_t bytes)
{
    rig_send_as((uint8_t)bytes, 1, data, bytes, 0);
    TEST_ASSERT_TRUE(rig_answer());
    TEST_ASSERT_EQUAL_UINT8(data[0], answered[0]);
    return answered[1];
}

#define rig_ask(...) rig_ask_of((const uint8_t[]){ __VA_ARGS__ }, sizeof((const uint8_t[]){ __VA_ARGS__ }))

/** A link that is up. */
static inline void rig_up(void)
{
    uint16_t n;
    lnet_init(line_memory);
    for (n = 0; n < 140u; n++) {
        variable[n] = (int16_t)(0x0100 + 3 * (int16_t)n);
    }
    TEST_ASSERT_EQUAL_UINT8(0, rig_ask(0));
}

#endif
