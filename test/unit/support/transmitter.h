/* What the UART is given, a character a pass. */
#ifndef TEST_UNIT_SUPPORT_TRANSMITTER_H
#define TEST_UNIT_SUPPORT_TRANSMITTER_H

#include <stdint.h>
#include <string.h>
#include <xc.h>

static char sent[1024];
static uint16_t sent_count;

static inline void transmitter_begins(void)
{
    host_registers_reset();
    memset(sent, 0, sizeof sent);
    sent_count = 0;
}

/** After a pass. */
static inline void transmitter_takes(void)
{
    if (U1TXREG != HOST_U1TXREG_EMPTY) {
        sent[sent_count] = (char)U1TXREG;
        sent_count = (uint16_t)((sent_count + 1u) % sizeof sent);
        sent[sent_count] = '\0';
        U1TXREG = HOST_U1TXREG_EMPTY;
    }
}

#endif
