/* FAULT_INPUT_USED 0 on the virtual board: what the fault input does is nobody's business, and over-current still trips. */
#include "bench.h"

#undef FAULT_INPUT_USED
#define FAULT_INPUT_USED 0

#include "firmware/board/firmware.c"
#include "firmware/board/peripherals.c"
#include "firmware/board/selftest_run.c"

void setUp(void)
{
    bench_set_up();
}

void test_a_low_input_neither_keeps_the_motor_from_starting_nor_stops_it(void)
{
    set("input.flta", 1.0);
    run_at(1500.0);
    (void)assert_holds(1500.0, 0.3);
    set("input.flta", 0.0);
    wait_s(0.1);
    set("input.flta", 1.0);
    (void)assert_holds(1500.0, 0.3);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, vb_warning_count(bench), vb_warning_count(bench) ? vb_warning(bench, 0) : "");
}

void test_the_firmware_s_own_over_current_protects(void)
{
    run_at(1500.0);
    ramp_load(0.06);
    set("fault.ia_gain", 10.0);
    wait_s(0.1);
    assert_fault(FAULT_OVERCURRENT_SW);
}
