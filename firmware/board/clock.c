/* Clock: FRC, then the 8 MHz crystal through the PLL to 40 MIPS, with bounded waits. */
#include "board/mclv.h"
#include "board/peripherals.h"

void clock_write_low(uint16_t low)
{
    __builtin_write_OSCCONL(low);
}

/** @param needs bits of OSCCON that tell that the source is ready @return 0, or 1 if it is not the clock */
static uint16_t clock_switch(uint16_t source, uint16_t needs)
{
    const uint16_t mask = (uint16_t)(0x7000u | needs), ready = (uint16_t)((uint16_t)(source << 12) | needs); /* COSC */
    uint16_t loops;
    __builtin_write_OSCCONH(source);
    clock_write_low((uint16_t)(OSCCON | 0x0001u));
    for (loops = BOARD_WAIT_LOOPS; loops != 0u; loops--) {
        if ((OSCCON & mask) == ready) {
            return 0;
        }
        ClrWdt(); /* the wait is bounded, but longer than the watchdog's time */
    }
    return 1;
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
