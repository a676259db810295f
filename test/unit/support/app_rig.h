/* An application alone: what it is told, what it asks, and the seam's part between two calls. A test includes the application's file before. */
#ifndef TEST_APP_RIG_H
#define TEST_APP_RIG_H

#include "unity.h"

#define EACH(n, table) for (uint16_t n = 0; n < sizeof (table) / sizeof (table)[0]; n++)

static app_told_t told;
static app_asks_t asks;

/** A stopped drive, minimum 500, nominal 2000, maximum 4000 counts; nothing asked. */
static inline void rig_fresh(void)
{
    static const app_told_t stopped = { .elapsed_ms = 1, .towards = 1, .slow = { 500, 2000 }, .fast = { 2000, 4000 } };
    static const app_asks_t nothing = { 0 };
    told = stopped;
    asks = nothing;
    app_init();
}

/** A millisecond, as the seam makes it: requests stand for one call. */
static inline void rig_ms(void)
{
    asks.clear_fault = 0;
    asks.fault = (uint16_t)FAULT_NONE;
    app_ms(&told, &asks);
}

/** Milliseconds until a fault is cleared. @return how many, or `most` without */
static inline uint16_t rig_ms_to_clear(uint16_t most)
{
    uint16_t ms;
    for (ms = 0; ms < most; ms++) {
        rig_ms();
        if (asks.clear_fault) {
            break;
        }
    }
    return ms;
}

/** Many of them. @return how many faults were asked to go */
static inline uint16_t rig_clears(uint16_t count_ms)
{
    uint16_t ms, clears = 0;
    for (ms = 0; ms < count_ms; ms++) {
        rig_ms();
        clears = (uint16_t)(clears + asks.clear_fault);
    }
    return clears;
}

#endif
