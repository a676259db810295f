/* Field weakening by table: start speed, every index, interpolation, the end and beyond, and the voltage trim. */
#include "control/fieldweak.h"
#include "golden.h"
#include "golden_fieldweak.h"
#include "golden_fieldweak_tables.h"
#include "unity.h"

static fieldweak_params_t params;
static motor_model_t tuning;
static fieldweak_t fw;

void setUp(void)
{
    static const fieldweak_t zero;
    GOLDEN_EACH(fieldweak_tables, v) {
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

static void look_up(int16_t ref_erpm)
{
    fieldweak_tick(&fw, &params, &tuning, ref_erpm);
}

void test_look_ups_equal_the_reference_in_both_directions(void)
{
    TEST_ASSERT_EQUAL_INT(18, FIELDWEAK_ENTRIES); /* AN1292's */
    TEST_ASSERT_EQUAL_UINT32(18u, GOLDEN_FIELDWEAK_TABLES_ROWS);
    GOLDEN_EACH(fieldweak, v) {
        for (int16_t direction = 1; direction >= -1; direction = (int16_t)(direction - 2)) {
            look_up((v.ref == INT16_MIN) ? v.ref : (int16_t)(direction * v.ref));
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.index, fw.index, golden_row(n));
            TEST_ASSERT_EQUAL_INT16_MESSAGE(v.idref, fw.table_q13, golden_row(n));
            TEST_ASSERT_EQUAL_INT16_MESSAGE(v.inv_kfi, tuning.inv_kfi, golden_row(n));
            TEST_ASSERT_EQUAL_INT16_MESSAGE(v.emf_max, tuning.emf_sum_max_q12, golden_row(n));
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.ls_q16, tuning.ls_q16, golden_row(n));
            TEST_ASSERT_EQUAL_INT16_MESSAGE(v.above ? 328 : 2400, tuning.kfilter_esdq_q16, golden_row(n));
        }
    }
}

void test_beyond_the_end_nothing_is_read_and_the_last_entry_holds_to_one_count(void)
{
    static const int16_t beyond[] = { 13000 + 17 * 1024, 32767, -32767, INT16_MIN };
    params.idref_q13[16] = -1000;
    params.idref_q13[17] = -2000;
    params.inv_kfi[16] = 8000;
    params.inv_kfi[17] = 9000;
    for (unsigned n = 0; n < 8u; n++) {
        params.on_speed_erpm = (n < 4u) ? 13000 : 500;
        look_up(beyond[n % 4u]);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(16, fw.index, golden_row(n));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1, -2000, fw.table_q13, golden_row(n));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(1, 9000, tuning.inv_kfi, golden_row(n));
    }
}

/* ---- voltage trim ---- */

void test_trim_asks_for_more_d_current_where_voltage_is_short_and_gives_it_back(void)
{
    static const struct {
        const char *what;
        int16_t before, free_q14, speed_erpm, after;
    } cases[] = {
        { "short of voltage", 0, 299, 8001, -2 },
        { "outside the circle, backwards", -2, -50, -8001, -4 },
        { "at its limit", -101, 0, 20000, -101 },
        { "nearly at its limit", -100, 0, 20000, -101 },
        { "voltage is free", -10, 300, 20000, -8 },
        { "speed is low", -10, 0, 8000, -8 },
        { "speed is low, backwards", -10, 0, -8000, -8 },
        { "nearly nothing is left", -1, 1000, 20000, 0 },
        { "nothing is left", 0, 1000, 20000, 0 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        fw.trim_q13 = cases[n].before;
        fieldweak_trim(&fw, &params, cases[n].free_q14, cases[n].speed_erpm);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].after, fw.trim_q13, cases[n].what);
    }
}
