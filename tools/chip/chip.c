/* The chip as a whole: registers, resets, and what happens by itself in its order. */
#include "chip.h"
#include "chip_assumptions.h"

#include <math.h>
#include <string.h>

static const struct { const char *name; uint16_t address, reset; } registers[] = {
#define ROW(name, address, reset) {#name, address, reset},
    SFR_TABLE(ROW)
#undef ROW
};
enum { REGISTERS = (int)(sizeof registers / sizeof registers[0]) };
enum { FPOR_PWMPIN = 0x80 };

int chip_register(const char *name)
{
    for (size_t n = 0; n < REGISTERS; n++) {
        if (strcmp(registers[n].name, name) == 0) {
            return registers[n].address;
        }
    }
    return -1;
}

const char *chip_register_name(uint16_t address)
{
    for (size_t n = 0; n < REGISTERS; n++) {
        if (registers[n].address == address) {
            return registers[n].name;
        }
    }
    return NULL;
}

void chip_warn(chip_t *chip, const char *format, ...)
{
    if (chip->board.warn != NULL) {
        va_list args;
        va_start(args, format);
        chip->board.warn(chip->board.context, format, args);
        va_end(args);
    }
}

/* ---- registers ---- */

void chip_hook(chip_t *chip, uint16_t address, uint16_t (*read)(void *, uint16_t), void (*write)(void *, uint16_t, uint16_t, uint16_t))
{
    chip->hook[address / 2u] = (chip_hook_t){read, write};
}

uint16_t chip_read(chip_t *chip, uint16_t address)
{
    const chip_hook_t *hook = &chip->hook[address / 2u];
    return hook->read != NULL ? hook->read(chip, address) : chip_get(chip, address);
}

void chip_write(chip_t *chip, uint16_t address, uint16_t value, uint16_t mask)
{
    const chip_hook_t *hook = &chip->hook[address / 2u];
    if (hook->write != NULL) {
        hook->write(chip, address, value, mask);
    } else {
        chip_put(chip, address, chip_merged(chip, address, value, mask));
    }
}

/* ---- time and events ---- */

double chip_time_at(const chip_t *chip, uint64_t cycle)
{
    return chip->clock.base_s + (double)(cycle - chip->clock.base_cycle) / chip->clock.fcy_hz;
}

uint64_t chip_cycle_at(const chip_t *chip, double time_s)
{
    double cycles = (time_s - chip->clock.base_s) * chip->clock.fcy_hz;
    return cycles <= 0.0 ? chip->clock.base_cycle : chip->clock.base_cycle + (uint64_t)ceil(cycles - 1e-6);
}

/* An event that comes before the cycle to which the processor runs ends that run. */
void chip_schedule(chip_t *chip, chip_event_t event, uint64_t cycle)
{
    chip->event[event] = cycle;
    if (chip->cpu.attend != NULL && cycle < chip->limit) {
        chip->cpu.attend(chip->cpu.context);
    }
}

static chip_event_t first_event(const chip_t *chip)
{
    unsigned first = 0;
    for (unsigned n = 1; n < CHIP_EVENTS; n++) {
        first = chip->event[n] < chip->event[first] ? n : first;
    }
    return (chip_event_t)first;
}

uint64_t chip_next_event(const chip_t *chip)
{
    return chip->event[first_event(chip)];
}

static void happen(chip_t *chip, chip_event_t event)
{
    chip->event[event] = CHIP_NEVER;
    switch (event) {
    case CHIP_EVENT_CLOCK: chip_clock_event(chip); break;
    case CHIP_EVENT_WATCHDOG: chip_watchdog_event(chip); break;
    case CHIP_EVENT_TIMER1: chip_timer_event(chip, 0); break;
    case CHIP_EVENT_TIMER2: chip_timer_event(chip, 1); break;
    case CHIP_EVENT_TIMER3: chip_timer_event(chip, 2); break;
    case CHIP_EVENT_SEND: chip_uart_sent(chip); break;
    case CHIP_EVENT_RECEIVE: chip_uart_received(chip); break;
    case CHIP_EVENTS: break;
    }
}

void chip_happen(chip_t *chip)
{
    for (chip_event_t event = first_event(chip); chip->event[event] <= chip_now(chip); event = first_event(chip)) {
        happen(chip, event);
    }
}

void chip_end(chip_t *chip)
{
    chip_uart_wake(chip);
    chip_happen(chip);
    chip_pwm_end(chip);
    chip_adc_end(chip);
}

/* ---- interrupts ---- */

/* Set a flag in IFSx and tell the processor. True if a handler is still to come. */
bool chip_irq_raise(chip_t *chip, unsigned irq)
{
    unsigned ifs = SFR_IFS0 + 2u * (irq / 16u);
    chip_put(chip, ifs, chip_get(chip, ifs) | 1u << irq % 16u);
    return chip->cpu.raised(chip->cpu.context, irq);
}

/* ---- resets ---- */

void chip_request_reset(chip_t *chip, chip_reset_t cause)
{
    if (!chip->pending_reset) {
        chip->pending_reset = true;
        chip->pending_cause = cause;
    }
    if (chip->cpu.attend != NULL) {
        chip->cpu.attend(chip->cpu.context);
    }
}

/* Registers that no reset but power-on changes: the causes of the resets, and the running clock. */
static bool survives(uint16_t address, chip_reset_t cause)
{
    return cause != CHIP_RESET_POR && (address == SFR_RCON || address == SFR_OSCCON);
}

static void reset_registers(chip_t *chip, chip_reset_t cause)
{
    for (size_t n = 0; n < REGISTERS; n++) {
        if (registers[n].address >= SFR_CNEN1 && !survives(registers[n].address, cause)) {
            chip_put(chip, registers[n].address, registers[n].reset);
        }
    }
    if ((chip->config[CHIP_FPOR] & FPOR_PWMPIN) == 0) {
        chip_put(chip, SFR_PWM1CON1, 0x0077); /* the PWM module owns its pins from the reset on */
    }
    chip_put(chip, SFR_RCON, cause == CHIP_RESET_POR ? 3u : chip_get(chip, SFR_RCON) | chip_watchdog_cause(cause));
}

void chip_reset(chip_t *chip, chip_reset_t cause)
{
    chip->pending_reset = false;
    reset_registers(chip, cause);
    for (unsigned n = 0; n < CHIP_EVENTS; n++) {
        chip->event[n] = CHIP_NEVER;
    }
    chip_clock_reset(chip, cause);
    chip_timer_reset(chip);
    chip_uart_reset(chip);
    chip_watchdog_reset(chip);
}

/* ---- creation ---- */

bool chip_connect(chip_t *chip, const chip_cpu_t *cpu, const chip_board_t *board, plant_t *plant)
{
    memset(chip, 0, sizeof *chip);
    chip->cpu = *cpu;
    chip->plant = plant;
    if (board != NULL) {
        chip->board = *board;
    }
    for (unsigned n = 0; n < CHIP_WORDS; n++) {
        chip->place[n] = &chip->nowhere;
    }
    for (size_t n = 0; n < REGISTERS; n++) {
        volatile uint16_t *place = cpu->reg(cpu->context, registers[n].name);
        if (registers[n].address >= SFR_CNEN1 && place == NULL) {
            return false;
        }
        chip->place[registers[n].address / 2u] = place != NULL ? place : &chip->nowhere;
    }
    for (unsigned n = 0; n < CHIP_CONFIG_WORDS; n++) {
        chip->config[n] = 0xFFFFFF;
    }
    chip->clock.crystal_hz = 8e6;
    chip->clock.frc_hz = ASSUME_FRC_HZ;
    chip->clock.lprc_hz = ASSUME_LPRC_HZ;
    chip->clock.pll_lock_s = 1e-6 * ASSUME_PLL_LOCK_US;
    chip->clock.crystal_start = ASSUME_CRYSTAL_START_PERIODS;
    chip->clock.fcy_hz = 0.5 * chip->clock.frc_hz;
    chip->adc.due_s = PLANT_NEVER;
    chip_clock_hooks(chip);
    chip_watchdog_hooks(chip);
    chip_ports_hooks(chip);
    chip_timer_hooks(chip);
    chip_uart_hooks(chip);
    return true;
}
