/* What the self-tests need of the processor itself: its registers, the place of RAM, stack and flash's CRC. The only file with assembler. */
#ifndef BOARD_SELFTEST_CHIP_H
#define BOARD_SELFTEST_CHIP_H

#include "board/mclv.h"

#define BOARD_FLASH_CRC_AT 0x57FCu /* the last two words of the flash: CRC of all before them, and its complement; tools/image/crc.py writes them */

#define STACK_GUARD (BOARD_STACK_LIMIT - 2)
#define STACK_PATTERN 0xA5C3u

/** An analogue input that AD1PCFGL switches off: the multiplexer gives AVSS. */
#define BOARD_AN_OFF ((uint16_t)((BOARD_AD1PCFGL & 0x0040u) ? 6 : 7))
PIN_NEEDS(an_input_is_free_for_the_converters_test, (BOARD_AD1PCFGL & 0x00C0u) != 0u);

#ifdef __XC16__

#define BOARD_RAM ((volatile uint16_t *)0x0800)
#define BOARD_RAM_END ((volatile uint16_t *)0x1000)
#define BOARD_USED_END(free_ram) (free_ram)
#define BOARD_FREE_END BOARD_RAM_END

extern uint16_t _SPLIM_init; /* the linker's: its address is the stack's limit */
#define BOARD_STACK_LIMIT (&_SPLIM_init)

/** First word of RAM that neither holds a variable nor is the stack of this call and of what it calls. Clears what lies between. */
static inline volatile uint16_t *board_free_ram(void)
{
    volatile uint16_t *at, *end;
    __asm__ volatile("mov w15, %0" : "=r"(at));
    end = at + 24;
    for (; at != end; at++) {
        *at = 0;
    }
    return end;
}

/* A chain of all W registers but the stack pointer: a bit that is stuck reaches the end. Two registers are compared with it, so that not
 * one of them hides its own. Leaves with anything wrong. */
#define CPU_CHAIN \
    "mov %1,w0\n mov w0,w1\n mov w1,w2\n mov w2,w3\n mov w3,w4\n mov w4,w5\n mov w5,w6\n mov w6,w7\n mov w7,w8\n mov w8,w9\n" \
    "mov w9,w10\n mov w10,w11\n mov w11,w12\n mov w12,w13\n mov w13,w14\n mov %1,w0\n mov %1,w1\n" \
    "cp w0,w14\n bra nz,.Lwrong%=\n cp w1,w14\n bra nz,.Lwrong%=\n"
/* The stack pointer (0x001E), whose bit 0 is always 0. Nothing uses the stack meanwhile: interrupts are off. */
#define CPU_STACK_POINTER "mov 0x001E,w2\n mov w0,0x001E\n mov 0x001E,w1\n mov w2,0x001E\n bclr w0,#0\n cp w0,w1\n bra nz,.Lwrong%=\n"
/* C, Z, OV, N and DC of SR (0x0042), level 7 stays: 0x01E5 or 0x00EA. None of these instructions changes a flag but CP. */
#define CPU_FLAGS "mov %2,w0\n mov w0,0x0042\n mov 0x0042,w1\n cp w0,w1\n bra nz,.Lwrong%=\n"

/** Not 0 if the registers of the processor hold a pattern. With interrupts off. @param pattern and flags: 0x5555, 0x01E5; 0xAAAA, 0x00EA */
NOINLINE uint16_t board_cpu_holds_pattern(uint16_t pattern_value, uint16_t flags_value)
{
    static volatile uint16_t pattern, flags, passed; /* no register says so: it could be the one that is wrong */
    pattern = pattern_value;
    flags = flags_value;
    passed = 0;
    __asm__ volatile("push w14\n" CPU_CHAIN CPU_STACK_POINTER CPU_FLAGS "setm %0\n.Lwrong%=: pop w14\n"
                     : "=T"(passed)
                     : "T"(pattern), "T"(flags)
                     : "w0", "w1", "w2", "w3", "w4", "w5", "w6", "w7", "w8", "w9", "w10", "w11", "w12", "w13", "cc");
    return passed;
}
#define board_cpu_holds() (board_cpu_holds_pattern(0x5555u, 0x01E5u) && board_cpu_holds_pattern(0xAAAAu, 0x00EAu))

/** 1 while no control interrupt can come for 600 cycles: the counter goes up, and the conversion's end is 250 cycles after its peak. */
#define BOARD_QUIET() (P1TMR < (uint16_t)(BOARD_P1TPER - 350u))

/** A pass of waiting for the watchdog's reset. @return 0: the reset leaves no time for another answer */
#define BOARD_WATCHDOG_BITES() 0u

#else /* the PC: registers are variables (tools/cpu_host), nothing interrupts the background */

#include "board/firmware.h"

#define BOARD_RAM ((volatile uint16_t *)(void *)&board_drive)
#define BOARD_RAM_END (BOARD_RAM + sizeof board_drive / sizeof *BOARD_RAM)
#define BOARD_STACK_LIMIT (host_stack + HOST_STACK_WORDS)
#define board_free_ram() host_free_ram
#define BOARD_USED_END(free_ram) BOARD_RAM_END
#define BOARD_FREE_END (host_free_ram + HOST_FREE_WORDS)
#define board_cpu_holds() host_cpu_holds()
#define BOARD_QUIET() 1u
#define BOARD_WATCHDOG_BITES() host_watchdog_bites()

#endif
#endif
