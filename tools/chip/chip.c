/* What all parts of the chip use: registers, time, events in their order, interrupt flags, warnings. */
#include "chip.h"

#include <math.h>
#include <string.h>

static const struct { const char *name; uint16_t address, reset; } registers[] = {
#define ROW(name, address, reset) {#name, address, reset},
    SFR_TABLE(ROW)
#undef ROW
};
enum { REGISTERS = (int)(sizeof registers / sizeof registers[0]) };

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

/* Registers of the peripherals to their values after power-on; `kept` tells which stay as they are. */
void chip_put_reset_values(chip_t *chip, bool (*kept)(uint16_t address))
{
    for (size_t n = 0; n < REGISTERS; n++) {
        if (registers[n].address >= SFR_CNEN1 && (kept == NULL || !kept(registers[n].address))) {
            chip_put(chip, registers[n].address, registers[n].reset);
        }
    }
}

/* Ask the processor where it has them. False if one is missing. */
bool chip_find_registers(chip_t *chip)
{
    for (unsigned n = 0; n < CHIP_WORDS; n++) {
        chip->place[n] = &chip->nowhere;
    }
    for (size_t n = 0; n < REGISTERS; n++) {
        volatile uint16_t *place = chip->cpu.reg(chip->cpu.context, registers[n].name);
        if (registers[n].address >= SFR_CNEN1 && place == NULL) {
            return false;
        }
        chip->place[registers[n].address / 2u] = place != NULL ? place : &chip->nowhere;
    }
    return true;
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

void chip_happen(chip_t *chip)
{
    for (chip_event_t event = first_event(chip); chip->event[event] <= chip_now(chip); event = first_event(chip)) {
        chip->event[event] = CHIP_NEVER;
        chip->on_event[event](chip);
    }
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
