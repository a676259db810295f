/* The core as the processor of a chip: registers in its data memory, accesses to peripherals, resets, and running from event to event. */
#ifndef FOC33_CPU_33F_ISS_CPU_H
#define FOC33_CPU_33F_ISS_CPU_H

#include "chip.h"
#include "iss.h"
#include "iss_image.h"

typedef struct iss_cpu iss_cpu_t;

/* Hooks may be NULL; they get the iss_cpu_t.
 *   written    a PWM register that acts at once has been changed (or P1DC3 written); the instruction is about to end
 *   counter    P1TMR now
 *   was_reset  the device has been reset while it ran */
struct iss_cpu {
    iss_t *iss;
    chip_t *chip;
    void (*written)(iss_cpu_t *cpu, uint16_t address);
    uint16_t (*counter)(iss_cpu_t *cpu);
    void (*was_reset)(iss_cpu_t *cpu);
    bool running, broken;
};

/* A core with this program, and what the chip asks of it, in `functions`: all that does not concern a board. False if memory ran out. */
bool iss_cpu_create(iss_cpu_t *cpu, const iss_image_t *image, chip_cpu_t *functions);
void iss_cpu_destroy(iss_cpu_t *cpu);

/* After chip_connect(): peripherals see the core's accesses; configuration words of the program; power-on reset. */
void iss_cpu_connect(iss_cpu_t *cpu, chip_t *chip, const iss_image_t *image);

/* Reset core and chip. */
void iss_cpu_reset(iss_cpu_t *cpu, chip_reset_t cause);

/* Go on to at least `until_cycle`. ISS_STOP_NONE: reached; ISS_STOP_REQUEST: a reset, or iss_cpu_break(); other stops are the core's. */
iss_stop_t iss_cpu_run(iss_cpu_t *cpu, uint64_t until_cycle);

/* End the present iss_cpu_run() after this instruction. */
void iss_cpu_break(iss_cpu_t *cpu);

#endif
