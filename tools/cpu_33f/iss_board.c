/* The virtual board's CPU as the instruction-set simulator with the chip's peripherals; time, registers and interrupts between both. */
#include "iss_board_state.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drive/param_scaling.h"

enum {
    ADC1_VECTOR = 21, /* (0x2E - 4) / 2 */
    T2_VECTOR = 15,   /* raised by software: the slow work of a period */
    T2_FLAG = 1 << CHIP_IRQ_T2,
    IUE = 0x0004,
    START_PERIODS = 3600,    /* "PWM periods" of 50 us that the start-up with its PLL may take */
    COUNTER_IN_TIME = 0x81F4 /* counting down: what a handler would see that does not look */
};

#define USUAL_ISR_US 13.0 /* of cpu.isr_us: the handler itself */

/* ---- time ---- */

static double time_of(const iss_board_t *b, uint64_t cycle)
{
    return b->base_s + (double)(int64_t)(cycle - b->base_cycle) / b->fcy_hz;
}

static uint64_t cycle_of(const iss_board_t *b, double time_s)
{
    double cycles = (time_s - b->base_s) * b->fcy_hz;
    return b->base_cycle + (uint64_t)(int64_t)llround(cycles);
}

static uint64_t now_cycle(const iss_board_t *b)
{
    return iss_cycles(b->cpu.iss);
}

/* ---- what the chip and the core tell ---- */

static uint16_t counter_now(const iss_board_t *b)
{
    const chip_t *chip = b->cpu.chip;
    if (!chip->pwm.running) {
        return CHIP_REG(chip, P1TMR);
    }
    double now_s = time_of(b, now_cycle(b)) + 1e-3 / b->fcy_hz;
    return chip_pwm_counter(chip, now_s >= chip->pwm.period_s ? now_s - chip->pwm.period_s : now_s);
}

static uint16_t core_counter(iss_cpu_t *cpu)
{
    iss_board_t *b = (iss_board_t *)cpu;
    uint16_t counter = counter_now(b);
    if (b->in_handler) {
        b->counter_seen = counter;
    }
    return counter;
}

static void measured(vb_range_t *range, uint64_t cycles)
{
    range->last = (double)cycles;
    range->min = range->count == 0.0 ? range->last : plant_min(range->min, range->last);
    range->max = plant_max(range->max, range->last);
    range->sum += range->last;
    range->count += 1.0;
}

/* The board has to look at what was written when its plant has come to the core's present time. */
static void core_written(iss_cpu_t *cpu, uint16_t address)
{
    iss_board_t *b = (iss_board_t *)cpu;
    bool duty = address == SFR_P1DC1 || address == SFR_P1DC2 || address == SFR_P1DC3;
    if (address == SFR_P1DC3 && b->in_handler) {
        measured(&vb_counts(b->vb)->latency, now_cycle(b) - b->trigger_cycle);
    }
    if (!duty || (CHIP_REG(cpu->chip, PWM1CON2) & IUE) != 0) {
        b->written = true;
        iss_cpu_break(cpu);
    }
}

static void clock_changed(void *context)
{
    iss_board_t *b = context;
    b->clock_changed = true;
    iss_cpu_break(&b->cpu);
}

static void core_reset(iss_cpu_t *cpu)
{
    ((iss_board_t *)cpu)->was_reset = true;
}

static void enter_interrupt(void *context, unsigned vector, uint64_t cycle)
{
    iss_board_t *b = context;
    if (vector == T2_VECTOR) {
        b->slow_cycle = cycle;
    }
    if (vector != ADC1_VECTOR) {
        return;
    }
    b->in_handler = true;
    b->counter_seen = COUNTER_IN_TIME;
    b->entry_cycle = cycle;
    measured(&vb_counts(b->vb)->entry, cycle - b->trigger_cycle);
    iss_shadow_tick(b);
}

/* What the control interrupt has done goes into the trace. With deferred duties its slow work ends behind the next sample, and is in the next row. */
static void row_is_due(iss_board_t *b)
{
    b->handled = true;
    iss_cpu_break(&b->cpu);
}

/* The work of a period is done. */
static void period_done(iss_board_t *b)
{
    measured(&vb_counts(b->vb)->period, (uint64_t)(vb_counts(b->vb)->isr.last + vb_counts(b->vb)->slow.last));
    iss_shadow_compare(b);
    if (!DEFER_DUTIES) {
        row_is_due(b);
    }
}

static bool slow_is_raised(const iss_board_t *b)
{
    const chip_t *chip = b->cpu.chip;
    return ((unsigned)CHIP_REG(chip, IFS0) & CHIP_REG(chip, IEC0) & T2_FLAG) != 0;
}

static void leave_interrupt(void *context, unsigned vector, uint64_t cycle)
{
    iss_board_t *b = context;
    if (vector == ADC1_VECTOR && b->in_handler) {
        b->in_handler = false;
        measured(&vb_counts(b->vb)->isr, cycle - b->entry_cycle);
        if (DEFER_DUTIES) {
            row_is_due(b);
        } else {
            vb_counts(b->vb)->slow.last = 0.0;
        }
        b->slow_to_come = slow_is_raised(b);
        if (!b->slow_to_come) {
            period_done(b);
        }
    } else if (vector == T2_VECTOR && b->slow_to_come) {
        b->slow_to_come = false;
        measured(&vb_counts(b->vb)->slow, cycle - b->slow_cycle);
        period_done(b);
    } else {
        /* another one */
    }
}

/* The core met something that no program should do. It goes on as the chip would. */
static void core_report(void *context, iss_error_t kind, uint32_t pc, const char *text)
{
    iss_board_t *b = context;
    (void)kind;
    (void)pc;
    if (b->vb != NULL) {
        vb_counts(b->vb)->errors += 1.0;
        vb_warn(b->vb, "%s", text);
    }
}

/* ---- what the board asks of its processor ---- */

static void start_time(iss_board_t *b)
{
    b->fcy_hz = b->cpu.chip->clock.fcy_hz;
    b->base_s = 0.0;
    b->base_cycle = now_cycle(b);
    b->pending_s = PLANT_NEVER;
    b->clock_changed = false;
    b->was_reset = false;
    b->written = false;
    b->handled = false;
    b->in_handler = false;
    b->slow_to_come = false;
}

/* Persistent variables hold anything after power-on; here always the same, so that runs can be repeated. */
static void fill_persistent(iss_board_t *b)
{
    iss_t *iss = b->cpu.iss;
    for (size_t n = 0; n < b->image.symbol_count; n++) {
        const iss_symbol_t *s = &b->image.symbols[n];
        for (uint32_t byte = 0; s->persistent && byte < s->size; byte++) {
            uint16_t address = (uint16_t)(s->address + byte);
            uint8_t *memory = (uint8_t *)iss_data(iss);
            memory[address] = (uint8_t)((address * 0x9E3779B1u) >> 24);
            iss_ram_known(iss, address, 1, true);
        }
    }
}

static int live_reset(void *context)
{
    iss_board_t *b = context;
    iss_cpu_reset(&b->cpu, CHIP_RESET_POR);
    fill_persistent(b);
    memset(vb_counts(b->vb), 0, sizeof *vb_counts(b->vb));
    start_time(b);
    b->start_cycle = now_cycle(b);
    b->shadow.ticks = 0;
    b->shadow.differences = 0;
    b->shadow.starting = 0;
    b->shadow.first[0] = '\0';
    iss_probe_restart(true);
    iss_shadow_reset(b);
    return 0;
}

static double live_run(void *context, double until_s)
{
    iss_board_t *b = context;
    if (b->pending_s < PLANT_NEVER) {
        return plant_min(until_s, b->pending_s);
    }
    uint64_t until = cycle_of(b, until_s);
    if (now_cycle(b) >= until) {
        return until_s;
    }
    if (iss_cpu_run(&b->cpu, until) == ISS_STOP_REQUEST) {
        b->pending_s = plant_max(plant_min(time_of(b, now_cycle(b)), until_s), b->cpu.chip->plant->now_s);
        return b->pending_s;
    }
    return until_s; /* errors do not stop */
}

/* A conversion is over; from its trigger the latency counts. */
static bool live_raised(void *context, unsigned irq)
{
    iss_board_t *b = context;
    if (irq == CHIP_IRQ_ADC1) {
        b->trigger_cycle = cycle_of(b, vb_sampled_at(b->vb));
    }
    return b->core_raised(context, irq);
}

/* The chip runs on another clock from now on. */
static void follow_clock(iss_board_t *b)
{
    uint64_t cycle = now_cycle(b);
    b->base_s = time_of(b, cycle);
    b->base_cycle = cycle;
    b->fcy_hz = b->cpu.chip->clock.fcy_hz;
}

static void follow_registers(iss_board_t *b)
{
    chip_t *chip = b->cpu.chip;
    if (chip_pwm_enabled(chip) != chip->pwm.running) {
        chip_pwm_cut(chip); /* the time base starts or stops here */
    } else {
        chip_pwm_written(chip);
    }
}

static void follow_reset(iss_board_t *b)
{
    chip_t *chip = b->cpu.chip;
    vb_counts(b->vb)->resets += 1.0;
    b->in_handler = false;
    b->slow_to_come = false;
    chip->adc.due_s = PLANT_NEVER;
    chip->pwm.running = false;
    chip_pwm_cut(chip);
    iss_probe_restart(false);
    iss_shadow_reset(b);
}

static void live_follow(void *context)
{
    iss_board_t *b = context;
    if (b->pending_s > b->cpu.chip->plant->now_s) {
        return;
    }
    b->pending_s = PLANT_NEVER;
    if (b->clock_changed) {
        b->clock_changed = false;
        follow_clock(b);
    }
    if (b->written) {
        b->written = false;
        follow_registers(b);
    }
    if (b->was_reset) {
        b->was_reset = false;
        follow_reset(b);
    }
    if (b->handled) {
        b->handled = false;
        vb_served(b->vb);
    }
}

static void live_end(void *context, double length_s)
{
    iss_board_t *b = context;
    vb_counts_t *c = vb_counts(b->vb);
    uint64_t end = cycle_of(b, length_s);
    b->base_s = time_of(b, end) - length_s; /* the rest that rounding to a cycle leaves */
    b->base_cycle = end;
    c->cycles = (double)(now_cycle(b) - b->start_cycle);
    c->instructions = (double)iss_instructions(b->cpu.iss);
    c->stack_bytes = (double)iss_stack_bytes(b->cpu.iss);
}

static void live_destroy(void *context)
{
    iss_board_t *b = context;
    iss_probe_place(&(iss_places_t){0});
    iss_cpu_destroy(&b->cpu);
    iss_image_free(&b->image);
    free(b);
}

/* ---- creation ---- */

static int failed(char *error, size_t size, const char *text)
{
    (void)snprintf(error, size, "%s", text);
    return -1;
}

/* Where a variable is in the target's RAM, 0 if it is not there. A size of 0 is not known: the linker gives none to an object with a
 * start value. */
static int find_variable(const iss_board_t *b, const char *name, size_t bytes, uint16_t *address, char *error, size_t size)
{
    const iss_symbol_t *s = iss_image_find(&b->image, name);
    *address = s != NULL && s->address < 0x8000u ? (uint16_t)s->address : (uint16_t)0;
    if (*address == 0 || s->size == 0 || s->size == bytes) {
        return 0;
    }
    (void)snprintf(error, size, "the image was built from other sources or settings than the simulator (%s has %lu bytes, not %zu)", name,
                   (unsigned long)s->size, bytes);
    return -1;
}

/* The target's objects must have the layout that the host expects. Without names there are no signals. */
static int find_signals(iss_board_t *b, char *error, size_t size)
{
    iss_places_t p = {.data = (uint8_t *)iss_data(b->cpu.iss)};
    const struct { const char *name; size_t bytes; uint16_t *address; } row[] = {
        {"board_drive", iss_probe_drive_bytes(), &p.drive}, {"board_params", iss_probe_params_bytes(), &p.params},
#ifdef SNAPSHOT
        {"board_snapshot", 20, &p.snapshot}, {"SnapStart", 2, &p.snap_start}, {"SnapDone", 2, &p.snap_done},
        {"SnapBuf1", 2 * DATA_BUFFER_SIZE, &p.snap_buf[0]}, {"SnapBuf2", 2 * DATA_BUFFER_SIZE, &p.snap_buf[1]},
        {"SnapBuf3", 2 * DATA_BUFFER_SIZE, &p.snap_buf[2]}, {"SnapBuf4", 2 * DATA_BUFFER_SIZE, &p.snap_buf[3]},
#endif
    };
    for (size_t n = 0; n < sizeof row / sizeof row[0]; n++) {
        if (find_variable(b, row[n].name, row[n].bytes, row[n].address, error, size) != 0) {
            size_t length = strlen(error);
            (void)snprintf(error + length, size - length, ": build both with the same DEFINES and USERPARAMS");
            return -1;
        }
    }
    if (p.drive != 0) {
        iss_probe_place(&p);
        b->signals = true;
    }
    return 0;
}

static int build(iss_board_t *b, const char *image, char *error, size_t size)
{
    chip_cpu_t cpu = {.own_isr_us = USUAL_ISR_US, .start_periods = START_PERIODS, .reset = live_reset, .run = live_run,
                      .follow = live_follow, .end = live_end, .destroy = live_destroy};
    if (iss_image_parse(&b->image, image) != 0) {
        return failed(error, size, "the image's text is damaged, vb_create_iss: make it by tools/image/load.py");
    }
    if (!iss_cpu_create(&b->cpu, &b->image, &cpu)) {
        return failed(error, size, "no memory for the simulator, vb_create_iss: free some");
    }
    b->core_raised = cpu.raised;
    cpu.raised = live_raised;
    cpu.clock = clock_changed;
    iss_on_interrupt(b->cpu.iss, enter_interrupt, leave_interrupt, b);
    iss_on_report(b->cpu.iss, core_report, b);
    iss_on_symbol(b->cpu.iss, iss_image_name, &b->image);
    iss_stop_on(b->cpu.iss, 0);
    if (find_signals(b, error, size) != 0) {
        return -1;
    }
    b->vb = vb_create_with_cpu(&cpu);
    return b->vb != NULL ? 0 : failed(error, size, "no memory for the board, vb_create_iss: free some");
}

vb_t *vb_create_iss(const char *image, char *error, size_t size)
{
    iss_board_t *b = calloc(1, sizeof *b);
    if (b == NULL) {
        (void)failed(error, size, "no memory for the board, vb_create_iss: free some");
        return NULL;
    }
    if (build(b, image, error, size) != 0) {
        live_destroy(b);
        return NULL;
    }
    iss_cpu_connect(&b->cpu, vb_chip(b->vb), &b->image);
    b->cpu.written = core_written;
    b->cpu.counter = core_counter;
    b->cpu.was_reset = core_reset;
    b->shadow.on = true;
    vb_use_signals(b->vb, b->signals ? iss_probe_signals : NULL);
    start_time(b);
    return b->vb;
}

/* ---- access ---- */

static iss_board_t *board_of(vb_t *vb)
{
    return vb_chip(vb)->cpu.context;
}

iss_t *vb_iss_core(vb_t *vb)
{
    return board_of(vb)->cpu.iss;
}

int vb_iss_has_names(vb_t *vb)
{
    return board_of(vb)->signals ? 1 : 0;
}

const char *vb_iss_difference(vb_t *vb)
{
    return board_of(vb)->shadow.first;
}

void vb_iss_lock_step(vb_t *vb, int on)
{
    board_of(vb)->shadow.on = on != 0;
}

int vb_iss_peek(vb_t *vb, unsigned address)
{
    return iss_data(board_of(vb)->cpu.iss)[(address & 0xFFFFu) / 2u];
}

/* Where a variable's elements are in data memory; NULL with a text if it is not there. */
static uint16_t *variable(vb_t *vb, const char *name, unsigned count)
{
    iss_board_t *b = board_of(vb);
    const iss_symbol_t *s = iss_image_find(&b->image, name);
    bool fits = s != NULL && (s->address & 1u) == 0 && s->address + 2u * (size_t)count <= 0x8000u && (s->size == 0 || 2u * (size_t)count <= s->size);
    if (!fits) {
        (void)vb_fail(vb, "the image has no variable '%s' of %u elements", name, count);
        return NULL;
    }
    return iss_data(b->cpu.iss) + s->address / 2u;
}

int vb_iss_read(vb_t *vb, const char *name, int16_t *values, unsigned count)
{
    const uint16_t *place = variable(vb, name, count);
    if (place == NULL) {
        return -1;
    }
    memcpy(values, place, count * sizeof *values);
    return 0;
}

int vb_iss_write(vb_t *vb, const char *name, const int16_t *values, unsigned count)
{
    uint16_t *place = variable(vb, name, count);
    if (place == NULL) {
        return -1;
    }
    memcpy(place, values, count * sizeof *values);
    const iss_symbol_t *s = iss_image_find(&board_of(vb)->image, name);
    iss_ram_known(board_of(vb)->cpu.iss, (uint16_t)s->address, 2u * count, true);
    return 0;
}

int vb_iss_param_get(vb_t *vb, const char *name, double *value)
{
    (void)vb;
    return iss_probe_param_get(name, value);
}

int vb_iss_param_set(vb_t *vb, const char *name, double value)
{
    int result = iss_probe_param_set(name, value);
    if (result == 0 && board_of(vb)->shadow.on) {
        (void)probe_param_set(name, value);
    }
    return result;
}
