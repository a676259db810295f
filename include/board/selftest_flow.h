/* The order of the background's parts, for its self-test. */
#ifndef BOARD_SELFTEST_FLOW_H
#define BOARD_SELFTEST_FLOW_H

#include "drive/selftest.h"

/** The background's parts, which come in this order. */
enum { SELFTEST_PART_SUPERVISE = 1,
       SELFTEST_PART_PANEL,
       SELFTEST_PART_WATCH,
       SELFTEST_PART_STATUS };

#ifndef SELFTEST_OFF

/** The parts that have come to their end, three bits each. */
extern uint16_t board_selftest_parts;

/** A part has come to its end. */
QM_INLINE void selftest_part(uint16_t part)
{
    board_selftest_parts = (uint16_t)((uint16_t)(board_selftest_parts << 3) | part);
}

#else
#define selftest_part(part) ((void)0)
#endif

#endif
