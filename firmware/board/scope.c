/* The scope, and LNet, the protocol of X2C-Scope clients that reads and writes memory and runs it (docs/scope.md). */
#include "board/scope.h"

#if SCOPE
/** 1 if all of these bytes are RAM: nothing else may be read, for reading a register may act. What is below wraps to beyond the end. */
static QM_WRAPS uint16_t memory_is_ram(uint16_t address, uint16_t bytes)
{
    uint16_t from = (uint16_t)(address - MEMORY_RAM_START);
    return (uint16_t)(from < MEMORY_RAM_BYTES && bytes <= (uint16_t)(MEMORY_RAM_BYTES - from));
}

/** 1 if all of these bytes of RAM are variables: no stack. */
static uint16_t memory_is_variable(uint16_t address, uint16_t bytes)
{
    uint16_t from = (uint16_t)(address - MEMORY_RAM_START);
    return (uint16_t)(from + bytes <= MEMORY_VARIABLE_BYTES);
}

/** The usual row in a straight line. Its addresses are volatile to be read first: none is used in the cycle after it was read. @return where the next one goes */
QM_INLINE int16_t *scope_copy_usual(const scope_t *s)
{
    const volatile int16_t *first = s->source[0], *second = s->source[1], *third = s->source[2], *fourth = s->source[3];
    int16_t *at = s->at;
    *at++ = *first;
    *at++ = *second;
    *at++ = *third;
    *at++ = *fourth;
    return at;
}

/** A row is there while the trigger is looked for. After the trigger's, scope_turn() ends a round. @param following where it ended */
QM_INLINE void scope_look(scope_t *s, const volatile uint16_t *trigger, int16_t *following)
{
    if ((int16_t)(*trigger ^ s->flip) < s->level) {
        s->is_low = 0xFFFFu;
    } else if (s->is_low) {
        s->event = following;
        s->mode = s->then;
        s->at = following;
        return;
    } else { /* it has always been there */
    }
    s->at = (following == s->ring_end) ? s->ring_begin : following;
}

/** Before a row after the trigger's, or without one: a new round at the array's end. @param begin of the array */
QM_INLINE void scope_turn(scope_t *s, int16_t *begin)
{
    if (s->at == s->last) {
        s->at = begin;
    }
}

/** Such a row is there. @param following where it ended */
QM_INLINE void scope_go_on(scope_t *s, int16_t *following)
{
    s->at = following;
    if (--s->left == 0u) {
        s->mode = SCOPE_IDLE;
    }
}

/** A row is there before the trigger is looked for: there is always room for one more. @param following where it ended
 *  @param is_rare what it is from the trigger's search on */
QM_INLINE void scope_fill(scope_t *s, int16_t *following, uint16_t is_rare)
{
    s->at = following;
    if (--s->before == 0u) {
        s->mode = s->looking;
        s->is_rare = is_rare;
    }
}

/** Words of any number. @return where the next row goes */
static NOINLINE int16_t *copy_words(const scope_t *s)
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

/** A row that is not the usual one: any length, whatever it costs. */
static void scope_record_unusual(scope_t *s)
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

void scope_tick(scope_t *s, int16_t *begin)
{
    if (s->mode == SCOPE_IDLE || --s->wait != 0u) {
        return;
    }
    s->wait = s->periods;
    if (s->mode >= 0) {
        if (!s->is_rare) {
            scope_turn(s, begin);
            scope_go_on(s, scope_copy_usual(s));
        } else if (s->looking < 0) {
            scope_fill(s, scope_copy_usual(s), 0);
        } else {
            scope_record_unusual(s);
        }
    } else {
        const volatile uint16_t *trigger = s->trigger;
        scope_look(s, trigger, scope_copy_usual(s));
    }
}

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

/** Nothing has been recorded. */
static void scope_init(scope_t *s)
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

static NOINLINE uint16_t word_at(const uint8_t *at)
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

/** A request to record. @return 1 if it was understood */
static uint16_t take_setting(scope_t *s, const uint8_t *request, uint16_t size)
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

/** A request to record, as it stands in a frame: state, channels, periods between rows, channels, trigger. Without channels the scope stops.
 *  @return 1 if it was understood; in any case a running record has ended. 0: the array is empty until the next good request, or device info */
static uint16_t scope_start(scope_t *s, const uint8_t *request, uint16_t size)
{
    uint16_t is_good = take_setting(s, request, size);
    if (!is_good) { /* clients that do not look at the error find nothing to read */
        scope_init(s);
        s->last = board_scope_array;
    }
    return is_good;
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

/** What the scope has done, as it stands in a frame. @param record at an even address, with room for thirty bytes */
static void scope_put(const scope_t *s, void *record)
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

/* ---- LNet: frames in and out byte by byte, and the services. No register: the caller moves the bytes ---- */

#if SCOPE
#define PARAMETER_SCOPE 1u
#define SCOPE_STATE_BYTES 29u

/** What comes next on the line. */
enum { PART_SYN = 0,
       PART_SUM, /* a SYN in its place begins a frame, too */
       PART_SIZE,
       PART_DATA, /* from the node on */
       ANSWER_SYN,
       ANSWER_DATA, /* from the size on */
       ANSWER_SUM };

/** Places in a frame without its SYN. */
enum { AT_SIZE,
       AT_NODE,
       AT_SERVICE,
       AT_ADDRESS,   /* of a request: of memory, or a parameter's number */
       AT_COUNT = 5, /* of bytes to read or to write */
       AT_SETTING = 5,
       AT_WRITTEN = 6,
       AT_ERROR = 3, /* of an answer */
       AT_PAYLOAD };
#define HEAD 2u /* size and node */

/** Service 0, words of its answer: versions of protocol and program, longest data, a dsPIC; no dates; state: the program runs. */
#define INFO_WORDS 22
#define INFO_PROTOCOL 0
#define INFO_PROGRAM 1
#define INFO_LONGEST 2 /* and the processor's low byte */
#define INFO_PROCESSOR 3
#define INFO_STATE 16 /* its high byte */

lnet_t board_lnet;

void lnet_init(uint8_t *memory)
{
    lnet_t *l = &board_lnet;
    l->memory = memory;
    l->buffer = l->first;
    l->room = LNET_FIRST;
    l->part = PART_SYN;
    l->special = 0;
    l->is_up = 0;
    scope_init(&l->scope);
}

uint16_t lnet_is_busy(void)
{
    return (uint16_t)(board_lnet.is_up | board_lnet.part);
}

void lnet_tick(uint16_t elapsed_ms)
{
    lnet_t *l = &board_lnet;
    l->quiet_ms = (uint16_t)(l->quiet_ms + elapsed_ms);
    if (l->quiet_ms >= LNET_QUIET_MS && l->part < (uint16_t)ANSWER_SYN) {
        l->part = PART_SYN;
        l->special = 0;
    }
}

/* ---- services ---- */

/** Fills the buffer from `at` on, which is even, with the answer's next bytes. Words where they are aligned, so that none is torn. */
static void fetch(lnet_t *l, uint16_t at, uint16_t bytes)
{
    const volatile uint8_t *from = l->source;
    uint16_t is_odd = (uint16_t)((uintptr_t)from & 1u), end = (uint16_t)(at + bytes);
    end = (end < l->room) ? end : l->room;
    while (at < end) {
        if (is_odd) {
            l->buffer[at] = *from;
            at++;
            from++;
        } else {
            *(uint16_t *)(void *)&l->buffer[at] = *(const volatile uint16_t *)(const volatile void *)from;
            at = (uint16_t)(at + 2u);
            from += 2;
        }
    }
    l->source = from;
}

/** What a client may write of the RAM: any variable but those of this link, with which it could make the scope write anywhere. */
static uint16_t may_write(uint16_t address, uint16_t bytes)
{
    uint16_t own = MEMORY_ADDRESS(&board_lnet);
    return (uint16_t)(memory_is_variable(address, bytes) && ((uint16_t)(address + bytes) <= own || address >= own + sizeof board_lnet));
}

/** Words where they are aligned: the control interrupt never sees half of one. @param from an even address */
static void store(uint16_t address, const uint8_t *from, uint16_t bytes)
{
    volatile uint8_t *to = MEMORY_AT(address);
    const uint8_t *end = &from[bytes];
    uint16_t is_odd = (uint16_t)((address | bytes) & 1u);
    while (from != end) {
        if (is_odd) {
            *to = *from;
            to++;
            from++;
        } else {
            *(volatile uint16_t *)(volatile void *)to = *(const uint16_t *)(const void *)from;
            to += 2;
            from += 2;
        }
    }
}

/** The answer to service 0. A client is there: the request to record before it may have been refused. @return its bytes */
static uint16_t put_info(lnet_t *l)
{
    uint16_t n, *to = (uint16_t *)(void *)&l->buffer[AT_PAYLOAD];
    if (l->scope.words == 0u) {
        scope_init(&l->scope);
    }
    for (n = 0; n < INFO_WORDS; n++) {
        to[n] = 0;
    }
    to[INFO_PROTOCOL] = 5;
    to[INFO_PROGRAM] = 1;
    to[INFO_LONGEST] = 0x10FFu;
    to[INFO_PROCESSOR] = 0x0082u;
    to[INFO_STATE] = 0x0100u;
    return 2u * INFO_WORDS;
}

/** Carries a request out. As many bytes as l->left tells follow the error; where they are is l->source, if not in the buffer.
 *  @param size of the request's data @return the error */
static uint8_t serve(lnet_t *l, const uint8_t *request, uint16_t size)
{
    uint16_t address = (uint16_t)(request[AT_ADDRESS] | (uint16_t)(request[AT_ADDRESS + 1] << 8)), count = request[AT_COUNT];
    uint16_t is_ram = (uint16_t)(count != 0u && memory_is_ram(address, count)), is_scope = (uint16_t)(address == PARAMETER_SCOPE);
    uint16_t is_good = 0;
    switch (request[AT_SERVICE]) {
    case LNET_DEVICE_INFO:
        l->left = put_info(l);
        is_good = 1;
        break;
    case LNET_GET_RAM:
        if (count > LNET_MOST_BYTES) {
            return LNET_ERROR_SIZE;
        }
        if (size == 5u && is_ram) {
            l->source = MEMORY_AT(address);
            l->left = count;
            is_good = 1;
        }
        break;
    case LNET_PUT_RAM:
        if (size == 4u + count && is_ram && may_write(address, count)) {
            store(address, &request[AT_WRITTEN], count);
            is_good = 1;
        }
        break;
    case LNET_LOAD_PARAMETER:
        if (size == 3u && is_scope) {
            scope_put(&l->scope, &l->buffer[AT_PAYLOAD]);
            l->left = SCOPE_STATE_BYTES;
            is_good = 1;
        }
        break;
    case LNET_SAVE_PARAMETER:
        is_good = (uint16_t)(size > 3u && is_scope && scope_start(&l->scope, &request[AT_SETTING], (uint16_t)(size - 3u)));
        break;
    default:
        return LNET_ERROR_SERVICE;
    }
    return is_good ? LNET_ERROR_OK : LNET_ERROR_FORMAT;
}

/* ---- frames ---- */

/** Bytes that begin something on the line are followed by a fill byte where they are data. */
static uint16_t special_of(uint16_t byte)
{
    return (byte == LNET_SYN || byte == LNET_KEY) ? byte : 0u;
}

/** A byte counts in the sum. */
static NOINLINE void count_byte(lnet_t *l, uint16_t byte)
{
    l->sum = (uint16_t)(l->sum + byte);
    l->special = special_of(byte);
}

/** The checksum as it is sent. */
static uint16_t sum_sent(const lnet_t *l)
{
    uint16_t sum = (uint16_t)(l->sum & 0xFFu);
    return (special_of(sum) != 0u) ? (uint16_t)(sum ^ 0xFFu) : sum;
}

/** The last byte of a frame. Before the first valid one, nothing is answered to what may be noise. */
static void end_frame(lnet_t *l, uint16_t sum)
{
    const uint8_t *request = l->buffer;
    uint8_t *answer = l->buffer;
    uint8_t service = request[AT_SERVICE], error = LNET_ERROR_CHECKSUM;
    uint16_t is_right = (uint16_t)(sum == sum_sent(l)), size = request[AT_SIZE], fits = (uint16_t)(HEAD + size <= l->room);
    l->part = PART_SYN;
    if (request[AT_NODE] != LNET_NODE || (!is_right && !l->is_up)) {
        return;
    }
    l->source = 0;
    l->left = 0;
    if (is_right) {
        answer = l->memory;
        l->buffer = answer;
        l->room = LNET_ROOM;
        l->is_up = 1;
        error = LNET_ERROR_SIZE;
        if (fits) {
            error = serve(l, request, size);
        }
    }
    answer[AT_SIZE] = (uint8_t)(2u + l->left);
    answer[AT_NODE] = LNET_NODE;
    answer[AT_SERVICE] = service;
    answer[AT_ERROR] = error;
    if (l->source != 0) {
        fetch(l, AT_PAYLOAD, l->left);
    }
    l->left = (uint16_t)(HEAD + 2u + l->left);
    l->at = 0;
    l->part = ANSWER_SYN;
}

/** A byte between SYN and checksum. */
static void take(lnet_t *l, uint8_t byte)
{
    count_byte(l, byte);
    if (l->at < l->room) {
        l->buffer[l->at] = byte;
        l->at++;
    }
    if (l->part == (uint16_t)PART_SIZE) {
        l->left = (uint16_t)(byte + 1u);
        l->part = (uint16_t)((byte != 0u) ? PART_DATA : PART_SYN);
    } else {
        l->left--;
        if (l->left == 0u) {
            l->part = PART_SUM;
        }
    }
}

static void begin_frame(lnet_t *l)
{
    l->part = PART_SIZE;
    l->sum = LNET_SYN;
    l->at = 0;
}

void lnet_receive(uint8_t byte)
{
    lnet_t *l = &board_lnet;
    uint16_t before = l->special;
    if (l->part >= (uint16_t)ANSWER_SYN) {
        return;
    }
    l->quiet_ms = 0;
    l->special = 0;
    if (before != 0u) {
        if (byte == 0u) {
            return; /* the fill byte */
        }
        l->part = PART_SYN;
        if (before == LNET_SYN) {
            begin_frame(l); /* it was no data: the frame before it has broken off */
        }
    }
    if (byte == LNET_SYN && l->part <= (uint16_t)PART_SUM) {
        begin_frame(l);
    } else if (l->part == (uint16_t)PART_SUM) {
        end_frame(l, byte);
    } else if (l->part != (uint16_t)PART_SYN) {
        take(l, byte);
    } else { /* noise */
    }
}

int16_t lnet_next(void)
{
    lnet_t *l = &board_lnet;
    uint16_t byte = 0;
    if (l->part < (uint16_t)ANSWER_SYN) {
        return -1;
    }
    if (l->special != 0u) {
        l->special = 0; /* the fill byte */
    } else if (l->part == (uint16_t)ANSWER_SYN) {
        byte = LNET_SYN;
        l->sum = LNET_SYN;
        l->part = ANSWER_DATA;
    } else if (l->part == (uint16_t)ANSWER_SUM) {
        byte = sum_sent(l);
        l->part = PART_SYN;
    } else {
        if (l->at == l->room) {
            fetch(l, 0, l->left);
            l->at = 0;
        }
        byte = l->buffer[l->at];
        l->at++;
        count_byte(l, byte);
        l->left--;
        if (l->left == 0u) {
            l->part = ANSWER_SUM;
        }
    }
    return (int16_t)byte;
}
#endif
