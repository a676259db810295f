/* The string keys: one table of names, units, ranges, defaults and meanings, and the way to each value. */
#include "chip_pwm_edges.h"
#include "plant_motor_step.h"
#include "vb_state.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { KIND_FIELD, KIND_GET, KIND_PROBE, KIND_REG, KIND_PIN };
enum { PINS = 35, PROBES = 128, NAME_SIZE = 64 };

typedef struct {
    vb_key_t info;
    double start;  /* value of a new board, for fields that can be written */
    size_t offset;
    double (*get)(const vb_t *vb);
    void (*set)(vb_t *vb, double value);
} key_entry_t;

static double get_time(const vb_t *vb) { return vb->plant.start_s + vb->plant.now_s; }
static double get_theta(const vb_t *vb) { return plant_motor_angle(&vb->plant.motor, vb->plant.motor.theta) * (180.0 / PLANT_PI); }
static double get_speed(const vb_t *vb) { return plant_motor_forward(&vb->plant.motor) * vb->plant.motor.omega / vb->plant.motor.pole_pairs * PLANT_RPM_PER_RAD_S; }
static double get_frequency(const vb_t *vb) { return vb->chip.pwm.running ? 1.0 / vb->chip.pwm.period_s : 0.0; }
static double get_running(const vb_t *vb) { return vb->chip.pwm.running ? 1.0 : 0.0; }
static double get_mask(const vb_t *vb) { return (double)chip_pwm_mask(&vb->chip); }
static double get_seen_mask(const vb_t *vb) { return (double)vb->chip.pwm.last_mask; }
static double get_fault_active(const vb_t *vb) { return vb->chip.fault.active ? 1.0 : 0.0; }
static double get_fault_pin(const vb_t *vb) { return vb->chip.fault.pin ? 1.0 : 0.0; }
static double get_trigger_us(const vb_t *vb) { return vb->chip.pwm.trigger_s < PLANT_NEVER ? vb->chip.pwm.trigger_s * 1e6 : -1.0; }
static double get_dead_us(const vb_t *vb) { return vb->chip.pwm.leg[0].dead_high_s * 1e6; }
static double get_led_alive(const vb_t *vb) { return vb_circuit_led(vb, 0); }
static double get_led_run(const vb_t *vb) { return vb_circuit_led(vb, 1); }
static double get_fault_relay(const vb_t *vb) { return vb_circuit_switch(vb, VB_FAULT_RELAY) ? 1.0 : 0.0; }
static double get_running_relay(const vb_t *vb) { return vb_circuit_switch(vb, VB_RUNNING_RELAY) ? 1.0 : 0.0; }
static double get_brake(const vb_t *vb) { return vb_circuit_switch(vb, VB_BRAKE) ? 1.0 : 0.0; }
static double get_conversion_us(const vb_t *vb) { return (double)vb->chip.adc.channels * vb->chip.adc.conversion_s * 1e6; }

static double reading_of(const vb_t *vb, unsigned k)
{
    const chip_adc_t *adc = &vb->chip.adc;
    return adc->samples > 0.0 ? (vb->analogue.offset_v - adc->volts[k]) / vb->analogue.gain_v_per_a : 0.0;
}

static double get_ia(const vb_t *vb) { return reading_of(vb, 0); }
static double get_ib(const vb_t *vb) { return reading_of(vb, 1); }

static double duty_of(const vb_t *vb, unsigned k)
{
    const chip_pwm_t *pwm = &vb->chip.pwm;
    double full = 2.0 * (double)(pwm->tper + 1u); /* duty registers count half ticks of half a period, or of the whole one */
    return pwm->running ? plant_min(1.0, (double)pwm->duty[k] / full) : 0.0;
}

static double get_duty1(const vb_t *vb) { return duty_of(vb, 0); }
static double get_duty2(const vb_t *vb) { return duty_of(vb, 1); }
static double get_duty3(const vb_t *vb) { return duty_of(vb, 2); }

static double mean(const vb_t *vb, double sum) { return vb->stat.periods > 0.0 ? sum / vb->stat.periods : 0.0; }
static double get_i_rms(const vb_t *vb) { return sqrt(mean(vb, vb->stat.i2_sum)); }
static double get_v_rms(const vb_t *vb) { return sqrt(mean(vb, vb->stat.v2_sum)); }
static double get_speed_mean(const vb_t *vb) { return mean(vb, vb->stat.speed_sum); }
static double get_torque_mean(const vb_t *vb) { return mean(vb, vb->stat.torque_sum); }

static double mean_of(const vb_range_t *range) { return range->count > 0.0 ? range->sum / range->count : 0.0; }
static double get_isr_mean(const vb_t *vb) { return mean_of(&vb->count.isr); }
static double get_slow_mean(const vb_t *vb) { return mean_of(&vb->count.slow); }
static double get_period_mean(const vb_t *vb) { return mean_of(&vb->count.period); }
static double get_latency_mean(const vb_t *vb) { return mean_of(&vb->count.latency); }

static void set_theta(vb_t *vb, double deg)
{
    plant_motor_t *m = &vb->plant.motor;
    m->theta = plant_motor_angle(m, fmod(deg * (PLANT_PI / 180.0), 2.0 * PLANT_PI));
    m->c = cos(m->theta);
    m->s = sin(m->theta);
    plant_motor_phase_currents(m, vb->plant.inverter.i);
}

static void set_speed(vb_t *vb, double rpm) { vb->plant.motor.omega = plant_motor_forward(&vb->plant.motor) * rpm / PLANT_RPM_PER_RAD_S * vb->plant.motor.pole_pairs; }

/* The clock changes at the next period: what was decoded with the old one counts no more. */
static void set_crystal(vb_t *vb, double hz)
{
    vb->chip.clock.crystal_hz = hz;
    memset(vb->chip.pwm.seen, 0xA5, sizeof vb->chip.pwm.seen);
    memset(vb->chip.adc.seen, 0xA5, sizeof vb->chip.adc.seen);
}

static void set_seed(vb_t *vb, double seed)
{
    vb->chip.adc.seed = seed;
    chip_adc_seed(&vb->chip.adc);
}

static void set_stat_reset(vb_t *vb, double value)
{
    (void)value;
    vb_stat_reset(vb);
}

static void set_isr_reset(vb_t *vb, double value)
{
    (void)value;
    vb->count.isr = (vb_range_t){.last = vb->count.isr.last};
    vb->count.slow = (vb_range_t){.last = vb->count.slow.last};
    vb->count.period = (vb_range_t){.last = vb->count.period.last};
    vb->count.latency = (vb_range_t){.last = vb->count.latency.last};
    vb->count.entry = (vb_range_t){.last = vb->count.entry.last};
}

#define AT(field) offsetof(struct vb, field)
/* a field that can be set, one of whole numbers, a field that can only be read, a computed value, a computed value that can be set, an action */
#define P(name, field, start, min, max, unit, meaning) \
    {{name, unit, meaning, min, max, VB_KEY_READ | VB_KEY_WRITE}, start, AT(field), NULL, NULL}
#define I(name, field, start, min, max, unit, meaning) \
    {{name, unit, meaning, min, max, VB_KEY_READ | VB_KEY_WRITE | VB_KEY_WHOLE}, start, AT(field), NULL, NULL}
#define R(name, field, unit, meaning) {{name, unit, meaning, 0.0, 0.0, VB_KEY_READ}, 0.0, AT(field), NULL, NULL}
#define G(name, function, unit, meaning) {{name, unit, meaning, 0.0, 0.0, VB_KEY_READ}, 0.0, 0, function, NULL}
#define S(name, function, setter, start, min, max, unit, meaning) \
    {{name, unit, meaning, min, max, VB_KEY_READ | VB_KEY_WRITE}, start, 0, function, setter}
#define SF(name, field, setter, start, min, max, unit, meaning) \
    {{name, unit, meaning, min, max, VB_KEY_READ | VB_KEY_WRITE | VB_KEY_WHOLE}, start, AT(field), NULL, setter}
#define SP(name, field, setter, start, min, max, unit, meaning) \
    {{name, unit, meaning, min, max, VB_KEY_READ | VB_KEY_WRITE}, start, AT(field), NULL, setter}
#define W(name, setter, unit, meaning) {{name, unit, meaning, 0.0, 1.0, VB_KEY_WRITE}, 0.0, 0, NULL, setter}

static const key_entry_t table[] = {
    G("time_s", get_time, "s", "board time since creation"),
    /* motor */
    P("motor.rs_ohm", plant.motor.rs_ohm, 2.67, 1e-4, 1000.0, "ohm", "phase resistance at 25 degC"),
    P("motor.ld_h", plant.motor.ld_h, 1.92e-3, 1e-6, 10.0, "H", "d-axis inductance of a phase"),
    P("motor.lq_h", plant.motor.lq_h, 1.92e-3, 1e-6, 10.0, "H", "q-axis inductance of a phase"),
    P("motor.psi_vs", plant.motor.psi_vs, 7.983e-3, 1e-6, 10.0, "V.s", "rotor flux linkage of a phase at 25 degC, per electrical rad/s"),
    I("motor.pole_pairs", plant.motor.pole_pairs, 5.0, 1.0, 100.0, "", "pole pairs"),
    P("motor.sat_ld_ratio", plant.motor.sat_ld_ratio, 0.0, 0.0, 0.95, "", "share of Ld that is lost at motor.sat_current_a, growing with the square of the current"),
    P("motor.sat_lq_ratio", plant.motor.sat_lq_ratio, 0.0, 0.0, 0.95, "", "the same for Lq"),
    P("motor.sat_current_a", plant.motor.sat_current_a, 4.0, 0.01, 1000.0, "A", "current amplitude at which saturation is complete"),
    P("motor.temp_c", plant.motor.temp_c, 25.0, -60.0, 250.0, "degC", "temperature of winding and magnets"),
    P("motor.r_tempco", plant.motor.r_tempco, 0.0039, 0.0, 0.02, "1/K", "relative change of the resistance"),
    P("motor.psi_tempco", plant.motor.psi_tempco, -0.002, -0.02, 0.02, "1/K", "relative change of the flux"),
    /* shaft */
    P("mech.inertia_kgm2", plant.motor.inertia_kgm2, 5.5e-6, 1e-9, 100.0, "kg.m2", "inertia of rotor and load"),
    P("mech.viscous_nms", plant.motor.viscous_nms, 15.3e-6, 0.0, 100.0, "N.m.s", "viscous friction of the motor"),
    P("mech.coulomb_nm", plant.motor.coulomb_nm, 0.004, 0.0, 100.0, "N.m", "dry friction while turning"),
    P("mech.stiction_nm", plant.motor.stiction_nm, 0.0, 0.0, 100.0, "N.m", "break-away torque from standstill; below mech.coulomb_nm that one counts"),
    P("load.constant_nm", plant.motor.load_constant_nm, 0.0, 0.0, 100.0, "N.m", "brake: opposes the rotation, holds at standstill"),
    P("load.active_nm", plant.motor.load_active_nm, 0.0, -100.0, 100.0, "N.m", "torque that the load applies to the shaft, positive drives it forward"),
    P("load.viscous_nms", plant.motor.load_viscous_nms, 0.0, 0.0, 100.0, "N.m.s", "load torque proportional to speed"),
    P("load.quadratic_nms2", plant.motor.load_quadratic_nms2, 0.0, 0.0, 100.0, "N.m.s2", "load torque proportional to the square of the speed"),
    P("load.pulse1_nm", plant.motor.load_pulse[0].nm, 0.0, 0.0, 100.0, "N.m", "amplitude of a load torque by the shaft's angle: nm * sin(order * plant.turns + deg), against the forward direction, at standstill too"),
    I("load.pulse1_order", plant.motor.load_pulse[0].order, 1.0, 1.0, 100.0, "", "its periods in a turn"),
    P("load.pulse1_deg", plant.motor.load_pulse[0].deg, 0.0, -360.0, 360.0, "deg", "its phase where plant.turns is a whole number"),
    P("load.pulse2_nm", plant.motor.load_pulse[1].nm, 0.0, 0.0, 100.0, "N.m", "the same of a second one, added to it"),
    I("load.pulse2_order", plant.motor.load_pulse[1].order, 2.0, 1.0, 100.0, "", "its periods in a turn"),
    P("load.pulse2_deg", plant.motor.load_pulse[1].deg, 0.0, -360.0, 360.0, "deg", "its phase where plant.turns is a whole number"),
    P("load.pulse3_nm", plant.motor.load_pulse[2].nm, 0.0, 0.0, 100.0, "N.m", "the same of a third one"),
    I("load.pulse3_order", plant.motor.load_pulse[2].order, 3.0, 1.0, 100.0, "", "its periods in a turn"),
    P("load.pulse3_deg", plant.motor.load_pulse[2].deg, 0.0, -360.0, 360.0, "deg", "its phase where plant.turns is a whole number"),
    I("load.locked", plant.motor.load_locked, 0.0, 0.0, 1.0, "", "1 = the shaft is blocked"),
    S("state.theta_e_deg", get_theta, set_theta, 0.0, -36000.0, 36000.0, "deg", "electrical angle of the rotor flux against phase A, now"),
    S("state.speed_rpm", get_speed, set_speed, 0.0, -100000.0, 100000.0, "rpm", "mechanical speed, now; positive is the phase order A, B, C"),
    /* supply and bus */
    P("supply.voltage_v", plant.supply.voltage_v, 24.0, 0.0, 100.0, "V", "open-circuit voltage of the supply"),
    P("supply.resistance_ohm", plant.supply.resistance_ohm, 0.1, 1e-3, 1000.0, "ohm", "its inner resistance with the cable"),
    I("supply.sinks", plant.supply.sinks, 0.0, 0.0, 1.0, "", "1 = the supply takes current back, 0 = regeneration raises the bus"),
    R("supply.current_a", plant.supply.supply_a, "A", "supply current, mean of the last period"),
    P("bus.capacitance_f", plant.supply.capacitance_f, 1e-3, 1e-6, 10.0, "F", "bus capacitor"),
    P("bus.load_a", plant.supply.load_a, 0.05, 0.0, 100.0, "A", "what the board itself draws from the bus"),
    P("bus.voltage_v", plant.supply.bus_v, 24.0, 0.0, 200.0, "V", "bus voltage, now"),
    P("bus.brake_ohm", plant.supply.brake_ohm, 0.0, 0.0, 1000.0, "ohm", "brake resistor, 0 = none"),
    R("bus.brake_a", plant.supply.brake_a, "A", "current of the brake resistor, mean of the last period"),
    R("bus.current_a", plant.supply.bus_a, "A", "current from the bus into the bridge, mean of the last period"),
    /* bridge */
    P("inverter.rds_on_ohm", plant.inverter.rds_on_ohm, 0.02, 1e-4, 100.0, "ohm", "on-resistance of a transistor"),
    P("inverter.diode_v", plant.inverter.diode_v, 0.8, 0.0, 5.0, "V", "forward voltage of a diode at no current"),
    P("inverter.diode_ohm", plant.inverter.diode_ohm, 0.02, 0.0, 100.0, "ohm", "series resistance of a diode"),
    P("inverter.turn_on_s", plant.inverter.turn_on_s, 1e-7, 0.0, 2e-6, "s", "delay from a gate signal to conduction"),
    P("inverter.turn_off_s", plant.inverter.turn_off_s, 1.5e-7, 0.0, 2e-6, "s", "delay from a gate signal to the end of conduction"),
    P("inverter.trip_a", plant.inverter.trip_a, 7.0, 0.0, 1000.0, "A", "bus current at which the comparator pulls FLTA1, 0 = no comparator"),
    R("inverter.trip_count", controls.trips, "", "how often it did"),
    I("fault.open_phase", plant.inverter.open_phase, 0.0, 0.0, 3.0, "", "1..3 = the wire of phase A..C is open, 0 = none"),
    I("fault.never_on", plant.inverter.never_on, 0.0, 0.0, 63.0, "mask", "transistors that never turn on, bits as in P1OVDCON (1L, 1H, 2L, 2H, 3L, 3H)"),
    I("fault.never_off", plant.inverter.never_off, 0.0, 0.0, 63.0, "mask", "transistors that never turn off"),
    I("fault.ia_stuck", analogue.current[0].stuck, 0.0, 0.0, 4.0, "", "signal of phase A's current: 1 = stays as it is, 2 = at ground, 3 = at 3.3 V, 4 = in the middle (of a current: zero)"),
    P("fault.ia_gain", analogue.current[0].gain, 1.0, -10.0, 10.0, "", "factor of the reading of phase A's current"),
    P("fault.ia_error_a", analogue.current[0].error, 0.0, -1000.0, 1000.0, "A", "by how much the reading of phase A's current is too high"),
    P("fault.ia_noise_a", analogue.current[0].noise, 0.0, 0.0, 1000.0, "A", "standard deviation of the noise on the reading of phase A's current"),
    I("fault.ib_stuck", analogue.current[1].stuck, 0.0, 0.0, 4.0, "", "signal of phase B's current: 1 = stays as it is, 2 = at ground, 3 = at 3.3 V, 4 = in the middle (of a current: zero)"),
    P("fault.ib_gain", analogue.current[1].gain, 1.0, -10.0, 10.0, "", "factor of the reading of phase B's current"),
    P("fault.ib_error_a", analogue.current[1].error, 0.0, -1000.0, 1000.0, "A", "by how much the reading of phase B's current is too high"),
    P("fault.ib_noise_a", analogue.current[1].noise, 0.0, 0.0, 1000.0, "A", "standard deviation of the noise on the reading of phase B's current"),
    I("fault.vbus_stuck", analogue.bus.stuck, 0.0, 0.0, 4.0, "", "signal of the bus: 1 = stays as it is, 2 = at ground, 3 = at 3.3 V, 4 = in the middle (of a current: zero)"),
    P("fault.vbus_gain", analogue.bus.gain, 1.0, -10.0, 10.0, "", "factor of the reading of the bus"),
    P("fault.vbus_error_v", analogue.bus.error, 0.0, -1000.0, 1000.0, "V", "by how much the reading of the bus is too high"),
    P("fault.vbus_noise_v", analogue.bus.noise, 0.0, 0.0, 1000.0, "V", "standard deviation of the noise on the reading of the bus"),
    I("fault.pot_stuck", analogue.pot.stuck, 0.0, 0.0, 4.0, "", "signal of the potentiometer: 1 = stays as it is, 2 = at ground, 3 = at 3.3 V, 4 = in the middle (of a current: zero)"),
    P("fault.pot_gain", analogue.pot.gain, 1.0, -10.0, 10.0, "", "factor of the reading of the potentiometer"),
    P("fault.pot_error", analogue.pot.error, 0.0, -1000.0, 1000.0, "", "by how much the reading of the potentiometer is too high"),
    P("fault.pot_noise", analogue.pot.noise, 0.0, 0.0, 1000.0, "", "standard deviation of the noise on the reading of the potentiometer"),
    I("fault.motor_ntc_stuck", analogue.motor_ntc.sense.stuck, 0.0, 0.0, 4.0, "", "signal of the motor's NTC: 1 = stays as it is, 2 = at ground, shorted, 3 = at 3.3 V, a broken wire, 4 = in the middle"),
    P("fault.motor_ntc_gain", analogue.motor_ntc.sense.gain, 1.0, -10.0, 10.0, "", "factor of the reading of the motor's NTC"),
    I("fault.bridge_ntc_stuck", analogue.bridge_ntc.sense.stuck, 0.0, 0.0, 4.0, "", "signal of the bridge's NTC: 1 = stays as it is, 2 = at ground, shorted, 3 = at 3.3 V, a broken wire, 4 = in the middle"),
    P("fault.bridge_ntc_gain", analogue.bridge_ntc.sense.gain, 1.0, -10.0, 10.0, "", "factor of the reading of the bridge's NTC"),
    I("wiring.motor", plant.motor.swapped, 0.0, 0.0, 3.0, "", "motor wires that have changed places: 1 = A and B, 2 = B and C, 3 = C and A"),
    I("wiring.pulse", pulse.inverted, 0.0, 0.0, 1.0, "", "1 = the pulses are inverted, as behind an opto-coupler"),
    I("wiring.drivers", plant.inverter.swapped, 0.0, 0.0, 3.0, "", "drivers that have changed places: 1 = A and B, 2 = B and C, 3 = C and A"),
    I("wiring.currents", wiring.currents, 0.0, 0.0, 1.0, "", "1 = the signals of both currents have changed places"),
    I("wiring.flta", wiring.flta, 0.0, 0.0, 2.0, "", "FLTA1: 1 = always high, 2 = of the wrong polarity"),
    I("wiring.buttons", wiring.buttons, 0.0, 0.0, 3.0, "", "1 = S2 and S3 have changed places, 2 = S2 is dead, 3 = S3 is dead"),
    I("wiring.leds", wiring.leds, 0.0, 0.0, 3.0, "", "1 = the LEDs have changed places, 2 = the first one stays dark, 3 = the second one"),
    I("wiring.uart_rp", wiring.uart_rp, 0.0, 0.0, 25.0, "", "RP pin that the serial line is connected to; 0 = whichever sends"),
    P("fault.isr_lost_share", chip.adc.lost_share, 0.0, 0.0, 1.0, "", "share of the control interrupts that never come; 0.1 = every tenth"),
    P("fault.isr_late_share", chip.adc.late_share, 0.0, 0.0, 1.0, "", "share of the control interrupts that come late"),
    P("fault.isr_late_us", chip.adc.late_us, 0.0, 0.0, 1000.0, "us", "by how much these are late"),
    R("fault.isr_lost_count", chip.adc.lost, "", "control interrupts that never came"),
    /* measurement */
    P("shunt.ohm", plant.inverter.shunt_ohm, 0.005, 0.0, 10.0, "ohm", "shunt in the low leg"),
    P("shunt.gain_v_per_a", analogue.gain_v_per_a, 0.375, -100.0, 100.0, "V/A", "by how much the amplifier's output falls per ampere into the motor; negative: it rises"),
    P("shunt.reference_v", analogue.offset_v, 1.65, 0.0, 3.3, "V", "amplifier output at no current"),
    P("shunt.offset_a_v", analogue.shunt_offset_v[0], 0.0, -3.3, 3.3, "V", "error of that for phase A"),
    P("shunt.offset_b_v", analogue.shunt_offset_v[1], 0.0, -3.3, 3.3, "V", "error of that for phase B"),
    P("shunt.settle_s", analogue.settle_s, 1e-6, 0.0, 1e-4, "s", "time after which the amplifier shows the current of a leg that started to conduct"),
    P("adc.noise_lsb", chip.adc.noise_lsb, 0.5, 0.0, 100.0, "LSB", "standard deviation of the noise of a conversion"),
    P("adc.gain_error", chip.adc.gain_error, 0.0, -0.5, 0.5, "", "relative gain error"),
    P("adc.vbus_ratio", analogue.vbus_ratio, 16.0, 1.0, 1000.0, "", "bus divider"),
    G("adc.ia_a", get_ia, "A", "phase A current that the last result stands for"),
    G("adc.ib_a", get_ib, "A", "phase B current that the last result stands for"),
    P("adc.ia_invalid_count", analogue.ia_invalid, 0.0, 0.0, 1e15, "", "samples of phase A whose shunt did not carry the leg's current for shunt.settle_s"),
    P("adc.ib_invalid_count", analogue.ib_invalid, 0.0, 0.0, 1e15, "", "the same for phase B"),
    R("adc.sample_count", chip.adc.samples, "", "triggers that were converted"),
    R("adc.overrun_count", chip.adc.overruns, "", "conversions that ended before the handler of the previous one"),
    G("adc.conversion_us", get_conversion_us, "us", "time from the trigger to the interrupt"),
    /* controls */
    I("input.s2", controls.s2, 0.0, 0.0, 1.0, "", "button S2, 1 = pressed"),
    I("input.s3", controls.s3, 0.0, 0.0, 1.0, "", "button S3, 1 = pressed"),
    P("input.pot", controls.pot, 0.0, 0.0, 1.0, "", "potentiometer, 0 left to 1 right"),
    P("input.pot_live_zero", controls.pot_zero, 0.0, 0.0, 0.4, "", "share of its range that the potentiometer's signal keeps from each rail; a scenario takes the header's POT_LIVE_ZERO"),
    I("input.direction", controls.direction, 0.0, 0.0, 1.0, "", "contact to ground at the direction input, 1 = closed"),
    I("input.flta", controls.flta, 0.0, 0.0, 1.0, "", "1 = an external circuit holds FLTA1 active"),
    /* temperatures */
    R("ntc.motor_c", analogue.motor_ntc.temp_c, "degC", "temperature of the motor's NTC: that of the winding, ntc.motor_lag_s late"),
    P("ntc.motor_lag_s", analogue.motor_ntc.lag_s, 0.0, 0.0, 1000.0, "s", "time constant by which the motor's NTC follows motor.temp_c"),
    P("ntc.bridge_c", analogue.bridge_ntc.temp_c, 25.0, -60.0, 250.0, "degC", "temperature of the bridge and its NTC"),
    P("ntc.motor_ohm", analogue.motor_ntc.ohm, 10000.0, 1.0, 1e7, "ohm", "the motor's NTC at 25 degC; a scenario takes the header's MOTOR_NTC_OHM"),
    P("ntc.motor_beta_k", analogue.motor_ntc.beta_k, 3435.0, 1000.0, 10000.0, "K", "its B; a scenario takes the header's MOTOR_NTC_BETA_K"),
    P("ntc.motor_divider_ohm", analogue.motor_ntc.divider_ohm, 10000.0, 1.0, 1e7, "ohm", "its resistor to 3.3 V; a scenario takes the header's MOTOR_NTC_DIVIDER_OHM"),
    P("ntc.bridge_ohm", analogue.bridge_ntc.ohm, 10000.0, 1.0, 1e7, "ohm", "the bridge's NTC at 25 degC; a scenario takes the header's BRIDGE_NTC_OHM"),
    P("ntc.bridge_beta_k", analogue.bridge_ntc.beta_k, 3435.0, 1000.0, 10000.0, "K", "its B; a scenario takes the header's BRIDGE_NTC_BETA_K"),
    P("ntc.bridge_divider_ohm", analogue.bridge_ntc.divider_ohm, 10000.0, 1.0, 1e7, "ohm", "its resistor to 3.3 V; a scenario takes the header's BRIDGE_NTC_DIVIDER_OHM"),
    P("input.pulse_hz", pulse.hz, 0.0, 0.0, 1e5, "Hz", "pulses at the command input, RB7: their frequency; 0 = nothing is connected, the pin is pulled up"),
    P("input.pulse_us", pulse.us, 1000.0, 0.0, 1e6, "us", "length of a pulse"),
    P("input.pulse_duty", pulse.duty, 0.0, 0.0, 1.0, "", "the same as a share of the period; 0 = input.pulse_us counts"),
    P("input.pulse_jitter_us", pulse.jitter_us, 0.0, 0.0, 1e5, "us", "each pulse is up to so much longer or shorter, evenly spread"),
    I("input.pulse_odd", pulse.odd, 0.0, 0.0, 1e6, "", "so many next pulses are odd; counts down"),
    P("input.pulse_odd_us", pulse.odd_us, 3000.0, 0.0, 1e6, "us", "length of an odd pulse"),
    I("input.pulse_stuck", pulse.stuck, 0.0, 0.0, 2.0, "", "the pulses stay away: 1 = the line is low, 2 = it is high"),
    /* CPU */
    P("cpu.isr_us", chip.adc.hold_us, VB_ISR_US, 0.0, 1000.0, "us", "time from the ADC interrupt to the moment when the handler's writes act, 0.5 of a header with deferred duties; on a target image what exceeds 13 holds the interrupt up"),
    I("cpu.isr_dropped", chip.adc.dropped, 0.0, 0.0, 1.0, "", "1 = the ADC handler is not called any more"),
    I("cpu.background_periods", background_periods, 4.0, 1.0, 1000.0, "", "PWM periods between two passes of the main loop"),
    SP("cpu.crystal_hz", chip.clock.crystal_hz, set_crystal, 8e6, 1e5, 64e6, "Hz", "crystal"),
    P("cpu.lprc_hz", chip.clock.lprc_hz, 32000.0, 16000.0, 128000.0, "Hz", "low-power oscillator, which drives the watchdog of a target image"),
    R("cpu.flash_operations", chip.nvm.operations, "", "pages erased, words and rows programmed by a target image, since the board was made"),
    R("cpu.fcy_hz", chip.clock.fcy_hz, "Hz", "instruction clock"),
    W("cpu.isr_reset", set_isr_reset, "", "any value starts the measurement of the control interrupt anew"),
    R("cpu.isr_cycles", count.isr.last, "cycles", "the last control interrupt, entry to return"),
    R("cpu.latency_cycles", count.latency.last, "cycles", "the last control interrupt's write of the third duty after its trigger"),
    R("cpu.isr_count", count.isr.count, "", "control interrupts measured; 0 = the CPU is the host, which has no cycles"),
    R("cpu.isr_cycles_min", count.isr.min, "cycles", "shortest control interrupt, entry to return"),
    R("cpu.isr_cycles_max", count.isr.max, "cycles", "longest control interrupt"),
    G("cpu.isr_cycles_mean", get_isr_mean, "cycles", "mean control interrupt"),
    R("cpu.slow_cycles", count.slow.last, "cycles", "the last interrupt that the control interrupt has raised for its slow work; 0 = it raised none"),
    R("cpu.slow_cycles_max", count.slow.max, "cycles", "longest interrupt of the slow work"),
    G("cpu.slow_cycles_mean", get_slow_mean, "cycles", "mean interrupt of the slow work"),
    R("cpu.period_cycles_max", count.period.max, "cycles", "longest work of a period: both interrupts"),
    G("cpu.period_cycles_mean", get_period_mean, "cycles", "mean work of a period"),
    R("cpu.latency_cycles_min", count.latency.min, "cycles", "shortest time from the trigger to the write of the third duty"),
    R("cpu.latency_cycles_max", count.latency.max, "cycles", "longest time from the trigger to the write of the third duty"),
    G("cpu.latency_cycles_mean", get_latency_mean, "cycles", "mean time from the trigger to the write of the third duty"),
    R("cpu.entry_cycles_min", count.entry.min, "cycles", "shortest time from the trigger to the moment before the interrupt's entry"),
    R("cpu.entry_cycles_max", count.entry.max, "cycles", "longest time from the trigger to the moment before the interrupt's entry"),
    R("cpu.cycles", count.cycles, "cycles", "instruction cycles since power-up"),
    R("cpu.instructions", count.instructions, "", "instructions since power-up"),
    R("cpu.stack_bytes", count.stack_bytes, "bytes", "deepest stack"),
    R("cpu.resets", count.resets, "", "resets since power-up by watchdog, software or error"),
    R("cpu.errors", count.errors, "", "what the core met that no program should do: see the warnings"),
    R("pil.ticks", count.ticks, "", "control interrupts compared with the host's"),
    R("pil.differences", count.differences, "", "of them those that differed"),
    P("expect.fcy_hz", chip.clock.expected_fcy_hz, 40e6, 0.0, 1e9, "Hz", "instruction clock that is no cause for a warning, 0 = any"),
    P("expect.pwm_hz", chip.expected_pwm_hz, 20e3, 0.0, 1e6, "Hz", "PWM frequency that is no cause for a warning, 0 = any"),
    SF("rng.seed", chip.adc.seed, set_seed, 1.0, 0.0, 9e15, "", "start of the noise sequence"),
    P("sim.max_step_s", plant.inverter.max_step_s, 1.0, 1e-9, 1.0, "s", "upper bound of an integration step; the edges bound it anyway"),
    /* PWM module */
    G("pwm.running", get_running, "", "1 = the time base counts"),
    G("pwm.frequency_hz", get_frequency, "Hz", "PWM frequency, 0 = not running"),
    G("pwm.duty1", get_duty1, "", "duty cycle in force, pair 1, 0..1"),
    G("pwm.duty2", get_duty2, "", "duty cycle in force, pair 2, 0..1"),
    G("pwm.duty3", get_duty3, "", "duty cycle in force, pair 3, 0..1"),
    G("pwm.outputs_on", get_mask, "mask", "outputs that are on now, bits as in P1OVDCON (1L, 1H, 2L, 2H, 3L, 3H)"),
    G("pwm.outputs_seen", get_seen_mask, "mask", "outputs that were on at any time of the last complete period"),
    G("pwm.dead_time_us", get_dead_us, "us", "dead time before a high transistor turns on"),
    G("pwm.trigger_us", get_trigger_us, "us", "special event trigger after the start of the period, -1 = none in this period"),
    G("pwm.fault_active", get_fault_active, "", "1 = the fault input holds the outputs"),
    G("pwm.fault_pin", get_fault_pin, "", "1 = the fault input is active"),
    G("led.alive", get_led_alive, "", "1 = the first LED is on"),
    G("led.run", get_led_run, "", "1 = the second LED is on"),
    G("output.fault_relay", get_fault_relay, "", "1 = the fault output's relay is held; 0 = it has dropped: a fault, a chip in reset, or an output that is not used"),
    G("output.running_relay", get_running_relay, "", "1 = the running output's relay is on"),
    G("output.brake", get_brake, "", "1 = the brake resistor is switched on"),
    R("uart.baud", chip.uart.baud, "1/s", "UART1 baud rate of the last character, 0 = none yet"),
    R("uart.lost_count", chip.uart.lost, "", "characters lost by a full buffer"),
    /* plant at the last sampling instant */
    R("plant.time_s", latch.time_s, "s", "sampling instant"),
    R("plant.i_a", latch.i_a, "A", "phase current into the motor"),
    R("plant.i_b", latch.i_b, "A", "phase current into the motor"),
    R("plant.i_c", latch.i_c, "A", "phase current into the motor"),
    R("plant.i_d", latch.i_d, "A", "true d current"),
    R("plant.i_q", latch.i_q, "A", "true q current"),
    R("plant.i_d_mean", latch.i_d_mean, "A", "true d current, mean of the period before"),
    R("plant.i_q_mean", latch.i_q_mean, "A", "true q current, mean of the period before"),
    R("plant.theta_e_deg", latch.theta_e_deg, "deg", "electrical angle of the rotor, 0..360"),
    R("plant.speed_rpm", latch.speed_rpm, "rpm", "mechanical speed"),
    R("plant.turns", latch.turns, "rev", "mechanical revolutions since creation"),
    R("plant.torque_nm", latch.torque_nm, "N.m", "electromagnetic torque"),
    R("plant.torque_mean_nm", latch.torque_mean_nm, "N.m", "electromagnetic torque, mean of the period before"),
    R("plant.v_d", latch.v_d, "V", "d voltage at the terminals, mean of the period before"),
    R("plant.v_q", latch.v_q, "V", "q voltage at the terminals, mean of the period before"),
    /* statistics since the last reset */
    W("stat.reset", set_stat_reset, "", "any value starts the statistics anew"),
    R("stat.periods", stat.periods, "", "periods in the statistics"),
    R("stat.bus_max_v", stat.bus_max_v, "V", "highest bus voltage"),
    R("stat.bus_min_v", stat.bus_min_v, "V", "lowest bus voltage"),
    R("stat.i_peak_a", stat.i_peak_a, "A", "largest phase current at the end of a period"),
    G("stat.i_rms_a", get_i_rms, "A", "RMS of a phase current, mean of the three"),
    G("stat.v_rms_v", get_v_rms, "V", "RMS over time of the voltage vector's amplitude"),
    G("stat.speed_mean_rpm", get_speed_mean, "rpm", "mean speed"),
    R("stat.speed_min_rpm", stat.speed_min_rpm, "rpm", "lowest speed"),
    R("stat.speed_max_rpm", stat.speed_max_rpm, "rpm", "highest speed"),
    G("stat.torque_mean_nm", get_torque_mean, "N.m", "mean electromagnetic torque"),
    R("stat.energy_supply_j", stat.energy_supply_j, "J", "energy from the supply"),
    R("stat.energy_bus_j", stat.energy_bus_j, "J", "energy from the bus into the bridge"),
    R("stat.energy_brake_j", stat.energy_brake_j, "J", "heat in the brake resistor"),
    R("stat.energy_copper_j", stat.energy_copper_j, "J", "heat in the windings"),
    R("stat.energy_shaft_j", stat.energy_shaft_j, "J", "mechanical energy from the magnetic field, friction included"),
};

enum { KEYS = (int)(sizeof table / sizeof table[0]) };

void vb_keys_defaults(vb_t *vb)
{
    for (unsigned k = 0; k < KEYS; k++) {
        if (table[k].set != NULL && (table[k].info.flags & VB_KEY_READ) != 0) {
            table[k].set(vb, table[k].start);
        } else if ((table[k].info.flags & VB_KEY_WRITE) != 0 && table[k].set == NULL) {
            *(double *)((char *)vb + table[k].offset) = table[k].start;
        }
    }
}

static const key_entry_t *find_key(const char *name)
{
    for (unsigned k = 0; k < KEYS; k++) {
        if (strcmp(table[k].info.name, name) == 0) {
            return &table[k];
        }
    }
    return NULL;
}

/* "pin.RC6": bits 0..3 of the code are the bit, the bits above the port. Ports A, B and C have these pins on the device. */
static const uint16_t pins_of_port[3] = {0x079F, 0xFFFF, 0x03FF};

static bool find_pin(const char *name, unsigned *pin)
{
    char port = '\0';
    unsigned bit = 0;
    int used = 0;
    if (sscanf(name, "pin.R%c%2u%n", &port, &bit, &used) != 2 || name[used] != '\0' || port < 'A' || port > 'C' || bit > 15
        || ((pins_of_port[port - 'A'] >> bit) & 1u) == 0) {
        return false;
    }
    *pin = ((unsigned)(port - 'A') << 4) | bit;
    return true;
}

static const char *probe_key_name(unsigned n, char *text)
{
    const char *name = probe_signals[n].name;
    (void)snprintf(text, NAME_SIZE, "%s%s", strncmp(name, "fw.", 3) == 0 ? "" : "fw.", name);
    return text;
}

static int find_probe(const char *name)
{
    char text[NAME_SIZE];
    for (unsigned n = 0; n < probe_signal_count; n++) {
        if (strcmp(probe_key_name(n, text), name) == 0) {
            return (int)n;
        }
    }
    return -1;
}

/* How to reach the readable quantity called `name`. */
int vb_keys_find(vb_t *vb, const char *name, vb_access_t *access)
{
    memset(access, 0, sizeof *access);
    const key_entry_t *key = find_key(name);
    if (key != NULL) {
        if ((key->info.flags & VB_KEY_READ) == 0) {
            return vb_fail(vb, "%s: can only be set", name);
        }
        access->kind = key->get != NULL ? KIND_GET : KIND_FIELD;
        access->get = key->get;
        access->offset = key->offset;
        return 0;
    }
    if (strncmp(name, "reg.", 4) == 0) {
        access->kind = KIND_REG;
        access->reg = vb->chip.cpu.reg(vb->chip.cpu.context, name + 4);
        return access->reg != NULL ? 0 : vb_fail(vb, "%s: the device has no register %s", name, name + 4);
    }
    if (find_pin(name, &access->pin)) {
        access->kind = KIND_PIN;
        return 0;
    }
    int probe = find_probe(name);
    if (probe >= 0 && vb->signals == NULL) {
        return vb_fail(vb, "%s: the image has no names, run its ELF file", name);
    }
    if (probe >= 0) {
        access->kind = KIND_PROBE;
        access->probe = vb->signals[probe].read;
        return 0;
    }
    return vb_fail(vb, "%s: unknown key", name);
}

double vb_keys_read(const vb_t *vb, const vb_access_t *access)
{
    switch (access->kind) {
    case KIND_GET: return access->get(vb);
    case KIND_PROBE: return access->probe();
    case KIND_REG: return (double)*access->reg;
    case KIND_PIN: return (double)chip_ports_pin(&vb->chip, access->pin >> 4, access->pin & 15u);
    default: return *(const double *)((const char *)vb + access->offset);
    }
}

int vb_get(vb_t *vb, const char *key, double *value)
{
    vb_access_t access;
    if (vb_keys_find(vb, key, &access) != 0) {
        return -1;
    }
    *value = vb_keys_read(vb, &access);
    return 0;
}

static int set_register(vb_t *vb, const char *key, double value)
{
    vb_access_t access;
    if (vb_keys_find(vb, key, &access) != 0) {
        return -1;
    }
    if (!(value >= 0.0 && value <= 65535.0)) {
        return vb_fail(vb, "%s: %g is outside 0..65535", key, value);
    }
    *access.reg = (uint16_t)value;
    return 0;
}

int vb_set(vb_t *vb, const char *key, double value)
{
    if (strncmp(key, "reg.", 4) == 0) {
        return set_register(vb, key, value);
    }
    const key_entry_t *entry = find_key(key);
    if (entry == NULL) {
        unsigned pin = 0;
        bool known = find_pin(key, &pin) || find_probe(key) >= 0;
        return vb_fail(vb, known ? "%s: can only be read" : "%s: unknown key", key);
    }
    if ((entry->info.flags & VB_KEY_WRITE) == 0) {
        return vb_fail(vb, "%s: can only be read", key);
    }
    if (!(value >= entry->info.min && value <= entry->info.max)) {
        return vb_fail(vb, "%s: %g is outside %g..%g %s", key, value, entry->info.min, entry->info.max, entry->info.unit);
    }
    if ((entry->info.flags & VB_KEY_WHOLE) != 0 && value != floor(value)) {
        return vb_fail(vb, "%s: %g is not a whole number", key, value);
    }
    if (entry->set != NULL) {
        entry->set(vb, value);
    } else {
        *(double *)((char *)vb + entry->offset) = value;
    }
    vb->plant.motor.derived_stale = true;
    return 0;
}

/* Keys that are not in the table: pins and the firmware's signals. Filled at the first call. */
const vb_key_t *vb_key_info(unsigned i)
{
    static vb_key_t more[PINS + PROBES];
    static char name[PINS + PROBES][NAME_SIZE];
    static unsigned count;
    if (i < KEYS) {
        return &table[i].info;
    }
    if (count == 0) {
        for (unsigned pin = 0; pin < 48; pin++) {
            if (((pins_of_port[pin >> 4] >> (pin & 15u)) & 1u) != 0) {
                (void)snprintf(name[count], NAME_SIZE, "pin.R%c%u", 'A' + (int)(pin >> 4), pin & 15u);
                more[count] = (vb_key_t){name[count], "", "level of the pin", 0.0, 0.0, VB_KEY_READ};
                count++;
            }
        }
        for (unsigned n = 0; n < probe_signal_count && n < PROBES; n++) {
            more[count] = (vb_key_t){probe_key_name(n, name[count]), probe_signals[n].unit, probe_signals[n].meaning, 0.0, 0.0, VB_KEY_READ};
            count++;
        }
    }
    return i - KEYS < count ? &more[i - KEYS] : NULL;
}

int vb_param(unsigned i, const char **name, double *value, const char **unit)
{
    if (i >= probe_param_count) {
        return -1;
    }
    *name = probe_params[i].name;
    *value = probe_params[i].value;
    *unit = probe_params[i].unit;
    return 0;
}

const char *vb_fault_name(int code)
{
    return probe_fault_name(code);
}

const char *vb_state_name(int state)
{
    return probe_state_name(state);
}
