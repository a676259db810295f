/* The fault recorder: a ring of rows, one a period, that stops a little after a fault and is kept until the next start. */
#ifndef DRIVE_RECORDER_H
#define DRIVE_RECORDER_H

#include "drive/drive.h"
#include "drive/modes/recorder_room.h"
#include "drive/param_scaling.h"

#define RECORDER_ROWS 72  /* 12 bytes each: 864 of the part's 2048; the stack needs 494 */
#define RECORDER_AFTER 16 /* of them, those after the fault */

/** The words of a row. The bus and the speed take turns in the last one: both change slowly. */
enum {
    RECORDER_I_A, /**< measured, Q13 */
    RECORDER_I_B,
    RECORDER_V_D, /**< commanded, Q14 */
    RECORDER_V_Q,
    RECORDER_ANGLE, /**< control angle of the next sample; its lowest four bits are the state */
    RECORDER_SLOW,  /**< in even rows of the ring the bus as the converter gives it; in odd ones the estimated speed, electrical rpm */
    RECORDER_WORDS  /**< of a row: 12 bytes */
};
#define RECORDER_STATE_BITS 15u

/** Rows apart, in periods; 0: no recorder. */
#define RECORDER_EVERY ((uint16_t)MODE_RECORDER_PERIODS)
#define RECORDER_FIRST ((int16_t)(RECORDER_EVERY != 0u ? (RECORDER_ROWS - 1) * RECORDER_WORDS : 0)) /**< index of the first row that is written */
#define RECORDER_SIZE (RECORDER_FIRST + RECORDER_WORDS)

/** It outlives a reset: nothing but recorder_restart() gives it a start value. */
typedef struct {
    int16_t word[RECORDER_SIZE]; /**< rows, the newest before the older ones */
    int16_t next;                /**< index of the next row's first word */
    volatile uint16_t left;      /**< RECORDER_AFTER + 1 before a fault, then one less with each row; 0: complete, nothing more is recorded */
    uint16_t full;               /**< 1: every row has been written */
    uint16_t fault;              /**< drive_fault_t, the first since the recorder began */
    uint16_t check;              /**< tells a recorder from what RAM holds after power-up */
} recorder_t;

/** After a reset. A record of a fault, or of what came before a reset that is a fault itself, is kept; else the recorder begins anew.
 *  @param powered_up RAM holds anything @param fault that the drive starts with */
void recorder_restart(recorder_t *r, uint16_t powered_up, drive_fault_t fault);

/** A pass of the background: a start begins a new record. */
void recorder_background(recorder_t *r, const drive_t *d);

/** Rows of a complete record; 0 before a fault. */
uint16_t recorder_rows(const recorder_t *r);

/** Place in the ring of row n of the record, the oldest being row 0. */
uint16_t recorder_place(const recorder_t *r, uint16_t n);

/** 1 in the periods that get a row: those of the slow steps, with late duties those between, which have the time. */
QM_INLINE uint16_t recorder_is_due(const drive_t *d)
{
    return (uint16_t)(RECORDER_EVERY != 0u && (d->ticks & (uint16_t)(RECORDER_EVERY - 1u)) == (uint16_t)LATE_DUTIES);
}

/** A period in a fault, before recorder_tick(). */
QM_INLINE void recorder_in_fault(recorder_t *r, const drive_t *d)
{
    if (r->left != 0u && recorder_is_due(d)) {
        r->left--;
    }
    if (r->fault == (uint16_t)FAULT_NONE) {
        r->fault = d->fault;
    }
}

/** The last work of a period. @param v_bus_raw the converter's result for the bus */
QM_INLINE void recorder_tick(recorder_t *r, const drive_t *d, int16_t v_bus_raw)
{
    int16_t *row;
    int16_t at = r->next, slow = v_bus_raw;

    if (r->left == 0u || !recorder_is_due(d)) {
        return;
    }
    row = &r->word[at];
    if (((uint16_t)at & 2u) != 0u) { /* six words a row: set in every other one */
        slow = estimator_speed(&d->run.estimator);
    }
    row[RECORDER_I_A] = d->phases_q13.a;
    row[RECORDER_I_B] = d->phases_q13.b;
    row[RECORDER_V_D] = d->run.control.v_q14.d;
    row[RECORDER_V_Q] = d->run.control.v_q14.q;
    row[RECORDER_ANGLE] = (int16_t)((d->angle & (uint16_t)~RECORDER_STATE_BITS) | d->state);
    row[RECORDER_SLOW] = slow;
    at = (int16_t)(at - (int16_t)RECORDER_WORDS);
    if (at < 0) {
        at = RECORDER_FIRST;
        r->full = 1;
    }
    r->next = at;
}

#endif
