/* What chip and core say to each other: interrupts by number (bit `number % 16` of IFSx and IECx, x = `number / 16`), and resets. */
#ifndef FOC33_CHIP_CHIP_IRQ_H
#define FOC33_CHIP_CHIP_IRQ_H

#include <stdint.h>

enum {
    CHIP_IRQ_IC1 = 1, CHIP_IRQ_T1 = 3, CHIP_IRQ_IC2 = 5, CHIP_IRQ_T2 = 7, CHIP_IRQ_T3 = 8, CHIP_IRQ_U1RX = 11, CHIP_IRQ_U1TX = 12, CHIP_IRQ_ADC1 = 13, CHIP_IRQ_IC7 = 22, CHIP_IRQ_IC8 = 23,
    CHIP_IRQ_PWM1 = 57, CHIP_IRQ_FLTA1 = 63,
    CHIP_IRQ_WORDS = 5
};

typedef enum {
    CHIP_RESET_POR, CHIP_RESET_BOR, CHIP_RESET_MCLR, CHIP_RESET_SOFTWARE, CHIP_RESET_WATCHDOG, CHIP_RESET_TRAP,
    CHIP_RESET_ILLEGAL /* illegal opcode or uninitialised W register (RCON.IOPUWR) */
} chip_reset_t;

/* The bits of RCON that tell of a reset. */
static inline uint16_t chip_reset_rcon(chip_reset_t cause)
{
    static const uint16_t bits[] = {
        [CHIP_RESET_POR] = 0x0003, [CHIP_RESET_BOR] = 0x0002, [CHIP_RESET_MCLR] = 0x0080, [CHIP_RESET_SOFTWARE] = 0x0040,
        [CHIP_RESET_WATCHDOG] = 0x0010, [CHIP_RESET_TRAP] = 0x8000, [CHIP_RESET_ILLEGAL] = 0x4000,
    };
    return bits[cause];
}

/* An interrupt and its priority; priority 0: none. */
typedef struct {
    unsigned priority, number;
} chip_irq_t;

/* The enabled interrupt with a set flag of the highest priority; among equals that of the lowest number. Arrays from IFS0, IEC0, IPC0. */
static inline chip_irq_t chip_irq_pending(const uint16_t *ifs, const uint16_t *iec, const uint16_t *ipc)
{
    chip_irq_t best = {0, 0};
    for (unsigned word = 0; word < CHIP_IRQ_WORDS; word++) {
        unsigned active = (unsigned)ifs[word] & iec[word];
        for (unsigned bit = 0; active != 0; bit++, active >>= 1) {
            unsigned number = 16u * word + bit, priority = (unsigned)ipc[number / 4u] >> 4u * (number % 4u) & 7u;
            if ((active & 1u) != 0 && priority > best.priority) {
                best = (chip_irq_t){priority, number};
            }
        }
    }
    return best;
}

#endif
