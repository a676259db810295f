/* The fault recorder with a row every fourth period. */
#include "hurst_params.h"

#undef RECORDER_PERIODS
#define RECORDER_PERIODS 4

#include "law.c"
#include "drive_rig.h"

#include "drive/recorder.h"

static recorder_t recorder;

void setUp(void)
{
}

static void period(void)
{
    drive.ticks++;
    drive.run.control.v_q14.d = (int16_t)(64u * drive.ticks);
    rig_speed((int16_t)(32u * drive.ticks));
    samples.v_bus = (int16_t)(96u * drive.ticks);
    if (drive.fault != (uint16_t)FAULT_NONE) {
        recorder_in_fault(&recorder, &drive);
    }
    if (recorder_is_due(&drive)) {
        recorder_write(&recorder, &drive, samples.i_a, samples.i_b, samples.v_bus);
    }
}

void test_every_fourth_period_has_a_row_and_sixteen_of_them_follow_the_fault_in_any_phase(void)
{
    uint16_t phase, n;
    for (phase = 0; phase < 4u; phase++) {
        uint16_t first_after;
        drive_init(&drive, &params);
        recorder_restart(&recorder, 1, FAULT_NONE);
        for (n = 0; n < 4u * 100u + phase; n++) {
            period();
        }
        drive_raise(&drive, FAULT_STALL);
        first_after = (uint16_t)((drive.ticks | 3u) + 1u);
        for (n = 0; n < 100u; n++) {
            period();
        }
        TEST_ASSERT_EQUAL_UINT16(RECORDER_ROWS, recorder_rows(&recorder));
        for (n = 0; n < RECORDER_ROWS; n++) {
            uint16_t place = recorder_place(&recorder, (uint16_t)(RECORDER_ROWS - 1u - n));
            uint16_t tick = (uint16_t)(first_after + 4u * (n - (RECORDER_ROWS - RECORDER_AFTER)));
            const int8_t *byte = recorder.row[place].byte;
            uint16_t row = (uint16_t)(0u - place) % 4u, of = (uint16_t)(tick - 4u * row);
            uint16_t slow = (uint16_t)((((place + row) % 8u == 4u) ? 32u : 96u) * of);
            TEST_ASSERT_EQUAL_HEX8(64u * tick >> 8, byte[RECORDER_V_D]);
            TEST_ASSERT_EQUAL_HEX8((slow >> (4u * row)) & 15u, ((unsigned)byte[RECORDER_SLOW] & 0xFFu) >> 4);
            TEST_ASSERT_EQUAL_UINT16((tick < first_after) ? DRIVE_CALIBRATE : DRIVE_FAULT, (unsigned)byte[RECORDER_SLOW] & 15u);
        }
    }
}
