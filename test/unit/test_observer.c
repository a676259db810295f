/* The load observer: it converges to speed and load, is quick after a large innovation and calm again, and keeps to its formats. */
#include "control/observer.h"
#include "control/tuned.h"
#include "golden.h"
#include "golden_observer.h"
#include "golden_observer_ends.h"
#include "golden_observer_quick.h"
#include "unity.h"

#define OBSERVER(which) { \
    GOLDEN_OBSERVER_##which##DELTAT_Q32, GOLDEN_OBSERVER_##which##PER_TURN_Q12, GOLDEN_OBSERVER_##which##SHIFT, \
    GOLDEN_OBSERVER_##which##PER_CURRENT_Q16, GOLDEN_OBSERVER_##which##PER_UNIT_Q15, GOLDEN_OBSERVER_##which##INNOVATION_MAX, \
    GOLDEN_OBSERVER_##which##LOAD_MAX, GOLDEN_OBSERVER_##which##QUIET_Q16, GOLDEN_OBSERVER_##which##LOADED_Q16, \
    GOLDEN_OBSERVER_##which##FAST_Q16, GOLDEN_OBSERVER_##which##FULL_ERPM, GOLDEN_OBSERVER_##which##LOAD_FROM, \
    GOLDEN_OBSERVER_##which##LOAD_WIDTH, GOLDEN_OBSERVER_##which##LOAD_SLOPE_Q15, GOLDEN_OBSERVER_##which##GATE_ERPM, \
    GOLDEN_OBSERVER_##which##GATE_LOADED_ERPM \
}
#define EACH_DIRECTION(direction) for (int16_t direction = -1; direction <= 1; direction = (int16_t)(direction + 2))

/** The Hurst motor with its bare rotor, a rotor 150 times as heavy with slow loops, and a motor whose count of speed is 4 electrical rpm. */
#define FASTEST_Q16 (32700L * 65536)

static const observer_params_t rotors[] = { OBSERVER(), OBSERVER(H_), OBSERVER(QUICK_) };
static const observer_params_t *p;
static observer_t o;

static void begin(uint16_t heavy)
{
    static const observer_t zero;
    p = &rotors[heavy];
    o = zero;
}

void setUp(void)
{
    begin(0);
}

/* ---- against the reference ---- */

#define EXPECT_ROWS(name) \
    GOLDEN_EACH(name, v) { \
        if (v.op == 1u) { \
            begin(v.heavy); \
            observer_preset(&o, p, v.rho, v.ref, v.iq); \
        } else { \
            observer_schedule(&o, p, qm_abs(v.ref), v.iq); \
            observer_step(&o, p, v.rho, v.iq); \
        } \
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.omega, o.omega_q16, golden_row(n)); \
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.load, o.load_q16, golden_row(n)); \
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(v.rho, o.rho_q32, golden_row(n)); \
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.rate, o.rate_q16, golden_row(n)); \
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.large, o.gate_erpm, golden_row(n)); \
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.quick, o.fast_share_q15, golden_row(n)); \
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.part, o.share_q15, golden_row(n)); \
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.load_q26, observer_load_q26(&o, p), golden_row(n)); \
    }

void test_sequences_equal_the_reference(void)
{
    EXPECT_ROWS(observer)
}

void test_speeds_in_counts_of_4_electrical_rpm_and_half_a_turn_in_a_step_equal_the_reference(void)
{
    EXPECT_ROWS(observer_quick)
}

void test_ends_of_the_formats_equal_the_reference(void)
{
    EXPECT_ROWS(observer_ends)
}

/* ---- a shaft in integers, turned by a current against a load, both in counts of q current ---- */

static int32_t shaft_q16;      /* electrical rpm */
static uint32_t shaft_rho_q32;

static void shaft_step(int16_t iq_q13, int16_t load_q13)
{
    int32_t before = shaft_q16;
    int64_t middle;
    shaft_q16 += (int32_t)(iq_q13 - load_q13) * (int32_t)p->per_current_q16 / (1 << p->shift);
    middle = ((int64_t)before + shaft_q16) / 2 * 8 * p->deltat_q32 / 65536;
    shaft_rho_q32 = (uint32_t)((uint64_t)(shaft_rho_q32 + (uint64_t)middle) & UINT32_C(0xFFFFFFFF));
}

/** Speed and load in balance, seen by the observer from now on. */
static void balanced(uint16_t heavy, int16_t erpm, int16_t load_q13)
{
    begin(heavy);
    shaft_q16 = (int32_t)erpm * 65536;
    observer_preset(&o, p, shaft_rho_q32, erpm, load_q13);
}

/** Steps with the speed held: the shaft's current is its load, the observer sees `iq_q13` of it. */
static void run(uint16_t steps, int16_t ref_erpm, int16_t iq_q13, int16_t load_q13)
{
    while (steps-- != 0u) {
        observer_schedule(&o, p, qm_abs(ref_erpm), iq_q13);
        shaft_step(iq_q13, load_q13);
        observer_step(&o, p, shaft_rho_q32, iq_q13);
    }
}

/** Load and speed that the observer does not know of are found: no offset stays. */
void test_converges_to_speed_and_load_in_both_directions_and_for_a_heavy_rotor(void)
{
    static const struct {
        const char *what;
        uint16_t heavy, steps;
        int16_t erpm, load_q13, off_erpm, off_q13;
    } cases[] = {
        { "speed too low by 100", 0, 800, 5000, 0, -100, 0 },
        { "speed too high by 1000", 0, 800, 5000, 0, 1000, 0 },
        { "load of 1000 counts", 0, 800, 5000, 1000, 0, -1000 },
        { "half of a load", 0, 800, 5000, 2000, 0, -1000 },
        { "a load that is not there", 0, 800, 5000, 0, 0, 1500 },
        { "a small load", 0, 800, 5000, 60, 0, -60 },
        { "a small load at 150 rpm", 0, 1600, 750, 60, 0, -60 },
        { "braking", 0, 800, 5000, -900, 0, 900 },
        { "a heavy rotor's load", 1, 2000, 5000, 1000, 0, -1000 },
        { "a heavy rotor's small load at 300 rpm, where the square of its rate is below 2^-16", 1, 15000, 1000, 60, 0, -60 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        EACH_DIRECTION(direction) {
            int16_t erpm = (int16_t)(direction * cases[n].erpm), load = (int16_t)(direction * cases[n].load_q13);
            balanced(cases[n].heavy, erpm, load);
            observer_preset(&o, p, shaft_rho_q32, (int16_t)(erpm + direction * cases[n].off_erpm),
                            (int16_t)(load + direction * cases[n].off_q13));
            run(cases[n].steps, erpm, load, load);
            TEST_ASSERT_INT16_WITHIN_MESSAGE(3, erpm, observer_speed(&o), cases[n].what);
            TEST_ASSERT_INT16_WITHIN_MESSAGE(10, load, observer_load(&o, p), cases[n].what);
        }
    }
}

void test_follows_a_current_step_without_taking_it_for_a_load(void)
{
    balanced(0, 2500, 0);
    run(40, 2500, 500, 0); /* 2240 electrical rpm faster in 16 ms */
    TEST_ASSERT_INT16_WITHIN(60, (int16_t)(shaft_q16 / 65536), observer_speed(&o));
    TEST_ASSERT_INT16_WITHIN(30, 0, observer_load(&o, p));
}

/* ---- rates ---- */

static int16_t rate_at(int16_t ref_erpm, int16_t load_units, q15_t fast_share_q15)
{
    o.load_q16 = (int32_t)load_units * 65536;
    o.fast_share_q15 = fast_share_q15;
    observer_schedule(&o, p, qm_abs(ref_erpm), -8000); /* all of the load makes current */
    return o.rate_q16;
}

void test_rate_follows_load_innovation_and_speed(void)
{
    enum { QUIET = GOLDEN_OBSERVER_QUIET_Q16, LOADED = GOLDEN_OBSERVER_LOADED_Q16, QUICK = GOLDEN_OBSERVER_FAST_Q16 };
    static const struct {
        const char *what;
        int16_t ref_erpm, load;
        q15_t quick;
        int16_t rate, share;
    } cases[] = {
        { "without load", 5000, 0, 0, QUIET, 32767 },
        { "up to a small load", 5000, 103, 0, QUIET, 32767 },
        { "halfway", 5000, 103 + 51, 0, (QUIET + LOADED) / 2, 32767 },
        { "under load", 5000, 206, 0, LOADED, 32767 },
        { "and a large one", 5000, 4574, 0, LOADED, 32767 },
        { "after a large innovation", 5000, 0, 32767, QUICK, 32767 },
        { "and under load", 5000, 206, 32767, QUICK, 32767 },
        { "as it fades", 5000, 0, 16384, QUIET + (QUICK - QUIET) / 2, 32767 },
        { "half the speed without load", 1222, 0, 0, QUIET / 2, 16384 },
        { "and after a large innovation", 1222, 0, 32767, QUICK / 2, 16384 },
        { "half the speed is enough under load", 1222, 206, 0, LOADED, 32767 },
        { "a quarter is not", 611, 206, 0, LOADED / 2, 16384 },
        { "nor after a large innovation", 611, 206, 32767, QUICK / 2, 16384 },
        { "standstill", 0, 206, 32767, 0, 0 },
        { "full speed", 2444, 0, 0, QUIET, 32767 },
        { "the fastest", 32767, 0, 0, QUIET, 32767 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        EACH_DIRECTION(direction) {
            int16_t rate = rate_at((int16_t)(direction * cases[n].ref_erpm), (int16_t)(-direction * cases[n].load), cases[n].quick);
            TEST_ASSERT_INT16_WITHIN_MESSAGE(10 + cases[n].rate / 80, cases[n].rate, rate, cases[n].what); /* the slope is rounded, too */
            TEST_ASSERT_INT16_WITHIN_MESSAGE(300, cases[n].share, o.share_q15, cases[n].what);
        }
    }
    TEST_ASSERT_EQUAL_INT16(QUIET - 1, rate_at(INT16_MIN, 0, 0));
}

void test_a_large_innovation_is_smaller_under_load_and_larger_at_speed(void)
{
    static const int16_t cases[][3] = { /* speed, load, and from where on an innovation is large */
        { 0, 0, 149 }, { 2500, 0, 149 + 78 }, { -2500, 0, 149 + 78 }, { 0, 206, 34 }, { 0, -4574, 34 }, { 0, 155, 92 },
        { 27500, 206, 34 + 859 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        (void)rate_at(cases[n][0], cases[n][1], 0);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(2, cases[n][2], o.gate_erpm, golden_row(n));
    }
}

/** Else a loop that the quick rate makes swing would go on swinging: with an L far from the header's, say. */
void test_the_longer_large_innovations_go_on_the_larger_they_must_be(void)
{
    static const uint16_t cases[][2] = { { 0, 149 }, { 4, 151 }, { 128, 223 }, { 256, 298 }, { 4000, 2477 } };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        o.gate_level = cases[n][0];
        (void)rate_at(0, 0, 0);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(2, cases[n][1], o.gate_erpm, golden_row(n));
    }
    TEST_ASSERT_EQUAL_INT16(32767, observer_gate(20000, 256));
    TEST_ASSERT_EQUAL_INT16(32766, observer_gate(16383, 256));
}

void test_is_quick_after_a_large_innovation_and_calm_50_ms_later(void)
{
    EACH_DIRECTION(direction) {
        uint16_t steps = 0;
        balanced(0, (int16_t)(direction * 2500), 0);
        TEST_ASSERT_TRUE(observer_gate_is_closed(&o));
        run(1, 2500, 0, 0);
        TEST_ASSERT_EQUAL_INT16(0, o.fast_share_q15);
        observer_preset(&o, p, shaft_rho_q32, (int16_t)(direction * 2500 + 400), 0);
        run(1, 2500, 0, 0);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(0, o.fast_share_q15, "the start is unrest");
        observer_preset(&o, p, shaft_rho_q32, (int16_t)(direction * 2500 + 400), 0);
        o.gate_level = 0;
        run(1, 2500, 0, 0);
        TEST_ASSERT_EQUAL_INT16(32767, o.fast_share_q15);
        TEST_ASSERT_FALSE(observer_gate_is_closed(&o));
        observer_preset(&o, p, shaft_rho_q32, (int16_t)(direction * 2500), 0);
        o.fast_share_q15 = 32767;
        while (!observer_gate_is_closed(&o)) {
            run(1, 2500, 0, 0);
            steps++;
        }
        TEST_ASSERT_UINT16_WITHIN(2, 133, steps); /* 0.4 ms each */
        o.fast_share_q15 = 4096; /* an eighth */
        TEST_ASSERT_FALSE(observer_gate_is_closed(&o));
        o.fast_share_q15 = 4095;
        TEST_ASSERT_TRUE(observer_gate_is_closed(&o));
    }
}

/** The observer after a step at standstill with this innovation, the angle 65536 counts further for a speed of 2.3. */
static q15_t quick_after(uint32_t counts, q15_t before)
{
    begin(0);
    observer_schedule(&o, p, 0, 0);
    o.fast_share_q15 = before;
    o.gate_erpm = 100;
    observer_step(&o, p, counts << 16, 0);
    return o.fast_share_q15;
}

void test_innovation_that_is_barely_large_is_answered_less_quickly(void)
{
    TEST_ASSERT_EQUAL_INT16(0, quick_after(40, 0));                  /* 92 erpm */
    TEST_ASSERT_EQUAL_INT16(OBSERVER_FAST_HALF_Q15, quick_after(45, 0));  /* 103 */
    TEST_ASSERT_EQUAL_INT16(OBSERVER_FAST_HALF_Q15, quick_after(65, 0));  /* 149 */
    TEST_ASSERT_EQUAL_INT16(32767, quick_after(67, 0));              /* 153 */
    TEST_ASSERT_EQUAL_INT16(20000 - 312, quick_after(45, 20000)); /* and makes a quick one no slower */
}

/** Dead time disturbs a rotor that its load slows down as much as one without a load. */
void test_load_that_takes_no_current_counts_as_none(void)
{
    enum { QUIET = GOLDEN_OBSERVER_QUIET_Q16, LOADED = GOLDEN_OBSERVER_LOADED_Q16 };
    EACH_DIRECTION(direction) {
        int16_t units = (int16_t)(direction * 4000), all = (int16_t)(direction * 8000), least = (int16_t)(GOLDEN_OBSERVER_LOAD_FROM * 65536LL / p->per_current_q16);
        o.load_q16 = (int32_t)units * 65536;
        o.fast_share_q15 = 0;
        observer_schedule(&o, p, 10000, all);
        TEST_ASSERT_INT16_WITHIN(LOADED / 100, LOADED, o.rate_q16);
        observer_schedule(&o, p, 10000, (int16_t)-all);
        TEST_ASSERT_INT16_WITHIN(LOADED / 100, LOADED, o.rate_q16); /* of either sign */
        observer_schedule(&o, p, 10000, (int16_t)(direction * (least - 2)));
        TEST_ASSERT_INT16_WITHIN(2, QUIET, o.rate_q16);
        observer_schedule(&o, p, 10000, (int16_t)(direction * (least + least / 2)));
        TEST_ASSERT_INT16_WITHIN((LOADED - QUIET) / 20, (QUIET + LOADED) / 2, o.rate_q16);
        o.load_q16 = 0;
        observer_schedule(&o, p, 10000, all);
        TEST_ASSERT_INT16_WITHIN(2, QUIET, o.rate_q16); /* nor does current that only makes speed */
    }
}

/* ---- innovations that do not end ---- */

static uint16_t wrong_after(uint16_t steps, uint32_t counts)
{
    while (steps-- != 0u) {
        o.omega_q16 = 0;
        observer_step(&o, p, o.rho_q32 + (counts << 16), 0);
    }
    return o.wrong_steps;
}

void test_steps_with_more_than_dead_time_and_a_32nd_of_the_speed_are_counted_and_taken_back(void)
{
    observer_params_t large_at_20000 = *p;
    observer_schedule(&o, p, 3200, 8000);
    TEST_ASSERT_INT16_WITHIN(2, 2 * (149 + 100), o.wrong_erpm); /* without load dead time may make a light rotor hunt */
    o.load_q16 = 4000L * 65536;
    observer_schedule(&o, p, 3200, 8000);
    TEST_ASSERT_INT16_WITHIN(2, 149 + 100, o.wrong_erpm);
    o.load_q16 = 0;
    TEST_ASSERT_EQUAL_UINT16(30, wrong_after(30, 200)); /* 458 erpm */
    TEST_ASSERT_EQUAL_UINT16(20, wrong_after(10, 60)); /* 137 */
    TEST_ASSERT_EQUAL_UINT16(0, wrong_after(25, 0));
    TEST_ASSERT_EQUAL_UINT16(10, wrong_after(10, 400));
    TEST_ASSERT_EQUAL_UINT16(20, wrong_after(10, (uint32_t)-400)); /* to either side */
    o.load_q16 = 0;
    large_at_20000.gate_erpm = 20000;
    observer_schedule(&o, &large_at_20000, 3200, 8000);
    TEST_ASSERT_INT16_WITHIN(2, 32766, o.wrong_erpm); /* the end of its format */
}

/* ---- the innovation: how much further the angle turned ---- */

/** Steps at standstill, each with an angle 400 * 65536 further: a large innovation. */
static void unrest(uint16_t steps)
{
    while (steps-- != 0u) {
        o.omega_q16 = 0;
        observer_step(&o, p, o.rho_q32 + 400ul * 65536ul, 0);
    }
}

/** Quick rates that shake the speed would call for quick rates: after a tenth of a second they have to calm down before the next time. */
void test_large_innovations_for_long_are_answered_only_from_calm(void)
{
    uint16_t fading = 0;
    o.gate_erpm = 100;
    unrest(250);
    TEST_ASSERT_EQUAL_UINT16(996, o.gate_level);
    TEST_ASSERT_EQUAL_INT16(32767, o.fast_share_q15);
    unrest(1);
    TEST_ASSERT_EQUAL_INT16(32767 - 511, o.fast_share_q15);
    while (!observer_gate_is_closed(&o)) {
        unrest(1);
        fading++;
    }
    TEST_ASSERT_UINT16_WITHIN(2, 132, fading);
    unrest(1);
    TEST_ASSERT_EQUAL_INT16(32767, o.fast_share_q15);
    unrest(5000);
    TEST_ASSERT_UINT16_WITHIN(4, 4000, o.gate_level);
    o.omega_q16 = 0;
    for (uint16_t n = 0; n < 4200u; n++) {
        observer_step(&o, p, o.rho_q32, 0);
    }
    TEST_ASSERT_EQUAL_UINT16(0, o.gate_level);
    unrest(2);
    TEST_ASSERT_EQUAL_UINT16(4, o.gate_level);
    TEST_ASSERT_EQUAL_INT16(32767, o.fast_share_q15);
}

/** A step at standstill that turns by so many counts. */
static void turned_by(int16_t counts)
{
    o.omega_q16 = 0;
    observer_step(&o, p, qm_turn_add(o.rho_q32, (uint32_t)((int32_t)counts * 65536)), 0);
}

/** After a large innovation to one side, one to the other, and a calm until the quick rate has faded to this; then a large one again. */
void test_large_innovations_to_both_sides_are_answered_only_from_calm(void)
{
    EACH_DIRECTION(direction) {
        begin(0);
        observer_schedule(&o, p, 0, 0);
        o.gate_level = 0;
        o.gate_erpm = 100;
        turned_by((int16_t)(direction * 400));
        turned_by((int16_t)(direction * 400));
        TEST_ASSERT_EQUAL_UINT16(4, o.gate_level); /* to one side: a step of the load */
        turned_by((int16_t)(direction * -400));
        TEST_ASSERT_EQUAL_UINT16(OBSERVER_GATE_STEPS, o.gate_level);
        TEST_ASSERT_EQUAL_INT16(32767, o.fast_share_q15); /* the first one back is answered still */
        turned_by((int16_t)(direction * 400));
        TEST_ASSERT_EQUAL_INT16(32767 - 511, o.fast_share_q15);
        while (!observer_gate_is_closed(&o)) {
            turned_by(0);
        }
        turned_by((int16_t)(direction * 400));
        TEST_ASSERT_EQUAL_INT16(32767, o.fast_share_q15);
        TEST_ASSERT_UINT16_WITHIN(600, 1500, o.gate_level);
    }
}

void test_one_side_after_the_other_with_calm_between_is_no_unrest(void)
{
    begin(0);
    observer_schedule(&o, p, 0, 0);
    o.gate_level = 0;
    o.gate_erpm = 100;
    turned_by(400);
    while (!observer_gate_is_closed(&o)) {
        turned_by(0);
    }
    turned_by(-400);
    TEST_ASSERT_EQUAL_INT16(32767, o.fast_share_q15);
    TEST_ASSERT_UINT16_WITHIN(8, 4 * 132, o.gate_level);
}

static int16_t innovation(uint32_t from_q32, uint32_t to_q32, int16_t erpm)
{
    o.rho_q32 = from_q32;
    return observer_innovation(&o, p, to_q32, erpm);
}

void test_innovation_is_the_turn_that_the_speed_does_not_explain(void)
{
    static const struct {
        const char *what;
        uint32_t turned_q32;
        int16_t erpm, innovation;
    } cases[] = {
        { "as far as the speed says", UINT32_C(8) * 5000 * 3579, 5000, 0 },
        { "backwards", UINT32_C(0) - UINT32_C(8) * 5000 * 3579, -5000, 0 },
        { "further by 1000", UINT32_C(8) * 6000 * 3579, 5000, 1000 },
        { "less far by 1000", UINT32_C(8) * 4000 * 3579, 5000, -1000 },
        { "from standstill", UINT32_C(8) * 300 * 3579, 0, 300 },
        { "more than half a turn in a step wraps alike", UINT32_C(8) * 32000 * 3579, 32700, -700 },
        { "limited, as the load's step needs it", UINT32_C(8) * 18000 * 3579, 0, 16383 },
        { "on both sides", UINT32_C(0) - UINT32_C(8) * 18000 * 3579, 0, -16383 },
        { "half a turn is the limit, too", UINT32_C(0x80000000), 0, -16383 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        static const uint32_t from[] = { 0, UINT32_C(0x12345678), UINT32_C(0xFFFF0000) };
        for (unsigned k = 0; k < 3u; k++) {
            uint32_t to = (uint32_t)(((uint64_t)from[k] + cases[n].turned_q32) & UINT32_C(0xFFFFFFFF));
            TEST_ASSERT_INT16_WITHIN_MESSAGE(1, cases[n].innovation, innovation(from[k], to, cases[n].erpm), cases[n].what);
            TEST_ASSERT_EQUAL_UINT32(to, o.rho_q32);
        }
    }
}

/** A count of the angle is more than two electrical rpm: rounded down they would make an offset of one. */
void test_innovation_is_rounded_to_the_nearest(void)
{
    int32_t sum = 0;
    uint32_t turned;
    for (turned = 0; turned < UINT32_C(655360); turned += 640u) { /* ten counts up, ten down */
        sum += innovation(0, turned, 0) + innovation(turned, 0, 0);
    }
    TEST_ASSERT_INT32_WITHIN(20, 0, sum); /* of 2048 */
    TEST_ASSERT_EQUAL_INT16(0, innovation(0, 32767, 0));
    TEST_ASSERT_EQUAL_INT16(2, innovation(0, 32768, 0));
    TEST_ASSERT_EQUAL_INT16(0, innovation(32768, 0, 0));
    TEST_ASSERT_EQUAL_INT16(-2, innovation(32769, 0, 0));
}

/** At a long period a count is less, and the limit is the count's: an eighth of a turn. */
void test_innovation_at_other_periods_ends_at_an_eighth_of_a_turn(void)
{
    observer_params_t other = rotors[0];
    p = &other;
    other.per_turn_q12 = 3348; /* 140 us */
    TEST_ASSERT_EQUAL_INT16(6695, innovation(0, UINT32_C(9000) << 16, 0));
    TEST_ASSERT_EQUAL_INT16(-6696, innovation(UINT32_C(9000) << 16, 0, 0));
    other.per_turn_q12 = 2048;
    TEST_ASSERT_EQUAL_INT16(1, innovation(0, UINT32_C(1) << 16, 0));
    other.per_turn_q12 = 2047;
    TEST_ASSERT_EQUAL_INT16(0, innovation(0, UINT32_C(1) << 16, 0));
}

void test_load_step_keeps_every_bit_of_the_squared_rate(void)
{
    static const struct {
        int16_t innovation, rate_q16;
        int32_t step;
    } cases[] = {
        { 0, 18118, 0 }, { 1, 256, 8 }, { -1, 256, -8 }, { 100, 181, 399 }, { 100, 9, 0 }, { 100, 10, 1 }, { 1000, 2612, INT32_C(832830) },
        { -1000, 2612, -INT32_C(832831) }, { 16383, 18118, INT32_C(656483776) }, { -16383, 18118, -INT32_C(656483777) },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_EQUAL_INT32_MESSAGE(cases[n].step, observer_load_step(p, cases[n].innovation, cases[n].rate_q16), golden_row(n));
    }
}

/* ---- ends ---- */

void test_speed_ends_at_32700_and_load_at_its_largest(void)
{
    EACH_DIRECTION(direction) {
        uint16_t n;
        observer_preset(&o, p, 0, (int16_t)(direction * 32000), 0);
        o.rate_q16 = 0;
        for (n = 0; n < 100u; n++) {
            observer_step(&o, p, 0, (int16_t)(direction * 10240));
            TEST_ASSERT_TRUE(direction * observer_speed(&o) <= 32700 && direction * observer_speed(&o) >= 32000);
        }
        TEST_ASSERT_EQUAL_INT16((direction > 0) ? 32700 : -32700, observer_speed(&o));
        observer_preset(&o, p, 0, 0, 0);
        for (n = 0; n < 100u; n++) { /* always a quarter of a turn further behind */
            observer_schedule(&o, p, 5000, 0);
            observer_step(&o, p, qm_turn_sub(o.rho_q32, (direction > 0) ? UINT32_C(0x40000000) : UINT32_C(0xC0000000)), 0);
        }
        TEST_ASSERT_EQUAL_INT16(direction * GOLDEN_OBSERVER_LOAD_MAX, qm_hi(o.load_q16));
        TEST_ASSERT_INT16_WITHIN(2, (int16_t)(direction * 5120), observer_load(&o, p));
    }
}

void test_speed_and_load_keep_their_fractions_up_to_their_ends(void)
{
    TEST_ASSERT_EQUAL_INT32(FASTEST_Q16, observer_sum(FASTEST_Q16 - 5, 6));
    TEST_ASSERT_EQUAL_INT32(FASTEST_Q16 - 1, observer_sum(FASTEST_Q16 - 5, 4));
    TEST_ASSERT_EQUAL_INT32(-FASTEST_Q16, observer_sum(5 - FASTEST_Q16, -6));
    TEST_ASSERT_EQUAL_INT32(-FASTEST_Q16, observer_sum(-FASTEST_Q16, -1));
    TEST_ASSERT_EQUAL_INT32(1 - FASTEST_Q16, observer_sum(5 - FASTEST_Q16, -4));
    EACH_DIRECTION(direction) {
        int32_t load_q16 = direction * (INT32_C(65536) * GOLDEN_OBSERVER_LOAD_MAX - 1000);
        balanced(0, 0, 0);
        o.load_q16 = load_q16;
        observer_step(&o, p, shaft_rho_q32, (int16_t)(direction * 5120)); /* no rate: nothing corrects it */
        TEST_ASSERT_EQUAL_INT32(load_q16, o.load_q16);
    }
    o.load_q16 = INT32_C(65536);
    {
        observer_params_t half = rotors[0], less = rotors[0]; /* half a count of current a unit */
        half.per_unit_q15 = 16384u;
        less.per_unit_q15 = 16383u;
        TEST_ASSERT_EQUAL_INT16(1, observer_load(&o, &half));
        TEST_ASSERT_EQUAL_INT16(0, observer_load(&o, &less));
    }
    o.load_q16 = 32767; /* half a unit */
    TEST_ASSERT_EQUAL_INT32(0, observer_load_q26(&o, p));
    o.load_q16 = 32768;
    TEST_ASSERT_EQUAL_INT32(GOLDEN_OBSERVER_PER_UNIT_Q15 / 4, observer_load_q26(&o, p));
}

/* ---- preset ---- */

void test_preset_is_bumpless(void)
{
    static const int16_t currents[] = { 0, 1, 60, 1310, 5120, -1, -60, -5120 };
    for (unsigned n = 0; n < sizeof currents / sizeof currents[0]; n++) {
        EACH_DIRECTION(direction) {
            balanced(0, (int16_t)(direction * 5000), currents[n]);
            o.fast_share_q15 = 32767;
            observer_preset(&o, p, shaft_rho_q32, (int16_t)(direction * 5000), currents[n]);
            TEST_ASSERT_INT16_WITHIN_MESSAGE(2, currents[n], observer_load(&o, p), golden_row(n));
            TEST_ASSERT_EQUAL_INT16_MESSAGE(direction * 5000, observer_speed(&o), golden_row(n));
            TEST_ASSERT_TRUE(observer_gate_is_closed(&o));
            run(20, (int16_t)(direction * 5000), currents[n], currents[n]);
            TEST_ASSERT_INT16_WITHIN_MESSAGE(2, (int16_t)(direction * 5000), observer_speed(&o), golden_row(n));
            TEST_ASSERT_INT16_WITHIN_MESSAGE(4, currents[n], observer_load(&o, p), golden_row(n));
        }
    }
}
