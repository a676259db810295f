/* The button S2 on the port's register. */
#ifndef TEST_UNIT_SUPPORT_PRESS_S2_H
#define TEST_UNIT_SUPPORT_PRESS_S2_H

#include <stdint.h>
#include <xc.h>

/** The test's own: the board runs for so many milliseconds. */
static void board_ms(uint16_t count);

/** Down and up again, both for longer than it bounces. */
static void press_s2(void)
{
    PORTAbits.RA8 = 0;
    board_ms(40);
    PORTAbits.RA8 = 1;
    board_ms(10);
}

#endif
