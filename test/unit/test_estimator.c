/* The PLL estimator block by block: Equation 4 and its spans, the sign rule, the filters, and the law of a wrong Kphi. */
#include "control/estimator.h"
#include "golden.h"
#include "unity.h"

/** Round numbers: Rs and Ls take 1/2 and 1/4 of their current. */
static estimator_params_t params;
static motor_model_t tuning;
static estimator_t e;
static uint16_t periods;

void setUp(void)
{
    static const estimator_params_t p = {
        .rs_exp = 0, .ls_exp = 0, .d_ilimit_ls_q14 = 6000, .d_ilimit_hs_q14 = 1000, .deltat_q32 = 3579,
        .half_step_q16_rad = 11244, .kfilter_velestim_q16 = 2958, .nominal_erpm = 14000, .decimate_erpm = 1400
    };
    static const motor_model_t t = {
        .rs_q16 = 32768u, .ls_q16 = 16384u, .inv_kfi = 7956, .emf_sum_max_q12 = 8434, .kfilter_esdq_q16 = 2400
    };
    static const estimator_t zero;
    params = p;
    tuning = t;
    e = zero;
    e.sign = 1;
    periods = 0;
}

/** 1 after every second period: the slow work follows. */
static uint16_t slow_is_due(void)
{
    return (uint16_t)((++periods & 1u) == 0u);
}

static dq_t rotating(int16_t d, int16_t q)
{
    dq_t x = { d, q };
    return x;
}

static alphabeta_t vector(int16_t alpha, int16_t beta)
{
    alphabeta_t x = { alpha, beta };
    return x;
}

static void filtered_speed(int16_t erpm)
{
    e.omega_filtered_q16 = (int32_t)erpm * 65536;
    estimator_choose_span(&e, &params);
}

static alphabeta_t e_q13;

static void back_emf(int16_t alpha, int16_t beta)
{
    e_q13 = estimator_back_emf(&e, &params, &tuning, vector(alpha, beta));
    if (slow_is_due()) {
        estimator_remember(&e);
    }
}

static void commanded(int16_t alpha, int16_t beta)
{
    estimator_commanded(&e, vector(alpha, beta));
}

static void expect_emf(int16_t alpha, int16_t beta)
{
    TEST_ASSERT_EQUAL_INT16(alpha, e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(beta, e_q13.beta);
}

/* ---- Equation 4: voltage and resistance ---- */

void test_acting_voltage_is_the_mean_of_the_last_two_vectors(void)
{
    commanded(8000, 8000); /* of three periods ago: does not count */
    commanded(3000, 400);
    commanded(1000, -2000);
    back_emf(0, 0);
    expect_emf(2000, -800);
    commanded(1001, 1); /* known with the vector itself; halves fall */
    TEST_ASSERT_EQUAL_INT16(1000, e.v_mean_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(-1000, e.v_mean_q13.beta);
    back_emf(0, 0);
    expect_emf(1000, -1000);
}

void test_resistive_drop_is_that_of_the_mean_of_two_currents(void)
{
    tuning.ls_q16 = 0;
    back_emf(2000, -4000);
    expect_emf(-500, 1000);
    back_emf(4000, -2000);
    expect_emf(-1500, 1500);
    params.rs_exp = 2; /* doubles twice */
    back_emf(4000, -2000);
    expect_emf(-8000, 4000);
    params.rs_exp = 0;
    tuning.rs_q16 = 49152u; /* unsigned */
    back_emf(4000, -2000);
    expect_emf(-3000, 1500);
}

/* ---- Equation 4: inductance ---- */

/* A step at an odd period: 8 periods, and a quarter of it in two more, 8.5 in all; at an even one, which the history keeps at once, 7.5. */
void test_step_of_the_current_shows_in_one_span_as_inductive_voltage(void)
{
    static const struct {
        const char *what;
        int16_t speed, i_alpha, i_beta;
        uint16_t ls_exp;
        int16_t limit_hs, e_alpha, e_beta;
        uint16_t periods;
    } cases[] = {
        { "eight samples below nominal speed", 13999, 1000, -2000, 0, 1000, -250, 500, 8 },
        { "backwards", -13999, 1000, -2000, 0, 1000, -250, 500, 8 },
        { "one sample from nominal speed on: eight times the slope", 14000, 400, -800, 0, 1000, -800, 1600, 1 },
        { "backwards", -14000, 400, -800, 0, 1000, -800, 1600, 1 },
        { "eight-sample limit", 0, 7000, -7000, 0, 1000, -1500, 1500, 8 },
        { "eight-sample limit, other sign", 0, -7000, 7000, 0, 1000, 1500, -1500, 8 },
        { "just below the eight-sample limit", 0, 5996, -5996, 0, 1000, -1499, 1499, 8 },
        { "one-sample limit", 20000, 1500, -1500, 0, 1000, -2000, 2000, 1 },
        { "one-sample limit, other sign", 20000, -1500, 1500, 0, 1000, 2000, -2000, 1 },
        { "just below the one-sample limit", 20000, 999, -999, 0, 1000, -1998, 1998, 1 },
        { "largest one-sample limit fits its product", 20000, 8000, -8000, 0, 4095, -8190, 8190, 1 },
        { "exponent of Ls doubles the eight-sample derivative", 0, 1000, -2000, 1, 1000, -500, 1000, 8 },
        { "and the one-sample derivative", 20000, 100, -200, 3, 1000, -1600, 3200, 1 },
    };
    for (unsigned n = 0; n < 2u * sizeof cases / sizeof cases[0]; n++) {
        unsigned row = n / 2u;
        uint16_t even = n % 2u, whole = 0, rest = 0;
        setUp();
        periods = even;
        tuning.rs_q16 = 0;
        params.ls_exp = cases[row].ls_exp;
        params.d_ilimit_hs_q14 = cases[row].limit_hs;
        filtered_speed(cases[row].speed);
        back_emf(cases[row].i_alpha, cases[row].i_beta);
        while (e_q13.alpha == cases[row].e_alpha && whole < 20u) {
            TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[row].e_beta, e_q13.beta, cases[row].what);
            whole++;
            back_emf(cases[row].i_alpha, cases[row].i_beta);
        }
        while (e_q13.alpha != 0 && rest < 20u) { /* the upper words of the products fall */
            TEST_ASSERT_EQUAL_INT16_MESSAGE(-((cases[row].i_alpha >> 4) * (1 << cases[row].ls_exp)), e_q13.alpha, cases[row].what);
            TEST_ASSERT_EQUAL_INT16_MESSAGE(-((cases[row].i_beta >> 4) * (1 << cases[row].ls_exp)), e_q13.beta, cases[row].what);
            rest++;
            back_emf(cases[row].i_alpha, cases[row].i_beta);
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((cases[row].periods == 8u) ? 8u - even : 1u, whole, cases[row].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE((cases[row].periods == 8u) ? 2u : 0u, rest, cases[row].what);
    }
}

/* 6.5 periods before an even one, which is 7.5 before the first and 8.5 before the second of the two that use it. */
void test_both_derivatives_agree_on_a_slope_in_the_mean_of_two_periods(void)
{
    int16_t n;
    tuning.rs_q16 = 0;
    for (n = 1; n <= 20; n++) {
        int16_t even = (int16_t)(n & ~1);
        back_emf((int16_t)(100 * n), (int16_t)(-60 * n));
        TEST_ASSERT_EQUAL_INT16((even >= 8) ? 100 * even - 650 : 0, e.i_oldest_q14.alpha);
        TEST_ASSERT_EQUAL_INT16((even >= 8) ? -60 * even + 390 : 0, e.i_oldest_q14.beta);
    }
    expect_emf(-212, 128);
    back_emf(2100, -1260);
    expect_emf(-187, 113);
    filtered_speed(20000);
    back_emf(2200, -1320);
    expect_emf(-200, 120);
}

/** What the history holds of a sequence of currents after this period. */
static int16_t expected_oldest(const int16_t *i, int16_t period)
{
    int16_t even = (int16_t)(period & ~1);
    int16_t six = (int16_t)((even > 6) ? i[even - 6] : 0), eight = (int16_t)((even > 8) ? i[even - 8] : 0);
    return (int16_t)(six - (six >> 2) + (eight >> 2));
}

void test_oldest_current_is_three_quarters_of_six_periods_ago_and_a_quarter_of_eight(void)
{
    static const int16_t alpha[] = { 0, 17, 4001, -31, 16383, -16384, 5, -6, 7, -1, -16384, 16383, 250, -3, 2, 1, 16383, -9, 0, 4, 4 }; /* from period 1 on */
    static const int16_t beta[] = { 0, 3, -4001, 31, -16384, 16383, -5, 6, -7, 1, 16383, -16384, -250, 3, -2, -1, 16383, 9, 12, -4, -4 };
    for (uint16_t n = 1; n < sizeof alpha / sizeof alpha[0]; n++) {
        back_emf(alpha[n], beta[n]);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected_oldest(alpha, (int16_t)n), e.i_oldest_q14.alpha, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected_oldest(beta, (int16_t)n), e.i_oldest_q14.beta, golden_row(n));
    }
    TEST_ASSERT_EQUAL_INT16(2 - 0 + 62, e.i_oldest_q14.alpha); /* of periods 14 and 12: 2 and 250 */
    TEST_ASSERT_EQUAL_INT16(-2 + 1 - 63, e.i_oldest_q14.beta);
    back_emf(0, 0);
    back_emf(0, 0);
    TEST_ASSERT_EQUAL_INT16(16383 - 4095 + 0, e.i_oldest_q14.alpha); /* of 16 and 14 */
    TEST_ASSERT_EQUAL_INT16(16383 - 4095 - 1, e.i_oldest_q14.beta);
}

void test_frame_of_its_own_is_that_of_the_next_sample(void)
{
    for (uint16_t n = 0; n < 64u; n++) {
        e.next = (angle_t)(n * 1031u);
        e.rho_q32 = 0x55550000u;
        estimator_turn_frame(&e);
        TEST_ASSERT_EQUAL_INT16(trig_sincos(e.next).sin, e.own.sin);
        TEST_ASSERT_EQUAL_INT16(trig_sincos(e.next).cos, e.own.cos);
    }
}

void test_eight_sample_voltage_is_turned_forward_by_three_and_a_half_steps(void)
{
    static const struct {
        const char *what;
        int16_t turn, speed, i_alpha, i_beta;
        uint16_t ls_q16;
        int16_t e_alpha, e_beta;
    } cases[] = {
        { "alpha, 7000 / 65536 rad", 7000, 0, 4000, 0, 16384u, -1000, -106 },
        { "beta", 7000, 0, 0, 4000, 16384u, 106, -1000 },
        { "follows the sense of rotation", -7000, 0, 4000, 0, 16384u, -1000, 107 },
        { "half a radian", 32767, 0, 6000, 0, 65535u, -5999, -2999 },
        { "half a radian, backwards", -32767, 0, 6000, 0, 65535u, -5999, 3000 },
        { "one-sample voltage is not turned", 28000, 20000, 800, 0, 16384u, -1600, 0 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        setUp();
        tuning.rs_q16 = 0;
        tuning.ls_q16 = cases[n].ls_q16;
        e.old_turn_q16_rad = cases[n].turn;
        filtered_speed(cases[n].speed);
        back_emf(cases[n].i_alpha, cases[n].i_beta);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].e_alpha, e_q13.alpha, cases[n].what);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].e_beta, e_q13.beta, cases[n].what);
    }
}

void test_turn_of_the_eight_samples_follows_the_filtered_speed_up_to_half_a_radian(void)
{
    static const int16_t cases[][2] = { /* electrical rpm, 7 half steps of 11244 / 65536 a count */
        { 0, 0 }, { 5829, 7000 }, { -5829, -7007 }, { 27283, 32760 }, { 27289, 32767 }, { 32767, 32767 }, { -32767, -32767 }
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        filtered_speed(cases[n][0]);
        estimator_follow(&e, &params);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n][1], e.old_turn_q16_rad, golden_row(n));
    }
}

/* ---- Equation 2 and its sign ---- */

/** Speed of a steady filtered back-EMF at a filtered speed. */
static int16_t speed_of(int16_t e_d, int16_t e_q, int16_t filtered_erpm)
{
    setUp();
    e.e_d_q28 = (int32_t)e_d * 65536;
    e.e_q_q28 = (int32_t)e_q * 65536;
    filtered_speed(filtered_erpm);
    estimator_follow(&e, &params);
    estimator_pll(&e, &params, &tuning, rotating(e_d, e_q));
    return e.omega_erpm;
}

void test_speed_is_back_emf_over_Kphi_with_the_sign_of_Eq_or_of_the_filtered_speed(void)
{
    static const struct {
        const char *what;
        int16_t e_d, e_q, filtered, sum; /* Eq -+ Ed */
    } cases[] = {
        { "above a tenth of nominal speed Eq decides", 100, 1000, 1401, 900 },
        { "backwards", 100, -1000, -1401, -900 },
        { "even against the filtered speed", 100, -1000, 1401, -900 },
        { "backwards", 100, 1000, -1401, 900 },
        { "up to a tenth the filtered speed decides", 100, -1000, 1400, -1100 },
        { "backwards", 100, 1000, -1400, 1100 },
        { "both agree", 100, 1000, 1400, 900 },
        { "backwards", 100, -1000, -1400, -900 },
        { "standstill counts as forward", 100, 0, 0, -100 },
        { "so does no Eq", 100, 0, 2000, -100 },
        { "a count backwards is backwards", 100, 0, -1, 100 },
        { "speed stops short of the word", 0, 12000, 20000, 8434 },
        { "on both sides", 0, -12000, -20000, -8434 },
        { "also of a sum of 32000", -16000, 16000, 20000, 8434 },
        { "just short of it", 0, 8433, 20000, 8433 },
    };
    for (unsigned n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        int16_t speed = speed_of(cases[n].e_d, cases[n].e_q, cases[n].filtered);
        TEST_ASSERT_EQUAL_INT16_MESSAGE((int32_t)cases[n].sum * 7956 >> 11, speed, cases[n].what);
    }
    TEST_ASSERT_INT16_WITHIN(3, 5000, speed_of(0, 1287, 5000)); /* 4.180 V of phase back-EMF at 1000 rpm */
}

/* ---- Equation 7 ---- */

void test_filters_make_their_share_of_the_way(void)
{
    static const int16_t before[] = { 4999, 5000, 4001, -4999, -5000, 32767, -32767 };
    for (unsigned n = 0; n < sizeof before / sizeof before[0]; n++) { /* in the mean of two periods, whose half count falls */
        (void)speed_of(0, (int16_t)((before[n] == 32767) ? 8434 : 1287), 0);
        e.omega_before_erpm = before[n];
        estimator_filter_speed(&e, &params);
        TEST_ASSERT_EQUAL_INT32_MESSAGE((((int32_t)before[n] + e.omega_erpm) >> 1) * 2958, e.omega_filtered_q16, golden_row((uint16_t)n));
    }
    e.omega_filtered_q16 = 0;
    e.omega_erpm = 4999;
    e.omega_before_erpm = 5002;
    estimator_filter_speed(&e, &params);
    TEST_ASSERT_EQUAL_INT32(INT32_C(5000) * 2958, e.omega_filtered_q16);
    TEST_ASSERT_EQUAL_INT16(225, estimator_speed(&e));
    estimator_pll(&e, &params, &tuning, rotating(0, 1287));
    TEST_ASSERT_EQUAL_INT16(4999, e.omega_before_erpm);
    setUp();
    estimator_pll(&e, &params, &tuning, rotating(1000, -3000));
    TEST_ASSERT_EQUAL_INT32(INT32_C(1000) * 2400, e.e_d_q28);
    TEST_ASSERT_EQUAL_INT32(-INT32_C(3000) * 2400, e.e_q_q28);
    TEST_ASSERT_EQUAL_INT16(36, estimator_emf(&e).d);
    TEST_ASSERT_EQUAL_INT16(-110, estimator_emf(&e).q);
}

/* ---- lock, with a turning motor that carries no current ---- */

#define STEP_7500_Q32 UINT32_C(26843546) /* 7500 electrical rpm */
#define EMF_7500_Q13 3861                /* its back-EMF, twice the counts for inverse Park */

static uint32_t true_q32;

/** Runs closed periods at +-7500 electrical rpm. */
static void run_motor(int16_t direction, uint16_t count)
{
    sincos_t frame = trig_sincos(estimator_next_angle(&e));
    while (count-- != 0u) {
        uint64_t turn = (direction > 0) ? STEP_7500_Q32 : UINT64_C(0x100000000) - STEP_7500_Q32;
        true_q32 = (uint32_t)((true_q32 + turn) & UINT32_C(0xFFFFFFFF)); /* now the angle of this sample */
        alphabeta_t emf = estimator_back_emf(&e, &params, &tuning, vector(0, 0));
        estimator_track(&e, &params, &tuning, emf, frame);
        frame = trig_sincos(estimator_next_angle(&e));
        /* acts for the period centred on the next sample */
        estimator_commanded(&e, inverse_park(rotating(0, (int16_t)(direction * 2 * EMF_7500_Q13)),
                                             trig_sincos((angle_t)(((true_q32 + turn) >> 16) & 0xFFFFu))));
        if (slow_is_due()) {
            estimator_filter_speed(&e, &params);
            estimator_follow(&e, &params);
        }
    }
}

/** Rotor ahead of the estimate, both half a period after the last sample. */
static int16_t angle_error(int16_t direction)
{
    uint16_t half = (uint16_t)(STEP_7500_Q32 >> 17);
    uint16_t truth = (uint16_t)((true_q32 >> 16) + ((direction > 0) ? half : 65536u - half));
    return (int16_t)(uint16_t)(truth - (uint16_t)(e.rho_q32 >> 16));
}

/** A locked estimator, and from now on another Kphi. */
static void locked_then(int16_t inv_kfi, int16_t direction)
{
    setUp();
    true_q32 = (direction > 0) ? 0 : UINT32_C(0x20000000);
    filtered_speed((int16_t)(direction * 7500));
    run_motor(direction, 1500);
    tuning.inv_kfi = inv_kfi;
    tuning.emf_sum_max_q12 = (int16_t)qm_divud(UINT32_C(32767) * 2048u, (uint16_t)inv_kfi);
}

void test_angle_error_is_the_law_of_a_wrong_Kphi_in_both_directions(void)
{
    /* sqrt(2) sin(D + 45 deg) = K'/K, within half a degree */
    static const struct {
        const char *what;
        int16_t inv_kfi, error;
    } cases[] = {
        { "right", 7956, 0 },
        { "too small by a tenth leads by 5.0 degrees", 8752, -910 },
        { "too small by half leads by 24.3 degrees", 15912, -4423 },
        { "too large by a quarter lags by 17.1 degrees", 6365, 3116 },
    };
    for (unsigned n = 0; n < 2u * sizeof cases / sizeof cases[0]; n++) {
        int16_t direction = (n % 2u) ? -1 : 1;
        locked_then(cases[n / 2u].inv_kfi, direction);
        run_motor(direction, 2000);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(25, (int16_t)(direction * 7500), estimator_speed(&e), cases[n / 2u].what);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(91, cases[n / 2u].error, (int16_t)(direction * angle_error(direction)), cases[n / 2u].what);
    }
}

void test_Kphi_too_large_by_more_than_41_percent_has_no_lock(void)
{
    uint16_t n, slipped = 0;
    locked_then(5300, 1); /* 1.5 */
    for (n = 0; n < 200u; n++) {
        run_motor(1, 50);
        slipped = (uint16_t)(slipped + ((qm_abs(angle_error(1)) > 16384) ? 1u : 0u));
    }
    TEST_ASSERT_TRUE(slipped > 10u);
}

void test_lock_is_found_from_every_angle(void)
{
    uint16_t start;
    for (start = 0; start < 8u; start++) {
        setUp();
        true_q32 = (uint32_t)start << 29;
        run_motor(1, 4000);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(91, 0, angle_error(1), golden_row(start));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(25, 7500, estimator_speed(&e), golden_row(start));
    }
}
