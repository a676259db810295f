/* The board as a whole: creation, power-up, and one PWM period after the other. */
#include "vb_internal.h"
#include "vb_motor_step.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int vb_fail(vb_t *vb, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    (void)vsnprintf(vb->error, sizeof vb->error, format, args);
    va_end(args);
    return -1;
}

/* Two texts from one place that name the same register are one problem. */
void vb_warn(vb_t *vb, const char *format, ...)
{
    char text[VB_TEXT];
    va_list args;
    va_start(args, format);
    (void)vsnprintf(text, sizeof text, format, args);
    va_end(args);
    size_t name = strcspn(text, ":") + 1;
    for (unsigned n = 0; n < vb->warnings; n++) {
        if (vb->warning_format[n] == format && strncmp(vb->warning[n], text, name) == 0) {
            return;
        }
    }
    if (vb->warnings < VB_WARNINGS) {
        memcpy(vb->warning[vb->warnings], text, sizeof text);
        vb->warning_format[vb->warnings] = format;
        vb->warnings++;
    }
}

unsigned vb_warning_count(const vb_t *vb)
{
    return vb->warnings;
}

const char *vb_warning(const vb_t *vb, unsigned i)
{
    return i < vb->warnings ? vb->warning[i] : NULL;
}

const char *vb_error(const vb_t *vb)
{
    return vb->error;
}

static bool connect_registers(vb_t *vb)
{
    static const struct { size_t offset; const char *name; } row[] = {
#define VB_REG_ROW(field, name) {offsetof(vb_regs_t, field), name},
        VB_REG_LIST(VB_REG_ROW)
#undef VB_REG_ROW
    };
    for (size_t n = 0; n < sizeof row / sizeof row[0]; n++) {
        volatile uint16_t *place = vb->cpu.reg(vb->cpu.context, row[n].name);
        if (place == NULL) {
            return false;
        }
        memcpy((char *)&vb->reg + row[n].offset, &place, sizeof place);
    }
    return true;
}

vb_t *vb_create_with_cpu(const vb_cpu_t *cpu)
{
    vb_t *vb = calloc(1, sizeof *vb);
    if (vb == NULL) {
        return NULL;
    }
    vb->cpu = *cpu;
    vb->signals = probe_signals;
    if (!connect_registers(vb)) {
        free(vb);
        return NULL;
    }
    vb->motor.c = 1.0;
    vb_keys_defaults(vb);
    vb->motor.derived_stale = true;
    vb_motor_prepare(&vb->motor);
    vb_inverter_reset(vb);
    vb_stat_reset(vb);
    return vb;
}

vb_t *vb_create(void)
{
    return vb_create_with_cpu(&vb_host_cpu);
}

void vb_destroy(vb_t *vb)
{
    if (vb != NULL) {
        vb_trace_free(vb);
        if (vb->live != NULL) {
            vb->live->destroy(vb->cpu.context);
        }
        free(vb);
    }
}

int vb_power_up(vb_t *vb)
{
    if (vb->cpu.reset(vb->cpu.context) != 0) {
        return vb_fail(vb, "power-up: the CPU could not be reset");
    }
    vb_motor_prepare(&vb->motor);
    memset(&vb->fault, 0, sizeof vb->fault);
    vb_inverter_reset(vb);
    vb->motor.torque_nm = 0.0; /* of currents that are gone */
    vb->supply.bus_v = vb->supply.voltage_v;
    vb_pwm_reset(vb);
    vb_adc_reset(vb);
    vb_io_reset(vb);
    vb->background_countdown = 0.0;
    vb->stuck_in_isr = false;
    vb->trace.due = false;
    vb->powered = true;
    return 0;
}

/* The plant at the sampling instant. */
void vb_latch(vb_t *vb)
{
    const vb_motor_t *m = &vb->motor;
    vb_latch_t *l = &vb->latch;
    l->time_s = vb->start_s + vb->now_s;
    l->i_a = vb->inverter.i[0];
    l->i_b = vb->inverter.i[1];
    l->i_c = vb->inverter.i[2];
    l->i_d = m->id;
    l->i_q = m->iq;
    l->theta_e_deg = vb_wrap((m->theta + m->omega * vb->now_s) * (180.0 / VB_PI), 360.0);
    l->speed_rpm = m->omega / m->pole_pairs * VB_RPM_PER_RAD_S;
    l->torque_nm = vb_motor_torque(m);
    l->turns = m->turns + m->omega * vb->now_s / (2.0 * VB_PI * m->pole_pairs);
    l->v_d = m->vd_v;
    l->v_q = m->vq_v;
    vb->trace.due = true;
}

void vb_stat_reset(vb_t *vb)
{
    memset(&vb->stat, 0, sizeof vb->stat);
    vb->stat.bus_max_v = vb->supply.bus_v;
    vb->stat.bus_min_v = vb->supply.bus_v;
    vb->stat.speed_max_rpm = vb->motor.omega / vb->motor.pole_pairs * VB_RPM_PER_RAD_S;
    vb->stat.speed_min_rpm = vb->stat.speed_max_rpm;
}

static void collect_statistics(vb_t *vb, double h_s)
{
    vb_stat_t *t = &vb->stat;
    const vb_motor_t *m = &vb->motor;
    double rpm = m->omega / m->pole_pairs * VB_RPM_PER_RAD_S;
    double amplitude2 = m->id * m->id + m->iq * m->iq;
    t->periods += 1.0;
    t->bus_max_v = vb_max(t->bus_max_v, vb->supply.bus_v);
    t->bus_min_v = vb_min(t->bus_min_v, vb->supply.bus_v);
    t->speed_max_rpm = vb_max(t->speed_max_rpm, rpm);
    t->speed_min_rpm = vb_min(t->speed_min_rpm, rpm);
    t->speed_sum += rpm;
    t->i2_sum += 0.5 * amplitude2;
    t->v2_sum += m->vd_v * m->vd_v + m->vq_v * m->vq_v;
    t->torque_sum += m->torque_nm;
    t->energy_supply_j += vb->supply.supply_a * vb->supply.bus_v * h_s;
    t->energy_copper_j += m->copper_w * h_s;
    for (unsigned k = 0; k < 3; k++) {
        t->i_peak_a = vb_max(t->i_peak_a, fabs(vb->inverter.i[k]));
    }
}

/* Transistors change at their planned edges. */
static void apply_edges(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    for (unsigned k = 0; k < 3; k++) {
        vb_leg_t *leg = &pwm->leg[k];
        while (leg->next < leg->count && leg->edge_s[leg->next] <= vb->now_s) {
            vb_inverter_gate(vb, k, (vb_gate_t)leg->edge_gate[leg->next]);
            leg->next++;
        }
    }
    pwm->seen_mask = (uint8_t)(pwm->seen_mask | vb_pwm_mask(vb));
}

static double next_edge(const vb_pwm_t *pwm)
{
    double first = VB_NEVER;
    for (unsigned k = 0; k < 3; k++) {
        const vb_leg_t *leg = &pwm->leg[k];
        if (leg->next < leg->count && leg->edge_s[leg->next] < first) {
            first = leg->edge_s[leg->next];
        }
    }
    return first;
}

void vb_cut_period(vb_t *vb)
{
    vb->pwm.length_s = vb->now_s;
}

/* The next instant at which something happens; a CPU with a time of its own goes there first and may find a nearer one. */
static double next_instant(vb_t *vb, double planned_s)
{
    double next_s = vb_min(planned_s, vb->pwm.length_s);
    return vb->live != NULL && next_s > vb->now_s ? vb->live->run(vb->cpu.context, next_s) : next_s;
}

/* Everything within one period: edges, trigger, handler, fault, each at its instant. */
static void run_events(vb_t *vb)
{
    double trigger_s = vb_adc_next_trigger(vb, -1.0);
    double half_s = vb->pwm.running && vb->pwm.double_update ? 0.5 * vb->pwm.length_s : VB_NEVER;
    for (;;) {
        double next_s = next_instant(vb, vb_min(vb_min(next_edge(&vb->pwm), trigger_s), vb_min(vb->adc.handler_s, half_s)));
        double trip_a = vb->inverter.trip_a > 0.0 && !vb->fault.comparator ? vb->inverter.trip_a : VB_NEVER;
        if (next_s > vb->now_s && !vb_inverter_run(vb, next_s, trip_a)) {
            vb_fault_check(vb, false);
            continue;
        }
        if (vb->live != NULL) {
            vb->live->follow(vb->cpu.context);
        }
        if (vb->now_s >= vb->pwm.length_s) {
            return;
        }
        apply_edges(vb);
        if (half_s <= vb->now_s) {
            half_s = VB_NEVER;
            vb_pwm_half(vb);
        }
        if (trigger_s <= vb->now_s) {
            vb_adc_trigger(vb);
            trigger_s = vb_adc_next_trigger(vb, vb->now_s);
        }
        if (vb->adc.handler_s <= vb->now_s) {
            vb_adc_handler(vb);
        }
    }
}

static void main_loop_pass(vb_t *vb, double period_s)
{
    if (vb->live != NULL) {
        return;
    }
    vb->background_countdown -= 1.0;
    if (vb->background_countdown > 0.0) {
        return;
    }
    vb->background_countdown = vb->background_periods;
    vb_background(vb);
    vb_io_uart_step(vb, period_s * vb->background_periods);
}

/* The periodic row of a period in which no handler was due. */
static void trace_without_handler(vb_t *vb, bool sampled)
{
    if (vb->adc.handler_s < VB_NEVER || (sampled && vb->live != NULL)) {
        return;
    }
    if (!sampled) {
        vb_latch(vb);
    }
    if (vb->trace.due) {
        vb_trace_row(vb);
    }
}

static void run_period(vb_t *vb)
{
    vb->now_s = 0.0;
    vb_io_ports(vb);
    vb_inverter_prepare(vb);
    vb_pwm_begin(vb);
    vb_adc_decode(vb);
    vb_motor_prepare(&vb->motor);
    if (vb->live == NULL) {
        vb_serve_pending(vb);
    }
    double samples = vb->adc.samples;
    run_events(vb);
    double period_s = vb->pwm.length_s;
    trace_without_handler(vb, vb->adc.samples != samples);
    main_loop_pass(vb, period_s);
    if (vb->live != NULL) {
        vb_adc_check(vb);
        vb->live->end(vb->cpu.context, period_s);
    } else {
        vb_io_timers(vb, period_s);
    }
    vb_pwm_end(vb);
    vb_adc_end(vb);
    vb->stat.energy_bus_j += vb->inverter.bus_as * vb->supply.bus_v;
    vb_supply_step(&vb->supply, vb->inverter.bus_as, period_s);
    vb->inverter.bus_as = 0.0;
    vb->stat.energy_shaft_j += vb->motor.torque_nms * vb->motor.omega / vb->motor.pole_pairs;
    vb_motor_mechanics(&vb->motor, period_s);
    collect_statistics(vb, period_s);
    vb->start_s += period_s;
    vb->now_s = 0.0;
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
