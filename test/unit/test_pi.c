/* The PI controller: gains, both limits, wind-up and recovery, the preset, and the reference. */
#include "control/current_control.h"
#include "golden.h"
#include "golden_pi.h"
#include "unity.h"

static pi_t pi;
static const pi_gains_t gains = {
    .kp = 2048, /* 2 output counts per error count */
    .ki = 512,  /* half an output count per error count and step */
    .kc = 32735,
    .shift = 10
};

void setUp(void)
{
    pi.sum = 0;
}

void test_sequences_equal_the_reference(void)
{
    GOLDEN_EACH(pi, v) {
        pi_gains_t g = { v.kp, v.ki, v.kc, v.shift };
        if (v.op == 2u) {
            pi_preset(&pi, &g, v.err, v.limit);
        } else {
            pi.sum = (v.op == 1u) ? 0 : pi.sum;
            TEST_ASSERT_EQUAL_INT16_MESSAGE(v.out, pi_tick(&pi, &g, v.err, v.limit), golden_row(n));
        }
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.sum, pi.sum, golden_row(n));
    }
}

void test_a_step_of_each_kind(void)
{
    static const struct {
        const char *what;
        int32_t before;     /* the integrator, in errors of 512 */
        int16_t err, limit, out;
        int32_t excess;     /* of the output, in whole steps of 65536 */
    } cases[] = {
        { "the first output is proportional", 0, 100, 32767, 200, 0 },
        { "so is a negative one", 0, -100, 32767, -200, 0 },
        { "the integral follows a step later", 100, 100, 32767, 250, 0 },
        { "and stays without an error", 200, 0, 32767, 100, 0 },
        { "a negative error takes it back", 100, -100, 32767, -150, 0 },
        { "just inside the upper limit", 0, 499, 999, 998, 0 },
        { "just inside the lower limit", 0, -499, 999, -998, 0 },
        { "beyond the upper limit", 0, 10000, 1000, 1000, 296 },
        { "beyond the lower limit", 0, -10000, 1000, -1000, -296 },
        { "limit zero", 0, 5000, 0, 0, 156 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        pi.sum = cases[n].before * 512;
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].out, pi_tick(&pi, &gains, cases[n].err, cases[n].limit), cases[n].what);
        TEST_ASSERT_EQUAL_INT32_MESSAGE((cases[n].before + cases[n].err) * 512 - 2 * cases[n].excess * 32735, pi.sum, cases[n].what);
    }
}

void test_a_long_time_at_the_limit_does_not_wind_up(void)
{
    uint16_t n;
    for (n = 0; n < 5000u; n++) {
        TEST_ASSERT_EQUAL_INT16(3000, pi_tick(&pi, &gains, 2000, 3000));
    }
    /* back inside with the first error of the other sign */
    TEST_ASSERT_TRUE(pi_tick(&pi, &gains, -100, 3000) < 3000);
}
