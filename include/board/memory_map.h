/* The memory that a client on the serial line may see, by 16-bit addresses: the chip's own; on a PC the window of tools/cpu_host. */
#ifndef BOARD_MEMORY_MAP_H
#define BOARD_MEMORY_MAP_H

#include "control/qmath.h"

#ifndef __XC16__
#include <xc.h> /* the PC's: where the window is */
#endif

#define MEMORY_RAM_START 0x0800u

#ifdef __XC16__

extern uint16_t _SP_init; /* the linker's: its address is where the variables end and the stack begins */
#define MEMORY_RAM_BYTES 0x0800u
#define MEMORY_VARIABLE_BYTES ((uint16_t)((uint16_t)(uintptr_t)&_SP_init - MEMORY_RAM_START))
#define MEMORY_AT(address) ((volatile void *)(uintptr_t)(address))
#define MEMORY_ADDRESS(pointer) ((uint16_t)(uintptr_t)(pointer))

#else

#define MEMORY_RAM_BYTES ((uint16_t)host_window_bytes())
#define MEMORY_VARIABLE_BYTES MEMORY_RAM_BYTES
#define MEMORY_AT(address) ((volatile void *)(host_window() + ((address)-MEMORY_RAM_START)))
#define MEMORY_ADDRESS(pointer) ((uint16_t)((const volatile uint8_t *)(pointer)-host_window() + (ptrdiff_t)MEMORY_RAM_START))

#endif

/** 1 if all of these bytes are RAM: nothing else may be read, for reading a register may act. What is below wraps to beyond the end. */
static inline QM_WRAPS uint16_t memory_is_ram(uint16_t address, uint16_t bytes)
{
    uint16_t from = (uint16_t)(address - MEMORY_RAM_START);
    return (uint16_t)(from < MEMORY_RAM_BYTES && bytes <= (uint16_t)(MEMORY_RAM_BYTES - from));
}

/** 1 if all of these bytes of RAM are variables: no stack. */
static inline uint16_t memory_is_variable(uint16_t address, uint16_t bytes)
{
    uint16_t from = (uint16_t)(address - MEMORY_RAM_START);
    return (uint16_t)(from + bytes <= MEMORY_VARIABLE_BYTES);
}

#endif
