/* UART1: 115200 8N1, and a full transmitter is left alone. */
#include "hurst_params.h"

#include "firmware/board/uart.c"

#include "unity.h"

void setUp(void)
{
    host_registers_reset();
    uart_init();
}

void tearDown(void)
{
}

void test_115200_8N1(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x8008, U1MODE); /* on, high-speed divider, 8 bits, no parity, one stop bit */
    TEST_ASSERT_EQUAL_UINT16(86, U1BRG);
    TEST_ASSERT_UINT32_WITHIN(1152, 115200ul, 40000000ul / (4ul * (U1BRG + 1ul)));
    TEST_ASSERT_EQUAL_UINT16(1, U1STAbits.UTXEN);
}

void test_a_character_is_written_when_there_is_room(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, uart_send('x'));
    TEST_ASSERT_EQUAL_HEX16('x', U1TXREG);
}

void test_a_full_transmitter_is_not_written(void)
{
    U1STAbits.UTXBF = 1;
    U1TXREG = 0x1234;
    TEST_ASSERT_EQUAL_UINT16(0, uart_send('x'));
    TEST_ASSERT_EQUAL_HEX16(0x1234, U1TXREG);
}

void test_only_eight_bits_are_sent(void)
{
    (void)uart_send((char)0xE9);
    TEST_ASSERT_EQUAL_HEX16(0x00E9, U1TXREG);
}
