/* Deviations that stay though no limit holds the drive back: they mean a wrong signal. */
#include "drive_rig.h"

#include "drive/deviation.h"
#include "drive/limit_reasons.h"

static deviation_t deviation;

void setUp(void)
{
    rig_power_up();
    rig_closed(1, 10000);
    drive.run.control.ref_q13.d = 0;
    drive.run.control.i_q13.d = 0;
    deviation.id_q16 = 0;
}

/** Milliseconds until it is found, at most 3000. */
static uint16_t ms_until_found(uint16_t reasons)
{
    uint16_t ms = 0;
    while (ms < 3000u && !deviation_tick(&deviation, &drive, &params, reasons)) {
        ms++;
    }
    return ms;
}

void test_d_current_that_stays_further_off_than_noise_and_dead_time_is_found_whatever_its_sign(void)
{
    const int16_t limit = params.id_off_q13;
    uint16_t ms = 0;
    drive.run.control.i_q13.d = limit;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until_found(0));
    setUp();
    do { /* noise */
        drive.run.control.i_q13.d = (int16_t)((ms & 1u) ? 4 * limit : -4 * limit);
        ms++;
    } while (ms < 3000u && !deviation_tick(&deviation, &drive, &params, 0));
    TEST_ASSERT_UINT16_WITHIN(10, 355, ms);
}

void test_deviations_are_no_fault_where_a_limit_holds_the_drive_back_or_the_start_is_not_over(void)
{
    static const uint16_t held[] = { LIMIT_VOLTAGE, LIMIT_CURRENT, LIMIT_BRAKE, LIMIT_RAMP, LIMIT_RAMP_WAITS, LIMIT_SPEED_RANGE };
    drive.run.control.i_q13.d = (int16_t)(4 * params.id_off_q13);
    EACH(n, held) {
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(3000, ms_until_found(held[n]), golden_row(n));
    }
    TEST_ASSERT_LESS_THAN_UINT16(400, ms_until_found((uint16_t)LIMIT_FIELD_WEAKENING));
    drive.run.handover.id_q13 = 10;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until_found(0));
    drive.run.handover.id_q13 = 0;
    drive.state = (uint16_t)DRIVE_STOPPING;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until_found(0));
    drive.state = (uint16_t)DRIVE_CLOSED;
    TEST_ASSERT_UINT16_WITHIN(10, 355, ms_until_found(0)); /* anew */
}

void test_d_current_that_follows_its_reference_is_none_however_large(void)
{
    drive.run.control.ref_q13.d = (int16_t)(-4 * params.id_off_q13);
    drive.run.control.i_q13.d = drive.run.control.ref_q13.d;
    TEST_ASSERT_EQUAL_UINT16(3000, ms_until_found(0));
    drive.run.control.i_q13.d = 0;
    TEST_ASSERT_UINT16_WITHIN(10, 355, ms_until_found(0));
}

void test_deviations_of_a_quarter_of_a_second_ride_through(void)
{
    uint16_t n, ms;
    for (n = 0; n < 3u; n++) {
        drive.run.control.i_q13.d = 3000;
        for (ms = 0; ms < 250u; ms++) {
            TEST_ASSERT_EQUAL_UINT16(0, deviation_tick(&deviation, &drive, &params, 0));
        }
        drive.run.control.i_q13.d = 0;
        for (ms = 0; ms < 1500u; ms++) {
            (void)deviation_tick(&deviation, &drive, &params, 0);
        }
    }
}
