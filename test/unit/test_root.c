/* Square roots and lengths, exact to the last bit. */
#include "control/soft_float.h"
#include "unity.h"

void test_square_roots_are_exact(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, root_of(0));
    TEST_ASSERT_EQUAL_UINT16(1, root_of(3));
    TEST_ASSERT_EQUAL_UINT16(2, root_of(4));
    TEST_ASSERT_EQUAL_UINT16(23169u, root_of(536848899ul));
    TEST_ASSERT_EQUAL_UINT16(23170u, root_of(536848900ul));
    TEST_ASSERT_EQUAL_UINT16(46340u, root_of(0x7FFFFFFFul));
    TEST_ASSERT_EQUAL_UINT16(65535u, root_of(0xFFFFFFFFul));
    TEST_ASSERT_EQUAL_UINT16(5, root_length(-3, 4));
}
