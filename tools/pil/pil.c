/* The virtual board's CPU as the instruction-set simulator with the chip's peripherals; time, registers and interrupts between both. */
#include "pil_internal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drive/param_scaling.h"

enum {
    ADC1_VECTOR = 21, /* (0x2E - 4) / 2 */
    PTEN = 0x8000,
    PWM1MD = 0x0200,
    IUE = 0x0004,
    COUNTER_IN_TIME = 0x81F4 /* counting down: what a handler would see that does not look */
};

/* ---- time ---- */

static double time_of(const pil_t *pil, uint64_t cycle)
{
    return pil->base_s + (double)(int64_t)(cycle - pil->base_cycle) / pil->fcy_hz;
}

static uint64_t cycle_of(const pil_t *pil, double time_s)
{
    double cycles = (time_s - pil->base_s) * pil->fcy_hz;
    return pil->base_cycle + (uint64_t)(int64_t)llround(cycles);
}

static uint64_t now_cycle(const pil_t *pil)
{
    return iss_cycles(soc_core(pil->soc));
}

/* The board has to look at something when its plant has come to the core's present time. */
static void ask_board(pil_t *pil)
{
    soc_break(pil->soc);
}

/* ---- what the chip tells the board ---- */

static uint16_t chip_pins(void *context, unsigned port)
{
    const pil_t *pil = context;
    uint16_t level[3];
    vb_io_external_levels(pil->vb, level);
    return level[port];
}

static uint16_t counter_now(const pil_t *pil)
{
    const vb_t *vb = pil->vb;
    if (!vb->pwm.running) {
        return *vb->reg.p1tmr;
    }
    double now_s = time_of(pil, now_cycle(pil)) + 1e-3 / pil->fcy_hz;
    return vb_pwm_counter(vb, now_s >= vb->pwm.period_s ? now_s - vb->pwm.period_s : now_s);
}

static uint16_t chip_counter(void *context)
{
    pil_t *pil = context;
    uint16_t counter = counter_now(pil);
    if (pil->in_handler) {
        pil->counter_seen = counter;
    }
    return counter;
}

static void count_range(double value, double *min, double *max, double *sum, double *count)
{
    *min = *count == 0.0 ? value : vb_min(*min, value);
    *max = vb_max(*max, value);
    *sum += value;
    *count += 1.0;
}

static void duty_written(pil_t *pil)
{
    vb_counts_t *c = &pil->vb->count;
    if (pil->in_handler) {
        c->latency_last = (double)(now_cycle(pil) - pil->trigger_cycle);
        count_range(c->latency_last, &c->latency_min, &c->latency_max, &c->latency_sum, &c->latency_count);
    }
}

static void chip_written(void *context, uint16_t address)
{
    pil_t *pil = context;
    bool duty = address == SFR_P1DC1 || address == SFR_P1DC2 || address == SFR_P1DC3;
    if (address == SFR_P1DC3) {
        duty_written(pil);
    }
    if (!duty || (*pil->vb->reg.pwm1con2 & IUE) != 0) {
        pil->written = true;
        ask_board(pil);
    }
}

static void chip_send(void *context, uint8_t character)
{
    pil_t *pil = context;
    vb_uart_t *u = &pil->vb->uart;
    unsigned divider = (*pil->vb->reg.u1mode & 8u) != 0 ? 4u : 16u;
    u->baud = pil->fcy_hz / ((double)divider * ((double)*pil->vb->reg.u1brg + 1.0));
    if (u->tx_count < VB_UART_TX) {
        u->tx[u->tx_count++] = (char)character;
    } else {
        u->lost += 1.0;
    }
    if (pil->terminal != NULL) {
        soc_pty_send(pil->terminal, character);
    }
}

static int chip_receive(void *context)
{
    pil_t *pil = context;
    vb_uart_t *u = &pil->vb->uart;
    if (u->rx_count > 0) {
        uint8_t character = (uint8_t)u->rx[u->rx_head];
        u->rx_head = (u->rx_head + 1u) % VB_UART_RX;
        u->rx_count--;
        return character;
    }
    return pil->terminal != NULL ? soc_pty_receive(pil->terminal) : -1;
}

static void chip_clock(void *context)
{
    pil_t *pil = context;
    pil->clock_changed = true;
    ask_board(pil);
}

static void chip_reset(void *context)
{
    pil_t *pil = context;
    pil->was_reset = true;
}

static void chip_note(void *context, const char *text)
{
    pil_t *pil = context;
    vb_warn(pil->vb, "%s", text);
}

static void enter_interrupt(void *context, unsigned vector, uint64_t cycle)
{
    pil_t *pil = context;
    if (vector != ADC1_VECTOR) {
        return;
    }
    pil->in_handler = true;
    pil->counter_seen = COUNTER_IN_TIME;
    pil->entry_cycle = cycle;
    pil_shadow_tick(pil);
}

static void leave_interrupt(void *context, unsigned vector, uint64_t cycle)
{
    pil_t *pil = context;
    vb_counts_t *c = &pil->vb->count;
    if (vector != ADC1_VECTOR || !pil->in_handler) {
        return;
    }
    pil->in_handler = false;
    c->isr_last = (double)(cycle - pil->entry_cycle);
    count_range(c->isr_last, &c->isr_min, &c->isr_max, &c->isr_sum, &c->isr_count);
    pil_shadow_compare(pil);
    pil->handled = true;
    ask_board(pil);
}

/* The core met something that no program should do. It goes on as the chip would. */
static void core_report(void *context, iss_error_t kind, uint32_t pc, const char *text)
{
    pil_t *pil = context;
    (void)kind;
    (void)pc;
    if (pil->vb != NULL) {
        pil->vb->count.errors += 1.0;
        vb_warn(pil->vb, "%s", text);
    }
}

static const char *core_symbol(void *context, bool data, uint32_t address, uint32_t *offset)
{
    const pil_t *pil = context;
    const image_symbol_t *s = image_symbol_at(&pil->image, data ? IMAGE_DATA : IMAGE_CODE, address);
    if (s == NULL) {
        return NULL;
    }
    *offset = address - s->address;
    return s->name;
}

/* ---- what the board asks of its CPU ---- */

static volatile uint16_t *cpu_reg(void *context, const char *name)
{
    pil_t *pil = context;
    int address = soc_register(name);
    return address < 0 ? NULL : (volatile uint16_t *)&iss_data(soc_core(pil->soc))[address / 2];
}

static int cpu_interrupt(void *context, vb_vector_t vector)
{
    (void)context;
    (void)vector;
    return 1;
}

static void cpu_background(void *context)
{
    (void)context;
}

static void start_time(pil_t *pil)
{
    pil->fcy_hz = soc_fcy_hz(pil->soc);
    pil->base_s = 0.0;
    pil->base_cycle = now_cycle(pil);
    pil->pending_s = VB_NEVER;
    pil->clock_changed = false;
    pil->was_reset = false;
    pil->written = false;
    pil->handled = false;
    pil->in_handler = false;
}

/* Persistent variables hold anything after power-on; here always the same, so that runs can be repeated. */
static void fill_persistent(pil_t *pil)
{
    iss_t *iss = soc_core(pil->soc);
    for (size_t n = 0; n < pil->image.symbol_count; n++) {
        const image_symbol_t *s = &pil->image.symbols[n];
        for (uint32_t byte = 0; s->persistent && byte < s->size; byte++) {
            uint16_t address = (uint16_t)(s->address + byte);
            uint8_t *memory = (uint8_t *)iss_data(iss);
            memory[address] = (uint8_t)((address * 0x9E3779B1u) >> 24);
            iss_ram_known(iss, address, 1, true);
        }
    }
}

static int cpu_reset(void *context)
{
    pil_t *pil = context;
    soc_times(pil->soc)->crystal_hz = pil->vb->crystal_hz;
    soc_reset(pil->soc, ISS_RESET_POR);
    fill_persistent(pil);
    memset(&pil->vb->count, 0, sizeof pil->vb->count);
    start_time(pil);
    pil->start_cycle = now_cycle(pil);
    pil->shadow.ticks = 0;
    pil->shadow.differences = 0;
    pil->shadow.first[0] = '\0';
    pil_target_restart(true);
    pil_shadow_reset(pil);
    return 0;
}

static double live_run(void *context, double until_s)
{
    pil_t *pil = context;
    if (pil->pending_s < VB_NEVER) {
        return vb_min(until_s, pil->pending_s);
    }
    uint64_t until = cycle_of(pil, until_s);
    if (now_cycle(pil) >= until) {
        return until_s;
    }
    if (soc_run(pil->soc, until) == ISS_STOP_REQUEST) {
        pil->pending_s = vb_max(vb_min(time_of(pil, now_cycle(pil)), until_s), pil->vb->now_s);
        return pil->pending_s;
    }
    return until_s; /* a breakpoint is the caller's of soc_run(); errors do not stop */
}

static void live_raised(void *context, vb_vector_t vector)
{
    pil_t *pil = context;
    const vb_t *vb = pil->vb;
    if (vector == VB_VECTOR_ADC1) {
        pil->trigger_cycle = cycle_of(pil, vb->latch.time_s - vb->start_s);
    }
    iss_irq_changed(soc_core(pil->soc));
}

/* The chip runs on another clock from now on. */
static void follow_clock(pil_t *pil)
{
    uint64_t cycle = now_cycle(pil);
    pil->base_s = time_of(pil, cycle);
    pil->base_cycle = cycle;
    pil->fcy_hz = soc_fcy_hz(pil->soc);
}

static void follow_registers(pil_t *pil)
{
    vb_t *vb = pil->vb;
    bool run = (*vb->reg.p1tcon & PTEN) != 0 && (*vb->reg.pmd1 & PWM1MD) == 0;
    if (run != vb->pwm.running) {
        vb_cut_period(vb); /* the time base starts or stops here */
    } else {
        vb_pwm_registers_changed(vb);
    }
}

static void follow_reset(pil_t *pil)
{
    vb_t *vb = pil->vb;
    vb->count.resets += 1.0;
    pil->in_handler = false;
    vb->adc.handler_s = VB_NEVER;
    vb->pwm.running = false;
    vb_cut_period(vb);
    pil_target_restart(false);
    pil_shadow_reset(pil);
}

static void live_follow(void *context)
{
    pil_t *pil = context;
    vb_t *vb = pil->vb;
    if (pil->pending_s > vb->now_s) {
        return;
    }
    pil->pending_s = VB_NEVER;
    if (pil->clock_changed) {
        pil->clock_changed = false;
        follow_clock(pil);
    }
    if (pil->written) {
        pil->written = false;
        follow_registers(pil);
    }
    if (pil->was_reset) {
        pil->was_reset = false;
        follow_reset(pil);
    }
    if (pil->handled) {
        pil->handled = false;
        if (vb->trace.due) {
            vb_trace_row(vb);
        }
    }
}

static void live_end(void *context, double length_s)
{
    pil_t *pil = context;
    vb_counts_t *c = &pil->vb->count;
    uint64_t end = cycle_of(pil, length_s);
    pil->base_s = time_of(pil, end) - length_s; /* the rest that rounding to a cycle leaves */
    pil->base_cycle = end;
    c->cycles = (double)(now_cycle(pil) - pil->start_cycle);
    c->instructions = (double)iss_instructions(soc_core(pil->soc));
    c->stack_bytes = (double)iss_stack_bytes(soc_core(pil->soc));
    soc_uart_wake(pil->soc);
}

static void live_destroy(void *context)
{
    pil_t *pil = context;
    pil_target_place(&(pil_places_t){0});
    soc_pty_close(pil->terminal);
    soc_destroy(pil->soc);
    image_free(&pil->image);
    free(pil);
}

static const vb_live_t live = {live_run, live_raised, live_follow, live_end, live_destroy};

/* ---- creation ---- */

static int failed(char *error, size_t size, const char *text)
{
    (void)snprintf(error, size, "%s", text);
    return -1;
}

/* Where a variable is in the target's RAM, 0 if it is not there. A size of 0 is not known: the linker gives none to an object with a
 * start value. */
static int find_variable(const pil_t *pil, const char *name, size_t bytes, uint16_t *address, char *error, size_t size)
{
    const image_symbol_t *s = image_find(&pil->image, IMAGE_DATA, name);
    *address = s != NULL && s->address < 0x8000u ? (uint16_t)s->address : (uint16_t)0;
    if (*address == 0 || s->size == 0 || s->size == bytes) {
        return 0;
    }
    (void)snprintf(error, size, "the image was built from other sources or settings than the simulator (%s has %lu bytes, not %zu)", name,
                   (unsigned long)s->size, bytes);
    return -1;
}

/* The target's objects must have the layout that the host expects. Without names there are no signals. */
static int find_signals(pil_t *pil, const char *path, char *error, size_t size)
{
    pil_places_t p = {.data = (uint8_t *)iss_data(soc_core(pil->soc))};
    const struct { const char *name; size_t bytes; uint16_t *address; } row[] = {
        {"board_drive", pil_target_drive_bytes(), &p.drive}, {"board_params", pil_target_params_bytes(), &p.params},
#ifdef SNAPSHOT
        {"board_snapshot", 20, &p.snapshot}, {"SnapStart", 2, &p.snap_start}, {"SnapDone", 2, &p.snap_done},
        {"SnapBuf1", 2 * DATA_BUFFER_SIZE, &p.snap_buf[0]}, {"SnapBuf2", 2 * DATA_BUFFER_SIZE, &p.snap_buf[1]},
        {"SnapBuf3", 2 * DATA_BUFFER_SIZE, &p.snap_buf[2]}, {"SnapBuf4", 2 * DATA_BUFFER_SIZE, &p.snap_buf[3]},
#endif
    };
    for (size_t n = 0; n < sizeof row / sizeof row[0]; n++) {
        if (find_variable(pil, row[n].name, row[n].bytes, row[n].address, error, size) != 0) {
            size_t length = strlen(error);
            (void)snprintf(error + length, size - length, ", %s: build both with the same DEFINES and USERPARAMS", path);
            return -1;
        }
    }
    if (p.drive != 0) {
        pil_target_place(&p);
        pil->signals = true;
    }
    return 0;
}

/* A HEX file has no names; an ELF file of the same name and the same contents lends it its own. */
static void borrow_names(image_t *image, const char *path)
{
    char sibling[1024];
    size_t length = strlen(path);
    if (image->symbol_count != 0 || length < 5 || length >= sizeof sibling || strcmp(path + length - 4, ".hex") != 0) {
        return;
    }
    memcpy(sibling, path, length - 4);
    memcpy(sibling + length - 4, ".elf", 5);
    image_t *elf = calloc(1, sizeof *elf);
    if (elf == NULL) {
        return;
    }
    bool same = image_load(elf, sibling) == 0 && memcmp(elf->program, image->program, sizeof elf->program) == 0
                && memcmp(elf->config, image->config, sizeof elf->config) == 0;
    if (same) {
        image->symbols = elf->symbols;
        image->symbol_count = elf->symbol_count;
        image->names = elf->names;
    } else {
        image_free(elf);
    }
    free(elf);
}

static int build(pil_t *pil, const char *path, char *error, size_t size)
{
    const soc_board_t board = {pil, chip_pins, chip_counter, chip_written, chip_send, chip_receive, chip_clock, chip_reset, chip_note};
    const vb_cpu_t cpu = {pil, cpu_reg, cpu_reset, cpu_interrupt, cpu_background};
    if (image_load(&pil->image, path) != 0) {
        return failed(error, size, pil->image.error);
    }
    borrow_names(&pil->image, path);
    pil->soc = soc_create(&pil->image, &board);
    if (pil->soc == NULL) {
        return failed(error, size, "no memory for the simulator, vb_create_iss: free some");
    }
    iss_on_interrupt(soc_core(pil->soc), enter_interrupt, leave_interrupt, pil);
    iss_on_report(soc_core(pil->soc), core_report, pil);
    iss_on_symbol(soc_core(pil->soc), core_symbol, pil);
    iss_stop_on(soc_core(pil->soc), 0);
    if (find_signals(pil, path, error, size) != 0) {
        return -1;
    }
    pil->vb = vb_create_with_cpu(&cpu);
    return pil->vb != NULL ? 0 : failed(error, size, "no memory for the board, vb_create_iss: free some");
}

vb_t *vb_create_iss(const char *path, char *error, size_t size)
{
    pil_t *pil = calloc(1, sizeof *pil);
    if (pil == NULL) {
        (void)failed(error, size, "no memory for the board, vb_create_iss: free some");
        return NULL;
    }
    if (build(pil, path, error, size) != 0) {
        live_destroy(pil);
        return NULL;
    }
    pil->vb->live = &live;
    pil->shadow.on = true;
    pil->vb->signals = pil->signals ? pil_target_signals : NULL;
    start_time(pil);
    return pil->vb;
}

/* ---- access ---- */

static pil_t *pil_of(const vb_t *vb)
{
    return vb->cpu.context;
}

iss_t *vb_iss_core(vb_t *vb)
{
    return soc_core(pil_of(vb)->soc);
}

int vb_iss_has_names(const vb_t *vb)
{
    return pil_of(vb)->signals ? 1 : 0;
}

const char *vb_iss_difference(const vb_t *vb)
{
    return pil_of(vb)->shadow.first;
}

void vb_iss_lock_step(vb_t *vb, int on)
{
    pil_of(vb)->shadow.on = on != 0;
}

int vb_iss_peek(vb_t *vb, unsigned address)
{
    return iss_data(soc_core(pil_of(vb)->soc))[(address & 0xFFFFu) / 2u];
}

/* Where a variable's elements are in data memory; NULL with a text if it is not there. */
static uint16_t *variable(vb_t *vb, const char *name, unsigned count)
{
    pil_t *pil = pil_of(vb);
    const image_symbol_t *s = image_find(&pil->image, IMAGE_DATA, name);
    bool fits = s != NULL && (s->address & 1u) == 0 && s->address + 2u * (size_t)count <= 0x8000u && (s->size == 0 || 2u * (size_t)count <= s->size);
    if (!fits) {
        (void)vb_fail(vb, "the image has no variable '%s' of %u elements", name, count);
        return NULL;
    }
    return iss_data(soc_core(pil->soc)) + s->address / 2u;
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
    const image_symbol_t *s = image_find(&pil_of(vb)->image, IMAGE_DATA, name);
    iss_ram_known(soc_core(pil_of(vb)->soc), (uint16_t)s->address, 2u * count, true);
    return 0;
}

int vb_iss_param_get(vb_t *vb, const char *name, double *value)
{
    (void)vb;
    return pil_target_param_get(name, value);
}

int vb_iss_param_set(vb_t *vb, const char *name, double value)
{
    int result = pil_target_param_set(name, value);
    if (result == 0 && pil_of(vb)->shadow.on) {
        (void)probe_param_set(name, value);
    }
    return result;
}

int vb_iss_terminal(vb_t *vb, char *path, size_t size)
{
    pil_t *pil = pil_of(vb);
    soc_pty_close(pil->terminal);
    pil->terminal = soc_pty_open(path, size);
    return pil->terminal != NULL ? 0 : vb_fail(vb, "no pseudo-terminal can be opened");
}
