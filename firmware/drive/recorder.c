/* The fault recorder: a ring of rows, RECORDER_PERIODS apart, that stops a little after a fault and is kept until the next start. */
#include "drive/recorder.h"

#include "drive/drive.h"

#define RECORDER_FIRST ((int16_t)((RECORDER_PLACES - 1) * RECORDER_BYTES)) /**< bytes before the first row that is written */
#define RECORDER_CHECK 0x5Eu

/** From now on a new record. */
static void recorder_begin(recorder_t *r)
{
    drive_zero(r, sizeof *r); /* the test of the RAM reads it all */
    r->check = RECORDER_CHECK;
    r->next = RECORDER_FIRST;
    r->left = RECORDER_AFTER + 1u; /* last: from now on the slow work writes */
}

void recorder_background(recorder_t *r, const drive_t *d)
{
    const uint16_t left = r->left;
    if (left != 0u) {
        r->offset_a_q13 = d->calibration.offset_a_q13;
        r->offset_b_q13 = d->calibration.offset_b_q13;
        if (left <= RECORDER_AFTER && d->fault == (uint16_t)FAULT_NONE) {
            r->left = 0; /* cleared before the last row: what comes now is no part of it */
        }
    } else if (d->command.run) {
        recorder_begin(r);
    } else { /* it is kept */
    }
}

uint16_t recorder_rows(const recorder_t *r)
{
    if (r->left != 0u) { /* without a recorder it begins and never ends, or has no row */
        return 0;
    }
    return (uint16_t)(r->full ? RECORDER_ROWS : (RECORDER_PLACES - 1) - (uint16_t)r->next / (uint16_t)RECORDER_BYTES);
}

uint16_t recorder_place(const recorder_t *r, uint16_t later)
{
    return (uint16_t)((uint16_t)r->next / (uint16_t)RECORDER_BYTES + 1u + later) % RECORDER_ROWS;
}

uint16_t recorder_is_due(const drive_t *d)
{
    return (uint16_t)(RECORDER_EVERY != 0u && (d->ticks & (uint16_t)(RECORDER_EVERY - 1u)) == (uint16_t)DEFER_DUTIES);
}

void recorder_in_fault(recorder_t *r, const drive_t *d)
{
    if (r->left != 0u && recorder_is_due(d)) {
        r->left--;
    }
    if (r->fault == (uint16_t)FAULT_NONE) {
        r->fault = (uint8_t)d->fault;
    }
}

/** The upper byte of a word. */
static int8_t recorder_upper(int16_t word)
{
    return (int8_t)(word >> 8);
}

void recorder_write(recorder_t *r, const drive_t *d, int16_t i_a, int16_t i_b, int16_t v_bus)
{
    recorder_row_t *row;
    int16_t at = r->next;
    uint16_t slow = r->slow;
    if (r->left == 0u) {
        return;
    }
    if (((uint16_t)at & 6u) == 0u) { /* six bytes a row: every fourth place */
        slow = (uint16_t)estimator_speed(&d->run.estimator);
        if (((uint16_t)at & 8u) == 0u) {
            slow = (uint16_t)v_bus;
        }
    }
    row = (recorder_row_t *)(void *)((int8_t *)r->row + at);
    row->word[RECORDER_V_D / 2] = d->run.control.v_q14.d;
    row->word[RECORDER_V_Q / 2] = d->run.control.v_q14.q;
    row->word[RECORDER_ANGLE / 2] = (int16_t)d->angle;
    row->byte[RECORDER_I_A] = recorder_upper(i_a);
    row->byte[RECORDER_I_B] = recorder_upper(i_b);
    row->byte[RECORDER_SLOW] = (int8_t)((uint16_t)(slow << 4) | d->state);
    r->slow = (uint16_t)(slow >> 4);
    at = (int16_t)(at - (int16_t)RECORDER_BYTES);
    if (at < 0) {
        at = RECORDER_FIRST;
        r->full = 1;
    }
    r->next = at;
}

#ifdef MODE_WITHOUT_RECORDER
#pragma message(MODE_WITHOUT_RECORDER " takes the fault recorder's place in RAM: this build has no recorder, whatever RECORDER_PERIODS says")
#endif

/** Whether a reset has left a recorder and no chance content of RAM. */
static uint16_t recorder_is_valid(const recorder_t *r)
{
    return (uint16_t)(r->check == RECORDER_CHECK && r->left <= RECORDER_AFTER + 1u && r->full <= 1u && r->fault < (uint16_t)FAULT_COUNT
                      && (uint16_t)r->next < sizeof r->row && (uint16_t)r->next % (uint16_t)RECORDER_BYTES == 0u);
}

void recorder_restart(recorder_t *r, uint16_t powered_up, drive_fault_t fault)
{
    if (!powered_up && recorder_is_valid(r)) {
        if (r->fault == (uint8_t)FAULT_NONE) {
            r->fault = (uint8_t)fault;
        }
        if (r->fault != (uint8_t)FAULT_NONE) {
            r->left = 0;
            return;
        }
    }
    recorder_begin(r);
}
