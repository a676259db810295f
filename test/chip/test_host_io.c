/* Pins, timers and the serial port as the host's firmware and the user of the board see them; what the chip makes of the registers:
 * test/cpu_33f/test_peripherals.py. */
#include "fake_firmware.inc"

void setUp(void); /* both in fake_firmware.inc */
void tearDown(void);

void test_buttons_pull_their_pins_low(void)
{
    start(1);
    TEST_ASSERT_EQUAL_UINT(1, PORTAbits.RA8);
    TEST_ASSERT_EQUAL_UINT(1, PORTBbits.RB4);
    set("input.s2", 1.0);
    run(1);
    TEST_ASSERT_EQUAL_UINT(0, PORTAbits.RA8);
    set("input.s3", 1.0);
    run(1);
    TEST_ASSERT_EQUAL_UINT(0, PORTBbits.RB4);
    set("input.s2", 0.0);
    run(1);
    TEST_ASSERT_EQUAL_UINT(1, PORTAbits.RA8);
}

static void write_port(void)
{
    TRISCbits.TRISC6 = 0;
    PORTCbits.RC6 = 0;
    PORTCbits.RC6 = 1;
    PORTCbits.RC7 = 0;
}

void test_writing_a_port_reaches_the_latch_and_is_named(void)
{
    start(1);
    fake_background_hook = write_port;
    run(8);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, get("pin.RC6"));
    TEST_ASSERT_TRUE(warned_about("PORTC"));
}

void test_timer_1_interrupts_every_millisecond(void)
{
    at_init("PR1", 4999); /* 40 MHz / 8 / 5000 */
    at_init("T1CON", 0x8010);
    at_init("IEC0", 0x2008);
    start(20000);
    TEST_ASSERT_UINT_WITHIN(1, 1000, fake_timer_calls);
    TEST_ASSERT_TRUE(TMR1 <= PR1);
}

void test_a_polled_timer_sets_its_flag(void)
{
    at_init("PR1", 4999);
    at_init("T1CON", 0x8010);
    start(19);
    TEST_ASSERT_EQUAL_UINT(0, IFS0bits.T1IF);
    run(2);
    TEST_ASSERT_EQUAL_UINT(1, IFS0bits.T1IF);
    TEST_ASSERT_EQUAL_UINT(0, fake_timer_calls);
}

static const char *text;

static void send_text(void)
{
    if (*text != '\0' && !U1STAbits.UTXBF) {
        U1TXREG = (uint16_t)(uint8_t)*text++;
    }
}

static void uart_on(void)
{
    at_init("RPOR9", 0x0300);
    at_init("RPINR18", 0x1F14);
    at_init("U1BRG", 86); /* 114943 baud */
    at_init("U1MODE", 0x8008);
    at_init("U1STA", 0x0510);
}

void test_sent_characters_arrive_in_order_at_the_baud_rate(void)
{
    char out[64] = { 0 };
    text = "state run\r\n";
    uart_on();
    fake_background_hook = send_text;
    start(400);
    TEST_ASSERT_EQUAL_UINT(11, vb_uart_read(board, out, sizeof out));
    TEST_ASSERT_EQUAL_STRING("state run\r\n", out);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 40e6 / 4.0 / 87.0, get("uart.baud"));
    TEST_ASSERT_EQUAL_UINT(1, U1STAbits.TRMT);
    TEST_ASSERT_EQUAL_UINT(0, vb_uart_read(board, out, sizeof out));
}

void _U1TXInterrupt(void)
{
    IFS0bits.U1TXIF = 0;
    send_text();
}

void test_the_transmit_interrupt_starts_with_the_transmitter_and_goes_on_with_each_character(void)
{
    char out[16] = { 0 };
    text = "interrupt";
    uart_on();
    at_init("IEC0", 0x3000); /* with U1TXIE */
    start(200);
    TEST_ASSERT_EQUAL_UINT(9, vb_uart_read(board, out, sizeof out));
    TEST_ASSERT_EQUAL_STRING("interrupt", out);
}

static char received[16];
static unsigned received_count;

static void poll_receiver(void)
{
    if (U1STAbits.URXDA && received_count < sizeof received) {
        received[received_count++] = (char)U1RXREG;
    }
}

void test_received_characters_are_seen_once_each(void)
{
    memset(received, 0, sizeof received);
    received_count = 0;
    uart_on();
    fake_background_hook = poll_receiver;
    power_up();
    TEST_ASSERT_EQUAL_UINT(5, vb_uart_write(board, "hello", 5));
    run(400);
    TEST_ASSERT_EQUAL_UINT(5, received_count);
    TEST_ASSERT_EQUAL_STRING("hello", received);
}

void test_received_characters_interrupt(void)
{
    uart_on();
    at_init("IEC0", 0x2800); /* with U1RXIE */
    power_up();
    TEST_ASSERT_EQUAL_UINT(3, vb_uart_write(board, "abc", 3));
    run(400);
    TEST_ASSERT_EQUAL_UINT(3, fake_rx_calls);
}

static uint16_t captured[64], captures;

static void keep_captures(void)
{
    if (IC1CONbits.ICBNE && captures < 64) {
        captured[captures++] = IC1BUF;
    }
}

static void capture_pulses(void)
{
    captures = 0;
    at_init("RPINR7", 7);
    at_init("T3CON", 0x8010);
    at_init("IC1CON", 3);
    set("input.pulse_hz", 1000.0);
    set("input.pulse_us", 300.0);
}

void test_the_main_loop_reads_one_capture_a_pass(void)
{
    capture_pulses();
    fake_background_hook = keep_captures;
    start(400);
    TEST_ASSERT_UINT_WITHIN(1, 19, captures);
    for (unsigned n = 1; n < captures; n++) {
        TEST_ASSERT_UINT_WITHIN(1, 5000, (uint16_t)(captured[n] - captured[n - 1]));
    }
    TEST_ASSERT_FALSE(warned_about("RPINR7"));
}

static uint16_t restarted_at;

static void restart_capture(void)
{
    restarted_at = TMR3;
    IC1CON = 0;
    IC1CON = 3;
}

void test_a_capture_that_is_switched_off_and_on_begins_anew(void)
{
    capture_pulses();
    set("input.pulse_hz", 10000.0);
    set("input.pulse_us", 30.0);
    start(60);
    TEST_ASSERT_EQUAL_HEX16(0x001B, IC1CON); /* two come in a pass, and one is read */
    fake_background_hook = restart_capture;
    run(4);
    TEST_ASSERT_EQUAL_HEX16(0x0003, IC1CON & 0x0017); /* one may have come in the pass's period */
    fake_background_hook = keep_captures;
    run(20);
    TEST_ASSERT_GREATER_THAN_UINT(0, captures);
    for (unsigned n = 0; n < captures; n++) {
        TEST_ASSERT_LESS_THAN_UINT16(7500, captured[n] - restarted_at + 250); /* 250: that period */
    }
}

static void set_timer(void)
{
    keep_captures();
    TMR3 = 1000;
}

void test_a_count_that_is_written_holds_for_the_edges_of_that_period_too(void)
{
    capture_pulses();
    set("input.pulse_hz", 9700.0);
    set("input.pulse_us", 30.0);
    fake_background_hook = set_timer;
    start(200);
    TEST_ASSERT_GREATER_THAN_UINT(45, captures);
    for (unsigned n = 4; n < captures; n++) {
        TEST_ASSERT_UINT_WITHIN(525, 1525, captured[n]); /* a count from 1000 on, to the next pass or the one behind it */
    }
}
