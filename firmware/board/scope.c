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

/** The words of a row. @return 1 if all are good */
static uint16_t take_channels(scope_t *s, const uint8_t *at)
{
    uint16_t channel, n;
    s->words = 0;
    for (channel = 0; channel < s->channels; channel++, at += CHANNEL_BYTES) {
        uint16_t words = (uint16_t)(at[5] >> 1);
        const volatile int16_t *first = variable_at(at + 1, at[5]);
        if (first == 0 || (at[5] & 1u) != 0u || words == 0u || words > 2u || s->words + words > SCOPE_WORDS) {
            return 0;
        }
        for (n = 0; n < words; n++) {
            s->source[s->words++] = first + n;
        }
    }
    return (uint16_t)(s->words != 0u);
}

/** Rows before the trigger and after it. @param before its row, in bytes; negative: bytes after it that are left out @return 1 if there is room */
static uint16_t take_delay(scope_t *s, int16_t before, uint16_t rows)
{
    int16_t before_rows = (int16_t)(before / (int16_t)(2u * s->words));
    s->delay = before;
    if (before_rows <= 0) { /* the last row then ends the array */
        uint16_t skipped = (uint16_t)-before_rows;
        s->left = 0;
        s->after = (uint16_t)(rows + skipped);
        s->begin = s->last - s->words * ((skipped + rows - 1u) % rows + 1u);
        s->at = s->begin;
        s->end = s->begin + s->words;
        return 1;
    }
    s->left = (uint16_t)before_rows;
    s->after = (uint16_t)(rows - s->left);
    return (uint16_t)(s->left < rows);
}

/** A trigger on a word. @param rows of the ring @return 1 if it is good */
static uint16_t take_trigger(scope_t *s, const uint8_t *at, uint16_t rows)
{
    uint16_t delay = word_at(at + TRIGGER_DELAY), rises = (uint16_t)(at[TRIGGER_EDGE] == 1u);
    s->trigger = (const volatile uint16_t *)variable_at(at + 2, 2);
    s->flip = (uint16_t)((rises ? 0xFFFFu : 0u) ^ ((at[0] & TYPE_SIGNED) != 0u ? 0u : 0x8000u));
    s->level = (int16_t)(word_at(at + TRIGGER_LEVEL) ^ s->flip);
    s->level = (int16_t)(s->level + 1); /* the other side begins there */
    s->is_low = 0;
    return (uint16_t)((at[0] & (TYPE_FLOAT | TYPE_WIDTH)) == 2u && s->trigger != 0
                      && word_at(at + TRIGGER_DELAY + 2) == ((delay >= 0x8000u) ? 0xFFFFu : 0u) && take_delay(s, (int16_t)delay, rows));
}

uint16_t scope_start(scope_t *s, const uint8_t *request, uint16_t size)
{
    uint16_t mode = request[0], rows, from;
    s->mode = (uint16_t)SCOPE_IDLE;
    if (mode == (uint16_t)SCOPE_IDLE) {
        return 1;
    }
    s->channels = request[1];
    from = (uint16_t)(HEAD_BYTES + CHANNEL_BYTES * s->channels);
    if (mode > (uint16_t)SCOPE_AUTO || s->channels > SCOPE_WORDS || size != from + TRIGGER_BYTES || !take_channels(s, request + HEAD_BYTES)) {
        return 0;
    }
    s->periods = (uint16_t)(word_at(request + 2) + 1u);
    s->wait = 1;
    s->is_unusual = (uint16_t)(s->words != SCOPE_USUAL_WORDS);
    rows = (uint16_t)(SCOPE_ARRAY_WORDS / s->words);
    s->at = board_scope_array;
    s->begin = board_scope_array;
    s->event = board_scope_array;
    s->last = board_scope_array + rows * s->words;
    s->end = s->last;
    if (mode != (uint16_t)SCOPE_TRIGGERED || request[from + TRIGGER_MODE] == 0u) {
        s->left = rows;
        s->after = 0;
        s->delay = 0;
    } else if (!take_trigger(s, request + from, rows)) {
        return 0;
    } else {
        /* it waits for the trigger */
    }
    s->mode = mode;
    return 1;
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
    uint16_t *at = put_long(record, (uint16_t)(s->mode | (uint16_t)(s->channels << 8)), (uint16_t)((s->periods != 0u) ? s->periods - 1u : 0u));
    uint16_t used = offset_of(s->last);
    at = put_long(at, offset_of(s->at), 0);
    at = put_long(at, MEMORY_ADDRESS(board_scope_array), 0);
    at = put_long(at, (uint16_t)s->delay, (s->delay < 0) ? 0xFFFFu : 0u);
    at = put_long(at, offset_of(s->event), 0);
    at = put_long(at, used, 0);
    at = put_long(at, used, 0); /* clients take all of an array of whole rows */
    *at = VERSION;
}

#endif
