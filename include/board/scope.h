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

/** The scope. The background changes it in SCOPE_IDLE only, and the mode last. */
typedef struct {
    volatile uint16_t mode;                      /**< scope_mode_t; the control interrupt ends it */
    uint16_t wait, periods;                      /**< until the next row, and from row to row */
    int16_t *at, *end;                           /**< where the next row goes, and the end of the last one in the ring */
    uint16_t words;                              /**< of a row */
    uint16_t left;                               /**< rows to come before the trigger may come, or after it; 0: it may come now */
    uint16_t after;                              /**< rows from the trigger on; 0: it has come */
    uint16_t stays;                              /**< 1: nothing from before the trigger is kept */
    const volatile int16_t *trigger;             /**< compared with the level */
    uint16_t flip;                               /**< bits that turn "falls to" or "unsigned" into "rises to" and "signed" */
    int16_t level;                               /**< flipped */
    uint16_t was_below;                          /**< 1: the next value that is not below the level is the trigger */
    const volatile int16_t *source[SCOPE_WORDS]; /**< of each word */
    const int16_t *event;                        /**< the trigger's row */
    int16_t delay;                               /**< bytes that are kept from before the trigger; negative: left out after it */
    uint16_t channels;
} scope_t;

/** Has the trigger come in this row? Then what is left is known. */
QM_INLINE uint16_t scope_fires(scope_t *s)
{
    if ((int16_t)((uint16_t)*s->trigger ^ s->flip) < s->level) {
        s->was_below = 1;
        return 0;
    }
    if (!s->was_below) {
        return 0;
    }
    s->left = s->after;
    s->after = 0;
    s->event = s->at;
    return 1;
}

/** A row. The usual one is copied in a straight line, others in a loop. @param begin of the array */
QM_INLINE void scope_row(scope_t *s, int16_t *begin)
{
    const volatile int16_t *const *source = s->source;
    int16_t *at = s->at;
    if (s->words == SCOPE_USUAL_WORDS) {
        at[0] = *source[0];
        at[1] = *source[1];
        at[2] = *source[2];
        at[3] = *source[3];
        at += SCOPE_USUAL_WORDS;
    } else {
        uint16_t left = s->words;
        do {
            *at = **source;
            at++;
            source++;
            left--;
        } while (left != 0u);
    }
    if (s->left == 0u && !scope_fires(s)) {
        if (s->stays) {
            return;
        }
    } else if (--s->left == 0u && s->after == 0u) {
        s->mode = (uint16_t)SCOPE_IDLE;
    } else {
        /* it records */
    }
    s->at = (at == s->end) ? begin : at;
}

/** The last work of a period. @param begin of the array */
QM_INLINE void scope_tick(scope_t *s, int16_t *begin)
{
    if (s->mode == (uint16_t)SCOPE_IDLE) {
        return;
    }
    if (--s->wait == 0u) {
        s->wait = s->periods;
        scope_row(s, begin);
    }
}

#if SCOPE

/** Rows go here. */
extern int16_t board_scope_array[SCOPE_ARRAY_WORDS];

/** A request to record, as it stands in a frame: state, channels, periods between rows, channels, trigger. Without channels the scope stops.
 *  @return 1 if it was understood; else nothing has changed but that a running record has ended */
uint16_t scope_start(scope_t *s, const uint8_t *request, uint16_t size);

/** What the scope has done, as it stands in a frame. @return the end */
uint8_t *scope_put(const scope_t *s, uint8_t *at);

#endif
#endif
