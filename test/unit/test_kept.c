/* Parameters kept over a reset: what a reset brings back, whatever has happened to the two copies, and when nothing is written. */
/* defines: -DPARAMS_IN_RAM -DPARAMS_KEPT=1 */
#include "hurst_params.h"

#include <setjmp.h>
#include <stddef.h>
#include <string.h>
#include <xc.h>

/* A bit of the flash that no operation sets or clears any more. */
static uint32_t stuck_at_word, stuck_bits, stuck_value;
static void after_nvm(void)
{
    if (stuck_bits != 0u) {
        host_flash[stuck_at_word] = (host_flash[stuck_at_word] & ~stuck_bits) | stuck_value;
    }
}
#undef __builtin_write_NVM
#define __builtin_write_NVM() (host_write_nvm(), after_nvm())

#include "firmware/board/kept.c"

#include "unity.h"

drive_t board_drive;
static const drive_params_t header = DRIVE_PARAMS_INIT;
static drive_params_t start_values; /* as the compiler's start-up code has them */
drive_params_t board_params;

/* Of status.c, which needs the whole firmware. */
char *text_put(char *at, const char *text)
{
    return stpcpy(at, text);
}
const char *text_next(const char *name)
{
    return name + strlen(name) + 1;
}

#define COPY_WORDS (AT_CRC + 1u)
#define NVM_OF_A_COPY (COPY_WORDS + 1u) /* operations: erase, words */

static uint32_t *page_word(unsigned page, unsigned n)
{
    return &host_flash[(KEPT_AT + page * KEPT_PAGE_SIZE) / 2u + n];
}

static void erase_pages(void)
{
    for (unsigned n = 0; n < KEPT_PAGES * KEPT_PAGE_SIZE / 2u; n++) {
        *page_word(0, n) = 0xFFFFFFu;
    }
}

static void reset(void)
{
    board_params = start_values;
    memset(of_header, 0, sizeof of_header); /* what the start-up code clears */
    memset(&kept_command, 0, sizeof kept_command);
    kept_since_ms = 0;
    TBLPAG = 0xAAu;
    kept_init();
}

static void ask(uint16_t request)
{
    kept_command.request = request;
    kept_tick(1);
    TEST_ASSERT_EQUAL_UINT16(0, kept_command.request);
}

static void keeps(void)
{
    ask(KEPT_ASK_KEEP);
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_DONE, kept_command.result);
}

/** Three values that tell which set is in RAM: a scalar, a long one, a table's last entry. */
static void choose(int16_t set)
{
    board_params.speed_kp_q13 = (int16_t)(1000 + set);
    board_params.speed_ramp_q16 = 0x00050000 + set;
    board_params.fieldweak.ls_over2ls0_q15[FIELDWEAK_ENTRIES - 1] = (int16_t)(16000 + set);
}

static int is_set(int16_t set)
{
    drive_params_t now = board_params;
    int equal;
    choose(set);
    equal = memcmp(&now, &board_params, sizeof now) == 0;
    board_params = now;
    return equal;
}

static int is_header(void)
{
    return memcmp(&board_params, &start_values, sizeof board_params) == 0;
}

void setUp(void)
{
    host_registers_reset();
    P1OVDCON = BOARD_OUTPUTS_OFF;
    memset(&board_drive, 0, sizeof board_drive);
    board_drive.state = (uint16_t)DRIVE_STOPPED;
    host_nvm_left = HOST_NVM_FOREVER;
    stuck_bits = 0;
    start_values = header;
    erase_pages();
    reset();
}

/* ---- without trouble ---- */

void test_without_copies_the_headers_values_are_in_use(void)
{
    TEST_ASSERT_EQUAL_UINT16(KEPT_NONE, kept_command.copies);
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_NONE, kept_command.result);
    TEST_ASSERT_EQUAL_UINT16(0, kept_command.unsaved);
    TEST_ASSERT_TRUE(is_header());
}

void test_every_word_that_can_be_kept_comes_back_after_a_reset(void)
{
    const kept_range_t *range;
    drive_params_t kept;
    for (range = ranges; range != &ranges[ROWS]; range++) {
        for (unsigned n = 0; n < (range->place >> 8); n++) {
            int16_t *at = (int16_t *)(void *)&board_params + (range->place & 0xFFu) + n;
            if (range->least != INT16_MIN) { /* not half of a long one */
                *at = (int16_t)(*at > range->least ? *at - 1 : *at + 1);
            }
        }
    }
    board_params.speed_ramp_q16 += 0x18000;
    board_params.speed_decel_q16 -= 0x8000;
    kept = board_params;
    keeps();
    TEST_ASSERT_EQUAL_UINT16(KEPT_KEPT, kept_command.copies);
    reset();
    TEST_ASSERT_EQUAL_MEMORY(&kept, &board_params, sizeof kept);
    TEST_ASSERT_EQUAL_UINT16(KEPT_KEPT, kept_command.copies);
    TEST_ASSERT_EQUAL_UINT16(0, kept_command.unsaved);
}

void test_what_protects_the_motor_and_what_it_is_stay_the_headers(void)
{
    static const size_t others[] = {
        offsetof(drive_params_t, overcurrent_q13), offsetof(drive_params_t, current_max_q13), offsetof(drive_params_t, bus_over_q15),
        offsetof(drive_params_t, overspeed_erpm), offsetof(drive_params_t, kcurr_a), offsetof(drive_params_t, stall_steps),
        offsetof(drive_params_t, estimator.d_ilimit_ls_q14), offsetof(drive_params_t, svm.knee_q13),
    };
    for (size_t n = 0; n < sizeof others / sizeof others[0]; n++) {
        *(int16_t *)(void *)((char *)&board_params + others[n]) ^= 1;
    }
    choose(1);
    keeps();
    reset();
    TEST_ASSERT_TRUE(is_set(1));
}

void test_both_pages_hold_the_same_copy_and_nothing_else_of_the_flash_changes(void)
{
    static uint32_t before[HOST_FLASH_WORDS];
    memcpy(before, host_flash, sizeof before);
    choose(1);
    keeps();
    TEST_ASSERT_EQUAL_HEX16(0, TBLPAG);
    TEST_ASSERT_EQUAL_MEMORY(before, host_flash, KEPT_AT / 2u * sizeof before[0]);
    for (unsigned n = 0; n < KEPT_PAGE_SIZE / 2u; n++) {
        TEST_ASSERT_EQUAL_HEX32(*page_word(0, n), *page_word(1, n));
        TEST_ASSERT_EQUAL_HEX32(0xFF0000u, *page_word(0, n) & 0xFF0000u);
        TEST_ASSERT_TRUE(n < COPY_WORDS || *page_word(0, n) == 0xFFFFFFu);
    }
}

void test_unsaved_counts_the_words_that_a_reset_would_change(void)
{
    choose(1); /* the ramp's two words, too */
    kept_tick(99);
    TEST_ASSERT_EQUAL_UINT16(0, kept_command.unsaved);
    kept_tick(1);
    TEST_ASSERT_EQUAL_UINT16(4, kept_command.unsaved);
    keeps();
    TEST_ASSERT_EQUAL_UINT16(0, kept_command.unsaved);
    board_params.fieldweak.idref_q13[3]--;
    board_params.overcurrent_q13--; /* never kept */
    kept_tick(100);
    TEST_ASSERT_EQUAL_UINT16(1, kept_command.unsaved);
}

void test_forget_brings_the_headers_values_at_once_and_after_a_reset(void)
{
    choose(1);
    keeps();
    board_params.overcurrent_q13--;
    ask(KEPT_ASK_FORGET);
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_DONE, kept_command.result);
    TEST_ASSERT_EQUAL_UINT16(KEPT_NONE, kept_command.copies);
    TEST_ASSERT_EQUAL_UINT16(0, kept_command.unsaved);
    TEST_ASSERT_EQUAL_INT16(header.overcurrent_q13 - 1, board_params.overcurrent_q13);
    board_params.overcurrent_q13++;
    TEST_ASSERT_TRUE(is_header());
    reset();
    TEST_ASSERT_TRUE(is_header());
    TEST_ASSERT_EQUAL_UINT16(KEPT_NONE, kept_command.copies);
}

void test_the_last_of_many_is_kept_also_where_the_copies_numbers_wrap(void)
{
    choose(1);
    keeps();
    kept_number = 0xFFFEu;
    for (int16_t set = 2; set < 8; set++) {
        choose(set);
        keeps();
        reset();
        TEST_ASSERT_TRUE(is_set(set));
    }
    TEST_ASSERT_EQUAL_UINT16(4, kept_number);
}

/* ---- when it is written ---- */

/** So long as a rotor may coast. */
static void coasted(void)
{
    for (unsigned ms = 0; ms < KEPT_COAST_MS; ms++) {
        kept_tick(1);
    }
}

void test_it_is_refused_while_a_rotor_that_was_let_go_may_coast(void)
{
    uint32_t before = *page_word(0, 0);
    P1OVDCON = BOARD_OUTPUTS_BOOTSTRAP;
    kept_tick(1);
    P1OVDCON = BOARD_OUTPUTS_OFF;
    for (unsigned ms = 1; ms < KEPT_COAST_MS; ms++) {
        ask((ms % 1000u == 0u) ? KEPT_ASK_FORGET : KEPT_ASK_KEEP);
        TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_NOT_STOPPED, kept_command.result);
    }
    TEST_ASSERT_EQUAL_HEX32(before, *page_word(0, 0));
    ask(KEPT_ASK_KEEP);
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_DONE, kept_command.result);
}

void test_it_is_refused_in_every_other_state(void)
{
    static const uint16_t requests[] = { KEPT_ASK_KEEP, KEPT_ASK_FORGET };
    uint32_t before = *page_word(0, 0);
    choose(1);
    for (unsigned n = 0; n < 2u; n++) {
        for (uint16_t state = 0; state < (uint16_t)DRIVE_STATE_COUNT; state++) {
            board_drive.state = state;
            if (state != (uint16_t)DRIVE_STOPPED) {
                ask(requests[n]);
                TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_NOT_STOPPED, kept_command.result);
            }
        }
        board_drive.state = (uint16_t)DRIVE_STOPPED;
        board_drive.command.run = 1;
        ask(requests[n]);
        TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_NOT_STOPPED, kept_command.result);
        board_drive.command.run = 0;
        P1OVDCON = BOARD_OUTPUTS_BOOTSTRAP;
        kept_command.result = KEPT_RESULT_NONE;
        ask(requests[n]);
        TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_NOT_STOPPED, kept_command.result);
        P1OVDCON = BOARD_OUTPUTS_OFF;
        coasted();
    }
    TEST_ASSERT_EQUAL_HEX32(before, *page_word(0, 0));
    TEST_ASSERT_EQUAL_UINT16(0, host_watchdog_serves);
    TEST_ASSERT_TRUE(is_set(1));
}

void test_no_other_number_is_a_request(void)
{
    for (uint32_t request = 0; request <= 0xFFFFu; request++) {
        if (request != (uint32_t)KEPT_ASK_KEEP && request != (uint32_t)KEPT_ASK_FORGET) {
            ask((uint16_t)request);
        }
    }
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_NONE, kept_command.result);
    TEST_ASSERT_EQUAL_UINT16(0, host_watchdog_serves);
}

void test_the_watchdog_is_served_before_each_operation_and_the_late_sample_left_out(void)
{
    IFS0bits.AD1IF = 1;
    keeps();
    TEST_ASSERT_EQUAL_UINT16(2u * NVM_OF_A_COPY, host_watchdog_serves);
    TEST_ASSERT_EQUAL_UINT16(0, IFS0bits.AD1IF);
    TEST_ASSERT_EQUAL_UINT16(0, SRbits.IPL);
}

/* ---- the supply fails ---- */

static jmp_buf failed_supply;

static void supply_fails(void)
{
    longjmp(failed_supply, 1);
}

/** Asks; the supply fails in the midst of operation `left` from now. Then a reset. @return 1 if it came so far */
static int cut(uint16_t request, uint16_t left)
{
    volatile int fails = 0;
    host_power_fails = supply_fails;
    host_nvm_left = left;
    if (setjmp(failed_supply) == 0) {
        ask(request);
    } else {
        fails = 1;
    }
    host_nvm_left = HOST_NVM_FOREVER;
    reset();
    return fails;
}

/** Cuts at every operation, several times: what is changed in part is drawn anew. `before` and `after`: 0 for the header's values. */
static void sweep(uint16_t request, int16_t before, int16_t after)
{
    unsigned seen_before = 0, seen_after = 0, cuts = 0;
    for (unsigned turn = 0; turn < 8u; turn++) {
        for (uint16_t left = 1;; left++) {
            int fails, is_before, is_after;
            erase_pages();
            reset();
            if (before != 0) {
                choose(before);
                keeps();
            }
            choose(after != 0 ? after : before);
            fails = cut(request, left);
            is_before = before != 0 ? is_set(before) : is_header();
            is_after = after != 0 ? is_set(after) : is_header();
            TEST_ASSERT_TRUE_MESSAGE(is_before || is_after, "neither the old values nor the new ones");
            TEST_ASSERT_EQUAL_UINT16(0, kept_command.unsaved);
            seen_before += (unsigned)is_before;
            seen_after += (unsigned)is_after;
            if (is_header()) { /* no other word: the next question tells why */
                TEST_ASSERT_TRUE(kept_command.copies == KEPT_NONE || kept_command.copies == KEPT_BROKEN);
            } else {
                TEST_ASSERT_TRUE(kept_command.copies == KEPT_KEPT || kept_command.copies == KEPT_ONE_COPY);
            }
            choose(9); /* and it goes on */
            keeps();
            reset();
            TEST_ASSERT_TRUE(is_set(9));
            TEST_ASSERT_EQUAL_UINT16(KEPT_KEPT, kept_command.copies);
            if (!fails) {
                break;
            }
            cuts++;
        }
    }
    TEST_ASSERT_EQUAL_UINT(8u * (request == (uint16_t)KEPT_ASK_KEEP ? 2u * NVM_OF_A_COPY : 2u), cuts);
    TEST_ASSERT_TRUE(seen_before >= 8u && seen_after >= 8u);
}

void test_a_cut_while_the_first_copy_is_written_leaves_the_headers_values_or_the_new_ones(void)
{
    sweep(KEPT_ASK_KEEP, 0, 1);
}

void test_a_cut_while_new_values_are_written_leaves_the_old_ones_or_the_new_ones(void)
{
    sweep(KEPT_ASK_KEEP, 1, 2);
}

void test_a_cut_while_it_forgets_leaves_the_kept_values_or_the_headers(void)
{
    sweep(KEPT_ASK_FORGET, 1, 0);
}

void test_between_the_copies_the_newer_one_counts_in_whichever_page_it_is(void)
{
    for (unsigned turn = 0; turn < 2u; turn++) { /* the newest page changes its place with each cut */
        choose(1);
        keeps();
        choose(2);
        TEST_ASSERT_TRUE(cut(KEPT_ASK_KEEP, NVM_OF_A_COPY + 1u)); /* the second one's erasing */
        TEST_ASSERT_TRUE(is_set(2));
        TEST_ASSERT_EQUAL_UINT16(KEPT_ONE_COPY, kept_command.copies);
        choose(3);
        keeps();
    }
    for (unsigned page = 0; page < 2u; page++) { /* both whole, one newer */
        uint32_t copy[COPY_WORDS];
        kept_number = 0xFFFEu; /* the next ones have 0xFFFF and 0 */
        choose(4);
        keeps();
        memcpy(copy, page_word(page, 0), sizeof copy);
        choose(5);
        keeps();
        memcpy(page_word(page, 0), copy, sizeof copy);
        reset();
        TEST_ASSERT_TRUE(is_set(5));
    }
}

/* ---- the flash is damaged ---- */

void test_a_bit_that_flips_in_one_copy_changes_nothing_and_is_told(void)
{
    choose(1);
    keeps();
    for (unsigned page = 0; page < 2u; page++) {
        for (unsigned n = 0; n < COPY_WORDS; n++) {
            for (unsigned bit = 0; bit < 16u; bit++) {
                *page_word(page, n) ^= 1u << bit;
                reset();
                TEST_ASSERT_TRUE(is_set(1));
                TEST_ASSERT_EQUAL_UINT16(KEPT_ONE_COPY, kept_command.copies);
                *page_word(page, n) ^= 1u << bit;
            }
        }
    }
}

void test_with_both_copies_damaged_the_headers_values_are_in_use_and_it_says_so(void)
{
    choose(1);
    keeps();
    for (unsigned n = 0; n < COPY_WORDS; n++) {
        *page_word(0, n) ^= 0x0100u;
        *page_word(1, COPY_WORDS - 1u - n) ^= 0x0001u;
        reset();
        TEST_ASSERT_TRUE(is_header());
        TEST_ASSERT_EQUAL_UINT16(KEPT_BROKEN, kept_command.copies);
        *page_word(0, n) ^= 0x0100u;
        *page_word(1, COPY_WORDS - 1u - n) ^= 0x0001u;
    }
}

void test_flash_that_does_not_take_what_is_written_is_told_and_the_old_copy_stays(void)
{
    choose(1);
    keeps();
    stuck_at_word = (KEPT_AT + KEPT_PAGE_SIZE * (kept_newest == FIRST_PAGE)) / 2u + AT_VALUES + 5u; /* the other page */
    stuck_bits = stuck_value = 0x8000u;
    choose(2);
    ask(KEPT_ASK_KEEP);
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_FLASH, kept_command.result);
    TEST_ASSERT_TRUE(is_set(2));
    TEST_ASSERT_EQUAL_UINT16(3, kept_command.unsaved);
    reset();
    TEST_ASSERT_TRUE(is_set(1));
    stuck_at_word = KEPT_AT / 2u; /* a page that is not erased */
    stuck_value = 0;
    ask(KEPT_ASK_FORGET);
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_FLASH, kept_command.result);
    TEST_ASSERT_TRUE(is_header());
}

/* ---- copies that are whole, and must not be used ---- */

/** A word of both copies, with a CRC that is right. */
static void forge(unsigned n, uint16_t word)
{
    for (unsigned page = 0; page < 2u; page++) {
        uint16_t crc = SELFTEST_CRC_START;
        *page_word(page, n) = 0xFF0000u | word;
        for (unsigned k = 0; k < AT_CRC; k++) {
            crc = kept_crc_of(crc, (uint16_t)*page_word(page, k));
        }
        *page_word(page, AT_CRC) = 0xFF0000u | crc;
    }
}

void test_copies_of_another_firmware_are_not_used(void)
{
    choose(1);
    keeps();
    forge(AT_VERSION, (uint16_t)(kept_version ^ 0x0001u));
    reset();
    TEST_ASSERT_TRUE(is_header());
    TEST_ASSERT_EQUAL_UINT16(KEPT_OTHER, kept_command.copies);
    choose(2);
    keeps();
    reset();
    TEST_ASSERT_TRUE(is_set(2));
}

void test_copies_kept_with_another_header_are_not_used(void)
{
    choose(1);
    keeps();
    start_values.fieldweak.inv_kfi[7]++;
    reset();
    TEST_ASSERT_TRUE(is_header());
    TEST_ASSERT_EQUAL_UINT16(KEPT_OTHER, kept_command.copies);
    start_values = header;
    reset();
    TEST_ASSERT_TRUE(is_set(1));
}

/** Such a value in both copies: not used; and in RAM: not kept. */
static void is_refused(unsigned n, int16_t *at, int16_t value)
{
    const int16_t good = *at;
    const uint32_t before = *page_word(0, AT_VALUES + n);
    forge(AT_VALUES + n, (uint16_t)value);
    reset();
    TEST_ASSERT_TRUE(is_header());
    TEST_ASSERT_EQUAL_UINT16(KEPT_RANGE, kept_command.copies);
    forge(AT_VALUES + n, (uint16_t)before);
    reset();
    TEST_ASSERT_TRUE(is_set(1));
    *at = value;
    ask(KEPT_ASK_KEEP);
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_RANGE, kept_command.result);
    TEST_ASSERT_EQUAL_HEX32(before, *page_word(0, AT_VALUES + n));
    *at = good;
}

void test_a_value_outside_its_range_is_neither_used_nor_kept(void)
{
    const kept_range_t *range;
    unsigned n = 0;
    choose(1);
    keeps();
    for (range = ranges; range != &ranges[ROWS]; range++) {
        int16_t *first = (int16_t *)(void *)&board_params + (range->place & 0xFFu);
        for (unsigned k = 0; k < (range->place >> 8); k++, n++) {
            if (range->least > INT16_MIN) {
                is_refused(n, &first[k], (int16_t)(range->least - 1));
            }
            if (range->most < INT16_MAX) {
                is_refused(n, &first[k], (int16_t)(range->most + 1));
            }
        }
    }
    TEST_ASSERT_EQUAL_UINT(KEPT_WORDS, n);
}

void test_the_ranges_are_those_of_the_parameters_in_counts(void)
{
    struct {
        int16_t *place, least, most;
    } rows[] = {
        { &board_params.minimum_erpm, (int16_t)PARAM_ROUND(PARAM_LOWEST_ERPM), MAXIMUM_SPEED_RPM * NOPOLESPAIRS },
        { &board_params.forced.increase_rate_q10, 1, 2000 },
        { &board_params.open_loop_q13, CURRENT_Q13(0.05), CURRENT_Q13(MAXIMUM_CURRENT_A) },
        { (int16_t *)&board_params.flying_start, 0, 1 },
        { &board_params.fieldweak.kfilter_esdq_q16, 20, 16000 },
        { &board_params.fieldweak.trim_max_q13, 0, CURRENT_Q13(MAXIMUM_CURRENT_A) },
        { board_params.fieldweak.idref_q13, CURRENT_Q13(-MAXIMUM_CURRENT_A), 0 },
        { board_params.fieldweak.ls_over2ls0_q15, 3277, 19661 },
    };
    for (unsigned n = 0; n < sizeof rows / sizeof rows[0]; n++) {
        const kept_range_t *range = ranges;
        while ((int16_t *)(void *)&board_params + (range->place & 0xFFu) != rows[n].place) {
            range++;
            TEST_ASSERT_TRUE(range != &ranges[ROWS]);
        }
        TEST_ASSERT_EQUAL_INT16(rows[n].least, range->least);
        TEST_ASSERT_EQUAL_INT16(rows[n].most, range->most);
    }
}

static void does_not_fit(void)
{
    ask(KEPT_ASK_KEEP);
    TEST_ASSERT_EQUAL_UINT16(KEPT_RESULT_RANGE, kept_command.result);
    board_params = header;
}

void test_values_that_do_not_fit_each_other_are_not_kept(void)
{
    board_params.nominal_erpm = board_params.minimum_erpm;
    does_not_fit();
    board_params.maximum_erpm = (int16_t)(board_params.nominal_erpm - 1);
    does_not_fit();
    board_params.fieldweak.on_speed_erpm = board_params.maximum_erpm;
    does_not_fit();
    board_params.speed_ramp_q16 = KEPT_SLOPE_LEAST - 1;
    does_not_fit();
    board_params.speed_ramp_q16 = KEPT_SLOPE_MOST + 1;
    does_not_fit();
    board_params.speed_decel_q16 = 0;
    does_not_fit();
    board_params.speed_decel_q16 = -KEPT_SLOPE_LEAST;
    does_not_fit();
    TEST_ASSERT_EQUAL_UINT16(KEPT_NONE, kept_command.copies);
    board_params.maximum_erpm = board_params.nominal_erpm; /* the ends fit */
    board_params.fieldweak.on_speed_erpm = (int16_t)(board_params.maximum_erpm - 1);
    board_params.speed_ramp_q16 = KEPT_SLOPE_LEAST;
    board_params.speed_decel_q16 = KEPT_SLOPE_MOST;
    keeps();
}

/* ---- the status line ---- */

void test_the_status_line_says_what_is_to_be_told(void)
{
    static const char *const said[] = { "", "", " kept ONE_COPY", " kept OTHER", " kept RANGE", " kept BROKEN" };
    char line[32];
    for (uint16_t state = 0; state < sizeof said / sizeof said[0]; state++) {
        kept_command.copies = state;
        *kept_put(line) = '\0';
        TEST_ASSERT_EQUAL_STRING(said[state], line);
    }
}
