/* Pins: directions, analogue inputs, remappable functions. */
#include "board/mclv.h"
#include "board/peripherals.h"

void pins_init(void)
{
    AD1PCFGL = BOARD_AD1PCFGL;
    LATA = 0;
    LATB = 0;
    LATC = 0;
    TRISA = BOARD_TRIS(A);
    TRISB = BOARD_TRIS(B);
    TRISC = BOARD_TRIS(C);

    clock_write_low((uint16_t)(OSCCON & ~0x0040u)); /* unlock the pin selection */
    RPINR12 = BOARD_FLTA_RP;
    RPINR18 = 0x1F00u | BOARD_UART_RX_RP; /* U1CTS stays without a pin */
    BOARD_UART_TX_PIN = BOARD_UART_TX_FUNCTION;
    clock_write_low((uint16_t)(OSCCON | 0x0040u));
}
