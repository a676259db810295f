/* The pulses at the command input: an RC receiver's, or the PWM of a controller, with what may be wrong with them. */
#include "vb_state.h"

/* -1 .. 1, evenly spread; not the ADC's sequence, which goes on as without pulses. */
static double random_share(vb_pulse_t *p)
{
    p->rng = p->rng * 6364136223846793005u + 1442695040888963407u;
    return (double)(p->rng >> 11) * 0x1p-52 - 1.0;
}

/* The next pulse begins at `begin_s`. One as long as the period does not end before the next. */
static void begin(vb_pulse_t *p, double begin_s)
{
    double period_s = 1.0 / p->hz;
    double length_s = p->duty > 0.0 ? p->duty * period_s : 1e-6 * p->us;
    if (p->odd > 0.0) {
        p->odd -= 1.0;
        length_s = 1e-6 * p->odd_us;
    }
    length_s += p->jitter_us > 0.0 ? 1e-6 * p->jitter_us * random_share(p) : 0.0;
    p->fall_s = length_s < period_s ? begin_s + length_s : PLANT_NEVER;
    p->rise_s = begin_s + period_s;
    p->level = length_s > 0.0;
}

/* The level as it is at `now_s`. Returns when it changes next. */
double vb_pulse_signals(void *context, double now_s)
{
    vb_pulse_t *p = &((vb_t *)context)->pulse;
    now_s += 1e-9; /* the cycle of a change may be a rounding before it */
    if (p->hz <= 0.0) {
        p->runs = false;
        return PLANT_NEVER;
    }
    if (!p->runs || p->rise_s > now_s + 1.0 / p->hz) { /* just connected, or faster than before */
        p->runs = true;
        begin(p, now_s);
    }
    while (p->rise_s <= now_s) {
        begin(p, p->rise_s);
    }
    if (p->fall_s <= now_s) {
        p->level = false;
        p->fall_s = PLANT_NEVER;
    }
    return plant_min(p->fall_s, p->rise_s);
}

/* What the chip's pin sees; pulled up where nothing is connected. */
bool vb_pulse_pin(const vb_t *vb)
{
    const vb_pulse_t *p = &vb->pulse;
    bool line = p->stuck != 0.0 ? p->stuck == 2.0 : p->level;
    return p->hz <= 0.0 || line != (p->inverted != 0.0);
}
