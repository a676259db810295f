/* The board as a whole: creation, power-up, and one PWM period after the other. */
#include "chip_pwm_edges.h"
#include "vb_state.h"

#include <stdlib.h>
#include <string.h>

vb_t *vb_create_with_cpu(const chip_cpu_t *cpu)
{
    vb_t *vb = calloc(1, sizeof *vb);
    if (vb == NULL) {
        return NULL;
    }
    chip_board_t board = vb_circuit;
    board.context = vb;
    if (!chip_connect(&vb->chip, cpu, &board, &vb->plant)) {
        free(vb);
        return NULL;
    }
    vb->signals = probe_signals;
    vb->serial.master = vb->serial.slave = -1;
    vb->plant.motor.c = 1.0;
    vb_keys_defaults(vb);
    vb->plant.motor.derived_stale = true;
    plant_motor_prepare(&vb->plant.motor);
    plant_inverter_reset(&vb->plant);
    vb_stat_reset(vb);
    return vb;
}

void vb_destroy(vb_t *vb)
{
    if (vb != NULL) {
        vb_trace_free(vb);
        vb_serial_close(vb);
        vb->chip.cpu.destroy(vb->chip.cpu.context);
        free(vb);
    }
}

chip_t *vb_chip(vb_t *vb)
{
    return &vb->chip;
}

vb_counts_t *vb_counts(vb_t *vb)
{
    return &vb->count;
}

void vb_use_signals(vb_t *vb, const probe_signal_t *signals)
{
    vb->signals = signals;
}

double vb_background_periods(const vb_t *vb)
{
    return vb->background_periods;
}

double vb_sampled_at(const vb_t *vb)
{
    return vb->latch.time_s - vb->plant.start_s;
}

int vb_power_up(vb_t *vb)
{
    vb->serial.rx_count = 0;
    if (vb->chip.cpu.reset(vb->chip.cpu.context) != 0) {
        return vb_fail(vb, "power-up: the CPU could not be reset");
    }
    plant_motor_prepare(&vb->plant.motor);
    memset(&vb->chip.fault, 0, sizeof vb->chip.fault);
    vb->controls.comparator = false;
    vb->controls.trips = 0.0;
    vb->pulse.runs = false;
    plant_inverter_reset(&vb->plant);
    vb->plant.motor.torque_nm = 0.0; /* of currents that are gone */
    vb->plant.supply.bus_v = vb->plant.supply.voltage_v;
    vb->analogue.motor_ntc.temp_c = vb->plant.motor.temp_c;
    chip_pwm_reset(&vb->chip);
    chip_adc_reset(&vb->chip);
    chip_ports_show(&vb->chip);
    vb->trace.due = false;
    vb->awaits_handler = false;
    vb->powered = true;
    return 0;
}

/* The next instant at which something happens; a processor with a time of its own goes there first and may find a nearer one. */
static double next_instant(vb_t *vb, double planned_s)
{
    const chip_cpu_t *cpu = &vb->chip.cpu;
    double next_s = plant_min(planned_s, vb->chip.pwm.length_s);
    return cpu->run != NULL && next_s > vb->plant.now_s ? cpu->run(cpu->context, next_s) : next_s;
}

static void look_at_fault(vb_t *vb, bool period_start)
{
    vb_circuit_comparator(vb, period_start);
    chip_pwm_fault(&vb->chip, period_start);
}

/* Everything within one period: edges, trigger, handler, fault, each at its instant. */
static void run_events(vb_t *vb)
{
    chip_t *chip = &vb->chip;
    plant_t *plant = &vb->plant;
    double trigger_s = chip_adc_next_trigger(chip, -1.0);
    double half_s = chip->pwm.running && chip->pwm.double_update ? 0.5 * chip->pwm.length_s : PLANT_NEVER;
    for (;;) {
        double next_s = next_instant(vb, plant_min(plant_min(chip_pwm_next_edge(chip), trigger_s), plant_min(chip->adc.due_s, half_s)));
        double trip_a = plant->inverter.trip_a > 0.0 && !vb->controls.comparator ? plant->inverter.trip_a : PLANT_NEVER;
        if (next_s > plant->now_s && !plant_inverter_run(plant, next_s, trip_a)) {
            look_at_fault(vb, false);
            continue;
        }
        if (chip->cpu.follow != NULL) {
            chip->cpu.follow(chip->cpu.context);
        }
        if (plant->now_s >= chip->pwm.length_s) {
            return;
        }
        chip_pwm_apply_edges(chip);
        if (half_s <= plant->now_s) {
            half_s = PLANT_NEVER;
            chip_pwm_half(chip);
        }
        if (trigger_s <= plant->now_s) {
            chip_adc_trigger(chip);
            trigger_s = chip_adc_next_trigger(chip, plant->now_s);
        }
        if (chip->adc.due_s <= plant->now_s) {
            chip_adc_done(chip);
        }
    }
}

/* The periodic row of a period in which no handler was due. */
static void trace_without_handler(vb_t *vb, bool sampled)
{
    if (vb->chip.adc.due_s < PLANT_NEVER || (sampled && vb->awaits_handler)) {
        return;
    }
    if (!sampled) {
        vb_latch(vb);
    }
    vb_served(vb);
}

static void run_period(vb_t *vb)
{
    chip_t *chip = &vb->chip;
    plant_t *plant = &vb->plant;
    plant->now_s = 0.0;
    chip_ports_show(chip);
    plant_inverter_prepare(plant);
    look_at_fault(vb, true);
    chip_pwm_begin(chip);
    chip_adc_begin(chip);
    plant_motor_prepare(&plant->motor);
    if (chip->cpu.begin != NULL) {
        chip->cpu.begin(chip->cpu.context);
    }
    double samples = chip->adc.samples;
    run_events(vb);
    double period_s = chip->pwm.length_s;
    trace_without_handler(vb, chip->adc.samples != samples);
    chip->cpu.end(chip->cpu.context, period_s);
    chip_end(chip);
    vb->stat.energy_bus_j += plant->inverter.bus_as * plant->supply.bus_v;
    plant->supply.brake_on = vb_circuit_switch(vb, VB_BRAKE);
    plant_supply_step(&plant->supply, plant->inverter.bus_as, period_s);
    plant->inverter.bus_as = 0.0;
    vb->stat.energy_shaft_j += plant->motor.torque_nms * plant->motor.omega / plant->motor.pole_pairs;
    plant_motor_mechanics(&plant->motor, period_s);
    vb_circuit_warm(vb, period_s);
    vb_stat_collect(vb, period_s);
    plant->start_s += period_s;
    plant->now_s = 0.0;
}

int vb_run(vb_t *vb, uint32_t pwm_periods)
{
    if (!vb->powered) {
        return vb_fail(vb, "run: the board is off, call vb_power_up() first");
    }
    for (uint32_t n = 0; n < pwm_periods; n++) {
        run_period(vb);
    }
    return 0;
}
