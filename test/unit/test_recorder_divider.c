/* The fault recorder with a row every fourth period, and of a motor whose speed has finer steps. */
#include "hurst_params.h"

#undef RECORDER_PERIODS
#define RECORDER_PERIODS 4
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 2500 /* 1.25 * 12500 electrical rpm end in a byte of 128 each */

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
    recorder_tick(&recorder, &drive, &samples);
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
            uint16_t place = recorder_place(&recorder, n), tick = (uint16_t)(first_after + 4u * (n - (RECORDER_ROWS - RECORDER_AFTER)));
            const int8_t *byte = &recorder.byte[place * RECORDER_BYTES];
            uint16_t of = (uint16_t)((place % 2u) ? tick : tick - 4u), slow = (uint16_t)((place % 4u < 2u) ? 32u * of >> 7 : 96u * of >> 8);
            TEST_ASSERT_EQUAL_HEX8(64u * tick >> 8, byte[RECORDER_V_D]);
            TEST_ASSERT_EQUAL_HEX8((place % 2u) ? slow >> 4 : slow & 15u, ((unsigned)byte[RECORDER_SLOW] & 0xFFu) >> 4);
            TEST_ASSERT_EQUAL_UINT16((tick < first_after) ? DRIVE_CALIBRATE : DRIVE_FAULT, (unsigned)byte[RECORDER_SLOW] & RECORDER_STATE_BITS);
        }
    }
}

void test_speed_beyond_a_byte_is_the_most_that_it_has(void)
{
    static const struct {
        int16_t speed;
        uint16_t byte;
    } cases[] = { { 15625, 122 }, { 127, 0 }, { -1, 255 }, { 16383, 127 }, { 16384, 127 }, { INT16_MAX, 127 }, { -16384, 128 }, { -16385, 128 },
                  { INT16_MIN, 128 } };
    drive_init(&drive, &params);
    EACH(n, cases) {
        rig_speed(cases[n].speed);
        TEST_ASSERT_EQUAL_HEX8(cases[n].byte, recorder_slow(&drive, &samples, 5 * RECORDER_BYTES));
    }
}
