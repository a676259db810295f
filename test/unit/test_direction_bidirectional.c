/* The direction input in BIDIRECTIONAL_SPEED: it turns the potentiometer's sides round, and the middle keeps the direction of the run. */
/* defines: -DBIDIRECTIONAL_SPEED */
#include "hurst_params.h"

#undef DIRECTION_INPUT_USED
#define DIRECTION_INPUT_USED 1

#include "firmware/board/application.c"
#include "firmware/board/firmware.c"
#include "firmware/board/isr.c"
#include "firmware/board/peripherals.c"
#include "firmware/drive/modes/modes.c"

#include "unity.h"

static app_told_t seen;

void app_init(void)
{
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    seen = *told;
    asks->run = 0;
}

void setUp(void)
{
    host_registers_reset();
    PORTA = 0xFFFFu;
    drive_init(&board_drive, &board_params);
    application_init();
}

/** Which way the potentiometer points after so long that it has settled. */
static int16_t towards(uint16_t contact_closed, int16_t pot_q15, int16_t direction)
{
    PORTAbits.RA4 = (uint16_t)!contact_closed;
    board_pot.now_q15 = pot_q15;
    board_drive.direction = direction;
    for (uint16_t ms = 0; ms < 200u; ms++) {
        application_tick(1);
    }
    return seen.towards;
}

void test_a_side_is_the_other_direction_while_the_contact_is_closed(void)
{
    TEST_ASSERT_EQUAL_INT16(1, towards(0, 20000, 1));
    TEST_ASSERT_EQUAL_INT16(-1, towards(0, -20000, 1));
    TEST_ASSERT_EQUAL_INT16(-1, towards(1, 20000, 1));
    TEST_ASSERT_EQUAL_INT16(1, towards(1, -20000, 1));
    TEST_ASSERT_EQUAL_HEX16(APP_DIRECTION, seen.inputs);
}

void test_the_middle_keeps_the_direction_of_the_run_whatever_the_contact_is(void)
{
    for (uint16_t closed = 0; closed < 2u; closed++) {
        TEST_ASSERT_EQUAL_INT16(1, towards(closed, 0, 1));
        TEST_ASSERT_EQUAL_INT16(-1, towards(closed, 0, -1));
    }
}
