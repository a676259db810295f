/* The trial of a start: the rotor's equation of motion, step by step, for all start angles and loads; start.py says what it is of. */
#include <math.h>
#include <stddef.h>

/** What all columns share, in SI units. */
typedef struct {
    double step_s, lock_s;
    double pull_nm;             /* of the full current */
    double pole_pairs;
    double viscous_nms;         /* of the rotor's own speed */
    double swing_nms;           /* of its speed against the forced one */
    double turning_rad_s;       /* electrical speed of the lock */
    double acceleration_rpm_s;  /* of the ramp */
    double end_rad_s;           /* electrical */
    double per_torque;          /* step over inertia */
    double rad_s_per_rpm;
} trial_t;

/** One column. */
typedef struct {
    double dry_nm;     /* friction and load, against the motion */
    double hold_rad_s; /* what they take off the speed in a step */
    double rotor_rad;  /* electrical */
    double speed_rad_s;
    double locked_rad; /* rotor against the forced angle at the lock's end */
    double lowest_rad_s;
} column_t;

static void advance(const trial_t *t, column_t *c, double pull_nm, double forced_rad, double forced_rad_s)
{
    double drive = pull_nm * sin(forced_rad - c->rotor_rad) - t->viscous_nms * c->speed_rad_s - t->swing_nms * (c->speed_rad_s - forced_rad_s);
    double free = c->speed_rad_s + t->per_torque * drive;
    double slowed = (fabs(free) <= c->hold_rad_s) ? 0.0 : free - copysign(c->hold_rad_s, free);
    c->speed_rad_s = (fabs(c->speed_rad_s) > 1e-9 || fabs(drive) > c->dry_nm) ? slowed : 0.0;
    c->rotor_rad += t->pole_pairs * c->speed_rad_s * t->step_s;
    c->lowest_rad_s = (c->lowest_rad_s <= c->speed_rad_s) ? c->lowest_rad_s : c->speed_rad_s;
}

/** Advances the columns by so many steps; of every so many keeps time, forced electrical speed, and each column's speed. The forced angle at the end. */
double start_trial(const trial_t *t, column_t *columns, size_t width, size_t steps, size_t every, double *kept)
{
    double forced_rad = 0.0;
    for (size_t k = 0; k < steps; k++) {
        double now_s = (double)k * t->step_s;
        double ramp_rad_s = fmax(now_s - t->lock_s, 0.0) * t->acceleration_rpm_s * t->rad_s_per_rpm * t->pole_pairs;
        double forced_rad_s = fmin(t->turning_rad_s + ramp_rad_s, t->end_rad_s);
        double pull_nm = t->pull_nm * fmin(now_s / t->lock_s, 1.0);
        forced_rad += forced_rad_s * t->step_s;
        for (size_t i = 0; i < width; i++) {
            advance(t, &columns[i], pull_nm, forced_rad, forced_rad_s / t->pole_pairs);
            if (now_s <= t->lock_s) {
                columns[i].locked_rad = columns[i].rotor_rad - forced_rad;
            }
        }
        if (k % every == 0) {
            *kept++ = now_s;
            *kept++ = forced_rad_s;
            for (size_t i = 0; i < width; i++) {
                *kept++ = columns[i].speed_rad_s;
            }
        }
    }
    return forced_rad;
}
