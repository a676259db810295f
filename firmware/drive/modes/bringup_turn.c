/* BRINGUP, the last steps: the field turns, the user tells direction and pole pairs. */
#include "drive/modes/bringup_turn.h"

#ifdef BRINGUP

#include "drive/modes/bringup_measure.h"
#include "drive/modes/bringup_say.h"

void bringup_step_direction(bringup_guide_t *g, drive_t *d)
{
    uint16_t button;
    if (bringup_has_tripped(g, d)) {
        return;
    }
    d->run.bringup.most = BRINGUP_MOST_AMPLITUDE;
    d->run.bringup.keeps_current = 1;
    d->run.bringup.turning = 1;
    button = bringup_answered(g, BRINGUP_ASK_DIRECTION, 0, 0);
    if (button == 3u) {
        bringup_find(g, BRINGUP_DIRECTION, 0);
    }
    if (button != 0u) {
        d->run.bringup.turning = 0; /* at the end of this turn */
        bringup_go(g, BRINGUP_STEP_MARK);
    }
}

void bringup_step_mark(bringup_guide_t *g, drive_t *d)
{
    if (bringup_has_tripped(g, d) || bringup_answered(g, BRINGUP_ASK_MARK, 0, 0) == 0u) {
        return;
    }
    d->run.bringup.turns = 0;
    d->run.bringup.turning = 1;
    bringup_go(g, BRINGUP_STEP_TURNS);
}

void bringup_step_turns(bringup_guide_t *g, drive_t *d)
{
    uint16_t button;
    if (bringup_has_tripped(g, d)) {
        return;
    }
    button = bringup_answered(g, BRINGUP_ASK_TURNS, 0, 0);
    if (button == 3u) {
        bringup_find(g, BRINGUP_STANDS, 0);
    } else if (button == 2u) {
        bringup_tell_or_find(g, BRINGUP_VALUE_POLE_PAIRS, 0, (int32_t)d->run.bringup.turns, NOPOLESPAIRS, NOPOLESPAIRS, BRINGUP_POLE_PAIRS);
    } else {
        return;
    }
    bringup_go(g, BRINGUP_STEP_LAST);
}

#endif
