/* STOP_MODE 2 on the virtual board: the ramp, then the short-circuited winding, which stops the rotor without lifting the bus. */
#include "bench.h"

#undef STOP_MODE
#define STOP_MODE 2

#include "firmware/board/isr.c"
#include "firmware/board/selftest_run.c"
#include "law.c"

void setUp(void)
{
    bench_set_up();
}

void test_a_rotor_of_any_inertia_is_shorted_from_1750_rpm_to_standstill_within_the_current_limit(void)
{
    static const double inertias[] = { 1.0, 9.0, 36.0 };
    for (size_t i = 0; i < sizeof inertias / sizeof inertias[0]; i++) {
        stop_from(2800.0, inertias[i]);
        (void)seconds_to(DRIVE_BRAKE, 3.0);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_BRAKE, board_drive.state);
        TEST_ASSERT_DOUBLE_WITHIN(150.0, 1700.0, get("state.speed_rpm"));
        set("stat.reset", 1.0);
        double bus_v = get("bus.voltage_v"); /* what the ramp has left of it */
        measured_t m = measure(0.01);
        TEST_ASSERT_TRUE(m.i_peak_a < 1.1 * MAXIMUM_CURRENT_A);
        TEST_ASSERT_TRUE(seconds_to(DRIVE_STOPPED, 3.0) < 2.0);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
        TEST_ASSERT_TRUE(fabs(get("state.speed_rpm")) < 30.0);
        TEST_ASSERT_TRUE(get("stat.bus_max_v") < bus_v + 0.2);
        assert_outputs_off();
        set("mech.inertia_kgm2", 5.5e-6);
    }
}

void test_a_hot_and_a_cold_winding_stay_below_the_trip(void)
{
    static const double factors[][2] = { { 0.7, 1.1 }, { 1.4, 0.9 } }; /* of R, of the flux */
    for (size_t i = 0; i < sizeof factors / sizeof factors[0]; i++) {
        set("motor.rs_ohm", factors[i][0] * MOTOR_RS_OHM);
        set("motor.psi_vs", factors[i][1] * MOTOR_KPHI_V_PER_KRPM / sqrt(3.0) * 60.0 / (2000.0 * M_PI * NOPOLESPAIRS));
        run_at(2000.0);
        set("mech.inertia_kgm2", 20e-6);
        press("input.s2");
        TEST_ASSERT_TRUE(seconds_to(DRIVE_STOPPED, 3.0) < 2.0);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
        set("mech.inertia_kgm2", 5.5e-6);
    }
}

void test_a_start_follows_the_brake(void)
{
    run_at(1500.0);
    press("input.s2");
    wait_s(1.0);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
    (void)start();
    assert_running();
}
