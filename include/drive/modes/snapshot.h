/* SNAPSHOT, AN1292's recorder: four arrays filled with one row every SNAPDELAY periods, on request. */
#ifndef DRIVE_MODES_SNAPSHOT_H
#define DRIVE_MODES_SNAPSHOT_H

#include "drive/drive.h"

/** Recorder; the arrays belong to the board and bear AN1292's names. */
typedef struct {
    int16_t *column[4];       /**< SnapBuf1..4: phase current a, q current, filtered speed, angle */
    uint16_t rows;            /**< DATA_BUFFER_SIZE */
    uint16_t delay;           /**< SNAPDELAY, periods per row */
    volatile uint16_t *start; /**< set to 1 to record; goes back to 0 when done */
    volatile uint16_t *done;  /**< 1 when the arrays are full */
    uint16_t row, wait;
} snapshot_t;

/** One period of the recorder. Currents are in AN1292's format (Q15 of full scale). */
QM_INLINE void snapshot_tick(snapshot_t *s, const drive_t *d)
{
    uint16_t row = s->row;
    if (!*s->start || ++s->wait < s->delay) {
        return;
    }
    s->wait = 0;
    *s->done = 0;
    s->column[0][row] = (int16_t)(4 * qm_clamp(d->phases_q13.a, -8191, 8191));
    s->column[1][row] = (int16_t)(4 * qm_clamp(d->run.control.i_q13.q, -8191, 8191));
    s->column[2][row] = estimator_speed(&d->run.estimator);
    s->column[3][row] = (int16_t)(d->run.estimator.rho_q32 >> 16);
    s->row = (uint16_t)(row + 1u);
    if (s->row >= s->rows) {
        s->row = 0;
        *s->start = 0;
        *s->done = 1;
    }
}

#endif
