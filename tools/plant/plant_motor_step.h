/* The part of the motor model that runs at every switching edge, in a header so that it is inlined there. Model: see plant_motor.c. */
#ifndef FOC33_PLANT_MOTOR_STEP_H
#define FOC33_PLANT_MOTOR_STEP_H

#include "plant.h"

#define PLANT_SQRT3 1.7320508075688772

/* What a step changes, to take it back. */
typedef struct {
    double id, iq, c, s, torque_nms, vd_vs, vq_vs, id_as, iq_as, copper_j;
} plant_motor_state_t;

static inline plant_motor_state_t plant_motor_save(const plant_motor_t *m)
{
    return (plant_motor_state_t){m->id, m->iq, m->c, m->s, m->torque_nms, m->vd_vs, m->vq_vs, m->id_as, m->iq_as, m->copper_j};
}

static inline void plant_motor_restore(plant_motor_t *m, const plant_motor_state_t *state)
{
    m->id = state->id;
    m->iq = state->iq;
    m->c = state->c;
    m->s = state->s;
    m->torque_nms = state->torque_nms;
    m->vd_vs = state->vd_vs;
    m->vq_vs = state->vq_vs;
    m->id_as = state->id_as;
    m->iq_as = state->iq_as;
    m->copper_j = state->copper_j;
}

/* Cosine and sine of a small angle; exact to 1e-8 below 0.2 rad. */
static inline void plant_rotation(double angle, double *c, double *s)
{
    double x2 = angle * angle;
    *c = 1.0 - x2 * (0.5 - x2 * (1.0 / 24.0));
    *s = angle * (1.0 - x2 * ((1.0 / 6.0) - x2 * (1.0 / 120.0)));
}

/* One stretch of constant terminal voltage: midpoint rule for the currents, voltage seen from the rotor's middle position. */
static inline void plant_motor_step(plant_motor_t *m, double v_alpha, double v_beta, double h_s)
{
    double rc, rs;
    double w = m->omega;
    double half = 0.5 * h_s;
    plant_rotation(half * w, &rc, &rs);
    double c = m->c * rc - m->s * rs;
    double s = m->s * rc + m->c * rs;
    double vd = v_alpha * c + v_beta * s;
    double vq = v_beta * c - v_alpha * s;
    m->c = c * rc - s * rs;
    m->s = s * rc + c * rs;

    double hd = h_s * m->inv_ld;
    double hq = h_s * m->inv_lq;
    double wlq = w * m->lq;
    double wld = w * m->ld;
    double vq_net = vq - w * m->psi;
    double id = m->id + 0.5 * hd * (vd - m->r * m->id + wlq * m->iq);
    double iq = m->iq + 0.5 * hq * (vq_net - m->r * m->iq - wld * m->id);
    m->id += hd * (vd - m->r * id + wlq * iq);
    m->iq += hq * (vq_net - m->r * iq - wld * id);

    m->torque_nms += h_s * 1.5 * m->pole_pairs * (m->psi + (m->ld - m->lq) * id) * iq;
    m->copper_j += h_s * 1.5 * m->r * (id * id + iq * iq);
    m->vd_vs += h_s * vd;
    m->vq_vs += h_s * vq;
    m->id_as += h_s * id;
    m->iq_as += h_s * iq;
}

static inline void plant_motor_phase_currents(const plant_motor_t *m, double i[3])
{
    double i_alpha = m->id * m->c - m->iq * m->s;
    double i_beta = m->id * m->s + m->iq * m->c;
    i[0] = i_alpha;
    i[1] = -0.5 * i_alpha + (0.5 * PLANT_SQRT3) * i_beta;
    i[2] = -i[0] - i[1];
}

#endif
