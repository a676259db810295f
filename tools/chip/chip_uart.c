/* UART1: four-deep buffers, characters at the configured rate, interrupts after UTXISEL and URXISEL, loop-back. */
#include "chip.h"

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
    RP_VSS = 31      /* RPINR18 */
};

static uint64_t character_cycles(const chip_t *chip)
{
    unsigned mode = chip_get(chip, SFR_U1MODE);
    uint64_t bit = ((uint64_t)chip_get(chip, SFR_U1BRG) + 1u) * ((mode & BRGH) != 0 ? 4u : 16u);
    unsigned bits = 10u + (((mode >> 1) & 3u) != 0 ? 1u : 0u) + (mode & 1u);
    return bit * bits;
}

static bool can_send(const chip_t *chip)
{
    return (chip_get(chip, SFR_U1MODE) & UARTEN) != 0 && (chip_get(chip, SFR_U1STA) & UTXEN) != 0;
}

static bool can_receive(const chip_t *chip)
{
    return (chip_get(chip, SFR_U1MODE) & UARTEN) != 0;
}

static void show_state(chip_t *chip)
{
    const chip_uart_t *u = &chip->uart;
    unsigned sta = chip_get(chip, SFR_U1STA) & ~(unsigned)(URXDA | RIDLE | TRMT | UTXBF);
    sta |= u->tx_count >= CHIP_FIFO ? (unsigned)UTXBF : 0u;
    sta |= !u->sending && u->tx_count == 0 ? (unsigned)TRMT : 0u;
    sta |= u->rx_count > 0 ? (unsigned)URXDA : 0u;
    sta |= !u->receiving ? (unsigned)RIDLE : 0u;
    chip_put(chip, SFR_U1STA, sta);
}

/* UTXISEL: 0 a place in the buffer is free, 1 everything has left, 2 the buffer is empty. */
static unsigned transmit_mode(const chip_t *chip)
{
    unsigned sta = chip_get(chip, SFR_U1STA);
    return ((sta >> 14) & 2u) | ((sta >> 13) & 1u);
}

static void start_character(chip_t *chip)
{
    chip_uart_t *u = &chip->uart;
    double divider = (chip_get(chip, SFR_U1MODE) & BRGH) != 0 ? 4.0 : 16.0;
    u->baud = chip->clock.fcy_hz / (divider * ((double)chip_get(chip, SFR_U1BRG) + 1.0));
    u->shift = u->tx[0];
    memmove(u->tx, u->tx + 1, CHIP_FIFO - 1);
    u->tx_count--;
    u->sending = true;
    chip_schedule(chip, CHIP_EVENT_SEND, chip_now(chip) + character_cycles(chip));
    unsigned mode = transmit_mode(chip);
    if (mode == 0 || (mode == 2 && u->tx_count == 0)) {
        (void)chip_irq_raise(chip, CHIP_IRQ_U1TX);
    }
}

static void receive_character(chip_t *chip, uint8_t character)
{
    chip_uart_t *u = &chip->uart;
    if (u->rx_count >= CHIP_FIFO) {
        chip_put(chip, SFR_U1STA, chip_get(chip, SFR_U1STA) | OERR);
        return;
    }
    u->rx[u->rx_count++] = character;
    unsigned mode = (chip_get(chip, SFR_U1STA) >> 6) & 3u;
    if (mode < 2 || u->rx_count == mode + 1u) {
        (void)chip_irq_raise(chip, CHIP_IRQ_U1RX);
    }
}

/* The last bit of a character has left the chip. */
void chip_uart_sent(chip_t *chip)
{
    chip_uart_t *u = &chip->uart;
    u->sending = false;
    if ((chip_get(chip, SFR_U1MODE) & LPBACK) != 0) {
        receive_character(chip, u->shift);
    } else if (!chip_ports_have_function(chip, CHIP_FUNCTION_U1TX)) {
        chip_warn(chip, "RPOR9: no pin has the function U1TX (3), what the firmware sends does not leave the device");
    } else if (chip->board.send != NULL) {
        chip->board.send(chip->board.context, u->shift);
    }
    if (u->tx_count > 0) {
        start_character(chip);
    } else if (transmit_mode(chip) == 1) {
        (void)chip_irq_raise(chip, CHIP_IRQ_U1TX);
    }
    show_state(chip);
}

static void write_character(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    chip_uart_t *u = &chip->uart;
    (void)mask;
    chip_put(chip, address, value & 0x1FFu);
    if (!can_send(chip)) {
        chip_warn(chip, "U1TXREG: a character was written while UARTEN (U1MODE) or UTXEN (U1STA) is 0, it is lost");
        return;
    }
    if (u->tx_count >= CHIP_FIFO) {
        chip_warn(chip, "U1STA: a character was written while UTXBF was set, it is lost");
        u->lost += 1.0;
        return;
    }
    u->tx[u->tx_count++] = (uint8_t)value;
    if (!u->sending) {
        start_character(chip);
    }
    show_state(chip);
}

static uint16_t read_character(void *context, uint16_t address)
{
    chip_t *chip = context;
    chip_uart_t *u = &chip->uart;
    uint16_t value = chip_get(chip, address);
    if (u->rx_count > 0) {
        value = u->rx[0];
        memmove(u->rx, u->rx + 1, CHIP_FIFO - 1);
        u->rx_count--;
        chip_put(chip, address, value);
        show_state(chip);
    }
    return value;
}

static void write_status(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    uint16_t before = chip_get(chip, address);
    uint16_t wanted = chip_merged(chip, address, value, mask);
    chip_put(chip, address, (wanted & ~(unsigned)STATUS) | (before & STATUS));
    if ((before & OERR) != 0 && (wanted & OERR) == 0) {
        chip->uart.rx_count = 0; /* clearing the overrun empties the buffer */
        chip_put(chip, address, chip_get(chip, address) & ~(unsigned)OERR);
    }
    if ((before & UTXEN) == 0 && can_send(chip)) {
        (void)chip_irq_raise(chip, CHIP_IRQ_U1TX); /* the empty buffer is news to an enabled transmitter */
    }
    show_state(chip);
}

static void write_mode(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    chip_put(chip, address, chip_merged(chip, address, value, mask));
    if (!can_receive(chip)) {
        chip_uart_reset(chip);
    }
    chip_uart_wake(chip);
}

/* Fetch the next character for the receiver, if it is idle and there is one. */
void chip_uart_wake(chip_t *chip)
{
    chip_uart_t *u = &chip->uart;
    if (u->receiving || chip->board.receive == NULL || !can_receive(chip)) {
        return;
    }
    int character = chip->board.receive(chip->board.context);
    if (character < 0) {
        return;
    }
    if ((chip_get(chip, SFR_RPINR18) & 0x1Fu) == RP_VSS) {
        chip_warn(chip, "RPINR18: characters arrive but U1RX has no pin");
        return;
    }
    u->incoming = (uint8_t)character;
    u->receiving = true;
    chip_schedule(chip, CHIP_EVENT_RECEIVE, chip_now(chip) + character_cycles(chip));
    show_state(chip);
}

void chip_uart_received(chip_t *chip)
{
    chip->uart.receiving = false;
    receive_character(chip, chip->uart.incoming);
    chip_uart_wake(chip);
    show_state(chip);
}

void chip_uart_hooks(chip_t *chip)
{
    chip_hook(chip, SFR_U1MODE, NULL, write_mode);
    chip_hook(chip, SFR_U1STA, NULL, write_status);
    chip_hook(chip, SFR_U1TXREG, NULL, write_character);
    chip_hook(chip, SFR_U1RXREG, read_character, NULL);
}

void chip_uart_reset(chip_t *chip)
{
    chip->uart = (chip_uart_t){.baud = chip->uart.baud, .lost = chip->uart.lost};
    chip->event[CHIP_EVENT_SEND] = CHIP_NEVER;
    chip->event[CHIP_EVENT_RECEIVE] = CHIP_NEVER;
    chip_put(chip, SFR_U1STA, chip_get(chip, SFR_U1STA) & ~(unsigned)(OERR | 0x000C));
    show_state(chip);
}
