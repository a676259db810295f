/* The fault recorder: which rows it holds, in which order, how long it keeps them, and when it begins anew. */
#include "drive_rig.h"

#include "firmware/drive/recorder.c"

#include <string.h>

static recorder_t recorder;

static uint16_t ticks;
static uint8_t state_of[400]; /* of a tick: at its end */

void setUp(void)
{
    rig_ready();
    memset(&recorder, 0x5A, sizeof recorder); /* what RAM may hold */
    recorder_restart(&recorder, 1, FAULT_NONE);
    ticks = 0; /* and the drive's are 1024 */
}

void test_power_up_leaves_no_byte_as_it_was(void)
{
    static recorder_t other;
    memset(&other, 0xA5, sizeof other);
    recorder_restart(&other, 1, FAULT_NONE);
    TEST_ASSERT_EQUAL_MEMORY(&other, &recorder, sizeof recorder);
    TEST_ASSERT_EQUAL_UINT(RECORDER_ROWS * RECORDER_BYTES + 12, sizeof recorder);
}

/* What the samples and the drive have in a tick; multiples of 257 differ in their upper bytes. */
static int16_t word(uint16_t tick, int16_t times)
{
    return (int16_t)(257 * times * (int16_t)(tick % 10u));
}

static int16_t raw_a(uint16_t tick)
{
    return word(tick, -12);
}

static int16_t raw_b(uint16_t tick)
{
    return word(tick, 11);
}

static int16_t v_d(uint16_t tick)
{
    return (int16_t)(80 * tick);
}

static int16_t v_q(uint16_t tick)
{
    return (int16_t)(-57 * (int16_t)tick);
}

static uint16_t angle(uint16_t tick)
{
    return (uint16_t)(977u * tick);
}

static int16_t v_bus(uint16_t tick)
{
    return rig_raw_bus(PARAM_F(NOMINAL_BUS_V) + 0.25F * (float)(tick % 20u));
}

static int16_t speed(uint16_t tick)
{
    return (int16_t)(-20000 + 67 * (int16_t)tick);
}

/** Upper byte, rounded down. */
static int upper(int16_t x)
{
    return (x >= 0) ? x / 256 : -1 - (-1 - x) / 256;
}

/** A period as the board's interrupt has it; every quantity moves. */
static void period(void)
{
    samples.i_a = raw_a(ticks);
    samples.i_b = raw_b(ticks);
    samples.v_bus = v_bus(ticks);
    drive.run.control.v_q14.d = v_d(ticks);
    drive.run.control.v_q14.q = v_q(ticks);
    drive.angle = angle(ticks);
    rig_tick(1);
    rig_speed(speed(ticks));
    if (drive.fault != (uint16_t)FAULT_NONE) {
        recorder_in_fault(&recorder, &drive);
    }
    if (recorder_is_due(&drive)) {
        recorder_write(&recorder, &drive, samples.i_a, samples.i_b, samples.v_bus);
    }
    TEST_ASSERT_TRUE(ticks < sizeof state_of);
    state_of[ticks] = (uint8_t)drive.state;
    ticks++;
}

static void periods(uint16_t count)
{
    while (count-- != 0u) {
        period();
    }
}

/** Periods count from 0 again. The drive's are even then: 1, 3, 5, ... get a row. */
static void count_anew(void)
{
    drive.ticks = (uint16_t)(drive.ticks & ~1u);
    ticks = 0;
}

/** The period after the record's last row, for a fault after so many. */
static uint16_t end_of(uint16_t before)
{
    return (uint16_t)((before | 1u) + 2u * RECORDER_AFTER - 1u);
}

/** Four bits of what changes slowly, of the tick of the first of four rows; 0 before that. */
static unsigned slow_bits(uint16_t place, uint16_t tick)
{
    uint16_t row = (uint16_t)(0u - place) % 4u;
    int16_t of = (int16_t)(tick - 2u * row);
    if (of < 0) {
        return 0;
    }
    return ((unsigned)(((place + row) % 8u == 4u) ? speed((uint16_t)of) : v_bus((uint16_t)of)) >> (4u * row)) & 15u;
}

/** The record is complete, and its rows are those of every second tick before `end`. */
static void expect_rows(uint16_t rows, uint16_t end)
{
    uint16_t n;
    TEST_ASSERT_EQUAL_UINT16(rows, recorder_rows(&recorder));
    for (n = 0; n < rows; n++) {
        uint16_t place = recorder_place(&recorder, (uint16_t)(rows - 1u - n)), tick = (uint16_t)(((end - 2u) | 1u) - 2u * (rows - 1u - n));
        const int8_t *byte = recorder.row[place].byte;
        TEST_ASSERT_TRUE(place < RECORDER_ROWS);
        TEST_ASSERT_EQUAL_INT8(upper(raw_a(tick)), byte[RECORDER_I_A]);
        TEST_ASSERT_EQUAL_INT8(upper(raw_b(tick)), byte[RECORDER_I_B]);
        TEST_ASSERT_EQUAL_INT8(upper(v_d(tick)), byte[RECORDER_V_D]);
        TEST_ASSERT_EQUAL_INT8(upper(v_q(tick)), byte[RECORDER_V_Q]);
        TEST_ASSERT_EQUAL_HEX8(angle(tick) >> 8, byte[RECORDER_ANGLE]);
        TEST_ASSERT_EQUAL_HEX8(state_of[tick], (unsigned)byte[RECORDER_SLOW] & 15u);
        TEST_ASSERT_EQUAL_HEX8(slow_bits(place, tick), ((unsigned)byte[RECORDER_SLOW] & 0xFFu) >> 4);
    }
}

void test_forty_eight_rows_before_a_fault_and_sixteen_from_it_on_wherever_the_ring_stands(void)
{
    uint16_t before;
    for (before = 2 * (RECORDER_ROWS - RECORDER_AFTER); before < 4 * RECORDER_ROWS + 16; before++) {
        setUp();
        periods(before);
        TEST_ASSERT_EQUAL_UINT16(0, recorder_rows(&recorder));
        drive_raise(&drive, FAULT_TRAP);
        periods(2 * RECORDER_AFTER + 20);
        expect_rows(RECORDER_ROWS, end_of(before));
        TEST_ASSERT_EQUAL_UINT16(FAULT_TRAP, recorder.fault);
    }
}

void test_a_fault_soon_after_the_beginning_has_fewer_rows_before_it(void)
{
    uint16_t before;
    for (before = 0; before < 2 * (RECORDER_ROWS - RECORDER_AFTER); before++) {
        setUp();
        periods(before);
        drive_raise(&drive, FAULT_STALL);
        periods(2 * RECORDER_AFTER + 3);
        expect_rows((uint16_t)(before / 2u + RECORDER_AFTER), end_of(before));
    }
}

void test_first_row_in_state_fault_is_the_fault_s_own(void)
{
    uint16_t n;
    periods(200);
    rig_currents(0, 0);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    periods(40);
    for (n = 0; n < RECORDER_ROWS; n++) {
        uint16_t place = recorder_place(&recorder, (uint16_t)(RECORDER_ROWS - 1u - n));
        unsigned state = (unsigned)recorder.row[place].byte[RECORDER_SLOW] & 15u;
        TEST_ASSERT_EQUAL_UINT16((n < RECORDER_ROWS - RECORDER_AFTER) ? DRIVE_STOPPED : DRIVE_FAULT, state);
    }
}

static void clear_fault(void)
{
    drive.command.clear_fault = 1;
    period();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_a_cleared_fault_s_record_stays_until_the_next_start(void)
{
    periods(200);
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    periods(40);
    clear_fault();
    recorder_background(&recorder, &drive);
    drive_raise(&drive, FAULT_UNDERVOLTAGE); /* a second fault, without a start between */
    periods(40);
    recorder_background(&recorder, &drive);
    expect_rows(RECORDER_ROWS, end_of(200));
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, recorder.fault);
    clear_fault();
    while (drive.state != (uint16_t)DRIVE_STOPPED) {
        rig_tick(1);
    }
    drive_start(&drive, &params, 1);
    recorder_background(&recorder, &drive);
    TEST_ASSERT_EQUAL_UINT16(0, recorder_rows(&recorder));
    count_anew();
    periods(5);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    periods(40);
    expect_rows(2 + RECORDER_AFTER, end_of(5));
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_HW, recorder.fault);
}

static void expect_offsets(int16_t a_q13, int16_t b_q13)
{
    TEST_ASSERT_EQUAL_INT16(a_q13, recorder.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(b_q13, recorder.offset_b_q13);
}

static void pass(int16_t offset_a_q13, int16_t offset_b_q13)
{
    drive.calibration.offset_a_q13 = offset_a_q13;
    drive.calibration.offset_b_q13 = offset_b_q13;
    recorder_background(&recorder, &drive);
}

void test_record_keeps_the_offsets_of_its_run(void)
{
    expect_offsets(0, 0);
    pass(-40, 30);
    expect_offsets(-40, 30);
    periods(100);
    drive_raise(&drive, FAULT_STALL);
    periods(7);
    pass(-40, 30);
    periods(40);
    pass(7, 8); /* measured anew after the fault is cleared */
    expect_offsets(-40, 30);
    recorder_restart(&recorder, 0, FAULT_WATCHDOG);
    pass(0, 0); /* after a reset nobody has measured yet */
    expect_offsets(-40, 30);
    drive.command.run = 1;
    pass(9, -10);
    pass(9, -10);
    expect_offsets(9, -10);
}

void test_of_two_faults_at_once_the_first_is_told(void)
{
    periods(190);
    drive_raise(&drive, FAULT_LOST_LOCK);
    periods(3);
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    periods(40);
    TEST_ASSERT_EQUAL_UINT16(FAULT_LOST_LOCK, recorder.fault);
    expect_rows(RECORDER_ROWS, end_of(190));
}

void test_a_fault_cleared_within_its_sixteen_rows_ends_the_record(void)
{
    periods(190);
    drive_raise(&drive, FAULT_LOST_LOCK);
    periods(7);
    recorder_background(&recorder, &drive);
    TEST_ASSERT_EQUAL_UINT16(0, recorder_rows(&recorder));
    clear_fault();
    recorder_background(&recorder, &drive);
    expect_rows(RECORDER_ROWS, 198);
    periods(40);
    expect_rows(RECORDER_ROWS, 198);
}

void test_a_reset_keeps_the_record_of_a_fault_and_power_up_does_not(void)
{
    periods(200);
    drive_raise(&drive, FAULT_STALL);
    periods(40);
    recorder_restart(&recorder, 0, FAULT_NONE);
    expect_rows(RECORDER_ROWS, end_of(200));
    recorder_restart(&recorder, 0, FAULT_WATCHDOG); /* the first stays the first */
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, recorder.fault);
    recorder_restart(&recorder, 1, FAULT_NONE);
    TEST_ASSERT_EQUAL_UINT16(0, recorder_rows(&recorder));
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, recorder.fault);
}

void test_a_reset_that_is_a_fault_itself_keeps_what_came_before_it(void)
{
    periods(200);
    recorder_restart(&recorder, 0, FAULT_WATCHDOG);
    expect_rows(RECORDER_ROWS, 200);
    TEST_ASSERT_EQUAL_UINT16(FAULT_WATCHDOG, recorder.fault);
    setUp();
    periods(33);
    drive_raise(&drive, FAULT_TRAP);
    periods(4);
    recorder_restart(&recorder, 0, FAULT_TRAP); /* in the middle of the last rows */
    expect_rows(18, 37);
}

void test_a_reset_of_a_healthy_drive_begins_anew(void)
{
    periods(100);
    recorder_restart(&recorder, 0, FAULT_NONE);
    TEST_ASSERT_EQUAL_UINT16(0, recorder_rows(&recorder));
    count_anew();
    periods(3);
    drive_raise(&drive, FAULT_STALL);
    periods(40);
    expect_rows(1 + RECORDER_AFTER, end_of(3));
}

void test_what_ram_happens_to_hold_is_no_record(void)
{
    static const struct {
        const char *what;
        uint8_t left, full, fault, check_off;
        int16_t next;
    } cases[] = {
        { "check word", 0, 1, FAULT_STALL, 1, 0 },
        { "rows to come", RECORDER_AFTER + 2, 1, FAULT_STALL, 0, 0 },
        { "next row behind the last", 0, 1, FAULT_STALL, 0, RECORDER_ROWS * RECORDER_BYTES },
        { "next row before the first", 0, 1, FAULT_STALL, 0, -RECORDER_BYTES },
        { "next row within a row", 0, 1, FAULT_STALL, 0, 3 },
        { "neither full nor not", 0, 2, FAULT_STALL, 0, 0 },
        { "no such fault", 0, 1, FAULT_COUNT, 0, 0 },
    };
    periods(100);
    EACH(n, cases) {
        recorder.left = cases[n].left;
        recorder.next = cases[n].next;
        recorder.full = cases[n].full;
        recorder.fault = cases[n].fault;
        recorder.check = (uint8_t)(recorder.check + cases[n].check_off);
        recorder_restart(&recorder, 0, FAULT_STALL);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(0, recorder_rows(&recorder), cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(RECORDER_AFTER + 1, recorder.left, cases[n].what);
    }
    recorder.left = 0; /* and the same with nothing wrong is one */
    recorder.full = 1;
    recorder.fault = FAULT_STALL;
    recorder_restart(&recorder, 0, FAULT_NONE);
    TEST_ASSERT_EQUAL_UINT16(RECORDER_ROWS, recorder_rows(&recorder));
}
