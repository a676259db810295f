/* The status line with a client on the line: it goes on until the first valid frame, and then never more. */
/* defines: -DSCOPE=1 */
#include "lnet_rig.h"

#include "firmware/board/scope.c"
#include "firmware/board/status.c"

#include "mock_selftest_run.h"
#include "mock_peripherals.h"
#include "peripherals_on_registers.h"
#include "transmitter.h"

drive_t board_drive;
request_t board_request;
const drive_params_t board_params;
retry_t board_retry;
uint16_t board_selftest_parts;
volatile uint16_t board_reset_cause;
tLimitParm LimitParm;

static const uint8_t *coming;
static uint16_t coming_count;

static int16_t give(int calls)
{
    (void)calls;
    if (coming_count == 0u) {
        return -1;
    }
    coming_count--;
    return *coming++;
}

static char *nothing_more(char *at, int calls)
{
    (void)calls;
    return at;
}

void setUp(void)
{
    peripherals_on_registers();
    uart_receive_Stub(give);
    selftest_put_Stub(nothing_more);
    selftest_put_marked_Stub(nothing_more);
    board_reset_cause = 0;
    transmitter_begins();
    coming_count = 0;
    status_init();
}

static void passes(uint16_t count)
{
    while (count-- != 0u) {
        status_send();
        transmitter_takes();
    }
}

static void receive(const uint8_t *bytes, uint16_t count)
{
    coming = bytes;
    coming_count = count;
}

static const uint8_t device_info_request[] = { 0x55, 1, 1, 0, 0x57 };

void test_text_goes_on_beside_noise(void)
{
    static const uint8_t noise[] = { 0, 0xFF, 'a', 0x02, 0x56 };
    status_tick(500);
    receive(noise, sizeof noise);
    passes(60);
    TEST_ASSERT_EQUAL_STRING("state 0 fault NONE speed 0 rpm\r\n", sent);
}

void test_a_valid_frame_ends_the_text_and_only_its_answer_follows(void)
{
    uint16_t n;
    status_tick(500);
    passes(4);
    TEST_ASSERT_EQUAL_STRING("stat", sent);
    receive(device_info_request, sizeof device_info_request);
    passes(5);
    TEST_ASSERT_EQUAL_UINT16(5, sent_count); /* the answer begins in the pass of the request's last byte */
    passes(60);
    TEST_ASSERT_EQUAL_HEX8(0x55, sent[4]);
    TEST_ASSERT_EQUAL_HEX8(46, sent[5]);
    TEST_ASSERT_TRUE(sent_count > 4u + 46u);
    n = sent_count;
    status_tick(500);
    status_tick(500);
    passes(60);
    TEST_ASSERT_EQUAL_UINT16(n, sent_count);
}

void test_text_waits_for_a_frame_that_may_be_valid_and_goes_on_when_it_is_not(void)
{
    static const uint8_t begun[] = { 0x55, 40, 1 };
    status_tick(500);
    passes(4);
    receive(begun, sizeof begun);
    passes(30);
    TEST_ASSERT_EQUAL_STRING("stat", sent);
    status_tick(LNET_QUIET_MS);
    passes(60);
    TEST_ASSERT_EQUAL_STRING("state 0 fault NONE speed 0 rpm\r\n", sent);
}

void test_an_answer_waits_for_a_transmitter_that_is_full(void)
{
    U1STAbits.UTXBF = 1;
    receive(device_info_request, sizeof device_info_request);
    passes(30);
    TEST_ASSERT_EQUAL_UINT16(0, sent_count);
    U1STAbits.UTXBF = 0;
    passes(2);
    TEST_ASSERT_EQUAL_HEX8(0x55, sent[0]);
    TEST_ASSERT_EQUAL_HEX8(46, sent[1]);
}
