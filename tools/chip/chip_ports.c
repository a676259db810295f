/* Ports and peripheral pin select: PORTx reads the pins and writes the latch, RPINRx and RPORx obey IOLOCK. */
#include "chip.h"

static const uint16_t port_address[3] = {SFR_PORTA, SFR_PORTB, SFR_PORTC};
enum { TRIS_BEFORE = 2, LAT_BEHIND = 2, RP_VSS = 31, RP_PINS = 26 }; /* TRISx, PORTx and LATx follow each other; RPINRx = 31 ties an input to ground */

static unsigned port_of(uint16_t address)
{
    return address == SFR_PORTA ? 0u : address == SFR_PORTB ? 1u : 2u;
}

/* A pin that is an analogue input reads 0. AN0, 1 are RA0, 1; AN2..5 RB0..3; AN6..8 RC0..2. */
static uint16_t analogue_pins(const chip_t *chip, unsigned port)
{
    static const unsigned shift[3] = {0, 2, 6};
    static const uint16_t mask[3] = {0x3, 0xF, 0x7};
    unsigned analogue = ~(unsigned)chip_get(chip, SFR_AD1PCFGL) & 0x1FFu;
    return (uint16_t)((analogue >> shift[port]) & mask[port]);
}

/* Levels of the pins of a port as its bits read; `external` where they are digital inputs. */
static unsigned port_value(const chip_t *chip, unsigned port, unsigned external)
{
    static const uint16_t implemented[3] = {0x079F, 0xFFFF, 0x03FF};
    unsigned tris = chip_get(chip, port_address[port] - TRIS_BEFORE);
    unsigned lat = chip_get(chip, port_address[port] + LAT_BEHIND);
    return ((tris & external & ~(unsigned)analogue_pins(chip, port)) | (lat & ~tris)) & implemented[port];
}

static void external_levels(const chip_t *chip, uint16_t level[3])
{
    level[0] = level[1] = level[2] = 0xFFFF;
    if (chip->board.levels != NULL) {
        chip->board.levels(chip->board.context, level);
    }
}

/* PORTx as they are now, for who reads them without a hook. */
void chip_ports_show(chip_t *chip)
{
    uint16_t level[3];
    external_levels(chip, level);
    for (unsigned port = 0; port < 3; port++) {
        chip_put(chip, port_address[port], port_value(chip, port, level[port]));
    }
}

/* Level of a pin itself, analogue or not. */
unsigned chip_ports_pin(const chip_t *chip, unsigned port, unsigned bit)
{
    uint16_t level[3];
    external_levels(chip, level);
    unsigned input = (unsigned)chip_get(chip, port_address[port] - TRIS_BEFORE) >> bit & 1u;
    return (input != 0 ? (unsigned)level[port] : chip_get(chip, port_address[port] + LAT_BEHIND)) >> bit & 1u;
}

/* Level that a peripheral reads at RPn: RP0 to 15 are port B, the others port C. An analogue pin, ground and what does not exist read low. */
bool chip_ports_rp(const chip_t *chip, unsigned rp)
{
    unsigned port = rp < 16 ? 1u : 2u, bit = rp % 16u;
    return rp < RP_PINS && (analogue_pins(chip, port) >> bit & 1u) == 0 && chip_ports_pin(chip, port, bit) != 0;
}

/* False where the firmware leaves the fault input alone on purpose: no pin, and no pair follows it. */
bool chip_ports_fault_used(chip_t *chip)
{
    return (CHIP_REG(chip, RPINR12) & 0x1Fu) != RP_VSS || (CHIP_REG(chip, P1FLTACON) & 7u) != 0;
}

/* True if the PWM's fault input is low at this instant; RPINR12 chooses the pin. */
bool chip_ports_fault(chip_t *chip)
{
    unsigned rp = CHIP_REG(chip, RPINR12) & 0x1Fu;
    if (rp != chip->board.fault_rp && chip->pwm.running && chip_ports_fault_used(chip)) {
        chip_warn(chip, "RPINR12: FLTA1R is %u, the board's fault signal is on RP%u%s", rp, chip->board.fault_rp,
                  rp == RP_VSS ? "; tied to ground the input is always active" : "");
    }
    return (rp < RP_PINS || rp == RP_VSS) && !chip_ports_rp(chip, rp);
}

static uint16_t read_port(void *context, uint16_t address)
{
    uint16_t level[3];
    external_levels(context, level);
    unsigned port = port_of(address);
    chip_put(context, address, port_value(context, port, level[port]));
    return chip_get(context, address);
}

static void write_port(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    uint16_t lat = (uint16_t)(address + LAT_BEHIND);
    chip_put(context, lat, chip_merged(context, lat, value, mask));
    int letter = 'A' + (int)port_of(address);
    chip_warn(context, "PORT%c: the firmware writes the port, LAT%c is the register for outputs", letter, letter);
}

static void write_selection(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    if (chip_clock_pins_locked(chip)) {
        chip_warn(chip, "OSCCON: a pin selection is written while IOLOCK is set, nothing happens");
        return;
    }
    chip_put(chip, address, chip_merged(chip, address, value, mask) & 0x1F1Fu);
}

/* True if the pin RPn is the output of this peripheral. */
bool chip_ports_pin_has_function(const chip_t *chip, unsigned rp, unsigned function)
{
    return (chip_get(chip, (uint16_t)(SFR_RPOR0 + (rp & ~1u))) >> (rp % 2u != 0 ? 8u : 0u) & 0x1Fu) == function;
}

/* True if some RPn pin is the output of this peripheral. */
bool chip_ports_have_function(const chip_t *chip, unsigned function)
{
    for (uint16_t address = SFR_RPOR0; address <= SFR_RPOR12; address = (uint16_t)(address + 2u)) {
        unsigned rpor = chip_get(chip, address);
        if ((rpor & 0x1Fu) == function || ((rpor >> 8) & 0x1Fu) == function) {
            return true;
        }
    }
    return false;
}

void chip_ports_hooks(chip_t *chip)
{
    for (unsigned port = 0; port < 3; port++) {
        chip_hook(chip, port_address[port], read_port, write_port);
    }
    for (uint16_t address = SFR_RPINR0; address <= SFR_RPOR12; address = (uint16_t)(address + 2u)) {
        if (chip_register_name(address) != NULL) {
            chip_hook(chip, address, NULL, write_selection);
        }
    }
}
