/* What the self-tests need of the processor itself: its registers, the place of RAM, stack and flash's CRC. */
#ifndef BOARD_SELFTEST_CPU_H
#define BOARD_SELFTEST_CPU_H

#include "board/firmware.h"
#include "board/mclv.h"

/** Two words: CRC of the flash before them, and its complement; tools/image/crc.py writes them. Behind them are the kept parameters' pages, or nothing. */
#define BOARD_FLASH_CRC_AT ((PARAMS_KEPT) ? 0x4FFCu : 0x57FCu)
#define STACK_GUARD (BOARD_STACK_LIMIT - 2)
#define STACK_PATTERN 0xA5C3u

#ifdef __XC16__
#define BOARD_RAM ((volatile uint16_t *)0x0800)
#define BOARD_RAM_END ((volatile uint16_t *)0x1000)
#define BOARD_USED_END(free_ram) (free_ram)
#define BOARD_FREE_END BOARD_RAM_END

extern uint16_t _SPLIM_init; /* the linker's: its address is the stack's limit */
#define BOARD_STACK_LIMIT (&_SPLIM_init)

/** First word of RAM that neither holds a variable nor is the stack of this call and of what it calls. What lies between is cleared. */
volatile uint16_t *board_free_ram(void);

/** Do W0 to W15 and the flags hold a pattern and its complement? With interrupts off; leaves level 7. */
void board_cpu_test(void) FIRMWARE_CALLED;

/** Not 0: they do. In memory, because it could be the register of a function's value that is wrong. */
extern volatile uint16_t board_cpu_holds;

/** 1 while no control interrupt can come for 400 cycles: the counter goes up, and the conversion's end is 250 cycles after its peak. With
 *  deferred duties there is less: 300 are enough as a rule, and the control interrupt has time for 50 more. */
#define BOARD_QUIET() (P1TMR < (uint16_t)(BOARD_P1TPER - (DEFER_DUTIES ? 60u : 150u)))

/** A pass of waiting for the watchdog's reset. @return 0: the reset leaves no time for another answer */
#define BOARD_WATCHDOG_BITES() 0u
#else /* the PC: registers are variables (tools/cpu_host), nothing interrupts the background */
#define BOARD_RAM ((volatile uint16_t *)(void *)&board_drive)
#define BOARD_RAM_END (BOARD_RAM + sizeof board_drive / sizeof *BOARD_RAM)
#define BOARD_STACK_LIMIT (host_stack + HOST_STACK_WORDS)
#define board_free_ram() host_free_ram
#define BOARD_USED_END(free_ram) BOARD_RAM_END
#define BOARD_FREE_END (host_free_ram + HOST_FREE_WORDS)
#define board_cpu_holds host_cpu_holds
#define board_cpu_test() host_cpu_test()
#define BOARD_QUIET() 1u
#define BOARD_WATCHDOG_BITES() host_watchdog_bites()
#endif

#endif
