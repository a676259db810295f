/* Clock: FRC at reset, then the 8 MHz crystal through the PLL to 40 MIPS, with bounded waits. */
#include "board/mclv.h"
#include "board/peripherals.h"

uint16_t clock_init(void)
{
    uint16_t loops = BOARD_WAIT_LOOPS;

    PLLFBD = BOARD_PLLFBD;
    CLKDIV = BOARD_CLKDIV;
    OSCTUN = 0;
    __builtin_write_OSCCONH(BOARD_NOSC_PRIPLL);
    __builtin_write_OSCCONL(OSCCON | 0x0001u);
    while ((OSCCONbits.COSC != BOARD_NOSC_PRIPLL || OSCCONbits.LOCK == 0u) && loops != 0u) {
        loops--;
        ClrWdt(); /* the wait is bounded, but longer than the watchdog's time */
    }
    return (uint16_t)(loops == 0u);
}
