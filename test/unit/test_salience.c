/* Salient motors: flux and torque with a d current, and the d current of the least current for the torque. */
#include "hurst_params.h"

#include "control/motor_model.h"
#include "golden.h"
#include "golden_salience.h"
#include "golden_salience_least.h"
#include "unity.h"

#define DOUBLE_Q13 12412u /* 6.67 A: 0.01 V s and 1.5 mH between the axes */

void setUp(void)
{
}

static salience_t at(uint16_t double_q13, current_q13_t id_q13, q15_t kfi)
{
    salience_t s = { .id_q13 = id_q13, .least_q13 = 0, .flux_q13 = 0, .per_flux_q15 = 0 };
    salience_update(&s, double_q13, kfi);
    return s;
}

void test_flux_torque_current_and_kphi_equal_the_reference(void)
{
    GOLDEN_EACH(salience, v) {
        salience_t s = at(v.doubles, v.i_d, v.kfi);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.flux, s.flux_q13, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.per_flux, s.per_flux_q15, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.torque, salience_torque(&s, v.i_q), golden_row(n));
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.current_q26, salience_current_q26(&s, (int32_t)v.i_q * 8192), golden_row(n));
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.flux_kfi, salience_kfi(&s, v.inv_kfi), golden_row(n));
    }
}

void test_least_current_equals_the_reference(void)
{
    salience_t s = at(DOUBLE_Q13, 0, 0);
    GOLDEN_EACH(salience_least, v) {
        uint16_t step, steps = (uint16_t)((n % 31u == 30u) ? 70u : 1u); /* the last row of a case is the hundredth step */
        if (v.start) {
            s.least_q13 = 0;
        }
        for (step = 0; step < steps; step++) {
            salience_least(&s, v.doubles, v.i_q, 1);
        }
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.least, s.least_q13, golden_row(n));
    }
}

void test_least_current_is_least(void)
{
    int16_t i_q;
    for (i_q = 1500; i_q <= 6300; i_q = (int16_t)(i_q + 400)) {
        salience_t s = at(DOUBLE_Q13, 0, 0);
        uint16_t n;
        int32_t d, found;
        for (n = 0; n < 200u; n++) {
            salience_least(&s, DOUBLE_Q13, i_q, 1);
        }
        d = s.least_q13;
        found = d * d + (int32_t)i_q * i_q;
        for (n = 0; n < 40u; n++) { /* other d currents with the same torque, (I + d) i_q, need as much current or more */
            int32_t other_d = d / 2 + d * (int32_t)n / 40, other_q = ((int32_t)DOUBLE_Q13 + d) * i_q / ((int32_t)DOUBLE_Q13 + other_d) + 1;
            int32_t other = other_d * other_d + other_q * other_q;
            TEST_ASSERT_TRUE_MESSAGE(other > found - found / 2000, golden_row((uint32_t)i_q));
        }
    }
}

void test_d_current_that_is_not_wanted_goes(void)
{
    salience_t s = at(DOUBLE_Q13, 0, 0);
    uint16_t n;
    s.least_q13 = 1300;
    salience_least(&s, DOUBLE_Q13, 4000, 0);
    TEST_ASSERT_EQUAL_INT16(1300 - 325, s.least_q13);
    for (n = 0; n < 100u; n++) {
        salience_least(&s, DOUBLE_Q13, 4000, 0);
    }
    TEST_ASSERT_EQUAL_INT16(0, s.least_q13);
}

void test_without_d_current_nothing_changes(void)
{
    salience_t s = at(DOUBLE_Q13, 0, 0);
    TEST_ASSERT_EQUAL_INT16(-4321, salience_torque(&s, -4321));
    TEST_ASSERT_EQUAL_INT32(-4321L * 8192 + 77, salience_current_q26(&s, -4321L * 8192 + 77));
    TEST_ASSERT_EQUAL_INT32(6351, salience_kfi(&s, 6351));
}

void test_weak_magnets_make_a_d_current_count_more(void)
{
    salience_t weak = at(DOUBLE_Q13, -1241, 8192); /* a tenth of I, and 1/Kphi a quarter larger */
    TEST_ASSERT_EQUAL_UINT16(8192 + 8192 / 8, (weak.flux_q13 + 3u) & ~7u);
}

void test_torque_beyond_the_format_is_the_format_s_end(void)
{
    salience_t s = at(DOUBLE_Q13, 6000, 0);
    TEST_ASSERT_EQUAL_INT32(salience_current_q26(&s, SALIENCE_MOST_Q26), salience_current_q26(&s, INT32_MAX));
    TEST_ASSERT_EQUAL_INT32(salience_current_q26(&s, -SALIENCE_MOST_Q26), salience_current_q26(&s, INT32_MIN));
    TEST_ASSERT_GREATER_THAN_INT32(SALIENCE_MOST_Q26, salience_current_q26(&s, INT32_MAX)); /* d current along the flux weakens the torque */
}
