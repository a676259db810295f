/* What flows against what is asked for, in closed loop: a d current that stays off means a noisy or wrong signal, a phase without current an open
 * one. No limit explains either: of the voltage the d axis takes its part first, and a phase carries its share of any current. */
#ifndef DRIVE_DEVIATION_H
#define DRIVE_DEVIATION_H

#include "drive/state.h"

#define DEVIATION_MEAN_SHIFT 9   /* 512 ms */
#define DEVIATION_MOST_TIMES 2   /* a deviation counts as twice its limit at most: then it may last 0.35 s */
#define DEVIATION_SAMPLES 64u    /* currents of the phases are compared over so many samples, some 62 ms */
#define DEVIATION_PHASE_SHIFT 4  /* so many sums of half the range fit a word */
#define DEVIATION_WAIT_LEAST 16u /* periods from a sample to the next: 16 to 23, each in turn, so that no speed meets the same angles again and again */
#define DEVIATION_WAIT_STEP 5u
#define DEVIATION_WAIT_MASK 7u
#define DEVIATION_OPEN_SHIFT 2 /* of what is asked of it an open phase carries less than a quarter of another one's share */

/** Sums of the phases' currents. */
typedef struct {
    uint16_t asked[3], flows[3]; /**< |current| that the references ask of the phases and that is measured, Q13 / 16 */
    uint16_t samples;            /**< in the sums */
} deviation_sums_t;

/** Mean size of the d current's deviation over half a second, and what the phases carry. Zero is a valid start. */
typedef struct {
    int32_t id_q16; /**< Q13 counts with 16 fraction bits */
    deviation_sums_t sums;
    uint16_t sampled_tick; /**< period of the last sample */
} deviation_t;

/** @param a,b,c Q13; as a structure they would go over the stack */
NOINLINE void deviation_add_sizes(uint16_t *sums, current_q13_t a, current_q13_t b, current_q13_t c)
{
    sums[0] = (uint16_t)(sums[0] + ((uint16_t)qm_size(a) >> DEVIATION_PHASE_SHIFT));
    sums[1] = (uint16_t)(sums[1] + ((uint16_t)qm_size(b) >> DEVIATION_PHASE_SHIFT));
    sums[2] = (uint16_t)(sums[2] + ((uint16_t)qm_size(c) >> DEVIATION_PHASE_SHIFT));
}

/** Takes the phases' currents into their sums. What is asked for goes by the next period's angle: in the mean over a turn they agree. */
QM_INLINE void deviation_add(deviation_sums_t *s, const drive_t *d)
{
    phases_t asked = phases_of(d->run.control.ref_q13, d->frame);
    deviation_add_sizes(s->asked, asked.a, asked.b, asked.c);
    deviation_add_sizes(s->flows, d->phases_q13.a, d->phases_q13.b, d->phases_q13.c);
}

/** 1 where a phase is asked for more than noise and carries less than a quarter of the share of it that the phase with the most current does. */
QM_INLINE uint16_t deviation_open_phase(const deviation_sums_t *s, const drive_params_t *p)
{
    const uint16_t least = (uint16_t)(((uint16_t)p->id_off_q13 * DEVIATION_SAMPLES) >> DEVIATION_PHASE_SHIFT);
    uint16_t n, flows = 0, asked = 0;
    for (n = 3; n != 0u; n--) {
        if (s->flows[n - 1u] >= flows) {
            flows = s->flows[n - 1u];
            asked = s->asked[n - 1u];
        }
    }
    flows = (flows < asked) ? flows : asked; /* more is noise */
    for (n = 0; n < 3u; n++) {
        if (s->asked[n] >= least && qm_muluu(s->flows[n], asked) < (qm_muluu(flows, s->asked[n]) >> DEVIATION_OPEN_SHIFT)) {
            return 1;
        }
    }
    return 0;
}

/** 1 in closed loop after the hand-over; a reversal's ramp forgets nothing. */
QM_INLINE uint16_t deviation_is_judged(const drive_t *d)
{
    return (uint16_t)(drive_is_closed(d) && d->run.handover.id_q13 == 0);
}

/** Every pass of the background. @return drive_fault_t: OPEN_PHASE when a phase carries next to none of what is asked of it, or none */
QM_INLINE uint16_t deviation_phases(deviation_t *v, const drive_t *d, const drive_params_t *p)
{
    const uint16_t now = d->ticks;
    uint16_t wait;

    if (!drive_is_running(d) || v->sums.samples >= DEVIATION_SAMPLES) {
        drive_zero(&v->sums, sizeof v->sums);
    }
    wait = (uint16_t)(DEVIATION_WAIT_LEAST + ((v->sums.samples * DEVIATION_WAIT_STEP) & DEVIATION_WAIT_MASK));
    if (!deviation_is_judged(d) || (uint16_t)(now - v->sampled_tick) < wait) {
        return (uint16_t)FAULT_NONE;
    }
    v->sampled_tick = now;
    deviation_add(&v->sums, d);
    v->sums.samples++;
    if (v->sums.samples < DEVIATION_SAMPLES) {
        return (uint16_t)FAULT_NONE;
    }
    return (uint16_t)(deviation_open_phase(&v->sums, p) ? FAULT_OPEN_PHASE : FAULT_NONE);
}

/** Every millisecond in the background. @return drive_fault_t: CURRENT_SENSOR when the d current stays further off than dead time and noise
 *  make it, or none */
QM_INLINE uint16_t deviation_tick(deviation_t *v, const drive_t *d, const drive_params_t *p)
{
    const drive_control_t *c = &d->run.control;
    int32_t off_q16;
    int16_t size;

    if (!drive_is_running(d)) {
        v->id_q16 = 0;
    }
    if (!deviation_is_judged(d)) {
        return (uint16_t)FAULT_NONE;
    }
    size = qm_clamp(qm_size((int16_t)(c->ref_q13.d - c->i_q13.d)), 0, (int16_t)(DEVIATION_MOST_TIMES * p->id_off_q13));
    off_q16 = (int32_t)size * 65536 - v->id_q16;
    v->id_q16 += qm_mulsu(qm_hi(off_q16), 1u << (16 - DEVIATION_MEAN_SHIFT)) + (int32_t)((uint16_t)off_q16 >> DEVIATION_MEAN_SHIFT); /* off >> shift */
    return (uint16_t)((qm_hi(v->id_q16) > p->id_off_q13) ? FAULT_CURRENT_SENSOR : FAULT_NONE);
}

#endif
