/* Refuses a userparams.h that cannot work: every value against its range, and the values against each other, by name. */
#include "drive/modes/mode_table.h"
#include "drive/param_limits.h"
#include "drive/param_scaling.h"

#if defined(SPEEDCNTR_ITERM) || defined(SPEEDCNTR_CTERM)
#error userparams.h: SPEEDCNTR_ITERM and SPEEDCNTR_CTERM mean nothing: the load observer (LOAD_BANDWIDTH_HZ) takes the place of the integral, remove them
#endif

#pragma GCC diagnostic ignored "-Woverflow" /* what a value out of range does to the formulas of the relations */

/* The motor's own 1/Kphi in a table: its relation says once if it does not fit. */
#define FOLLOWS_KPHI(name) (__builtin_strcmp(PARAM_TEXT(name), PARAM_TEXT(NORM_INVKFIBASE)) == 0)
#define IN_RANGE(name, min, max) ((PARAM_F(name) >= PARAM_F(min) && PARAM_F(name) <= PARAM_F(max)) || FOLLOWS_KPHI(name))
#define IS_WHOLE(name) (PARAM_F(name) <= (float)(int32_t)PARAM_F(name))

#define CHECK_RANGE(name, unit, min, max, value, meaning) \
    PARAM_CHECK(range_of_##name) \
    { \
        if (!IN_RANGE(name, min, max)) \
            PARAM_REFUSE(outside_##name, #name " = " PARAM_TEXT(name) " is outside " PARAM_RANGE(unit, min, max, meaning) ": correct it") \
        else if (PARAM_COUNTED(unit) && !IS_WHOLE(name)) \
            PARAM_REFUSE(part_##name, #name " = " PARAM_TEXT(name) " must be a whole number, " PARAM_RANGE(unit, min, max, meaning)) \
    }
PARAM_TABLE(CHECK_RANGE)

/* One wrong value breaks several relations: they are asked only when each value alone is right, and the first that fails ends it. */
#define RANGE_HOLDS(name, unit, min, max, value, meaning) \
    &&IN_RANGE(name, min, max) && (!PARAM_COUNTED(unit) || IS_WHOLE(name))
#define CHECK_RELATION(condition, message) CHECK_RELATION_N(__COUNTER__, condition, message)
#define CHECK_RELATION_N(n, condition, message) CHECK_RELATION_N_(n, condition, message)
#define CHECK_RELATION_N_(n, condition, message) \
    else if (!(condition)) \
        PARAM_REFUSE(relation_##n, message)
PARAM_CHECK(relations)
{
    if (!(1 PARAM_TABLE(RANGE_HOLDS))) {
    }
    MODE_RELATION_TABLE(CHECK_RELATION)
    PARAM_RELATION_TABLE(CHECK_RELATION)
}
