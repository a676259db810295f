/* The three half bridges: which device carries each leg, its voltage drop, floating legs, and the current drawn from the bus. */
#include "plant.h"
#include "plant_motor_step.h"

#include <math.h>

#define FLOAT_STEP_S 5e-6     /* a floating terminal is compared with the diodes' thresholds this often */
#define NO_PROGRESS_S 1e-12

static const double axis_cos[3] = {1.0, -0.5, -0.5};
static const double axis_sin[3] = {0.0, 0.5 * PLANT_SQRT3, -0.5 * PLANT_SQRT3};

/* The device that carries a leg, as terminal voltage = share * bus + fixed - ohm * i. */
static void set_equation(plant_t *plant, unsigned leg)
{
    const plant_inverter_t *inv = &plant->inverter;
    plant_leg_equation_t *eq = &plant->inverter.equation[leg];
    *eq = (plant_leg_equation_t){0.0, 0.0, 0.0, 0.0, 0.0};
    switch (inv->cond[leg]) {
    case PLANT_COND_HIGH: *eq = (plant_leg_equation_t){1.0, 0.0, inv->rds_on_ohm, 1.0, 0.0}; break;
    case PLANT_COND_LOW: eq->ohm = inv->rds_on_ohm + inv->shunt_ohm; break;
    case PLANT_COND_DIODE_LOW: *eq = (plant_leg_equation_t){0.0, -inv->diode_v, inv->diode_ohm + inv->shunt_ohm, 0.0, 0.0}; break;
    case PLANT_COND_DIODE_HIGH: *eq = (plant_leg_equation_t){1.0, inv->diode_v, inv->diode_ohm, 1.0, 0.0}; break;
    case PLANT_COND_SHOOT:
        *eq = (plant_leg_equation_t){0.5, 0.0, 0.5 * inv->rds_on_ohm, 0.5, 1.0 / (2.0 * inv->rds_on_ohm + inv->shunt_ohm)};
        break;
    default: break;
    }
}

static bool is_low_path(plant_cond_t cond)
{
    return cond == PLANT_COND_LOW || cond == PLANT_COND_DIODE_LOW || cond == PLANT_COND_SHOOT;
}

static void set_condition(plant_t *plant, unsigned leg, plant_cond_t cond)
{
    plant_inverter_t *inv = &plant->inverter;
    inv->cond[leg] = cond;
    set_equation(plant, leg);
    bool low = is_low_path(cond);
    if (low != inv->low_path[leg]) {
        inv->low_path[leg] = low;
        inv->low_since_s[leg] = plant->start_s + plant->now_s;
    }
    unsigned bit = 1u << leg;
    inv->float_mask = cond == PLANT_COND_FLOAT ? inv->float_mask | bit : inv->float_mask & ~bit;
}

/* A leg's current has reached zero (or its wire is open): take its share out of the motor's currents. */
static void set_floating(plant_t *plant, unsigned leg)
{
    plant_motor_t *m = &plant->motor;
    double i_alpha = m->id * m->c - m->iq * m->s;
    double i_beta = m->id * m->s + m->iq * m->c;
    double share = i_alpha * axis_cos[leg] + i_beta * axis_sin[leg];
    plant_motor_set_alpha_beta(m, i_alpha - share * axis_cos[leg], i_beta - share * axis_sin[leg]);
    plant_motor_phase_currents(m, plant->inverter.i);
    plant->inverter.i[leg] = 0.0;
    if (plant->inverter.cond[leg] != PLANT_COND_FLOAT) {
        set_condition(plant, leg, PLANT_COND_FLOAT);
    }
}

/* What the transistors of a leg do when the drivers ask for `gate`: a broken one does as it likes. */
static plant_gate_t transistors(const plant_inverter_t *inv, unsigned leg, plant_gate_t gate)
{
    unsigned dead = inv->dead_mask >> 2u * leg & 3u, stuck = inv->stuck_mask >> 2u * leg & 3u;
    return (plant_gate_t)(((unsigned)gate & ~dead) | stuck);
}

/* A driver is asked for something new. With both transistors off the current chooses the diode. */
void plant_inverter_gate(plant_t *plant, unsigned driver, plant_gate_t gate)
{
    static const plant_cond_t on[4] = {PLANT_COND_FLOAT, PLANT_COND_LOW, PLANT_COND_HIGH, PLANT_COND_SHOOT};
    plant_inverter_t *inv = &plant->inverter;
    unsigned leg = inv->leg_of[driver], bit = 1u << leg;
    inv->gate[driver] = gate;
    gate = transistors(inv, leg, gate);
    if ((inv->open_mask & bit) != 0) {
        inv->off_mask |= bit;
        set_floating(plant, leg);
    } else if (gate != PLANT_GATE_OFF) {
        inv->off_mask &= ~bit;
        set_condition(plant, leg, on[gate]);
    } else if ((inv->off_mask & bit) == 0) {
        inv->off_mask |= bit;
        double i = inv->i[leg];
        set_condition(plant, leg, i > 0.0 ? PLANT_COND_DIODE_LOW : i < 0.0 ? PLANT_COND_DIODE_HIGH : PLANT_COND_FLOAT);
    }
}

/* Which leg each driver drives: a driver's signal may have come to the wrong leg. */
static void connect_drivers(plant_inverter_t *inv)
{
    static const unsigned leg_of[PLANT_SWAPS][3] = {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}};
    for (unsigned k = 0; k < 3; k++) {
        inv->leg_of[k] = leg_of[(unsigned)inv->swapped][k];
    }
}

void plant_inverter_reset(plant_t *plant)
{
    plant_inverter_t *inv = &plant->inverter;
    inv->open_mask = inv->dead_mask = inv->stuck_mask = 0;
    connect_drivers(inv);
    plant->motor.derived_stale = true; /* what is broken acts from the first period on */
    inv->off_mask = 0;
    plant_motor_set_alpha_beta(&plant->motor, 0.0, 0.0);
    for (unsigned k = 0; k < 3; k++) {
        inv->i[k] = 0.0;
        plant_inverter_gate(plant, k, PLANT_GATE_OFF);
        inv->low_path[k] = false;
        inv->low_since_s[k] = plant->start_s - 1.0;
    }
    inv->bus_as = 0.0;
}

/* Start of a period: follow changed drops, and wires and transistors that have broken or are whole again. */
void plant_inverter_prepare(plant_t *plant)
{
    plant_inverter_t *inv = &plant->inverter;
    if (!plant->motor.derived_stale) {
        return;
    }
    unsigned open = inv->open_phase > 0.0 ? 1u << ((unsigned)inv->open_phase - 1u) : 0u;
    unsigned opened = open ^ inv->open_mask;
    unsigned dead = (unsigned)inv->never_on, stuck = (unsigned)inv->never_off;
    unsigned broken = (dead ^ inv->dead_mask) | (stuck ^ inv->stuck_mask);
    inv->open_mask = open;
    inv->dead_mask = dead;
    inv->stuck_mask = stuck;
    for (unsigned k = 0; k < 3; k++) {
        unsigned leg = inv->leg_of[k];
        if ((opened >> leg & 1u) != 0 || (broken >> 2u * leg & 3u) != 0) {
            plant_inverter_gate(plant, k, inv->gate[k]);
        }
        set_equation(plant, k);
    }
}

static inline double terminal_voltage(const plant_t *plant, unsigned leg)
{
    const plant_leg_equation_t *eq = &plant->inverter.equation[leg];
    return eq->share * plant->supply.bus_v + eq->fixed_v - eq->ohm * plant->inverter.i[leg];
}

/* Current from the bus into the bridge at this instant. */
double plant_inverter_bus_a(const plant_t *plant)
{
    const plant_leg_equation_t *eq = plant->inverter.equation;
    const double *i = plant->inverter.i;
    return eq[0].from_bus * i[0] + eq[1].from_bus * i[1] + eq[2].from_bus * i[2]
           + (eq[0].shoot_s + eq[1].shoot_s + eq[2].shoot_s) * plant->supply.bus_v;
}

/* Let a floating leg conduct through the diode that its open-circuit voltage `v` forward-biases. */
static void clamp_floating(plant_t *plant, unsigned leg, double v)
{
    if ((plant->inverter.open_mask & (1u << leg)) != 0) {
        return;
    }
    if (v > plant->supply.bus_v + plant->inverter.diode_v) {
        set_condition(plant, leg, PLANT_COND_DIODE_HIGH);
    } else if (v < -plant->inverter.diode_v) {
        set_condition(plant, leg, PLANT_COND_DIODE_LOW);
    }
}

/* Two or three legs float, so no current flows. Either one leg is held by a transistor and fixes the star point, or none is and the
 * line-to-line voltage decides. `hold` keeps the diodes off. */
static void resolve_idle(plant_t *plant, bool hold)
{
    plant_inverter_t *inv = &plant->inverter;
    double e[3];
    plant_motor_emf(&plant->motor, e);
    plant->motor.id = 0.0;
    plant->motor.iq = 0.0;
    unsigned high = 0, low = 0, held = 3;
    for (unsigned k = 0; k < 3; k++) {
        inv->i[k] = 0.0;
        if ((inv->off_mask & (1u << k)) == 0) {
            held = k;
        } else if (inv->cond[k] != PLANT_COND_FLOAT) {
            set_condition(plant, k, PLANT_COND_FLOAT);
        }
        high = e[k] > e[high] ? k : high;
        low = e[k] < e[low] ? k : low;
    }
    double star = 0.5 * (plant->supply.bus_v - e[high] - e[low]);
    if (held < 3) {
        star = terminal_voltage(plant, held) - e[held];
    }
    for (unsigned k = 0; k < 3; k++) {
        inv->v[k] = star + e[k];
        if (k != held && !hold) {
            clamp_floating(plant, k, inv->v[k]);
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
static void resolve_floating(plant_t *plant, bool hold)
{
    plant_inverter_t *inv = &plant->inverter;
    if (several(inv->float_mask)) {
        resolve_idle(plant, hold);
        return;
    }
    unsigned leg = single_leg(inv->float_mask);
    for (unsigned k = 0; k < 3; k++) {
        inv->v[k] = terminal_voltage(plant, k);
    }
    inv->v[leg] = plant_motor_float_voltage(&plant->motor, inv->v, leg);
    if (!hold) {
        clamp_floating(plant, leg, inv->v[leg]);
    }
}

static inline void step_motor(plant_t *plant, double h_s)
{
    const double *v = plant->inverter.v;
    plant_motor_step(&plant->motor, (2.0 * v[0] - v[1] - v[2]) * (1.0 / 3.0), (v[1] - v[2]) * (1.0 / PLANT_SQRT3), h_s);
    plant_motor_phase_currents(&plant->motor, plant->inverter.i);
}

/* The part of the step, 0..1, at which the first diode current passes zero; 1 if none does. `leg` is the one. */
static double first_crossing(const plant_inverter_t *inv, unsigned diodes, const double before[3], unsigned *leg)
{
    double first = 1.0;
    for (unsigned k = 0; k < 3; k++) {
        if ((diodes & (1u << k)) != 0) {
            double sign = inv->cond[k] == PLANT_COND_DIODE_LOW ? 1.0 : -1.0;
            double end = sign * inv->i[k];
            if (end < 0.0) {
                double start = plant_max(0.0, sign * before[k]);
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
static double step_with_off_legs(plant_t *plant, double h_s)
{
    plant_inverter_t *inv = &plant->inverter;
    unsigned floating = inv->float_mask;
    if (several(floating)) {
        plant_motor_turn(&plant->motor, h_s);
        return h_s;
    }
    plant_motor_state_t before_m = plant_motor_save(&plant->motor);
    double before_i[3] = {inv->i[0], inv->i[1], inv->i[2]};
    step_motor(plant, h_s);
    unsigned ended = 3;
    double part = first_crossing(inv, inv->off_mask & ~floating, before_i, &ended);
    if (ended < 3) {
        plant_motor_restore(&plant->motor, &before_m);
        h_s *= part;
        step_motor(plant, h_s);
        plant->now_s += h_s; /* the shunt stops carrying here */
        set_floating(plant, ended);
        plant->now_s -= h_s;
    }
    if (floating != 0) {
        set_floating(plant, single_leg(floating));
    }
    return h_s;
}

/* Go on to `until_s` without any change of the transistors. Terminal voltages, currents, angle and bus charge follow. Returns false, and
 * stays where it is (plant->now_s), as soon as the bus current exceeds `trip_a`. */
bool plant_inverter_run(plant_t *plant, double until_s, double trip_a)
{
    plant_inverter_t *inv = &plant->inverter;
    bool hold = false; /* a diode that was found not to conduct stays off for one step */
    while (plant->now_s < until_s) {
        double bus_before = plant_inverter_bus_a(plant);
        if (bus_before > trip_a) {
            return false;
        }
        double h = plant_min(until_s - plant->now_s, inv->max_step_s);
        if (inv->float_mask != 0) {
            h = plant_min(h, FLOAT_STEP_S);
            resolve_floating(plant, hold);
        }
        if (inv->float_mask == 0) {
            inv->v[0] = terminal_voltage(plant, 0);
            inv->v[1] = terminal_voltage(plant, 1);
            inv->v[2] = terminal_voltage(plant, 2);
        } else if (!several(inv->float_mask)) {
            unsigned leg = single_leg(inv->float_mask);
            for (unsigned k = 0; k < 3; k++) {
                inv->v[k] = k == leg ? inv->v[k] : terminal_voltage(plant, k);
            }
        }
        double passed = h;
        if (inv->off_mask == 0) {
            step_motor(plant, h);
        } else {
            passed = step_with_off_legs(plant, h);
        }
        hold = passed < NO_PROGRESS_S;
        inv->bus_as += 0.5 * (bus_before + plant_inverter_bus_a(plant)) * passed;
        plant->now_s = passed < until_s - plant->now_s ? plant->now_s + passed : until_s;
    }
    return true;
}
