/* The cause of a reset, the fault that is kept over it, and who may serve the watchdog. */
#include "firmware/board/reset.c"

#include "unity.h"

#define POWER_UP 0x0003u
#define WATCHDOG 0x0010u
#define OPCODE 0x4000u
#define TRAP_CONFLICT 0x8000u
#define PIN 0x0080u
#define SOFTWARE 0x0040u

void setUp(void)
{
    host_registers_reset();
    kept_fault = 0x5A5Au; /* what RAM may hold */
    kept_inverse = 0x1234u;
    board_trap_intcon1 = 0x0008u;
}

static drive_fault_t start(uint16_t rcon)
{
    RCON = rcon;
    return reset_take();
}

void test_cause_of_the_reset_decides_about_the_kept_fault_and_the_trap(void)
{
    static const struct {
        const char *what;
        uint16_t kept, rcon, fault, trap;
    } cases[] = {
        { "power-up: no fault, no old trap", FAULT_STALL, POWER_UP, FAULT_NONE, 0 },
        { "power-up without the brown-out's flag", FAULT_STALL, 0x0001u, FAULT_NONE, 0 },
        { "brown-out", FAULT_STALL, 0x0002u, FAULT_NONE, 0 },
        { "a watchdog flag beside power-up means nothing", FAULT_STALL, 0x0013u, FAULT_NONE, 0 },
        { "nor beside its own flag", FAULT_STALL, 0x0011u, FAULT_NONE, 0 },
        { "nor beside brown-out", FAULT_STALL, 0x0012u, FAULT_NONE, 0 },
        { "the pin forgets the fault but not the trap", FAULT_TRAP, PIN, FAULT_NONE, 0x0008u },
        { "so does software", FAULT_TRAP, SOFTWARE, FAULT_NONE, 0x0008u },
        { "a trap that ends in a watchdog reset is still a trap", FAULT_TRAP, WATCHDOG, FAULT_TRAP, 0x0008u },
        { "watchdog out of a healthy run", FAULT_NONE, WATCHDOG, FAULT_WATCHDOG, 0x0008u },
        { "a code that does not exist", FAULT_COUNT, WATCHDOG, FAULT_WATCHDOG, 0x0008u },
        { "illegal opcode", FAULT_NONE, OPCODE, FAULT_TRAP, 0x0008u },
        { "trap conflict", FAULT_NONE, TRAP_CONFLICT, FAULT_TRAP, 0x0008u },
        { "illegal opcode after a fault", FAULT_OVERCURRENT_HW, OPCODE, FAULT_OVERCURRENT_HW, 0x0008u },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        setUp();
        reset_keep(cases[n].kept);
        TEST_ASSERT_EQUAL_INT_MESSAGE(cases[n].fault, start(cases[n].rcon), cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(cases[n].trap, board_trap_intcon1, cases[n].what);
        TEST_ASSERT_EQUAL_HEX16_MESSAGE((cases[n].rcon & POWER_UP) ? cases[n].rcon & ~WATCHDOG : cases[n].rcon, board_reset_cause,
                                        cases[n].what); /* both together are the watchdog's test */
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(0, RCON, cases[n].what); /* cleared for the next reset */
    }
}

void test_each_kept_fault_comes_back_after_a_watchdog_reset(void)
{
    uint16_t fault;
    for (fault = (uint16_t)FAULT_NONE + 1u; fault < (uint16_t)FAULT_COUNT; fault++) {
        reset_keep(fault);
        TEST_ASSERT_EQUAL_INT(fault, start(WATCHDOG));
    }
}

void test_what_ram_happens_to_hold_is_no_kept_fault(void)
{
    TEST_ASSERT_EQUAL_INT(FAULT_WATCHDOG, start(WATCHDOG));
    kept_fault = FAULT_STALL; /* a plausible code, the check word is not */
    TEST_ASSERT_EQUAL_INT(FAULT_WATCHDOG, start(WATCHDOG));
    kept_inverse = 0xFFFFu;
    TEST_ASSERT_EQUAL_INT(FAULT_WATCHDOG, start(WATCHDOG));
}

void test_watchdog_is_served_once_for_each_new_period_and_never_without_one(void)
{
    served_tick = 77;
    (void)start(POWER_UP);
    reset_serve_watchdog(0); /* no interrupt has come yet */
    TEST_ASSERT_EQUAL_UINT16(0, host_watchdog_serves);
    reset_serve_watchdog(1);
    TEST_ASSERT_EQUAL_UINT16(1, host_watchdog_serves);
    reset_serve_watchdog(1);
    reset_serve_watchdog(1);
    TEST_ASSERT_EQUAL_UINT16(1, host_watchdog_serves);
    reset_serve_watchdog(0); /* the tick counter wraps */
    TEST_ASSERT_EQUAL_UINT16(2, host_watchdog_serves);
}
