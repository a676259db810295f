/* The brake chopper with a resistor that bears all of the time, BRAKE_CHOPPER_SHARE 1: it never rests. */
#include "hurst_params.h"

#undef BRAKE_CHOPPER_V
#define BRAKE_CHOPPER_V 26
#undef BRAKE_CHOPPER_SHARE
#define BRAKE_CHOPPER_SHARE 1
#undef BRAKE_CHOPPER_SEC
#define BRAKE_CHOPPER_SEC 60

#include "drive_rig.h"

#include "firmware/drive/limits.c"

void setUp(void)
{
}

void test_it_is_on_for_as_long_as_the_bus_is_high(void)
{
    chopper_t chopper = { 0 };
    uint16_t now = 0;
    for (uint32_t periods = 0; periods < 200u * 20000u; periods += 2u) {
        now = (uint16_t)(now + 2u);
        TEST_ASSERT_EQUAL_UINT16(1, bus_chopper(&chopper, BUS_Q15(28.0F), now));
    }
    TEST_ASSERT_EQUAL_UINT32(0, chopper.spent_q10);
}
