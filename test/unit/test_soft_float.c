/* Numbers with 16 significant bits: what they keep, and how products, quotients and whole numbers come out. */
#include "control/soft_float.h"
#include "unity.h"

static void expect_number(uint16_t m, int16_t e, soft_float_t n)
{
    TEST_ASSERT_EQUAL_UINT16(m, n.m);
    TEST_ASSERT_EQUAL_INT16(e, n.e);
}

void test_number_keeps_the_upper_16_bits(void)
{
    expect_number(0, 0, soft_float_of(0));
    expect_number(32768u, -15, soft_float_of(1));
    expect_number(65535u, 0, soft_float_of(65535u));
    expect_number(65535u, 15, soft_float_of(0x7FFFFFFFul));
    expect_number(32768u, 1, soft_float_of(65536ul));
    expect_number(65535u, 16, soft_float_of(0xFFFFFFFFul));
    expect_number(40000u, -3 - 4, soft_float_scaled(5000u, 4));
}

void test_products_and_quotients_are_right_to_a_few_parts_in_65536(void)
{
    static const uint32_t value[] = { 1, 3, 19, 255, 4097, 50000ul, 65535ul, 1000003ul, 87654321ul };
    uint16_t i, j;
    for (i = 0; i < sizeof value / sizeof value[0]; i++) {
        for (j = 0; j < sizeof value / sizeof value[0]; j++) {
            soft_float_t p = soft_float_mul(soft_float_of(value[i]), soft_float_of(value[j]));
            soft_float_t q = soft_float_div(p, soft_float_of(value[j]));
            uint32_t back = (q.e >= 0) ? (uint32_t)q.m << (uint16_t)q.e : (((uint32_t)q.m >> (uint16_t)(-q.e - 1)) + 1u) >> 1;
            uint32_t miss = (back > value[i]) ? back - value[i] : value[i] - back;
            TEST_ASSERT_TRUE(miss <= (value[i] >> 13));
        }
    }
}

void test_division_by_zero_gives_zero(void)
{
    expect_number(0, 0, soft_float_div(soft_float_of(7), soft_float_of(0)));
    expect_number(0, 0, soft_float_div(soft_float_of(0), soft_float_of(1)));
    TEST_ASSERT_EQUAL_UINT16(0, soft_float_to_uint16(soft_float_div(soft_float_of(0), soft_float_of(1))));
}

void test_whole_numbers_are_rounded_and_limited(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, soft_float_to_uint16(soft_float_of(0)));
    TEST_ASSERT_EQUAL_UINT16(1, soft_float_to_uint16(soft_float_of(1)));
    TEST_ASSERT_EQUAL_UINT16(3, soft_float_to_uint16(soft_float_scaled(5, 1)));
    TEST_ASSERT_EQUAL_UINT16(2, soft_float_to_uint16(soft_float_scaled(9, 2)));
    TEST_ASSERT_EQUAL_UINT16(1, soft_float_to_uint16(soft_float_scaled(1, 1)));
    TEST_ASSERT_EQUAL_UINT16(0, soft_float_to_uint16(soft_float_scaled(1, 2)));
    TEST_ASSERT_EQUAL_UINT16(65535u, soft_float_to_uint16(soft_float_of(65535u)));
    TEST_ASSERT_EQUAL_UINT16(65535u, soft_float_to_uint16(soft_float_of(65536ul)));
    TEST_ASSERT_EQUAL_UINT16(65535u, soft_float_to_uint16(soft_float_of(0xFFFFFFFFul)));
    TEST_ASSERT_EQUAL_UINT32(0, soft_float_to_uint32(soft_float_of(0)));
    TEST_ASSERT_EQUAL_UINT32(3, soft_float_to_uint32(soft_float_scaled(5, 1)));
    TEST_ASSERT_EQUAL_UINT32(65535u, soft_float_to_uint32(soft_float_of(65535u)));
    TEST_ASSERT_EQUAL_UINT32(65536ul, soft_float_to_uint32(soft_float_of(65536ul)));
    TEST_ASSERT_EQUAL_UINT32(0xFFFF0000ul, soft_float_to_uint32(soft_float_of(0xFFFFFFFFul)));
    TEST_ASSERT_EQUAL_UINT32(0xFFFFFFFFul, soft_float_to_uint32(soft_float_scaled(0x80000000ul, -1))); /* from 2^32 on: limited */
}

void test_signed_products(void)
{
    TEST_ASSERT_EQUAL_INT32(-100000l, soft_float_times(-40000l, soft_float_scaled(5, 1)));
    TEST_ASSERT_EQUAL_INT32(100000l, soft_float_times(40000l, soft_float_scaled(5, 1)));
    TEST_ASSERT_EQUAL_INT32(-5, soft_float_times(-1, soft_float_of(5)));
    TEST_ASSERT_EQUAL_INT32(0, soft_float_times(0, soft_float_of(5)));
    TEST_ASSERT_EQUAL_INT32(0, soft_float_times(3, soft_float_scaled(1, 20)));
    TEST_ASSERT_EQUAL_INT32(0x3FFFFFFFl, soft_float_times(32768l, soft_float_of(32768u))); /* from 2^30 on: limited */
    TEST_ASSERT_EQUAL_INT32(0x3FFFFFFFl, soft_float_times(65536l, soft_float_of(32768u)));
    TEST_ASSERT_EQUAL_INT32(0x3FFFFFFFl, soft_float_times(0x3FFFFFFFl, soft_float_of(65535u)));
    TEST_ASSERT_INT32_WITHIN(20000l, 1000000000l, soft_float_times(1000000l, soft_float_of(1000)));
}
