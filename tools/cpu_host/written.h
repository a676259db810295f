/* What the self-test REGISTERS compares, for the tools: the end of the PC's unit of the firmware, behind firmware/board/selftest_run.c. The
 * image has none of it. tools/bench/selftest.py reads the registers' names from the firmware's source, in this order. */
#ifndef WRITTEN_H
#define WRITTEN_H

#include <stdint.h>

/* Mask and value of a row of the self-test's table: 0, or -1 behind its end and in a build with SELFTEST_OFF. */
int probe_written(unsigned row, uint16_t *mask, uint16_t *value);

int probe_written(unsigned row, uint16_t *mask, uint16_t *value)
{
#ifndef SELFTEST_OFF
    if (row < sizeof written / sizeof written[0]) {
        *mask = written[row].mask;
        *value = written[row].value;
        return 0;
    }
#else
    (void)row;
    (void)mask;
    (void)value;
#endif
    return -1;
}

#endif
