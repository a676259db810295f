/* The retry: a run that a passing fault has ended starts again by itself, after a pause and a stated number of times. */
#ifndef DRIVE_RETRY_H
#define DRIVE_RETRY_H

#include "control/qmath.h"
#include "drive/forward.h"

/** State of the retry. */
typedef struct {
    uint16_t left;      /**< retries left before a fault stays */
    uint16_t first;     /**< drive_fault_t that began it; FAULT_NONE: nothing to tell */
    uint16_t fault;     /**< the one that the pause is for */
    uint16_t asked;     /**< 1: the fault has been asked to go */
    uint32_t waited_ms; /**< in the pause, or in closed loop since the last fault */
} retry_t;

/** All retries left. */
void retry_init(retry_t *r);

/** A pass of the background, after panel_tick(): it clears a fault and wishes a run as S2 would. RETRY_COUNT 0: never. */
void retry_tick(retry_t *r, panel_t *panel, drive_t *d, uint16_t elapsed_ms);

#endif
