/* defines: -DAPP_PULSE=1 */
/* The board's part of the pulses, on registers: set-up, what a signal of any pace is measured as, and when nothing is. */
#include <stdio.h>
#include <string.h>

#include "registers.h"

#define T3CON (*registers_watch(&T3CON)) /* the timer stands still while it is set up */
#include "firmware/board/app_calls.c"
#undef T3CON

#define HOLDS 4u
#define TICK_S 50e-6

/** The captures as tools/chip has them: those of the first, of both edges. */
static struct {
    uint16_t fifo[HOLDS], count;
    double from_s; /* when it was switched on */
} captures[2];
static double now_s, period_s, length_s, edge_s; /* the next edge */
static uint16_t is_high, measured, wrong;
static app_told_t told;

/* Instead of the other files'. */
void pins_unlock(void)
{
    OSCCON &= (uint16_t)~0x0040u;
}

void pins_lock(void)
{
    OSCCON |= 0x0040u;
}

int16_t status_rpm(speed_erpm_t speed)
{
    return speed;
}

uint16_t retry_may_pass(uint16_t fault)
{
    return fault;
}

static void edges_until(double end_s)
{
    for (; edge_s <= end_s && period_s > 0.0; edge_s += is_high ? length_s : period_s - length_s) {
        const uint16_t n = is_high;
        if (edge_s >= captures[n].from_s && captures[n].count < HOLDS) {
            captures[n].fifo[captures[n].count++] = (uint16_t)(uint64_t)(edge_s * 5e6);
        }
        is_high ^= 1u;
    }
}

static void show(uint16_t n, volatile uint16_t *con, volatile uint16_t *buf)
{
    *con = (uint16_t)((*con & ~8u) | (captures[n].count ? 8u : 0u));
    *buf = captures[n].fifo[0];
}

static void drop(uint16_t n)
{
    uint16_t k;
    for (k = 1; k < HOLDS; k++) {
        captures[n].fifo[k - 1u] = captures[n].fifo[k];
    }
    captures[n].count = (uint16_t)(captures[n].count ? captures[n].count - 1u : 0u);
}

/** A pass of the background after so long. @param gap_s between the two switchings-on of a new begin */
static void pass(double after_s, double gap_s)
{
    uint16_t offered;
    now_s += after_s;
    edges_until(now_s);
    show(0, &IC1CON, &IC1BUF);
    show(1, &IC2CON, &IC2BUF);
    offered = IC1CONbits.ICBNE;
    app_pulse_look((uint16_t)(uint64_t)(now_s / TICK_S));
    drop(0);
    drop(1);
    if (offered && !IC1CONbits.ICBNE) {
        captures[0].count = captures[1].count = 0;
        captures[0].from_s = now_s;
        captures[1].from_s = now_s + gap_s;
    }
}

/** For so long. Counts what is measured, and what of it is none of the signal's. */
static void run(double for_s, double pass_s, double gap_s)
{
    const double end_s = now_s + for_s;
    const uint16_t length = (uint16_t)(length_s * 5e6 + 0.5), period = (period_s < 12e-3) ? (uint16_t)(period_s * 5e6 + 0.5) : 65535u;
    measured = 0;
    wrong = 0;
    while (now_s < end_s) {
        pass(pass_s, gap_s);
        app_pulse_take(&told);
        if (told.pulse_200ns != 0u) {
            measured++;
            wrong = (uint16_t)(wrong + (qm_abs((int16_t)(told.pulse_200ns - length)) > 1 || qm_abs((int16_t)(told.period_200ns - period)) > 1));
        }
    }
}

/** A signal that begins now. */
static void signal(double hz, double high_s)
{
    period_s = (hz > 0.0) ? 1.0 / hz : 0.0;
    length_s = high_s;
    edge_s = now_s + 1e-4;
}

void setUp(void)
{
    host_registers_reset();
    memset(captures, 0, sizeof captures);
    now_s = 0.0;
    is_high = 0;
    period_s = 0.0;
    app_pulse_init();
}

void tearDown(void)
{
}

void test_both_captures_are_on_the_pin_with_the_timer_on_200_ns_and_the_selection_is_locked_again(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0707, RPINR7);
    TEST_ASSERT_EQUAL_HEX16(0x0040, OSCCON & 0x0040u);
    TEST_ASSERT_EQUAL_HEX16(0x8010, T3CON);
    TEST_ASSERT_EQUAL_HEX16(0x0000, register_then("T3CON"));
    TEST_ASSERT_EQUAL_HEX16(0xFFFF, register_then("PR3"));
    TEST_ASSERT_EQUAL_HEX16(0x0003, IC1CON);
    TEST_ASSERT_EQUAL_HEX16(0x0002, IC2CON);
    TEST_ASSERT_EQUAL_HEX16(0x0000, IEC0);
}

void test_a_pwm_of_any_frequency_and_duty_is_measured_to_a_count_whatever_the_passes_take(void)
{
    static const double hz[] = { 91.0, 100.0, 249.0, 251.0, 1000.0, 3000.0, 9999.0 }, duty[] = { 0.05, 0.5, 0.95 };
    static const double pass_us[] = { 30.0, 97.0, 200.0, 511.0, 1003.0 }, gap_us[] = { 0.0, 40.0 };
    for (uint16_t n = 0; n < 7u * 3u * 5u * 2u; n++) {
        const double one_s = 1.0 / hz[n % 7u];
        char text[160];
        signal(0.0, 0.0);
        run(0.02, 1e-3, 0.0);
        signal(hz[n % 7u], one_s * duty[n / 7u % 3u]);
        run(0.05, 1e-6 * pass_us[n / 21u % 5u], 1e-6 * gap_us[n / 105u]); /* what the signal before it has left */
        run(0.4, 1e-6 * pass_us[n / 21u % 5u], 1e-6 * gap_us[n / 105u]);
        (void)snprintf(text, sizeof text, "%g Hz, duty %g, a pass of %g us, gap %g us", hz[n % 7u], duty[n / 7u % 3u], pass_us[n / 21u % 5u], gap_us[n / 105u]);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(0, wrong, text);
        TEST_ASSERT_GREATER_OR_EQUAL_UINT16_MESSAGE((uint16_t)(0.4 * ((hz[n % 7u] < 250.0) ? 0.95 * hz[n % 7u] : 95.0)), measured, text);
    }
}

void test_each_pulse_of_a_receiver_is_measured_and_each_second_one_of_a_quick_receiver(void)
{
    static const struct {
        double hz;
        uint16_t measured;
    } receivers[] = { { 50.0, 50 }, { 100.0, 100 }, { 240.0, 240 }, { 400.0, 200 } };
    for (uint16_t n = 0; n < 4u; n++) {
        signal(receivers[n].hz, 1.5e-3);
        run(0.1, 3e-4, 0.0);
        run(1.0, 3e-4, 0.0);
        TEST_ASSERT_UINT16_WITHIN(1, receivers[n].measured, measured);
        TEST_ASSERT_EQUAL_UINT16(0, wrong);
    }
}

void test_a_pulse_is_told_once(void)
{
    signal(50.0, 1.5e-3);
    run(0.03, 3e-4, 0.0);
    TEST_ASSERT_EQUAL_UINT16(1, measured);
    run(0.005, 3e-4, 0.0);
    TEST_ASSERT_EQUAL_UINT16(0, measured);
}

void test_a_pulse_too_long_for_the_count_is_none(void)
{
    static const double long_s[] = { 11.1e-3, 12.9e-3, 14.6e-3, 28.0e-3, 300e-3 }; /* 14.6 ms look like 1.5 */
    for (uint16_t n = 0; n < 5u; n++) {
        signal(1.0 / (long_s[n] + 5e-3), long_s[n]);
        run(0.1, 3e-4, 0.0); /* the end of the one before */
        run(2.0, 3e-4, 0.0);
        TEST_ASSERT_EQUAL_UINT16(0, measured);
    }
}

void test_a_line_that_stands_still_gives_nothing(void)
{
    signal(1000.0, 4e-4);
    run(0.1, 3e-4, 0.0);
    TEST_ASSERT_NOT_EQUAL(0, measured);
    signal(0.0, 0.0);
    run(0.01, 3e-4, 0.0);
    run(10.0, 1e-3, 0.0);
    TEST_ASSERT_EQUAL_UINT16(0, measured);
}

void test_a_stalled_background_loses_pulses_and_measures_none_wrong(void)
{
    static const double hz[] = { 50.0, 400.0, 1000.0, 10000.0 };
    for (uint16_t n = 0; n < 4u; n++) {
        signal(hz[n], (n < 2u) ? 1.5e-3 : 0.3 / hz[n]);
        run(0.2, 2e-4, 0.0);
        run(0.0201, 0.02, 0.0);
        run(1.0, 2e-4, 0.0);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(1, wrong);
        TEST_ASSERT_GREATER_THAN_UINT16(40, measured);
    }
}
