/* Self-tests in the manner of IEC 60730 Class B: the table of tests, and those parts that see no register (docs/selftest.md). */
#ifndef DRIVE_SELFTEST_H
#define DRIVE_SELFTEST_H

#include "drive/drive.h"

/** X(code, name, clause of IEC 60730-1 table H.1, what is tested): feeds the enum, the status line and docs/selftest.md. Codes keep their meaning. */
#define SELFTEST_TABLE(X) \
    X(1, CPU, "1.1", "W0 to W15 and the flags of SR hold 0x5555 and 0xAAAA") \
    X(2, RAM, "4.2, 4.3, 5", "March C- with five backgrounds: all of the RAM at once at a start, four words a millisecond while running") \
    X(3, FLASH, "4.1, 4.3, 5", "CRC-16 of all of the flash: at a start at once, then 32 words a millisecond") \
    X(4, CLOCK, "3", "at power-up: the instruction clock against the low-power oscillator, which drives the watchdog") \
    X(5, FLOW, "1.3", "the slow phases and the background's parts come in their order, and the tests get their turn") \
    X(6, VARIABLES, "4.2", "state, fault, direction, current offsets and the user's wishes against their complements") \
    X(7, REGISTERS, "1.1, 7.1", "registers of PWM, ADC, pins, clock, timer and interrupts as they were written; the outputs as the state asks") \
    X(8, ADC, "7.2.1, 7.2.2", "in STOPPED: the converter reads AVSS as 0 through an input that is switched off") \
    X(9, STACK, "4.2", "the pattern below the stack's limit, and SPLIM") \
    X(10, WATCHDOG, "1.3", "at power-up: the watchdog resets the processor")

#define SELFTEST_ENUM(code, name, clause, what) SELFTEST_##name = (code),
/** Which test has failed. */
typedef enum { SELFTEST_NONE = 0,
               SELFTEST_TABLE(SELFTEST_ENUM) SELFTEST_COUNT } selftest_t;

#define SELFTEST_BACKGROUNDS 5u
/** Words for selftest_march(): any two bits of a word differ in at least one of them. */
extern const uint16_t selftest_backgrounds[SELFTEST_BACKGROUNDS];

/** March C- over a stretch of RAM: up w; up r, w~; up r~, w; down r, w~; down r~, w; up r. Nothing may use the stretch meanwhile.
 *  Apart from its beginning and end it works in registers alone: the stretch may hold the stack.
 *  @param background what w writes; w~ is its complement
 *  @param spare keeps the contents meanwhile, outside of the stretch; 0: they may get lost @return 0, or bits that were wrong */
uint16_t selftest_march(volatile uint16_t *first, uint16_t words, uint16_t background, volatile uint16_t *spare);

/** CRC-16 of CCITT (polynomial 0x1021, start value 0xFFFF, highest bit first) of one more byte. */
uint16_t selftest_crc(uint16_t crc, uint16_t byte);
#define SELFTEST_CRC_START 0xFFFFu

#ifndef SELFTEST_OFF
/** 1 if the sum of the slow phases is the one that belongs to the ticks: each came in its turn, ever since the start. Between two periods. */
QM_INLINE uint16_t selftest_flow_holds(const drive_t *d)
{
    uint16_t calls = (uint16_t)(d->ticks / SLOW_EVERY), rest = (uint16_t)(calls & (SLOW_CALLS - 1u));
    uint16_t expected = (uint16_t)((calls / SLOW_CALLS) * (SLOW_CALLS * (SLOW_CALLS - 1u) / 2u) + rest * (rest + 1u) / 2u);
    return (uint16_t)(((d->selftest.phases ^ expected) & 0x3FFFu) == 0u); /* the sum of 65536 ticks is a multiple of 0x4000 */
}

/** 1 if what is kept twice agrees. Between two periods. */
QM_INLINE uint16_t selftest_variables_hold(const drive_t *d)
{
    const selftest_state_t *s = &d->selftest;
    uint16_t same = (uint16_t)((s->state ^ d->state) & (s->fault ^ d->fault) & (s->direction ^ (uint16_t)d->direction)
                               & (s->offset_a ^ (uint16_t)d->calibration.offset_a_q13)
                               & (s->offset_b ^ (uint16_t)d->calibration.offset_b_q13));
    return (uint16_t)(same == 0xFFFFu);
}
#endif

#endif
