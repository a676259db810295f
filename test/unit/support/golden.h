/* Helpers of the golden-vector tests: a walk through a table, the failing row in the message, and the generator's checksum. */
#ifndef TEST_GOLDEN_H
#define TEST_GOLDEN_H

#include <stdint.h>

/** "row n" for the message of an assertion; n counts from 0 after the header lines. */
static inline const char *golden_row(uint32_t n)
{
    static char text[] = "row 00000";
    uint16_t place;
    for (place = 8; place > 3; place--) {
        text[place] = (char)('0' + (char)(n % 10u));
        n /= 10u;
    }
    return text;
}

/** For each row v, whose number is n, of the vectors `name`: GOLDEN_EACH(park, v) { ... } */
#define GOLDEN_EACH(name, v) \
    golden_##name##_t v; \
    for (uint32_t n = 0; n < golden_##name##_rows && (v = golden_##name##_row(n), 1); n++)

/** s = 31 s + the value's low word, modulo 2^32. */
static inline uint32_t golden_checksum(uint32_t s, int16_t value)
{
    return (uint32_t)((UINT64_C(31) * s + (uint16_t)value) & UINT32_C(0xFFFFFFFF));
}

#endif
