/* Self-tests in the manner of IEC 60730 Class B: those parts that see no register (docs/selftest.md). */
#include "drive/selftest.h"

#include "drive/drive.h"

#ifndef SELFTEST_OFF
uint16_t selftest_flow_holds(const drive_t *d)
{
    uint16_t calls = (uint16_t)(d->ticks / SLOW_EVERY), rest = (uint16_t)(calls & (SLOW_CALLS - 1u));
    uint16_t expected = (uint16_t)((calls / SLOW_CALLS) * (SLOW_CALLS * (SLOW_CALLS - 1u) / 2u) + rest * (rest + 1u) / 2u);
    return (uint16_t)(((d->selftest.phases ^ expected) & 0x3FFFu) == 0u); /* the sum of 65536 ticks is a multiple of 0x4000 */
}

uint16_t selftest_variables_hold(const drive_t *d)
{
    const selftest_state_t *s = &d->selftest;
    uint16_t same = (uint16_t)((s->state ^ d->state) & (s->fault ^ d->fault) & (s->direction ^ (uint16_t)d->direction)
                               & (s->offset_a ^ (uint16_t)d->calibration.offset_a_q13)
                               & (s->offset_b ^ (uint16_t)d->calibration.offset_b_q13));
    return (uint16_t)(same == 0xFFFFu);
}
#endif

/* A test of this file puts memory with faults behind these. */
#ifndef SELFTEST_READ
#define SELFTEST_READ(cell) (*(cell))
#define SELFTEST_WRITE(cell, value) (*(cell) = (value))
#endif

const uint16_t selftest_backgrounds[SELFTEST_BACKGROUNDS] = { 0x0000u, 0x5555u, 0x3333u, 0x0F0Fu, 0x00FFu };

/** Reads what is expected and writes the next, from the first word to the last. @return bits that were wrong */
static INLINE uint16_t march_up(volatile uint16_t *first, uint16_t words, uint16_t expected, uint16_t next)
{
    volatile uint16_t *at = first;
    uint16_t wrong = 0, left;
    for (left = words; left != 0u; left--) { /* XC16's comparison of two variables writes to the stack, that with 0 does not */
        wrong |= (uint16_t)(SELFTEST_READ(at) ^ expected);
        SELFTEST_WRITE(at, next);
        at++;
    }
    return wrong;
}

/** The same from the last word to the first. */
static INLINE uint16_t march_down(volatile uint16_t *first, uint16_t words, uint16_t expected, uint16_t next)
{
    volatile uint16_t *at = &first[words];
    uint16_t wrong = 0, left;
    for (left = words; left != 0u; left--) {
        at--;
        wrong |= (uint16_t)(SELFTEST_READ(at) ^ expected);
        SELFTEST_WRITE(at, next);
    }
    return wrong;
}

uint16_t selftest_march(volatile uint16_t *first, uint16_t words, uint16_t background, volatile uint16_t *spare)
{
    volatile uint16_t *at = first, *kept = spare;
    uint16_t inverse = (uint16_t)~background, wrong, left;
    for (left = words; left != 0u; left--) {
        if (spare) {
            *kept = SELFTEST_READ(at);
            kept++;
        }
        SELFTEST_WRITE(at, background);
        at++;
    }
    wrong = march_up(first, words, background, inverse);
    wrong |= march_up(first, words, inverse, background);
    wrong |= march_down(first, words, background, inverse);
    wrong |= march_down(first, words, inverse, background);
    at = &first[words];
    for (left = words; left != 0u; left--) {
        at--;
        wrong |= (uint16_t)(SELFTEST_READ(at) ^ background);
        if (spare) {
            kept--;
            SELFTEST_WRITE(at, *kept);
        }
    }
    return wrong;
}

uint16_t selftest_crc(uint16_t crc, uint16_t byte)
{
    uint16_t x = (uint16_t)((crc >> 8) ^ byte);
    x = (uint16_t)(x ^ (x >> 4));
    return (uint16_t)((uint16_t)(crc << 8) ^ (uint16_t)(x << 12) ^ (uint16_t)(x << 5) ^ x);
}
