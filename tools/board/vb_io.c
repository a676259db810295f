/* Pins, timers 1 to 3 and UART1. */
#include "vb_internal.h"

#include <math.h>
#include <string.h>

enum {
    FLTA_RP = 8,         /* the board wires FLTA1 to RB8/RP8 */
    RP_VSS = 31,         /* RPINRx value that ties an input to ground */
    UARTEN = 0x8000,
    BRGH = 0x0008,
    URXDA = 0x0001,
    TRMT = 0x0100,
    UTXBF = 0x0200,
    UTXEN = 0x0400,
    RP_U1TX = 3,         /* RPORx function code */
    TX_EMPTY = 0xFFFF,
    FIFO_DEPTH = 4,
    TON = 0x8000,
    TCS = 0x0002
};

/* Registers of the three ports: what = 0 PORTx, 1 LATx, 2 TRISx. */
static void ports_of(const vb_t *vb, volatile uint16_t *set[3], int what)
{
    const vb_regs_t *r = &vb->reg;
    set[0] = what == 0 ? r->porta : what == 1 ? r->lata : r->trisa;
    set[1] = what == 0 ? r->portb : what == 1 ? r->latb : r->trisb;
    set[2] = what == 0 ? r->portc : what == 1 ? r->latc : r->trisc;
}

/* Levels that the board's circuits give to the pins when these are inputs; everything else is pulled up. */
void vb_io_external_levels(const vb_t *vb, uint16_t level[3])
{
    bool fault = vb->pins.flta != 0.0 || vb->fault.comparator;
    level[0] = (uint16_t)(0x079Fu & ~(vb->pins.s2 != 0.0 ? 1u << 8 : 0u));
    level[1] = (uint16_t)(0xFFFFu & ~(vb->pins.s3 != 0.0 ? 1u << 4 : 0u) & ~(fault ? 1u << FLTA_RP : 0u));
    level[2] = 0x03FFu;
}

unsigned vb_io_pin_level(const vb_t *vb, unsigned port, unsigned bit)
{
    volatile uint16_t *tris[3], *lat[3];
    uint16_t level[3];
    vb_io_external_levels(vb, level);
    ports_of(vb, tris, 2);
    ports_of(vb, lat, 1);
    unsigned value = ((*tris[port] >> bit) & 1u) != 0 ? level[port] : *lat[port];
    return (value >> bit) & 1u;
}

/* A pin that is an analogue input reads 0 as a port bit. */
static void decode_analogue(vb_t *vb)
{
    unsigned an = ~(unsigned)*vb->reg.ad1pcfgl & 0x1FFu;
    vb->pins.analogue[0] = (uint16_t)(an & 3u);
    vb->pins.analogue[1] = (uint16_t)((an >> 2) & 0xFu);
    vb->pins.analogue[2] = (uint16_t)((an >> 6) & 7u);
}

/* Write the port registers. A PORTx that the firmware wrote is taken as a write of the latch, as on silicon; a CPU with a time of its own
 * has done that already. */
void vb_io_ports(vb_t *vb)
{
    volatile uint16_t *port[3], *lat[3], *tris[3];
    uint16_t level[3];
    ports_of(vb, port, 0);
    ports_of(vb, lat, 1);
    ports_of(vb, tris, 2);
    vb_io_external_levels(vb, level);
    decode_analogue(vb);
    for (unsigned p = 0; p < 3; p++) {
        uint16_t now = *port[p];
        if (now != vb->pins.written[p] && vb->live == NULL) {
            *lat[p] = now;
            vb_warn(vb, "PORT%c: the firmware writes the port, LAT%c is the register for outputs", 'A' + (int)p, 'A' + (int)p);
        }
        unsigned in = *tris[p] & level[p] & ~(unsigned)vb->pins.analogue[p];
        uint16_t value = (uint16_t)(in | (*lat[p] & ~(unsigned)*tris[p]));
        *port[p] = value;
        vb->pins.written[p] = value;
    }
}

/* True if the PWM's fault input is low at this instant; RPINR12 chooses the pin. */
bool vb_io_fault_pin(vb_t *vb)
{
    unsigned rp = *vb->reg.rpinr12 & 0x1Fu;
    if (rp == FLTA_RP) {
        return vb_io_pin_level(vb, 1, FLTA_RP) == 0;
    }
    if (vb->pwm.running) {
        vb_warn(vb, "RPINR12: FLTA1R is %u, the board's fault signal is on RP%d%s", rp, FLTA_RP,
                rp == RP_VSS ? "; tied to ground the input is always active" : "");
    }
    if (rp < 16) {
        return vb_io_pin_level(vb, 1, rp) == 0;
    }
    if (rp < 26) {
        return vb_io_pin_level(vb, 2, rp - 16u) == 0;
    }
    return rp == RP_VSS;
}

void vb_io_reset(vb_t *vb)
{
    vb->pins.written[0] = *vb->reg.porta;
    vb->pins.written[1] = *vb->reg.portb;
    vb->pins.written[2] = *vb->reg.portc;
    memset(vb->pins.timer_rest, 0, sizeof vb->pins.timer_rest);
    vb_uart_t *u = &vb->uart;
    u->fifo_count = 0;
    u->rx_count = 0;
    u->sending = false;
    u->presented = false;
    u->enabled = false;
    vb_io_ports(vb);
    if (vb->live == NULL) {
        vb_io_uart_take(vb); /* what the initialisation already sent */
    }
}

static void step_timer(vb_t *vb, unsigned n, unsigned con, volatile uint16_t *tmr, unsigned period, double h_s)
{
    static const double prescale[4] = {1.0, 8.0, 64.0, 256.0};
    static const vb_vector_t vector[3] = {VB_VECTOR_T1, VB_VECTOR_T2, VB_VECTOR_T3};
    if ((con & TON) == 0 || (con & TCS) != 0) {
        return;
    }
    double counts = vb->pins.timer_rest[n] + h_s * vb->pwm.fcy_hz / prescale[(con >> 4) & 3u] + 1e-6;
    double whole = floor(counts);
    vb->pins.timer_rest[n] = counts - whole - 1e-6;
    uint32_t value = (uint32_t)*tmr + (uint32_t)whole;
    bool match = value > period;
    *tmr = (uint16_t)(match ? value % (period + 1u) : value);
    if (match) {
        (void)vb_raise(vb, vector[n]);
    }
}

void vb_io_timers(vb_t *vb, double h_s)
{
    const vb_regs_t *r = &vb->reg;
    step_timer(vb, 0, *r->t1con, r->tmr1, *r->pr1, h_s);
    step_timer(vb, 1, *r->t2con, r->tmr2, *r->pr2, h_s);
    step_timer(vb, 2, *r->t3con, r->tmr3, *r->pr3, h_s);
}

/* Time of one character on the line: start, eight or nine bits, one or two stop bits. */
static double character_s(vb_t *vb)
{
    unsigned mode = *vb->reg.u1mode;
    double divider = (mode & BRGH) != 0 ? 4.0 : 16.0;
    vb->uart.baud = vb->pwm.fcy_hz / (divider * ((double)*vb->reg.u1brg + 1.0));
    double bits = 10.0 + (((mode >> 1) & 3u) != 0 ? 1.0 : 0.0) + ((mode & 1u) != 0 ? 1.0 : 0.0);
    return bits / vb->uart.baud;
}

static bool tx_is_mapped(const vb_t *vb)
{
    const vb_regs_t *r = &vb->reg;
    const volatile uint16_t *rpor[13] = {r->rpor0, r->rpor1, r->rpor2, r->rpor3,  r->rpor4,  r->rpor5, r->rpor6,
                                         r->rpor7, r->rpor8, r->rpor9, r->rpor10, r->rpor11, r->rpor12};
    for (unsigned n = 0; n < 13; n++) {
        if ((*rpor[n] & 0x1Fu) == RP_U1TX || ((*rpor[n] >> 8) & 0x1Fu) == RP_U1TX) {
            return true;
        }
    }
    return false;
}

static void show_tx_state(vb_t *vb)
{
    unsigned sta = *vb->reg.u1sta & ~(unsigned)(UTXBF | TRMT);
    sta |= vb->uart.fifo_count >= FIFO_DEPTH ? (unsigned)UTXBF : 0u;
    sta |= !vb->uart.sending && vb->uart.fifo_count == 0 ? (unsigned)TRMT : 0u;
    *vb->reg.u1sta = (uint16_t)sta;
}

static void start_next_character(vb_t *vb)
{
    vb_uart_t *u = &vb->uart;
    u->sending = u->fifo_count > 0;
    if (!u->sending) {
        return;
    }
    if (u->tx_count < VB_UART_TX) {
        u->tx[u->tx_count++] = (char)u->fifo[0];
    } else {
        u->lost += 1.0;
    }
    memmove(u->fifo, u->fifo + 1, FIFO_DEPTH - 1);
    u->fifo_count--;
    u->tx_busy_s += character_s(vb);
}

/* Take a character that the firmware wrote to U1TXREG. */
void vb_io_uart_take(vb_t *vb)
{
    vb_uart_t *u = &vb->uart;
    uint16_t value = *vb->reg.u1txreg;
    if (value == TX_EMPTY) {
        return;
    }
    *vb->reg.u1txreg = TX_EMPTY;
    if ((*vb->reg.u1mode & UARTEN) == 0 || (*vb->reg.u1sta & UTXEN) == 0) {
        vb_warn(vb, "U1TXREG: a character was written while UARTEN (U1MODE) or UTXEN (U1STA) is 0, it is lost");
        return;
    }
    if (!tx_is_mapped(vb)) {
        vb_warn(vb, "RPOR9: no pin has the function U1TX (3), what the firmware sends does not leave the device");
        return;
    }
    if (u->fifo_count >= FIFO_DEPTH) {
        vb_warn(vb, "U1STA: a character was written while UTXBF was set, it is lost");
        u->lost += 1.0;
        return;
    }
    u->fifo[u->fifo_count++] = (uint8_t)value;
    if (!u->sending) {
        u->tx_busy_s = 0.0;
        start_next_character(vb);
    }
    show_tx_state(vb);
}

static void step_receiver(vb_t *vb, double h_s)
{
    vb_uart_t *u = &vb->uart;
    if (u->presented) { /* the firmware has had a pass of its main loop to read it */
        u->presented = false;
        *vb->reg.u1sta = (uint16_t)(*vb->reg.u1sta & ~(unsigned)URXDA);
    }
    if (u->rx_count == 0) {
        return;
    }
    if ((*vb->reg.u1mode & UARTEN) == 0 || (*vb->reg.rpinr18 & 0x1Fu) == RP_VSS) {
        vb_warn(vb, "RPINR18: characters arrive but U1RX has no pin or UARTEN (U1MODE) is 0");
        u->rx_count = 0;
        return;
    }
    u->rx_busy_s += h_s;
    double needed_s = character_s(vb);
    if (u->rx_busy_s < needed_s) {
        return;
    }
    u->rx_busy_s = vb_min(u->rx_busy_s - needed_s, needed_s);
    *vb->reg.u1rxreg = (uint16_t)(uint8_t)u->rx[u->rx_head];
    *vb->reg.u1sta = (uint16_t)(*vb->reg.u1sta | URXDA);
    u->rx_head = (u->rx_head + 1u) % VB_UART_RX;
    u->rx_count--;
    u->presented = true;
    (void)vb_raise(vb, VB_VECTOR_U1RX);
}

/* The line moves on by `h_s`; called after each pass of the main loop. */
void vb_io_uart_step(vb_t *vb, double h_s)
{
    vb_uart_t *u = &vb->uart;
    bool enabled = (*vb->reg.u1mode & UARTEN) != 0 && (*vb->reg.u1sta & UTXEN) != 0;
    if (enabled && !u->enabled) {
        (void)vb_raise(vb, VB_VECTOR_U1TX); /* enabling the transmitter sets its flag */
    }
    u->enabled = enabled;
    if (u->sending) {
        u->tx_busy_s -= h_s;
        while (u->sending && u->tx_busy_s <= 0.0) {
            start_next_character(vb);
            (void)vb_raise(vb, VB_VECTOR_U1TX);
        }
        show_tx_state(vb);
    }
    if (u->rx_count > 0 || u->presented) {
        step_receiver(vb, h_s);
    }
}

size_t vb_uart_read(vb_t *vb, char *text, size_t size)
{
    vb_uart_t *u = &vb->uart;
    size_t count = size < u->tx_count ? size : u->tx_count;
    memcpy(text, u->tx, count);
    memmove(u->tx, u->tx + count, u->tx_count - count);
    u->tx_count -= count;
    return count;
}

size_t vb_uart_write(vb_t *vb, const char *text, size_t size)
{
    vb_uart_t *u = &vb->uart;
    size_t count = 0;
    while (count < size && u->rx_count < VB_UART_RX) {
        u->rx[(u->rx_head + u->rx_count) % VB_UART_RX] = text[count];
        u->rx_count++;
        count++;
    }
    return count;
}
