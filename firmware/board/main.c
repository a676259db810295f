/* The program: initialise, then the background for ever; the interrupts do the rest. And the chip's configuration words. */
#include "board/firmware.h"
#include "board/selftest_cpu.h"

/* Start on FRC, crystal and PLL by software, PWM pins inactive at reset, watchdog on: 32 kHz / 32 / 16, 16 ms.
 * With PARAMS_KEPT 64 ms: a page is erased in 27 ms at most [?], and the self-test of a start lets 48 ms pass. */
#ifdef __XC16__
#pragma config FNOSC = FRC
#pragma config IESO = OFF
#pragma config POSCMD = XT
#pragma config OSCIOFNC = OFF
#pragma config IOL1WAY = OFF
#pragma config FCKSM = CSECMD
#pragma config FWDTEN = ON
#pragma config WINDIS = OFF
#pragma config WDTPRE = PR32
#if PARAMS_KEPT
#pragma config WDTPOST = PS64
#else
#pragma config WDTPOST = PS16
#endif
#pragma config FPWRT = PWR128
#pragma config PWMPIN = ON
#pragma config HPOL = ON
#pragma config LPOL = ON
#pragma config ICS = PGD3
#pragma config JTAGEN = OFF
#pragma config BWRP = WRPROTECT_OFF
#pragma config BSS = NO_FLASH
#pragma config GSS = OFF
#pragma config GWRP = OFF
#endif

int main(void)
{
#ifndef SELFTEST_OFF
    (void)board_free_ram(); /* the test of the RAM reads the stack, also what a function leaves unused */
#endif
    firmware_init();
    for (;;) {
        firmware_background();
    }
}
