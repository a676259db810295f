/* Clock: FRC, then the 8 MHz crystal through the PLL to 40 MIPS, with bounded waits. */
#include "board/mclv.h"
#include "board/peripherals.h"

/** @param needs bits of OSCCON that tell that the source is ready @return 0, or 1 if it is not the clock */
static uint16_t clock_switch(uint16_t source, uint16_t needs)
{
    uint16_t loops = BOARD_WAIT_LOOPS;
    __builtin_write_OSCCONH(source);
    __builtin_write_OSCCONL(OSCCON | 0x0001u);
    while ((OSCCONbits.COSC != source || (OSCCON & needs) != needs) && loops != 0u) {
        loops--;
        ClrWdt(); /* the wait is bounded, but longer than the watchdog's time */
    }
    return (uint16_t)(loops == 0u);
}

uint16_t clock_init(void)
{
    /* After any reset but power-on the old clock goes on, and a PLL that is in use must not be changed. */
    if (OSCCONbits.COSC != BOARD_NOSC_FRC && clock_switch(BOARD_NOSC_FRC, 0)) {
        return 1;
    }
    PLLFBD = BOARD_PLLFBD;
    CLKDIV = BOARD_CLKDIV;
    OSCTUN = 0;
    return clock_switch(BOARD_NOSC_PRIPLL, BOARD_OSCCON_LOCK);
}
