/* The self-tests of the board: at a start, in each pass of the background and in each millisecond. Nothing with SELFTEST_OFF. */
#ifndef BOARD_SELFTEST_RUN_H
#define BOARD_SELFTEST_RUN_H

#include "drive/faults.h"
#include "drive/selftest.h"

/** The background's parts, which come in this order. */
enum { SELFTEST_PART_SUPERVISE = 1,
       SELFTEST_PART_PANEL,
       SELFTEST_PART_WATCH,
       SELFTEST_PART_STATUS };

#ifndef SELFTEST_OFF
/** The parts that have come to their end, three bits each. */
extern uint16_t board_selftest_parts;

/** A part has come to its end. */
#define selftest_part(part) (board_selftest_parts = (uint16_t)((uint16_t)(board_selftest_parts << 3) | (part)))

/** The self-test that failed first (selftest_t), 0: none. From then on to the next reset by power-up or MCLR nothing may run. */
extern volatile uint16_t board_selftest_failed;

/** Drive ticks at the last selftest_ms(). */
extern uint16_t board_selftest_stepped;

/** Notes a failure and trips. Any context but the control interrupt. */
void selftest_fail(selftest_t test);

/** After every reset. @param rcon its cause @return the cause to go on with: that of power-up after the reset that ends the watchdog's test */
uint16_t selftest_reset_cause(uint16_t rcon);

/** What is tested once, with the outputs off: watchdog and clock at power-up (by a reset), processor, flash, RAM, stack. @param kept fault */
void selftest_start(drive_fault_t kept);

/** First of all in a pass of the background. */
void selftest_pass(void);

/** At the end of a millisecond's work. */
void selftest_ms(void);

/** The processor's registers. With interrupts off; leaves level 7. */
void selftest_cpu(void);

/** Status line: " selftest 3" after a failure, the code of SELFTEST_TABLE. @return the text's end */
char *selftest_put(char *at);

/** First line: says that the image has no CRC, so that the flash is not tested. @return the text's end */
char *selftest_put_marked(char *at);
#else
#define board_selftest_failed 0u /* no test, none failed */
#define selftest_reset_cause(rcon) (rcon)
#define selftest_start(kept) ((void)(kept))
#define selftest_pass() ((void)0)
#define selftest_ms() ((void)0)
#define selftest_put(at) (at)
#define selftest_put_marked(at) (at)
#define selftest_part(part) ((void)0)
#endif

#endif
