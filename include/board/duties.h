/* The way of the duties to the PWM: written as soon as they are computed, or, where they are late, at the begin of the next period (drive/late.h). */
#ifndef BOARD_DUTIES_H
#define BOARD_DUTIES_H

#include <xc.h>

#include "drive/late.h"

/** The duties load when the counter reaches zero. @return 1 once it counts up: too late */
QM_INLINE uint16_t duties_write(const duties_t *duty)
{
    P1DC1 = duty->a;
    P1DC2 = duty->b;
    P1DC3 = duty->c;
    return (uint16_t)((P1TMR & 0x8000u) == 0u);
}

/** Where the law puts them. @param waiting until the next period @param now written in this one */
QM_INLINE duties_t *duties_place(duties_t *waiting, duties_t *now)
{
    return LATE_DUTIES ? waiting : now;
}

/** Before the law: those that have waited. @return 1 too late */
QM_INLINE uint16_t duties_write_waiting(const duties_t *duty)
{
    return (uint16_t)(LATE_DUTIES ? duties_write(duty) : 0u);
}

/** After the law: those that do not wait. @return 1 too late */
QM_INLINE uint16_t duties_write_now(const duties_t *duty)
{
    return (uint16_t)(LATE_DUTIES ? 0u : duties_write(duty));
}

/** 1 where the duties are the law's. Late ones come a period after it has begun: until then they are 0, as those of a bridge that does not switch. */
QM_INLINE uint16_t duties_are_the_laws(void)
{
    return (uint16_t)(!LATE_DUTIES || (P1DC1 | P1DC2 | P1DC3) != 0u);
}

#endif
