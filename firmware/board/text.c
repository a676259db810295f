/* Text and decimal numbers into a buffer. */
#include "board/text.h"

#include "control/qmath.h"

const char text_record_fault[sizeof "record fault "] = "record fault ";

char *text_put(char *at, const char *text)
{
    char *next = at;
    while (*text != '\0') {
        *next++ = *text++;
    }
    return next;
}

char *text_put_unsigned(char *at, uint16_t number)
{
    char digits[6], *digit = &digits[5];
    uint16_t rest = number;

    *digit = '\0';
    do {
        *--digit = (char)('0' + rest % 10u);
        rest /= 10u;
    } while (rest != 0u);
    return text_put(at, digit);
}

char *text_put_signed(char *at, int16_t number)
{
    char *next = at;
    if (number < 0) {
        *next++ = '-';
    }
    return text_put_unsigned(next, (uint16_t)qm_abs(number));
}

char *text_put_named(char *at, const char *name, int16_t number)
{
    return text_put_signed(text_put(at, name), number);
}

char *text_end(char *at)
{
    return text_put(at, "\r\n");
}
