/* The fault recorder on the virtual board: its rows are the trace's, to the byte, and outlast all but a power-up and a start. */
#include "bench.h"

#include "board/status.h"

enum { RAW_A, RAW_B, V_D, V_Q, ANGLE, STATE, BUS, SPEED, FAULT, PHASE, COLUMNS };

static const float *trace;
static size_t fault_row; /* of the trace, with the record's first row in a fault: the first period that has one */

void setUp(void)
{
    bench_set_up();
}

/** Counts of a value of the trace. */
static long counts(size_t row, int column, double per_count)
{
    return lround((double)trace[row * COLUMNS + (size_t)column] / per_count);
}

static void trace_from_here(void)
{
    TEST_ASSERT_EQUAL_INT(0, vb_trace_config(bench, "reg.ADC1BUF1 reg.ADC1BUF2 fw.v_d_v fw.v_q_v fw.theta_ctrl_deg fw.state reg.ADC1BUF3 fw.speed_est_rpm "
                                                    "fw.fault fw.slow_phase",
                                             1));
}

/** Lets the record be completed, and finds the fault in the trace. */
static void find_fault(drive_fault_t fault)
{
    size_t rows, columns;
    wait_s((RECORDER_AFTER + 2u) * RECORDER_EVERY * (double)LOOPTIME_SEC);
    TEST_ASSERT_EQUAL_INT(fault, board_drive.fault);
    trace = vb_trace_data(bench, &rows, &columns);
    TEST_ASSERT_EQUAL_UINT(COLUMNS, columns);
    for (fault_row = 0; fault_row < rows && (counts(fault_row, FAULT, 1.0) == FAULT_NONE || counts(fault_row, PHASE, 1.0) % RECORDER_EVERY != 0); fault_row++) {
    }
    TEST_ASSERT_TRUE(fault_row >= RECORDER_EVERY * (RECORDER_ROWS - RECORDER_AFTER) && fault_row + RECORDER_EVERY * RECORDER_AFTER < rows);
}

/** Upper byte of a word of the trace. */
static unsigned upper(size_t row, int column, double per_count)
{
    return ((unsigned)counts(row, column, per_count) & 0xFFFFu) >> 8;
}

/** Four bits of what changes slowly, of the first of four rows. */
static unsigned slow_bits(uint16_t place, size_t row)
{
    unsigned after = (0u - place) % 4u;
    size_t of = row - RECORDER_EVERY * after;
    unsigned word = (unsigned)(((place + after) % 8u == 4u) ? counts(of, SPEED, 1.0 / NOPOLESPAIRS) : counts(of, BUS, 1.0));
    return (word >> (4u * after)) & 15u;
}

static void expect_trace(void)
{
    const double volts = 2.0 * (double)NORM_VOLTAGE_CONST;
    TEST_ASSERT_EQUAL_UINT16(RECORDER_ROWS, recorder_rows(&board_recorder));
    for (uint16_t n = 0; n < RECORDER_ROWS; n++) {
        uint16_t place = recorder_place(&board_recorder, (uint16_t)(RECORDER_ROWS - 1 - n));
        size_t row = fault_row - RECORDER_EVERY * (RECORDER_ROWS - RECORDER_AFTER) + (size_t)RECORDER_EVERY * n;
        const int8_t *byte = board_recorder.row[place].byte;
        TEST_ASSERT_EQUAL_HEX8(upper(row, RAW_A, 1.0), byte[RECORDER_I_A]);
        TEST_ASSERT_EQUAL_HEX8(upper(row, RAW_B, 1.0), byte[RECORDER_I_B]);
        TEST_ASSERT_EQUAL_HEX8(upper(row, V_D, volts), byte[RECORDER_V_D]);
        TEST_ASSERT_EQUAL_HEX8(upper(row, V_Q, volts), byte[RECORDER_V_Q]);
        TEST_ASSERT_EQUAL_HEX8(upper(row, ANGLE, 360.0 / 65536.0), byte[RECORDER_ANGLE]);
        TEST_ASSERT_EQUAL_UINT(counts(row, STATE, 1.0), (unsigned)byte[RECORDER_SLOW] & 15u);
        TEST_ASSERT_EQUAL_HEX8(slow_bits(place, row), ((unsigned)byte[RECORDER_SLOW] & 0xFFu) >> 4);
    }
}

void test_rows_of_an_overcurrent_are_those_of_the_trace(void)
{
    run_at(2000.0);
    ramp_load(0.06);
    trace_from_here();
    wait_s((RECORDER_ROWS - RECORDER_AFTER + 2u) * RECORDER_EVERY * (double)LOOPTIME_SEC);
    set("shunt.gain_v_per_a", 0.375 * 5.0); /* the amplifier shows five times the current */
    (void)seconds_to_fault(0.02);
    find_fault(FAULT_OVERCURRENT_SW);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_SW, board_recorder.fault);
    expect_trace();
}

void test_rows_of_a_stall_are_those_of_the_trace(void)
{
    run_at(1500.0);
    set("load.constant_nm", 0.4);
    trace_from_here();
    (void)seconds_to_fault(1.0);
    find_fault(FAULT_STALL);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, board_recorder.fault);
    expect_trace();
}

void test_a_fault_that_the_background_finds_is_recorded_as_well(void)
{
    run_at(1500.0);
    trace_from_here();
    wait_s((RECORDER_ROWS - RECORDER_AFTER + 2u) * RECORDER_EVERY * (double)LOOPTIME_SEC);
    board_clock_failed = 1;
    find_fault(FAULT_CLOCK);
    expect_trace();
}

void test_record_stays_over_s2_and_goes_with_the_next_start(void)
{
    run_at(1500.0);
    set("input.flta", 1.0);
    wait_s(0.001);
    set("input.flta", 0.0);
    wait_s(0.3);
    TEST_ASSERT_EQUAL_UINT16(RECORDER_ROWS, recorder_rows(&board_recorder));
    press("input.s2");
    TEST_ASSERT_EQUAL_INT(DRIVE_STOPPED, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(RECORDER_ROWS, recorder_rows(&board_recorder));
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_HW, board_recorder.fault);
    set("state.speed_rpm", 0.0);
    wait_s(0.1);
    press("input.s2");
    TEST_ASSERT_EQUAL_INT(DRIVE_ALIGN, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(0, recorder_rows(&board_recorder));
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_recorder.fault);
}

void test_power_up_forgets_the_record(void)
{
    run_at(1500.0);
    set("input.flta", 1.0);
    wait_s(0.01);
    set("input.flta", 0.0);
    TEST_ASSERT_EQUAL_UINT16(RECORDER_ROWS, recorder_rows(&board_recorder));
    power_on();
    TEST_ASSERT_EQUAL_UINT16(0, recorder_rows(&board_recorder));
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_recorder.fault);
}
