/* LNet: frames in and out byte by byte, and the services. No register: the caller moves the bytes. */
#include "board/lnet.h"

#include "board/memory_map.h"

#if SCOPE

#define PARAMETER_SCOPE 1u
#define SCOPE_STATE_BYTES 29u

/** What comes next on the line. */
enum { PART_SYN,
       PART_SIZE,
       PART_DATA, /* from the node on */
       PART_SUM,
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

/** Service 0: versions of protocol and program, longest data, a dsPIC; no dates; state: the program runs. */
#define INFO_BYTES 44u
#define INFO_STATE 33
static const uint8_t device_info[INFO_BYTES] = { 5, 0, 1, 0, 255, 0x10, 0x82, [INFO_STATE] = 1 };

lnet_t board_lnet;

void lnet_init(uint8_t *memory)
{
    lnet_t *l = &board_lnet;
    scope_init(&l->scope);
    l->memory = memory;
    l->buffer = l->first;
    l->room = LNET_FIRST;
    l->part = PART_SYN;
    l->special = 0;
    l->is_up = 0;
}

uint16_t lnet_is_busy(void)
{
    return (uint16_t)(board_lnet.is_up || board_lnet.part != (uint16_t)PART_SYN);
}

void lnet_tick(uint16_t elapsed_ms)
{
    lnet_t *l = &board_lnet;
    l->quiet_ms = (uint16_t)(l->quiet_ms + elapsed_ms);
    if (l->quiet_ms >= LNET_QUIET_MS && l->part < (uint16_t)ANSWER_SYN) {
        l->quiet_ms = 0;
        l->part = PART_SYN;
        l->special = 0;
    }
}

/* ---- services ---- */

/** Fills the buffer from `at` on with the answer's next bytes. Words where they are aligned, so that none is torn. */
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
            uint16_t word = *(const volatile uint16_t *)(const volatile void *)from;
            l->buffer[at] = (uint8_t)word;
            l->buffer[at + 1u] = (uint8_t)(word >> 8);
            at = (uint16_t)(at + 2u);
            from += 2;
        }
    }
    l->source = from;
}

/** What a client may write: any variable but those of this link, with which it could make the scope write anywhere. */
static uint16_t may_write(uint16_t address, uint16_t bytes)
{
    uint16_t own = MEMORY_ADDRESS(&board_lnet);
    return (uint16_t)(memory_is_variable(address, bytes) && ((uint16_t)(address + bytes) <= own || address >= own + sizeof board_lnet));
}

/** Words where they are aligned: the control interrupt never sees half of one. */
static void store(uint16_t address, const uint8_t *from, uint16_t bytes)
{
    volatile uint8_t *to = MEMORY_AT(address);
    const uint8_t *end = &from[bytes];
    if (((address | bytes) & 1u) != 0u) {
        while (from != end) {
            *to = *from;
            to++;
            from++;
        }
    } else {
        while (from != end) {
            *(volatile uint16_t *)(volatile void *)to = (uint16_t)(from[0] | (uint16_t)(from[1] << 8));
            to += 2;
            from += 2;
        }
    }
}

/** Carries a request out. @param size of its data @param bytes of the answer after its error; where they are is l->source, if not in the buffer
 *  @return the error */
static uint8_t serve(lnet_t *l, const uint8_t *request, uint16_t size, uint16_t *bytes)
{
    uint16_t address = (uint16_t)(request[AT_ADDRESS] | (uint16_t)(request[AT_ADDRESS + 1] << 8)), count = request[AT_COUNT];
    uint8_t error = LNET_ERROR_FORMAT;

    switch (request[AT_SERVICE]) {
    case LNET_DEVICE_INFO:
        l->source = device_info;
        *bytes = INFO_BYTES;
        return LNET_ERROR_OK;
    case LNET_GET_RAM:
        if (count > LNET_MOST_BYTES) {
            error = LNET_ERROR_SIZE;
        } else if (size == 5u && count != 0u && memory_is_ram(address, count)) {
            l->source = MEMORY_AT(address);
            *bytes = count;
            error = LNET_ERROR_OK;
        } else {
            /* refused */
        }
        break;
    case LNET_PUT_RAM:
        if (size == 4u + count && count != 0u && may_write(address, count)) {
            store(address, &request[AT_WRITTEN], count);
            error = LNET_ERROR_OK;
        }
        break;
    case LNET_LOAD_PARAMETER:
        if (size == 3u && address == PARAMETER_SCOPE) {
            scope_put(&l->scope, &l->buffer[AT_PAYLOAD]);
            *bytes = SCOPE_STATE_BYTES;
            error = LNET_ERROR_OK;
        }
        break;
    case LNET_SAVE_PARAMETER:
        if (size > 3u && address == PARAMETER_SCOPE && scope_start(&l->scope, &request[AT_SETTING], (uint16_t)(size - 3u))) {
            error = LNET_ERROR_OK;
        }
        break;
    default:
        error = LNET_ERROR_SERVICE;
        break;
    }
    return error;
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
    uint8_t service = request[AT_SERVICE], error = LNET_ERROR_CHECKSUM;
    uint16_t sent = sum_sent(l), size = request[AT_SIZE], bytes = 0, fits = (uint16_t)(HEAD + size <= l->room);

    l->part = PART_SYN;
    if (request[AT_NODE] != LNET_NODE || (sum != sent && !l->is_up)) {
        return;
    }
    l->source = 0;
    if (sum == sent) {
        l->buffer = l->memory;
        l->room = LNET_ROOM;
        l->is_up = 1;
        error = LNET_ERROR_SIZE;
        if (fits) {
            error = serve(l, request, size, &bytes);
        }
    }
    l->buffer[AT_SIZE] = (uint8_t)(2u + bytes);
    l->buffer[AT_NODE] = LNET_NODE;
    l->buffer[AT_SERVICE] = service;
    l->buffer[AT_ERROR] = error;
    if (l->source != 0) {
        fetch(l, AT_PAYLOAD, bytes);
    }
    l->left = (uint16_t)(HEAD + 2u + bytes);
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
    if (byte == LNET_SYN && (l->part == (uint16_t)PART_SYN || l->part == (uint16_t)PART_SUM)) {
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
