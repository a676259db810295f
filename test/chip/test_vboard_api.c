/* The library's surface: keys and their ranges, the firmware's own signals and parameters, errors, trace, warnings, power-up. */
#include "fake_firmware.inc"
#include "probe.h"

void setUp(void); /* both in fake_firmware.inc */
void tearDown(void);

/* ---- a firmware's signals and parameters ---- */

static double counted_calls(void)
{
    return (double)fake_adc_calls;
}

static double constant(void)
{
    return -2.5;
}

const probe_signal_t probe_signals[] = {
    { "calls", "", "handler calls", counted_calls },
    { "fw.constant_a", "A", "a constant", constant },
};
const unsigned probe_signal_count = 2;
const probe_param_t probe_params[] = { { "END_SPEED_RPM", 1000.0, "rpm" } };
const unsigned probe_param_count = 1;

const char *probe_fault_name(int code)
{
    return code == 3 ? "over-current" : "";
}

const char *probe_state_name(int state)
{
    return state == 1 ? "lock" : "";
}

void test_every_listed_key_can_be_used_as_its_flags_say(void)
{
    unsigned count = 0, signals = 0;
    power_up();
    for (const vb_key_t *key; (key = vb_key_info(count)) != NULL; count++) {
        double value = 0.0;
        TEST_ASSERT_TRUE(key->meaning[0] != '\0');
        if (strcmp(key->name, "fw.constant_a") == 0) {
            TEST_ASSERT_EQUAL_STRING("A", key->unit);
            TEST_ASSERT_EQUAL_STRING("a constant", key->meaning);
            signals++;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE((key->flags & VB_KEY_READ) != 0 ? 0 : -1, vb_get(board, key->name, &value), key->name);
        if ((key->flags & VB_KEY_WRITE) != 0) {
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, vb_set(board, key->name, key->min), key->name);
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, vb_set(board, key->name, key->max), key->name);
            TEST_ASSERT_EQUAL_INT_MESSAGE(-1, vb_set(board, key->name, key->max * 1.001 + 1.0), key->name);
        } else {
            TEST_ASSERT_EQUAL_INT_MESSAGE(-1, vb_set(board, key->name, value), key->name);
        }
    }
    TEST_ASSERT_TRUE(count > 100);
    TEST_ASSERT_EQUAL_UINT(1, signals);
}

void test_an_unknown_key_is_refused_by_name(void)
{
    double value;
    TEST_ASSERT_EQUAL_INT(-1, vb_set(board, "motor.rs", 1.0));
    TEST_ASSERT_EQUAL_STRING("motor.rs: unknown key", vb_error(board));
    TEST_ASSERT_EQUAL_INT(-1, vb_get(board, "pin.RD0", &value));
    TEST_ASSERT_EQUAL_INT(-1, vb_get(board, "pin.RB4x", &value));
    TEST_ASSERT_EQUAL_INT(-1, vb_get(board, "reg.NOPE", &value));
}

void test_an_impossible_value_is_refused_with_the_range(void)
{
    TEST_ASSERT_EQUAL_INT(-1, vb_set(board, "motor.rs_ohm", 0.0));
    TEST_ASSERT_EQUAL_STRING("motor.rs_ohm: 0 is outside 0.0001..1000 ohm", vb_error(board));
    TEST_ASSERT_EQUAL_INT(-1, vb_set(board, "motor.rs_ohm", NAN));
    TEST_ASSERT_EQUAL_INT(-1, vb_set(board, "motor.rs_ohm", INFINITY));
    TEST_ASSERT_EQUAL_INT(-1, vb_set(board, "reg.P1DC1", 65536.0));
    TEST_ASSERT_EQUAL_INT(-1, vb_set(board, "motor.pole_pairs", 2.5));
    TEST_ASSERT_EQUAL_STRING("motor.pole_pairs: 2.5 is not a whole number", vb_error(board));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2.67, get("motor.rs_ohm"));
}

void test_running_before_power_up_is_refused(void)
{
    TEST_ASSERT_EQUAL_INT(-1, vb_run(board, 1));
    TEST_ASSERT_TRUE(strstr(vb_error(board), "vb_power_up") != NULL);
}

void test_power_up_resets_registers_but_keeps_the_shaft_turning(void)
{
    start(10);
    set("reg.LATC", 0x55);
    set("state.speed_rpm", 1234.0);
    set("supply.voltage_v", 20.0);
    power_up();
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("reg.LATC"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1234.0, get("state.speed_rpm"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20.0, get("bus.voltage_v"));
}

void test_the_background_runs_every_few_periods(void)
{
    start(400);
    TEST_ASSERT_EQUAL_UINT(100, fake_background_calls);
    set("cpu.background_periods", 20.0);
    run(400);
    TEST_ASSERT_UINT_WITHIN(1, 120, fake_background_calls);
}

void test_trace_has_a_row_each_period_with_the_values_of_the_sample(void)
{
    size_t rows, cols;
    power_up();
    TEST_ASSERT_EQUAL_INT(0, vb_trace_config(board, "plant.time_s, plant.theta_e_deg\nplant.speed_rpm", 1));
    set("mech.inertia_kgm2", 100.0);
    set("state.speed_rpm", 1000.0);
    run(10);
    const float *data = vb_trace_data(board, &rows, &cols);
    TEST_ASSERT_EQUAL_UINT(10, rows);
    TEST_ASSERT_EQUAL_UINT(3, cols);
    for (size_t n = 0; n < rows; n++) {
        double t = 50e-6 * (double)n + 25.025e-6; /* P1SECMP 999, counting down */
        TEST_ASSERT_FLOAT_WITHIN(1e-8f, (float)t, data[n * cols]);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, (float)(t * 1000.0 * 6.0 * 5.0), data[n * cols + 1]);
    }
}

void test_trace_decimation_keeps_every_nth_row(void)
{
    size_t rows, cols;
    power_up();
    TEST_ASSERT_EQUAL_INT(0, vb_trace_config(board, "time_s", 4));
    run(10000);
    (void)vb_trace_data(board, &rows, &cols);
    TEST_ASSERT_EQUAL_UINT(2500, rows);
    vb_trace_clear(board);
    run(8);
    const float *data = vb_trace_data(board, &rows, &cols);
    TEST_ASSERT_EQUAL_UINT(2, rows);
    TEST_ASSERT_TRUE(data[0] > 0.49f);
}

void test_trace_goes_on_without_interrupts(void)
{
    size_t rows, cols;
    at_init("P1TCON", 0);
    power_up();
    TEST_ASSERT_EQUAL_INT(0, vb_trace_config(board, "plant.speed_rpm", 1));
    run(10);
    (void)vb_trace_data(board, &rows, &cols);
    TEST_ASSERT_EQUAL_UINT(10, rows);
}

void test_trace_refuses_unknown_names_and_keeps_nothing(void)
{
    size_t rows, cols;
    TEST_ASSERT_EQUAL_INT(-1, vb_trace_config(board, "time_s,plant.speed", 1));
    TEST_ASSERT_EQUAL_STRING("plant.speed: unknown key", vb_error(board));
    TEST_ASSERT_EQUAL_INT(-1, vb_trace_config(board, "time_s", 0));
    start(5);
    (void)vb_trace_data(board, &rows, &cols);
    TEST_ASSERT_EQUAL_UINT(0, rows);
}

void test_each_problem_is_reported_once(void)
{
    at_init("P1FLTACON", 0);
    at_init("P1SECMP", 0);
    start(100);
    unsigned count = vb_warning_count(board);
    TEST_ASSERT_EQUAL_UINT(2, count);
    set("reg.LATB", 1.0); /* another decoding pass */
    run(100);
    TEST_ASSERT_EQUAL_UINT(count, vb_warning_count(board));
    TEST_ASSERT_NULL(vb_warning(board, count));
}

void test_statistics_start_anew(void)
{
    start(10);
    TEST_ASSERT_EQUAL_DOUBLE(10.0, get("stat.periods"));
    set("stat.reset", 1.0);
    run(5);
    TEST_ASSERT_EQUAL_DOUBLE(5.0, get("stat.periods"));
}

void test_a_run_is_repeatable(void)
{
    double angle[2];
    for (int k = 0; k < 2; k++) {
        fake_restart();
        set_duties(1200, 900, 900);
        power_up();
        set("state.theta_e_deg", 40.0);
        run(2000);
        angle[k] = get("state.theta_e_deg");
    }
    TEST_ASSERT_EQUAL_DOUBLE(angle[0], angle[1]);
}

void test_signals_are_readable_under_one_prefix(void)
{
    start(7);
    TEST_ASSERT_EQUAL_DOUBLE(7.0, get("fw.calls"));
    TEST_ASSERT_EQUAL_DOUBLE(-2.5, get("fw.constant_a"));
    TEST_ASSERT_EQUAL_INT(-1, vb_set(board, "fw.calls", 1.0));
    TEST_ASSERT_EQUAL_STRING("fw.calls: can only be read", vb_error(board));
}

void test_a_trace_row_holds_what_the_handler_made_of_its_sample(void)
{
    size_t rows, cols;
    power_up();
    TEST_ASSERT_EQUAL_INT(0, vb_trace_config(board, "fw.calls", 1));
    run(3);
    const float *data = vb_trace_data(board, &rows, &cols);
    TEST_ASSERT_EQUAL_UINT(3, rows);
    TEST_ASSERT_EQUAL_FLOAT(1.0f, data[0]);
    TEST_ASSERT_EQUAL_FLOAT(3.0f, data[2]);
}

void test_parameters_and_names_are_passed_on(void)
{
    const char *name = NULL, *unit = NULL;
    double value = 0.0;
    TEST_ASSERT_EQUAL_INT(0, vb_param(0, &name, &value, &unit));
    TEST_ASSERT_EQUAL_STRING("END_SPEED_RPM", name);
    TEST_ASSERT_EQUAL_DOUBLE(1000.0, value);
    TEST_ASSERT_EQUAL_STRING("rpm", unit);
    TEST_ASSERT_EQUAL_INT(-1, vb_param(1, &name, &value, &unit));
    TEST_ASSERT_EQUAL_STRING("over-current", vb_fault_name(3));
    TEST_ASSERT_EQUAL_STRING("", vb_state_name(2));
}
