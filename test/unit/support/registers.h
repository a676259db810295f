/* What every register held at one moment, for the tests of the board's modules. After the start: test_firmware_on_registers.c. */
#ifndef TEST_REGISTERS_H
#define TEST_REGISTERS_H

#include "hurst_params.h"

#include <xc.h>

#include "unity.h"

enum { REGISTERS_MOST = 1024 }; /* words of the chip's register space */

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

#endif
