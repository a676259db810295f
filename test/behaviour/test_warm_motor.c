/* NTC thermistors on the virtual board: a winding that gets warm costs current and then speed, a hot one trips, cools and comes back by a retry, and a sensor
 * that breaks stops the motor. */
#define MOTOR_NTC_USED 1
#define BRIDGE_NTC_USED 1
#include "bench.h"

#undef RETRY_COUNT
#define RETRY_COUNT 3

#include "firmware/app/panel.c"
#include "firmware/board/application.c"
#include "firmware/board/firmware.c"
#include "firmware/board/isr.c"
#include "firmware/board/modes/mode_board.c"
#include "firmware/board/peripherals.c"
#include "firmware/board/reset.c"
#include "firmware/board/selftest_run.c"
#include "firmware/board/status.c"
#include "firmware/board/watch.c"
#include "law.c"

#define FAN_NMS2 1.6e-6 /* 0.07 N m at 2000 rpm */

void setUp(void)
{
    bench_set_up();
    set("load.quadratic_nms2", FAN_NMS2);
}

static double limit_a(void)
{
    return board_drive.run.control.iq_limit_q13 * 4.0 * NORM_CURRENT_CONST;
}

static double motor_c(void)
{
    return board_drive.heat.motor.celsius_q4 / 16.0;
}

void test_a_warm_winding_costs_current_and_a_fan_speed_and_gives_both_back(void)
{
    run_at(2000.0);
    (void)assert_holds(2000.0, 0.3);
    set("motor.temp_c", 118.0);
    wait_s(1.0);
    TEST_ASSERT_DOUBLE_WITHIN(1.5, 118.0, motor_c());
    TEST_ASSERT_DOUBLE_WITHIN(0.2, MAXIMUM_CURRENT_A * (1.0 - 0.8 * 8.0 / 20.0), limit_a());
    TEST_ASSERT_EQUAL_UINT16(0, LimitParm.now & LIMIT_TEMPERATURE); /* enough for it */
    set("motor.temp_c", 126.0);
    wait_s(1.5);
    assert_running();
    TEST_ASSERT_TRUE((LimitParm.now & LIMIT_TEMPERATURE) != 0u);
    measured_t warm = measure(0.3);
    TEST_ASSERT_TRUE(warm.rpm < 1800.0 && warm.rpm > 1200.0);
    set("motor.temp_c", 40.0);
    wait_s(1.5);
    (void)assert_holds(2000.0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, MAXIMUM_CURRENT_A, limit_a());
}

void test_bridge_derates_as_the_motor_does(void)
{
    run_at(2000.0);
    set("ntc.bridge_c", 95.0);
    wait_s(1.0);
    assert_running();
    TEST_ASSERT_DOUBLE_WITHIN(0.2, MAXIMUM_CURRENT_A * (1.0 - 0.8 * 15.0 / 20.0), limit_a());
    set("ntc.bridge_c", 101.5);
    TEST_ASSERT_TRUE(seconds_to_fault(1.0) < 1.0);
    assert_fault(FAULT_BRIDGE_HOT);
}

void test_the_motor_s_sensor_follows_the_winding_with_its_lag(void)
{
    power_on();
    set("ntc.motor_lag_s", 0.5);
    set("motor.temp_c", 125.0);
    wait_s(0.5);
    TEST_ASSERT_DOUBLE_WITHIN(4.0, 25.0 + 100.0 * (1.0 - exp(-1.0)), get("ntc.motor_c"));
    TEST_ASSERT_DOUBLE_WITHIN(12.0, get("ntc.motor_c"), motor_c());
    wait_s(2.5);
    TEST_ASSERT_DOUBLE_WITHIN(1.5, get("ntc.motor_c"), motor_c());
}

void test_a_motor_that_has_tripped_comes_back_by_itself_when_it_is_cooler_and_not_before(void)
{
    run_at(2000.0);
    set("motor.temp_c", 140.0);
    TEST_ASSERT_TRUE(seconds_to_fault(1.0) < 0.5);
    assert_fault(FAULT_MOTOR_HOT);
    wait_s(3.0 * RETRY_PAUSE_SEC);
    assert_fault(FAULT_MOTOR_HOT);
    set("motor.temp_c", 122.0);
    wait_s(2.0 * RETRY_PAUSE_SEC);
    assert_fault(FAULT_MOTOR_HOT); /* less than 10 K below */
    set("motor.temp_c", 60.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.5, RETRY_PAUSE_SEC, seconds_to(DRIVE_ALIGN, 10.0));
    TEST_ASSERT_TRUE(seconds_to(DRIVE_CLOSED, 5.0) < 5.0);
    wait_s(2.0);
    (void)assert_holds(2000.0, 0.3);
}

void test_a_sensor_that_is_shorted_or_open_stops_the_motor_and_does_not_start_it_again(void)
{
    static const struct {
        const char *key;
        double stuck;
    } cases[] = { { "fault.motor_ntc_stuck", 2.0 }, { "fault.motor_ntc_stuck", 3.0 }, { "fault.bridge_ntc_stuck", 2.0 }, { "fault.bridge_ntc_stuck", 3.0 } };
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        setUp();
        run_at(1500.0);
        set(cases[n].key, cases[n].stuck);
        TEST_ASSERT_TRUE(seconds_to_fault(1.0) < 0.2);
        assert_fault(FAULT_NTC_SENSOR);
        press("input.s2");
        wait_s(2.0 * RETRY_PAUSE_SEC);
        assert_fault(FAULT_NTC_SENSOR);
        set(cases[n].key, 0.0);
        wait_s(0.3);
        press("input.s2");
        TEST_ASSERT_EQUAL_INT(FAULT_NONE, board_drive.fault);
    }
}

void test_currents_speed_and_potentiometer_do_not_mind_and_the_chip_has_nothing_to_say(void)
{
    set("load.quadratic_nms2", 0.0);
    run_at(900.0);
    (void)assert_holds(900.0, 0.5);
    turn_to_rpm(2500.0);
    wait_s(1.5);
    (void)assert_holds(2500.0, 0.5);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, vb_warning_count(bench), vb_warning_count(bench) ? vb_warning(bench, 0) : "");
}
