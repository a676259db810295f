/* UART1: 115200 8N1, and a full transmitter is left alone. */
#include "registers.h"

#define U1MODE (*registers_watch(&U1MODE)) /* the last access switches the module on */
#include "firmware/board/peripherals.c"
#undef U1MODE

void setUp(void)
{
    host_registers_reset();
    uart_init();
}

void test_115200_8N1(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x0008, register_then("U1MODE"));
    TEST_ASSERT_EQUAL_UINT16(86, register_then("U1BRG"));
    TEST_ASSERT_UINT32_WITHIN(1152, 115200ul, 40000000ul / (4ul * (U1BRG + 1ul)));
}

void test_eight_bits_are_sent_when_there_is_room_and_a_full_transmitter_is_not_written(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, uart_send((char)0xE9));
    TEST_ASSERT_EQUAL_HEX16(0x00E9, U1TXREG);
    U1STAbits.UTXBF = 1;
    TEST_ASSERT_EQUAL_UINT16(0, uart_has_room());
    TEST_ASSERT_EQUAL_UINT16(0, uart_send('x'));
    TEST_ASSERT_EQUAL_HEX16(0x00E9, U1TXREG);
}

void test_a_character_is_received_when_there_is_one(void)
{
    U1RXREG = 0x1E9;
    TEST_ASSERT_EQUAL_INT16(-1, uart_receive());
    U1STAbits.URXDA = 1;
    TEST_ASSERT_EQUAL_INT16(0xE9, uart_receive());
}

void test_a_receiver_that_stands_still_goes_on(void)
{
    U1STAbits.OERR = 1;
    (void)uart_receive();
    TEST_ASSERT_EQUAL_UINT16(0, U1STAbits.OERR);
}
