/* Current controllers and voltage circle: d before q, both limits, never outside the circle, and the reference. */
#include "control/current_control.h"
#include "golden.h"
#include "golden_current_control.h"
#include "golden_voltage_circle.h"
#include "unity.h"

static pi_t pi_d, pi_q;
static int16_t limit_q;

void setUp(void)
{
    pi_d.sum = 0;
    pi_q.sum = 0;
}

static voltage_circle_t circle_of(int16_t radius)
{
    voltage_circle_t c;
    voltage_circle_of(&c, radius);
    return c;
}

static dq_t control(int16_t ref_d, int16_t ref_q, int16_t meas_d, int16_t meas_q, int16_t radius)
{
    static const pi_gains_t gains = {
        GOLDEN_CURRENT_CONTROL_KP, GOLDEN_CURRENT_CONTROL_KI, GOLDEN_CURRENT_CONTROL_KC, GOLDEN_CURRENT_CONTROL_SHIFT
    };
    voltage_circle_t circle = circle_of(radius);
    dq_t ref = { ref_d, ref_q }, meas = { meas_d, meas_q };
    return current_control(&pi_d, &gains, &pi_q, &gains, ref, meas, &circle, &limit_q);
}

/* ---- the circle ---- */

void test_circle_limits_equal_the_reference(void)
{
    GOLDEN_EACH(voltage_circle, v) {
        voltage_circle_t c = circle_of(v.radius);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.vd_limit, c.vd_most_q14, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.vq_limit, vq_limit(&c, v.vd), golden_row(n));
    }
}

void test_limit_for_every_d_voltage_has_the_reference_checksum(void)
{
    static const struct {
        int16_t radius;
        uint32_t checksum;
    } circles[] = {
        { 4097, GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_4097 }, { 7987, GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_7987 },
        { 12287, GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_12287 }, { 15974, GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_15974 },
        { 19000, GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_19000 }, { 22630, GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_22630 },
        { 30350, GOLDEN_VOLTAGE_CIRCLE_CHECKSUM_30350 },
    };
    for (unsigned n = 0; n < sizeof circles / sizeof circles[0]; n++) {
        voltage_circle_t c = circle_of(circles[n].radius);
        int16_t vd, most = c.vd_most_q14;
        uint32_t s = 0;
        for (vd = (int16_t)-most; vd <= most; vd++) {
            s = golden_checksum(s, vq_limit(&c, vd));
        }
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(circles[n].checksum, s, golden_row(n));
    }
}

/** Every d voltage stays inside, not by more than a half percent of the radius, and either sign leaves the same. */
static void expect_tight_circle(int16_t radius)
{
    voltage_circle_t c = circle_of(radius);
    int32_t square = qm_mulss(radius, radius);
    int16_t vd;
    for (vd = 0; vd <= c.vd_most_q14; vd++) {
        int16_t vq = vq_limit(&c, vd), more = (int16_t)(vq + radius / 199);
        int32_t left = square - qm_mulss(vd, vd);
        if (qm_mulss(vq, vq) > left || (vd % 64 == 0 && (qm_mulss(more, more) <= left || vq != vq_limit(&c, (int16_t)-vd)))) {
            TEST_FAIL_MESSAGE(golden_row((uint32_t)radius));
        }
    }
}

void test_vector_never_leaves_the_circle_by_a_single_count_and_uses_it(void)
{
    static const int16_t low_bus[] = { 7987, 7000, 5000, 4097 }; /* 12 V, 10.5 V, 7.5 V, 6.2 V of 24 V */
    int16_t radius;
    for (unsigned n = 0; n < 4u; n++) {
        expect_tight_circle(low_bus[n]);
    }
    for (radius = 8193; radius < 30400; radius = (int16_t)(radius + 613)) {
        expect_tight_circle(radius);
    }
}

/* ---- both controllers ---- */

void test_sequence_equals_the_reference(void)
{
    GOLDEN_EACH(current_control, v) {
        dq_t out = control(v.ref_d, v.ref_q, v.meas_d, v.meas_q, v.radius);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.v_d, out.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.v_q, out.q, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.limit_q, limit_q, golden_row(n));
    }
}
