/* The last reset's cause, and the fault that is kept over the next one; the watchdog. */
#ifndef BOARD_RESET_H
#define BOARD_RESET_H

#include "drive/faults.h"

#include <stdint.h>

/** Of a variable that outlives a reset: neither cleared nor set by the start-up code. */
#ifdef __XC16__
#define BOARD_PERSISTENT __attribute__((persistent))
#else
#define BOARD_PERSISTENT
#endif

/** Of a variable that the firmware writes before it reads it. The start-up code's list of what to clear is nine bytes shorter for a file that has no others. */
#define BOARD_UNSET BOARD_PERSISTENT

/** X(bit, name): the flags of RCON that say why the processor started. */
#define RESET_CAUSE_TABLE(X) \
    X(15, TRAPR, "trap conflict") \
    X(14, IOPUWR, "illegal opcode, or an address from a register that was never written") \
    X(9, CM, "pin selection changed without its unlock sequence") \
    X(7, EXTR, "MCLR pin") \
    X(6, SWR, "RESET instruction") \
    X(4, WDTO, "watchdog") \
    X(1, BOR, "supply dipped") \
    X(0, POR, "power-up")

#define RESET_BIT(bit, name, meaning) RESET_##name = (bit),
/** Bit numbers in RCON. */
enum { RESET_CAUSE_TABLE(RESET_BIT) };
/** 1 if the flag is set in a copy of RCON. */
#define RESET_WAS(name, rcon) (((rcon) >> RESET_##name) & 1u)

/** RCON as it was found at the start: bits of RESET_CAUSE_TABLE. */
extern volatile uint16_t board_reset_cause;
/** The flag as a bit, to ask for several at once. */
#define RESET_FLAG(name) (1u << RESET_##name)
/** Not 0 if RAM holds anything: after power-up, or a supply that dipped. */
#define RESET_LOST_RAM(rcon) ((uint16_t)((rcon) & (RESET_FLAG(POR) | RESET_FLAG(BOR))))

/** INTCON1 at the last trap (FAULT_TRAP): its bits name the trap. Kept over every reset but power-up. */
extern volatile uint16_t board_trap_intcon1;

/** Reads and clears RCON. Once, at the start.
 *  @return what to start with: the kept fault after a reset by watchdog, trap or illegal opcode (WATCHDOG or TRAP if none was kept),
 *          else FAULT_NONE */
drive_fault_t reset_take(void);

/** Keeps a fault (or FAULT_NONE) for the time after a reset. */
void reset_keep(uint16_t fault);

/** Serves the watchdog if a control interrupt came since the last call; the caller shows that the background is alive. Nothing else serves
 *  it after the start, but what programs the flash (kept.c): when either stands still, the reset comes 16 ms later, with PARAMS_KEPT 64. @param ticks of the drive */
void reset_serve_watchdog(uint16_t ticks);

#endif
