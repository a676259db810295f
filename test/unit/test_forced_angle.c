/* The forced angle of the start: acceleration, end speed, its time, the fraction that is kept, both directions. */
#include "control/forced_angle.h"
#include "golden.h"
#include "golden_forced_angle.h"
#include "unity.h"

static forced_angle_t forced;

void setUp(void)
{
    static const forced_angle_t at_rest;
    forced = at_rest;
}

static int16_t run(const forced_angle_params_t *p, int16_t direction, uint16_t periods)
{
    int16_t at_end = 0;
    while (periods-- != 0u) {
        forced.increase_q10 = p->increase_rate_q10;
        at_end = forced_angle_tick(&forced, p, direction);
    }
    return at_end;
}

void test_ramp_equals_the_reference_in_both_directions(void)
{
    static const forced_angle_params_t params = { GOLDEN_FORCED_ANGLE_END_SPEED_Q10, GOLDEN_FORCED_ANGLE_INCREASE_RATE_Q10 };
    int16_t direction = 0, at_end = 0;
    uint16_t tick = 0;
    GOLDEN_EACH(forced_angle, v) {
        if (v.direction != direction) {
            direction = v.direction;
            tick = 0;
            setUp();
        }
        at_end = run(&params, direction, (uint16_t)(v.tick - tick));
        tick = v.tick;
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.speed, forced.speed_q10, golden_row(n));
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(v.angle, forced.angle_q32, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((uint16_t)(v.angle >> 16), forced_angle(&forced), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE((int16_t)v.at_end, at_end, golden_row(n));
    }
    TEST_ASSERT_EQUAL_INT32(279620, forced.speed_q10); /* 1000 rpm of 5 pole pairs, and it stays there */
}

void test_end_speed_that_is_not_a_multiple_of_the_rate_is_not_passed(void)
{
    static const forced_angle_params_t odd = { 25, 10 };
    TEST_ASSERT_EQUAL_INT16(0, run(&odd, 1, 2));
    TEST_ASSERT_TRUE(run(&odd, 1, 1) != 0);
    TEST_ASSERT_EQUAL_INT32(25, forced.speed_q10);
}
