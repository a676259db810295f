/* The board's self-tests on the host's registers: a healthy board passes them all, and each planted defect is found and named. */
#include "hurst_params.h"

#include <stdint.h>

/* One bit of the drive's RAM that may be stuck, behind the march's own accesses. */
static volatile uint16_t *stuck_word;
static uint16_t stuck_bits;
#define SELFTEST_READ(cell) (*(cell))
#define SELFTEST_WRITE(cell, value) (*(cell) = (uint16_t)(((cell) == stuck_word) ? (value) | stuck_bits : (value)))

#include "board/firmware.h"
#include "board/selftest_cpu.h"

/* Where the RAM ends. */
static volatile uint16_t *const whole_ram_end = BOARD_RAM_END;
static volatile uint16_t *ram_end = BOARD_RAM_END;
#undef BOARD_RAM_END
#define BOARD_RAM_END ram_end

#include "firmware/board/peripherals.c"
#include "firmware/app/panel.c"
#include "firmware/board/application.c"
#include "firmware/board/firmware.c"
#include "firmware/board/isr.c"
#include "firmware/board/reset.c"
#include "firmware/board/selftest_run.c"
#include "firmware/board/status.c"
#include "firmware/drive/selftest.c"

#include <string.h>

#include "interrupts.h"
#include "press_s2.h"
#include "transmitter.h"
#include "unity.h"

static uint16_t ground_reads_raw;


static void power_up(void)
{
    host_registers_reset();
    ADC1BUF3 = (uint16_t)(int16_t)(24.0F / 52.8F * 65536.0F - 32768.0F);
    firmware_init();
}

void setUp(void)
{
    stuck_word = 0;
    host_watchdog_counts = 10000;
    ground_reads_raw = 0x8000u;
    memset(host_w_stuck_at_1, 0, sizeof host_w_stuck_at_1);
    memset(host_w_stuck_at_0, 0, sizeof host_w_stuck_at_0);
    transmitter_begins();
    owed_ms = 0; /* as after every start of the chip */
    power_up();
}

/** Milliseconds: 20 control interrupts, timer 1's flag, some passes of the loop. */
static void board_ms(uint16_t count)
{
    while (count-- != 0u) {
        uint16_t n;
        for (n = 0; n < 20u; n++) {
            ADC1BUF0 = (AD1CHS0 == 8u) ? 0x0000u : ground_reads_raw;
            a_period();
        }
        IFS0bits.T1IF = 1;
        for (n = 0; n < 5u; n++) {
            firmware_background();
            transmitter_takes();
        }
    }
}

/** A pass of the loop after so many control interrupts, in each of which the converter has sampled its input. */
static void pass_after(uint16_t periods)
{
    while (periods-- != 0u) {
        ADC1BUF0 = (AD1CHS0 == 8u) ? 0x0000u : ground_reads_raw;
        a_period();
    }
    IFS0bits.T1IF = 1;
    firmware_background();
    transmitter_takes();
}

/** In this many milliseconds the defect is found, as this test's, and the outputs are off. */
static void finds_it(selftest_t test, uint16_t most_ms, const char *what)
{
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(SELFTEST_NONE, board_selftest_failed, what);
    while (board_selftest_failed == 0u && most_ms-- != 0u) {
        board_ms(1);
    }
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(test, board_selftest_failed, what);
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(BOARD_OUTPUTS_OFF, P1OVDCON, what);
}

/** The same, and the drive tells of it. */
static void finds(selftest_t test, uint16_t most_ms, const char *what)
{
    finds_it(test, most_ms, what);
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(FAULT_SELFTEST, board_drive.fault, what);
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(DRIVE_FAULT, board_drive.state, what);
}

static void run_motor(void)
{
    board_ms(100);
    press_s2();
    TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_PWM, P1OVDCON);
}

/* ---- a healthy board ---- */

void test_a_healthy_board_passes_for_seconds_and_keeps_its_variables(void)
{
    board_ms(3000);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, board_drive.state);
    press_s2();
    board_ms(800); /* ALIGN: no motor is there */
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_PWM, P1OVDCON);
}

/* ---- registers ---- */

void test_each_bit_of_each_register_in_the_table_is_read_back(void)
{
    for (size_t n = 0; n < sizeof written / sizeof written[0]; n++) {
        for (uint16_t bit = 0; bit < 16u; bit++) {
            if ((written[n].mask >> bit) & 1u) {
                char what[40];
                power_up();
                board_ms(60);
                sprintf(what, "row %u, bit %u", (unsigned)n, (unsigned)bit);
                *written[n].place ^= (uint16_t)(1u << bit);
                finds(SELFTEST_REGISTERS, 11, what);
            }
        }
    }
}

void test_outputs_that_the_state_does_not_ask_for_are_found(void)
{
    uint16_t bit;
    for (bit = 0; bit < 16u; bit++) {
        power_up();
        board_ms(60);
        P1OVDCON ^= (uint16_t)(1u << bit);
        owed_ms = 1; /* its turn comes before the interrupt writes it anew */
        firmware_background();
        TEST_ASSERT_EQUAL_UINT16(SELFTEST_REGISTERS, board_selftest_failed);
        TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_OFF, P1OVDCON);
    }
    power_up();
    run_motor();
    P1OVDCON = BOARD_OUTPUTS_BOOTSTRAP;
    owed_ms = 1;
    firmware_background();
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_REGISTERS, board_selftest_failed);
}

void test_outputs_that_are_on_with_a_fault_are_wrong_in_every_state(void)
{
    static const uint16_t states[] = { DRIVE_BOOTSTRAP, DRIVE_ALIGN, DRIVE_CLOSED, DRIVE_FAULT };
    size_t n;
    for (n = 0; n < sizeof states / sizeof states[0]; n++) {
        power_up();
        board_drive.state = states[n];
        P1OVDCON = (states[n] == DRIVE_BOOTSTRAP) ? BOARD_OUTPUTS_BOOTSTRAP : BOARD_OUTPUTS_PWM;
        test_outputs();
        TEST_ASSERT_EQUAL_UINT16((states[n] == DRIVE_FAULT) ? SELFTEST_REGISTERS : SELFTEST_NONE, board_selftest_failed);
        board_drive.fault = FAULT_STALL;
        test_outputs();
        TEST_ASSERT_EQUAL_UINT16(SELFTEST_REGISTERS, board_selftest_failed);
    }
}

void test_a_slice_that_has_a_word_of_the_keep_is_seen(void)
{
    static volatile uint16_t ram[4u * SLICE_WORDS];
    const volatile uint16_t *keep = &ram[2u * SLICE_WORDS];
    uint16_t n;
    for (n = 0; n < 3u * SLICE_WORDS; n++) {
        TEST_ASSERT_EQUAL_UINT16(n >= SLICE_WORDS, slices_touch(&ram[n], keep));
    }
    TEST_ASSERT_EQUAL_UINT16(0, slices_touch(&ram[3u * SLICE_WORDS], keep));
}

void test_low_sides_may_stay_on_until_the_bridge_s_first_duties(void)
{
    board_ms(100);
    PORTAbits.RA8 = 0;
    for (uint16_t n = 0; n < 2000u && board_drive.state != (uint16_t)DRIVE_ALIGN; n++) {
        if (n % 20u == 0u) {
            IFS0bits.T1IF = 1;
            firmware_background();
        }
        a_period();
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, board_drive.state);
    TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_BOOTSTRAP, P1OVDCON);
    owed_ms = 1;
    firmware_background();
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, board_drive.state);
}

/* ---- processor, RAM, flash, stack ---- */

void test_each_bit_of_each_processor_register_is_tested(void)
{
    for (uint16_t n = 0; n < HOST_W_REGISTERS * 32u; n++) {
        uint16_t *where = (n & 1u) ? host_w_stuck_at_1 : host_w_stuck_at_0;
        setUp();
        where[n >> 5] = (uint16_t)(1u << ((n >> 1) & 15u));
        finds(SELFTEST_CPU, sizeof board_drive / 6u + 3u, "stuck");
    }
}

void test_each_stuck_bit_of_the_drives_ram_is_found_while_running_and_at_a_start(void)
{
    for (uint16_t n = 0; n < sizeof board_drive / 2u; n++) {
        setUp();
        board_ms(60);
        stuck_word = BOARD_RAM + n;
        stuck_bits = (uint16_t)(1u << (n % 16u));
        finds_it(SELFTEST_RAM, sizeof board_drive / 6u + 3u, "running"); /* the word may be that of the fault itself */
        RCON = 0x0003u;
        firmware_init();
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(SELFTEST_RAM, board_selftest_failed, "at a start");
    }
}

void test_the_last_words_are_tested_whatever_the_slices_before_leave_of_them(void)
{
    for (uint16_t less = 0; less < SLICE_WORDS; less++) {
        setUp();
        ram_end = whole_ram_end - less;
        stuck_word = ram_end - 1;
        stuck_bits = 0x0400u;
        finds_it(SELFTEST_RAM, sizeof board_drive / 6u + 3u, "its last word");
    }
    ram_end = whole_ram_end;
}

void test_interrupts_are_on_again_after_the_tests_that_need_silence(void)
{
    board_ms(1);
    owed_ms = 1;
    firmware_background();
    TEST_ASSERT_EQUAL_UINT16(0, owed_ms);
    TEST_ASSERT_EQUAL_UINT16(0, SRbits.IPL);
}

void test_each_bit_of_flash_counts_and_so_does_its_crc(void)
{
    static const uint32_t places[] = { 0, 1, 0x100, 0x1FFF, HOST_FLASH_WORDS - 3, HOST_FLASH_WORDS - 2, HOST_FLASH_WORDS - 1 };
    for (size_t n = 0; n < sizeof places / sizeof places[0]; n++) {
        for (unsigned bit = 0; bit < ((places[n] < HOST_FLASH_WORDS - 2) ? 24u : 16u); bit++) {
            power_up();
            host_flash[places[n]] ^= (uint32_t)1 << bit;
            finds(SELFTEST_FLASH, HOST_FLASH_WORDS / 32u + 2u, "running");
            RCON = 0x0003u;
            firmware_init();
            host_flash[places[n]] ^= (uint32_t)1 << bit;
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(SELFTEST_FLASH, board_selftest_failed, "at a start");
        }
    }
}

void test_an_image_without_crc_says_so_and_runs(void)
{
    uint32_t crc = host_flash[HOST_FLASH_WORDS - 2], inverse = host_flash[HOST_FLASH_WORDS - 1];
    host_flash[HOST_FLASH_WORDS - 2] = 0xFFFFu;
    host_flash[HOST_FLASH_WORDS - 1] = 0xFFFFu;
    power_up();
    board_ms(400);
    host_flash[HOST_FLASH_WORDS - 2] = crc;
    host_flash[HOST_FLASH_WORDS - 1] = inverse;
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_NOT_NULL(strstr(sent, "reset BOR POR flash without CRC\r\n"));
}

void test_guard_and_limit_of_the_stack_are_watched(void)
{
    for (uint16_t n = 0; n < 48u; n++) {
        volatile uint16_t *const words[] = { &STACK_GUARD[0], &STACK_GUARD[1], &SPLIM };
        setUp();
        *words[n >> 4] ^= (uint16_t)(1u << (n & 15u));
        finds(SELFTEST_STACK, 1, "one bit");
    }
}

/* ---- variables, program flow ---- */

void test_a_changed_bit_of_the_state_stops_within_a_millisecond(void)
{
    for (uint16_t bit = 0; bit < 16u; bit++) {
        setUp();
        board_ms(60);
        board_drive.direction ^= (int16_t)(1u << bit);
        finds(SELFTEST_VARIABLES, 2, "direction");
    }
}

void test_a_changed_bit_of_the_wish_to_run_stops_within_a_millisecond(void)
{
    for (uint16_t bit = 0; bit < 16u; bit++) {
        setUp();
        board_ms(60);
        board_request.wish_run ^= (int16_t)(1u << bit);
        finds(SELFTEST_VARIABLES, 2, "wish to run");
    }
}

void test_slow_work_that_stays_away_is_found(void)
{
    board_ms(60);
    board_drive.ticks = (uint16_t)(board_drive.ticks + 3u); /* three periods without it */
    owed_ms = 1;
    firmware_background();
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_FLOW, board_selftest_failed);
}

void test_a_part_of_the_background_that_is_missing_or_comes_twice_is_found(void)
{
    static const uint16_t orders[][5] = { { 1, 2, 3, 4, 0 }, { 1, 3, 4, 0, 0 }, { 1, 2, 4, 0, 0 }, { 1, 2, 3, 0, 0 }, { 2, 3, 4, 0, 0 },
                                          { 1, 3, 2, 4, 0 }, { 1, 2, 2, 3, 4 }, { 1, 2, 3, 4, 4 } };
    for (size_t n = 0; n < sizeof orders / sizeof orders[0]; n++) {
        setUp();
        board_selftest_parts = 0;
        for (uint16_t k = 0; k < 5u && orders[n][k] != 0u; k++) {
            selftest_part(orders[n][k]);
        }
        selftest_ms();
        TEST_ASSERT_EQUAL_UINT16(n == 0u ? SELFTEST_NONE : SELFTEST_FLOW, board_selftest_failed);
    }
}

void test_tests_that_do_not_get_their_turn_are_a_failure(void)
{
    uint16_t n;
    for (n = 0; n <= OWED_MS; n++) { /* never silent between two interrupts */
        TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
        board_selftest_parts = PARTS_IN_ORDER;
        selftest_ms();
    }
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_FLOW, board_selftest_failed);
    setUp();
    for (n = 0; n < 2000u; n++) { /* interrupts and passes, but no millisecond's work */
        board_drive.ticks++;
        selftest_pass();
    }
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_FLOW, board_selftest_failed);
}

/* ---- converter ---- */

void test_a_converter_that_does_not_read_ground_is_found_in_STOPPED_only(void)
{
    static const uint16_t wrong[] = { 0x8000u + 17u * 64u, 0xC000u, 0x0000u, 0x7FC0u };
    for (size_t n = 0; n < sizeof wrong / sizeof wrong[0]; n++) {
        setUp();
        ground_reads_raw = wrong[n];
        finds(SELFTEST_ADC, 2u * ADC_EVERY_MS + 100u, "ground");
    }
    setUp();
    ground_reads_raw = 0x8000u + 16u * 64u;
    board_ms(1200);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    setUp();
    run_motor();
    ground_reads_raw = 0;
    board_ms(1200); /* the potentiometer is needed */
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_EQUAL_HEX16(BOARD_AD1CHS0, AD1CHS0);
}

void test_the_converter_is_looked_at_neither_in_a_stop_nor_once_a_start_is_asked_for(void)
{
    static const struct {
        uint16_t state, input;
        int16_t run;
    } cases[] = { { DRIVE_STOPPING, BOARD_AD1CHS0, 0 }, { DRIVE_STOPPED, BOARD_AD1CHS0, 1 }, { DRIVE_STOPPED, BOARD_AN_OFF, 0 } };
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        board_drive.state = cases[n].state;
        board_drive.command.run = cases[n].run;
        start_adc();
        TEST_ASSERT_EQUAL_HEX16(cases[n].input, AD1CHS0);
    }
}

void test_a_pass_that_is_late_and_the_next_at_once_accuse_no_register(void)
{
    for (uint16_t parity = 0; parity < 2u; parity++) {
        setUp();
        pass_after((uint16_t)(20u * (parity + 1u)));
        for (uint32_t n = 0; n < 40ul * ADC_EVERY_MS; n++) {
            pass_after((n & 1u) ? 1u : 39u);
        }
        TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
    }
}

void test_the_converter_s_test_ends_with_the_third_period_and_not_before(void)
{
    uint16_t n = 0;
    do {
        pass_after(20);
    } while (AD1CHS0 != BOARD_AN_OFF && ++n <= 2u * ADC_EVERY_MS);
    TEST_ASSERT_EQUAL_HEX16(BOARD_AN_OFF, AD1CHS0);
    pass_after(2);
    TEST_ASSERT_EQUAL_HEX16(BOARD_AN_OFF, AD1CHS0);
    pass_after(1);
    TEST_ASSERT_EQUAL_HEX16(BOARD_AD1CHS0, AD1CHS0);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
}

void test_a_start_in_the_middle_of_the_converters_test_forgets_it(void)
{
    uint16_t n;
    for (n = 0; n < 2000u && AD1CHS0 == BOARD_AD1CHS0; n++) {
        board_ms(1);
    }
    TEST_ASSERT_EQUAL_HEX16(BOARD_AN_OFF, AD1CHS0);
    power_up();
    board_ms(1100);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
}

void test_the_panel_never_sees_the_converters_test(void)
{
    uint16_t n, tested = 0;
    for (n = 0; n < 2000u; n++) {
        int16_t before = board_pot.used_q15;
        board_ms(1);
        tested |= (uint16_t)(AD1CHS0 != BOARD_AD1CHS0);
        TEST_ASSERT_TRUE(n < 300u || board_pot.used_q15 == before);
    }
    TEST_ASSERT_EQUAL_UINT16(1, tested);
}

/* ---- watchdog and clock, once at power-up ---- */

void test_watchdog_and_clock_are_tested_at_power_up(void)
{
    static const struct {
        uint16_t counts, test;
    } cases[] = { { 0, SELFTEST_WATCHDOG }, { 5000, SELFTEST_CLOCK }, { 7300, SELFTEST_CLOCK }, { 7700, SELFTEST_NONE },
                  { 10000, SELFTEST_NONE }, { 14300, SELFTEST_NONE }, { 14800, SELFTEST_CLOCK }, { 19000, SELFTEST_CLOCK } };
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        host_watchdog_counts = cases[n].counts;
        power_up();
        TEST_ASSERT_EQUAL_UINT16(cases[n].test, board_selftest_failed);
        TEST_ASSERT_EQUAL_HEX16(0x0003u, board_reset_cause);
        TEST_ASSERT_EQUAL_HEX16(0, RCON);
    }
}

/** As the chip: the reset comes in the middle of the wait, with power-up's bits still set. */
void test_the_reset_that_the_test_waits_for_ends_it(void)
{
    static const struct {
        uint16_t counts, test;
    } cases[] = { { 10000, SELFTEST_NONE }, { 5000, SELFTEST_CLOCK } };
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        host_registers_reset();
        host_watchdog_counts = 0; /* a second wait would be a failure */
        waited_counts = cases[n].counts;
        RCON = 0x0013u;
        firmware_init();
        TEST_ASSERT_EQUAL_UINT16(cases[n].test, board_selftest_failed);
        TEST_ASSERT_EQUAL_HEX16(0x0003u, board_reset_cause);
        TEST_ASSERT_EQUAL_HEX16(0, RCON);
        TEST_ASSERT_EQUAL_UINT16(n == 0u ? FAULT_NONE : FAULT_SELFTEST, board_drive.fault);
    }
}

void test_other_resets_test_no_watchdog_and_leave_a_kept_fault(void)
{
    host_watchdog_counts = 0;
    reset_keep(FAULT_STALL);
    RCON = 0x0010u;
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    RCON = 0x0080u;
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}

/* ---- the drive's own: a transition that is not in its table ---- */

void test_a_state_that_none_may_follow_is_a_failure_of_the_flow_that_S2_does_not_clear(void)
{
    run_motor();
    drive_enter(&board_drive, DRIVE_BOOTSTRAP);
    finds(SELFTEST_FLOW, 1, "BOOTSTRAP after CLOSED");
    press_s2();
    press_s2();
    TEST_ASSERT_EQUAL_UINT16(FAULT_SELFTEST, board_drive.fault);
}

/* ---- what a failure does ---- */

void test_S2_does_not_clear_a_failure_and_a_reset_of_the_watchdog_keeps_its_name(void)
{
    run_motor();
    STACK_GUARD[0] = 0;
    finds(SELFTEST_STACK, 1, "guard");
    STACK_GUARD[0] = STACK_PATTERN;
    press_s2();
    press_s2();
    TEST_ASSERT_EQUAL_UINT16(FAULT_SELFTEST, board_drive.fault);
    TEST_ASSERT_EQUAL_HEX16(BOARD_OUTPUTS_OFF, P1OVDCON);
    board_ms(1000);
    TEST_ASSERT_NOT_NULL(strstr(sent, "state 7 fault SELFTEST speed 0 rpm selftest 9\r\n"));
    RCON = 0x0010u;
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(FAULT_SELFTEST, board_drive.fault);
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_STACK, board_selftest_failed);
    press_s2();
    TEST_ASSERT_EQUAL_UINT16(FAULT_SELFTEST, board_drive.fault);
    RCON = 0x0080u; /* MCLR */
    firmware_init();
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, board_drive.fault);
}
