/* SNAPSHOT on the board: AN1292's arrays, and the recorder that fills them. */
#ifndef BOARD_MODES_SNAPSHOT_ARRAYS_H
#define BOARD_MODES_SNAPSHOT_ARRAYS_H

#include "board/firmware.h"
#include "drive/modes/snapshot.h"

#ifdef SNAPSHOT
/** Set SnapStart to 1; SnapDone becomes 1 when the arrays are full. Columns: phase current a, q current (Q15 of full
 *  scale), filtered estimated speed (as EstimParm.qVelEstim), estimated angle. */
extern int16_t SnapBuf1[DATA_BUFFER_SIZE], SnapBuf2[DATA_BUFFER_SIZE], SnapBuf3[DATA_BUFFER_SIZE], SnapBuf4[DATA_BUFFER_SIZE];
extern volatile uint16_t SnapStart, SnapDone;
extern snapshot_t board_snapshot;
#endif

/** 1 where the mode has work in every period. */
#ifdef SNAPSHOT
#define MODE_RECORDS 1
#else
#define MODE_RECORDS 0
#endif

/** The mode's part of the slow work. */
QM_INLINE void mode_record(void)
{
#ifdef SNAPSHOT
    snapshot_tick(&board_snapshot, &board_drive);
#endif
}

#endif
