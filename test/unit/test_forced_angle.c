/* The forced angle of the start: acceleration, end speed, its time, the fraction that is kept, both directions. */
#include "control/forced_angle.h"
#include "golden.h"
#include "golden_forced_angle.h"
#include "unity.h"

static const forced_angle_params_t params = { GOLDEN_FORCED_ANGLE_END_SPEED_Q10, GOLDEN_FORCED_ANGLE_INCREASE_RATE_Q10 };
static forced_angle_t forced;

void setUp(void)
{
    forced.speed_q10 = 0;
    forced.angle_q32 = 0;
}

void tearDown(void)
{
}

static int16_t run(int16_t direction, uint16_t periods)
{
    int16_t at_end = 0;
    while (periods-- != 0u) {
        at_end = forced_angle_tick(&forced, &params, direction);
    }
    return at_end;
}

void test_ramp_equals_the_reference_in_both_directions(void)
{
    int16_t direction = 0, at_end = 0;
    uint16_t tick = 0;
    uint32_t n;
    for (n = 0; n < GOLDEN_FORCED_ANGLE_ROWS; n++) {
        golden_forced_angle_t v = golden_forced_angle[n];
        if (v.direction != direction) {
            direction = v.direction;
            tick = 0;
            setUp();
        }
        while (tick < v.tick) {
            at_end = forced_angle_tick(&forced, &params, direction);
            tick++;
        }
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.speed, forced.speed_q10, golden_row(n));
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(v.angle, forced.angle_q32, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE((int16_t)v.at_end, at_end, golden_row(n));
    }
}

void test_end_speed_is_reached_after_1398_milliseconds_and_not_earlier(void)
{
    TEST_ASSERT_EQUAL_INT16(0, run(1, 27961));
    TEST_ASSERT_EQUAL_INT32(279610, forced.speed_q10);
    TEST_ASSERT_TRUE(run(1, 1) != 0); /* 27962 * 50 us */
    TEST_ASSERT_EQUAL_INT32(279620, forced.speed_q10);
}

void test_speed_stays_at_the_end_speed(void)
{
    (void)run(1, 27962);
    TEST_ASSERT_TRUE(run(1, 10000) != 0);
    TEST_ASSERT_EQUAL_INT32(279620, forced.speed_q10);
}

void test_end_speed_that_is_not_a_multiple_of_the_rate_is_not_passed(void)
{
    static const forced_angle_params_t odd = { 25, 10 };
    TEST_ASSERT_EQUAL_INT16(0, forced_angle_tick(&forced, &odd, 1));
    TEST_ASSERT_EQUAL_INT16(0, forced_angle_tick(&forced, &odd, 1));
    TEST_ASSERT_TRUE(forced_angle_tick(&forced, &odd, 1) != 0);
    TEST_ASSERT_EQUAL_INT32(25, forced.speed_q10);
}

void test_end_speed_is_1000_rpm_of_5_pole_pairs(void)
{
    angle_t before;
    (void)run(1, 27962);
    before = forced_angle(&forced);
    (void)run(1, 240); /* 12 ms: one electrical turn at 83.333 Hz */
    TEST_ASSERT_INT16_WITHIN(2, 0, (int16_t)(uint16_t)(forced_angle(&forced) - before));
}

void test_fraction_below_a_count_is_kept(void)
{
    static const forced_angle_params_t slow = { 100, 100 }; /* 0.0977 counts a period */
    uint16_t n;
    for (n = 0; n < 10240u; n++) {
        (void)forced_angle_tick(&forced, &slow, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(1000, forced_angle(&forced));
}

void test_backwards_is_the_mirror_of_forwards(void)
{
    uint32_t ahead;
    (void)run(1, 5000);
    ahead = forced.angle_q32;
    setUp();
    (void)run(-1, 5000);
    TEST_ASSERT_EQUAL_HEX32(0u, (uint32_t)((uint64_t)(ahead + (uint64_t)forced.angle_q32) & UINT32_C(0xFFFFFFFF)));
    TEST_ASSERT_EQUAL_INT32(50000, forced.speed_q10); /* a magnitude */
}

void test_forwards_increases_the_angle(void)
{
    (void)run(1, 1000);
    TEST_ASSERT_INT16_WITHIN(1, 4887, (int16_t)forced_angle(&forced)); /* 10/1024 * 1000 * 1001 / 2 */
}
