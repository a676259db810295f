/* LNet: frames in and out byte by byte, and the services. No register: the caller moves the bytes. */
#include "board/lnet.h"

#include "board/memory_map.h"

#if SCOPE

#define REPLY_HEAD 2u /* service, error */
#define PARAMETER_SCOPE 1u
#define SCOPE_STATE_BYTES 29u

/** What comes next on the line. */
enum { PART_SYN,
       PART_SIZE,
       PART_NODE,
       PART_DATA,
       PART_SUM,
       ANSWER_SYN,
       ANSWER_SIZE,
       ANSWER_NODE,
       ANSWER_DATA,
       ANSWER_SUM };

/** Service 0: versions of protocol and program, longest data, a dsPIC; no dates; state: the program runs. */
#define INFO_BYTES 44u
#define INFO_STATE 33
static const uint8_t device_info[INFO_BYTES] = { 5, 0, 1, 0, 255, 0x10, 0x82, [INFO_STATE] = 1 };

lnet_t board_lnet;

void lnet_init(uint8_t *memory, uint8_t size)
{
    lnet_t *l = &board_lnet;
    l->scope.mode = (uint16_t)SCOPE_IDLE;
    l->scope.last = board_scope_array + SCOPE_ARRAY_WORDS;
    l->scope.at = board_scope_array;
    l->scope.event = board_scope_array;
    l->scope.channels = 0;
    l->scope.periods = 1;
    l->scope.delay = 0;
    l->memory = memory;
    l->memory_size = size;
    l->part = PART_SYN;
    l->special = 0;
    l->is_up = 0;
}

uint16_t lnet_is_busy(void)
{
    return (uint16_t)(board_lnet.is_up || board_lnet.part != (uint8_t)PART_SYN);
}

void lnet_tick(uint16_t elapsed_ms)
{
    lnet_t *l = &board_lnet;
    l->quiet_ms = (uint16_t)(l->quiet_ms + elapsed_ms);
    if (l->quiet_ms >= LNET_QUIET_MS) {
        l->quiet_ms = LNET_QUIET_MS;
        if (l->part < (uint8_t)ANSWER_SYN) {
            l->part = PART_SYN;
            l->special = 0;
        }
    }
}

/* ---- services ---- */

/** Words where they are aligned, so that none is torn. */
static void copy(uint8_t *to, const volatile void *from, uint16_t bytes)
{
    const volatile uint8_t *byte = from;
    while (bytes != 0u) {
        if (bytes >= 2u && ((uintptr_t)byte & 1u) == 0u) {
            uint16_t word = *(const volatile uint16_t *)(const volatile void *)byte;
            to[0] = (uint8_t)word;
            to[1] = (uint8_t)(word >> 8);
            to += 2;
            byte += 2;
            bytes = (uint16_t)(bytes - 2u);
        } else {
            *to++ = *byte++;
            bytes--;
        }
    }
}

/** Fills the memory from `at` on with what is left of the answer. */
static void fetch(lnet_t *l, uint8_t at, uint8_t left)
{
    uint8_t room = (uint8_t)(l->memory_size - at), bytes = (left < room) ? left : room;
    copy(l->memory + at, l->source, bytes);
    l->source = (const volatile uint8_t *)l->source + bytes;
    l->at = 0;
}

/** An answer with so many bytes after service and error. */
static void answer(lnet_t *l, uint8_t service, uint8_t error, uint8_t bytes)
{
    l->memory[0] = service;
    l->memory[1] = error;
    l->size = (uint8_t)(REPLY_HEAD + bytes);
    l->done = 0;
    l->at = 0;
    l->special = 0;
    l->part = ANSWER_SYN;
}

/** An answer that goes on with memory. */
static void answer_from(lnet_t *l, uint8_t service, const volatile void *source, uint8_t bytes)
{
    answer(l, service, LNET_ERROR_OK, bytes);
    l->source = source;
    fetch(l, REPLY_HEAD, bytes);
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
    uint16_t n;
    for (n = 0; n < bytes; n++) {
        if ((address & 1u) == 0u && n + 1u < bytes) {
            *(volatile uint16_t *)MEMORY_AT(address) = (uint16_t)(from[n] | (uint16_t)(from[n + 1u] << 8));
            address = (uint16_t)(address + 2u);
            n++;
        } else {
            *(volatile uint8_t *)MEMORY_AT(address) = from[n];
            address++;
        }
    }
}

/** Carries a request out. @param request service and what follows @param size of it */
static void serve(lnet_t *l, const uint8_t *request, uint8_t size)
{
    uint8_t service = request[0], error = LNET_ERROR_FORMAT, bytes = request[3];
    uint16_t address = (uint16_t)(request[1] | (uint16_t)(request[2] << 8)); /* or the parameter's number */

    switch (service) {
    case LNET_DEVICE_INFO:
        answer_from(l, service, device_info, INFO_BYTES);
        return;
    case LNET_GET_RAM:
        if (bytes > LNET_MOST_BYTES) {
            error = LNET_ERROR_SIZE;
        } else if (size == 5u && bytes != 0u && memory_is_ram(address, bytes)) {
            answer_from(l, service, MEMORY_AT(address), bytes);
            return;
        } else {
            /* refused */
        }
        break;
    case LNET_PUT_RAM:
        if (size == 4u + bytes && bytes != 0u && may_write(address, bytes)) {
            store(address, request + 4, bytes);
            error = LNET_ERROR_OK;
        }
        break;
    case LNET_LOAD_PARAMETER:
        if (size == 3u && address == PARAMETER_SCOPE) {
            answer(l, service, LNET_ERROR_OK, SCOPE_STATE_BYTES);
            (void)scope_put(&l->scope, l->memory + REPLY_HEAD);
            return;
        }
        break;
    case LNET_SAVE_PARAMETER:
        if (size >= 4u && address == PARAMETER_SCOPE && scope_start(&l->scope, request + 3, (uint16_t)(size - 3u))) {
            error = LNET_ERROR_OK;
        }
        break;
    default:
        error = LNET_ERROR_SERVICE;
        break;
    }
    answer(l, service, error, 0);
}

/* ---- frames ---- */

/** Bytes that begin something on the line are followed by a fill byte where they are data. */
static uint8_t special_of(uint8_t byte)
{
    return (uint8_t)((byte == LNET_SYN || byte == LNET_KEY) ? byte : 0u);
}

/** The checksum as it is sent. */
static uint8_t sum_sent(const lnet_t *l)
{
    return (uint8_t)((special_of(l->sum) != 0u) ? ~l->sum : l->sum);
}

static void begin_frame(lnet_t *l)
{
    l->part = PART_SIZE;
    l->sum = LNET_SYN;
    l->done = 0;
}

/** The last byte of a frame. Before the first valid one, nothing is answered to what may be noise. */
static void end_frame(lnet_t *l, uint8_t sum)
{
    const uint8_t *request = l->is_up ? l->memory : l->first;
    uint16_t room = l->is_up ? l->memory_size : LNET_FIRST;

    l->part = PART_SYN;
    if (!l->is_mine) {
        return;
    }
    if (sum != sum_sent(l)) {
        if (l->is_up) {
            answer(l, request[0], LNET_ERROR_CHECKSUM, 0);
        }
    } else {
        l->is_up = 1;
        if (l->size > room) {
            answer(l, request[0], LNET_ERROR_SIZE, 0);
        } else {
            serve(l, request, l->size);
        }
    }
}

/** A byte between SYN and checksum. */
static void take(lnet_t *l, uint8_t byte)
{
    l->sum = (uint8_t)(l->sum + byte);
    l->special = special_of(byte);
    if (l->part == (uint8_t)PART_SIZE) {
        l->size = byte;
        l->part = PART_NODE;
    } else if (l->part == (uint8_t)PART_NODE) {
        l->is_mine = (uint8_t)(byte == LNET_NODE);
        l->part = (uint8_t)((l->size != 0u) ? PART_DATA : PART_SYN);
    } else {
        if (l->is_up && l->done < l->memory_size) {
            l->memory[l->done] = byte;
        }
        if (!l->is_up && l->done < LNET_FIRST) {
            l->first[l->done] = byte;
        }
        l->done++;
        l->part = (uint8_t)((l->done == l->size) ? PART_SUM : PART_DATA);
    }
}

void lnet_receive(uint8_t byte)
{
    lnet_t *l = &board_lnet;
    uint8_t before = l->special;

    if (l->part >= (uint8_t)ANSWER_SYN) {
        return;
    }
    l->quiet_ms = 0;
    l->special = 0;
    if (before != 0u && byte == 0u) {
        return; /* the fill byte */
    }
    if (before == LNET_SYN) {
        begin_frame(l); /* it was no data: the frame before it has broken off */
    } else if (before != 0u) {
        l->part = PART_SYN;
    } else {
        /* no fill byte was due */
    }
    if (l->part == (uint8_t)PART_SYN || (l->part == (uint8_t)PART_SUM && byte == LNET_SYN)) {
        l->part = PART_SYN;
        if (byte == LNET_SYN) {
            begin_frame(l);
        }
    } else if (l->part == (uint8_t)PART_SUM) {
        end_frame(l, byte);
    } else {
        take(l, byte);
    }
}

/** The next byte of the answer's data. */
static uint8_t next_data(lnet_t *l)
{
    uint8_t byte;
    if (l->at == l->memory_size) {
        fetch(l, 0, (uint8_t)(l->size - l->done));
    }
    byte = l->memory[l->at];
    l->at++;
    l->done++;
    return byte;
}

int16_t lnet_next(void)
{
    lnet_t *l = &board_lnet;
    uint8_t byte;

    if (l->part < (uint8_t)ANSWER_SYN) {
        return -1;
    }
    if (l->special != 0u) {
        l->special = 0;
        return 0; /* the fill byte */
    }
    if (l->part == (uint8_t)ANSWER_SUM) {
        l->part = PART_SYN;
        return sum_sent(l);
    }
    if (l->part == (uint8_t)ANSWER_SYN) {
        l->sum = LNET_SYN;
        l->part = ANSWER_SIZE;
        return (int16_t)LNET_SYN;
    }
    if (l->part == (uint8_t)ANSWER_SIZE) {
        byte = l->size;
        l->part = ANSWER_NODE;
    } else if (l->part == (uint8_t)ANSWER_NODE) {
        byte = LNET_NODE;
        l->part = ANSWER_DATA;
    } else {
        byte = next_data(l);
        l->part = (uint8_t)((l->done == l->size) ? ANSWER_SUM : ANSWER_DATA);
    }
    l->sum = (uint8_t)(l->sum + byte);
    l->special = special_of(byte);
    return byte;
}

#endif
