/* What the MCLV board has between chip and plant: buttons, potentiometer, comparator, current amplifiers, bus divider, and the wiring. */
#include "vb_state.h"

#include <math.h>

#define REFERENCE_V 3.3
#define ZERO_C_K 273.15

enum { FLTA_RP = 8, PULSE_RP = 7, LED_PORT = 2, LED_BIT = 6, LEDS = 2 }; /* FLTA1 is on RB8, the pulses on RB7, the LEDs on RC6 and RC7 */
/* The direction input is RA4, CN0; the outputs of a product are on port A, each with a pull-down before its switch. */
enum { DIRECTION_BIT = 4, DIRECTION_CN = 0 };
static const unsigned switch_bit[] = { [VB_FAULT_RELAY] = 7, [VB_RUNNING_RELAY] = 10, [VB_BRAKE] = 9 };
enum { MOTOR_NTC_AN = 6, BRIDGE_NTC_AN = 7 };
enum { FLTA_DEAD = 1, FLTA_INVERTED = 2, SWAPPED = 1, FIRST_DEAD = 2 };

/* Is the button S2 (0) or S3 (1) pressed, as its pin sees it? */
static bool button(const vb_t *vb, unsigned number)
{
    const vb_wiring_t *w = &vb->wiring;
    unsigned pressed = w->buttons == SWAPPED ? 1u - number : number;
    return (pressed == 0 ? vb->controls.s2 : vb->controls.s3) != 0.0 && w->buttons != FIRST_DEAD + (double)number;
}

static bool fault_is_low(const vb_t *vb)
{
    bool fault = vb->controls.flta != 0.0 || vb->controls.comparator;
    return vb->wiring.flta == FLTA_INVERTED ? !fault : fault && vb->wiring.flta != FLTA_DEAD;
}

/* Does the first (0) or the second LED (1) light? */
double vb_circuit_led(const vb_t *vb, unsigned led)
{
    unsigned pin = LED_BIT + (vb->wiring.leds == SWAPPED ? LEDS - 1u - led : led);
    bool output = (CHIP_REG(&vb->chip, TRISC) >> pin & 1u) == 0;
    return output && vb->wiring.leds != FIRST_DEAD + (double)led ? (double)chip_ports_pin(&vb->chip, LED_PORT, pin) : 0.0;
}

bool vb_circuit_switch(const vb_t *vb, unsigned number)
{
    unsigned driven_high = CHIP_REG(&vb->chip, LATA) & ~(unsigned)CHIP_REG(&vb->chip, TRISA);
    return (driven_high >> switch_bit[number] & 1u) != 0;
}

/* A contact to ground on a pin that nothing but the chip pulls up: without its pull-up the pin falls. */
static bool direction_is_low(const vb_t *vb)
{
    return vb->controls.direction != 0.0 || (CHIP_REG(&vb->chip, CNPU1) >> DIRECTION_CN & 1u) == 0;
}

/* Levels that the circuits give to the pins when these are inputs; everything else is pulled up. */
static void levels(void *context, uint16_t level[3])
{
    const vb_t *vb = context;
    level[0] = (uint16_t)(0x079Fu & ~(button(vb, 0) ? 1u << 8 : 0u) & ~(direction_is_low(vb) ? 1u << DIRECTION_BIT : 0u));
    level[1] = (uint16_t)(0xFFFFu & ~(button(vb, 1) ? 1u << 4 : 0u) & ~(fault_is_low(vb) ? 1u << FLTA_RP : 0u) & ~(vb_pulse_pin(vb) ? 0u : 1u << PULSE_RP));
    level[2] = 0x03FFu;
}

/* Follow the over-current comparator, which stays active to the end of the period. */
void vb_circuit_comparator(vb_t *vb, bool period_start)
{
    vb_controls_t *c = &vb->controls;
    double limit_a = vb->plant.inverter.trip_a;
    bool over = limit_a > 0.0 && plant_inverter_bus_a(&vb->plant) > limit_a;
    if (over && !c->comparator) {
        c->trips += 1.0;
    }
    c->comparator = over || (c->comparator && !period_start);
}

/* Current that the shunt of leg 0 (A) or 1 (B) shows at this instant. It needs settle_s after a change of the leg's path; until then the
 * amplifier is on its way. `valid` tells whether the sample is the true current. */
static double shunt_current(const vb_t *vb, unsigned leg, bool *valid)
{
    const plant_inverter_t *inv = &vb->plant.inverter;
    double age_s = vb->plant.start_s + vb->plant.now_s - inv->low_since_s[leg];
    double part = vb->analogue.settle_s > 0.0 ? plant_min(1.0, age_s / vb->analogue.settle_s) : 1.0;
    if (!inv->low_path[leg]) {
        part = 1.0 - part;
    }
    double i = inv->i[leg];
    *valid = part >= 1.0 || inv->cond[leg] == PLANT_COND_FLOAT;
    return part * i;
}

/* Voltage at the pin for a quantity that gives `volts` per unit from `zero_v` on, after all that may be wrong on the way. */
static double sensed(vb_t *vb, vb_sense_t *sense, double quantity, double volts, double zero_v)
{
    double shown = sense->gain * quantity + sense->error + (sense->noise > 0.0 ? sense->noise * chip_adc_noise(&vb->chip.adc) : 0.0);
    const double stuck_v[VB_SENSES] = {zero_v + volts * shown, sense->last_v, 0.0, REFERENCE_V, 0.5 * REFERENCE_V};
    sense->last_v = stuck_v[(unsigned)sense->stuck];
    return sense->last_v;
}

static double current_voltage(vb_t *vb, unsigned leg)
{
    bool valid = false;
    double i = shunt_current(vb, leg, &valid);
    if (!valid) {
        *(leg == 0 ? &vb->analogue.ia_invalid : &vb->analogue.ib_invalid) += 1.0;
    }
    double zero_v = vb->analogue.offset_v + vb->analogue.shunt_offset_v[leg];
    return sensed(vb, &vb->analogue.current[leg], i, -vb->analogue.gain_v_per_a, zero_v);
}

/* The thermistor to ground, its resistor to the reference. */
static double ntc_voltage(vb_t *vb, vb_ntc_t *ntc)
{
    double ohm = ntc->ohm * exp(ntc->beta_k * (1.0 / (ntc->temp_c + ZERO_C_K) - 1.0 / (25.0 + ZERO_C_K)));
    return sensed(vb, &ntc->sense, ohm / (ohm + ntc->divider_ohm), REFERENCE_V, 0.0);
}

/* The motor's thermistor follows the winding. */
void vb_circuit_warm(vb_t *vb, double period_s)
{
    vb_ntc_t *ntc = &vb->analogue.motor_ntc;
    double winding_c = vb->plant.motor.temp_c;
    ntc->temp_c += (winding_c - ntc->temp_c) * (ntc->lag_s > period_s ? period_s / ntc->lag_s : 1.0);
}

/* Voltage at the analogue input AN<input>. */
static double input_voltage(void *context, unsigned input)
{
    vb_t *vb = context;
    switch (input) {
    case 0:
    case 1: return current_voltage(vb, vb->wiring.currents != 0.0 ? 1u - input : input);
    case 2: return sensed(vb, &vb->analogue.bus, vb->plant.supply.bus_v, 1.0 / vb->analogue.vbus_ratio, 0.0);
    case 3:
    case 4:
    case 5: return vb->plant.inverter.v[input - 3] / vb->analogue.vbus_ratio;
    case MOTOR_NTC_AN: return ntc_voltage(vb, &vb->analogue.motor_ntc);
    case BRIDGE_NTC_AN: return ntc_voltage(vb, &vb->analogue.bridge_ntc);
    case 8: return sensed(vb, &vb->analogue.pot, vb->controls.pot_zero + vb->controls.pot * (1.0 - 2.0 * vb->controls.pot_zero), REFERENCE_V, 0.0);
    default: return 0.0;
    }
}

static void sampled(void *context)
{
    vb_latch(context);
}

static void warn(void *context, const char *format, va_list args)
{
    vb_warn_list(context, format, args);
}

const chip_board_t vb_circuit = {
    .levels = levels, .input_v = input_voltage, .sampled = sampled, .served = vb_served, .signals = vb_pulse_signals, .send = vb_serial_send,
    .receive = vb_serial_receive, .warn = warn,
    .fault_rp = FLTA_RP, .capture_rp = PULSE_RP,
    .channel = {{8, "the potentiometer", 1u << MOTOR_NTC_AN | 1u << BRIDGE_NTC_AN}, {0, "IA", 0}, {1, "IB", 0}, {2, "VBUS", 0}},
};
