/* The modulator: line voltages in every sector, the sampling window, over-modulation, dead time, and the reference. */
#include "control/svm.h"
#include "golden.h"
#include "golden_svm.h"
#include "unity.h"

#define GAIN_24V 8868u   /* duty per Q13 voltage count * 65536 at 24 V */
#define FULL_CIRCLE 7987 /* radius at 24 V, Q13 */

static const svm_params_t params = {
    GOLDEN_SVM_FULL, GOLDEN_SVM_TOP, GOLDEN_SVM_DEAD_TIME, GOLDEN_SVM_KNEE_Q13,
    (uint16_t)GOLDEN_SVM_DEAD_SLOPE_Q16, GOLDEN_SVM_TURN_Q13
};

void setUp(void)
{
}

void tearDown(void)
{
}

static duties_t duties_of(int16_t alpha, int16_t beta)
{
    alphabeta_t v;
    v.alpha = alpha;
    v.beta = beta;
    return svm(&params, v, GAIN_24V, 0, 0, 0);
}

/** @param radius Q13; the transformation's halving is undone by the gain */
static duties_t duties_at(int16_t radius, angle_t angle)
{
    dq_t v;
    v.d = radius;
    v.q = 0;
    return svm(&params, inverse_park(v, trig_sincos(angle)), 2u * GAIN_24V, 0, 0, 0);
}

void test_duties_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_SVM_ROWS; n++) {
        golden_svm_t r = golden_svm[n];
        alphabeta_t v;
        duties_t d;
        v.alpha = r.alpha;
        v.beta = r.beta;
        d = svm(&params, v, r.gain, r.i_a, r.i_b, r.i_c);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(r.a, d.a, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(r.b, d.b, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(r.c, d.c, golden_row(n));
    }
}

void test_zero_voltage_is_half_duty_on_every_leg(void)
{
    duties_t d = duties_of(0, 0);
    TEST_ASSERT_EQUAL_UINT16(1000, d.a);
    TEST_ASSERT_EQUAL_UINT16(1000, d.b);
    TEST_ASSERT_EQUAL_UINT16(1000, d.c);
}

void test_voltage_along_alpha_raises_A_and_lowers_B_and_C_alike(void)
{
    duties_t d = duties_of(4000, 0); /* 541 duty counts */
    TEST_ASSERT_UINT16_WITHIN(2, 1000 + 406, d.a);
    TEST_ASSERT_UINT16_WITHIN(2, 1000 - 406, d.b);
    TEST_ASSERT_EQUAL_UINT16(d.b, d.c);
}

void test_voltage_along_beta_raises_B_over_C_and_leaves_A_between(void)
{
    duties_t d = duties_of(0, 4000);
    TEST_ASSERT_UINT16_WITHIN(2, 1000, d.a);
    TEST_ASSERT_UINT16_WITHIN(2, 1000 + 468, d.b);
    TEST_ASSERT_UINT16_WITHIN(2, 1000 - 468, d.c);
}

void test_highest_leg_changes_from_A_to_B_to_C_as_the_vector_turns_forward(void)
{
    uint16_t degree;
    for (degree = 5; degree < 360u; degree = (uint16_t)(degree + 10u)) {
        duties_t d = duties_at(7000, (angle_t)(degree * UINT32_C(65536) / 360u));
        duty_t highest = (degree < 60u || degree > 300u) ? d.a : (degree < 180u) ? d.b : d.c;
        duty_t lowest = (degree > 120u && degree < 240u) ? d.a : (degree > 240u) ? d.b : d.c;
        TEST_ASSERT_TRUE_MESSAGE(highest >= d.a && highest >= d.b && highest >= d.c, golden_row(degree));
        TEST_ASSERT_TRUE_MESSAGE(lowest <= d.a && lowest <= d.b && lowest <= d.c, golden_row(degree));
    }
}

void test_legs_are_centred_while_the_window_allows(void)
{
    uint32_t a;
    for (a = 0; a < UINT32_C(65536); a += 500u) {
        duties_t d = duties_at(6000, (angle_t)a);
        duty_t high = (d.a > d.b) ? d.a : d.b, low = (d.a < d.b) ? d.a : d.b;
        high = (d.c > high) ? d.c : high;
        low = (d.c < low) ? d.c : low;
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(1, 2000, (duty_t)(high + low), golden_row(a));
    }
}

void test_window_moves_all_legs_down_and_keeps_the_line_voltages(void)
{
    uint32_t a;
    for (a = 0; a < UINT32_C(65536); a += 500u) {
        duties_t d = duties_at(FULL_CIRCLE, (angle_t)a);
        sincos_t sc = trig_sincos((angle_t)a);
        /* sqrt(3) V cos(angle + 30 deg) and sqrt(3) V sin(angle), V = 1080.8 duty counts */
        int16_t a_b = (int16_t)(qm_mulhi(3242, sc.cos) - qm_mulhi(1872, sc.sin));
        int16_t b_c = qm_mulhi(3744, sc.sin);
        TEST_ASSERT_TRUE_MESSAGE(d.a <= 1872u && d.b <= 1872u && d.c <= 1872u, golden_row(a));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(3, a_b, (int16_t)d.a - (int16_t)d.b, golden_row(a));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(3, b_c, (int16_t)d.b - (int16_t)d.c, golden_row(a));
    }
}

void test_line_voltage_reaches_all_that_the_window_leaves(void)
{
    duties_t d = duties_at(FULL_CIRCLE, 65536u - 5461u); /* -30 degrees: the hexagon's inner circle */
    TEST_ASSERT_UINT16_WITHIN(1, 1872, d.a);
    TEST_ASSERT_UINT16_WITHIN(3, 0, d.b);
}

void test_over_modulation_stays_between_zero_and_the_window(void)
{
    uint32_t a;
    for (a = 0; a < UINT32_C(65536); a += 500u) {
        duties_t d = duties_at(12000, (angle_t)a);
        duty_t high = (d.a > d.b) ? d.a : d.b, low = (d.a < d.b) ? d.a : d.b;
        high = (d.c > high) ? d.c : high;
        low = (d.c < low) ? d.c : low;
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(1872, high, golden_row(a));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(0, low, golden_row(a));
    }
}

/* ---- dead time ---- */

static duties_t with_current(int16_t i_a, int16_t i_b, int16_t i_c)
{
    alphabeta_t zero = { 0, 0 };
    return svm(&params, zero, GAIN_24V, i_a, i_b, i_c);
}

void test_leg_with_a_current_into_the_motor_gets_the_dead_time_back(void)
{
    duties_t d = with_current(1000, -400, -600);
    TEST_ASSERT_UINT16_WITHIN(1, 1080, d.a);
    TEST_ASSERT_UINT16_WITHIN(1, 920, d.b);
    TEST_ASSERT_UINT16_WITHIN(1, 920, d.c);
}

void test_each_leg_is_compensated_by_its_own_current(void)
{
    TEST_ASSERT_UINT16_WITHIN(1, 1080, with_current(0, 500, -500).b);
    TEST_ASSERT_UINT16_WITHIN(1, 1080, with_current(-500, 0, 500).c);
    TEST_ASSERT_EQUAL_UINT16(1000, with_current(0, 500, -500).a);
}

void test_compensation_is_linear_below_the_knee(void)
{
    TEST_ASSERT_EQUAL_INT16(0, svm_dead_time(&params, 0));
    TEST_ASSERT_INT16_WITHIN(1, 40, svm_dead_time(&params, 44));
    TEST_ASSERT_INT16_WITHIN(1, -40, svm_dead_time(&params, -44));
    TEST_ASSERT_INT16_WITHIN(1, 72, svm_dead_time(&params, 80));
}

void test_compensation_is_full_from_the_knee_on(void)
{
    TEST_ASSERT_INT16_WITHIN(1, 80, svm_dead_time(&params, 88));
    TEST_ASSERT_EQUAL_INT16(svm_dead_time(&params, 88), svm_dead_time(&params, 89));
    TEST_ASSERT_EQUAL_INT16(svm_dead_time(&params, 88), svm_dead_time(&params, 10000));
    TEST_ASSERT_INT16_WITHIN(1, -80, svm_dead_time(&params, -88));
    TEST_ASSERT_EQUAL_INT16(svm_dead_time(&params, -88), svm_dead_time(&params, -10000));
}

void test_compensation_passes_the_window_only_where_the_current_stays_positive(void)
{
    int16_t full = svm_dead_time(&params, 1000);
    TEST_ASSERT_EQUAL_UINT16(1872 + full, svm_leg(&params, 1872, 738));
    TEST_ASSERT_EQUAL_UINT16(1872, svm_leg(&params, 1872, 737)); /* may turn negative in a period of the top speed */
    TEST_ASSERT_EQUAL_UINT16(1872, svm_leg(&params, 1800, 400));
    TEST_ASSERT_EQUAL_UINT16(1872 + full, svm_leg(&params, 1900, 1000));
    TEST_ASSERT_EQUAL_UINT16(1872 - 80, svm_leg(&params, 1900, -1000));
}

void test_compensated_duty_stays_between_zero_and_the_period(void)
{
    svm_params_t wide = params;
    TEST_ASSERT_EQUAL_UINT16(0, svm_leg(&params, 50, -1000));
    TEST_ASSERT_EQUAL_UINT16(20, svm_leg(&params, 100, -1000));
    TEST_ASSERT_EQUAL_UINT16(svm_dead_time(&params, 1000), svm_leg(&params, -5, 1000));
    wide.top = 1960;
    TEST_ASSERT_EQUAL_UINT16(2000, svm_leg(&wide, 1960, 1000));
}

/* ---- bus ---- */

void test_half_the_bus_needs_twice_the_duty(void)
{
    alphabeta_t v = { 2000, 1000 };
    duties_t at_24 = svm(&params, v, GAIN_24V, 0, 0, 0), at_12 = svm(&params, v, 2u * GAIN_24V, 0, 0, 0);
    TEST_ASSERT_INT16_WITHIN(2, 2 * ((int16_t)at_24.a - (int16_t)at_24.b), (int16_t)at_12.a - (int16_t)at_12.b);
    TEST_ASSERT_INT16_WITHIN(2, 2 * ((int16_t)at_24.b - (int16_t)at_24.c), (int16_t)at_12.b - (int16_t)at_12.c);
}
