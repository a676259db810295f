/* What the image leaves out because its parameters are constants: with all of them known the same comes out, wherever a limit or a table counts. */
#define QM_CONSTANT(x) 1

#include "control/adaptation.h"
#include "firmware/control/fieldweak.c"
#include "golden.h"
#include "golden_adaptation_step.h"
#include "golden_fieldweak_params.h"
#include "unity.h"

static fieldweak_params_t params;
static motor_model_t model;
static fieldweak_t fw;

void setUp(void)
{
    static const fieldweak_t zero;
    golden_fieldweak_params(&params);
    fw = zero;
}

static void look_up(int16_t ref_erpm)
{
    const fieldweak_tables_t tables = fieldweak_tables(&params);
    fieldweak_tick(&fw, &params, &tables, &model, ref_erpm);
}

static adaptation_params_t bounds(q15_t kfi, q15_t rs_most, uint16_t rs_base_q16)
{
    adaptation_params_t p = { .kfi_least = (q15_t)-kfi, .kfi_most = kfi, .rs_most = rs_most, .rs_base_q16 = rs_base_q16 };
    return p;
}

static void apply(const adaptation_params_t *p, int16_t inv_kfi, q15_t kfi, q15_t rs)
{
    const adaptation_t learnt = { (int32_t)kfi * 65536, (int32_t)rs * 65536 };
    model.inv_kfi = inv_kfi;
    adaptation_apply(&learnt, p, &model);
}

/* ---- adaptation ---- */

void test_what_was_learnt_goes_to_the_model_as_by_the_reference(void)
{
    const adaptation_params_t p = {
        GOLDEN_ADAPTATION_STEP_RATE_Q16, GOLDEN_ADAPTATION_STEP_KFI_LEAST, GOLDEN_ADAPTATION_STEP_KFI_MOST, GOLDEN_ADAPTATION_STEP_RS_LEAST,
        GOLDEN_ADAPTATION_STEP_RS_MOST, GOLDEN_ADAPTATION_STEP_EMF_LEAST_Q12, GOLDEN_ADAPTATION_STEP_RS_BASE_Q16
    };
    GOLDEN_EACH(adaptation_step, v)
    {
        const adaptation_t learnt = { v.kfi, v.rs };
        model.inv_kfi = v.inv_kfi0;
        adaptation_apply(&learnt, &p, &model);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.inv_kfi, model.inv_kfi, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.rs_q16, model.rs_q16, golden_row(n));
    }
}

void test_a_change_that_reaches_no_limit_is_the_sum(void)
{
    const adaptation_params_t p = bounds(8192, 16384, 20000);
    apply(&p, 8000, 8192, 16384);
    TEST_ASSERT_EQUAL_INT16(10000, model.inv_kfi);
    TEST_ASSERT_EQUAL_UINT16(30000, model.rs_q16);
    TEST_ASSERT_EQUAL_INT16(32767ul * 2048ul / 10000ul, model.emf_sum_max_q12);
    apply(&p, 8000, -8192, -16384);
    TEST_ASSERT_EQUAL_INT16(6000, model.inv_kfi);
    TEST_ASSERT_EQUAL_UINT16(10000, model.rs_q16);
}

void test_a_change_that_may_reach_a_limit_ends_there(void)
{
    const adaptation_params_t p = bounds(8192, 16384, 60000);
    apply(&p, 30000, 8192, 16384);
    TEST_ASSERT_EQUAL_INT16(32767, model.inv_kfi);
    TEST_ASSERT_EQUAL_UINT16(65535, model.rs_q16);
    apply(&p, 1100, -8192, 0);
    TEST_ASSERT_EQUAL_INT16(ADAPTATION_KFI_LEAST, model.inv_kfi);
    TEST_ASSERT_EQUAL_INT16(32767, model.emf_sum_max_q12);
}

void test_the_largest_sum_follows_1_over_kphi_from_2048_on(void)
{
    const adaptation_params_t p = bounds(8192, 0, 20000);
    apply(&p, 2729, -8192, 0); /* 2730 is the first whose least is 2048 */
    TEST_ASSERT_EQUAL_INT16(2045, model.inv_kfi);
    TEST_ASSERT_EQUAL_INT16(32767, model.emf_sum_max_q12);
    apply(&p, 2800, -8192, 0);
    TEST_ASSERT_EQUAL_INT16(2100, model.inv_kfi);
    TEST_ASSERT_EQUAL_INT16(32767ul * 2048ul / 2100ul, model.emf_sum_max_q12);
}

/* ---- tables of field weakening ---- */

void test_tables_that_differ_are_looked_up_as_by_the_reference(void)
{
    GOLDEN_EACH(fieldweak, v)
    {
        look_up(v.ref);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.idref, fw.table_q13, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.inv_kfi, model.inv_kfi, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.ls_q16, model.ls_q16, golden_row(n));
    }
}

void test_a_table_of_one_value_is_that_value_at_every_speed(void)
{
    uint16_t n;
    int16_t ref_erpm;
    for (n = 0; n < FIELDWEAK_ENTRIES; n++) {
        params.idref_q13[n] = -300;
        params.inv_kfi[n] = 7956;
        params.ls_over2ls0_q15[n] = 16384;
    }
    for (ref_erpm = 0; ref_erpm < 30000; ref_erpm = (int16_t)(ref_erpm + 1000)) {
        look_up(ref_erpm);
        TEST_ASSERT_EQUAL_INT16(-300, fw.table_q13);
        TEST_ASSERT_EQUAL_INT16(7956, model.inv_kfi);
        TEST_ASSERT_EQUAL_UINT16(GOLDEN_FIELDWEAK_LS_BASE, model.ls_q16);
    }
    for (n = 0; n < FIELDWEAK_ENTRIES; n++) {
        params.ls_over2ls0_q15[n] = 8192;
    }
    look_up(20000);
    TEST_ASSERT_EQUAL_UINT16(GOLDEN_FIELDWEAK_LS_BASE / 2, model.ls_q16);
}

void test_one_other_entry_makes_a_table_differ(void)
{
    int16_t table[FIELDWEAK_ENTRIES] = { 0 };
    uint16_t n;
    TEST_ASSERT_TRUE(FIELDWEAK_FLAT(table));
    for (n = 0; n < FIELDWEAK_ENTRIES; n++) {
        table[n] = -1;
        TEST_ASSERT_FALSE_MESSAGE(FIELDWEAK_FLAT(table), golden_row(n));
        table[n] = 0;
    }
}
