/* Timer 1: a millisecond that does not depend on the control interrupt and therefore can supervise it. */
#include "board/mclv.h"
#include "board/peripherals.h"

void timer_init(void)
{
    T1CON = 0;
    TMR1 = 0;
    PR1 = (uint16_t)(BOARD_FCY_HZ / 1000ul - 1ul);
    IFS0bits.T1IF = 0;
    T1CON = 0x8000u;
}
