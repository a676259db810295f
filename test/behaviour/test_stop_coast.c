/* STOP_MODE 1 on the virtual board: S2 lets the rotor coast, and S2 while it turns catches it. */
#include "bench.h"

#undef STOP_MODE
#define STOP_MODE 1

#include "firmware/board/isr.c"
#include "law.c"

void setUp(void)
{
    bench_set_up();
}

void test_S2_switches_the_outputs_off_at_once_and_friction_alone_slows_the_rotor(void)
{
    run_at(2000.0);
    set("mech.inertia_kgm2", 50e-6);
    set("input.s2", 1.0);
    wait_s(0.05); /* the button counts after 30 ms */
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
    assert_outputs_off();
    set("input.s2", 0.0);
    TEST_ASSERT_DOUBLE_WITHIN(100.0, 2000.0, get("state.speed_rpm"));
    wait_s(0.1);
    TEST_ASSERT_TRUE(get("state.speed_rpm") > 1000.0);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

void test_a_start_of_a_coasting_rotor_catches_it(void)
{
    set("mech.inertia_kgm2", 100e-6);
    run_at(2000.0);
    press("input.s2");
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
    wait_s(0.1);
    TEST_ASSERT_TRUE(start() < 0.3);
    TEST_ASSERT_TRUE(get("state.speed_rpm") > 1000.0);
    wait_s(1.5);
    (void)assert_holds(2000.0, 0.3);
}
