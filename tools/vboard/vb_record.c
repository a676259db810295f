/* What is measured of the plant: at the sampling instant, and over time. */
#include "vb_state.h"

#include <math.h>
#include <string.h>

/* The plant at the sampling instant. */
void vb_latch(vb_t *vb)
{
    const plant_motor_t *m = &vb->plant.motor;
    vb_latch_t *l = &vb->latch;
    double forward = plant_motor_forward(m);
    l->time_s = vb->plant.start_s + vb->plant.now_s;
    l->i_a = vb->plant.inverter.i[0];
    l->i_b = vb->plant.inverter.i[1];
    l->i_c = vb->plant.inverter.i[2];
    l->i_d = m->id;
    l->i_q = forward * m->iq;
    l->theta_e_deg = plant_motor_angle(m, m->theta + m->omega * vb->plant.now_s) * (180.0 / PLANT_PI);
    l->speed_rpm = forward * m->omega / m->pole_pairs * PLANT_RPM_PER_RAD_S;
    l->torque_nm = forward * plant_motor_torque(m);
    l->turns = forward * (m->turns + m->omega * vb->plant.now_s / (2.0 * PLANT_PI * m->pole_pairs));
    l->torque_mean_nm = forward * m->torque_nm;
    l->i_d_mean = m->id_a;
    l->i_q_mean = forward * m->iq_a;
    l->v_d = m->vd_v;
    l->v_q = forward * m->vq_v;
    vb->trace.due = true;
    vb->awaits_handler = true;
}

void vb_stat_reset(vb_t *vb)
{
    memset(&vb->stat, 0, sizeof vb->stat);
    vb->stat.bus_max_v = vb->plant.supply.bus_v;
    vb->stat.bus_min_v = vb->plant.supply.bus_v;
    vb->stat.speed_max_rpm = plant_motor_forward(&vb->plant.motor) * vb->plant.motor.omega / vb->plant.motor.pole_pairs * PLANT_RPM_PER_RAD_S;
    vb->stat.speed_min_rpm = vb->stat.speed_max_rpm;
}

void vb_stat_collect(vb_t *vb, double h_s)
{
    vb_stat_t *t = &vb->stat;
    const plant_motor_t *m = &vb->plant.motor;
    double rpm = plant_motor_forward(m) * m->omega / m->pole_pairs * PLANT_RPM_PER_RAD_S;
    double amplitude2 = m->id * m->id + m->iq * m->iq;
    t->periods += 1.0;
    t->bus_max_v = plant_max(t->bus_max_v, vb->plant.supply.bus_v);
    t->bus_min_v = plant_min(t->bus_min_v, vb->plant.supply.bus_v);
    t->speed_max_rpm = plant_max(t->speed_max_rpm, rpm);
    t->speed_min_rpm = plant_min(t->speed_min_rpm, rpm);
    t->speed_sum += rpm;
    t->i2_sum += 0.5 * amplitude2;
    t->v2_sum += m->vd_v * m->vd_v + m->vq_v * m->vq_v;
    t->torque_sum += m->torque_nm;
    t->energy_supply_j += vb->plant.supply.supply_a * vb->plant.supply.bus_v * h_s;
    t->energy_brake_j += vb->plant.supply.brake_a * vb->plant.supply.bus_v * h_s;
    t->energy_copper_j += m->copper_w * h_s;
    for (unsigned k = 0; k < 3; k++) {
        t->i_peak_a = plant_max(t->i_peak_a, fabs(vb->plant.inverter.i[k]));
    }
}
