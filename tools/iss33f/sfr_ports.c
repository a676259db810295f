/* Ports and peripheral pin select: PORTx reads the pins and writes the latch, RPINRx and RPORx obey IOLOCK. */
#include "sfr_internal.h"

static const uint16_t port_address[3] = {SFR_PORTA, SFR_PORTB, SFR_PORTC};
enum { TRIS_BEFORE = 2, LAT_BEHIND = 2 }; /* TRISx, PORTx and LATx follow each other */

static unsigned port_of(uint16_t address)
{
    return address == SFR_PORTA ? 0u : address == SFR_PORTB ? 1u : 2u;
}

/* A pin that is an analogue input reads 0. AN0, 1 are RA0, 1; AN2..5 RB0..3; AN6..8 RC0..2. */
static uint16_t analogue_pins(const soc_t *soc, unsigned port)
{
    static const unsigned shift[3] = {0, 2, 6};
    static const uint16_t mask[3] = {0x3, 0xF, 0x7};
    unsigned analogue = ~(unsigned)soc_get(soc, SFR_AD1PCFGL) & 0x1FFu;
    return (uint16_t)((analogue >> shift[port]) & mask[port]);
}

static uint16_t read_port(void *context, uint16_t address)
{
    static const uint16_t implemented[3] = {0x079F, 0xFFFF, 0x03FF};
    soc_t *soc = context;
    unsigned port = port_of(address);
    unsigned level = soc->board.pins != NULL ? soc->board.pins(soc->board.context, port) : 0xFFFFu;
    unsigned tris = soc_get(soc, (uint16_t)(address - TRIS_BEFORE));
    unsigned lat = soc_get(soc, (uint16_t)(address + LAT_BEHIND));
    unsigned value = ((tris & level & ~(unsigned)analogue_pins(soc, port)) | (lat & ~tris)) & implemented[port];
    soc_put(soc, address, value);
    return (uint16_t)value;
}

static void write_port(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    uint16_t lat = (uint16_t)(address + LAT_BEHIND);
    soc_put(soc, lat, soc_merged(soc, lat, value, mask));
    soc_note(soc, port_of(address) == 0 ? "PORTA: the firmware writes the port, LATA is the register for outputs"
                  : port_of(address) == 1 ? "PORTB: the firmware writes the port, LATB is the register for outputs"
                                          : "PORTC: the firmware writes the port, LATC is the register for outputs");
}

static void write_selection(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    if (soc_pins_locked(soc)) {
        soc_note(soc, "OSCCON: a pin selection is written while IOLOCK is set, nothing happens");
        return;
    }
    soc_put(soc, address, soc_merged(soc, address, value, mask) & 0x1F1Fu);
}

/* True if some RPn pin is the output of this peripheral. */
bool soc_pin_has_function(const soc_t *soc, unsigned function)
{
    for (uint16_t address = SFR_RPOR0; address <= SFR_RPOR12; address = (uint16_t)(address + 2u)) {
        unsigned rpor = soc_get(soc, address);
        if ((rpor & 0x1Fu) == function || ((rpor >> 8) & 0x1Fu) == function) {
            return true;
        }
    }
    return false;
}

void soc_ports_hooks(soc_t *soc)
{
    for (unsigned port = 0; port < 3; port++) {
        iss_sfr_hook(soc->iss, port_address[port], read_port, write_port, soc);
    }
    for (uint16_t address = SFR_RPINR0; address <= SFR_RPOR12; address = (uint16_t)(address + 2u)) {
        if (soc_register_name(address) != NULL) {
            iss_sfr_hook(soc->iss, address, NULL, write_selection, soc);
        }
    }
}
