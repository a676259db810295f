/* Refuses a userparams.h that cannot work: every value against its range, and the values against each other, by name. */
#include "drive/param_scaling.h"
#include "drive/param_table.h"

#if defined(SPEEDCNTR_ITERM) || defined(SPEEDCNTR_CTERM)
#error userparams.h: SPEEDCNTR_ITERM and SPEEDCNTR_CTERM mean nothing: the load observer (LOAD_BANDWIDTH_HZ) takes the place of the integral, remove them
#endif

#define CHECK_TEXT_(x) #x
#define CHECK_TEXT(x) CHECK_TEXT_(x)
#define CHECK_RANGE(name, unit, min, max, value, meaning) \
    CHECK(PARAM_F(name) >= PARAM_F(min) && PARAM_F(name) <= PARAM_F(max), \
          "userparams.h: " #name " = " CHECK_TEXT(name) " is outside " #min " .. " #max " " unit)
#define CHECK_RELATION(condition, message) CHECK(condition, "userparams.h: " message)

#if __GNUC__ >= 5
#define CHECK(condition, message) _Static_assert(condition, message);
PARAM_RELATION_TABLE(CHECK_RELATION) /* first: one wrong value can put several others outside their ranges */
PARAM_TABLE(CHECK_RANGE)
#else
/* gcc 4.5 has no _Static_assert: a call that is left after constant folding stops the build with the message. */
#define CHECK(condition, message) CHECK_N(__COUNTER__, condition, message)
#define CHECK_N(n, condition, message) CHECK_N_(n, condition, message)
#define CHECK_N_(n, condition, message) \
    { \
        extern void param_check_##n(void) __attribute__((error(message))); \
        if (!(condition)) { \
            param_check_##n(); \
        } \
    }
void param_check(void);
void param_check(void)
{
    PARAM_RELATION_TABLE(CHECK_RELATION)
    PARAM_TABLE(CHECK_RANGE)
}
#endif
