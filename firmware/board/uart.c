/* UART1: polled transmitter at 115200 8N1. */
#include "board/mclv.h"
#include "board/peripherals.h"

void uart_init(void)
{
    U1MODE = 0x0008u; /* BRGH */
    U1BRG = BOARD_U1BRG;
    U1MODE = 0x8008u; /* on, 8N1 */
    U1STAbits.UTXEN = 1;
}

uint16_t uart_send(char c)
{
    if (U1STAbits.UTXBF) {
        return 0;
    }
    U1TXREG = (uint16_t)(uint8_t)c;
    return 1;
}
