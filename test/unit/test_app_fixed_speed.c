/* The application fixed_speed: it starts by itself, and how often and when it tries again. */
/* defines: -DDIRECTION_INPUT_USED=1 */
#include "firmware/app/fixed_speed.c"

#include "app_rig.h"

void setUp(void)
{
    rig_fresh();
}

void tearDown(void)
{
}

void test_it_runs_from_the_first_call_on_at_its_one_speed(void)
{
    rig_ms();
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
    TEST_ASSERT_EQUAL_INT16(APP_RPM(FIXED_RPM), asks.target_erpm);
    told.pot_q16 = 65535;
    rig_ms();
    TEST_ASSERT_EQUAL_INT16(APP_RPM(FIXED_RPM), asks.target_erpm);
}

void test_the_direction_input_turns_its_speed_round(void)
{
    told.inputs = APP_S2 | APP_S3 | APP_DIRECTION;
    rig_ms();
    TEST_ASSERT_EQUAL_INT16(-APP_RPM(FIXED_RPM), asks.target_erpm);
    told.inputs = APP_S2 | APP_S3;
    rig_ms();
    TEST_ASSERT_EQUAL_INT16(APP_RPM(FIXED_RPM), asks.target_erpm);
}

void test_a_fault_is_cleared_after_the_pause_and_the_motor_then_starts_anew(void)
{
    told.fault = FAULT_STALL;
    TEST_ASSERT_UINT16_WITHIN(1, FIXED_PAUSE_MS, rig_ms_to_clear(60000));
    TEST_ASSERT_EQUAL_INT16_MESSAGE(0, asks.run, "a start is a change from 0 to 1");
    told.fault = FAULT_NONE;
    rig_ms();
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_slow_calls_count_their_elapsed_time(void)
{
    told.fault = FAULT_STALL;
    told.elapsed_ms = 10;
    TEST_ASSERT_UINT16_WITHIN(1, FIXED_PAUSE_MS / 10u, rig_ms_to_clear(60000));
}

void test_a_fault_that_comes_back_is_cleared_as_often_as_stated_and_then_stays(void)
{
    told.fault = FAULT_STALL; /* clearing it does not help: the shaft is still blocked */
    TEST_ASSERT_EQUAL_UINT16(FIXED_TRIES, rig_clears(60000));
}

void test_a_minute_without_a_fault_gives_all_tries_back(void)
{
    told.fault = FAULT_STALL;
    (void)rig_clears(60000);
    told.fault = FAULT_NONE;
    (void)rig_clears(FIXED_CALM_MS + 2u);
    told.fault = FAULT_STALL;
    TEST_ASSERT_EQUAL_UINT16(FIXED_TRIES, rig_clears(60000));
}

void test_less_than_a_minute_without_a_fault_gives_none_back(void)
{
    told.fault = FAULT_STALL;
    (void)rig_clears(60000);
    told.fault = FAULT_NONE;
    (void)rig_clears(FIXED_CALM_MS - 100u);
    told.fault = FAULT_STALL;
    TEST_ASSERT_EQUAL_UINT16(0, rig_clears(60000));
}

void test_a_fault_that_may_be_a_short_circuit_is_never_cleared(void)
{
    static const uint16_t stays[] = { FAULT_OVERCURRENT_HW, FAULT_OVERCURRENT_SW, FAULT_OPEN_PHASE, FAULT_TRAP, FAULT_SELFTEST };
    EACH(n, stays) {
        rig_fresh();
        told.fault = stays[n];
        TEST_ASSERT_EQUAL_UINT16(0, rig_clears(60000));
        TEST_ASSERT_EQUAL_INT16(0, asks.run);
    }
}

void test_it_waits_for_a_client_and_starts_when_that_gives_the_command_back(void)
{
    told.is_remote = 1;
    rig_ms();
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    told.is_remote = 0;
    rig_ms();
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}
