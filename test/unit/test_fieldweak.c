/* Field weakening by table: start speed, every index, interpolation, the end and beyond, and the voltage trim. */
#include "control/fieldweak.h"
#include "golden.h"
#include "golden_fieldweak.h"
#include "golden_fieldweak_tables.h"
#include "unity.h"

static fieldweak_params_t params;
static estimator_tuning_t tuning;
static fieldweak_t fw;

void setUp(void)
{
    static const fieldweak_t zero;
    uint16_t n;
    for (n = 0; n < FIELDWEAK_ENTRIES; n++) {
        golden_fieldweak_tables_t v = golden_fieldweak_tables[n];
        params.idref_q13[n] = v.idref;
        params.inv_kfi[n] = v.inv_kfi;
        params.ls_over2ls0_q15[n] = v.ls;
    }
    params.on_speed_erpm = GOLDEN_FIELDWEAK_ON_SPEED;
    params.ls_base_q16 = (uint16_t)GOLDEN_FIELDWEAK_LS_BASE;
    params.kfilter_esdq_q16 = 2400;
    params.kfilter_esdq_fw_q16 = 328;
    params.trim_max_q13 = 101;
    params.trim_step_q13 = 2;
    params.margin_q14 = 300;
    params.trim_speed_erpm = 8000;
    fw = zero;
}

void tearDown(void)
{
}

static void look_up(int16_t ref_erpm)
{
    fieldweak_tick(&fw, &params, &tuning, ref_erpm);
}

void test_table_length_is_the_notes_18(void)
{
    TEST_ASSERT_EQUAL_UINT32(18u, GOLDEN_FIELDWEAK_TABLES_ROWS);
    TEST_ASSERT_EQUAL_INT(18, FIELDWEAK_ENTRIES);
}

void test_look_ups_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_FIELDWEAK_ROWS; n++) {
        golden_fieldweak_t v = golden_fieldweak[n];
        look_up(v.ref);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.index, fw.index, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.idref, fw.table_q13, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.inv_kfi, tuning.inv_kfi, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.emf_max, tuning.emf_sum_max_q12, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.ls_q16, tuning.ls_q16, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.above ? 328 : 2400, tuning.kfilter_esdq_q16, golden_row(n));
    }
}

void test_entry_0_and_the_base_constants_hold_up_to_the_start_speed(void)
{
    static const int16_t refs[] = { 0, 500, 12999, 13000, -13000 };
    uint16_t n;
    for (n = 0; n < 5u; n++) {
        look_up(refs[n]);
        TEST_ASSERT_EQUAL_UINT16(0, fw.index);
        TEST_ASSERT_EQUAL_INT16(params.idref_q13[0], fw.table_q13);
        TEST_ASSERT_EQUAL_INT16(params.inv_kfi[0], tuning.inv_kfi);
        TEST_ASSERT_EQUAL_UINT16(params.ls_base_q16, tuning.ls_q16); /* entry 0 is 0.5: no change */
        TEST_ASSERT_EQUAL_INT16(2400, tuning.kfilter_esdq_q16);
    }
}

void test_filter_changes_just_above_the_start_speed_in_both_directions(void)
{
    look_up(13001);
    TEST_ASSERT_EQUAL_INT16(328, tuning.kfilter_esdq_q16);
    look_up(13000);
    TEST_ASSERT_EQUAL_INT16(2400, tuning.kfilter_esdq_q16);
    look_up(-13001);
    TEST_ASSERT_EQUAL_INT16(328, tuning.kfilter_esdq_q16);
}

void test_every_entry_is_read_at_its_own_speed(void)
{
    uint16_t n;
    for (n = 0; n < FIELDWEAK_ENTRIES - 1u; n++) {
        look_up((int16_t)(13000 + (int16_t)(n * 1024u)));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(n, fw.index, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(params.idref_q13[n], fw.table_q13, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(params.inv_kfi[n], tuning.inv_kfi, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((uint16_t)(qm_muluu(params.ls_base_q16, (uint16_t)params.ls_over2ls0_q15[n]) >> 14),
                                         tuning.ls_q16, golden_row(n));
    }
}

void test_half_way_between_two_entries_is_their_mean(void)
{
    look_up(13000 + 512);
    TEST_ASSERT_INT16_WITHIN(1, (int16_t)((params.idref_q13[0] + params.idref_q13[1]) / 2), fw.table_q13);
    TEST_ASSERT_INT16_WITHIN(1, (int16_t)((params.inv_kfi[0] + params.inv_kfi[1]) / 2), tuning.inv_kfi);
}

void test_index_is_14_at_the_notes_5500_rpm(void)
{
    look_up(27500); /* (27500 - 13000) / 1024 = 14.16 */
    TEST_ASSERT_EQUAL_UINT16(14, fw.index);
}

void test_look_up_has_the_same_values_in_reverse(void)
{
    int16_t ref;
    for (ref = 12000; ref < 32000; ref = (int16_t)(ref + 333)) {
        fieldweak_t forward;
        int16_t inv_kfi;
        look_up(ref);
        forward = fw;
        inv_kfi = tuning.inv_kfi;
        look_up((int16_t)-ref);
        TEST_ASSERT_EQUAL_UINT16(forward.index, fw.index);
        TEST_ASSERT_EQUAL_INT16(forward.table_q13, fw.table_q13);
        TEST_ASSERT_EQUAL_INT16(inv_kfi, tuning.inv_kfi);
    }
}

void test_beyond_the_end_nothing_is_read_and_nothing_moves(void)
{
    int16_t end_q13;
    look_up(13000 + 17 * 1024);
    end_q13 = fw.table_q13;
    TEST_ASSERT_EQUAL_UINT16(16, fw.index);
    TEST_ASSERT_INT16_WITHIN(1, params.idref_q13[17], end_q13);
    look_up(32767);
    TEST_ASSERT_EQUAL_UINT16(16, fw.index);
    TEST_ASSERT_EQUAL_INT16(end_q13, fw.table_q13);
    look_up(INT16_MIN);
    TEST_ASSERT_EQUAL_UINT16(16, fw.index);
    TEST_ASSERT_EQUAL_INT16(end_q13, fw.table_q13);
}

void test_beyond_the_end_the_last_entry_holds_to_one_count(void)
{
    params.idref_q13[16] = -1000;
    params.idref_q13[17] = -2000;
    params.inv_kfi[16] = 8000;
    params.inv_kfi[17] = 9000;
    look_up(32767);
    TEST_ASSERT_INT16_WITHIN(1, -2000, fw.table_q13);
    TEST_ASSERT_INT16_WITHIN(1, 9000, tuning.inv_kfi);
}

void test_reference_at_both_ends_of_the_word_is_accepted(void)
{
    params.on_speed_erpm = 500;
    look_up(32767);
    TEST_ASSERT_EQUAL_UINT16(16, fw.index);
    look_up(INT16_MIN);
    TEST_ASSERT_EQUAL_UINT16(16, fw.index);
    look_up(-32767);
    TEST_ASSERT_EQUAL_UINT16(16, fw.index);
}

void test_emf_limit_keeps_the_speed_in_16_bits(void)
{
    int16_t ref;
    for (ref = 0; ref < 32000; ref = (int16_t)(ref + 777)) {
        look_up(ref);
        TEST_ASSERT_TRUE(qm_mulss(tuning.emf_sum_max_q12, tuning.inv_kfi) >> 11 <= 32767);
        TEST_ASSERT_TRUE(qm_mulss(tuning.emf_sum_max_q12, tuning.inv_kfi) >> 11 > 32740);
    }
}

/* ---- voltage trim ---- */

static int16_t trim(int16_t free_q14, int16_t speed_erpm)
{
    fieldweak_trim(&fw, &params, free_q14, speed_erpm);
    return fw.trim_q13;
}

void test_trim_asks_for_more_d_current_where_voltage_is_short(void)
{
    TEST_ASSERT_EQUAL_INT16(-2, trim(299, 8001));
    TEST_ASSERT_EQUAL_INT16(-4, trim(0, 8001));
    TEST_ASSERT_EQUAL_INT16(-6, trim(-50, -8001));
}

void test_trim_is_given_back_where_voltage_is_free_or_speed_is_low(void)
{
    fw.trim_q13 = -10;
    TEST_ASSERT_EQUAL_INT16(-8, trim(300, 20000));
    TEST_ASSERT_EQUAL_INT16(-6, trim(0, 8000));
    TEST_ASSERT_EQUAL_INT16(-4, trim(0, -8000));
}

void test_trim_ends_at_its_limit_and_at_zero(void)
{
    uint16_t n;
    for (n = 0; n < 100u; n++) {
        (void)trim(0, 20000);
    }
    TEST_ASSERT_EQUAL_INT16(-101, fw.trim_q13);
    for (n = 0; n < 100u; n++) {
        (void)trim(1000, 20000);
    }
    TEST_ASSERT_EQUAL_INT16(0, fw.trim_q13);
}
