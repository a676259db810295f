/* SUPPLY_CURRENT_LIMIT_A on the virtual board: the motor gives the torque that half an ampere of supply allows, and no more. */
#include "bench.h"

#undef SUPPLY_CURRENT_LIMIT_A
#define SUPPLY_CURRENT_LIMIT_A 0.5

#include "firmware/board/isr.c"
#include "firmware/board/watch.c"
#include "law.c"

void setUp(void)
{
    bench_set_up();
}

/** Mean current from the bus into the bridge. */
static double bridge_current_a(double seconds)
{
    set("stat.reset", 1.0);
    wait_s(seconds);
    return get("stat.energy_bus_j") / seconds / 24.0;
}

void test_a_load_beyond_the_limit_slows_the_motor_at_the_limit_and_names_it(void)
{
    run_at(2000.0);
    ramp_load(0.06);
    wait_s(0.5);
    TEST_ASSERT_DOUBLE_WITHIN(0.035, 0.5, bridge_current_a(0.5));
    TEST_ASSERT_TRUE(get("state.speed_rpm") < 1600.0);
    TEST_ASSERT_TRUE((LimitParm.seen & LIMIT_SUPPLY) != 0u);
    TEST_ASSERT_EQUAL_UINT16(0, LimitParm.now & LIMIT_CURRENT);
    assert_running();
    ramp_load(0.01);
    wait_s(0.5);
    (void)assert_holds(2000.0, 0.3);
}

void test_acceleration_stays_at_the_limit_and_in_field_weakening_d_current_counts(void)
{
    set("mech.inertia_kgm2", 100e-6);
    run_at(1000.0);
    turn_to_rpm(2800.0);
    wait_s(0.3);
    TEST_ASSERT_DOUBLE_WITHIN(0.04, 0.5, bridge_current_a(0.2));
    wait_s(3.0);
    (void)assert_holds(2800.0, 0.3);
    press("input.s3");
    turn_to_rpm(5000.0);
    wait_s(0.5);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.5, bridge_current_a(0.3));
    assert_running();
}

void test_braking_is_not_limited(void)
{
    set("mech.inertia_kgm2", 30e-6);
    set("supply.sinks", 1.0);
    run_at(2800.0);
    turn_to_rpm(500.0);
    wait_s(0.75);
    TEST_ASSERT_DOUBLE_WITHIN(60.0, 500.0, get("state.speed_rpm")); /* 2300 rpm at 4000 rpm/s */
    assert_running();
}
