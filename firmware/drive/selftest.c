/* Self-tests that see no register: March C-, order of the slow phases, variables that are kept twice. */
#include "drive/selftest.h"

/* A test of this file puts memory with faults behind these. */
#ifndef SELFTEST_READ
#define SELFTEST_READ(cell) (*(cell))
#define SELFTEST_WRITE(cell, value) (*(cell) = (value))
#endif

const uint16_t selftest_backgrounds[SELFTEST_BACKGROUNDS] = { 0x0000u, 0x5555u, 0x3333u, 0x0F0Fu, 0x00FFu };

uint16_t selftest_march(volatile uint16_t *first, uint16_t words, uint16_t background, volatile uint16_t *spare)
{
    volatile uint16_t *at = first, *kept = spare;
    uint16_t inverse = (uint16_t)~background, wrong = 0, left;

    for (left = words; left != 0u; left--) { /* XC16's comparison of two variables writes to the stack, that with 0 does not */
        if (spare) {
            *kept = SELFTEST_READ(at);
            kept++;
        }
        SELFTEST_WRITE(at, background);
        at++;
    }
    at = first;
    for (left = words; left != 0u; left--) {
        wrong |= (uint16_t)(SELFTEST_READ(at) ^ background);
        SELFTEST_WRITE(at, inverse);
        at++;
    }
    at = first;
    for (left = words; left != 0u; left--) {
        wrong |= (uint16_t)(SELFTEST_READ(at) ^ inverse);
        SELFTEST_WRITE(at, background);
        at++;
    }
    for (left = words; left != 0u; left--) {
        at--;
        wrong |= (uint16_t)(SELFTEST_READ(at) ^ background);
        SELFTEST_WRITE(at, inverse);
    }
    at = &first[words];
    for (left = words; left != 0u; left--) {
        at--;
        wrong |= (uint16_t)(SELFTEST_READ(at) ^ inverse);
        SELFTEST_WRITE(at, background);
    }
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
