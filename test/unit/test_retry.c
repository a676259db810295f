/* The retry: which faults it tries again, how often, after which pause, and what ends it. */
#include "hurst_params.h"

#undef RETRY_COUNT
#define RETRY_COUNT 3

#include "law.c"
#include "panel_rig.h"

static retry_t retry;

void setUp(void)
{
    panel_reset();
    rig_ready();
    panel_turn_pot(0);
    retry_init(&retry);
}

/** Milliseconds of drive, panel and retry together. */
static void all_ms(uint32_t ms)
{
    while (ms-- != 0u) {
        rig_tick(20);
        panel_ms(1);
        retry_tick(&retry, &the_request, &drive, 1);
    }
}

static void press(void)
{
    inputs.s2_down = 1;
    all_ms(31);
    inputs.s2_down = 0;
    all_ms(1);
}

static void run(void)
{
    press();
    all_ms(20);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, drive.state);
}

static void fault(drive_fault_t code)
{
    drive_raise(&drive, code);
    all_ms(1);
}

static uint32_t ms_to_restart(uint32_t most)
{
    uint32_t ms;
    for (ms = 0; ms < most && !drive_is_running(&drive); ms++) {
        all_ms(1);
    }
    return ms;
}

void test_a_passing_fault_starts_again_after_the_pause(void)
{
    run();
    fault(FAULT_STALL);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, retry.first);
    TEST_ASSERT_UINT32_WITHIN(15, 2000 + 10, ms_to_restart(5000)); /* and the charging of the drivers */
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(2, retry.left);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, retry.first);
}

void test_the_outputs_are_off_in_all_of_the_pause(void)
{
    uint16_t ms;
    run();
    fault(FAULT_STALL);
    for (ms = 0; ms < 1990u; ms++) {
        all_ms(1);
        TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
        TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
    }
}

void test_after_the_stated_number_the_fault_stays_and_the_first_cause_is_told(void)
{
    static const drive_fault_t later[] = { FAULT_START_FAILED, FAULT_LOST_LOCK, FAULT_START_FAILED };
    run();
    fault(FAULT_STALL);
    EACH(n, later) {
        TEST_ASSERT_EQUAL_UINT16(3 - n, retry.left);
        TEST_ASSERT_TRUE(ms_to_restart(5000) < 5000u);
        fault(later[n]);
    }
    all_ms(7000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    TEST_ASSERT_EQUAL_UINT16(FAULT_START_FAILED, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(0, retry.left);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, retry.first);
}

void test_each_fault_is_tried_again_as_its_row_says(void)
{
#define ROW(code, name, passes, decided_by, cause, remedy) { #name, (code), (passes) },
    static const struct {
        const char *name;
        uint16_t code, passes;
    } rows[] = { DRIVE_FAULT_TABLE(ROW) };
    uint16_t passing = 0;
    EACH(n, rows) {
        if (rows[n].code == (uint16_t)FAULT_NONE) {
            continue;
        }
        setUp();
        run();
        fault((drive_fault_t)rows[n].code);
        all_ms(3000);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(rows[n].passes ? FAULT_NONE : rows[n].code, drive.fault, rows[n].name);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(rows[n].code, retry.first, rows[n].name);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(rows[n].passes, retry_may_pass(rows[n].code), rows[n].name);
        passing = (uint16_t)(passing + rows[n].passes);
    }
    TEST_ASSERT_TRUE(passing >= 5 && passing < sizeof rows / sizeof rows[0] / 2);
    TEST_ASSERT_EQUAL_UINT16(0, retry_may_pass(FAULT_OVERCURRENT_HW));
    TEST_ASSERT_EQUAL_UINT16(0, retry_may_pass(FAULT_OVERCURRENT_SW));
    TEST_ASSERT_EQUAL_UINT16(0, retry_may_pass(FAULT_WATCHDOG));
}

void test_a_staying_fault_after_a_passing_one_ends_it(void)
{
    run();
    fault(FAULT_STALL);
    (void)ms_to_restart(5000);
    fault(FAULT_OVERCURRENT_HW);
    all_ms(7000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERCURRENT_HW, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(2, retry.left);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, retry.first);
}

void test_s2_in_the_pause_ends_it_and_gives_the_retries_back(void)
{
    run();
    fault(FAULT_STALL);
    (void)ms_to_restart(5000);
    fault(FAULT_STALL);
    all_ms(1000);
    press();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    all_ms(7000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_UINT16(3, retry.left);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, retry.first);
    run();
}

void test_s2_in_every_millisecond_around_the_pause_s_end_leaves_the_motor_standing(void)
{
    uint16_t ms;
    for (ms = 1965; ms < 1972u; ms++) { /* the press acts after 30 ms: in the last ones of the pause, and with the fault cleared */
        setUp();
        drive.calibration.done = 0; /* the fault has interrupted the calibration: it takes its time before the start */
        the_request.wish_run = 1;
        fault(FAULT_OVERVOLTAGE);
        all_ms(ms);
        press();
        all_ms(5000);
        TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
        TEST_ASSERT_EQUAL_INT16(0, the_request.wish_run);
    }
}

void test_s2_after_the_last_retry_clears_and_all_are_there_again(void)
{
    uint16_t n;
    run();
    for (n = 0; n < 4u; n++) {
        fault(FAULT_STALL);
        (void)ms_to_restart(5000);
    }
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
    press();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(3, retry.left);
    all_ms(5000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}

void test_a_fault_at_rest_starts_nothing(void)
{
    all_ms(100);
    fault(FAULT_OVERVOLTAGE);
    all_ms(7000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, retry.first);
}

void test_a_fault_that_somebody_else_clears_is_not_tried_again(void)
{
    run();
    fault(FAULT_STALL);
    all_ms(100);
    drive.command.clear_fault = 1;
    all_ms(7000);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}

void test_a_voltage_that_stays_wrong_uses_up_the_retries(void)
{
    run();
    rig_bus(PARAM_F(UNDER_VOLTAGE_V) - 1.0F);
    all_ms(7000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_UNDERVOLTAGE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(0, retry.left);
}

void test_the_time_without_a_fault_gives_the_retries_back_in_closed_loop_only(void)
{
    uint32_t ms;
    run();
    fault(FAULT_STALL);
    (void)ms_to_restart(5000);
    retry_tick(&retry, &the_request, &drive, 20000); /* the start is no proof */
    TEST_ASSERT_EQUAL_UINT16(2, retry.left);
    drive.state = (uint16_t)DRIVE_CLOSED;
    for (ms = 0; ms < 9999u; ms++) {
        retry_tick(&retry, &the_request, &drive, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(2, retry.left);
    retry_tick(&retry, &the_request, &drive, 1);
    TEST_ASSERT_EQUAL_UINT16(3, retry.left);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, retry.first);
}

void test_a_fault_begins_the_time_without_one_anew(void)
{
    run();
    drive.state = (uint16_t)DRIVE_CLOSED;
    retry_tick(&retry, &the_request, &drive, 9000);
    fault(FAULT_STALL);
    TEST_ASSERT_TRUE(ms_to_restart(5000) > 1990u); /* nor does it shorten the pause */
    drive.state = (uint16_t)DRIVE_CLOSED;
    retry_tick(&retry, &the_request, &drive, 9000);
    TEST_ASSERT_EQUAL_UINT16(2, retry.left);
}

void test_the_fast_range_is_kept(void)
{
    run();
    press_s3(40);
    TEST_ASSERT_EQUAL_INT16(1, app_panel.fast_range);
    fault(FAULT_STALL);
    (void)ms_to_restart(5000);
    TEST_ASSERT_EQUAL_INT16(1, app_panel.fast_range);
}
