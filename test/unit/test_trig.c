/* Sine, cosine and the circle limit: every angle, every table entry among them, and the errors that the header promises. */
#include "control/transforms.h"
#include "golden.h"
#include "golden_circle.h"
#include "golden_sincos.h"
#include "unity.h"

void test_sine_and_cosine_equal_the_reference(void)
{
    GOLDEN_EACH(sincos, v) {
        sincos_t sc = trig_sincos(v.angle);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.sin, sc.sin, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.cos, sc.cos, golden_row(n));
    }
}

void test_all_65536_angles_have_the_reference_checksum(void)
{
    uint32_t a, s = 0;
    for (a = 0; a < UINT32_C(65536); a++) {
        sincos_t sc = trig_sincos((angle_t)a);
        s = golden_checksum(golden_checksum(s, sc.sin), sc.cos);
    }
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_SINCOS_CHECKSUM, s);
}

void test_sine_squared_plus_cosine_squared_is_one_at_every_angle(void)
{
    uint32_t a;
    for (a = 0; a < UINT32_C(65536); a += 7u) {
        sincos_t sc = trig_sincos((angle_t)a);
        int32_t square = qm_mulss(sc.sin, sc.sin) + qm_mulss(sc.cos, sc.cos);
        /* length 32753..32769 */
        TEST_ASSERT_INT32_WITHIN_MESSAGE(INT32_C(16) * 32761, INT32_C(32761) * 32761, square, golden_row(a));
    }
}

void test_direction_is_that_of_the_vector_to_a_quarter_of_a_degree(void)
{
    static const int16_t lengths[] = { 32767, 1000 };
    uint32_t a;
    for (a = 0; a < UINT32_C(65536); a += 37u) {
        sincos_t sc = trig_sincos((angle_t)a);
        uint16_t n;
        for (n = 0; n < 2u; n++) {
            int16_t x = qm_hi(2 * qm_mulss(sc.cos, lengths[n])), y = qm_hi(2 * qm_mulss(sc.sin, lengths[n]));
            TEST_ASSERT_INT16_WITHIN_MESSAGE((n == 0u) ? 46 : 60, 0, (int16_t)(angle_t)(trig_direction(x, y) - a), golden_row(a));
        }
    }
}

void test_direction_of_axes_and_diagonals_and_of_no_vector(void)
{
    static const struct {
        int16_t x, y;
        angle_t angle;
    } cases[] = {
        { 0, 0, 0 }, { 5, 0, 0 }, { 0, 5, 0x4000 }, { -5, 0, 0x8000 }, { 0, -5, 0xC000 }, { 7, 7, 0x2000 }, { -7, 7, 0x6000 }, { -7, -7, 0xA000 },
        { 7, -7, 0xE000 }, { 32767, -32767, 0xE000 },
    };
    uint16_t n;
    for (n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        TEST_ASSERT_INT16_WITHIN_MESSAGE(2, 0, (int16_t)(angle_t)(trig_direction(cases[n].x, cases[n].y) - cases[n].angle), golden_row(n));
    }
}

void test_circle_equals_the_reference(void)
{
    GOLDEN_EACH(circle, v) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.value, trig_circle(v.x), golden_row(n));
    }
}

void test_circle_falls_from_one_to_zero_and_is_nowhere_left_by_a_count(void)
{
    int16_t last = 32767;
    uint32_t x, s = 0;
    TEST_ASSERT_EQUAL_INT16(last, trig_circle(0));
    for (x = 0; x < UINT32_C(32768); x++) {
        int16_t y = trig_circle((int16_t)x), inside = (int16_t)(y - 1);
        uint32_t square = (uint32_t)qm_mulss((int16_t)x, (int16_t)x) + (uint32_t)qm_mulss(inside, inside);
        TEST_ASSERT_TRUE_MESSAGE(square < UINT32_C(0x40000000), golden_row(x));
        TEST_ASSERT_TRUE_MESSAGE(y <= last, golden_row(x));
        s = golden_checksum(s, y);
        last = y;
    }
    TEST_ASSERT_INT16_WITHIN(12, 0, last);
    TEST_ASSERT_EQUAL_HEX32(GOLDEN_CIRCLE_CHECKSUM, s);
}
