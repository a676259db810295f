/* Field weakening by table: start speed, every index, interpolation, the end and beyond, the back-EMF's filter, and the voltage trim. */
#include "control/motor_model.h"
#include "golden.h"
#include "golden_emf_filter.h"
#include "golden_fieldweak_params.h"
#include "golden_fieldweak_quick.h"
#include "unity.h"

static fieldweak_params_t params;
static motor_model_t tuning;
static fieldweak_t fw;

void setUp(void)
{
    static const fieldweak_t zero;
    golden_fieldweak_params(&params);
    params.kfilter_esdq_q16 = 2400;
    params.kfilter_esdq_fw_q16 = 328;
    params.esdq_per_erpm_q13 = 14055u; /* 50 us */
    params.trim_max_q13 = 101;
    params.trim_step_q13 = 4;
    params.trim_most_q13 = 24;
    params.trim_speed_erpm = 8000;
    fw = zero;
}

static void look_up(int16_t ref_erpm)
{
    fieldweak_tick(&fw, &params, &tuning, ref_erpm);
}

/** What the table gave, against a golden row of either table. */
#define EXPECT_ROW(v, n) \
    do { \
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((v).index, fw.index, golden_row(n)); \
        TEST_ASSERT_EQUAL_INT16_MESSAGE((v).idref, fw.table_q13, golden_row(n)); \
        TEST_ASSERT_EQUAL_INT16_MESSAGE((v).inv_kfi, tuning.inv_kfi, golden_row(n)); \
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((v).ls_q16, tuning.ls_q16, golden_row(n)); \
        if ((v).above) { \
            TEST_ASSERT_EQUAL_INT16_MESSAGE(328, tuning.kfilter_esdq_q16, golden_row(n)); \
        } \
    } while (0)

void test_look_ups_equal_the_reference_in_both_directions(void)
{
    TEST_ASSERT_EQUAL_INT(18, FIELDWEAK_ENTRIES); /* AN1292's */
    TEST_ASSERT_EQUAL_UINT32(18u, GOLDEN_FIELDWEAK_TABLES_ROWS);
    GOLDEN_EACH(fieldweak, v)
    {
        for (int16_t direction = 1; direction >= -1; direction = (int16_t)(direction - 2)) {
            look_up((v.ref == INT16_MIN) ? v.ref : (int16_t)(direction * v.ref));
            EXPECT_ROW(v, n);
        }
    }
}

void test_a_step_of_the_table_stays_1024_electrical_rpm_where_a_count_of_speed_is_more_than_one(void)
{
    GOLDEN_EACH(fieldweak_quick, v)
    {
        params.index_per_count_q16 = (uint16_t)(v.unit * (65536u >> SPEED_INDEX_CONST));
        look_up(v.ref);
        EXPECT_ROW(v, n);
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

/* ---- the back-EMF's filter ---- */

void test_filters_equal_the_reference(void)
{
    params.on_speed_erpm = 32767;
    GOLDEN_EACH(emf_filter, v)
    {
        params.kfilter_esdq_q16 = v.k;
        params.esdq_per_erpm_q13 = v.per_erpm;
        look_up(v.ref);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.filter, tuning.kfilter_esdq_q16, golden_row(n));
    }
}

void test_filter_is_as_quick_as_the_rotor_turns_between_its_floor_and_the_parameter(void)
{
    static const struct {
        const char *what;
        int16_t ref_erpm, filter;
    } cases[] = {
        { "the floor at standstill", 0, 256 },
        { "and up to 149 electrical rpm", 153, 256 },
        { "then in proportion, in eighths", 154, 264 },
        { "five times the electrical frequency: 62.5 Hz at 750", 750, 1280 },
        { "nearly all", 1398, 2392 },
        { "all of it", 1400, 2400 },
        { "at any speed above", 13000, 2400 },
        { "that of field weakening", 13001, 328 },
        { "whatever the speed", 32767, 328 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        look_up(cases[n].ref_erpm);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].filter, tuning.kfilter_esdq_q16, cases[n].what);
        look_up((int16_t)-cases[n].ref_erpm);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].filter, tuning.kfilter_esdq_q16, cases[n].what);
    }
}

/* ---- voltage trim ---- */

void test_trim_asks_for_more_d_current_where_voltage_is_short_and_gives_it_back(void)
{
    static const struct {
        const char *what;
        int16_t before, free_q14, speed_erpm, after;
    } cases[] = {
        { "a little short of voltage", 0, -1, 8001, -1 },
        { "by 8 counts", -2, -8, 8001, -3 },
        { "by 9", -2, -9, 8001, -4 },
        { "backwards", -2, -9, -8001, -4 },
        { "by 192: the most in a step", -2, -192, 8001, -26 },
        { "outside the circle, backwards", -2, -800, -8001, -26 },
        { "at its limit", -101, -300, 20000, -101 },
        { "nearly at its limit", -100, -300, 20000, -101 },
        { "just enough", -10, 0, 20000, -10 },
        { "and up to 7 counts more", -10, 7, 20000, -10 },
        { "8 counts more", -10, 8, 20000, -9 },
        { "voltage is free", -10, 32, 20000, -6 },
        { "and plenty", -10, 15700, 20000, -6 },
        { "speed is low", -10, -300, 8000, -6 },
        { "speed is low, backwards", -10, -300, -8000, -6 },
        { "nearly nothing is left", -1, 700, 20000, 0 },
        { "nothing is left", 0, 700, 20000, 0 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        fw.trim_q13 = cases[n].before;
        fieldweak_trim(&fw, &params, cases[n].free_q14, cases[n].speed_erpm);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].after, fw.trim_q13, cases[n].what);
    }
}
