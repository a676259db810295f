/* UART1: polled, at 115200 8N1. */
#include "board/mclv.h"
#include "board/peripherals.h"

void uart_init(void)
{
    U1MODE = 0x0008u; /* BRGH */
    U1BRG = BOARD_U1BRG;
    U1MODE = 0x8008u; /* on, 8N1 */
    U1STAbits.UTXEN = 1;
}

int16_t uart_receive(void)
{
    if (U1STAbits.OERR) {
        U1STAbits.OERR = 0; /* the receiver stands still until then */
    }
    return (int16_t)(U1STAbits.URXDA ? (int16_t)(U1RXREG & 0xFFu) : -1);
}
