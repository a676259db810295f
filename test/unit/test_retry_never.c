/* Without retries (RETRY_COUNT 0) a fault stays until S2, and one press clears it. */
#include "panel_rig.h"

static retry_t retry;

static void all_ms(uint32_t ms)
{
    while (ms-- != 0u) {
        rig_tick(20);
        panel_ms(1);
        retry_tick(&retry, &the_request, &drive, 1);
    }
}

void test_never_means_never(void)
{
    TEST_ASSERT_EQUAL_INT(0, RETRY_COUNT);
    panel_reset();
    rig_ready();
    retry_init(&retry);
    the_request.wish_run = 1;
    all_ms(30);
    drive_raise(&drive, FAULT_STALL);
    all_ms(60000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, retry.first);
    drive.command.clear_fault = 1;
    all_ms(5);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    inputs.s2_down = 1;
    all_ms(60);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, drive.state);
}
