/* The plant: inverter, motor, shaft with its load, supply. It knows no register: gates go in, currents and voltages come out. */
#ifndef FOC33_PLANT_PLANT_H
#define FOC33_PLANT_PLANT_H

#include <stdbool.h>

#define PLANT_PI 3.14159265358979323846
#define PLANT_RPM_PER_RAD_S (30.0 / PLANT_PI)
#define PLANT_NEVER 1e30

/* Two of three wires that have changed places. */
typedef enum { PLANT_SWAP_NONE, PLANT_SWAP_AB, PLANT_SWAP_BC, PLANT_SWAP_CA, PLANT_SWAPS } plant_swap_t;

/* ---- motor and mechanics (plant_motor.c) ---- */

/* A load that goes with the shaft's angle: nm * sin(order * angle + deg), against the forward direction; it also acts on a shaft that stands. */
typedef struct {
    double nm, order, deg;
} plant_pulse_t;

enum { PLANT_PULSES = 3 };

typedef struct {
    /* parameters as set by keys */
    double rs_ohm, ld_h, lq_h, psi_vs, pole_pairs;
    double sat_ld_ratio, sat_lq_ratio, sat_current_a; /* share of L that is lost at sat_current_a; 0 = linear */
    double temp_c, r_tempco, psi_tempco;
    double inertia_kgm2, viscous_nms, coulomb_nm, stiction_nm;
    double load_constant_nm, load_active_nm, load_viscous_nms, load_quadratic_nms2, load_locked;
    plant_pulse_t load_pulse[PLANT_PULSES]; /* their sum; the angle is the shaft's since creation */
    double swapped; /* plant_swap_t: two of its wires; angle, speed and torque here are as the bridge sees them */
    /* effective values of this period */
    double r, psi, ld, lq, inv_ld, inv_lq;
    /* state: dq currents, electrical angle with its cosine and sine, electrical speed (constant within a period) */
    double id, iq, theta, c, s, omega;
    double turns; /* mechanical revolutions since creation */
    /* integrals over the period */
    double torque_nms, vd_vs, vq_vs, id_as, iq_as, copper_j;
    double torque_nm, vd_v, vq_v, id_a, iq_a, copper_w; /* means of the last period */
    bool derived_stale;
} plant_motor_t;

/* ---- inverter (plant_inverter.c) ---- */

typedef enum { PLANT_GATE_OFF = 0, PLANT_GATE_LOW = 1, PLANT_GATE_HIGH = 2, PLANT_GATE_BOTH = 3 } plant_gate_t;
typedef enum {
    PLANT_COND_FLOAT, PLANT_COND_LOW, PLANT_COND_HIGH, PLANT_COND_DIODE_LOW, PLANT_COND_DIODE_HIGH, PLANT_COND_SHOOT
} plant_cond_t;

/* A leg: terminal voltage = share * bus + fixed - ohm * i; it takes from_bus * i + shoot * bus from the bus. */
typedef struct {
    double share, fixed_v, ohm, from_bus, shoot_s;
} plant_leg_equation_t;

typedef struct {
    double rds_on_ohm, diode_v, diode_ohm, turn_on_s, turn_off_s, trip_a, open_phase;
    double shunt_ohm;
    double swapped;             /* plant_swap_t: of the drivers' signals */
    double never_on, never_off; /* broken transistors: masks of bits 1L, 1H, 2L, 2H, 3L, 3H; one that is in both never turns off */
    plant_gate_t gate[3];       /* what the drivers are asked for; all else here goes by legs */
    unsigned leg_of[3];         /* the leg that a driver drives */
    plant_cond_t cond[3];
    bool low_path[3];        /* the low transistor or its diode carries the leg */
    double low_since_s[3];   /* when low_path last changed, absolute time */
    double i[3];             /* phase currents, into the motor */
    double v[3];             /* terminal voltages of the last segment, against bus minus */
    plant_leg_equation_t equation[3]; /* what cond[] means for voltages and the bus */
    double bus_as;           /* integral over this period of the current from the bus into the bridge */
    double max_step_s;       /* upper bound of an integration step */
    unsigned off_mask, float_mask; /* legs (bit k) with both transistors off, and those of them that carry nothing */
    unsigned open_mask;      /* the open phase, as a mask, that the conduction states stand for */
    unsigned dead_mask, stuck_mask; /* never_on and never_off that they stand for */
} plant_inverter_t;

/* ---- supply and bus capacitor (plant_supply.c) ---- */

typedef struct {
    double voltage_v, resistance_ohm, sinks, capacitance_f, load_a;
    double brake_ohm;       /* brake resistor, 0: none */
    bool brake_on;          /* its switch, of this period */
    double bus_v;
    double bus_a, supply_a, brake_a; /* means of the last period: bridge, supply, brake resistor */
} plant_supply_t;

/* All of it, and the time: of the present PWM period's start, and within that period. */
typedef struct {
    plant_motor_t motor;
    plant_inverter_t inverter;
    plant_supply_t supply;
    double start_s, now_s;
} plant_t;

static inline double plant_min(double a, double b)
{
    return a < b ? a : b;
}

static inline double plant_max(double a, double b)
{
    return a > b ? a : b;
}

/* `x` brought into 0..range; it is at most a few ranges away. */
static inline double plant_wrap(double x, double range)
{
    while (x >= range) {
        x -= range;
    }
    while (x < 0.0) {
        x += range;
    }
    return x;
}

/* plant_motor.c */
void plant_motor_prepare(plant_motor_t *m);
void plant_motor_turn(plant_motor_t *m, double h_s);
double plant_motor_float_voltage(const plant_motor_t *m, const double v[3], unsigned leg);
void plant_motor_set_alpha_beta(plant_motor_t *m, double i_alpha, double i_beta);
void plant_motor_emf(const plant_motor_t *m, double e[3]);
double plant_motor_torque(const plant_motor_t *m);
double plant_motor_pulse(const plant_motor_t *m);
double plant_motor_forward(const plant_motor_t *m);
double plant_motor_angle(const plant_motor_t *m, double theta);
void plant_motor_mechanics(plant_motor_t *m, double h_s);

/* plant_inverter.c */
void plant_inverter_reset(plant_t *plant);
void plant_inverter_gate(plant_t *plant, unsigned driver, plant_gate_t gate);
bool plant_inverter_run(plant_t *plant, double until_s, double trip_a);
double plant_inverter_bus_a(const plant_t *plant);
void plant_inverter_prepare(plant_t *plant);

/* plant_supply.c */
void plant_supply_step(plant_supply_t *s, double bridge_as, double h_s);

#endif
