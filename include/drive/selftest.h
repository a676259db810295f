/* What the self-tests add to the drive: critical variables kept twice, and the marks of the slots. Nothing with SELFTEST_OFF. */
#ifndef DRIVE_SELFTEST_H
#define DRIVE_SELFTEST_H

#include "control/qmath.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

#ifndef SELFTEST_OFF
/** Complements of the drive's fields of the same name, and the sum of the slots that came to their end. */
typedef struct {
    uint16_t state, fault, direction, offset_a, offset_b, phases;
} selftest_state_t;

/** Member of drive_t. */
#define SELFTEST_STATE selftest_state_t selftest;

/** Goes with every write of a field that is kept twice. */
#define SELFTEST_KEEP(d, field, value) ((d)->selftest.field = (uint16_t) ~(uint16_t)(value))

/** 1 where the copy of such a field is that of a value. */
#define SELFTEST_KEPT(d, field, value) ((d)->selftest.field == (uint16_t) ~(uint16_t)(value))

/** A slot, or its half, has come to its end. */
#define SELFTEST_MARK(d, phase) ((d)->selftest.phases = (uint16_t)((d)->selftest.phases + (phase)))
#else
#define SELFTEST_STATE
#define SELFTEST_KEEP(d, field, value) ((void)0)
#define SELFTEST_KEPT(d, field, value) 1
#define SELFTEST_MARK(d, phase) ((void)(phase))
#endif

/** X(code, name, clause of IEC 60730-1 table H.1, what is tested): feeds the enum, the status line and docs/selftest.md. Codes keep their meaning. */
#define SELFTEST_TABLE(X) \
    X(1, CPU, "1.1", "W0 to W15 and the flags of SR hold 0x5555 and 0xAAAA") \
    X(2, RAM, "4.2, 4.3, 5", "March C- with five backgrounds: all of the RAM at once at a start, four words a millisecond while running") \
    X(3, FLASH, "4.1, 4.3, 5", "CRC-16 of all of the flash: at a start at once, then 32 words a millisecond") \
    X(4, CLOCK, "3", "at power-up: the instruction clock against the low-power oscillator, which drives the watchdog") \
    X(5, FLOW, "1.3", "the slots, the background's parts and the states come in their order, and the tests get their turn") \
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

/** March C- over a stretch of RAM: up w; up r, w~; up r~, w; down r, w~; down r~, w; up r. Nothing may use the stretch meanwhile. Apart
 *  from its beginning and end it works in registers alone: the stretch may hold the stack. @param background what w writes; w~ is its
 *  complement @param spare keeps the contents meanwhile, outside of the stretch; 0: they may get lost @return 0, or bits that were wrong */
uint16_t selftest_march(volatile uint16_t *first, uint16_t words, uint16_t background, volatile uint16_t *spare);

/** CRC-16 of CCITT (polynomial 0x1021, start value 0xFFFF, highest bit first) of one more byte. */
uint16_t selftest_crc(uint16_t crc, uint16_t byte);

#define SELFTEST_CRC_START 0xFFFFu

#ifndef SELFTEST_OFF
/** 1 if the sum of the slots is the one that belongs to the ticks: each came in its turn, ever since the start. Between two periods. */
uint16_t selftest_flow_holds(const drive_t *d);

/** 1 if what is kept twice agrees. Between two periods. */
uint16_t selftest_variables_hold(const drive_t *d);
#endif

#endif
