/* Self-tests at a start, and while the program runs: a slice each millisecond, what needs silence between two control interrupts. */
#include "board/selftest_run.h"

#ifndef SELFTEST_OFF
#include "board/application.h"
#include "board/firmware.h"
#include "board/peripherals.h"
#include "board/reset.h"
#include "board/selftest_cpu.h"
#include "board/status.h"
#include "drive/tick.h"
#include "drive/states.h"

#define SLICE_WORDS 4u  /* of RAM; two slices overlap by one, so that faults between neighbours show */
#define FLASH_WORDS 32u /* of flash in a millisecond */
#define REGISTERS_AT_ONCE 4u
#define OWED_MS 50u /* in this time the tests get their turn */
#define ADC_EVERY_MS 512u
#define ADC_ZERO_MOST (INT16_MIN + 16 * 64) /* 16 counts of the converter: its offset error is 7 at most [?] */
#define PARTS_IN_ORDER \
    ((((SELFTEST_PART_SUPERVISE * 8u + SELFTEST_PART_PANEL) * 8u) + SELFTEST_PART_WATCH) * 8u + SELFTEST_PART_STATUS)

volatile uint16_t board_selftest_failed BOARD_PERSISTENT;
uint16_t board_selftest_parts, board_selftest_stepped;

static uint16_t owed_ms; /* how long the tests between two interrupts have waited */
static uint16_t run_ms;  /* counts on */

void selftest_fail(selftest_t test)
{
    if (board_selftest_failed == (uint16_t)SELFTEST_NONE) {
        board_selftest_failed = (uint16_t)test;
    }
    firmware_trip(FAULT_SELFTEST);
}

/* ---- registers, as the start wrote them ---- */

typedef struct {
    volatile uint16_t *place;
    uint16_t mask, value; /* the mask leaves out what the chip itself changes or does not have */
} written_t;

static const written_t written[] = {
    /* PWM */
    { &P1TCON, 0xA0FFu, BOARD_P1TCON },
    { &P1TPER, 0x7FFFu, BOARD_P1TPER },
    { &P1SECMP, 0xFFFFu, BOARD_P1SECMP },
    { &PWM1CON1, 0x0777u, BOARD_PWM1CON1 },
    { &PWM1CON2, 0x0F07u, 0u },
    { &P1DTCON1, 0xFFFFu, BOARD_P1DTCON1 },
    { &P1DTCON2, 0x003Fu, 0u },
    { &P1FLTACON, 0x3F87u, BOARD_P1FLTACON },
    /* ADC; SAMP and DONE change */
    { &AD1CON1, 0xA7ECu, BOARD_AD1CON1 | 0x8000u },
    { &AD1CON2, 0xE77Fu, BOARD_AD1CON2 },
    { &AD1CON3, 0x9FFFu, BOARD_AD1CON3 },
#if !HEAT_USED
    { &AD1CHS0, 0x9F9Fu, BOARD_AD1CHS0 },
#endif
    { &AD1CHS123, 0x0707u, BOARD_AD1CHS123 },
    { &AD1PCFGL, 0x01FFu, BOARD_AD1PCFGL & 0x01FFu },
    /* pins */
    { &TRISA, 0x079Fu, BOARD_TRIS(A) & 0x079Fu },
    { &TRISB, 0xFFFFu, BOARD_TRIS(B) },
    { &TRISC, 0x03FFu, BOARD_TRIS(C) & 0x03FFu },
    { &RPINR12, 0x001Fu, BOARD_FLTA_RP },
#if DIRECTION_INPUT_USED
    { &CNPU1, 0xFFFFu, BOARD_CNPU1 },
    { &CNPU2, 0x7FFFu, BOARD_CNPU2 },
#endif
    /* clock, timer, power of the peripherals */
    { &OSCCON, 0x7060u, 0x3060u }, /* the crystal with the PLL, locked; pin selection locked */
    { &PLLFBD, 0x01FFu, BOARD_PLLFBD },
    { &CLKDIV, 0xFFDFu, BOARD_CLKDIV },
    { &OSCTUN, 0x003Fu, 0u },
    { &T1CON, 0xA076u, 0x8000u },
    { &PR1, 0xFFFFu, BOARD_FCY_HZ / 1000ul - 1ul },
    { &PMD1, 0xFFFFu, 0u },
    /* interrupts: only the control interrupt, that of the slow work, and the fault input; the core */
    { &IEC0, 0xFFFFu, 0x2080u },
    { &IEC3, 0xFFFFu, 0x8000u * BOARD_FLTA_USED },
    { &IPC1, 0x7000u, BOARD_PRIORITY_SLOW << 12 },
    { &IPC3, 0x0070u, BOARD_PRIORITY_CONTROL << 4 },
    { &IPC15, 0x7000u, BOARD_PRIORITY_FAULT << 12 },
    { &INTCON1, 0x8000u, 0u },
    { &INTCON2, 0x8000u, 0u },
    { &CORCON, 0x10F7u, 0x0024u },
    { &MODCON, 0xC000u, 0u },
#if APP_PULSE
    { &RPINR7, 0x1F1Fu, BOARD_RPINR7 },
    { &T3CON, 0xA072u, BOARD_T3CON },
    { &PR3, 0xFFFFu, 0xFFFFu },
    { &IC1CON, 0x2087u, BOARD_IC1CON },
    { &IC2CON, 0x2087u, BOARD_IC2CON },
    { &PMD2, 0x0300u, 0u },
#endif
};

static void test_registers(void)
{
    static uint16_t untested;
    uint16_t left, wrong = PSVPAG; /* 8 bits in the device header */
#if HEAT_USED
    wrong |= (uint16_t)(AD1CHS0 ^ board_ch0); /* each time: the next sample is its */
#endif
    for (left = REGISTERS_AT_ONCE; left != 0u; left--) {
        const written_t *w;
        if (untested == 0u) {
            untested = sizeof written / sizeof written[0];
        }
        untested--;
        w = &written[untested];
        wrong |= (uint16_t)((*w->place & w->mask) ^ w->value);
    }
    if (wrong != 0u) {
        selftest_fail(SELFTEST_REGISTERS);
    }
}

/** The override as the interrupts' last words have left it: as the state asks (drive_outputs()), or off; low sides on until the first duties. */
static void test_outputs(void)
{
    const uint16_t now = P1OVDCON, state = board_drive.state;
    const uint16_t low = (uint16_t)(state == (uint16_t)DRIVE_BOOTSTRAP || drive_shorts(&board_drive));
    if (now == BOARD_OUTPUTS_OFF || (state == (uint16_t)DRIVE_ALIGN && board_drive.periods <= DEFER_ALIGN_PERIODS && now == BOARD_OUTPUTS_BOOTSTRAP)) {
        return;
    }
    if (board_drive.fault != (uint16_t)FAULT_NONE || now != (drive_is_running(&board_drive) ? BOARD_OUTPUTS_PWM : low ? BOARD_OUTPUTS_BOOTSTRAP
                                                                                                                      : BOARD_OUTPUTS_OFF)) {
        selftest_fail(SELFTEST_REGISTERS);
    }
}

/* ---- flash ---- */

static uint16_t flash_at;
static uint16_t flash_has_crc; /* 0: erased words in its place, linked without tools/image/crc.py */
static uint16_t flash_crc;

static void judge_flash(uint16_t crc)
{
    uint16_t stored = (uint16_t)__builtin_tblrdl(BOARD_FLASH_CRC_AT), inverse = (uint16_t)__builtin_tblrdl(BOARD_FLASH_CRC_AT + 2u);
    flash_has_crc = (uint16_t) ~(stored & inverse);
    if (flash_has_crc && (stored != crc || (uint16_t)(inverse ^ crc) != 0xFFFFu)) {
        selftest_fail(SELFTEST_FLASH);
    }
}

/** One slice of the flash's CRC. @return not 0 at the flash's end */
static uint16_t selftest_flash(void)
{
    uint16_t at = flash_at, crc = flash_crc, left;
    TBLPAG = 0;
    if (at == 0u) {
        crc = SELFTEST_CRC_START;
    }
    for (left = FLASH_WORDS; left != 0u; left--) {
        uint16_t low = (uint16_t)__builtin_tblrdl(at), high = (uint16_t)__builtin_tblrdh(at);
        crc = selftest_crc(selftest_crc(selftest_crc(crc, low & 0xFFu), low >> 8), high & 0xFFu);
        at = (uint16_t)(at + 2u);
        if (at == BOARD_FLASH_CRC_AT) {
            judge_flash(crc);
            at = 0;
            break;
        }
    }
    flash_at = at;
    flash_crc = crc;
    return left;
}

#ifdef __XC16__
/** Here tools/image/crc.py writes. */
const uint16_t board_flash_crc[2] __attribute__((space(prog), address(BOARD_FLASH_CRC_AT), keep, externally_visible)) = { 0xFFFFu, 0xFFFFu };
#endif

/* ---- between two control interrupts ---- */

void selftest_cpu(void)
{
    board_cpu_test();
    if (board_cpu_holds == 0u) {
        selftest_fail(SELFTEST_CPU);
    }
}

/** 1 if two slices have a word in common, or if the first ends where the second begins. */
QM_INLINE QM_WRAPS uint16_t slices_touch(const volatile uint16_t *first, const volatile uint16_t *second)
{
    return (uint16_t)((uintptr_t)(first + SLICE_WORDS) - (uintptr_t)second < 2u * SLICE_WORDS * sizeof *first);
}

/** Four words of RAM; at its end the processor's registers, and another background. With interrupts off. */
static void test_ram_slice(void)
{
    static uint16_t from, n; /* word of the RAM, background */
    uint16_t words = (uint16_t)((uint16_t)(BOARD_RAM_END - BOARD_RAM) - from);
    words = (words < SLICE_WORDS) ? words : SLICE_WORDS;
    if (words > 1u) {
        static volatile uint16_t keep[3u * SLICE_WORDS]; /* a slice never touches both ends */
        volatile uint16_t *at = BOARD_RAM + from;
        volatile uint16_t *spare = slices_touch(at, keep) ? keep + 2u * SLICE_WORDS : keep;
        if (selftest_march(at, words, selftest_backgrounds[n], spare) != 0u) {
            selftest_fail(SELFTEST_RAM);
        }
        from = (uint16_t)(from + words - 1u);
    } else {
        from = 0;
        n = (uint16_t)((n + 1u < SELFTEST_BACKGROUNDS) ? n + 1u : 0u);
        selftest_cpu();
    }
}

static void test_in_silence(void)
{
    if (!selftest_variables_hold(&board_drive) || !request_holds(&board_request)) {
        selftest_fail(SELFTEST_VARIABLES);
    }
    if (!selftest_flow_holds(&board_drive)) {
        selftest_fail(SELFTEST_FLOW);
    }
    test_outputs();
    test_ram_slice();
}

/* ---- converter: an input that is switched off reads AVSS ---- */

static uint16_t adc_since;
static int16_t adc_pot_q15;

static void start_adc(void)
{
    if (board_drive.state == (uint16_t)DRIVE_STOPPED && !board_drive.command.run) {
        adc_since = board_drive.ticks;
        adc_pot_q15 = board_pot.now_q15;
        firmware_choose_input(BOARD_AN_OFF);
    }
}

/** The second sample after the change is AVSS for sure; the panel gets the potentiometer's sample from before.
 *  @return 0 while that is to come and the input is AVSS */
static uint16_t end_adc(void)
{
    int16_t zero_q15 = HEAT_USED ? (int16_t)ADC1BUF0 : board_pot.now_q15;
    if (AD1CHS0 == BOARD_AN_OFF) {
        if ((uint16_t)(board_drive.ticks - adc_since) < 3u) {
            return 0;
        }
        firmware_choose_input(BOARD_AD1CHS0);
        board_pot.now_q15 = adc_pot_q15;
        if (zero_q15 > ADC_ZERO_MOST) {
            selftest_fail(SELFTEST_ADC);
        }
    }
    return 1;
}

/* ---- program flow ---- */

void selftest_pass(void)
{
    /* S2 must not clear it. What no test has named yet is the drive's own: a state that none may follow. */
    if (board_drive.fault == (uint16_t)FAULT_SELFTEST || board_selftest_failed != (uint16_t)SELFTEST_NONE) {
        selftest_fail(SELFTEST_FLOW);
    }
    if ((uint16_t)(board_drive.ticks - board_selftest_stepped) > PARAM_PERIODS(OWED_MS * 0.001F)) {
        selftest_fail(SELFTEST_FLOW);
    }
    board_selftest_parts = SELFTEST_PART_SUPERVISE;
    (void)end_adc();
    if (owed_ms != 0u && BOARD_QUIET()) {
        SET_CPU_IPL(7);
        test_in_silence();
        SET_CPU_IPL(0); /* the background's */
        owed_ms = 0;
    }
}

void selftest_ms(void)
{
    run_ms = (uint16_t)(run_ms + 1u);
    owed_ms++;
    board_selftest_stepped = board_drive.ticks;
    if (board_selftest_parts != PARTS_IN_ORDER || owed_ms > OWED_MS) {
        selftest_fail(SELFTEST_FLOW);
    }
    if (STACK_GUARD[0] != STACK_PATTERN || STACK_GUARD[1] != STACK_PATTERN || SPLIM != (uint16_t)(uintptr_t)BOARD_STACK_LIMIT) {
        selftest_fail(SELFTEST_STACK);
    }
    if (end_adc()) { /* after a late pass the next one comes at once */
        test_registers();
    }
    (void)selftest_flash();
    if (run_ms % ADC_EVERY_MS == 0u) {
        start_adc();
    }
}

/* ---- messages ---- */

char *selftest_put(char *at)
{
    return board_selftest_failed ? text_put_named(at, " selftest ", (int16_t)board_selftest_failed) : at;
}

char *selftest_put_marked(char *at)
{
    return flash_has_crc ? at : text_put(at, " flash without CRC");
}

/* ---- Self-tests at a start: the watchdog and with it the clock (by a reset, at power-up), processor, flash, all of the RAM, stack ---- */

/* The watchdog's time in counts of timer 1 at 64 cycles: 10000 for 512 periods of 32 kHz. An oscillator 30 % off passes [?], one of twice or half does not. */
#define WATCHDOG_LEAST 7500u
#define WATCHDOG_MOST 14500u
#define WATCHDOG_NEVER 20000u
#define WATCHDOG_T1CON ((PARAMS_KEPT) ? 0x8030u : 0x8020u) /* its time is four times as long: 256 cycles a count */

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
    T1CON = WATCHDOG_T1CON;
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
    } else { /* once each power-up */
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
