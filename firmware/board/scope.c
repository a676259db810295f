/* The scope's slow side: what a client asks it to record, and what it says of itself. */
#include "board/scope.h"

#include "board/memory_map.h"

#if SCOPE

#define HEAD_BYTES 4u    /* state, channels, periods */
#define CHANNEL_BYTES 6u /* type of memory, address in four bytes, width */
/* Type, type of memory, address, level of 16 bits, delay, edge, mode. */
#define TRIGGER_LEVEL 6
#define TRIGGER_DELAY 8
#define TRIGGER_EDGE 12
#define TRIGGER_MODE 13u /* 0: none */
#define TRIGGER_BYTES 14u
#define TYPE_FLOAT 0x40u
#define TYPE_SIGNED 0x20u
#define TYPE_WIDTH 0x1Fu
#define VERSION 0x82u

int16_t board_scope_array[SCOPE_ARRAY_WORDS];

void scope_init(scope_t *s)
{
    s->mode = SCOPE_IDLE;
    s->at = board_scope_array;
    s->event = board_scope_array;
    s->last = board_scope_array + SCOPE_ARRAY_WORDS;
    s->words = 0;
    s->channels = 0;
    s->periods = 0;
    s->delay = 0;
}

static uint16_t word_at(const uint8_t *at)
{
    return (uint16_t)(at[0] | (uint16_t)(at[1] << 8));
}

/** A variable of so many bytes. @return its first word, or 0 if it cannot be recorded */
static const volatile int16_t *variable_at(const uint8_t *address, uint16_t bytes)
{
    uint16_t at = word_at(address);
    if ((at & 1u) != 0u || word_at(address + 2) != 0u || !memory_is_ram(at, bytes)) {
        return 0;
    }
    return (const volatile int16_t *)MEMORY_AT(at);
}

/** The words of a row. @return how many, or 0 if one is not good */
static uint16_t take_channels(scope_t *s, const uint8_t *at)
{
    uint16_t channel, n, count = 0;
    for (channel = 0; channel < s->channels; channel++, at += CHANNEL_BYTES) {
        uint16_t words = (uint16_t)(at[5] >> 1);
        const volatile int16_t *first = variable_at(at + 1, at[5]);
        if (first == 0 || (at[5] & 1u) != 0u || words == 0u || words > 2u || count + words > SCOPE_WORDS) {
            return 0;
        }
        for (n = 0; n < words; n++) {
            s->source[count++] = first + n;
        }
    }
    return count;
}

/** Rows before the trigger and after it. @param before its row, in bytes; negative: bytes after it that are left out @return 1 if there is room */
static uint16_t take_delay(scope_t *s, int16_t before, uint16_t rows)
{
    uint16_t size = (uint16_t)((before < 0) ? (uint16_t) ~(uint16_t)before + 1u : (uint16_t)before);
    uint16_t count = qm_divud(size, (uint16_t)(2u * s->words));
    s->delay = before;
    if (before > 0 && count != 0u) {
        s->before = count;
        s->left = (uint16_t)((count < rows) ? rows - 1u - count : 0u);
    } else { /* it looks in the place from which on the last row ends the array */
        s->left = (uint16_t)(rows - 1u + count);
        s->ring_begin = s->last - (uint16_t)(s->words * (uint16_t)(s->left - rows * qm_divud(s->left, rows) + 1));
        s->ring_end = s->ring_begin + s->words;
        s->at = s->ring_begin;
    }
    s->then = (int16_t)((s->left != 0u) ? SCOPE_TRIGGERED : SCOPE_IDLE);
    return (uint16_t)(s->before < rows);
}

/** A trigger on a word. @param rows of the array @return 1 if it is good */
static uint16_t take_trigger(scope_t *s, const uint8_t *at, uint16_t rows)
{
    uint16_t delay = word_at(at + TRIGGER_DELAY), falls = (uint16_t)(at[TRIGGER_EDGE] != 1u);
    s->trigger = (const volatile uint16_t *)variable_at(at + 2, 2);
    s->flip = (uint16_t)((falls ? 0xFFFFu : 0u) ^ ((at[0] & TYPE_SIGNED) != 0u ? 0u : 0x8000u));
    s->level = (int16_t)(word_at(at + TRIGGER_LEVEL) ^ s->flip);
    s->is_low = 0;
    return (uint16_t)((at[0] & (TYPE_FLOAT | TYPE_WIDTH)) == 2u && s->trigger != 0
                      && word_at(at + TRIGGER_DELAY + 2) == ((delay >= 0x8000u) ? 0xFFFFu : 0u) && take_delay(s, (int16_t)delay, rows));
}

uint16_t scope_start(scope_t *s, const uint8_t *request, uint16_t size)
{
    int16_t mode = (int16_t)request[0];
    uint16_t rows, from, words;
    s->mode = SCOPE_IDLE;
    if (mode == SCOPE_IDLE) {
        return 1;
    }
    s->channels = request[1];
    from = (uint16_t)(HEAD_BYTES + CHANNEL_BYTES * s->channels);
    if (mode > SCOPE_AUTO || s->channels > SCOPE_WORDS || size != from + TRIGGER_BYTES) {
        return 0;
    }
    words = take_channels(s, request + HEAD_BYTES);
    if (words == 0u) {
        return 0;
    }
    s->words = words;
    s->periods = (uint16_t)(word_at(request + 2) + 1u);
    s->wait = 1;
    rows = qm_divud(SCOPE_ARRAY_WORDS, words);
    s->at = board_scope_array;
    s->ring_begin = board_scope_array;
    s->event = board_scope_array + words;
    s->last = board_scope_array + rows * words;
    s->ring_end = s->last;
    s->before = 0;
    s->left = rows;
    s->delay = 0;
    s->looking = (int16_t)((words == SCOPE_USUAL_WORDS) ? SCOPE_LOOKS : SCOPE_LOOKS_UNUSUAL);
    if (mode == SCOPE_TRIGGERED && request[from + TRIGGER_MODE] != 0u) {
        if (!take_trigger(s, request + from, rows)) {
            return 0;
        }
        mode = (s->before != 0u) ? SCOPE_TRIGGERED : s->looking;
    }
    s->is_rare = (uint16_t)(s->before != 0u || s->looking >= 0);
    s->mode = mode;
    return 1;
}

/** Words of any number. @return where the next row goes */
static int16_t *copy_words(const scope_t *s)
{
    const volatile int16_t *const volatile *source = s->source;
    int16_t *at = s->at;
    uint16_t left = s->words;
    do {
        *at = **source; /* wcet: at most 8 turns */
        at++;
        source++;
        left--;
    } while (left != 0u);
    return at;
}

void scope_record_unusual(scope_t *s)
{
    if (s->mode == s->looking) {
        scope_look(s, s->trigger, copy_words(s));
    } else if (s->before != 0u) {
        scope_fill(s, copy_words(s), 1);
    } else {
        scope_turn(s, board_scope_array);
        scope_go_on(s, copy_words(s));
    }
}

/** Bytes from the array's begin. */
static uint16_t offset_of(const int16_t *at)
{
    return (uint16_t)((uint16_t)(at - board_scope_array) * 2u);
}

/** Four bytes. */
static uint16_t *put_long(uint16_t *at, uint16_t low, uint16_t high)
{
    *at++ = low;
    *at++ = high;
    return at;
}

void scope_put(const scope_t *s, void *record)
{
    uint16_t *at = put_long(record, (uint16_t)((s->mode & 0xFF) | (s->channels << 8)), (uint16_t)((s->periods != 0u) ? s->periods - 1u : 0u));
    uint16_t used = offset_of(s->last), next = offset_of(s->at);
    at = put_long(at, (next == used) ? 0u : next, 0);
    at = put_long(at, MEMORY_ADDRESS(board_scope_array), 0);
    at = put_long(at, (uint16_t)s->delay, (s->delay < 0) ? 0xFFFFu : 0u);
    at = put_long(at, offset_of(s->event - s->words), 0);
    at = put_long(at, used, 0);
    at = put_long(at, used, 0); /* clients take all of an array of whole rows */
    *at = VERSION;
}

#endif
