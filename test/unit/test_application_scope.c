/* The seam of the application with a client of the serial line in command: it asks in vain, but for a stop because it is late. */
/* defines: -DSCOPE=1 */
#include "hurst_params.h"

#include "law.c"
#include "firmware/board/application.c"
#include "drive/param_init.h"

#include "mock_peripherals.h"
#include "mock_reset.h"
#include "unity.h"

drive_t board_drive;
request_t board_request;
const drive_params_t board_params = DRIVE_PARAMS_INIT;
remote_t scope_command;
tLimitParm LimitParm;
static uint16_t late, told_remote, tripped;

void firmware_trip(drive_fault_t fault)
{
    tripped = (uint16_t)fault;
}

void app_init(void)
{
}

/** Asks for a stop, as one that knows nothing of clients. */
void app_ms(const app_told_t *told, app_asks_t *asks)
{
    told_remote = told->is_remote;
    asks->run = 0;
    if (late) {
        board_drive.ticks = (uint16_t)(board_drive.ticks + LATE_TICKS + 1u);
        application_watch();
    }
}

void setUp(void)
{
    drive_init(&board_drive, &board_params);
    board_drive.state = (uint16_t)DRIVE_CLOSED;
    board_drive.direction = 1;
    request_init(&board_request);
    drive_zero(&scope_command, sizeof scope_command);
    remote_init(&scope_command);
    application_init();
    late = 0;
    tripped = (uint16_t)FAULT_NONE;
    scope_command.mode = (uint16_t)REMOTE_START;
    scope_command.lease_ms = 1000;
    scope_command.run = 1;
    application_tick(1);
    TEST_ASSERT_EQUAL_INT16(1, board_drive.command.run);
}

void test_a_client_s_run_stands_whatever_the_application_asks(void)
{
    application_tick(1);
    TEST_ASSERT_EQUAL_UINT16(1, told_remote);
    TEST_ASSERT_EQUAL_INT16(1, board_drive.command.run);
}

void test_a_late_application_ends_a_client_s_run_too(void)
{
    late = 1;
    application_tick(1);
    late = 0;
    application_tick(1);
    TEST_ASSERT_EQUAL_INT16(0, board_drive.command.run);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, tripped);
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    application_tick(1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_APPLICATION, tripped);
}
