/* A drive on the bench for closed-loop tests: the whole firmware on the virtual board, with a person's hands on the buttons. */
#ifndef BEHAVIOUR_BENCH_H
#define BEHAVIOUR_BENCH_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "board/firmware.h"
#include "drive/param_scaling.h"
#include "unity.h"
#include "vboard.h"

static vb_t *bench;
static int bench_fast;

/** What a measurement over some time gives. */
typedef struct {
    double rpm, rpm_min, rpm_max;           /**< true speed */
    double i_rms_a, i_d_a, i_q_a, i_peak_a; /**< true phase current (RMS), d and q current (means), longest current vector */
    double angle_mean_deg, angle_rms_deg;   /**< estimated minus true rotor angle */
    double bus_max_v, v_max_share;          /**< highest bus; longest commanded vector over the voltage circle */
} measured_t;

static inline void set(const char *key, double value)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, vb_set(bench, key, value), vb_error(bench));
}

static inline double get(const char *key)
{
    double value = NAN;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, vb_get(bench, key, &value), vb_error(bench));
    return value;
}

static inline void wait_s(double seconds)
{
    TEST_ASSERT_EQUAL_INT(0, vb_run(bench, (uint32_t)(seconds * 20000.0 + 0.5)));
}

/** input.s2 starts and stops at the low range, input.s3 changes the range; the potentiometer stays where it is. */
static inline void press(const char *button)
{
    set(button, 1.0);
    wait_s(0.1);
    set(button, 0.0);
    bench_fast = (strcmp(button, "input.s3") == 0) ? !bench_fast : 0;
}

static inline void turn_to_rpm(double rpm)
{
    double low = bench_fast ? NOMINAL_SPEED_RPM : MINIMUM_SPEED_RPM;
    double high = bench_fast ? MAXIMUM_SPEED_RPM : NOMINAL_SPEED_RPM;
    set("input.pot", (rpm - low) / (high - low));
}

/** Power on with the shaft at rest, and wait for the calibration. */
static inline void power_on(void)
{
    set("state.speed_rpm", 0.0);
    TEST_ASSERT_EQUAL_INT(0, vb_power_up(bench));
    bench_fast = 0;
    turn_to_rpm(1000.0);
    wait_s(0.1);
}

/** S2, then until the loop is closed, a fault, or 2 s. @return seconds since S2 went down */
static inline double start(void)
{
    double begin = get("time_s");
    press("input.s2");
    while (board_drive.state != DRIVE_CLOSED && board_drive.fault == FAULT_NONE && get("time_s") < begin + 2.0) {
        wait_s(0.005);
    }
    return get("time_s") - begin;
}

/** A running motor at a speed, settled. */
static inline void run_at(double rpm)
{
    power_on();
    (void)start();
    TEST_ASSERT_EQUAL_INT_MESSAGE(FAULT_NONE, board_drive.fault, "did not start");
    TEST_ASSERT_EQUAL_INT_MESSAGE(DRIVE_CLOSED, board_drive.state, "did not start");
    wait_s(0.5);
    if (rpm > NOMINAL_SPEED_RPM) {
        press("input.s3");
    }
    turn_to_rpm(rpm);
    wait_s(1.7);
}

static inline void ramp_load(double nm)
{
    for (int i = 1; i <= 50; i++) {
        set("load.constant_nm", nm * i / 50.0);
        wait_s(0.01);
    }
}

static inline measured_t measure(double seconds)
{
    measured_t m = { .rpm_min = 1e9, .rpm_max = -1e9 };
    size_t rows, cols;
    double angle2 = 0.0;
    TEST_ASSERT_EQUAL_INT(0, vb_trace_config(bench, "plant.speed_rpm plant.i_d plant.i_q plant.theta_e_deg fw.theta_est_deg "
                                                    "bus.voltage_v fw.v_d_v fw.v_q_v fw.v_limit_v",
                                             3));
    wait_s(seconds);
    const float *row = vb_trace_data(bench, &rows, &cols);
    TEST_ASSERT_EQUAL_UINT(9, cols);
    for (size_t i = 0; i < rows; i++, row += cols) {
        double i2 = (double)row[1] * row[1] + (double)row[2] * row[2];
        double angle = remainder((double)row[4] - row[3], 360.0);
        m.rpm += row[0] / (double)rows;
        m.rpm_min = fmin(m.rpm_min, row[0]);
        m.rpm_max = fmax(m.rpm_max, row[0]);
        m.i_rms_a += i2 / 2.0 / (double)rows;
        m.i_d_a += row[1] / (double)rows;
        m.i_q_a += row[2] / (double)rows;
        m.i_peak_a = fmax(m.i_peak_a, sqrt(i2));
        m.angle_mean_deg += angle / (double)rows;
        angle2 += angle * angle / (double)rows;
        m.bus_max_v = fmax(m.bus_max_v, row[5]);
        m.v_max_share = fmax(m.v_max_share, hypot(row[6], row[7]) / row[8]);
    }
    m.i_rms_a = sqrt(m.i_rms_a);
    m.angle_rms_deg = sqrt(angle2);
    (void)vb_trace_config(bench, "", 1);
    return m;
}

static inline void assert_outputs_off(void)
{
    wait_s(0.0001);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, (int)get("pwm.outputs_seen"), "an output is on");
}

static inline void assert_fault(drive_fault_t fault)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE((int)fault, board_drive.fault, vb_fault_name((int)board_drive.fault));
    TEST_ASSERT_EQUAL_INT(DRIVE_FAULT, board_drive.state);
    assert_outputs_off();
}

static inline void assert_running(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(FAULT_NONE, board_drive.fault, vb_fault_name((int)board_drive.fault));
    TEST_ASSERT_EQUAL_INT_MESSAGE(DRIVE_CLOSED, board_drive.state, vb_state_name((int)board_drive.state));
}

/** The speed is held to half a percent over some time, and nothing has failed. */
static inline measured_t assert_holds(double rpm, double seconds)
{
    measured_t m = measure(seconds);
    TEST_ASSERT_DOUBLE_WITHIN(rpm * 0.005, rpm, m.rpm);
    assert_running();
    return m;
}

/** From a start on. */
static inline measured_t assert_holds_under_load(double rpm, double nm)
{
    set("load.constant_nm", 0.0);
    run_at(rpm);
    ramp_load(nm);
    wait_s(0.5);
    return assert_holds(rpm, 0.5);
}

/** Gives up on a fault, otherwise waits until the condition's time is over. @return seconds until the fault, or limit */
static inline double seconds_to_fault(double limit)
{
    double begin = get("time_s");
    while (board_drive.fault == FAULT_NONE && get("time_s") < begin + limit) {
        wait_s(0.00005);
    }
    return get("time_s") - begin;
}

/** Until the state is reached. @return seconds, or the limit */
static inline double seconds_to(drive_state_t state, double limit)
{
    double begin = get("time_s");
    while (board_drive.state != (uint16_t)state && get("time_s") < begin + limit) {
        wait_s(0.0005);
    }
    return get("time_s") - begin;
}

/** A rotor of so many times the header's inertia turns for a second, and S2 is pressed to stop it. */
static inline void stop_from(double rpm, double inertias)
{
    run_at(rpm);
    set("mech.inertia_kgm2", inertias * 5.5e-6);
    wait_s(1.0);
    press("input.s2");
}

/** A new board; the last test's goes. */
static inline void bench_set_up(void)
{
    vb_destroy(bench);
    bench = vb_create();
    TEST_ASSERT_NOT_NULL(bench);
    bench_fast = 0;
}

/** No current sample was taken while its low side was off. */
static inline void assert_shunts_see_the_current(void)
{
    set("adc.ia_invalid_count", 0.0);
    set("adc.ib_invalid_count", 0.0);
    wait_s(0.5);
    TEST_ASSERT_EQUAL_INT(0, (int)get("adc.ia_invalid_count"));
    TEST_ASSERT_EQUAL_INT(0, (int)get("adc.ib_invalid_count"));
}

/** The supply at a voltage, and the bus with it. */
static inline void supply_v(double volts)
{
    set("supply.voltage_v", volts);
    set("bus.voltage_v", volts);
}

#endif
