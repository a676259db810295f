/* UART1: four-deep buffers, characters at the configured rate, interrupts after UTXISEL and URXISEL, loop-back. */
#include "sfr_internal.h"

#include <string.h>

enum {
    UARTEN = 0x8000, /* U1MODE */
    LPBACK = 0x0040,
    BRGH = 0x0008,
    URXDA = 0x0001,  /* U1STA */
    OERR = 0x0002,
    RIDLE = 0x0010,
    TRMT = 0x0100,
    UTXBF = 0x0200,
    UTXEN = 0x0400,
    STATUS = URXDA | OERR | 0x000C | RIDLE | TRMT | UTXBF,
    RP_U1TX = 3,     /* RPORx */
    RP_VSS = 31,     /* RPINR18 */
    U1RXIF = 11,     /* bits in IFS0 */
    U1TXIF = 12
};

static uint64_t character_cycles(const soc_t *soc)
{
    unsigned mode = soc_get(soc, SFR_U1MODE);
    uint64_t bit = ((uint64_t)soc_get(soc, SFR_U1BRG) + 1u) * ((mode & BRGH) != 0 ? 4u : 16u);
    unsigned bits = 10u + (((mode >> 1) & 3u) != 0 ? 1u : 0u) + (mode & 1u);
    return bit * bits;
}

static bool can_send(const soc_t *soc)
{
    return (soc_get(soc, SFR_U1MODE) & UARTEN) != 0 && (soc_get(soc, SFR_U1STA) & UTXEN) != 0;
}

static bool can_receive(const soc_t *soc)
{
    return (soc_get(soc, SFR_U1MODE) & UARTEN) != 0;
}

static void show_state(soc_t *soc)
{
    const soc_uart_t *u = &soc->uart;
    unsigned sta = soc_get(soc, SFR_U1STA) & ~(unsigned)(URXDA | RIDLE | TRMT | UTXBF);
    sta |= u->tx_count >= SOC_FIFO ? (unsigned)UTXBF : 0u;
    sta |= !u->sending && u->tx_count == 0 ? (unsigned)TRMT : 0u;
    sta |= u->rx_count > 0 ? (unsigned)URXDA : 0u;
    sta |= !u->receiving ? (unsigned)RIDLE : 0u;
    soc_put(soc, SFR_U1STA, sta);
}

/* UTXISEL: 0 a place in the buffer is free, 1 everything has left, 2 the buffer is empty. */
static unsigned transmit_mode(const soc_t *soc)
{
    unsigned sta = soc_get(soc, SFR_U1STA);
    return ((sta >> 14) & 2u) | ((sta >> 13) & 1u);
}

static void start_character(soc_t *soc)
{
    soc_uart_t *u = &soc->uart;
    u->shift = u->tx[0];
    memmove(u->tx, u->tx + 1, SOC_FIFO - 1);
    u->tx_count--;
    u->sending = true;
    soc_schedule(soc, SOC_SEND, soc_now(soc) + character_cycles(soc));
    unsigned mode = transmit_mode(soc);
    if (mode == 0 || (mode == 2 && u->tx_count == 0)) {
        soc_flag(soc, SFR_IFS0, U1TXIF);
    }
}

static void receive_character(soc_t *soc, uint8_t character)
{
    soc_uart_t *u = &soc->uart;
    if (u->rx_count >= SOC_FIFO) {
        soc_put(soc, SFR_U1STA, soc_get(soc, SFR_U1STA) | OERR);
        return;
    }
    u->rx[u->rx_count++] = character;
    unsigned mode = (soc_get(soc, SFR_U1STA) >> 6) & 3u;
    if (mode < 2 || u->rx_count == mode + 1u) {
        soc_flag(soc, SFR_IFS0, U1RXIF);
    }
}

/* The last bit of a character has left the chip. */
void soc_uart_sent(soc_t *soc)
{
    soc_uart_t *u = &soc->uart;
    u->sending = false;
    if ((soc_get(soc, SFR_U1MODE) & LPBACK) != 0) {
        receive_character(soc, u->shift);
    } else if (!soc_pin_has_function(soc, RP_U1TX)) {
        soc_note(soc, "RPOR9: no pin has the function U1TX (3), what the firmware sends does not leave the device");
    } else if (soc->board.send != NULL) {
        soc->board.send(soc->board.context, u->shift);
    }
    if (u->tx_count > 0) {
        start_character(soc);
    } else if (transmit_mode(soc) == 1) {
        soc_flag(soc, SFR_IFS0, U1TXIF);
    }
    show_state(soc);
}

static void write_character(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    soc_uart_t *u = &soc->uart;
    (void)mask;
    soc_put(soc, address, value & 0x1FFu);
    if (!can_send(soc)) {
        soc_note(soc, "U1TXREG: a character was written while UARTEN (U1MODE) or UTXEN (U1STA) is 0, it is lost");
        return;
    }
    if (u->tx_count >= SOC_FIFO) {
        soc_note(soc, "U1STA: a character was written while UTXBF was set, it is lost");
        return;
    }
    u->tx[u->tx_count++] = (uint8_t)value;
    if (!u->sending) {
        start_character(soc);
    }
    show_state(soc);
}

static uint16_t read_character(void *context, uint16_t address)
{
    soc_t *soc = context;
    soc_uart_t *u = &soc->uart;
    uint16_t value = soc_get(soc, address);
    if (u->rx_count > 0) {
        value = u->rx[0];
        memmove(u->rx, u->rx + 1, SOC_FIFO - 1);
        u->rx_count--;
        soc_put(soc, address, value);
        show_state(soc);
    }
    return value;
}

static void write_status(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    uint16_t before = soc_get(soc, address);
    uint16_t wanted = soc_merged(soc, address, value, mask);
    soc_put(soc, address, (wanted & ~(unsigned)STATUS) | (before & STATUS));
    if ((before & OERR) != 0 && (wanted & OERR) == 0) {
        soc->uart.rx_count = 0; /* clearing the overrun empties the buffer */
        soc_put(soc, address, soc_get(soc, address) & ~(unsigned)OERR);
    }
    if ((before & UTXEN) == 0 && can_send(soc)) {
        soc_flag(soc, SFR_IFS0, U1TXIF); /* the empty buffer is news to an enabled transmitter */
    }
    show_state(soc);
}

static void write_mode(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    soc_put(soc, address, soc_merged(soc, address, value, mask));
    if (!can_receive(soc)) {
        soc_uart_reset(soc);
    }
    soc_uart_wake(soc);
}

/* Fetch the next character for the receiver, if it is idle and there is one. */
void soc_uart_wake(soc_t *soc)
{
    soc_uart_t *u = &soc->uart;
    if (u->receiving || soc->board.receive == NULL || !can_receive(soc)) {
        return;
    }
    int character = soc->board.receive(soc->board.context);
    if (character < 0) {
        return;
    }
    if ((soc_get(soc, SFR_RPINR18) & 0x1Fu) == RP_VSS) {
        soc_note(soc, "RPINR18: characters arrive but U1RX has no pin");
        return;
    }
    u->incoming = (uint8_t)character;
    u->receiving = true;
    soc_schedule(soc, SOC_RECEIVE, soc_now(soc) + character_cycles(soc));
    show_state(soc);
}

void soc_uart_received(soc_t *soc)
{
    soc->uart.receiving = false;
    receive_character(soc, soc->uart.incoming);
    soc_uart_wake(soc);
    show_state(soc);
}

void soc_uart_hooks(soc_t *soc)
{
    iss_sfr_hook(soc->iss, SFR_U1MODE, NULL, write_mode, soc);
    iss_sfr_hook(soc->iss, SFR_U1STA, NULL, write_status, soc);
    iss_sfr_hook(soc->iss, SFR_U1TXREG, NULL, write_character, soc);
    iss_sfr_hook(soc->iss, SFR_U1RXREG, read_character, NULL, soc);
}

void soc_uart_reset(soc_t *soc)
{
    soc->uart = (soc_uart_t){0};
    soc->event[SOC_SEND] = SOC_NEVER;
    soc->event[SOC_RECEIVE] = SOC_NEVER;
    soc_put(soc, SFR_U1STA, soc_get(soc, SFR_U1STA) & ~(unsigned)(OERR | 0x000C));
    show_state(soc);
}
