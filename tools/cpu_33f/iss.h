/* Instruction-set simulator of a dsPIC33FJ32MC204's core: memory, instructions, DSP engine, interrupts, traps; cycle by cycle.
 *
 * Registers are memory, as in the chip: iss_data() holds W0..W15, SR, CORCON and all others at their addresses; peripherals are hooks on
 * addresses below 0x0800. Only the accumulators, the PC and DISICNT live elsewhere while instructions run; iss_run() and iss_sync() put them
 * into data memory, iss_set_acc() and iss_restart() change them. All program addresses are PC addresses (two per instruction word).
 */
#ifndef FOC33_CPU_33F_ISS_H
#define FOC33_CPU_33F_ISS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "chip_irq.h"

enum {
    ISS_PROGRAM_WORDS = 0x2C00,     /* 24-bit words of flash: PC addresses 0x0000..0x57FE */
    ISS_CONFIG_START = 0xF80000,    /* PC address of the first configuration word */
    ISS_CONFIG_WORDS = 12,
    ISS_DATA_WORDS = 0x8000,        /* 64 KB of data addresses */
    ISS_RAM_START = 0x0800,
    ISS_Y_START = 0x0C00,           /* the DSP engine's Y space */
    ISS_RAM_END = 0x1000
};

#define ISS_ERASED 0xFFFFFFu

typedef struct iss iss_t;

/* Why iss_run() came back. After every stop it can be called again: the core goes on as the chip would. */
typedef enum {
    ISS_STOP_NONE,       /* until_cycle reached */
    ISS_STOP_REQUEST,    /* iss_request_stop() */
    ISS_STOP_ERROR       /* iss_error() tells which */
} iss_stop_t;

/* What a program should not do. Each is noted (iss_error, iss_on_report); which of them end iss_run() is set by iss_stop_on(). */
typedef enum {
    ISS_ERROR_OPCODE,        /* no instruction; the chip resets */
    ISS_ERROR_FETCH,         /* erased flash (the chip takes it for NOPR) or no flash at all (address error trap) is executed */
    ISS_ERROR_UNKNOWN_RAM,   /* RAM that was never written since power-on is read */
    ISS_ERROR_UNKNOWN_W,     /* a W register that was never written is used as an address; the chip resets */
    ISS_ERROR_DIVIDE,        /* DIV without REPEAT #17 */
    ISS_ERROR_SPACE,         /* X prefetch from Y space or the reverse (reads 0), table or PSV access outside the flash */
    ISS_ERROR_TRAP,          /* a trap is raised: oscillator, address, stack, math */
    ISS_ERROR_TRAP_CONFLICT, /* a hard trap during one of higher priority; the chip resets */
    ISS_ERROR_KINDS
} iss_error_t;

#define ISS_STOP_DEFAULT \
    (1u << ISS_ERROR_OPCODE | 1u << ISS_ERROR_FETCH | 1u << ISS_ERROR_UNKNOWN_RAM | 1u << ISS_ERROR_UNKNOWN_W | 1u << ISS_ERROR_DIVIDE | \
     1u << ISS_ERROR_SPACE)

typedef enum { ISS_POWER_RUN, ISS_POWER_IDLE, ISS_POWER_SLEEP } iss_power_t;

/* ---- life ---- */

/* A core with erased flash, after a power-on reset. NULL if memory ran out. */
iss_t *iss_create(void);
void iss_destroy(iss_t *iss);

/* Core registers to their reset values, PC 0; W0..W14 become uninitialised, and after CHIP_RESET_POR and _BOR the RAM too. The cycle count goes on. */
void iss_reset(iss_t *iss, chip_reset_t cause);

/* ---- memory ---- */

/* Flash, index = PC / 2. After writing through this pointer call iss_program_changed(); every word that is not ISS_ERASED counts as
 * programmed then. */
uint32_t *iss_program(iss_t *iss);
void iss_program_changed(iss_t *iss);

/* The chip programs it: erases so many words around the last table write, or clears the bits that are 0 in what the table writes have left for
 * them. The core stands for so many cycles. Words are a power of two. */
void iss_flash(iss_t *iss, bool erases, unsigned words, uint64_t cycles);

/* Program one word, of flash or of the configuration words; ISS_ERASED erases it. False: there is no such address. */
bool iss_write_program(iss_t *iss, uint32_t pc, uint32_t word);

/* Data memory as words, index = address / 2. Little-endian as bytes on a little-endian host. */
uint16_t *iss_data(iss_t *iss);

/* The chip's data memory read and written from outside, without hooks and effects. */
uint16_t iss_peek(iss_t *iss, uint16_t address);
void iss_poke(iss_t *iss, uint16_t address, uint16_t value);

/* Declare bytes of RAM written or never written; for loaders, persistent variables and tests. */
void iss_ram_known(iss_t *iss, uint16_t address, unsigned bytes, bool known);

/* ---- registers that are not in data memory while instructions run ---- */

uint32_t iss_pc(const iss_t *iss);

/* Accumulator 0 (A) or 1 (B), sign-extended from 40 bits. */
int64_t iss_acc(const iss_t *iss, unsigned which);
void iss_set_acc(iss_t *iss, unsigned which, int64_t value);

/* Bit mask of the W registers that count as initialised (bit 15 always does). Poking W registers does not change it. */
void iss_set_w_known(iss_t *iss, uint16_t mask);

/* Put accumulators, PC and DISICNT into data memory, for a hook that looks at them there. */
void iss_sync(iss_t *iss);

/* For tests: forget DISI, sleep and the previous instruction; the cycle count becomes 0. Memory and registers stay. */
void iss_restart(iss_t *iss, uint32_t pc);

/* ---- running ---- */

/* Execute instructions until the cycle count is at least until_cycle, or to a stop. An instruction, each turn of a repeated one and the
 * entry into an interrupt are not divided. */
iss_stop_t iss_run(iss_t *iss, uint64_t until_cycle);

/* End the present iss_run() after this instruction; for hooks. */
void iss_request_stop(iss_t *iss);

uint64_t iss_cycles(const iss_t *iss);
uint64_t iss_instructions(const iss_t *iss);
iss_power_t iss_power(const iss_t *iss);

/* Leave IDLE or SLEEP, as a watchdog does. */
void iss_wake(iss_t *iss);

/* ---- errors ---- */

/* The last error as one line "what, where: why", "" if there was none; valid until the next one. */
const char *iss_error(const iss_t *iss);

/* Bit mask 1 << iss_error_t of the kinds that end iss_run() with ISS_STOP_ERROR; ISS_STOP_DEFAULT to begin with. */
void iss_stop_on(iss_t *iss, unsigned mask);

/* Called with every error, whether it stops or not. */
void iss_on_report(iss_t *iss, void (*report)(void *context, iss_error_t kind, uint32_t pc, const char *text), void *context);

/* Names for the texts: the symbol at or below an address and the distance to it, NULL if there is none. `data` tells which space. */
void iss_on_symbol(iss_t *iss, const char *(*name)(void *context, bool data, uint32_t address, uint32_t *offset), void *context);

/* ---- peripherals ---- */

/* The register at an even address below 0x0800: read() gives its value; write() gets a value with the bits that count in `mask` (a byte
 * write: 0x00FF or 0xFF00) and stores it itself if it is to be stored. NULL: plain memory. A read-modify-write instruction calls both; CLR, SETM
 * and moves to it call only write(). The core's own registers (0x0000..0x0053, 0x0080..0x00E1) cannot be hooked. */
void iss_sfr_hook(iss_t *iss, uint16_t address, uint16_t (*read)(void *context, uint16_t address),
                  void (*write)(void *context, uint16_t address, uint16_t value, uint16_t mask), void *context);

/* Bits of INTCON1, INTCON2, IFSx, IECx or IPCx have been changed from outside. */
void iss_irq_changed(iss_t *iss);

/* CLRWDT has been executed (PWRSAV clears the watchdog too). */
void iss_on_clrwdt(iss_t *iss, void (*cleared)(void *context), void *context);

/* The core demands a reset (RESET instruction, illegal opcode, ...). The hook asks for a stop and calls iss_reset() later, outside
 * iss_run(). Without a hook the core sets the bit in RCON and resets itself. */
void iss_on_reset(iss_t *iss, void (*reset)(void *context, chip_reset_t cause), void *context);

/* ---- observation ---- */

/* Around interrupts and traps. `vector` is the place in the vector table, 0 at address 4 (trap n, interrupt n - 8); `cycle` of the last
 * instruction's end before entry, and of RETFIE's end. */
void iss_on_interrupt(iss_t *iss, void (*enter)(void *context, unsigned vector, uint64_t cycle),
                      void (*leave)(void *context, unsigned vector, uint64_t cycle), void *context);

typedef enum { ISS_PROFILE_OFF, ISS_PROFILE_ALL, ISS_PROFILE_HANDLERS } iss_profile_t;

/* Count executions and cycles of every address (off at first), of all that runs or of what runs in handlers. The arrays have ISS_PROGRAM_WORDS
 * elements, index = PC / 2; cycles of an interrupt's entry belong to its first instruction. Switching on clears them. NULL if never switched on. */
bool iss_profile(iss_t *iss, iss_profile_t what);
const uint32_t *iss_profile_counts(const iss_t *iss);
const uint64_t *iss_profile_cycles(const iss_t *iss);

/* Handlers looked at while they are profiled: the cycles of all; of one vector's, too, how often and how late one run executes which parts of it,
 * and how many runs execute all parts of a set. */
enum { ISS_WATCH_PARTS = 64, ISS_WATCH_SETS = 128, ISS_VECTORS = 126 };

typedef struct {
    uint64_t runs;                          /* of the watched handlers, from entry to return */
    uint32_t longest[ISS_VECTORS];          /* of each vector: cycles from entry to return, without handlers in between */
    uint32_t times[ISS_WATCH_PARTS];        /* how often one run has executed an instruction of the part, at most */
    uint32_t latest[ISS_WATCH_PARTS];       /* cycles from entry to the end of the part's last instruction, at most */
    uint64_t whole[ISS_WATCH_SETS];         /* of each set: runs that have executed all of its parts */
} iss_watched_t;

/* Looks at a vector's handler from now on, with nothing seen; 0 ends it. False: no memory. */
bool iss_watch(iss_t *iss, unsigned vector);

/* Its runs count like those of the first one, each by itself. */
void iss_watch_also(iss_t *iss, unsigned vector);

/* The instruction at a PC address is in a part, below ISS_WATCH_PARTS. */
void iss_watch_part(iss_t *iss, uint32_t pc, unsigned part);

/* One more set, as bits 1 << part. False: there are ISS_WATCH_SETS already. */
bool iss_watch_set(iss_t *iss, uint64_t parts);

/* NULL: nothing is watched. */
const iss_watched_t *iss_watched(const iss_t *iss);

/* Bytes of stack at its deepest, above the last literal moved to W15. iss_stack_clear() starts anew. */
unsigned iss_stack_bytes(const iss_t *iss);
void iss_stack_clear(iss_t *iss);

/* ---- damage ---- */

/* From now on bits of the word at an even address of data memory (a W register, RAM, a register) are stuck; one word at a time, 0 and 0
 * mend it. */
void iss_stick(iss_t *iss, uint16_t address, uint16_t at_1, uint16_t at_0);

/* ---- instructions as text ---- */

/* Disassemble the word at a PC address; `next` is the word behind it. Words used: 1 or 2, 0 if it is no instruction (".word24 0x..."). */
unsigned iss_disassemble(uint32_t word, uint32_t next, uint32_t pc, char *buffer, size_t size);

/* ---- instructions as facts, for whoever adds up cycles without running them ---- */

/* Where the program goes on. */
typedef enum {
    ISS_FLOW_NEXT,
    ISS_FLOW_BRANCH,   /* to `target` or on */
    ISS_FLOW_JUMP,     /* to `target` */
    ISS_FLOW_COMPUTED, /* jumps or calls to where a register says */
    ISS_FLOW_CALL,     /* to `target`, and on after its return */
    ISS_FLOW_RETURN,
    ISS_FLOW_SKIP,     /* on, or over the next instruction */
    ISS_FLOW_REPEAT,   /* the next instruction `count` + 1 times */
    ISS_FLOW_DO,       /* from the next instruction to the one at `target` `count` + 1 times */
    ISS_FLOW_STOP      /* sleep or reset */
} iss_flow_t;

typedef struct {
    int32_t flow;      /* iss_flow_t */
    int32_t words;     /* 1 or 2 */
    int32_t cycles;
    int32_t taken;     /* more cycles of a branch that is taken, for each word of a skip that is */
    int32_t target;    /* PC address; -1: none, or outside the flash */
    int32_t count;     /* of REPEAT and DO; -1: a register has it */
    uint32_t stall;    /* W registers whose change by the instruction before costs a stall: assumption RAW_STALL_CYCLES */
    uint32_t writes;   /* W registers that it changes */
    int32_t window;    /* words that it can read through the PSV window, each for the cycles of assumption PSV_READ_CYCLES */
    int32_t address;   /* data address that it reads, if it is fixed; -1: in the registers of `stall`, or none */
} iss_fact_t;

/* What the word at a PC address takes and does; `next` is the word behind it. False: it is no instruction. */
bool iss_fact(uint32_t word, uint32_t next, uint32_t pc, iss_fact_t *fact);

/* ---- assumptions ---- */

/* Lines of assumptions.h; false behind the last. */
typedef struct {
    const char *id;
    int value;
    const char *meaning, *used_in;
} iss_assumption_t;
bool iss_assumption(size_t row, iss_assumption_t *assumption);

#endif
