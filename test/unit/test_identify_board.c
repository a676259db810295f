/* What the board shows of an identification: the status line and the watch variable. */
/* defines: -DIDENTIFY */
#include "hurst_params.h"

#include "firmware/board/modes/mode_board.c"
#include "firmware/board/status.c"
#include "firmware/board/watch.c"

#include "drive/param_init.h"
#include "law.c"
#include "mock_selftest_run.h"
#include "mock_peripherals.h"
#include "peripherals_on_registers.h"
#include "transmitter.h"
#include "unity.h"

drive_t board_drive;
request_t board_request;
retry_t board_retry;
volatile uint16_t board_reset_cause;
uint16_t board_selftest_parts;
const drive_params_t board_params = DRIVE_PARAMS_INIT;

/** No self-test has failed, and the flash has its CRC. */
static char *nothing_more(char *at, int calls)
{
    (void)calls;
    return at;
}

void setUp(void)
{
    peripherals_on_registers();
    selftest_put_Stub(nothing_more);
    selftest_put_marked_Stub(nothing_more);
    static const drive_t zero;
    board_drive = zero;
    transmitter_begins();
    status_init();
}

static void expect_line(const char *text)
{
    uint16_t n;
    status_tick(500);
    for (n = 0; n < 200u; n++) {
        status_send();
        transmitter_takes();
    }
    TEST_ASSERT_EQUAL_STRING(text, sent);
}

void test_line_before_the_first_measurement(void)
{
    expect_line("step 0 NONE fault NONE R 0 uohm Ld 0 nH Lq 0 nH Kphi 0 uV/krpm J 0e-9 kgm2 friction 0e-8 Nm + 0e-9 Nms\r\n");
}

void test_line_with_the_largest_numbers_fits(void)
{
    identify_values_t all = { 40000000ul, 60000000ul, 4294967295ul, 2000000000ul, 1000000001ul, 300000000ul, 1073741823ul };
    board_drive.run.identify.step = IDENTIFY_MECHANICS;
    board_drive.run.identify.result = IDENTIFY_RESULT_CURRENT_NOT_REACHED;
    board_drive.run.identify.values = all;
    board_drive.fault = FAULT_OVERTEMPERATURE;
    expect_line("step 12 CURRENT_NOT_REACHED fault OVERTEMPERATURE R 40000000 uohm Ld 60000000 nH Lq 4294967295 nH Kphi 2000000000 uV/krpm"
                " J 1000000001e-9 kgm2 friction 300000000e-8 Nm + 1073741823e-9 Nms\r\n");
    TEST_ASSERT_TRUE(sent_count < sizeof sent_line);
}

void test_watch_variable_shows_all_of_it(void)
{
    identify_values_t all = { 2692100, 1919400, 1920200, 40000000ul, 1000000000ul, 400000, 15300 };
    board_drive.run.identify.step = IDENTIFY_INDUCTANCE_Q;
    board_drive.run.identify.result = IDENTIFY_RESULT_BUSY;
    board_drive.run.identify.values = all;
    watch_refresh();
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_INDUCTANCE_Q, IdentifyParm.step);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, IdentifyParm.result);
    TEST_ASSERT_EQUAL_UINT32(2692100, IdentifyParm.Rs_uohm);
    TEST_ASSERT_EQUAL_UINT32(1919400, IdentifyParm.Ld_nH);
    TEST_ASSERT_EQUAL_UINT32(1920200, IdentifyParm.Lq_nH);
    TEST_ASSERT_EQUAL_UINT32(40000000ul, IdentifyParm.Kphi_uV_per_krpm);
    TEST_ASSERT_EQUAL_UINT32(1000000000ul, IdentifyParm.J_1e9_kgm2);
    TEST_ASSERT_EQUAL_UINT32(400000, IdentifyParm.Coulomb_1e8_Nm);
    TEST_ASSERT_EQUAL_UINT32(15300, IdentifyParm.Viscous_1e9_Nms);
}
