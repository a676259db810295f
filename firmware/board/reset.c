/* Why the processor started, what is kept over a reset, and the watchdog. */
#include "board/reset.h"

#include "board/mclv.h"
#include "board/selftest_run.h"

volatile uint16_t board_reset_cause BOARD_UNSET;
volatile uint16_t board_trap_intcon1 BOARD_PERSISTENT;

static volatile uint16_t kept_fault BOARD_PERSISTENT;
static volatile uint16_t kept_inverse BOARD_PERSISTENT; /* tells a kept fault from what RAM holds after power-up */

static uint16_t served_tick BOARD_UNSET;

void reset_keep(uint16_t fault)
{
    kept_fault = fault;
    kept_inverse = (uint16_t)~fault;
}

drive_fault_t reset_take(void)
{
    uint16_t cause = selftest_reset_cause(RCON), fault;
    RCON = 0;
    board_reset_cause = cause;
    served_tick = 0;
    if (RESET_LOST_RAM(cause)) {
        board_trap_intcon1 = 0;
        return FAULT_NONE; /* what is kept holds anything now: it is not even read */
    }
    if ((cause & (RESET_FLAG(TRAPR) | RESET_FLAG(IOPUWR) | RESET_FLAG(WDTO))) == 0u) {
        return FAULT_NONE;
    }
    fault = kept_fault;
    if (fault != (uint16_t)FAULT_NONE && fault < (uint16_t)FAULT_COUNT && (kept_inverse ^ fault) == 0xFFFFu) {
        return (drive_fault_t)fault;
    }
    return RESET_WAS(WDTO, cause) ? FAULT_WATCHDOG : FAULT_TRAP;
}

void reset_serve_watchdog(uint16_t ticks)
{
    if (ticks != served_tick) {
        served_tick = ticks;
        ClrWdt();
    }
}
