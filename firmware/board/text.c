/* Text and decimal numbers into a buffer. */
#include "board/text.h"

#include "control/qmath.h"

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
    char digits[6];
    char *next = at;
    uint16_t count = 0;
    uint16_t rest = number;

    do {
        digits[count++] = (char)('0' + rest % 10u);
        rest /= 10u;
    } while (rest != 0u);
    while (count != 0u) {
        *next++ = digits[--count];
    }
    return next;
}

char *text_put_signed(char *at, int16_t number)
{
    char *next = at;
    if (number < 0) {
        *next++ = '-';
    }
    return text_put_unsigned(next, (uint16_t)qm_abs(number));
}
