/* The motor: a permanent-magnet synchronous machine in rotor coordinates, and the shaft with its friction and load.
 *
 * Amplitude-invariant Clarke transform, alpha axis on phase A, theta = angle of the rotor flux (d axis):
 *   Ld did/dt = vd - R id + w Lq iq,   Lq diq/dt = vq - R iq - w (Ld id + psi),   T = 3/2 P (psi + (Ld - Lq) id) iq
 */
#include "plant.h"
#include "plant_motor_step.h"

#include <math.h>

static const double axis_cos[3] = {1.0, -0.5, -0.5};
static const double axis_sin[3] = {0.0, 0.5 * PLANT_SQRT3, -0.5 * PLANT_SQRT3};

/* Effective R, psi and L of the coming period. Saturation is slow compared with a period: L follows the current once per period. */
void plant_motor_prepare(plant_motor_t *m)
{
    bool saturates = m->sat_ld_ratio > 0.0 || m->sat_lq_ratio > 0.0;
    if (!m->derived_stale && !saturates) {
        return;
    }
    m->derived_stale = false;
    double above_25 = m->temp_c - 25.0;
    m->r = m->rs_ohm * plant_max(0.0, 1.0 + m->r_tempco * above_25);
    m->psi = m->psi_vs * plant_max(0.0, 1.0 + m->psi_tempco * above_25);
    double depth = plant_min(1.0, (m->id * m->id + m->iq * m->iq) / (m->sat_current_a * m->sat_current_a));
    m->ld = m->ld_h * (1.0 - m->sat_ld_ratio * depth);
    m->lq = m->lq_h * (1.0 - m->sat_lq_ratio * depth);
    m->inv_ld = 1.0 / m->ld;
    m->inv_lq = 1.0 / m->lq;
}

/* The rotor turns without any current. The terminals carry the back-EMF. */
void plant_motor_turn(plant_motor_t *m, double h_s)
{
    double rc, rs;
    plant_rotation(h_s * m->omega, &rc, &rs);
    double c = m->c * rc - m->s * rs;
    m->s = m->s * rc + m->c * rs;
    m->c = c;
    m->id = 0.0;
    m->iq = 0.0;
    m->vq_vs += h_s * m->psi * m->omega;
}

/* Terminal voltage of `leg` at which its current does not change, with the other two terminals at v[]. */
double plant_motor_float_voltage(const plant_motor_t *m, const double v[3], unsigned leg)
{
    double v_alpha = 0.0;
    double v_beta = 0.0;
    for (unsigned k = 0; k < 3; k++) {
        if (k != leg) {
            v_alpha += (2.0 / 3.0) * axis_cos[k] * v[k];
            v_beta += (2.0 / 3.0) * axis_sin[k] * v[k];
        }
    }
    double vd = v_alpha * m->c + v_beta * m->s;
    double vq = v_beta * m->c - v_alpha * m->s;
    double did = m->inv_ld * (vd - m->r * m->id + m->omega * m->lq * m->iq);
    double diq = m->inv_lq * (vq - m->r * m->iq - m->omega * (m->ld * m->id + m->psi));
    double axis_d = axis_cos[leg] * m->c + axis_sin[leg] * m->s;
    double axis_q = axis_sin[leg] * m->c - axis_cos[leg] * m->s;
    double slope_at_zero = axis_d * (did - m->omega * m->iq) + axis_q * (diq + m->omega * m->id);
    double slope_per_volt = (2.0 / 3.0) * (axis_d * axis_d * m->inv_ld + axis_q * axis_q * m->inv_lq);
    return -slope_at_zero / slope_per_volt;
}

void plant_motor_set_alpha_beta(plant_motor_t *m, double i_alpha, double i_beta)
{
    m->id = i_alpha * m->c + i_beta * m->s;
    m->iq = i_beta * m->c - i_alpha * m->s;
}

/* Phase voltages of the open winding. */
void plant_motor_emf(const plant_motor_t *m, double e[3])
{
    double amplitude = m->psi * m->omega;
    e[0] = -amplitude * m->s;
    e[1] = amplitude * (0.5 * m->s + (0.5 * PLANT_SQRT3) * m->c);
    e[2] = -e[0] - e[1];
}

double plant_motor_torque(const plant_motor_t *m)
{
    return 1.5 * m->pole_pairs * (m->psi + (m->ld - m->lq) * m->id) * m->iq;
}

/* 1, or -1 where two wires have changed places: the shaft turns the other way round. */
double plant_motor_forward(const plant_motor_t *m)
{
    return m->swapped == PLANT_SWAP_NONE ? 1.0 : -1.0;
}

/* The shaft's angle for that of the rotor flux against the bridge's leg A, and the other way round: with two wires swapped the rotor is
 * mirrored in the axis of the third. */
double plant_motor_angle(const plant_motor_t *m, double theta)
{
    static const double mirror[PLANT_SWAPS] = {0.0, 2.0 * PLANT_PI / 3.0, 0.0, 4.0 * PLANT_PI / 3.0};
    return plant_wrap(mirror[(unsigned)m->swapped] + plant_motor_forward(m) * theta, 2.0 * PLANT_PI);
}

/* What the load by angle asks of the shaft here, positive against the forward direction: it follows from the angle alone, so a turn neither
 * takes nor gives energy. */
double plant_motor_pulse(const plant_motor_t *m)
{
    double angle = plant_motor_forward(m) * 2.0 * PLANT_PI * m->turns;
    double torque = 0.0;
    for (unsigned k = 0; k < PLANT_PULSES; k++) {
        const plant_pulse_t *pulse = &m->load_pulse[k];
        if (pulse->nm != 0.0) {
            torque += pulse->nm * sin(pulse->order * angle + pulse->deg * (PLANT_PI / 180.0));
        }
    }
    return torque;
}

/* Shaft speed after `h_s` at the torque of the period. Coulomb friction and the brake load hold a shaft that stands still and never
 * turn it backwards. */
static double next_speed(const plant_motor_t *m, double speed, double torque, double h_s)
{
    double drive = torque + plant_motor_forward(m) * (m->load_active_nm - plant_motor_pulse(m));
    double dry = m->coulomb_nm + m->load_constant_nm;
    double direction = speed;
    if (speed == 0.0) {
        double hold = plant_max(m->stiction_nm, m->coulomb_nm) + m->load_constant_nm;
        if (fabs(drive) <= hold) {
            return 0.0;
        }
        direction = drive;
    }
    double viscous = m->viscous_nms + m->load_viscous_nms + m->load_quadratic_nms2 * fabs(speed);
    double next = (speed + h_s / m->inertia_kgm2 * (drive - copysign(dry, direction))) / (1.0 + h_s / m->inertia_kgm2 * viscous);
    return next * direction < 0.0 ? 0.0 : next;
}

/* End of a period: new angle from the speed that held during the period, which is that of its middle; new speed, that of the next one's
 * middle, from the torque between the two. With this period's mean torque a rotor would swing more and more by itself. */
void plant_motor_mechanics(plant_motor_t *m, double h_s)
{
    double before_nm = m->torque_nm;
    m->torque_nm = m->torque_nms / h_s;
    double between_nm = 1.5 * m->torque_nm - 0.5 * before_nm;
    m->vd_v = m->vd_vs / h_s;
    m->vq_v = m->vq_vs / h_s;
    m->id_a = m->id_as / h_s;
    m->iq_a = m->iq_as / h_s;
    m->copper_w = m->copper_j / h_s;
    m->theta = plant_wrap(m->theta + m->omega * h_s, 2.0 * PLANT_PI);
    m->c = cos(m->theta);
    m->s = sin(m->theta);
    double speed = m->omega / m->pole_pairs;
    m->turns += speed * h_s / (2.0 * PLANT_PI);
    double next = m->load_locked != 0.0 ? 0.0 : next_speed(m, speed, between_nm, h_s);
    m->omega = next * m->pole_pairs;
    m->torque_nms = 0.0;
    m->vd_vs = 0.0;
    m->vq_vs = 0.0;
    m->id_as = 0.0;
    m->iq_as = 0.0;
    m->copper_j = 0.0;
}
