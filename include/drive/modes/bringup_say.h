/* BRINGUP: what every step does with its lines: it says, asks, finds what is wrong, and goes on. */
#ifndef DRIVE_MODES_BRINGUP_SAY_H
#define DRIVE_MODES_BRINGUP_SAY_H

#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

/** A line without a value. */
void bringup_say(bringup_guide_t *g, bringup_kind_t kind, uint16_t code, uint16_t part);

/** On to a step, from its beginning. */
void bringup_go(bringup_guide_t *g, bringup_step_t step);

/** Something is wrong; the rest can be checked nevertheless. */
void bringup_find(bringup_guide_t *g, bringup_finding_t finding, uint16_t part);

/** Something is wrong, and the rest has no meaning or is dangerous: to the end. */
void bringup_give_up(bringup_guide_t *g, bringup_finding_t finding, uint16_t part);

/** A value with its range. @return 1 if it is inside */
uint16_t bringup_tell(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high);

/** A value with its range; outside of it the finding follows. */
void bringup_tell_or_find(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high,
                          bringup_finding_t finding);

/** Asks once and waits. @return the button that answers, 2 or 3; 0: none yet */
uint16_t bringup_answered(bringup_guide_t *g, bringup_question_t question, uint16_t part, int32_t value);

#endif

#endif
