/* Calibration: the current offsets, averaged once with the outputs off. */
#ifndef DRIVE_CALIBRATION_H
#define DRIVE_CALIBRATION_H

#include "drive/state.h"

/** One sample. The last one raises FAULT_OFFSET unless both offsets are plausible. @return the next state */
QM_INLINE drive_state_t calibration_step(drive_t *d, const drive_params_t *p, int16_t i_a, int16_t i_b)
{
    calibration_t *c = &d->calibration;
    c->sum_a += i_a;
    c->sum_b += i_b;
    d->periods++;
    if (d->periods == (1u << CALIBRATION_LOG2)) {
        int16_t a_q13 = qm_mulhi((int16_t)(c->sum_a >> CALIBRATION_LOG2), p->kcurr_a);
        int16_t b_q13 = qm_mulhi((int16_t)(c->sum_b >> CALIBRATION_LOG2), p->kcurr_b);
        if (qm_beyond(a_q13, p->offset_max_q13) || qm_beyond(b_q13, p->offset_max_q13)) {
            drive_raise(d, FAULT_OFFSET);
        } else {
            c->offset_a_q13 = a_q13;
            c->offset_b_q13 = b_q13;
            SELFTEST_KEEP(d, offset_a, a_q13);
            SELFTEST_KEEP(d, offset_b, b_q13);
            c->done = 1;
            return DRIVE_STOPPED;
        }
    }
    return DRIVE_CALIBRATE;
}

/** Sums begin anew, after a fault that came before the offsets were known. */
QM_INLINE void calibration_restart(calibration_t *c)
{
    c->sum_a = 0;
    c->sum_b = 0;
}

#endif
