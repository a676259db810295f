/* Registers by name for the tests of the board's modules: what they must hold, and what they held at one moment. */
#ifndef TEST_REGISTERS_H
#define TEST_REGISTERS_H

#include "hurst_params.h"

#include <xc.h>

#include "unity.h"

enum { REGISTERS_MOST = 1024 }; /* words of the chip's register space */

/** A register and its value. */
typedef struct {
    const char *name;
    uint16_t value;
} register_value_t;

static uint16_t registers_then[REGISTERS_MOST];
static uint16_t registers_accesses;

/** For a macro in place of a register: each access keeps what every register holds at that moment. */
static inline volatile uint16_t *registers_watch(volatile uint16_t *watched)
{
    registers_accesses++;
    for (size_t n = 0; n < host_sfr_count; n++) {
        registers_then[n] = *host_sfr_table[n].pointer;
    }
    return watched;
}

/** What a register held at the last access to the watched one. */
static inline uint16_t register_then(const char *name)
{
    for (size_t n = 0; n < host_sfr_count; n++) {
        if (host_sfr_table[n].pointer == host_sfr_find(name)) {
            return registers_then[n];
        }
    }
    TEST_FAIL_MESSAGE(name);
    return 0;
}

static inline void registers_expect(const register_value_t *values, size_t count)
{
    for (size_t n = 0; n < count; n++) {
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(values[n].value, *host_sfr_find(values[n].name), values[n].name);
    }
}

/** The registers of a table hold its values. */
#define EXPECT_REGISTERS(table) registers_expect(table, sizeof(table) / sizeof(table)[0])

#endif
