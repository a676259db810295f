/* The retry: a run that a passing fault has ended starts again by itself, after a pause and a stated number of times. */
#ifndef DRIVE_RETRY_H
#define DRIVE_RETRY_H

#include "drive/panel.h"
#include "drive/param_scaling.h"

/** State of the retry. */
typedef struct {
    uint16_t left;      /**< retries left before a fault stays */
    uint16_t first;     /**< drive_fault_t that began it; FAULT_NONE: nothing to tell */
    uint16_t fault;     /**< the one that the pause is for */
    uint16_t asked;     /**< 1: the fault has been asked to go */
    uint32_t waited_ms; /**< in the pause, or in closed loop since the last fault */
} retry_t;

/** All retries left. */
QM_INLINE void retry_init(retry_t *r)
{
    drive_zero(r, sizeof *r);
    if (RETRY_COUNT != 0) {
        r->left = RETRY_COUNT;
    }
}

/** A pass where a run may begin again. */
void retry_pass(retry_t *r, panel_t *panel, drive_t *d, uint16_t elapsed_ms);

/** A pass of the background, after panel_tick(): it clears a fault and wishes a run as S2 would. RETRY_COUNT 0: never. */
QM_INLINE void retry_tick(retry_t *r, panel_t *panel, drive_t *d, uint16_t elapsed_ms)
{
    if (RETRY_COUNT == 0) {
        panel->interrupted = 0;
    } else {
        retry_pass(r, panel, d, elapsed_ms);
    }
}

#endif
