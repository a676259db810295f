/* BRAKE_CHOPPER_V on the virtual board: a resistor takes what a supply that takes nothing back leaves, within its share of time. */
#include "bench.h"

#undef BRAKE_CHOPPER_V
#define BRAKE_CHOPPER_V 26
#undef BRAKE_CHOPPER_SHARE
#define BRAKE_CHOPPER_SHARE 0.1
#undef BRAKE_CHOPPER_SEC
#define BRAKE_CHOPPER_SEC 10
#undef SPEEDREF_DECEL_RPM_PER_S
#define SPEEDREF_DECEL_RPM_PER_S 20000

#include "firmware/board/isr.c"
#include "firmware/board/peripherals.c"
#include "firmware/board/selftest_run.c"
#include "firmware/board/watch.c"
#include "law.c"

void setUp(void)
{
    bench_set_up();
    set("supply.sinks", 0.0);
    set("bus.brake_ohm", 10.0);
}

/** A rotor of 36 inertias, S2 at a speed. @return seconds to STOPPED */
static double stopped_after_s(double rpm)
{
    stop_from(rpm, 36.0);
    LimitParm.seen = 0;
    set("stat.reset", 1.0);
    double took_s = seconds_to(DRIVE_STOPPED, 6.0);
    TEST_ASSERT_EQUAL_INT_MESSAGE(FAULT_NONE, board_drive.fault, vb_fault_name((int)board_drive.fault));
    return took_s;
}

void test_a_heavy_rotor_stops_sooner_and_the_bus_stays_below_REGEN_LIMIT(void)
{
    double took_s = stopped_after_s(5500.0), heat_j = get("stat.energy_brake_j"), bus_v = get("stat.bus_max_v"), copper_j = get("stat.energy_copper_j");
    uint16_t reasons = LimitParm.seen;
    set("bus.brake_ohm", 0.0); /* the same without a resistor */
    double without_s = stopped_after_s(5500.0);
    TEST_ASSERT_TRUE(bus_v < 26.6);
    TEST_ASSERT_EQUAL_HEX16(0, reasons & (LIMIT_BRAKE | LIMIT_CHOPPER));
    TEST_ASSERT_TRUE(heat_j > 10.0);
    TEST_ASSERT_TRUE(took_s < 0.8 * without_s);
    TEST_ASSERT_TRUE(copper_j < get("stat.energy_copper_j"));
    TEST_ASSERT_TRUE(get("stat.bus_max_v") > 27.5);
    TEST_ASSERT_TRUE((LimitParm.seen & LIMIT_BRAKE) != 0u);
    TEST_ASSERT_EQUAL_UINT(0, vb_warning_count(bench));
}

#define SHARE_MOST (BRAKE_CHOPPER_SHARE * (20.0 + BRAKE_CHOPPER_SEC / 8.0) / 20.0) /* in 20 s of a warm resistor, which has an eighth at once */

/** Share of time with the resistor on. */
static double on_share(double seconds)
{
    size_t rows, cols;
    double sum = 0.0;
    TEST_ASSERT_EQUAL_INT(0, vb_trace_config(bench, "output.brake", 1));
    wait_s(seconds);
    const float *row = vb_trace_data(bench, &rows, &cols);
    for (size_t i = 0; i < rows; i++) {
        sum += row[i];
    }
    (void)vb_trace_config(bench, "", 1);
    return sum / (double)rows;
}

void test_a_load_that_drives_for_long_gets_no_more_than_the_resistor_s_share_and_REGEN_LIMIT_does_the_rest(void)
{
    set("bus.brake_ohm", 20.0); /* on for a quarter of the time, if it may */
    run_at(2500.0);
    set("load.active_nm", 0.05);
    wait_s(1.0);
    TEST_ASSERT_TRUE(get("stat.bus_max_v") < 26.6);
    wait_s(10.0);
    LimitParm.seen = 0;
    set("stat.reset", 1.0);
    double share = on_share(20.0);
    TEST_ASSERT_TRUE(share < SHARE_MOST);
    TEST_ASSERT_TRUE(share > 0.09);
    TEST_ASSERT_TRUE((LimitParm.seen & LIMIT_CHOPPER) != 0u);
    TEST_ASSERT_TRUE(get("stat.bus_max_v") < 30.0);
    TEST_ASSERT_EQUAL_INT_MESSAGE(FAULT_NONE, board_drive.fault, vb_fault_name((int)board_drive.fault));
}

void test_a_bus_signal_at_its_end_does_not_burn_the_resistor(void)
{
    power_on();
    set("fault.vbus_stuck", 3.0);
    wait_s(15.0);
    TEST_ASSERT_TRUE(on_share(20.0) < SHARE_MOST);
}
