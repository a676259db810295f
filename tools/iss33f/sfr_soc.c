/* The chip as a whole: memory, reset, and the order of what happens by itself between the core's instructions. */
#include "sfr_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const struct { const char *name; uint16_t address, reset; } registers[] = {
#define ROW(name, address, reset) {#name, address, reset},
    SFR_TABLE(ROW)
#undef ROW
};
enum { REGISTERS = (int)(sizeof registers / sizeof registers[0]) };
enum { FPOR_PWMPIN = 0x80 };

int soc_register(const char *name)
{
    for (size_t n = 0; n < REGISTERS; n++) {
        if (strcmp(registers[n].name, name) == 0) {
            return registers[n].address;
        }
    }
    return -1;
}

const char *soc_register_name(uint16_t address)
{
    for (size_t n = 0; n < REGISTERS; n++) {
        if (registers[n].address == address) {
            return registers[n].name;
        }
    }
    return NULL;
}

iss_t *soc_core(soc_t *soc)
{
    return soc->iss;
}

soc_times_t *soc_times(soc_t *soc)
{
    return &soc->times;
}

unsigned soc_resets(const soc_t *soc)
{
    return soc->resets;
}

uint64_t soc_now(const soc_t *soc)
{
    return iss_cycles(soc->iss);
}

double soc_fcy_hz(const soc_t *soc)
{
    return soc->fcy_hz;
}

double soc_time_at(const soc_t *soc, uint64_t cycle)
{
    return soc->base_s + (double)(cycle - soc->base_cycle) / soc->fcy_hz;
}

uint64_t soc_cycle_at(const soc_t *soc, double time_s)
{
    double cycles = (time_s - soc->base_s) * soc->fcy_hz;
    return cycles <= 0.0 ? soc->base_cycle : soc->base_cycle + (uint64_t)ceil(cycles - 1e-6);
}

double soc_seconds(const soc_t *soc)
{
    return soc_time_at(soc, soc_now(soc));
}

void soc_note(soc_t *soc, const char *text)
{
    if (soc->board.note != NULL) {
        soc->board.note(soc->board.context, text);
    }
}

void soc_break(soc_t *soc)
{
    soc->broken = true;
    iss_request_stop(soc->iss);
}

/* An event that comes before the cycle to which the core runs ends that run. */
void soc_schedule(soc_t *soc, soc_event_t event, uint64_t cycle)
{
    soc->event[event] = cycle;
    if (soc->running && cycle < soc->limit) {
        iss_request_stop(soc->iss);
    }
}

void soc_flag(soc_t *soc, uint16_t address, unsigned bit)
{
    soc_put(soc, address, soc_get(soc, address) | 1u << bit);
    iss_irq_changed(soc->iss);
}

static void happen(soc_t *soc, soc_event_t event)
{
    soc->event[event] = SOC_NEVER;
    switch (event) {
    case SOC_CLOCK: soc_clock_event(soc); break;
    case SOC_WATCHDOG: soc_watchdog_event(soc); break;
    case SOC_TIMER1: soc_timer_event(soc, 0); break;
    case SOC_TIMER2: soc_timer_event(soc, 1); break;
    case SOC_TIMER3: soc_timer_event(soc, 2); break;
    case SOC_SEND: soc_uart_sent(soc); break;
    case SOC_RECEIVE: soc_uart_received(soc); break;
    case SOC_EVENTS: break;
    }
}

static uint64_t first_event(const soc_t *soc, soc_event_t *event)
{
    uint64_t first = SOC_NEVER;
    for (unsigned n = 0; n < SOC_EVENTS; n++) {
        if (soc->event[n] < first) {
            first = soc->event[n];
            *event = (soc_event_t)n;
        }
    }
    return first;
}

static void happen_until_now(soc_t *soc)
{
    soc_event_t event = SOC_EVENTS;
    while (first_event(soc, &event) <= soc_now(soc)) {
        happen(soc, event);
    }
}

/* A reset that an instruction or a peripheral has asked for. */
static void finish_reset(soc_t *soc)
{
    soc->pending_reset = false;
    soc->resets++;
    soc_reset(soc, soc->pending_cause);
    if (soc->board.reset != NULL) {
        soc->board.reset(soc->board.context);
    }
    soc->broken = true;
}

iss_stop_t soc_run(soc_t *soc, uint64_t until_cycle)
{
    iss_stop_t stop = ISS_STOP_NONE;
    soc->running = true;
    soc->broken = false;
    while (soc_now(soc) < until_cycle && !soc->broken && stop == ISS_STOP_NONE) {
        soc_event_t event = SOC_EVENTS;
        uint64_t next = first_event(soc, &event);
        soc->limit = next < until_cycle ? next : until_cycle;
        stop = iss_run(soc->iss, soc->limit);
        if (stop == ISS_STOP_REQUEST) {
            stop = ISS_STOP_NONE;
        }
        happen_until_now(soc);
        if (soc->pending_reset) {
            finish_reset(soc);
        }
    }
    soc->running = false;
    return stop == ISS_STOP_NONE && soc->broken ? ISS_STOP_REQUEST : stop;
}

void soc_request_reset(soc_t *soc, iss_reset_cause_t cause)
{
    if (!soc->pending_reset) {
        soc->pending_reset = true;
        soc->pending_cause = cause;
    }
    iss_request_stop(soc->iss);
}

/* Registers that no reset but power-on changes: the causes of the resets, and the running clock. */
static bool survives(uint16_t address, iss_reset_cause_t cause)
{
    return cause != ISS_RESET_POR && (address == SFR_RCON || address == SFR_OSCCON);
}

static void reset_registers(soc_t *soc, iss_reset_cause_t cause)
{
    for (size_t n = 0; n < REGISTERS; n++) {
        if (registers[n].address >= SFR_CNEN1 && !survives(registers[n].address, cause)) {
            soc_put(soc, registers[n].address, registers[n].reset);
        }
    }
    if ((soc->config[IMAGE_FPOR] & FPOR_PWMPIN) == 0) {
        soc_put(soc, SFR_PWM1CON1, 0x0077); /* the PWM module owns its pins from the reset on */
    }
    soc_put(soc, SFR_RCON, cause == ISS_RESET_POR ? 3u : soc_get(soc, SFR_RCON) | soc_reset_bits(cause));
}

void soc_reset(soc_t *soc, iss_reset_cause_t cause)
{
    iss_reset(soc->iss, cause);
    reset_registers(soc, cause);
    for (unsigned n = 0; n < SOC_EVENTS; n++) {
        soc->event[n] = SOC_NEVER;
    }
    soc_clock_reset(soc, cause);
    soc_timer_reset(soc);
    soc_uart_reset(soc);
    soc_watchdog_reset(soc);
    iss_irq_changed(soc->iss);
}

/* PWM1's counter is live, and its other registers act at once. */
static uint16_t read_counter(void *context, uint16_t address)
{
    soc_t *soc = context;
    if (soc->board.counter != NULL) {
        soc_put(soc, address, soc->board.counter(soc->board.context));
    }
    return soc_get(soc, address);
}

static void write_acting(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    uint16_t now = soc_merged(soc, address, value, mask);
    bool changed = now != soc_get(soc, address);
    soc_put(soc, address, now);
    if (soc->board.written != NULL && (changed || address == SFR_P1DC3)) {
        soc->board.written(soc->board.context, address);
    }
}

static void board_hooks(soc_t *soc)
{
    iss_sfr_hook(soc->iss, SFR_P1TMR, read_counter, NULL, soc);
#define HOOK(name) iss_sfr_hook(soc->iss, SFR_##name, NULL, write_acting, soc);
    SOC_ACTING_LIST(HOOK)
#undef HOOK
}

static void reset_by_core(void *context, iss_reset_cause_t cause)
{
    soc_request_reset(context, cause);
}

static void program(soc_t *soc, const image_t *image)
{
    for (uint32_t n = 0; n < IMAGE_WORDS; n++) {
        if (image->programmed[n] != 0) {
            (void)iss_write_program(soc->iss, 2u * n, image->program[n]);
        }
    }
    memcpy(soc->config, image->config, sizeof soc->config);
}

soc_t *soc_create(const image_t *image, const soc_board_t *board)
{
    soc_t *soc = calloc(1, sizeof *soc);
    if (soc == NULL) {
        return NULL;
    }
    soc->iss = iss_create();
    if (soc->iss == NULL) {
        free(soc);
        return NULL;
    }
    soc->data = iss_data(soc->iss);
    soc->times = (soc_times_t){.crystal_hz = 8e6, .frc_hz = ASSUME_FRC_HZ, .lprc_hz = ASSUME_LPRC_HZ, .pll_lock_s = 1e-6 * ASSUME_PLL_LOCK_US,
                               .crystal_start = ASSUME_CRYSTAL_START_PERIODS};
    if (board != NULL) {
        soc->board = *board;
    }
    program(soc, image);
    iss_on_reset(soc->iss, reset_by_core, soc);
    board_hooks(soc);
    soc_clock_hooks(soc);
    soc_watchdog_hooks(soc);
    soc_ports_hooks(soc);
    soc_timer_hooks(soc);
    soc_uart_hooks(soc);
    soc_reset(soc, ISS_RESET_POR);
    return soc;
}

void soc_destroy(soc_t *soc)
{
    if (soc != NULL) {
        iss_destroy(soc->iss);
        free(soc);
    }
}
