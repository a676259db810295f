/* BRINGUP: a step says and asks, finds what is wrong, and goes on. */
#include "drive/modes/bringup_say.h"

#ifdef BRINGUP

void bringup_say(bringup_guide_t *g, bringup_kind_t kind, uint16_t code, uint16_t part)
{
    g->message.kind = (uint16_t)kind;
    g->message.code = code;
    g->message.part = part;
}

void bringup_go(bringup_guide_t *g, bringup_step_t step)
{
    g->step = (uint16_t)step;
    g->index = 0;
    g->phase = 0;
    g->asked = 0;
    g->button = 0;
    g->waited_ms = 0;
}

void bringup_find(bringup_guide_t *g, bringup_finding_t finding, uint16_t part)
{
    g->found++;
    bringup_say(g, BRINGUP_FINDS, (uint16_t)finding, part);
}

void bringup_give_up(bringup_guide_t *g, bringup_finding_t finding, uint16_t part)
{
    bringup_find(g, finding, part);
    bringup_go(g, BRINGUP_STEP_LAST);
}

uint16_t bringup_tell(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high)
{
    bringup_say(g, BRINGUP_TELLS, (uint16_t)what, part);
    g->message.value = value;
    g->message.low = low;
    g->message.high = high;
    return (uint16_t)(value >= low && value <= high);
}

void bringup_tell_or_find(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high,
                          bringup_finding_t finding)
{
    if (!bringup_tell(g, what, part, value, low, high)) {
        g->pending = (uint16_t)finding;
        g->pending_part = part;
    }
}

uint16_t bringup_answered(bringup_guide_t *g, bringup_question_t question, uint16_t part, int32_t value)
{
    uint16_t button = g->button;
    if (!g->asked) {
        bringup_say(g, BRINGUP_ASKS, (uint16_t)question, part);
        g->message.value = value;
        g->asked = 1;
        button = 0;
    } else if (button != 0u) {
        g->asked = 0;
        g->waited_ms = 0;
    } else {
        /* the user thinks */
    }
    g->button = 0;
    return button;
}

#endif
