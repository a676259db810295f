/* Adaptation of flux and resistance: it converges from wrong constants in both directions, shares by voltage, and stays in its bounds. */
#include "control/motor_model.h"
#include "golden.h"
#include "golden_adaptation.h"
#include "golden_adaptation_step.h"
#include "unity.h"

#define INV_KFI 7956

static adaptation_params_t params;
static adaptation_t learnt;

void setUp(void)
{
    static const adaptation_params_t p = {
        GOLDEN_ADAPTATION_STEP_RATE_Q16, GOLDEN_ADAPTATION_STEP_KFI_LEAST, GOLDEN_ADAPTATION_STEP_KFI_MOST, GOLDEN_ADAPTATION_STEP_RS_LEAST,
        GOLDEN_ADAPTATION_STEP_RS_MOST, GOLDEN_ADAPTATION_STEP_EMF_LEAST_Q12, GOLDEN_ADAPTATION_STEP_TURNED_Q12, GOLDEN_ADAPTATION_STEP_RS_BASE_Q16
    };
    static const adaptation_t zero;
    params = p;
    learnt = zero;
}

static void learn(int16_t e_d, int16_t e_q, int16_t ri)
{
    dq_t emf = { e_d, e_q };
    adaptation_learn(&learnt, &params, emf, ri);
}

static motor_model_t model_of(int16_t inv_kfi)
{
    motor_model_t model = { .rs_q16 = 0, .ls_q16 = 1234, .inv_kfi = inv_kfi, .emf_sum_max_q12 = 0, .kfilter_esdq_q16 = 4321 };
    adaptation_apply(&learnt, &params, &model);
    return model;
}

/* ---- against the reference ---- */

void test_steps_equal_the_reference(void)
{
    GOLDEN_EACH(adaptation_step, v) {
        motor_model_t model;
        learnt.kfi_q31 = v.kfi0;
        learnt.rs_q31 = v.rs0;
        learn(v.e_d, v.e_q, v.ri);
        model = model_of(v.inv_kfi0);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.kfi, learnt.kfi_q31, golden_row(n));
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.rs, learnt.rs_q31, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.inv_kfi, model.inv_kfi, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(v.rs_q16, model.rs_q16, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.emf_max, model.emf_sum_max_q12, golden_row(n));
    }
}

void test_sequences_equal_the_reference(void)
{
    params.rate_q16 = GOLDEN_ADAPTATION_RATE_Q16;
    GOLDEN_EACH(adaptation, v) {
        if (v.start) {
            learnt.kfi_q31 = 0;
            learnt.rs_q31 = 0;
        }
        learn(v.e_d, v.e_q, v.ri);
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.kfi, learnt.kfi_q31, golden_row(n));
        TEST_ASSERT_EQUAL_INT32_MESSAGE(v.rs, learnt.rs_q31, golden_row(n));
    }
}

/* ---- convergence: a motor in lock, where Eq -+ Ed is the speed over 1/Kphi ---- */

/** Steps at a speed and a current of a motor with other constants than the header's, in percent of them. */
static void run(int16_t kphi_percent, int16_t rs_percent, int16_t erpm, int16_t iq_q13, uint16_t steps)
{
    while (steps-- != 0u) {
        motor_model_t model = model_of(INV_KFI);
        int16_t ri = qm_mulhi_su(iq_q13, (uint16_t)((int32_t)params.rs_base_q16 * rs_percent / 100));
        int16_t ri_known = qm_mulhi_su(iq_q13, model.rs_q16);
        int16_t total = (int16_t)((int32_t)erpm * 2048 / INV_KFI * kphi_percent / 100 + ri - ri_known);
        int16_t seen = (int16_t)((int32_t)erpm * 2048 / model.inv_kfi);
        /* to first order, which is where it settles: Eq keeps its size and Ed makes up the sum */
        learn((int16_t)((erpm > 0) ? total - seen : seen - total), total, ri_known);
    }
}

/** Change in thousandths of the header's value. */
static int16_t per_mille(int32_t x_q31)
{
    return (int16_t)((int32_t)qm_hi(x_q31) * 1000 / 32768);
}

void test_flux_and_resistance_are_found_in_both_directions_and_while_braking(void)
{
    static const struct {
        const char *what;
        int16_t kphi_percent, rs_percent, kfi_per_mille, rs_per_mille;
    } cases[] = {
        { "right", 100, 100, 0, 0 },
        { "weak magnets", 80, 100, 250, 0 },
        { "strong magnets", 120, 100, -167, 0 },
        { "a cold winding", 100, 70, 0, -300 },
        { "a hot winding", 100, 150, 0, 500 },
        { "a hot motor", 80, 150, 250, 500 },
        { "another motor", 120, 70, -167, -300 },
    };
    for (unsigned n = 0; n < 4u * sizeof cases / sizeof cases[0]; n++) {
        int16_t direction = (n & 1u) ? -1 : 1, load = (int16_t)((n & 2u) ? -2000 : 2000);
        int16_t kphi = cases[n / 4u].kphi_percent, rs = cases[n / 4u].rs_percent;
        uint16_t round;
        setUp();
        params.rate_q16 = (int16_t)(5 * params.rate_q16 / 2); /* for two fifths of the steps */
        for (round = 0; round < 16u; round++) {
            run(kphi, rs, (int16_t)(direction * 5000), (int16_t)(direction * 300), 50);
            run(kphi, rs, (int16_t)(direction * 2500), (int16_t)(direction * load), 100);
        }
        TEST_ASSERT_INT16_WITHIN_MESSAGE(8, cases[n / 4u].kfi_per_mille, per_mille(learnt.kfi_q31), cases[n / 4u].what);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(16, cases[n / 4u].rs_per_mille, per_mille(learnt.rs_q31), cases[n / 4u].what);
    }
}

void test_flux_settles_in_half_a_second_without_load(void)
{
    run(80, 100, 2500, 60, 313);
    TEST_ASSERT_INT16_WITHIN(25, 250, per_mille(learnt.kfi_q31));
    setUp();
    run(120, 100, -2500, -60, 313);
    TEST_ASSERT_INT16_WITHIN(25, -167, per_mille(learnt.kfi_q31));
}

/* ---- one step ---- */

void test_directions_of_a_step(void)
{
    static const struct {
        const char *what;
        int16_t e_d, e_q, ri, kfi, rs; /* signs */
    } cases[] = {
        { "Ed ahead: 1/Kphi falls, R rises", 100, 1000, 500, -1, 1 },
        { "Ed behind", -100, 1000, 500, 1, -1 },
        { "backwards Ed means the same", 100, -1000, -500, -1, 1 },
        { "and behind", -100, -1000, -500, 1, -1 },
        { "braking turns R's share", 100, 1000, -500, -1, -1 },
        { "and backwards", 100, -1000, 500, -1, -1 },
        { "braking, Ed behind", -100, -1000, 500, 1, 1 },
        { "right", 0, 1000, 500, 0, 0 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        setUp();
        learn(cases[n].e_d, cases[n].e_q, cases[n].ri);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].kfi, (learnt.kfi_q31 > 0) - (learnt.kfi_q31 < 0), cases[n].what);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].rs, (learnt.rs_q31 > 0) - (learnt.rs_q31 < 0), cases[n].what);
    }
}

void test_an_error_is_shared_by_voltage(void)
{
    static const int16_t cases[][3] = { { 1000, 0, 100 }, { 1000, 1000, 50 }, { 3000, 1000, 75 }, { 500, 1500, 25 }, { 1000, -250, 80 } };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        int16_t emf = cases[n][0], ri = cases[n][1], percent = cases[n][2];
        int32_t whole, by_r;
        setUp();
        learn(-100, emf, ri);
        whole = (int32_t)(INT32_C(100) * 32768 / (emf + qm_abs(ri))) * params.rate_q16;
        by_r = whole / 100 * (100 - percent);
        TEST_ASSERT_INT32_WITHIN_MESSAGE(whole / 100, whole / 100 * percent, learnt.kfi_q31, golden_row(n));
        TEST_ASSERT_INT32_WITHIN_MESSAGE(whole / 100, (ri > 0) ? -by_r : by_r, learnt.rs_q31, golden_row(n));
    }
}

/** Without current nothing holds R: rounding must not move it. */
void test_noise_moves_neither_flux_nor_resistance(void)
{
    static const int16_t noise[] = { 1, -1, 7, -7, 30, -30, 3, 0, -3 };
    uint16_t n;
    for (n = 0; n < 9000u; n++) {
        learn(noise[n % 9u], 643, (int16_t)(n / 9u % 3u * 10u));
    }
    TEST_ASSERT_EQUAL_INT32(0, learnt.kfi_q31);
    TEST_ASSERT_EQUAL_INT32(0, learnt.rs_q31);
}

void test_nothing_is_learnt_below_the_least_back_emf(void)
{
    learn(500, GOLDEN_ADAPTATION_STEP_EMF_LEAST_Q12 - 1, 500);
    learn(-500, 1 - GOLDEN_ADAPTATION_STEP_EMF_LEAST_Q12, 500);
    learn(500, 0, 0);
    TEST_ASSERT_EQUAL_INT32(0, learnt.kfi_q31);
    TEST_ASSERT_EQUAL_INT32(0, learnt.rs_q31);
    learn(500, GOLDEN_ADAPTATION_STEP_EMF_LEAST_Q12, 500);
    TEST_ASSERT_TRUE(learnt.kfi_q31 < 0 && learnt.rs_q31 > 0);
}

void test_changes_are_bounded(void)
{
    uint16_t n;
    for (n = 0; n < 20000u; n++) {
        learn(32767, 500, 500);
    }
    TEST_ASSERT_EQUAL_INT32((int32_t)GOLDEN_ADAPTATION_STEP_KFI_LEAST * 65536, learnt.kfi_q31);
    TEST_ASSERT_EQUAL_INT32((int32_t)GOLDEN_ADAPTATION_STEP_RS_MOST * 65536, learnt.rs_q31);
    for (n = 0; n < 20000u; n++) {
        learn(-32768, 500, 500);
    }
    TEST_ASSERT_EQUAL_INT32((int32_t)GOLDEN_ADAPTATION_STEP_KFI_MOST * 65536, learnt.kfi_q31);
    TEST_ASSERT_EQUAL_INT32((int32_t)GOLDEN_ADAPTATION_STEP_RS_LEAST * 65536, learnt.rs_q31);
}

/* ---- the model ---- */

void test_model_gets_what_was_learnt_within_its_formats_and_keeps_the_rest(void)
{
    static const struct {
        const char *what;
        q15_t kfi, rs;
        int16_t inv_kfi;
        uint16_t rs_base;
        int16_t inv_kfi_after;
        uint16_t rs_after;
    } cases[] = {
        { "nothing learnt", 0, 0, 7956, 28940u, 7956, 28940u },
        { "weak magnets, hot winding", 8192, 16384, 7956, 28940u, 9944, 43410u },
        { "strong magnets, cold winding", -6554, -9830, 7956, 28940u, 6364, 20258u },
        { "1/Kphi ends at 32767", 9830, 0, 30000, 28940u, 32767, 28940u },
        { "by one count", 11468, 0, 24274, 28940u, 32767, 28940u },
        { "a slow motor, below 2048", -6554, 0, 2000, 28940u, 1598, 28940u },
        { "and at 1024", -9830, 0, 1240, 28940u, 1024, 28940u },
        { "by one count", -6554, 0, 1279, 28940u, 1024, 28940u },
        { "R ends at its word", 0, 19660, 7956, 50000u, 7956, 65535u },
        { "by one count", 0, 9830, 7956, 50414u, 7956, 65535u },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        motor_model_t model;
        learnt.kfi_q31 = cases[n].kfi * INT32_C(65536);
        learnt.rs_q31 = cases[n].rs * INT32_C(65536);
        params.rs_base_q16 = cases[n].rs_base;
        model = model_of(cases[n].inv_kfi);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].inv_kfi_after, model.inv_kfi, cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].rs_after, model.rs_q16, cases[n].what);
        TEST_ASSERT_TRUE_MESSAGE((int32_t)model.emf_sum_max_q12 * model.inv_kfi <= INT32_C(32767) * 2048, cases[n].what);
        TEST_ASSERT_TRUE_MESSAGE(model.emf_sum_max_q12 == 32767 || ((int32_t)model.emf_sum_max_q12 + 1) * model.inv_kfi > INT32_C(32767) * 2048,
                                 cases[n].what);
        TEST_ASSERT_EQUAL_UINT16(1234u, model.ls_q16);
        TEST_ASSERT_EQUAL_INT16(4321, model.kfilter_esdq_q16);
    }
}
