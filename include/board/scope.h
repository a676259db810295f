/* The scope: up to eight variables, a row of them every so many control interrupts, into what RAM is left; with trigger and pre-trigger. */
#ifndef BOARD_SCOPE_H
#define BOARD_SCOPE_H

#include "board/modes/scope_room.h"
#include "control/qmath.h"

#define SCOPE_WORDS 8u /* of a row: 16-bit variables; a 32-bit one takes two */
#define SCOPE_USUAL_WORDS 4u
#define SCOPE_ARRAY_WORDS (SCOPE_BYTES / 2u)

/** What it does, as clients know it. */
typedef enum {
    SCOPE_IDLE,
    SCOPE_TRIGGERED, /**< records, or waits for the trigger */
    SCOPE_AUTO       /**< records at once */
} scope_mode_t;

/** The scope. The background changes it in SCOPE_IDLE only, and the mode last. The ring in use is one row until the trigger comes, where nothing
 *  from before it is kept. */
typedef struct {
    volatile uint16_t mode;                               /**< scope_mode_t; the control interrupt ends it */
    uint16_t wait, periods;                               /**< until the next row, and from row to row */
    int16_t *at, *begin, *end;                            /**< where the next row goes, and the ring in use */
    int16_t *last;                                        /**< end of the array's last row */
    uint16_t words;                                       /**< of a row */
    uint16_t is_unusual;                                  /**< 1: a row has not SCOPE_USUAL_WORDS */
    uint16_t left;                                        /**< rows to come before the trigger is looked for, or after it; 0: it is looked for */
    uint16_t after;                                       /**< rows from the trigger on; 0: it has come */
    uint16_t is_low;                                      /**< 1: the value has been on the other side of the level; now it must come over */
    const volatile uint16_t *volatile trigger;            /**< compared with the level */
    uint16_t flip;                                        /**< bits that turn what is waited for into "not below, signed" */
    int16_t level;                                        /**< flipped */
    const volatile int16_t *volatile source[SCOPE_WORDS]; /**< of each word */
    const int16_t *event;                                 /**< the trigger's row */
    int16_t delay;                                        /**< bytes that are kept from before the trigger; negative: left out after it */
    uint16_t channels;
} scope_t;

/** What was waited for has come: first the other side of the level, then the trigger. @param at its row @param begin of the array */
QM_INLINE void scope_comes(scope_t *s, const int16_t *at, int16_t *begin)
{
    if (!s->is_low) {
        s->is_low = 1;
        s->flip = (uint16_t)~s->flip;
        s->level = (int16_t)-s->level;
    } else {
        s->left = (uint16_t)(s->after - 1u);
        s->after = 0;
        s->event = at;
        s->begin = begin;
        s->end = s->last;
        if (s->left == 0u) {
            s->mode = (uint16_t)SCOPE_IDLE;
        }
    }
}

/** A row of any length. @return where the next one goes */
QM_INLINE int16_t *scope_copy_words(const scope_t *s)
{
    const volatile int16_t *const volatile *source = s->source;
    int16_t *at = s->at;
    uint16_t left = s->words;
    do {
        *at = **source;
        at++;
        source++;
        left--;
    } while (left != 0u);
    return at;
}

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

/** The last work of a period. @param begin of the array */
QM_INLINE void scope_tick(scope_t *s, int16_t *begin)
{
    const volatile uint16_t *trigger;
    int16_t *following;
    if (s->mode == (uint16_t)SCOPE_IDLE || --s->wait != 0u) {
        return;
    }
    s->wait = s->periods;
    trigger = s->trigger;
    following = s->is_unusual ? scope_copy_words(s) : scope_copy_usual(s);
    if (s->left == 0u) {
        if ((int16_t)(*trigger ^ s->flip) >= s->level) {
            scope_comes(s, s->at, begin);
        }
    } else if (--s->left == 0u && s->after == 0u) {
        s->mode = (uint16_t)SCOPE_IDLE;
    } else {
        /* it records */
    }
    s->at = (following == s->end) ? s->begin : following;
}

#if SCOPE

/** Rows go here. */
extern int16_t board_scope_array[SCOPE_ARRAY_WORDS];

/** A request to record, as it stands in a frame: state, channels, periods between rows, channels, trigger. Without channels the scope stops.
 *  @return 1 if it was understood; else nothing has changed but that a running record has ended */
uint16_t scope_start(scope_t *s, const uint8_t *request, uint16_t size);

/** What the scope has done, as it stands in a frame. @param record at an even address, with room for thirty bytes */
void scope_put(const scope_t *s, void *record);

#endif
#endif
