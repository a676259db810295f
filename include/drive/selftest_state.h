/* What the self-tests add to the drive: critical variables kept twice, and the marks of the slow phases. Nothing with SELFTEST_OFF. */
#ifndef DRIVE_SELFTEST_STATE_H
#define DRIVE_SELFTEST_STATE_H

#include "control/qmath.h"
#include "drive/param_scaling.h" /* userparams.h may define SELFTEST_OFF */

#ifndef SELFTEST_OFF

/** Complements of the drive's fields of the same name, and the sum of the slow phases that came to their end. */
typedef struct {
    uint16_t state, fault, direction, offset_a, offset_b;
    uint16_t phases;
} selftest_state_t;

/** Member of drive_t. */
#define SELFTEST_STATE selftest_state_t selftest;

/** The complement of what is written. */
QM_INLINE QM_WRAPS uint16_t selftest_complement(uint16_t value)
{
    const uint16_t negative = (uint16_t)(0u - value); /* of ~value the compiler computes 32 bits */
    return (uint16_t)(negative - 1u);
}

/** The sum with one phase more. */
QM_INLINE uint16_t selftest_marked(uint16_t sum, uint16_t phase)
{
    return (uint16_t)(sum + phase);
}

/** Goes with every write of a field that is kept twice. */
#define SELFTEST_KEEP(d, field, value) ((d)->selftest.field = selftest_complement((uint16_t)(value)))

/** A slow phase has come to its end. */
#define SELFTEST_MARK(d, phase) ((d)->selftest.phases = selftest_marked((d)->selftest.phases, phase))

#else
#define SELFTEST_STATE
#define SELFTEST_KEEP(d, field, value) ((void)0)
#define SELFTEST_MARK(d, phase) ((void)(phase))
#endif

#endif
