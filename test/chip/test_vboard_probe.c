/* The firmware's own signals and parameters reach the keys, the trace and the lists. */
#include "fake_firmware.inc"
#include "probe.h"

void setUp(void); /* both in fake_firmware.inc */
void tearDown(void);

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

void test_signals_are_listed_with_their_meaning(void)
{
    unsigned i = 0;
    const vb_key_t *key;
    while ((key = vb_key_info(i)) != NULL && strcmp(key->name, "fw.constant_a") != 0) {
        i++;
    }
    TEST_ASSERT_NOT_NULL(key);
    TEST_ASSERT_EQUAL_STRING("A", key->unit);
    TEST_ASSERT_EQUAL_STRING("a constant", key->meaning);
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
