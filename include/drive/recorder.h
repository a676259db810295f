/* The fault recorder: a ring of rows, RECORDER_PERIODS apart, that stops a little after a fault and is kept until the next start. */
#ifndef DRIVE_RECORDER_H
#define DRIVE_RECORDER_H

#include "control/qmath.h"
#include "drive/faults.h"
#include "drive/forward.h"
#include "drive/modes/mode_table.h"

#define RECORDER_ROWS 64  /* six bytes each: 384 of the part's 2048 */
#define RECORDER_AFTER 16 /* of them, those after the fault */

/** The bytes of a row. All but the state's are the upper byte of a word, which is never out of range.
 *
 *  What changes slowly is a word in four rows, its lowest bits first, all of them of the first row's moment: the estimated speed where the
 *  first row's place in the ring is 4, 12, ..., the bus as the converter gives it where it is 0, 8, ... */
enum {
    RECORDER_I_A, /**< as the converter gives it: the head line tells the offsets */
    RECORDER_V_D, /**< commanded, Q14 / 256 */
    RECORDER_I_B,
    RECORDER_V_Q,
    RECORDER_SLOW,  /**< four bits of what changes slowly; the lower four are the state */
    RECORDER_ANGLE, /**< control angle of the next sample, 256 a turn */
    RECORDER_BYTES  /**< of a row */
};

#if SCOPE && !defined(MODE_WITHOUT_RECORDER)
#define MODE_WITHOUT_RECORDER "SCOPE"
#endif
#ifdef MODE_WITHOUT_RECORDER
#define RECORDER_IN_USE_PERIODS 0u
#else
#define RECORDER_IN_USE_PERIODS (RECORDER_PERIODS)
#endif

/** Rows apart, in periods; 0: no recorder. */
#define RECORDER_EVERY ((uint16_t)RECORDER_IN_USE_PERIODS)
#define RECORDER_PLACES (RECORDER_EVERY != 0u ? RECORDER_ROWS : 1)

/** A word's lower byte makes place for the byte before it: cheaper than to take the words apart. */
typedef union {
    int16_t word[RECORDER_BYTES / 2];
    int8_t byte[RECORDER_BYTES];
} recorder_row_t;

/** It outlives a reset: nothing but recorder_restart() gives it a start value. */
typedef struct {
    recorder_row_t row[RECORDER_PLACES]; /**< the newest before the older ones */
    int16_t next;                        /**< bytes before the next row */
    int16_t offset_a_q13;                /**< of the currents, calibrated: after a reset nobody else knows it */
    int16_t offset_b_q13;
    uint16_t slow;         /**< what changes slowly: its lowest four bits are the next row's */
    volatile uint8_t left; /**< RECORDER_AFTER + 1 before a fault, then one less with each row; 0: complete, nothing more is recorded */
    uint8_t full;          /**< 1: every row has been written */
    uint8_t fault;         /**< drive_fault_t, the first since the recorder began */
    uint8_t check;         /**< tells a recorder from what RAM holds after power-up */
} recorder_t;

/** After a reset. A record of a fault, or of what came before a reset that is a fault itself, is kept; else the recorder begins anew.
 *  @param powered_up RAM holds anything @param fault that the drive starts with */
void recorder_restart(recorder_t *r, uint16_t powered_up, drive_fault_t fault);

/** A pass of the background: a start begins a new record, which has the offsets of its run. */
void recorder_background(recorder_t *r, const drive_t *d);

/** Rows of a complete record; 0 before a fault. */
uint16_t recorder_rows(const recorder_t *r);

/** Place in the ring of the row that so many later ones follow: the newest has none. */
uint16_t recorder_place(const recorder_t *r, uint16_t later);

/** 1 in the periods that get a row: every RECORDER_EVERY, those of a slot; with deferred duties those between, which have the time. */
uint16_t recorder_is_due(const drive_t *d);

/** A period in a fault, before recorder_write(). */
void recorder_in_fault(recorder_t *r, const drive_t *d);

/** The last work of a period that gets a row. @param i_a,i_b,v_bus the converter's results; as a structure they would be kept on the stack */
void recorder_write(recorder_t *r, const drive_t *d, int16_t i_a, int16_t i_b, int16_t v_bus);

#endif
