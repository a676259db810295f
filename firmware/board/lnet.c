/* LNet: frames in and out byte by byte, and the services. No register: the caller moves the bytes. */
#include "board/lnet.h"

#include "board/memory_map.h"

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

/** The answer to service 0. @return its bytes */
static uint16_t put_info(uint16_t *to)
{
    uint16_t n;
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
        l->left = put_info((uint16_t *)(void *)&l->buffer[AT_PAYLOAD]);
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
static void count_byte(lnet_t *l, uint16_t byte)
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
    } else {
        /* noise */
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
