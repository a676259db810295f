/* Self-tests at a start: the watchdog and with it the clock (by a reset, at power-up), processor, flash, all of the RAM, stack. */
#include "board/selftest_run.h"

#ifndef SELFTEST_OFF

#include "board/firmware.h"
#include "board/peripherals.h"
#include "board/reset.h"
#include "board/selftest_chip.h"

/* The watchdog's time in counts of timer 1 at 64 cycles: 10000 for 512 periods of 32 kHz. An oscillator that is 30 % off passes [?], a clock of twice or
 * half its frequency does not. */
#define WATCHDOG_LEAST 7500u
#define WATCHDOG_MOST 14500u
#define WATCHDOG_NEVER 20000u

enum { WATCHDOG_NO_TEST,
       WATCHDOG_DUE,
       WATCHDOG_BITTEN };
static uint16_t watchdog_test BOARD_UNSET;
static volatile uint16_t waited_counts BOARD_PERSISTENT;

/* Power-up clears WDTO, and its own bits stay until the firmware clears them: both together are the reset that the test has waited for. */
uint16_t selftest_reset_cause(uint16_t rcon)
{
    watchdog_test = WATCHDOG_NO_TEST;
    if (!RESET_WAS(POR, rcon) && !RESET_WAS(BOR, rcon)) {
        return rcon;
    }
    watchdog_test = (uint16_t)(WATCHDOG_DUE + RESET_WAS(WDTO, rcon)); /* BITTEN is the next */
    return (uint16_t)(rcon & ~RESET_FLAG(WDTO));
}

/** The clock that counted is the crystal's, the watchdog's is the low-power oscillator. */
static void judge_watchdog(uint16_t bitten)
{
    if (!bitten) {
        selftest_fail(SELFTEST_WATCHDOG);
    } else if (waited_counts < WATCHDOG_LEAST || waited_counts > WATCHDOG_MOST) {
        selftest_fail(SELFTEST_CLOCK);
    }
}

/** Waits for the watchdog's reset. It returns if none comes, and on a PC. */
static void wait_for_watchdog(void)
{
    uint16_t counts = 0;
    T1CON = 0;
    TMR1 = 0;
    PR1 = 0xFFFFu;
    T1CON = 0x8020u; /* 64 cycles a count */
    RCON = board_reset_cause;
    ClrWdt();
    while (counts < WATCHDOG_NEVER && !BOARD_WATCHDOG_BITES()) {
        counts = TMR1;
        waited_counts = counts;
    }
    judge_watchdog(RCON & RESET_FLAG(WDTO));
    RCON = 0;
}

/** All of the RAM. First what nothing uses, at once; then, with that as its keep, what holds variables and stack. */
static void test_ram(void)
{
    volatile uint16_t *spare = board_free_ram(), *at;
    uint16_t room = (uint16_t)(BOARD_FREE_END - spare), wrong = 0, n, words;

    for (n = 0; n < SELFTEST_BACKGROUNDS; n++) {
        wrong |= selftest_march(spare, room, selftest_backgrounds[n], 0);
        at = BOARD_RAM;
        do {
            words = (uint16_t)(BOARD_USED_END(spare) - at);
            words = (words < room) ? words : room;
            wrong |= selftest_march(at, words, selftest_backgrounds[n], spare);
            at += words;
        } while (at != BOARD_USED_END(spare));
        ClrWdt();
    }
    if (wrong) {
        selftest_fail(SELFTEST_RAM);
    }
}

void selftest_start(drive_fault_t kept)
{
    if (kept != FAULT_SELFTEST) {
        board_selftest_failed = (uint16_t)SELFTEST_NONE;
    }
    if (watchdog_test == WATCHDOG_BITTEN) {
        judge_watchdog(1);
    } else if (watchdog_test == WATCHDOG_DUE && !board_clock_failed) { /* only with a clock that is known */
        wait_for_watchdog();
    } else {
        /* once each power-up */
    }
    selftest_cpu();
    SET_CPU_IPL(0); /* no interrupt is enabled yet */
    test_ram();
    STACK_GUARD[0] = STACK_PATTERN;
    STACK_GUARD[1] = STACK_PATTERN;
    while (!selftest_flash()) {
        ClrWdt();
    }
    board_selftest_stepped = board_drive.ticks;
}

#endif
