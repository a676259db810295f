/* The modulator: line voltages in every sector, the sampling window, over-modulation, dead time, and the reference. */
#include "control/svm.h"
#include "golden.h"
#include "golden_svm.h"
#include "unity.h"

#define GAIN_24V 8868u   /* duty per Q13 voltage count * 65536 at 24 V */

static const svm_params_t params = {
    GOLDEN_SVM_FULL, GOLDEN_SVM_TOP, GOLDEN_SVM_DEAD_TIME, GOLDEN_SVM_KNEE_Q13, GOLDEN_SVM_DEAD_SLOPE_Q8, GOLDEN_SVM_TURN_Q13
};
static const phases_t no_current;
static const dead_duties_t no_dead_time;

void test_duties_equal_the_reference(void)
{
    GOLDEN_EACH(svm, r) {
        alphabeta_t v = { r.alpha, r.beta };
        phases_t asked = { r.asked_a, r.asked_b, r.asked_c }, i = { r.i_a, r.i_b, r.i_c };
        duties_t d;
        dead_duties_t dead;
        svm_compensation(&params, asked, &dead);
        svm(&params, v, r.gain, &dead, &i, &d);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(r.a, d.a, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(r.b, d.b, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(r.c, d.c, golden_row(n));
    }
}

void test_directions_of_voltage_and_dead_time(void)
{
    static const struct {
        const char *what;
        int16_t alpha, beta;
        phases_t asked;
        duty_t a, b, c;
    } cases[] = {
        { "zero voltage: half duty on every leg", 0, 0, { 0, 0, 0 }, 1000, 1000, 1000 },
        { "along alpha: A over B and C", 4000, 0, { 0, 0, 0 }, 1406, 594, 594 }, /* 541 duty counts */
        { "along beta: B over C, A between", 0, 4000, { 0, 0, 0 }, 1000, 1468, 532 },
        { "a current into the motor asked for at A gets the dead time back", 0, 0, { 1000, -400, -600 }, 1080, 920, 920 },
        { "at B", 0, 0, { 0, 500, -500 }, 1000, 1080, 920 },
        { "at C", 0, 0, { -500, 0, 500 }, 920, 1000, 1080 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        alphabeta_t v = { cases[n].alpha, cases[n].beta };
        duties_t d;
        dead_duties_t dead;
        svm_compensation(&params, cases[n].asked, &dead);
        svm(&params, v, GAIN_24V, &dead, &no_current, &d);
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(2, cases[n].a, d.a, cases[n].what);
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(2, cases[n].b, d.b, cases[n].what);
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(2, cases[n].c, d.c, cases[n].what);
    }
}

/* ---- a turn of the vector ---- */

static duties_t duties_at(int16_t radius, angle_t angle)
{
    dq_t v = { radius, 0 };
    duties_t d;
    /* twice the gain: undoes the transformation's halving */
    svm(&params, inverse_park(v, trig_sincos(angle)), 2u * GAIN_24V, &no_dead_time, &no_current, &d);
    return d;
}

static duty_t highest(duties_t d)
{
    duty_t high = (d.a > d.b) ? d.a : d.b;
    return (d.c > high) ? d.c : high;
}

static duty_t lowest(duties_t d)
{
    duty_t low = (d.a < d.b) ? d.a : d.b;
    return (d.c < low) ? d.c : low;
}

void test_legs_are_centred_then_moved_out_of_the_window_then_limited_to_it(void)
{
    uint32_t a;
    for (a = 0; a < UINT32_C(65536); a += 500u) {
        duties_t centred = duties_at(6000, (angle_t)a), moved = duties_at(7987, (angle_t)a), limited = duties_at(12000, (angle_t)a);
        sincos_t sc = trig_sincos((angle_t)a);
        /* radius at 24 V: sqrt(3) V cos(angle + 30 deg) and sqrt(3) V sin(angle), V = 1080.8 duty counts */
        int16_t a_b = (int16_t)(qm_mulhi(3242, sc.cos) - qm_mulhi(1872, sc.sin)), b_c = qm_mulhi(3744, sc.sin);
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(1, 2000, (duty_t)(highest(centred) + lowest(centred)), golden_row(a));
        TEST_ASSERT_TRUE_MESSAGE(highest(moved) <= 1872u, golden_row(a));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(3, a_b, (int16_t)moved.a - (int16_t)moved.b, golden_row(a));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(3, b_c, (int16_t)moved.b - (int16_t)moved.c, golden_row(a));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(1872, highest(limited), golden_row(a));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(0, lowest(limited), golden_row(a));
    }
}

/* ---- dead time ---- */

void test_compensation_is_linear_up_to_the_knee_and_full_from_there_on(void)
{
    static const int16_t cases[][2] = { { 0, 0 }, { 1, 13 }, { 3, 40 }, { 5, 67 }, { 6, 80 }, { 7, 80 }, { 10000, 80 }, { 32767, 80 } };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1, cases[n][1], svm_dead_time(&params, cases[n][0]), golden_row(n));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1, -cases[n][1], svm_dead_time(&params, (int16_t)-cases[n][0]), golden_row(n));
    }
    TEST_ASSERT_EQUAL_INT16(svm_dead_time(&params, 6), svm_dead_time(&params, 10000));
    TEST_ASSERT_EQUAL_INT16(svm_dead_time(&params, -6), svm_dead_time(&params, -10000));
}

static duty_t leg(const svm_params_t *p, int16_t u, current_q13_t asked, const current_q13_t *measured)
{
    return svm_leg(p, (int16_t)(u + svm_dead_time(p, asked)), measured);
}

void test_compensation_is_for_the_currents_asked_for_and_the_window_for_those_measured(void)
{
    static const struct {
        const char *what;
        int16_t u, asked, measured;
        duty_t leg;
    } cases[] = {
        { "the current is sure to stay positive: beyond the window", 1872, 1000, 738, 1872 + 79 },
        { "it may turn negative in a period of the top speed", 1872, 1000, 737, 1872 },
        { "asked for is not enough", 1872, 32767, -1, 1872 },
        { "measured alone gets nothing back", 1872, 0, 1000, 1872 },
        { "the window leaves room", 1800, 400, 0, 1872 },
        { "a current out of the motor, against the one measured", 1872, -1000, 1000, 1872 - 80 },
        { "below zero by rounding", -1, 1000, 0, 78 },
        { "near zero", 100, -1000, 1000, 20 },
        { "not below zero", 50, -1000, 1000, 0 },
    };
    static const current_q13_t large = 1000;
    svm_params_t wide = params;
    wide.top = 1960;
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].leg, leg(&params, cases[n].u, cases[n].asked, &cases[n].measured), cases[n].what);
    }
    TEST_ASSERT_EQUAL_UINT16(2000, leg(&wide, 1960, 1000, &large)); /* never beyond the period */
}

void test_measured_currents_alone_do_not_move_the_duties(void)
{
    static const phases_t i = { 700, -300, -400 };
    static const alphabeta_t v = { 1000, -2000 };
    duties_t without, with;
    svm(&params, v, GAIN_24V, &no_dead_time, &no_current, &without);
    svm(&params, v, GAIN_24V, &no_dead_time, &i, &with);
    TEST_ASSERT_EQUAL_UINT16(without.a, with.a);
    TEST_ASSERT_EQUAL_UINT16(without.b, with.b);
    TEST_ASSERT_EQUAL_UINT16(without.c, with.c);
}
