/* Text and decimal numbers into a buffer. */
#include "board/text.h"

#include "control/qmath.h"

uint16_t text_put(char *line, uint16_t at, const char *text)
{
    while (*text != '\0') {
        line[at++] = *text++;
    }
    return at;
}

uint16_t text_put_unsigned(char *line, uint16_t at, uint16_t number)
{
    char digits[6];
    uint16_t count = 0;
    uint16_t rest = number;

    do {
        digits[count++] = (char)('0' + rest % 10u);
        rest /= 10u;
    } while (rest != 0u);
    while (count != 0u) {
        line[at++] = digits[--count];
    }
    return at;
}

uint16_t text_put_signed(char *line, uint16_t at, int16_t number)
{
    uint16_t size = (uint16_t)qm_abs(number);
    if (number < 0) {
        line[at++] = '-';
    }
    return text_put_unsigned(line, at, size);
}
