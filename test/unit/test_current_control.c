/* Current controllers and voltage circle: d before q, both limits, never outside the circle, and the reference. */
#include "control/current_control.h"
#include "golden.h"
#include "golden_current_control.h"
#include "golden_voltage_circle.h"
#include "unity.h"

static pi_t pi_d, pi_q;
static int16_t limit_q;
static const pi_gains_t gains = {
    GOLDEN_CURRENT_CONTROL_KP, GOLDEN_CURRENT_CONTROL_KI, GOLDEN_CURRENT_CONTROL_KC, GOLDEN_CURRENT_CONTROL_SHIFT
};

void setUp(void)
{
    pi_d.sum = 0;
    pi_q.sum = 0;
}

void tearDown(void)
{
}

static voltage_circle_t circle_of(int16_t radius)
{
    voltage_circle_t c;
    c.limit_q14 = radius;
    c.reciprocal = voltage_circle_reciprocal(radius);
    return c;
}

static dq_t control(int16_t ref_d, int16_t ref_q, int16_t meas_d, int16_t meas_q, int16_t radius)
{
    voltage_circle_t circle = circle_of(radius);
    dq_t ref, meas;
    ref.d = ref_d;
    ref.q = ref_q;
    meas.d = meas_d;
    meas.q = meas_q;
    return current_control(&pi_d, &gains, &pi_q, &gains, ref, meas, &circle, &limit_q);
}

/* ---- the circle ---- */

void test_circle_limits_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_VOLTAGE_CIRCLE_ROWS; n++) {
        golden_voltage_circle_t v = golden_voltage_circle[n];
        voltage_circle_t c = circle_of(v.radius);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.vd_limit, vd_limit(&c), golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.vq_limit, vq_limit(&c, v.vd), golden_row(n));
    }
}

static uint32_t checksum_of(int16_t radius)
{
    voltage_circle_t c = circle_of(radius);
    int16_t vd, most = vd_limit(&c);
    uint32_t s = 0;
    for (vd = (int16_t)-most; vd <= most; vd++) {
        s = golden_checksum(s, vq_limit(&c, vd));
    }
    return s;
}

void test_limit_for_every_d_voltage_has_the_reference_checksum(void)
{
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_4097, checksum_of(4097));
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_7987, checksum_of(7987));
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_12287, checksum_of(12287));
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_15974, checksum_of(15974));
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_19000, checksum_of(19000));
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_22630, checksum_of(22630));
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_30350, checksum_of(30350));
}

void test_d_voltage_may_take_31_of_32_parts_of_the_circle(void)
{
    voltage_circle_t c = circle_of(16000);
    TEST_ASSERT_EQUAL_INT16(15500, vd_limit(&c));
}

void test_d_voltage_of_0_6_leaves_0_8_to_q(void)
{
    voltage_circle_t c = circle_of(16000);
    TEST_ASSERT_INT16_WITHIN(8, 12800, vq_limit(&c, 9600));
    TEST_ASSERT_INT16_WITHIN(8, 12800, vq_limit(&c, -9600));
    TEST_ASSERT_INT16_WITHIN(8, 9600, vq_limit(&c, 12800));
}

void test_no_d_voltage_leaves_nearly_all_to_q(void)
{
    voltage_circle_t c = circle_of(16000);
    TEST_ASSERT_INT16_WITHIN(2, 15999, vq_limit(&c, 0));
    TEST_ASSERT_TRUE(vq_limit(&c, 0) <= 16000);
}

void test_limits_of_both_signs_of_d_are_equal(void)
{
    voltage_circle_t c = circle_of(15974);
    int16_t vd;
    for (vd = 0; vd <= vd_limit(&c); vd++) {
        TEST_ASSERT_EQUAL_INT16(vq_limit(&c, vd), vq_limit(&c, (int16_t)-vd));
    }
}

/** Largest length^2 - radius^2 over all d voltages. */
static int32_t most_outside(int16_t radius)
{
    voltage_circle_t c = circle_of(radius);
    int32_t most = -INT32_C(0x40000000), square = qm_mulss(radius, radius);
    int16_t vd;
    for (vd = 0; vd <= vd_limit(&c); vd++) {
        int16_t vq = vq_limit(&c, vd);
        int32_t outside = qm_mulss(vd, vd) - square + qm_mulss(vq, vq);
        most = (outside > most) ? outside : most;
    }
    return most;
}

void test_vector_never_leaves_the_circle_by_a_single_count(void)
{
    int16_t radius;
    for (radius = 8193; radius < 30400; radius = (int16_t)(radius + 613)) {
        TEST_ASSERT_TRUE_MESSAGE(most_outside(radius) <= 0, golden_row((uint32_t)radius));
    }
}

void test_vector_stays_inside_the_circle_at_a_bus_below_half(void)
{
    static const int16_t radii[] = { 7987, 7000, 5000, 4097 }; /* 12 V, 10.5 V, 7.5 V, 6.2 V of 24 V */
    uint16_t n;
    for (n = 0; n < 4u; n++) {
        TEST_ASSERT_TRUE_MESSAGE(most_outside(radii[n]) <= 0, golden_row((uint32_t)radii[n]));
    }
}

void test_circle_is_used_to_within_a_half_percent(void)
{
    voltage_circle_t c = circle_of(15974);
    int16_t vd;
    for (vd = 0; vd <= vd_limit(&c); vd = (int16_t)(vd + 11)) {
        int16_t vq = (int16_t)(vq_limit(&c, vd) + 80);
        TEST_ASSERT_TRUE_MESSAGE(qm_mulss(vd, vd) + qm_mulss(vq, vq) > INT32_C(15974) * 15974, golden_row((uint32_t)vd));
    }
}

/* ---- both controllers ---- */

void test_sequence_equals_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_CURRENT_CONTROL_ROWS; n++) {
        golden_current_control_t v = golden_current_control[n];
        dq_t out = control(v.ref_d, v.ref_q, v.meas_d, v.meas_q, v.radius);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.v_d, out.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.v_q, out.q, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.limit_q, limit_q, golden_row(n));
    }
}

void test_current_below_its_reference_raises_the_voltage_of_its_own_axis(void)
{
    dq_t v = control(1000, 0, 0, 0, 15974);
    TEST_ASSERT_TRUE(v.d > 0);
    TEST_ASSERT_EQUAL_INT16(0, v.q);
    setUp();
    v = control(0, 1000, 0, 0, 15974);
    TEST_ASSERT_EQUAL_INT16(0, v.d);
    TEST_ASSERT_TRUE(v.q > 0);
}

void test_current_above_its_reference_lowers_the_voltage(void)
{
    dq_t v = control(0, 0, 1000, 500, 15974);
    TEST_ASSERT_TRUE(v.d < 0);
    TEST_ASSERT_TRUE(v.q < 0);
    TEST_ASSERT_INT16_WITHIN(1, v.d, (int16_t)(2 * v.q));
}

void test_d_axis_comes_first_and_q_gets_the_rest(void)
{
    dq_t v = control(20000, 20000, -8000, -8000, 16000);
    TEST_ASSERT_EQUAL_INT16(15500, v.d);
    TEST_ASSERT_EQUAL_INT16(limit_q, v.q);
    TEST_ASSERT_INT16_WITHIN(70, 3969, v.q); /* sqrt(16000^2 - 15500^2), a chord */
}

void test_q_voltage_is_limited_on_both_sides(void)
{
    dq_t v = control(0, 20000, 0, -8000, 16000);
    TEST_ASSERT_EQUAL_INT16(limit_q, v.q);
    setUp();
    v = control(0, -20000, 0, 8000, 16000);
    TEST_ASSERT_EQUAL_INT16(-limit_q, v.q);
    TEST_ASSERT_TRUE(limit_q > 15990);
}
