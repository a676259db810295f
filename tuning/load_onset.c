/* A motor on its way at its reference speed, and a load that grows: the model of load_onset.py, step by step; electrical rad/s, A, N m. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>

enum { SUB_STEPS = 2 };

/** Shaft and controllers: the fields of Drive, then the law's own numbers. */
typedef struct {
    double step_s, per_amp, per_nm, pull_a, psi, filter_rad_s, current_rad_s, full_rad_s, quiet, loaded, fast, gain, load_from_a, gate, gate_loaded, most_a;
    double esdq_ratio, fast_gain, speed_per_gate, level_per_gate, gate_steps, fade, half_level, open_share, lost_rad;
} drive_t;

typedef struct {
    const drive_t *drive;
    double reference, speed, angle, e_d, e_q, seen, load_a, current_a, quick, level, last;
    bool lost;
} model_t;

static double within(double value, double least, double most)
{
    return fmin(fmax(value, least), most);
}

/* Current, shaft and estimator over a step; returns the mean speed that the estimator has seen. */
static double turn(model_t *m, double asked_a, double load_nm)
{
    const drive_t *p = m->drive;
    double dt = p->step_s / SUB_STEPS, mean = 0.0;
    double k = 1.0 - exp(-fmin(p->filter_rad_s, p->esdq_ratio * fmax(m->speed, 1.0)) * dt), current_k = 1.0 - exp(-p->current_rad_s * dt);
    for (int i = 0; i < SUB_STEPS; i++) {
        m->current_a += (asked_a - m->current_a) * current_k;
        m->e_d += k * (p->psi * m->speed * sin(m->angle) - m->e_d);
        m->e_q += k * (p->psi * m->speed * cos(m->angle) - m->e_q);
        double estimated = (m->e_q - m->e_d) / p->psi;
        mean += estimated / SUB_STEPS;
        double resisting = (m->speed > 0.0) ? p->per_nm * load_nm + p->per_amp * p->pull_a : 0.0;
        m->speed = fmax(m->speed + dt * (p->per_amp * m->current_a * cos(m->angle) - resisting), 0.0);
        m->angle += (estimated - m->speed) * dt;
    }
    m->lost = m->lost || fabs(m->angle) > p->lost_rad;
    return mean;
}

/* The quick rate after a large innovation, until the loop's own swing turns it back. */
static void answer(model_t *m, double innovation, double gate)
{
    const drive_t *p = m->drive;
    bool is_open = m->quick > p->open_share;
    m->level = is_open ? fmin(m->level + 4.0, 4.0 * p->gate_steps) : fmax(m->level - 1.0, 0.0);
    m->quick *= p->fade;
    if (fabs(innovation) > gate && (!is_open || m->level < p->gate_steps)) {
        if (is_open && innovation * m->last < 0.0) {
            m->level = p->gate_steps;
        }
        m->last = innovation;
        m->quick = fmax(m->quick, (fabs(innovation) > 1.5 * gate) ? 1.0 : p->half_level);
    }
}

/* A slow step: rates and gate, the current that is asked for, the shaft, and what the observer learns. */
static void step(model_t *m, double load_nm)
{
    const drive_t *p = m->drive;
    double speed = fmax(fabs(m->seen), m->reference);
    double loaded = within((fmin(fabs(m->load_a), fabs(m->current_a)) - p->load_from_a) / p->load_from_a, 0.0, 1.0);
    double share = fmin(speed / p->full_rad_s, 1.0);
    double quiet = p->quiet * share;
    share += (fmin(2.0 * share, 1.0) - share) * loaded;
    double rate = quiet + (p->loaded * share - quiet) * loaded;
    rate += (p->fast * share - rate) * m->quick;
    double gate = (p->gate + (p->gate_loaded - p->gate) * loaded + speed / p->speed_per_gate) * (1.0 + m->level / p->level_per_gate);
    double gain = p->gain * (1.0 + (p->fast_gain - 1.0) * m->quick) * fmin(2.0 * share, 1.0);
    double seen = turn(m, within(gain * (m->reference - m->seen) + m->load_a, -p->most_a, p->most_a), load_nm);
    double before = m->seen;
    m->seen += p->per_amp * p->step_s * (m->current_a - m->load_a);
    double innovation = seen - 0.5 * (before + m->seen);
    m->seen += 2.0 * rate * innovation;
    m->load_a = within(m->load_a - rate * rate / (p->per_amp * p->step_s) * innovation, -p->most_a, p->most_a);
    answer(m, innovation, gate);
}

/** The speed that is left after so many steps of a load that has come after over_s; negative if the estimator has lost the rotor before. */
double load_onset(const drive_t *drive, double reference, double load_nm, double over_s, size_t steps)
{
    model_t m = { drive, reference, reference, 0.0, 0.0, drive->psi * reference, reference, drive->pull_a, drive->pull_a, 0.0, 0.0, 0.0, false };
    for (size_t k = 0; k < steps && !m.lost; k++) {
        step(&m, load_nm * fmin((double)k * drive->step_s / over_s, 1.0));
    }
    return m.lost ? -1.0 : m.speed;
}
