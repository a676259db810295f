/* The board's serial line: texts both ways, and a pseudo-terminal for those who want to talk to the firmware by hand. */
#define _XOPEN_SOURCE 600
#include "vb_state.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

size_t vb_uart_read(vb_t *vb, char *text, size_t size)
{
    vb_serial_t *s = &vb->serial;
    size_t count = size < s->tx_count ? size : s->tx_count;
    memcpy(text, s->tx, count);
    memmove(s->tx, s->tx + count, s->tx_count - count);
    s->tx_count -= count;
    return count;
}

size_t vb_uart_write(vb_t *vb, const char *text, size_t size)
{
    vb_serial_t *s = &vb->serial;
    size_t count = 0;
    while (count < size && s->rx_count < VB_UART_RX) {
        s->rx[(s->rx_head + s->rx_count) % VB_UART_RX] = text[count];
        s->rx_count++;
        count++;
    }
    return count;
}

/* A character from UART1. A terminal that does not read loses some, as a real one would. */
void vb_serial_send(void *context, uint8_t character)
{
    vb_t *vb = context;
    vb_serial_t *s = &vb->serial;
    if (vb->wiring.uart_rp != 0.0 && !chip_ports_pin_has_function(&vb->chip, (unsigned)vb->wiring.uart_rp, CHIP_FUNCTION_U1TX)) {
        return;
    }
    if (s->tx_count < VB_UART_TX) {
        s->tx[s->tx_count++] = (char)character;
    } else {
        vb->chip.uart.lost += 1.0;
    }
    if (s->master >= 0) {
        ssize_t written = write(s->master, &character, 1);
        (void)written;
    }
}

/* The next character for UART1, -1: none. */
int vb_serial_receive(void *context)
{
    vb_t *vb = context;
    vb_serial_t *s = &vb->serial;
    uint8_t character = 0;
    if (s->rx_count > 0) {
        character = (uint8_t)s->rx[s->rx_head];
        s->rx_head = (s->rx_head + 1u) % VB_UART_RX;
        s->rx_count--;
        return character;
    }
    return s->master >= 0 && read(s->master, &character, 1) == 1 ? character : -1;
}

/* ---- the pseudo-terminal ---- */

static bool make_raw(int file)
{
    struct termios settings;
    if (tcgetattr(file, &settings) != 0) {
        return false;
    }
    settings.c_iflag = 0;
    settings.c_oflag = 0;
    settings.c_lflag = 0;
    settings.c_cflag = CS8 | CREAD | CLOCAL;
    return tcsetattr(file, TCSANOW, &settings) == 0;
}

/* Both ends: the slave is kept open, or reading fails whenever no terminal program is there. */
static bool open_both(vb_serial_t *s, char *path, size_t size)
{
    s->master = posix_openpt(O_RDWR | O_NOCTTY);
    if (s->master < 0 || grantpt(s->master) != 0 || unlockpt(s->master) != 0) {
        return false;
    }
    const char *name = ptsname(s->master);
    if (name == NULL || strlen(name) >= size) {
        return false;
    }
    memcpy(path, name, strlen(name) + 1u);
    s->slave = open(name, O_RDWR | O_NOCTTY);
    return s->slave >= 0 && make_raw(s->slave) && fcntl(s->master, F_SETFL, O_NONBLOCK) == 0;
}

int vb_terminal(vb_t *vb, char *path, size_t size)
{
    vb_serial_close(vb);
    if (!open_both(&vb->serial, path, size)) {
        vb_serial_close(vb);
        return vb_fail(vb, "no pseudo-terminal can be opened");
    }
    return 0;
}

void vb_serial_close(vb_t *vb)
{
    vb_serial_t *s = &vb->serial;
    if (s->slave >= 0) {
        (void)close(s->slave);
    }
    if (s->master >= 0) {
        (void)close(s->master);
    }
    s->slave = s->master = -1;
}
