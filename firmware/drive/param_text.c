/* Refuses a userparams.h by its text: a parameter that is missing, empty, octal (05500) or no number (2,67; two; 2.67 ohm), and a mode with = 0.
 *
 * Only the text is looked at, for as an expression such a value gives messages about formulas, in every file that uses it; this file
 * therefore comes first in the build. Without optimisation (-O0) the compiler does not evaluate the texts, and they are not looked at. */
#include "drive/modes/mode_table.h"
#include "drive/param_limits.h"
#include "drive/param_scaling.h"

#ifdef PARAM_OF_AN1292
#error userparams.h: NORM_RS, NORM_LSDTBASE, NORM_INVKFIBASE and NORM_DELTAT are constants of AN1292 that follow from the parameters: remove them, or make import HEADER=file
#endif

#ifdef __OPTIMIZE__
#define IS_EMPTY(text) (sizeof(text) == 1)
#define HAS(characters, character) (__builtin_strchr(characters, character) != 0)
#define IS_DEFINED(word, text) (__builtin_strcmp(word, text) != 0) /* else the preprocessor leaves the name as it is */

/* A number or an expression of constants: it begins as one, and a number in front is followed by the end, an operator or a suffix. */
#define DIGITS ".0123456789"
#define OPERATORS ")+-*/%<>=&|^!?:"
#define ALLOWED DIGITS OPERATORS "(~ _abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
#define FIRST(text) __builtin_strspn(text, "+-~! ")
#define NUMBER(text) __builtin_strspn(text, "+-~!( ")
#define BEHIND(text) (NUMBER(text) + __builtin_strspn((text) + NUMBER(text), DIGITS))
#define BLANKS(text) __builtin_strspn((text) + BEHIND(text), " ")
#define ENDS(text) HAS((BLANKS(text) > 0) ? OPERATORS : OPERATORS "xXeEfFlLuU", (text)[BEHIND(text) + BLANKS(text)])
#define IS_COMPUTED(text) (sizeof(text) > 80) /* from other parameters, whose own texts are looked at */
#define IS_NUMBER(text) \
    (IS_COMPUTED(text) \
     || (__builtin_strspn(text, ALLOWED) == sizeof(text) - 1 && HAS("(" DIGITS, (text)[FIRST(text)]) \
         && (BEHIND(text) == NUMBER(text) || ENDS(text))))

/* 05500 is 2880 to C, 0.5 and 0x5 are what they look like. */
#define AFTER_DIGITS(text) ((text)[NUMBER(text) + __builtin_strspn((text) + NUMBER(text), "0123456789")])
#define IS_OCTAL(text) \
    (!IS_COMPUTED(text) && (text)[NUMBER(text)] == '0' && __builtin_strspn((text) + NUMBER(text), "0123456789") > 1 \
     && AFTER_DIGITS(text) != '.' && AFTER_DIGITS(text) != 'e' && AFTER_DIGITS(text) != 'E')
#define ENDS_IN_SEMICOLON(text) ((text)[sizeof(text) - 2] == ';')

#define ANEW ", or make tune"
#define HOW ", with a decimal point and without a unit"
#define CHECK_TEXT(name, unit, min, max, value, meaning) \
    PARAM_CHECK(text_of_##name) \
    { \
        if (!IS_DEFINED(#name, PARAM_TEXT(name))) \
            PARAM_REFUSE(gone_##name, #name " is missing: add #define " #name " and a number, " PARAM_RANGE(unit, min, max, meaning) ANEW) \
        else if (IS_EMPTY(PARAM_TEXT(name))) \
            PARAM_REFUSE(empty_##name, #name " has no value: write a number, " PARAM_RANGE(unit, min, max, meaning)) \
        else if (ENDS_IN_SEMICOLON(PARAM_TEXT(name))) \
            PARAM_REFUSE(semicolon_##name, #name " = " PARAM_TEXT(name) " ends in a semicolon: write the number without it") \
        else if (!IS_NUMBER(PARAM_TEXT(name))) \
            PARAM_REFUSE(not_##name, #name " = " PARAM_TEXT(name) " is no number: write one, " PARAM_RANGE(unit, min, max, meaning) HOW) \
        else if (IS_OCTAL(PARAM_TEXT(name))) \
            PARAM_REFUSE(octal_##name, #name " = " PARAM_TEXT(name) " is octal to C, for it begins with 0: write it without, " PARAM_RANGE(unit, min, max, meaning)) \
    }
#define CHECK_OPTIONAL(name) \
    PARAM_CHECK(text_of_##name) \
    { \
        if (IS_EMPTY(PARAM_TEXT(name))) \
            PARAM_REFUSE(empty_##name, #name " has no value: remove the line, or write a number") \
        else if (!IS_NUMBER(PARAM_TEXT(name))) \
            PARAM_REFUSE(not_##name, #name " = " PARAM_TEXT(name) " is no number: remove the line, or write a number" HOW) \
    }
#define CHECK_MODE(name, meaning) \
    PARAM_CHECK(text_of_##name) \
    { \
        if (IS_DEFINED(#name, PARAM_TEXT(name)) && !IS_EMPTY(PARAM_TEXT(name)) && __builtin_strcmp(PARAM_TEXT(name), "1") != 0) \
            PARAM_REFUSE(mode_##name, #name " = " PARAM_TEXT(name) " switches the mode on: write #define " #name ", or nothing for off") \
    }

PARAM_TABLE(CHECK_TEXT)
PARAM_OPTIONAL(CHECK_OPTIONAL)
MODE_TABLE(CHECK_MODE)
#endif
