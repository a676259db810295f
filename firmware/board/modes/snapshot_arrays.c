/* SNAPSHOT on the board: AN1292's arrays. */
#include "board/modes/snapshot_arrays.h"

#ifdef SNAPSHOT
int16_t SnapBuf1[DATA_BUFFER_SIZE], SnapBuf2[DATA_BUFFER_SIZE], SnapBuf3[DATA_BUFFER_SIZE], SnapBuf4[DATA_BUFFER_SIZE];
volatile uint16_t SnapStart, SnapDone;
snapshot_t board_snapshot = {
    { SnapBuf1, SnapBuf2, SnapBuf3, SnapBuf4 }, DATA_BUFFER_SIZE, SNAPDELAY, &SnapStart, &SnapDone, 0, 0
};
#endif
