/* Remote control: a client's command through the panel, its lease, and who wins. */
/* defines: -DSCOPE=1 */
#include "hurst_params.h"

#undef RETRY_COUNT
#define RETRY_COUNT 3


#include "law.c"
#include "panel_rig.h"

#include "drive/request.h"

static remote_t command;

/** What a client writes, the lease last. */
static void client(uint16_t mode, uint16_t run, int16_t target_erpm)
{
    command.mode = mode;
    command.run = run;
    command.target_erpm = target_erpm;
    command.lease_ms = 100;
}

/** Milliseconds in which the client renews its lease. */
static void attended_ms(uint16_t ms)
{
    while (ms-- != 0u) {
        command.lease_ms = 100;
        panel_and_drive_ms(1);
    }
}

/** A client's run that has ended with a stall so many milliseconds ago. */
static void stall_of_a_run(uint16_t ago_ms)
{
    client(REMOTE_TARGET, 1, 6000);
    attended_ms(5);
    drive_raise(&drive, FAULT_STALL);
    attended_ms(ago_ms);
}

void setUp(void)
{
    rig_ready();
    panel_reset();
    remote_init(&command);
    the_client = &command;
    panel_turn_pot(512);
}

void test_an_application_that_asks_for_no_run_does_not_end_a_clients(void)
{
    const asked_t none = { .elapsed_ms = 1, .remote = &command };
    uint16_t ms;
    client(REMOTE_TARGET, 1, 6000);
    attended_ms(5);
    for (ms = 0; ms < 5u; ms++) {
        request_tick(&the_request, &drive, &params, &none);
        TEST_ASSERT_EQUAL_INT16(1, the_request.wish_run);
        TEST_ASSERT_EQUAL_INT16(6000, drive.command.target_erpm);
    }
}

void test_without_a_client_the_panel_is_in_command(void)
{
    int16_t of_pot = drive.command.target_erpm;
    command.run = 1;
    command.target_erpm = 5000;
    panel_ms(10);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(of_pot, drive.command.target_erpm);
    press_s2(40);
    panel_and_drive_ms(5);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_TRUE(request_holds(&the_request));
}

void test_a_client_starts_sets_the_target_and_stops(void)
{
    client(REMOTE_TARGET, 1, 6000);
    attended_ms(5);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(6000, drive.command.target_erpm);
    TEST_ASSERT_NOT_EQUAL(DRIVE_STOPPED, drive.state);
    command.target_erpm = 7000;
    attended_ms(1);
    TEST_ASSERT_EQUAL_INT16(7000, drive.command.target_erpm);
    TEST_ASSERT_TRUE(request_holds(&the_request));
    command.run = 0;
    attended_ms(2);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_TRUE(request_holds(&the_request));
}

void test_the_target_stays_between_minimum_and_maximum_in_either_direction(void)
{
    client(REMOTE_TARGET, 0, 32767);
    attended_ms(1);
    TEST_ASSERT_EQUAL_INT16(params.maximum_erpm, drive.command.target_erpm);
    command.target_erpm = 0;
    attended_ms(1);
    TEST_ASSERT_EQUAL_INT16(params.minimum_erpm, drive.command.target_erpm);
    command.target_erpm = -1;
    attended_ms(1);
    TEST_ASSERT_EQUAL_INT16(-params.minimum_erpm, drive.command.target_erpm);
    command.target_erpm = INT16_MIN;
    attended_ms(1);
    TEST_ASSERT_EQUAL_INT16(-params.maximum_erpm, drive.command.target_erpm);
}

void test_a_negative_target_starts_in_that_direction(void)
{
    client(REMOTE_TARGET, 1, -6000);
    attended_ms(3);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(-1, drive.direction);
}

void test_a_client_may_leave_the_target_to_the_potentiometer(void)
{
    int16_t of_pot = drive.command.target_erpm;
    client(REMOTE_START, 1, 6000);
    attended_ms(3);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(of_pot, drive.command.target_erpm);
}

void test_when_the_client_vanishes_its_run_ends_in_order_and_the_panel_is_in_command(void)
{
    int16_t of_pot = drive.command.target_erpm;
    client(REMOTE_TARGET, 1, 6000);
    panel_and_drive_ms(99);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    panel_ms(1);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_INT16(of_pot, drive.command.target_erpm);
    TEST_ASSERT_EQUAL_UINT16(REMOTE_PANEL, command.mode);
    TEST_ASSERT_TRUE(request_holds(&the_request));
    command.lease_ms = 100; /* alone it brings nothing back */
    panel_and_drive_ms(20);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
}

void test_a_client_that_leaves_stops_its_run(void)
{
    client(REMOTE_TARGET, 1, 6000);
    attended_ms(5);
    command.mode = REMOTE_PANEL;
    panel_ms(1);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
}

void test_mode_and_target_without_a_lease_are_no_command(void)
{
    client(REMOTE_TARGET, 1, 6000);
    command.lease_ms = 0;
    panel_ms(5);
    TEST_ASSERT_EQUAL_UINT16(0, command.is_taken);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_NOT_EQUAL(6000, drive.command.target_erpm);
    attended_ms(5); /* the lease begins: what stood there before is no start */
    TEST_ASSERT_EQUAL_UINT16(1, command.is_taken);
    TEST_ASSERT_EQUAL_INT16(6000, drive.command.target_erpm);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
}

void test_a_client_that_takes_over_without_a_wish_to_run_stops(void)
{
    press_s2(40);
    panel_and_drive_ms(5);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    client(REMOTE_TARGET, 0, 6000);
    attended_ms(2);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
}

void test_a_run_of_s2_outlives_the_client(void)
{
    press_s2(40);
    panel_and_drive_ms(5);
    client(REMOTE_TARGET, 1, 6000);
    panel_and_drive_ms(50);
    TEST_ASSERT_EQUAL_INT16(6000, drive.command.target_erpm);
    panel_and_drive_ms(60);
    TEST_ASSERT_EQUAL_UINT16(REMOTE_PANEL, command.mode);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
}

void test_a_lease_is_five_seconds_at_most(void)
{
    client(REMOTE_TARGET, 1, 6000);
    command.lease_ms = 65535;
    panel_ms(4999);
    TEST_ASSERT_EQUAL_UINT16(REMOTE_TARGET, command.mode);
    panel_ms(1);
    TEST_ASSERT_EQUAL_UINT16(REMOTE_PANEL, command.mode);
}

void test_a_longer_lease_is_cut_to_that_at_once(void)
{
    client(REMOTE_TARGET, 1, 6000);
    command.lease_ms = REMOTE_LEASE_MOST_MS + 1u;
    panel_ms(1);
    TEST_ASSERT_EQUAL_UINT16(REMOTE_LEASE_MOST_MS - 1u, command.lease_ms);
}

void test_a_lease_counts_the_time_that_a_pass_has_taken(void)
{
    client(REMOTE_TARGET, 0, 6000);
    remote_tick(&command, &the_request, &drive, 30);
    TEST_ASSERT_EQUAL_UINT16(70, command.lease_ms);
    remote_tick(&command, &the_request, &drive, 70);
    TEST_ASSERT_EQUAL_UINT16(REMOTE_PANEL, command.mode);
}

/** Or the retry would start it again. */
void test_a_client_that_stops_or_clears_in_a_fault_forgets_the_run_that_it_has_ended(void)
{
    stall_of_a_run(2);
    TEST_ASSERT_EQUAL_INT16(1, the_request.interrupted);
    command.run = 0;
    attended_ms(1);
    TEST_ASSERT_EQUAL_INT16(0, the_request.interrupted);
    the_request.interrupted = 1;
    command.run = 1;
    command.clear_fault = 1;
    attended_ms(1);
    TEST_ASSERT_EQUAL_INT16(0, the_request.interrupted);
}

void test_an_unknown_mode_is_the_panels(void)
{
    client(REMOTE_MODE_COUNT, 1, 6000);
    attended_ms(3);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_UINT16(0, command.is_taken);
}

/** Whoever stands at the board has the last word. */
void test_s2_takes_the_command_and_stops(void)
{
    client(REMOTE_TARGET, 1, 6000);
    attended_ms(5);
    inputs.s2_down = 1;
    attended_ms(40);
    inputs.s2_down = 0;
    attended_ms(5);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_UINT16(REMOTE_PANEL, command.mode);
    client(REMOTE_TARGET, 1, 6000); /* the client may come back, but its old wish starts nothing */
    attended_ms(20);
    TEST_ASSERT_EQUAL_INT16(0, the_request.wish_run);
    command.run = 0;
    attended_ms(2);
    command.run = 1;
    attended_ms(2);
    TEST_ASSERT_EQUAL_INT16(1, the_request.wish_run);
}

void test_a_fault_ends_the_run_and_needs_a_clear_and_a_new_start(void)
{
    stall_of_a_run(5);
    TEST_ASSERT_EQUAL_INT16(0, the_request.wish_run);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
    command.clear_fault = 1;
    attended_ms(5);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(0, command.clear_fault);
    attended_ms(100);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    command.run = 0;
    attended_ms(2);
    command.run = 1;
    attended_ms(2);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
}

void test_a_start_in_a_fault_is_no_start(void)
{
    drive_raise(&drive, FAULT_STALL);
    client(REMOTE_TARGET, 1, 6000);
    attended_ms(5);
    TEST_ASSERT_EQUAL_INT16(0, the_request.wish_run);
    TEST_ASSERT_EQUAL_INT16(0, the_request.interrupted);
    command.clear_fault = 1;
    attended_ms(100);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
}
