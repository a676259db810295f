/* BRINGUP, the interrupt's part: one PWM period of driving a voltage vector with little current, and of adding up. */
#ifndef DRIVE_MODES_BRINGUP_TICK_H
#define DRIVE_MODES_BRINGUP_TICK_H

#include "drive/state.h"

#ifdef BRINGUP

#define BRINGUP_HALF_DUTY (PWM_FULL_DUTY / 2)
#define BRINGUP_FILTER_SHIFT 5                   /* 1.6 ms: four counts of the amplitude */
#define BRINGUP_STEP_MASK 7u                     /* the amplitude changes by a count every eighth period */
#define BRINGUP_TURN_PERIODS PARAM_PERIODS(0.4F) /* of an electrical turn, and of the pause after it */
#define BRINGUP_TURN_Q32 ((uint32_t)(4294967295.0F / PARAM_F(BRINGUP_TURN_PERIODS)))

/** Adds up, in every state. @param settled the amplitude stands */
QM_INLINE void bringup_add(drive_t *d, uint16_t settled)
{
    bringup_run_t *t = &d->run.bringup;
    if (t->ready || t->left == 0u || !settled) {
        return;
    }
    if (t->wait != 0u) {
        t->wait--;
        return;
    }
    t->sum_a += d->phases_q13.a;
    t->sum_b += d->phases_q13.b;
    t->off_a += qm_abs((int16_t)(d->phases_q13.a - t->mean_a_q13));
    t->off_b += qm_abs((int16_t)(d->phases_q13.b - t->mean_b_q13));
    t->left--;
    t->ready = (uint16_t)(t->left == 0u);
}

/** 1, 0 or -1: where the amplitude goes. A measurement stays at the amplitude where the current is reached; a vector that turns keeps the
 *  current, for dead time takes more or less of it at each angle. */
QM_INLINE int16_t bringup_direction(bringup_run_t *t, int16_t carried_q13)
{
    if (t->keeps_current) {
        return (int16_t)((carried_q13 < t->stop_q13 && t->amplitude < t->most) ? 1 : (t->amplitude > 0) ? -1
                                                                                                        : 0);
    }
    if (t->amplitude < t->most && carried_q13 >= t->stop_q13) {
        t->most = t->amplitude;
    } else if (t->amplitude > 0 && t->most == t->amplitude && carried_q13 > t->stop_q13 + (t->stop_q13 >> 1)) {
        t->most = (int16_t)(t->amplitude - 1); /* it has grown by itself */
    } else {
        /* on its way, or there */
    }
    return (int16_t)((t->amplitude < t->most) ? 1 : (t->amplitude > t->most) ? -1
                                                                             : 0);
}

/** A count towards the amplitude that is asked for. @return 1 when it stands, or follows the current */
QM_INLINE uint16_t bringup_step_amplitude(drive_t *d)
{
    bringup_run_t *t = &d->run.bringup;
    int16_t direction = bringup_direction(t, (int16_t)(t->carried_q21 >> 8));
    t->carried_q21 += ((int32_t)(qm_abs(d->phases_q13.a) + qm_abs(d->phases_q13.b)) * 256 - t->carried_q21) >> BRINGUP_FILTER_SHIFT;
    if ((d->ticks & BRINGUP_STEP_MASK) == 0u) {
        t->amplitude = (int16_t)(t->amplitude + direction);
    }
    return (uint16_t)(direction == 0 || t->keeps_current);
}

/** A period of an electrical turn, or of the pause after it. */
QM_INLINE void bringup_turn(bringup_run_t *t)
{
    uint32_t before = t->turn_q32;
    if (!t->turning && before == 0u) { /* a turn that has begun goes on to its end */
        return;
    }
    if (t->pause != 0u) {
        t->pause--;
        return;
    }
    t->turn_q32 = qm_turn_add(before, BRINGUP_TURN_Q32);
    if (t->turn_q32 < before) { /* it has come round */
        t->turn_q32 = 0;
        t->turns++;
        t->pause = BRINGUP_TURN_PERIODS;
    }
    t->angle = (angle_t)(t->turn_q32 >> 16);
}

/** A period with the bridge switching: no law, no compensation, just a vector. */
NOINLINE void bringup_run(drive_t *d, const drive_params_t *p, duties_t *duty)
{
    bringup_run_t *t = &d->run.bringup;
    uint16_t settled = bringup_step_amplitude(d);
    dq_t vector;
    phases_t part;

    (void)p;
    if (settled) {
        bringup_turn(t);
    }
    bringup_add(d, settled);
    vector.d = t->amplitude;
    vector.q = 0;
    part = phases_of(vector, trig_sincos(t->angle));
    t->part[0] = part.a;
    t->part[1] = part.b;
    t->part[2] = part.c;
    duty->a = (duty_t)(BRINGUP_HALF_DUTY + part.a);
    duty->b = (duty_t)(BRINGUP_HALF_DUTY + part.b);
    duty->c = (duty_t)(BRINGUP_HALF_DUTY + part.c);
    if (!d->command.run) {
        drive_enter(d, DRIVE_STOPPED);
    }
}

/** The background's first word of a start: the instrument is its own. */
QM_INLINE void bringup_start(drive_t *d, const drive_params_t *p)
{
    (void)p;
    d->run.bringup.ready = 1;
}

#endif

/** A period with the bridge off: the mode may add up the samples. */
QM_INLINE void mode_idle(drive_t *d)
{
#ifdef BRINGUP
    bringup_add(d, 1);
#else
    (void)d;
#endif
}

#endif
