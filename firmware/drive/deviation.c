/* What flows against what is asked for. */
#include "drive/deviation.h"

#include "drive/state.h"

#define MEAN_SHIFT 9   /* 512 ms */
#define MOST_TIMES 2   /* a deviation counts as twice its limit at most: then it may last 0.35 s */
#define SAMPLES 64u    /* currents of the phases are compared over so many samples, some 62 ms */
#define PHASE_SHIFT 4  /* so many sums of half the range fit a word */
#define WAIT_LEAST 16u /* periods from a sample to the next: 16 to 23, each in turn, so that no speed meets the same angles again and again */
#define WAIT_STEP 5u
#define WAIT_MASK 7u
#define OPEN_SHIFT 2 /* of what is asked of it an open phase carries less than a quarter of another one's share */

/** @param i Q13 */
NOINLINE void add_sizes(uint16_t *sums, const phases_t *i)
{
    sums[0] = (uint16_t)(sums[0] + ((uint16_t)qm_size(i->a) >> PHASE_SHIFT));
    sums[1] = (uint16_t)(sums[1] + ((uint16_t)qm_size(i->b) >> PHASE_SHIFT));
    sums[2] = (uint16_t)(sums[2] + ((uint16_t)qm_size(i->c) >> PHASE_SHIFT));
}

/** Takes the phases' currents into their sums. What is asked for goes by the next period's angle: in the mean over a turn they agree. */
static void add_phases(deviation_t *v, const drive_t *d)
{
    phases_t asked = phases_of(d->run.control.ref_q13, d->frame);
    add_sizes(v->asked, &asked);
    add_sizes(v->flows, &d->phases_q13);
}

/** 1 where a phase is asked for more than noise and carries less than a quarter of the share of it that the phase with the most current does. */
static uint16_t has_open_phase(const deviation_t *v, const drive_params_t *p)
{
    const uint16_t least = (uint16_t)(((uint16_t)p->id_off_q13 * SAMPLES) >> PHASE_SHIFT);
    uint16_t n, most = 0, open = 0, flows;
    for (n = 1; n < 3u; n++) {
        most = (v->flows[n] > v->flows[most]) ? n : most;
    }
    flows = (v->flows[most] < v->asked[most]) ? v->flows[most] : v->asked[most]; /* more is noise */
    for (n = 0; n < 3u; n++) {
        open |= (uint16_t)(v->asked[n] >= least && qm_muluu(v->flows[n], v->asked[most]) < (qm_muluu(flows, v->asked[n]) >> OPEN_SHIFT));
    }
    return open;
}

static void phases_anew(deviation_t *v)
{
    uint16_t n;
    for (n = 0; n < 3u; n++) {
        v->asked[n] = 0;
        v->flows[n] = 0;
    }
    v->samples = 0;
}

/** 1 in closed loop after the hand-over; a reversal's ramp forgets nothing. */
static uint16_t is_judged(const drive_t *d)
{
    return (uint16_t)(drive_is_closed(d) && d->run.handover.id_q13 == 0);
}

uint16_t deviation_phases(deviation_t *v, const drive_t *d, const drive_params_t *p)
{
    const uint16_t now = d->ticks;
    uint16_t open;

    if (!drive_is_running(d)) {
        phases_anew(v);
    }
    if (!is_judged(d) || (uint16_t)(now - v->sampled_tick) < WAIT_LEAST + ((v->samples * WAIT_STEP) & WAIT_MASK)) {
        return (uint16_t)FAULT_NONE;
    }
    v->sampled_tick = now;
    add_phases(v, d);
    v->samples++;
    if (v->samples < SAMPLES) {
        return (uint16_t)FAULT_NONE;
    }
    open = has_open_phase(v, p);
    phases_anew(v);
    return (uint16_t)(open ? FAULT_OPEN_PHASE : FAULT_NONE);
}

uint16_t deviation_tick(deviation_t *v, const drive_t *d, const drive_params_t *p)
{
    const drive_control_t *c = &d->run.control;
    int16_t size;

    if (!drive_is_running(d)) {
        v->id_q16 = 0;
    }
    if (!is_judged(d)) {
        return (uint16_t)FAULT_NONE;
    }
    size = qm_clamp(qm_size((int16_t)(c->ref_q13.d - c->i_q13.d)), 0, (int16_t)(MOST_TIMES * p->id_off_q13));
    v->id_q16 += ((int32_t)size * 65536 - v->id_q16) >> MEAN_SHIFT;
    return (uint16_t)((qm_hi(v->id_q16) > p->id_off_q13) ? FAULT_CURRENT_SENSOR : FAULT_NONE);
}
