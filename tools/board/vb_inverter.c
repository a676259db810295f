/* The three half bridges: which device carries each leg, its voltage drop, floating legs, and the current drawn from the bus. */
#include "vb_internal.h"
#include "vb_motor_step.h"

#include <math.h>

#define FLOAT_STEP_S 5e-6     /* a floating terminal is compared with the diodes' thresholds this often */
#define NO_PROGRESS_S 1e-12

static const double axis_cos[3] = {1.0, -0.5, -0.5};
static const double axis_sin[3] = {0.0, 0.5 * VB_SQRT3, -0.5 * VB_SQRT3};

/* The device that carries a leg, as terminal voltage = share * bus + fixed - ohm * i. */
static void set_equation(vb_t *vb, unsigned leg)
{
    const vb_inverter_t *inv = &vb->inverter;
    vb_leg_equation_t *eq = &vb->inverter.equation[leg];
    *eq = (vb_leg_equation_t){0.0, 0.0, 0.0, 0.0, 0.0};
    switch (inv->cond[leg]) {
    case VB_COND_HIGH:
        *eq = (vb_leg_equation_t){1.0, 0.0, inv->rds_on_ohm, 1.0, 0.0};
        break;
    case VB_COND_LOW:
        eq->ohm = inv->rds_on_ohm + inv->shunt_ohm;
        break;
    case VB_COND_DIODE_LOW:
        eq->fixed_v = -inv->diode_v;
        eq->ohm = inv->diode_ohm + inv->shunt_ohm;
        break;
    case VB_COND_DIODE_HIGH:
        *eq = (vb_leg_equation_t){1.0, inv->diode_v, inv->diode_ohm, 1.0, 0.0};
        break;
    case VB_COND_SHOOT:
        *eq = (vb_leg_equation_t){0.5, 0.0, 0.5 * inv->rds_on_ohm, 0.5, 1.0 / (2.0 * inv->rds_on_ohm + inv->shunt_ohm)};
        break;
    case VB_COND_FLOAT:
    default:
        break;
    }
}

static bool is_low_path(vb_cond_t cond)
{
    return cond == VB_COND_LOW || cond == VB_COND_DIODE_LOW || cond == VB_COND_SHOOT;
}

static void set_condition(vb_t *vb, unsigned leg, vb_cond_t cond)
{
    vb_inverter_t *inv = &vb->inverter;
    inv->cond[leg] = cond;
    set_equation(vb, leg);
    bool low = is_low_path(cond);
    if (low != inv->low_path[leg]) {
        inv->low_path[leg] = low;
        inv->low_since_s[leg] = vb->start_s + vb->now_s;
    }
    unsigned bit = 1u << leg;
    inv->float_mask = cond == VB_COND_FLOAT ? inv->float_mask | bit : inv->float_mask & ~bit;
}

/* A leg's current has reached zero (or its wire is open): take its share out of the motor's currents. */
static void set_floating(vb_t *vb, unsigned leg)
{
    vb_motor_t *m = &vb->motor;
    double i_alpha = m->id * m->c - m->iq * m->s;
    double i_beta = m->id * m->s + m->iq * m->c;
    double share = i_alpha * axis_cos[leg] + i_beta * axis_sin[leg];
    vb_motor_set_alpha_beta(m, i_alpha - share * axis_cos[leg], i_beta - share * axis_sin[leg]);
    vb_motor_phase_currents(m, vb->inverter.i);
    vb->inverter.i[leg] = 0.0;
    if (vb->inverter.cond[leg] != VB_COND_FLOAT) {
        set_condition(vb, leg, VB_COND_FLOAT);
    }
}

/* New state of a leg's transistors. With both off the current chooses the diode. */
void vb_inverter_gate(vb_t *vb, unsigned leg, vb_gate_t gate)
{
    static const vb_cond_t on[4] = {VB_COND_FLOAT, VB_COND_LOW, VB_COND_HIGH, VB_COND_SHOOT};
    vb_inverter_t *inv = &vb->inverter;
    unsigned bit = 1u << leg;
    inv->gate[leg] = gate;
    if ((inv->open_mask & bit) != 0) {
        inv->off_mask |= bit;
        set_floating(vb, leg);
    } else if (gate != VB_GATE_OFF) {
        inv->off_mask &= ~bit;
        set_condition(vb, leg, on[gate]);
    } else if ((inv->off_mask & bit) == 0) {
        inv->off_mask |= bit;
        double i = inv->i[leg];
        set_condition(vb, leg, i > 0.0 ? VB_COND_DIODE_LOW : i < 0.0 ? VB_COND_DIODE_HIGH : VB_COND_FLOAT);
    }
}

void vb_inverter_reset(vb_t *vb)
{
    vb_inverter_t *inv = &vb->inverter;
    inv->open_mask = 0;
    inv->off_mask = 0;
    vb_motor_set_alpha_beta(&vb->motor, 0.0, 0.0);
    for (unsigned k = 0; k < 3; k++) {
        inv->i[k] = 0.0;
        vb_inverter_gate(vb, k, VB_GATE_OFF);
        inv->low_path[k] = false;
        inv->low_since_s[k] = vb->start_s - 1.0;
    }
    inv->bus_as = 0.0;
}

/* Start of a period: follow changed drops, and a phase wire that was opened or closed. */
void vb_inverter_prepare(vb_t *vb)
{
    vb_inverter_t *inv = &vb->inverter;
    if (!vb->motor.derived_stale) {
        return;
    }
    unsigned open = inv->open_phase > 0.0 ? 1u << ((unsigned)inv->open_phase - 1u) : 0u;
    unsigned changed = open ^ inv->open_mask;
    inv->open_mask = open;
    for (unsigned k = 0; k < 3; k++) {
        if ((changed & (1u << k)) != 0) {
            vb_inverter_gate(vb, k, inv->gate[k]);
        }
        set_equation(vb, k);
    }
}

static inline double terminal_voltage(const vb_t *vb, unsigned leg)
{
    const vb_leg_equation_t *eq = &vb->inverter.equation[leg];
    return eq->share * vb->supply.bus_v + eq->fixed_v - eq->ohm * vb->inverter.i[leg];
}

/* Current from the bus into the bridge at this instant. */
static inline double bus_current(const vb_t *vb)
{
    const vb_leg_equation_t *eq = vb->inverter.equation;
    const double *i = vb->inverter.i;
    return eq[0].from_bus * i[0] + eq[1].from_bus * i[1] + eq[2].from_bus * i[2]
           + (eq[0].shoot_s + eq[1].shoot_s + eq[2].shoot_s) * vb->supply.bus_v;
}

double vb_inverter_bus_a(const vb_t *vb)
{
    return bus_current(vb);
}

/* Let a floating leg conduct through the diode that its open-circuit voltage `v` forward-biases. */
static void clamp_floating(vb_t *vb, unsigned leg, double v)
{
    if ((vb->inverter.open_mask & (1u << leg)) != 0) {
        return;
    }
    if (v > vb->supply.bus_v + vb->inverter.diode_v) {
        set_condition(vb, leg, VB_COND_DIODE_HIGH);
    } else if (v < -vb->inverter.diode_v) {
        set_condition(vb, leg, VB_COND_DIODE_LOW);
    }
}

/* Two or three legs float, so no current flows. Either one leg is held by a transistor and fixes the star point, or none is and the
 * line-to-line voltage decides. `hold` keeps the diodes off. */
static void resolve_idle(vb_t *vb, bool hold)
{
    vb_inverter_t *inv = &vb->inverter;
    double e[3];
    vb_motor_emf(&vb->motor, e);
    vb->motor.id = 0.0;
    vb->motor.iq = 0.0;
    unsigned high = 0, low = 0, held = 3;
    for (unsigned k = 0; k < 3; k++) {
        inv->i[k] = 0.0;
        if ((inv->off_mask & (1u << k)) == 0) {
            held = k;
        } else if (inv->cond[k] != VB_COND_FLOAT) {
            set_condition(vb, k, VB_COND_FLOAT);
        }
        high = e[k] > e[high] ? k : high;
        low = e[k] < e[low] ? k : low;
    }
    double star = 0.5 * (vb->supply.bus_v - e[high] - e[low]);
    if (held < 3) {
        star = terminal_voltage(vb, held) - e[held];
    }
    for (unsigned k = 0; k < 3; k++) {
        inv->v[k] = star + e[k];
        if (k != held && !hold) {
            clamp_floating(vb, k, inv->v[k]);
        }
    }
}

static unsigned single_leg(unsigned mask)
{
    return mask >> 1; /* 1, 2, 4 -> 0, 1, 2 */
}

static bool several(unsigned mask)
{
    return (mask & (mask - 1u)) != 0;
}

/* Voltages of floating legs, and whether a diode starts to conduct there. */
static void resolve_floating(vb_t *vb, bool hold)
{
    vb_inverter_t *inv = &vb->inverter;
    if (several(inv->float_mask)) {
        resolve_idle(vb, hold);
        return;
    }
    unsigned leg = single_leg(inv->float_mask);
    for (unsigned k = 0; k < 3; k++) {
        inv->v[k] = terminal_voltage(vb, k);
    }
    inv->v[leg] = vb_motor_float_voltage(&vb->motor, inv->v, leg);
    if (!hold) {
        clamp_floating(vb, leg, inv->v[leg]);
    }
}

static inline void step_motor(vb_t *vb, double h_s)
{
    const double *v = vb->inverter.v;
    vb_motor_step(&vb->motor, (2.0 * v[0] - v[1] - v[2]) * (1.0 / 3.0), (v[1] - v[2]) * (1.0 / VB_SQRT3), h_s);
    vb_motor_phase_currents(&vb->motor, vb->inverter.i);
}

/* The part of the step, 0..1, at which the first diode current passes zero; 1 if none does. `leg` is the one. */
static double first_crossing(const vb_inverter_t *inv, unsigned diodes, const double before[3], unsigned *leg)
{
    double first = 1.0;
    for (unsigned k = 0; k < 3; k++) {
        if ((diodes & (1u << k)) != 0) {
            double sign = inv->cond[k] == VB_COND_DIODE_LOW ? 1.0 : -1.0;
            double end = sign * inv->i[k];
            if (end < 0.0) {
                double start = vb_max(0.0, sign * before[k]);
                double part = start / (start - end);
                if (part < first) {
                    first = part;
                    *leg = k;
                }
            }
        }
    }
    return first;
}

/* A stretch in which at least one leg is carried by a diode or floats. Returns the time that passed: it ends early where a diode stops
 * conducting. */
static double step_with_off_legs(vb_t *vb, double h_s)
{
    vb_inverter_t *inv = &vb->inverter;
    unsigned floating = inv->float_mask;
    if (several(floating)) {
        vb_motor_turn(&vb->motor, h_s);
        return h_s;
    }
    vb_motor_state_t before_m = vb_motor_save(&vb->motor);
    double before_i[3] = {inv->i[0], inv->i[1], inv->i[2]};
    step_motor(vb, h_s);
    unsigned ended = 3;
    double part = first_crossing(inv, inv->off_mask & ~floating, before_i, &ended);
    if (ended < 3) {
        vb_motor_restore(&vb->motor, &before_m);
        h_s *= part;
        step_motor(vb, h_s);
        vb->now_s += h_s; /* the shunt stops carrying here */
        set_floating(vb, ended);
        vb->now_s -= h_s;
    }
    if (floating != 0) {
        set_floating(vb, single_leg(floating));
    }
    return h_s;
}

/* Go on to `until_s` without any change of the transistors. Terminal voltages, currents, angle and bus charge follow. Returns false, and
 * stays where it is (vb->now_s), as soon as the bus current exceeds `trip_a`. */
bool vb_inverter_run(vb_t *vb, double until_s, double trip_a)
{
    vb_inverter_t *inv = &vb->inverter;
    bool hold = false; /* a diode that was found not to conduct stays off for one step */
    while (vb->now_s < until_s) {
        double bus_before = bus_current(vb);
        if (bus_before > trip_a) {
            return false;
        }
        double h = vb_min(until_s - vb->now_s, inv->max_step_s);
        if (inv->float_mask != 0) {
            h = vb_min(h, FLOAT_STEP_S);
            resolve_floating(vb, hold);
        }
        if (inv->float_mask == 0) {
            inv->v[0] = terminal_voltage(vb, 0);
            inv->v[1] = terminal_voltage(vb, 1);
            inv->v[2] = terminal_voltage(vb, 2);
        } else if (!several(inv->float_mask)) {
            unsigned leg = single_leg(inv->float_mask);
            for (unsigned k = 0; k < 3; k++) {
                inv->v[k] = k == leg ? inv->v[k] : terminal_voltage(vb, k);
            }
        }
        double passed = h;
        if (inv->off_mask == 0) {
            step_motor(vb, h);
        } else {
            passed = step_with_off_legs(vb, h);
        }
        hold = passed < NO_PROGRESS_S;
        inv->bus_as += 0.5 * (bus_before + bus_current(vb)) * passed;
        vb->now_s = passed < until_s - vb->now_s ? vb->now_s + passed : until_s;
    }
    return true;
}
