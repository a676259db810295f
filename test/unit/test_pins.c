/* Pins: the lock of the pin selection, and the buttons. */
#include "registers.h"

/* Each write of the lock bit, and what the pin selection held then: only between unlock and lock does the chip take a write. */
static uint16_t lock_writes, written[2], fault_pin_then[2];

static void write_lock(uint16_t value)
{
    if (lock_writes < 2u) {
        written[lock_writes] = value & 0x00FFu;
        fault_pin_then[lock_writes] = RPINR12;
    }
    lock_writes++;
    host_write_oscconl(value);
}

#undef __builtin_write_OSCCONL
#define __builtin_write_OSCCONL(value) write_lock((uint16_t)(value))
#include "firmware/board/peripherals.c"

void setUp(void)
{
    host_registers_reset();
    OSCCON = 0x3363; /* locked pin selection, running on crystal and PLL, a switch under way */
    lock_writes = 0;
    pins_init();
}

void test_pin_selection_is_unlocked_written_and_locked_again(void)
{
    TEST_ASSERT_EQUAL_UINT16(2, lock_writes);
    TEST_ASSERT_EQUAL_HEX16(0x0023, written[0]); /* the lock alone changes */
    TEST_ASSERT_EQUAL_HEX16(0x001F, fault_pin_then[0]); /* as after reset */
    TEST_ASSERT_EQUAL_HEX16(0x0062, written[1]);
    TEST_ASSERT_EQUAL_HEX16(0x0008, fault_pin_then[1]);
    TEST_ASSERT_EQUAL_UINT16(1, OSCCONbits.IOLOCK);
}

void test_buttons_are_active_low_on_RA8_and_RB4(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, BOARD_S2_DOWN());
    TEST_ASSERT_EQUAL_UINT16(0, BOARD_S3_DOWN());
    PORTAbits.RA8 = 0;
    TEST_ASSERT_NOT_EQUAL(0, BOARD_S2_DOWN());
    TEST_ASSERT_EQUAL_UINT16(0, BOARD_S3_DOWN());
    PORTAbits.RA8 = 1;
    PORTBbits.RB4 = 0;
    TEST_ASSERT_EQUAL_UINT16(0, BOARD_S2_DOWN());
    TEST_ASSERT_NOT_EQUAL(0, BOARD_S3_DOWN());
}
