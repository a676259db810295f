/* What flows against what is asked for. */
#include "drive/deviation.h"

#include "drive/state.h"

#define MEAN_SHIFT 9  /* 512 ms */
#define MOST_TIMES 2  /* a deviation counts as twice its limit at most: then it may last 0.35 s */
#define PHASE_MS 64u  /* currents of the phases are compared over so many milliseconds */
#define PHASE_SHIFT 4 /* so many sums of half the range fit a word */
#define OPEN_SHIFT 2  /* of what is asked of it an open phase carries less than a quarter of another one's share */

/** @param i Q13 */
NOINLINE void add_sizes(uint16_t *sums, const phases_t *i)
{
    sums[0] = (uint16_t)(sums[0] + ((uint16_t)qm_abs(i->a) >> PHASE_SHIFT));
    sums[1] = (uint16_t)(sums[1] + ((uint16_t)qm_abs(i->b) >> PHASE_SHIFT));
    sums[2] = (uint16_t)(sums[2] + ((uint16_t)qm_abs(i->c) >> PHASE_SHIFT));
}

/** Takes the phases' currents into their sums. What is asked for goes by the same angle, so that samples that always meet a phase near its zero
 *  ask nothing of it. */
static void add_phases(deviation_t *v, const drive_t *d)
{
    phases_t asked = phases_of(d->run.control.ref_q13, d->frame);
    add_sizes(v->asked, &asked);
    add_sizes(v->flows, &d->phases_q13);
}

/** 1 where a phase is asked for more than noise and carries less than a quarter of the share of it that the phase with the most current does. */
static uint16_t has_open_phase(const deviation_t *v, const drive_params_t *p)
{
    const uint16_t least = (uint16_t)(((uint16_t)p->id_off_q13 * PHASE_MS) >> PHASE_SHIFT);
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
    v->phase_ms = 0;
}

uint16_t deviation_tick(deviation_t *v, const drive_t *d, const drive_params_t *p)
{
    const drive_control_t *c = &d->run.control;
    uint16_t open = 0;
    int16_t size;

    if (!drive_is_running(d)) {
        v->id_q16 = 0;
        phases_anew(v);
    }
    if (!drive_is_closed(d) || d->run.handover.id_q13 != 0) { /* a reversal's ramp forgets nothing */
        return (uint16_t)FAULT_NONE;
    }
    add_phases(v, d);
    v->phase_ms++;
    if (v->phase_ms == PHASE_MS) {
        open = has_open_phase(v, p);
        phases_anew(v);
    }
    size = qm_clamp(qm_abs((int16_t)(c->ref_q13.d - c->i_q13.d)), 0, (int16_t)(MOST_TIMES * p->id_off_q13));
    v->id_q16 += ((int32_t)size * 65536 - v->id_q16) >> MEAN_SHIFT;
    if (open) {
        return (uint16_t)FAULT_OPEN_PHASE;
    }
    return (uint16_t)((qm_hi(v->id_q16) > p->id_off_q13) ? FAULT_CURRENT_SENSOR : FAULT_NONE);
}
