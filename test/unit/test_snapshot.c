/* SNAPSHOT: four columns of a recording under the note's names, a row every SNAPDELAY periods. */
/* defines: -DSNAPSHOT */
#include "hurst_params.h"

#include "firmware/board/isr.c"
#include "firmware/board/modes/snapshot_arrays.c"

#include "unity.h"


void setUp(void)
{
    uint16_t n;
    drive_init(&board_drive, &board_params);
    for (n = 0; n < 50u; n++) {
        SnapBuf1[n] = SnapBuf2[n] = SnapBuf3[n] = SnapBuf4[n] = 0x7EEE;
    }
    SnapStart = 0;
    SnapDone = 0;
    board_snapshot.row = 0;
    board_snapshot.wait = 0;
}

void tearDown(void)
{
}

/** Periods of a drive whose signals count the periods. */
static uint16_t period;

static void record(uint16_t periods)
{
    while (periods-- != 0u) {
        period++;
        board_drive.i_a_q13 = (int16_t)period;
        board_drive.run.control.i_q13.q = (int16_t)-period;
        board_drive.run.estimator.omega_filtered_q16 = (int32_t)(10 * period) * 65536;
        board_drive.run.estimator.rho_q32 = (uint32_t)(100u * period) << 16;
        mode_record();
    }
}

void test_nothing_is_recorded_without_a_request(void)
{
    record(1000);
    TEST_ASSERT_EQUAL_HEX16(0x7EEE, SnapBuf1[0]);
    TEST_ASSERT_EQUAL_UINT16(0, SnapDone);
}

void test_currents_beyond_the_notes_format_are_limited_not_wrapped(void)
{
    int16_t sign;
    for (sign = -1; sign <= 1; sign = (int16_t)(sign + 2)) {
        uint16_t n;
        board_snapshot.row = 0;
        SnapStart = 1;
        board_drive.i_a_q13 = (int16_t)(sign * 12000);
        board_drive.run.control.i_q13.q = (int16_t)(sign * 8200);
        for (n = 0; n < 5u; n++) {
            mode_record();
        }
        TEST_ASSERT_EQUAL_INT16(sign * 32764, SnapBuf1[0]);
        TEST_ASSERT_EQUAL_INT16(sign * 32764, SnapBuf2[0]);
    }
}

void test_a_row_every_five_periods_until_fifty_are_full(void)
{
    uint16_t n;
    period = 0;
    SnapStart = 1;
    record(249);
    TEST_ASSERT_EQUAL_UINT16(0, SnapDone);
    TEST_ASSERT_EQUAL_UINT16(1, SnapStart);
    record(1);
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone);
    TEST_ASSERT_EQUAL_UINT16(0, SnapStart);
    for (n = 0; n < 50u; n++) {
        int16_t at = (int16_t)(5 * (n + 1));
        TEST_ASSERT_EQUAL_INT16(4 * at, SnapBuf1[n]);   /* phase current a, note's format */
        TEST_ASSERT_EQUAL_INT16(-4 * at, SnapBuf2[n]);  /* q current */
        TEST_ASSERT_EQUAL_INT16(10 * at, SnapBuf3[n]);  /* filtered speed */
        TEST_ASSERT_EQUAL_INT16(100 * at, SnapBuf4[n]); /* angle */
    }
}

void test_done_stays_until_the_next_request(void)
{
    SnapStart = 1;
    record(250);
    record(1000);
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone);
}

void test_recording_stops_when_full(void)
{
    int16_t last;
    SnapStart = 1;
    record(250);
    last = SnapBuf1[49];
    record(1000);
    TEST_ASSERT_EQUAL_INT16(last, SnapBuf1[49]);
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone);
}

void test_a_second_request_records_from_the_first_row_again(void)
{
    SnapStart = 1;
    record(250);
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone);
    period = 1000;
    SnapStart = 1;
    record(249);
    TEST_ASSERT_EQUAL_UINT16(0, SnapDone); /* taken back while recording */
    record(1);
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone);
    TEST_ASSERT_EQUAL_INT16(4 * 1005, SnapBuf1[0]);
    TEST_ASSERT_EQUAL_INT16(4 * 1250, SnapBuf1[49]);
}

void test_currents_beyond_the_notes_format_are_limited(void)
{
    uint16_t n;
    SnapStart = 1;
    for (n = 0; n < 5u; n++) {
        board_drive.i_a_q13 = 9000;
        board_drive.run.control.i_q13.q = -9000;
        mode_record();
    }
    TEST_ASSERT_EQUAL_INT16(32764, SnapBuf1[0]);
    TEST_ASSERT_EQUAL_INT16(-32764, SnapBuf2[0]);
}

void test_control_interrupt_records(void)
{
    uint16_t n;
    host_registers_reset();
    SnapStart = 1;
    for (n = 0; n < 249u; n++) {
        _ADC1Interrupt();
    }
    TEST_ASSERT_EQUAL_UINT16(0, SnapDone);
    _ADC1Interrupt();
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone);
}
