/* The way of the duties to the PWM: written as soon as they are computed, or, where they are late, at the begin of the next period (drive/deferred.h). */
#include "board/duties.h"

#include "drive/param_scaling.h"

#include <xc.h>

/** The duties load when the counter reaches zero. @return 1 once it counts up: too late */
static INLINE uint16_t duties_write(const duties_t *duty)
{
    P1DC1 = duty->a;
    P1DC2 = duty->b;
    P1DC3 = duty->c;
    return (uint16_t)((P1TMR & 0x8000u) == 0u);
}

INLINE duties_t *duties_place(duties_t *waiting, duties_t *now)
{
    return DEFER_DUTIES ? waiting : now;
}

INLINE uint16_t duties_write_waiting(const duties_t *duty)
{
    return (uint16_t)(DEFER_DUTIES ? duties_write(duty) : 0u);
}

INLINE uint16_t duties_write_now(const duties_t *duty)
{
    return (uint16_t)(DEFER_DUTIES ? 0u : duties_write(duty));
}

INLINE uint16_t duties_are_the_laws(void)
{
    return (uint16_t)(!DEFER_DUTIES || (P1DC1 | P1DC2 | P1DC3) != 0u);
}
