/* The scope, and LNet, the protocol of X2C-Scope clients that reads and writes memory and runs it (docs/scope.md).
 *
 * The scope records up to eight variables, a row of them every so many control interrupts, into what RAM is left; with trigger and pre-trigger. */
#ifndef BOARD_SCOPE_H
#define BOARD_SCOPE_H

#include "board/modes/mode_board.h"

#ifndef __XC16__
#include <xc.h> /* the PC's: where the window is */
#endif

#define SCOPE_WORDS 8u /* of a row: 16-bit variables; a 32-bit one takes two */
#define SCOPE_USUAL_WORDS 4u
#define SCOPE_ARRAY_WORDS (SCOPE_BYTES / 2u)

/** What it does: the low byte as clients know it. */
typedef enum {
    SCOPE_IDLE,
    SCOPE_TRIGGERED,                 /**< records before the trigger is looked for, or after it */
    SCOPE_AUTO,                      /**< records at once */
    SCOPE_LOOKS_UNUSUAL = 0x4001,    /**< records and looks for the trigger, with rows that are not SCOPE_USUAL_WORDS long */
    SCOPE_LOOKS = (int16_t)(-0x7FFF) /**< the same with rows of SCOPE_USUAL_WORDS: negative, for it is told apart by its sign */
} scope_mode_t;

/** The scope. The background changes it in SCOPE_IDLE only, and the mode last. */
typedef struct {
    volatile int16_t mode;                                /**< scope_mode_t; the slow work ends it */
    uint16_t wait, periods;                               /**< until the next row, and from row to row */
    int16_t looking;                                      /**< mode while the trigger is looked for */
    int16_t then;                                         /**< mode after the trigger's row: SCOPE_IDLE if it is the last */
    uint16_t is_rare;                                     /**< 1: rows are not SCOPE_USUAL_WORDS long, or come before the trigger is looked for */
    int16_t *volatile at;                                 /**< where the next row goes; the end of the array for its begin */
    int16_t *ring_begin, *ring_end;                       /**< while it looks: one row, where nothing from before the trigger is kept */
    int16_t *last;                                        /**< end of the array's last row */
    uint16_t words;                                       /**< of a row */
    uint16_t before;                                      /**< rows to come before the trigger is looked for */
    uint16_t left;                                        /**< rows to come after that of the trigger; without one: all */
    uint16_t is_low;                                      /**< not 0: the value has been on the other side of the level */
    const volatile uint16_t *volatile trigger;            /**< compared with the level */
    uint16_t flip;                                        /**< bits that turn "it has come" into "not below the level, signed" */
    int16_t level;                                        /**< flipped */
    const volatile int16_t *volatile source[SCOPE_WORDS]; /**< of each word */
    const int16_t *event;                                 /**< end of the trigger's row */
    int16_t delay;                                        /**< bytes that are kept from before the trigger; negative: left out after it */
    uint16_t channels;
} scope_t;

#if SCOPE
/** The last work of a period. @param begin of the array */
void scope_tick(scope_t *s, int16_t *begin);

/** Rows go here. */
extern int16_t board_scope_array[SCOPE_ARRAY_WORDS];
#endif

/* ---- The memory that a client on the serial line may see, by 16-bit addresses: the chip's own; on a PC the window of tools/cpu_host ---- */

#define MEMORY_RAM_START 0x0800u

#ifdef __XC16__
extern uint16_t _SP_init; /* the linker's: its address is where the variables end and the stack begins */
#define MEMORY_RAM_BYTES 0x0800u
#define MEMORY_VARIABLE_BYTES ((uint16_t)((uint16_t)(uintptr_t)&_SP_init - MEMORY_RAM_START))
#define MEMORY_AT(address) ((volatile void *)(uintptr_t)(address))
#define MEMORY_ADDRESS(pointer) ((uint16_t)(uintptr_t)(pointer))
#else
#define MEMORY_RAM_BYTES ((uint16_t)host_window_bytes())
#define MEMORY_VARIABLE_BYTES MEMORY_RAM_BYTES
#define MEMORY_AT(address) ((volatile void *)(host_window() + ((address)-MEMORY_RAM_START)))
#define MEMORY_ADDRESS(pointer) ((uint16_t)((const volatile uint8_t *)(pointer)-host_window() + (ptrdiff_t)MEMORY_RAM_START))
#endif

/* ---- LNet, the protocol of X2C-Scope clients, on the serial line: answers frames, reads and writes memory, runs the scope (docs/scope.md) ---- */

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
