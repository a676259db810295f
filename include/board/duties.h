/* The way of the duties to the PWM: written as soon as they are computed, or, where they are late, at the begin of the next period (drive/deferred.h). */
#ifndef BOARD_DUTIES_H
#define BOARD_DUTIES_H

#include "control/qmath.h"
#include "control/svm.h"

/** Where the law puts them. @param waiting until the next period @param now written in this one */
duties_t *duties_place(duties_t *waiting, duties_t *now);

/** Before the law: those that have waited. @return 1 too late */
uint16_t duties_write_waiting(const duties_t *duty);

/** After the law: those that do not wait. @return 1 too late */
uint16_t duties_write_now(const duties_t *duty);

/** 1 where the duties are the law's. Late ones come a period after it has begun: until then they are 0, as those of a bridge that does not switch. */
uint16_t duties_are_the_laws(void);

#endif
