/* The processor's registers hold what is written to them: the only file with assembler. The PC has its own (tools/cpu_host/xc.c). */
#include "board/selftest_cpu.h"

#include "board/selftest_run.h"

#if defined(__XC16__) && !defined(SELFTEST_OFF)
#include "board/reset.h"

#define WORDS_BELOW 24u /* of stack that the test of the RAM may still need */

volatile uint16_t *board_free_ram(void)
{
    volatile uint16_t *at, *end;
    __asm__ volatile("mov w15, %0"
                     : "=r"(at));
    end = at + WORDS_BELOW;
    while (at != end) {
        *at = 0;
        at++;
    }
    return end;
}

/* A chain of all W registers but the stack pointer: a bit that is stuck reaches the end. Two registers are compared with it, so that not
 * one of them hides its own. Leaves with anything wrong. */
#define CHAIN \
    "mov %1,w0\n mov w0,w1\n mov w1,w2\n mov w2,w3\n mov w3,w4\n mov w4,w5\n mov w5,w6\n mov w6,w7\n mov w7,w8\n mov w8,w9\n" \
    "mov w9,w10\n mov w10,w11\n mov w11,w12\n mov w12,w13\n mov w13,w14\n mov %1,w0\n mov %1,w1\n" \
    "cp w0,w14\n bra nz,.Lwrong%=\n cp w1,w14\n bra nz,.Lwrong%=\n"
/* The stack pointer (0x001E), whose bit 0 is always 0. Nothing uses the stack meanwhile. */
#define STACK_POINTER "mov 0x001E,w2\n mov w0,0x001E\n mov 0x001E,w1\n mov w2,0x001E\n bclr w0,#0\n cp w0,w1\n bra nz,.Lwrong%=\n"
/* C, Z, OV, N and DC of SR (0x0042), level 7 stays. No MOV changes a flag; a Z that is stuck shows in the last branch. */
#define FLAGS \
    "mov %1,w0\n mov #0x010F,w1\n and w0,w1,w0\n mov #0x00E0,w1\n ior w0,w1,w0\n mov w0,0x0042\n mov 0x0042,w1\n" \
    "cp w0,w1\n bra nz,.Lwrong%=\n cp0 w1\n bra z,.Lwrong%=\n"

volatile uint16_t board_cpu_holds BOARD_UNSET;
static volatile uint16_t pattern BOARD_UNSET;

void board_cpu_test(void)
{
    pattern = 0x5555u;
    /* With the pattern and with its complement, which is made in memory: the pattern itself has come through a register that may be wrong. */
    __asm__ volatile("clr %0\n push w14\n"
                     ".Lagain%=:\n" CHAIN STACK_POINTER FLAGS "com %1\n inc %0\n btss %0,#1\n bra .Lagain%=\n bra .Lend%=\n"
                     ".Lwrong%=: clr %0\n"
                     ".Lend%=: pop w14\n"
                     : "+T"(board_cpu_holds), "+T"(pattern)
                     :
                     : "w0", "w1", "w2", "w3", "w4", "w5", "w6", "w7", "w8", "w9", "w10", "w11", "w12", "w13", "cc");
}
#else
typedef int selftest_cpu_is_for_the_target;
#endif
