/* What the self-test REGISTERS compares, for the tools: the end of the PC's unit of the firmware, behind firmware/board/selftest_run.c. The
 * image has none of it. */
#ifndef WRITTEN_H
#define WRITTEN_H

#include <stdint.h>
#include <xc.h>

/* Register, mask and value of a row of the self-test's table: its name, or NULL behind its end and in a build with SELFTEST_OFF. */
const char *probe_written(unsigned row, uint16_t *mask, uint16_t *value);

const char *probe_written(unsigned row, uint16_t *mask, uint16_t *value)
{
#ifndef SELFTEST_OFF
    for (size_t n = 0; n < host_sfr_count && row < sizeof written / sizeof written[0]; n++) {
        if (host_sfr_table[n].pointer == written[row].place) {
            *mask = written[row].mask;
            *value = written[row].value;
            return host_sfr_table[n].name;
        }
    }
#else
    (void)row;
    (void)mask;
    (void)value;
#endif
    return NULL;
}

#endif
