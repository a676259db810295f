/* SNAPSHOT: four columns of a recording under AN1292's names, a row every SNAPDELAY periods. */
/* defines: -DSNAPSHOT */
#include "hurst_params.h"

#include "firmware/board/isr.c"
#include "firmware/board/modes/mode_board.c"

#include "interrupts.h"
#include "unity.h"

static uint16_t period;

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
    period = 0;
}

/** Periods of a drive whose signals count the periods. */
static void record(uint16_t periods)
{
    while (periods-- != 0u) {
        period++;
        board_drive.phases_q13.a = (int16_t)period;
        board_drive.run.control.i_q13.q = (int16_t)-period;
        board_drive.run.estimator.omega_filtered_q16 = (int32_t)(10 * period) * 65536;
        board_drive.run.estimator.rho_q32 = (uint32_t)(100u * period) << 16;
        mode_record();
    }
}

/** A whole recording on request, 50 rows, one every five periods. */
static void record_all(uint16_t first)
{
    uint16_t n;
    period = first;
    SnapStart = 1;
    record(249);
    TEST_ASSERT_EQUAL_UINT16(0, SnapDone); /* taken back while recording */
    TEST_ASSERT_EQUAL_UINT16(1, SnapStart);
    record(1);
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone);
    TEST_ASSERT_EQUAL_UINT16(0, SnapStart);
    for (n = 0; n < 50u; n++) {
        uint16_t at = (uint16_t)(first + 5u * (n + 1u));
        TEST_ASSERT_EQUAL_INT16(4 * at, SnapBuf1[n]);            /* phase current a, AN1292's format */
        TEST_ASSERT_EQUAL_INT16(-4 * at, SnapBuf2[n]);           /* q current */
        TEST_ASSERT_EQUAL_INT16(10 * at, SnapBuf3[n]);           /* filtered speed */
        TEST_ASSERT_EQUAL_INT16((int16_t)(100u * at), SnapBuf4[n]); /* angle */
    }
}

void test_each_request_records_fifty_rows_and_nothing_is_recorded_without_one(void)
{
    record(1000);
    TEST_ASSERT_EQUAL_HEX16(0x7EEE, SnapBuf1[0]);
    TEST_ASSERT_EQUAL_UINT16(0, SnapDone);
    record_all(0);
    record(1000);
    TEST_ASSERT_EQUAL_INT16(4 * 250, SnapBuf1[49]);
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone); /* until the next request */
    record_all(1000);
}

void test_currents_beyond_AN1292s_format_are_limited_not_wrapped(void)
{
    int16_t sign;
    for (sign = -1; sign <= 1; sign = (int16_t)(sign + 2)) {
        uint16_t n;
        board_snapshot.row = 0;
        SnapStart = 1;
        board_drive.phases_q13.a = (int16_t)(sign * 12000);
        board_drive.run.control.i_q13.q = (int16_t)(sign * 8200);
        for (n = 0; n < 5u; n++) {
            mode_record();
        }
        TEST_ASSERT_EQUAL_INT16(sign * 32764, SnapBuf1[0]);
        TEST_ASSERT_EQUAL_INT16(sign * 32764, SnapBuf2[0]);
    }
}

void test_control_interrupt_records(void)
{
    uint16_t n;
    host_registers_reset();
    SnapStart = 1;
    for (n = 0; n < 249u; n++) {
        a_period();
    }
    TEST_ASSERT_EQUAL_UINT16(0, SnapDone);
    a_period();
    TEST_ASSERT_EQUAL_UINT16(1, SnapDone);
}
