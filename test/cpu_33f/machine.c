/* The simulator's core with a few functions that put a whole state in and take it out, for the tests' ctypes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "iss.h"

enum { SR = 0x42,
       CORCON = 0x44,
       RAM_BYTES = ISS_RAM_END - ISS_RAM_START,
       MOST_WORDS = 512,
       TEXT = 400 };

typedef struct {
    iss_t *iss;
    uint32_t loaded[MOST_WORDS]; /* addresses of the present program */
    unsigned count;
    char text[TEXT];
} machine_t;

typedef struct {
    uint16_t w[16], sr, corcon;
    uint64_t acc[2];
    uint32_t pc;
    uint64_t cycles;
} registers_t;

machine_t *machine_create(void)
{
    machine_t *machine = calloc(1, sizeof *machine);
    if (machine != NULL)
        machine->iss = iss_create();
    return machine;
}

iss_t *machine_core(machine_t *machine)
{
    return machine->iss;
}

/* Erases the last program and writes pairs of address and word. */
void machine_load(machine_t *machine, unsigned count, const uint32_t *words)
{
    for (unsigned i = 0; i < machine->count; i++)
        iss_write_program(machine->iss, machine->loaded[i], ISS_ERASED);
    machine->count = count < MOST_WORDS ? count : MOST_WORDS;
    for (unsigned i = 0; i < machine->count; i++) {
        machine->loaded[i] = words[2 * i];
        iss_write_program(machine->iss, words[2 * i], words[2 * i + 1]);
    }
}

/* A reset, then registers, RAM and pairs of address and value; all of it counts as written. */
void machine_set(machine_t *machine, const registers_t *to, const uint8_t *ram, unsigned count, const uint32_t *registers)
{
    iss_t *iss = machine->iss;
    iss_reset(iss, CHIP_RESET_POR);
    iss_restart(iss, to->pc);
    for (unsigned i = 0; i < 16; i++)
        iss_poke(iss, (uint16_t)(2 * i), to->w[i]);
    iss_set_w_known(iss, 0xFFFF);
    memcpy(iss_data(iss) + ISS_RAM_START / 2, ram, RAM_BYTES);
    iss_ram_known(iss, ISS_RAM_START, RAM_BYTES, true);
    for (unsigned i = 0; i < count; i++)
        iss_poke(iss, (uint16_t)registers[2 * i], (uint16_t)registers[2 * i + 1]);
    iss_poke(iss, SR, to->sr);
    for (unsigned i = 0; i < 2; i++)
        iss_set_acc(iss, i, (int64_t)(to->acc[i] << 24) >> 24);
    iss_irq_changed(iss);
}

/* "" when the cycle is reached. */
const char *machine_run(machine_t *machine, uint64_t until)
{
    iss_stop_t stop = iss_run(machine->iss, until);
    if (stop == ISS_STOP_NONE)
        return "";
    if (stop != ISS_STOP_ERROR)
        return "stop without an error";
    snprintf(machine->text, sizeof machine->text, "%s", iss_error(machine->iss));
    return machine->text;
}

void machine_get(machine_t *machine, registers_t *now)
{
    iss_t *iss = machine->iss;
    for (unsigned i = 0; i < 16; i++)
        now->w[i] = iss_peek(iss, (uint16_t)(2 * i));
    now->sr = iss_peek(iss, SR);
    now->corcon = iss_peek(iss, CORCON);
    for (unsigned i = 0; i < 2; i++)
        now->acc[i] = (uint64_t)iss_acc(iss, i) & 0xFFFFFFFFFFu;
    now->pc = iss_pc(iss);
    now->cycles = iss_cycles(iss);
}

void machine_ram(machine_t *machine, uint8_t *ram)
{
    memcpy(ram, iss_data(machine->iss) + ISS_RAM_START / 2, RAM_BYTES);
}

unsigned machine_peek(machine_t *machine, unsigned address)
{
    iss_sync(machine->iss);
    return iss_peek(machine->iss, (uint16_t)address);
}

void machine_poke(machine_t *machine, unsigned address, unsigned value)
{
    iss_poke(machine->iss, (uint16_t)address, (uint16_t)value);
}

void machine_forget(machine_t *machine, unsigned address, unsigned bytes)
{
    iss_ram_known(machine->iss, (uint16_t)address, bytes, false);
}

void machine_irq_changed(machine_t *machine)
{
    iss_irq_changed(machine->iss);
}

/* Registers whose bit is clear count as never written. */
void machine_forget_w(machine_t *machine, unsigned known)
{
    iss_set_w_known(machine->iss, (uint16_t)known);
}

const char *machine_disassemble(machine_t *machine, uint32_t word, uint32_t next, uint32_t pc)
{
    return iss_disassemble(word, next, pc, machine->text, sizeof machine->text) ? machine->text : "";
}
