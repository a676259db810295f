/* LNet, the protocol of X2C-Scope clients, on the serial line: answers frames, reads and writes memory, runs the scope (docs/scope.md). */
#ifndef BOARD_LNET_H
#define BOARD_LNET_H

#include "board/modes/identify_report.h"
#include "board/scope.h"

#include "drive/param_scaling.h" /* SCOPE */

#define LNET_SYN 0x55u
#define LNET_KEY 0x02u /* as SYN followed by a fill byte where it is data */
#define LNET_NODE 1u
#define LNET_ROOM ((uint16_t)MODE_LINE_SIZE) /* for a frame, even */
#define LNET_FIRST 8u                        /* bytes of the first request; the later ones have the status line's memory */
#define LNET_MOST_BYTES 253u                 /* of memory in an answer */
#define LNET_QUIET_MS 100u                   /* silence that ends a frame which is not complete */

/** X(number, name, meaning): services. */
#define LNET_SERVICE_TABLE(X) \
    X(0, DEVICE_INFO, "what is there") \
    X(9, GET_RAM, "read memory") \
    X(10, PUT_RAM, "write variables") \
    X(17, LOAD_PARAMETER, "what the scope has done") \
    X(18, SAVE_PARAMETER, "start or stop the scope")

/** X(number, name, meaning): how a request ends. */
#define LNET_ERROR_TABLE(X) \
    X(0, OK, "done") \
    X(19, CHECKSUM, "the checksum is wrong") \
    X(20, FORMAT, "wrong length, an address that is not allowed, or settings that the scope cannot have") \
    X(21, SIZE, "longer than the memory for it") \
    X(33, SERVICE, "no such service")

#define LNET_SERVICE(number, name, meaning) LNET_##name = (number),
#define LNET_ERROR(number, name, meaning) LNET_ERROR_##name = (number),
enum { LNET_SERVICE_TABLE(LNET_SERVICE) };
enum { LNET_ERROR_TABLE(LNET_ERROR) };

/** The line: requests and answers take turns. */
typedef struct {
    scope_t scope;
    uint8_t *buffer;                /**< a frame from its size to its last byte of data, as far as there is room */
    uint16_t room;                  /**< of it, even */
    uint8_t *memory;                /**< the buffer from the first valid frame on */
    const volatile uint8_t *source; /**< what an answer goes on with where the buffer ends */
    uint16_t quiet_ms;              /**< since the last byte of a request that is not complete */
    uint16_t part;                  /**< what comes next */
    uint16_t special;               /**< the byte that the next one must fill, or 0 */
    uint16_t left;                  /**< bytes of a frame that are still to come or to be sent, its sum not counted */
    uint16_t at;                    /**< in the buffer */
    uint16_t sum;
    uint16_t is_up;            /**< 1 from the first valid frame on */
    uint8_t first[LNET_FIRST]; /**< the buffer before that */
} lnet_t;

#if SCOPE

/** One link, one scope. */
extern lnet_t board_lnet;

/** Nothing received, nothing recorded. @param memory of the status line, LNET_ROOM bytes, which the first valid frame takes over */
void lnet_init(uint8_t *memory);

/** A byte from the line. While an answer is under way it is dropped: a client waits for its answer. */
void lnet_receive(uint8_t byte);

/** The next byte of an answer. @return 0 to 255, or -1: nothing to send */
int16_t lnet_next(void);

/** Time goes by. */
void lnet_tick(uint16_t elapsed_ms);

/** Not 0 while the line belongs to a client: one has sent a valid frame, or what may become the first one comes in. */
uint16_t lnet_is_busy(void);

#endif
#endif
