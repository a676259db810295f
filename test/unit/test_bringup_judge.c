/* What BRINGUP concludes from currents: signals and legs, signs, open and dead phases, resistance, gains, dead time. */
/* defines: -DBRINGUP */
#include "hurst_params.h"

#include "law.c"

#include "unity.h"

#define EACH(n, table) for (uint16_t n = 0; n < sizeof(table) / sizeof(table)[0]; n++)

/** A bridge with its motor and two signals. */
typedef struct {
    uint16_t driver[3];      /* the leg that each driver drives */
    uint16_t signal_leg[2];  /* the leg that each signal is in */
    float gain[2];           /* of the signals */
    uint16_t open;           /* mask of legs */
    uint16_t no_high, no_low;
} board_t;

#define CONNECTED { 0, 1, 2 }, { 0, 1 }, { 1.0F, 1.0F } /* drivers, signals and gains as they should be */

static const board_t right = { CONNECTED, 0, 0, 0 };
static const float full_a = 0.8F;

void setUp(void)
{
}

void tearDown(void)
{
}

/** Currents of the legs when one of them is driven, out (sign 1) or in; legs that cannot take part carry nothing. */
static void legs(const board_t *b, uint16_t leg, float sign, float i_a, float *i)
{
    uint16_t k, others = 0;
    for (k = 0; k < 3u; k++) {
        uint16_t blocks = (k == leg) == (sign > 0.0F) ? b->no_high : b->no_low; /* the way its current goes */
        i[k] = ((b->open | blocks) & (1u << k)) ? 0.0F : 1.0F;
        others = (uint16_t)(others + (k != leg && i[k] > 0.0F));
    }
    for (k = 0; k < 3u; k++) {
        i[k] *= (others == 0u || i[leg] == 0.0F) ? 0.0F : (k == leg) ? sign * i_a : -sign * i_a / (float)others;
    }
}

/** One level of all directions. @param amplitude duty counts for a current */
static bringup_level_t level(const board_t *b, float i_a, int16_t amplitude)
{
    static const uint16_t phase[6] = { 0, 2, 1, 0, 2, 1 };
    bringup_level_t x;
    uint16_t n;
    for (n = 0; n < BRINGUP_DIRECTIONS; n++) {
        float i[3];
        legs(b, b->driver[phase[n]], (n & 1u) ? -1.0F : 1.0F, i_a, i);
        x.a[n] = CURRENT_Q13(b->gain[0] * i[b->signal_leg[0]]);
        x.b[n] = CURRENT_Q13(b->gain[1] * i[b->signal_leg[1]]);
        x.amplitude[n] = amplitude;
    }
    return x;
}

static bringup_wiring_t wiring(const board_t *b)
{
    bringup_level_t x = level(b, full_a, 300);
    return bringup_wiring(&x);
}

void test_each_way_of_wiring_is_told_from_the_others(void)
{
    static const struct {
        const char *what;
        board_t board;
        bringup_wiring_t expected; /* dead, legs, inverted, open, high, low */
    } cases[] = {
        { "right", { CONNECTED, 0, 0, 0 }, { 0, { 0, 1 }, 0, 0, 0, 0 } },
        { "signals swapped", { { 0, 1, 2 }, { 1, 0 }, { 1.0F, 1.0F }, 0, 0, 0 }, { 0, { 1, 0 }, 0, 0, 0, 0 } },
        { "drivers A and B swapped", { { 1, 0, 2 }, { 0, 1 }, { 1.0F, 1.0F }, 0, 0, 0 }, { 0, { 1, 0 }, 0, 0, 0, 0 } },
        { "drivers B and C swapped", { { 0, 2, 1 }, { 0, 1 }, { 1.0F, 1.0F }, 0, 0, 0 }, { 0, { 0, 2 }, 0, 0, 0, 0 } },
        { "drivers C and A swapped", { { 2, 1, 0 }, { 0, 1 }, { 1.0F, 1.0F }, 0, 0, 0 }, { 0, { 2, 1 }, 0, 0, 0, 0 } },
        { "both signals in one leg", { { 0, 1, 2 }, { 0, 0 }, { 1.0F, 1.0F }, 0, 0, 0 }, { 0, { 0, 0 }, 0, 0, 0, 0 } },
        { "A inverted", { { 0, 1, 2 }, { 0, 1 }, { -1.0F, 1.0F }, 0, 0, 0 }, { 0, { 0, 1 }, 1, 0, 0, 0 } },
        { "both inverted", { { 0, 1, 2 }, { 0, 1 }, { -1.0F, -1.0F }, 0, 0, 0 }, { 0, { 0, 1 }, 3, 0, 0, 0 } },
        { "swapped and B's inverted", { { 0, 1, 2 }, { 1, 0 }, { 1.0F, -1.0F }, 0, 0, 0 }, { 0, { 1, 0 }, 2, 0, 0, 0 } },
        { "half the gain", { { 0, 1, 2 }, { 0, 1 }, { 0.5F, 1.0F }, 0, 0, 0 }, { 0, { 0, 1 }, 0, 0, 0, 0 } },
        { "signal A dead", { { 0, 1, 2 }, { 0, 1 }, { 0.0F, 1.0F }, 0, 0, 0 }, { 1, { 0, 1 }, 0, 0, 0, 0 } },
        { "signal B dead", { { 0, 1, 2 }, { 0, 1 }, { 1.0F, 0.0F }, 0, 0, 0 }, { 2, { 0, 1 }, 0, 0, 0, 0 } },
        { "A open", { CONNECTED, 1, 0, 0 }, { 0, { 0, 1 }, 0, 1, 0, 0 } },
        { "B open", { CONNECTED, 2, 0, 0 }, { 0, { 0, 1 }, 0, 2, 0, 0 } },
        { "C open", { CONNECTED, 4, 0, 0 }, { 0, { 0, 1 }, 0, 4, 0, 0 } },
        { "nothing flows", { CONNECTED, 7, 0, 0 }, { 0, { 0, 1 }, 0, 7, 0, 0 } },
        { "high side of A", { CONNECTED, 0, 1, 0 }, { 0, { 0, 1 }, 0, 0, 1, 0 } },
        { "high side of C", { CONNECTED, 0, 4, 0 }, { 0, { 0, 1 }, 0, 0, 4, 0 } },
        { "low side of B", { CONNECTED, 0, 0, 2 }, { 0, { 0, 1 }, 0, 0, 0, 2 } },
    };
    EACH(n, cases) {
        bringup_wiring_t w = wiring(&cases[n].board);
        const bringup_wiring_t *e = &cases[n].expected;
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(e->dead, w.dead, cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(e->leg[0], w.leg[0], cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(e->leg[1], w.leg[1], cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(e->inverted, w.inverted, cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(e->open, w.open, cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(e->high, w.high, cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(e->low, w.low, cases[n].what);
    }
}

/** Amplitude that drives a current through R behind a bridge with this dead time, at 24 V. */
static int16_t amplitude(float i_a, float rs_ohm, float dead_us)
{
    return (int16_t)((rs_ohm * i_a / 24.0F + 4.0F / 3.0F * dead_us / 50.0F) * 2000.0F + 0.5F);
}

static bringup_bridge_t bridge(const board_t *b, float i_a, float rs_ohm, float dead_us)
{
    bringup_level_t half = level(b, 0.5F * i_a, amplitude(0.5F * i_a, rs_ohm, dead_us)), full = level(b, i_a, amplitude(i_a, rs_ohm, dead_us));
    bringup_wiring_t w = bringup_wiring(&full);
    return bringup_bridge(&half, &full, &w, 2400);
}

void test_resistance_and_dead_time_come_from_two_levels(void)
{
    static const struct {
        float i_a, rs_ohm, dead_us;
    } cases[] = { { 0.8F, 2.67F, 2.0F }, { 0.8F, 2.67F, 0.5F }, { 0.8F, 2.67F, 3.0F }, { 1.0F, 1.0F, 2.0F }, { 0.3F, 10.0F, 2.0F } };
    EACH(n, cases) {
        bringup_bridge_t r = bridge(&right, cases[n].i_a, cases[n].rs_ohm, cases[n].dead_us);
        TEST_ASSERT_FLOAT_WITHIN(0.06F * cases[n].rs_ohm, cases[n].rs_ohm, 0.001F * (float)r.resistance_mohm);
        TEST_ASSERT_FLOAT_WITHIN(0.05F, cases[n].dead_us, 0.001F * (float)r.dead_time_ns);
        TEST_ASSERT_UINT16_WITHIN(1, 100, r.b_percent_of_a);
    }
}

void test_dead_time_does_not_depend_on_gains_and_the_ratio_tells_them(void)
{
    static const board_t half_a = { { 0, 1, 2 }, { 0, 1 }, { 0.5F, 1.0F }, 0, 0, 0 }, double_both = { { 0, 1, 2 }, { 0, 1 }, { 2.0F, 2.0F }, 0, 0, 0 };
    bringup_bridge_t r = bridge(&half_a, 0.8F, 2.67F, 2.0F);
    TEST_ASSERT_UINT16_WITHIN(2, 200, r.b_percent_of_a);
    TEST_ASSERT_FLOAT_WITHIN(0.05F, 2.0F, 0.001F * (float)r.dead_time_ns);
    TEST_ASSERT_FLOAT_WITHIN(0.2F, 5.34F, 0.001F * (float)r.resistance_mohm);
    r = bridge(&double_both, 0.8F, 2.67F, 2.0F);
    TEST_ASSERT_UINT16_WITHIN(2, 100, r.b_percent_of_a);
    TEST_ASSERT_FLOAT_WITHIN(0.1F, 1.335F, 0.001F * (float)r.resistance_mohm);
}

void test_swapped_signals_and_drivers_give_the_same_resistance(void)
{
    static const board_t swapped = { { 0, 1, 2 }, { 1, 0 }, { 1.0F, -1.0F }, 0, 0, 0 }, with_c = { { 2, 1, 0 }, { 0, 1 }, { 1.0F, 1.0F }, 0, 0, 0 };
    TEST_ASSERT_FLOAT_WITHIN(0.1F, 2.67F, 0.001F * (float)bridge(&swapped, 0.8F, 2.67F, 2.0F).resistance_mohm);
    TEST_ASSERT_FLOAT_WITHIN(0.1F, 2.67F, 0.001F * (float)bridge(&with_c, 0.8F, 2.67F, 2.0F).resistance_mohm);
    TEST_ASSERT_UINT16_WITHIN(2, 100, bridge(&with_c, 0.8F, 2.67F, 2.0F).b_percent_of_a);
}

void test_levels_that_do_not_differ_give_the_largest_resistance_and_no_dead_time(void)
{
    bringup_level_t same = level(&right, full_a, 300), none = level(&right, 0.0F, 300);
    bringup_wiring_t w = bringup_wiring(&same);
    TEST_ASSERT_EQUAL_UINT16(60000u, bringup_bridge(&same, &same, &w, 2400).resistance_mohm);
    TEST_ASSERT_EQUAL_UINT16(0, bringup_bridge(&same, &same, &w, 2400).dead_time_ns);
    TEST_ASSERT_EQUAL_UINT16(999, bringup_bridge(&none, &none, &w, 2400).b_percent_of_a);
}

void test_a_side_that_carries_a_quarter_of_the_other_one_turns_on(void)
{
    static const struct {
        int16_t percent; /* of the current of -A in +A */
        uint16_t high;
    } cases[] = { { 30, 0 }, { 20, 1 } };
    EACH(n, cases) {
        bringup_level_t x = level(&right, full_a, 300);
        x.a[0] = (current_q13_t)(-(int32_t)x.a[3] * cases[n].percent / 100);
        TEST_ASSERT_EQUAL_HEX16(cases[n].high, bringup_wiring(&x).high);
    }
}

void test_an_eighth_of_the_current_is_a_signal(void)
{
    static const struct {
        int16_t share; /* of the current that is asked for, 1/64 */
        uint16_t dead;
    } cases[] = { { 7, 1 }, { 9, 0 } };
    EACH(n, cases) {
        bringup_level_t x = level(&right, full_a, 300);
        uint16_t k;
        for (k = 0; k < BRINGUP_DIRECTIONS; k++) {
            x.a[k] = 0;
        }
        x.a[0] = (current_q13_t)(BRINGUP_FULL_Q13 / 64 * cases[n].share);
        x.a[3] = (current_q13_t)-x.a[0];
        TEST_ASSERT_EQUAL_HEX16(cases[n].dead, bringup_wiring(&x).dead);
    }
}

void test_a_signal_of_exactly_an_eighth_tells_its_leg_whatever_its_sign(void)
{
    static const uint16_t to[3] = { 0, 4, 2 }, back[3] = { 3, 1, 5 }; /* directions +A, +C, +B and their opposites */
    static const struct {
        int16_t size;
        uint16_t leg;
    } cases[] = { { BRINGUP_LEAST_Q13, 2 }, { -BRINGUP_LEAST_Q13, 2 }, { BRINGUP_LEAST_Q13 - 1, 0 }, { 1 - BRINGUP_LEAST_Q13, 0 } }; /* else the expected one */
    EACH(n, cases) {
        bringup_level_t x = level(&right, full_a, 300);
        for (uint16_t k = 0; k < 3u; k++) {
            x.a[to[k]] = (current_q13_t)((k == 1u) ? cases[n].size : -cases[n].size);
            x.a[back[k]] = (current_q13_t)-x.a[to[k]];
        }
        TEST_ASSERT_EQUAL_UINT16(cases[n].leg, bringup_wiring(&x).leg[0]);
    }
}

void test_equal_signals_are_a_ratio_of_100_percent_exactly(void)
{
    bringup_level_t half = level(&right, 0.4F, 150), full = level(&right, 0.8F, 300);
    bringup_wiring_t w = bringup_wiring(&full);
    TEST_ASSERT_EQUAL_UINT16(100, bringup_bridge(&half, &full, &w, 2400).b_percent_of_a);
    full.a[1] = 1000;
    full.a[4] = -1000;
    full.b[1] = 750;
    full.b[4] = -750;
    TEST_ASSERT_EQUAL_UINT16(75, bringup_bridge(&half, &full, &w, 2400).b_percent_of_a);
}

void test_dead_time_is_the_mean_of_both_legs(void)
{
    bringup_level_t half = level(&right, 0.4F, amplitude(0.4F, 2.67F, 1.0F)), full = level(&right, 0.8F, amplitude(0.8F, 2.67F, 1.0F));
    bringup_level_t half_b = level(&right, 0.4F, amplitude(0.4F, 2.67F, 3.0F)), full_b = level(&right, 0.8F, amplitude(0.8F, 2.67F, 3.0F));
    bringup_wiring_t w = bringup_wiring(&full);
    half.amplitude[2] = half_b.amplitude[2];
    half.amplitude[5] = half_b.amplitude[5];
    full.amplitude[2] = full_b.amplitude[2];
    full.amplitude[5] = full_b.amplitude[5];
    TEST_ASSERT_UINT16_WITHIN(60, 2000, bringup_bridge(&half, &full, &w, 2400).dead_time_ns);
}

void test_amplitude_that_grows_slower_than_the_current_leaves_no_dead_time(void)
{
    bringup_level_t half = level(&right, 0.4F, 100), full = level(&right, 0.8F, 300);
    bringup_wiring_t w = bringup_wiring(&full);
    TEST_ASSERT_EQUAL_UINT16(0, bringup_bridge(&half, &full, &w, 2400).dead_time_ns);
}

void test_milliamperes(void)
{
    TEST_ASSERT_INT16_WITHIN(1, 1000, bringup_ma(CURRENT_Q13(1.0F)));
    TEST_ASSERT_INT16_WITHIN(1, -4400, bringup_ma(-8192));
    TEST_ASSERT_EQUAL_INT16(0, bringup_ma(0));
}
