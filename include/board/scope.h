/* The scope: up to eight variables, a row of them every so many control interrupts, into what RAM is left; with trigger and pre-trigger. */
#ifndef BOARD_SCOPE_H
#define BOARD_SCOPE_H

#include "board/modes/scope_room.h"
#include "control/qmath.h"

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
    volatile int16_t mode;                                /**< scope_mode_t; the control interrupt ends it */
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

/** The usual row in a straight line. Its addresses are volatile to be read first: none is used in the cycle after it was read.
 *  @return where the next one goes */
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
    } else {
        /* it has always been there */
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

/** A row that is not the usual one: any length, whatever it costs. */
void scope_record_unusual(scope_t *s);

/** The last work of a period. @param begin of the array */
QM_INLINE void scope_tick(scope_t *s, int16_t *begin)
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

/** Rows go here. */
extern int16_t board_scope_array[SCOPE_ARRAY_WORDS];

/** Nothing has been recorded. */
void scope_init(scope_t *s);

/** A request to record, as it stands in a frame: state, channels, periods between rows, channels, trigger. Without channels the scope stops.
 *  @return 1 if it was understood; in any case a running record has ended */
uint16_t scope_start(scope_t *s, const uint8_t *request, uint16_t size);

/** What the scope has done, as it stands in a frame. @param record at an even address, with room for thirty bytes */
void scope_put(const scope_t *s, void *record);

#endif
#endif
