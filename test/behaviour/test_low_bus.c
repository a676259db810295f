/* DERATE_BELOW_V on the virtual board: a bus that sags leaves less torque, and the drive rides on where it would trip. */
#include "bench.h"

#undef DERATE_BELOW_V
#define DERATE_BELOW_V 20

#include "firmware/board/isr.c"
#include "firmware/board/watch.c"
#include "law.c"

void setUp(void)
{
    bench_set_up();
}

static double limit_a(void)
{
    return board_drive.run.control.iq_limit_q13 * 4.0 * NORM_CURRENT_CONST;
}

void test_current_falls_with_the_bus_and_comes_back(void)
{
    run_at(800.0);
    ramp_load(0.04);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, MAXIMUM_CURRENT_A, limit_a());
    supply_v(15.2);
    wait_s(0.3);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.2 * MAXIMUM_CURRENT_A + 0.8 * MAXIMUM_CURRENT_A * (get("bus.voltage_v") - 12.0) / 8.0, limit_a());
    (void)assert_holds(800.0, 0.3); /* 0.67 A are left for it */
    TEST_ASSERT_EQUAL_UINT16(0, LimitParm.now & LIMIT_LOW_BUS);
    ramp_load(0.09);
    wait_s(0.05);
    TEST_ASSERT_TRUE((LimitParm.seen & LIMIT_LOW_BUS) != 0u);
    ramp_load(0.02);
    supply_v(24.0);
    wait_s(0.5);
    (void)assert_holds(800.0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, MAXIMUM_CURRENT_A, limit_a());
}

void test_a_weak_supply_sags_to_where_the_torque_is_and_does_not_trip(void)
{
    uint16_t seen = 0;
    run_at(1000.0);
    set("mech.inertia_kgm2", 200e-6);
    set("supply.resistance_ohm", 13.0); /* 6.9 W at most, at 9.5 V: without derating it ends in UNDERVOLTAGE */
    set("supply.voltage_v", 19.0);
    wait_s(0.5);
    turn_to_rpm(1500.0);
    for (int i = 0; i < 100; i++) {
        wait_s(0.01);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
        seen |= LimitParm.now;
    }
    TEST_ASSERT_TRUE((seen & LIMIT_LOW_BUS) != 0u);
    TEST_ASSERT_TRUE(get("bus.voltage_v") < 18.0);
    assert_running();
}
