/* Refuses a userparams.h that cannot work: every value against its range, and the values against each other, by name. */
#include "drive/modes/mode_table.h"
#include "drive/param_limits.h"
#include "drive/param_scaling.h"

#if defined(SPEEDCNTR_ITERM) || defined(SPEEDCNTR_CTERM)
#error userparams.h: SPEEDCNTR_ITERM and SPEEDCNTR_CTERM mean nothing: the load observer (LOAD_BANDWIDTH_HZ) takes the place of the integral, remove them
#endif

#pragma GCC diagnostic ignored "-Woverflow"    /* what a value out of range does to the formulas of the relations */
#pragma GCC diagnostic ignored "-Wdiv-by-zero" /* IS_CONSTANT tells of it, by name */

/* The motor's own 1/Kphi in a table: its relation says once if it does not fit. */
#define FOLLOWS_KPHI(name) (__builtin_strcmp(PARAM_TEXT(name), PARAM_TEXT(NORM_INVKFIBASE)) == 0)
#define IN_RANGE(name, min, max) ((PARAM_F(name) >= PARAM_F(min) && PARAM_F(name) <= PARAM_F(max)) || FOLLOWS_KPHI(name))
#define IS_WHOLE(name) (PARAM_F(name) <= (float)(int32_t)PARAM_F(name))

/* 5/2 is 2 to C, and (5/2) too; 20/10 is what it looks like, of (20/10) nobody can tell. */
#define IS_INTEGER(name) ((((name)*0 + 1) / 2) <= 0)
#ifdef __OPTIMIZE__                                                                                /* as param_text.c: else no text is looked at */
#define HAS_QUOTIENT(text) (sizeof(text) <= 80 && __builtin_strcspn(text, "/") < sizeof(text) - 1) /* a longer one is computed from other parameters */
#else
#define HAS_QUOTIENT(text) 0
#endif
#define IS_FRACTION(name) ((float)(1.0 * name) > PARAM_F(name) || (float)(1.0 * name) < PARAM_F(name))
#define IS_DIVIDED(name) (HAS_QUOTIENT(PARAM_TEXT(name)) && IS_INTEGER(name) && (PARAM_TEXT(name)[0] == '(' || IS_FRACTION(name)))
#define IS_CONSTANT(name) __builtin_constant_p((int32_t)PARAM_F(name))

#define CHECK_RANGE(name, unit, min, max, value, meaning) \
    PARAM_CHECK(range_of_##name) \
    { \
        if (!IS_CONSTANT(name)) \
            PARAM_REFUSE(divided_##name, #name " = " PARAM_TEXT(name) " divides by 0: write a number, " PARAM_RANGE(unit, min, max, meaning)) \
        else if (IS_DIVIDED(name)) \
            PARAM_REFUSE(fraction_##name, #name " = " PARAM_TEXT(name) " divides whole numbers, of which C drops the fraction: write one with a decimal " \
                                                                       "point, or the result, " PARAM_RANGE(unit, min, max, meaning)) \
        else if (!IN_RANGE(name, min, max)) \
            PARAM_REFUSE(outside_##name, #name " = " PARAM_TEXT(name) " is outside " PARAM_RANGE(unit, min, max, meaning) ": correct it") \
        else if (PARAM_COUNTED(unit) && !IS_WHOLE(name)) \
            PARAM_REFUSE(part_##name, #name " = " PARAM_TEXT(name) " must be a whole number, " PARAM_RANGE(unit, min, max, meaning)) \
    }
PARAM_TABLE(CHECK_RANGE)

/* One wrong value breaks several relations: they are asked only when each value alone is right, and the first of a group that fails ends it.
 * tools/make/userparams.sh has an empty OR_ELSE and with it all that fail, for it knows which of them may be one mistake. */
#ifndef OR_ELSE
#define OR_ELSE else
#endif
#define THE_OTHERS_HOLD (1 PARAM_RELATION_ALONE(HOLDS) PARAM_RELATION_SPEEDS(HOLDS) PARAM_RELATION_CURRENTS(HOLDS) PARAM_RELATION_BUS(HOLDS))
#define RANGE_HOLDS(name, unit, min, max, value, meaning) \
    &&IS_CONSTANT(name) && IN_RANGE(name, min, max) && (!PARAM_COUNTED(unit) || IS_WHOLE(name))
#define RANGES_HOLD (1 PARAM_TABLE(RANGE_HOLDS))
#define HOLDS(condition, message) &&(condition)
#define CHECK_RELATION(condition, message) CHECK_RELATION_N(__COUNTER__, condition, message)
#define CHECK_RELATION_N(n, condition, message) CHECK_RELATION_N_(n, condition, message)
#define CHECK_RELATION_N_(n, condition, message) \
    if (!(condition)) \
        PARAM_REFUSE(relation_##n, message) \
    OR_ELSE
#define CHECK_ALONE(condition, message) \
    CHECK_RELATION(condition, message) \
    { \
    }
#define CHECK_GROUP(name, asked, ...) \
    PARAM_CHECK(name) \
    { \
        if (asked) { \
            __VA_ARGS__ \
            { \
            } \
        } \
    }
CHECK_GROUP(relations_alone, RANGES_HOLD, PARAM_RELATION_ALONE(CHECK_ALONE))
CHECK_GROUP(relations_speeds, RANGES_HOLD, PARAM_RELATION_SPEEDS(CHECK_RELATION))
CHECK_GROUP(relations_currents, RANGES_HOLD, PARAM_RELATION_CURRENTS(CHECK_RELATION))
CHECK_GROUP(relations_bus, RANGES_HOLD, PARAM_RELATION_BUS(CHECK_RELATION))
CHECK_GROUP(relations_rest, RANGES_HOLD && (sizeof(PARAM_TEXT(OR_ELSE)) == 1 || THE_OTHERS_HOLD), MODE_RELATION_TABLE(CHECK_RELATION) PARAM_RELATION_REST(CHECK_RELATION))
CHECK_GROUP(relations_entries, (RANGES_HOLD && PARAM_INVKFI < 32767.0F && PARAM_INVKFI_FITS(0)), PARAM_RELATION_ENTRIES(CHECK_ALONE))
