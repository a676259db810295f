/* The forced angle of the start: acceleration, end speed, its time, the fraction that is kept, both directions. */
#include "control/transforms.h"
#include "golden.h"
#include "golden_forced_angle.h"
#include "unity.h"

static forced_angle_t forced;
static uint16_t tick;
static int16_t at_end;

void setUp(void)
{
    static const forced_angle_t at_rest;
    forced = at_rest;
    tick = 0;
    at_end = 0;
}

/** Periods: the speed grows before every second one, for two. */
static void run(const forced_angle_params_t *p, int16_t direction, uint16_t periods)
{
    while (periods-- != 0u) {
        if ((tick++ & 1u) == 0u) {
            forced.increase_q10 = p->increase_rate_q10;
            at_end = forced_angle_accelerate(&forced, p, direction, 2);
        }
        forced_angle_move(&forced);
    }
}

void test_ramp_equals_the_reference_in_both_directions(void)
{
    static const forced_angle_params_t params = { GOLDEN_FORCED_ANGLE_END_SPEED_Q10, GOLDEN_FORCED_ANGLE_INCREASE_RATE_Q10 };
    int16_t direction = 0;
    GOLDEN_EACH(forced_angle, v) {
        if (v.direction != direction) {
            direction = v.direction;
            setUp();
        }
        run(&params, direction, (uint16_t)(v.tick - tick));
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
    run(&odd, 1, 2);
    TEST_ASSERT_EQUAL_INT16(0, at_end);
    TEST_ASSERT_EQUAL_INT32(20, forced.speed_q10);
    run(&odd, 1, 1);
    TEST_ASSERT_TRUE(at_end != 0);
    TEST_ASSERT_EQUAL_INT32(25, forced.speed_q10);
}

void test_angle_moves_every_period_by_the_step_that_the_last_acceleration_left(void)
{
    static const forced_angle_params_t p = { 100000, 10 };
    for (int16_t direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        setUp();
        forced.speed_q10 = 1000;
        forced_angle_move(&forced);
        TEST_ASSERT_EQUAL_HEX32(0, forced.angle_q32); /* no step is known before the first acceleration */
        forced.increase_q10 = 10;
        (void)forced_angle_accelerate(&forced, &p, direction, 1);
        TEST_ASSERT_EQUAL_INT32(1010, forced.speed_q10);
        (void)forced_angle_accelerate(&forced, &p, direction, 2);
        TEST_ASSERT_EQUAL_INT32(1030, forced.speed_q10);
        TEST_ASSERT_EQUAL_HEX32(0, forced.angle_q32); /* it moves with the periods only */
        for (int32_t n = 1; n <= 4; n++) {
            forced_angle_move(&forced);
            TEST_ASSERT_EQUAL_HEX32((uint32_t)(direction * n * 1030 * 64), forced.angle_q32);
            TEST_ASSERT_EQUAL_INT32(1030, forced.speed_q10);
        }
    }
}

void test_speed_against_the_direction_moves_the_angle_back(void)
{
    static const forced_angle_params_t p = { 100000, 10 };
    forced.speed_q10 = -30;
    forced.increase_q10 = 10;
    (void)forced_angle_accelerate(&forced, &p, -1, 2);
    forced_angle_move(&forced);
    TEST_ASSERT_EQUAL_HEX32(640, forced.angle_q32);
}
