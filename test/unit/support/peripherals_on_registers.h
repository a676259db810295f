/* Mocked peripherals whose smallest parts act on the host's registers, as the real ones do. */
#ifndef TEST_UNIT_SUPPORT_PERIPHERALS_ON_REGISTERS_H
#define TEST_UNIT_SUPPORT_PERIPHERALS_ON_REGISTERS_H

#include <xc.h>

#include "board/mclv.h"

#include "mock_peripherals.h"

static inline void outputs_off_in_register(int calls)
{
    (void)calls;
    P1OVDCON = BOARD_OUTPUTS_OFF;
}

static inline uint16_t ms_passed_in_register(int calls)
{
    uint16_t passed = IFS0bits.T1IF;
    (void)calls;
    IFS0bits.T1IF = 0;
    return passed;
}

static inline uint16_t room_in_register(int calls)
{
    (void)calls;
    return (uint16_t)!U1STAbits.UTXBF;
}

static inline uint16_t send_to_register(char c, int calls)
{
    uint16_t room = room_in_register(calls);
    if (room) {
        U1TXREG = (uint16_t)(uint8_t)c;
    }
    return room;
}

/** In setUp(). */
static inline void peripherals_on_registers(void)
{
    pwm_outputs_off_Stub(outputs_off_in_register);
    timer_ms_passed_Stub(ms_passed_in_register);
    uart_has_room_Stub(room_in_register);
    uart_send_Stub(send_to_register);
}

#endif
