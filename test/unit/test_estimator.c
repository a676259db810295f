/* The PLL estimator block by block: Equation 4 and its spans, the sign rule, the filters, and the law of a wrong Kphi. */
#include "control/estimator.h"
#include "golden.h"
#include "unity.h"

/** Round numbers: Rs and Ls take 1/2 and 1/4 of their current. */
static estimator_params_t params;
static estimator_tuning_t tuning;
static estimator_t e;

void setUp(void)
{
    static const estimator_params_t p = {
        .rs_q16 = 32768u, .rs_exp = 0, .ls_exp = 0, .d_ilimit_ls_q14 = 6000, .d_ilimit_hs_q14 = 1000, .deltat_q32 = 3579,
        .half_step_q16_rad = 11244, .kfilter_velestim_q16 = 1496, .nominal_erpm = 14000, .decimate_erpm = 1400
    };
    static const estimator_tuning_t t = { .ls_q16 = 16384u, .inv_kfi = 7956, .emf_sum_max_q12 = 8434, .kfilter_esdq_q16 = 2400 };
    static const estimator_t zero;
    params = p;
    tuning = t;
    e = zero;
}

void tearDown(void)
{
}

static alphabeta_t vector(int16_t alpha, int16_t beta)
{
    alphabeta_t x;
    x.alpha = alpha;
    x.beta = beta;
    return x;
}

static dq_t rotating(int16_t d, int16_t q)
{
    dq_t x;
    x.d = d;
    x.q = q;
    return x;
}

static void filtered_speed(int16_t erpm)
{
    e.omega_filtered_q16 = (int32_t)erpm * 65536;
}

static void back_emf(int16_t alpha, int16_t beta)
{
    estimator_back_emf(&e, &params, &tuning, vector(alpha, beta));
}

/* ---- Equation 4: voltage ---- */

void test_acting_voltage_is_the_mean_of_the_last_two_vectors(void)
{
    estimator_commanded(&e, vector(3000, 400));
    estimator_commanded(&e, vector(1000, -2000));
    back_emf(0, 0);
    TEST_ASSERT_EQUAL_INT16(2000, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(-800, e.e_q13.beta);
}

void test_vector_of_three_periods_ago_does_not_count(void)
{
    estimator_commanded(&e, vector(8000, 8000));
    estimator_commanded(&e, vector(500, 100));
    estimator_commanded(&e, vector(700, 300));
    back_emf(0, 0);
    TEST_ASSERT_EQUAL_INT16(600, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(200, e.e_q13.beta);
}

/* ---- Equation 4: resistance ---- */

void test_resistive_drop_is_that_of_the_mean_of_two_currents(void)
{
    tuning.ls_q16 = 0;
    back_emf(2000, -4000);
    TEST_ASSERT_EQUAL_INT16(-500, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(1000, e.e_q13.beta);
    back_emf(4000, -2000);
    TEST_ASSERT_EQUAL_INT16(-1500, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(1500, e.e_q13.beta);
}

void test_exponent_of_Rs_doubles_the_drop(void)
{
    tuning.ls_q16 = 0;
    params.rs_exp = 2;
    back_emf(2000, -4000);
    TEST_ASSERT_EQUAL_INT16(-2000, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(4000, e.e_q13.beta);
}

void test_resistance_above_half_is_taken_as_unsigned(void)
{
    tuning.ls_q16 = 0;
    params.rs_q16 = 49152u;
    back_emf(4000, 2000);
    TEST_ASSERT_EQUAL_INT16(-1500, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(-750, e.e_q13.beta);
}

/* ---- Equation 4: inductance ---- */

/** Periods in which a step of the current shows as inductive voltage, and its value, without turning and resistance. */
static uint16_t step_response(int16_t alpha, int16_t beta, alphabeta_t *first)
{
    uint16_t periods = 0;
    params.rs_q16 = 0;
    back_emf(alpha, beta);
    *first = e.e_q13;
    while (e.e_q13.alpha != 0 && periods < 20u) {
        TEST_ASSERT_EQUAL_INT16(first->alpha, e.e_q13.alpha);
        TEST_ASSERT_EQUAL_INT16(first->beta, e.e_q13.beta);
        periods++;
        back_emf(alpha, beta);
    }
    return periods;
}

void test_derivative_spans_exactly_eight_samples_below_nominal_speed(void)
{
    alphabeta_t v;
    filtered_speed(13999);
    TEST_ASSERT_EQUAL_UINT16(8, step_response(1000, -2000, &v));
    TEST_ASSERT_EQUAL_INT16(-250, v.alpha);
    TEST_ASSERT_EQUAL_INT16(500, v.beta);
    setUp();
    filtered_speed(-13999);
    TEST_ASSERT_EQUAL_UINT16(8, step_response(1000, -2000, &v));
}

void test_derivative_spans_one_sample_from_nominal_speed_on(void)
{
    alphabeta_t v;
    filtered_speed(14000);
    TEST_ASSERT_EQUAL_UINT16(1, step_response(400, -800, &v));
    TEST_ASSERT_EQUAL_INT16(-800, v.alpha); /* eight times the eight-sample slope */
    TEST_ASSERT_EQUAL_INT16(1600, v.beta);
    setUp();
    filtered_speed(-14000);
    TEST_ASSERT_EQUAL_UINT16(1, step_response(400, -800, &v));
}

void test_both_derivatives_agree_on_a_slope(void)
{
    int16_t n, slow;
    params.rs_q16 = 0;
    for (n = 1; n <= 20; n++) {
        back_emf((int16_t)(100 * n), (int16_t)(-60 * n));
    }
    slow = e.e_q13.alpha;
    TEST_ASSERT_EQUAL_INT16(-200, slow);
    TEST_ASSERT_EQUAL_INT16(120, e.e_q13.beta);
    filtered_speed(20000);
    back_emf(2100, -1260);
    TEST_ASSERT_EQUAL_INT16(slow, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(120, e.e_q13.beta);
}

void test_history_holds_eight_samples_in_a_ring(void)
{
    int16_t n;
    for (n = 1; n <= 20; n++) {
        back_emf(n, (int16_t)-n);
        TEST_ASSERT_EQUAL_UINT16((uint16_t)n & 7u, e.newest);
        TEST_ASSERT_EQUAL_INT16(n, e.history_q14[e.newest].alpha);
        TEST_ASSERT_EQUAL_INT16(-n, e.history_q14[e.newest].beta);
    }
}

void test_eight_sample_difference_is_limited_on_both_sides(void)
{
    alphabeta_t v;
    (void)step_response(7000, -7000, &v);
    TEST_ASSERT_EQUAL_INT16(-1500, v.alpha);
    TEST_ASSERT_EQUAL_INT16(1500, v.beta);
    setUp();
    (void)step_response(-7000, 7000, &v);
    TEST_ASSERT_EQUAL_INT16(1500, v.alpha);
    TEST_ASSERT_EQUAL_INT16(-1500, v.beta);
    setUp();
    (void)step_response(5996, -5996, &v);
    TEST_ASSERT_EQUAL_INT16(-1499, v.alpha);
    TEST_ASSERT_EQUAL_INT16(1499, v.beta);
}

void test_one_sample_difference_is_limited_on_both_sides(void)
{
    alphabeta_t v;
    filtered_speed(20000);
    (void)step_response(1500, -1500, &v);
    TEST_ASSERT_EQUAL_INT16(-2000, v.alpha);
    TEST_ASSERT_EQUAL_INT16(2000, v.beta);
    setUp();
    filtered_speed(20000);
    (void)step_response(-1500, 1500, &v);
    TEST_ASSERT_EQUAL_INT16(2000, v.alpha);
    TEST_ASSERT_EQUAL_INT16(-2000, v.beta);
    setUp();
    filtered_speed(20000);
    (void)step_response(999, -999, &v);
    TEST_ASSERT_EQUAL_INT16(-1998, v.alpha);
    TEST_ASSERT_EQUAL_INT16(1998, v.beta);
}

void test_largest_one_sample_limit_fits_its_product(void)
{
    alphabeta_t v;
    params.d_ilimit_hs_q14 = 4095;
    filtered_speed(20000);
    (void)step_response(8000, -8000, &v);
    TEST_ASSERT_EQUAL_INT16(-8190, v.alpha);
    TEST_ASSERT_EQUAL_INT16(8190, v.beta);
}

void test_exponent_of_Ls_doubles_both_derivatives(void)
{
    alphabeta_t v;
    params.ls_exp = 1;
    (void)step_response(1000, -2000, &v);
    TEST_ASSERT_EQUAL_INT16(-500, v.alpha);
    TEST_ASSERT_EQUAL_INT16(1000, v.beta);
    setUp();
    params.ls_exp = 3;
    filtered_speed(20000);
    (void)step_response(100, -200, &v);
    TEST_ASSERT_EQUAL_INT16(-1600, v.alpha);
    TEST_ASSERT_EQUAL_INT16(3200, v.beta);
}

void test_eight_sample_voltage_is_turned_forward_by_three_and_a_half_steps(void)
{
    params.rs_q16 = 0;
    e.half_step_q16_rad = 1000; /* 3.5 steps are 7000 / 65536 rad */
    back_emf(4000, 0);
    TEST_ASSERT_EQUAL_INT16(-1000, e.e_q13.alpha);
    TEST_ASSERT_INT16_WITHIN(1, -106, e.e_q13.beta);
    setUp();
    params.rs_q16 = 0;
    e.half_step_q16_rad = 1000;
    back_emf(0, 4000);
    TEST_ASSERT_INT16_WITHIN(1, 106, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(-1000, e.e_q13.beta);
}

void test_turn_follows_the_sense_of_rotation(void)
{
    params.rs_q16 = 0;
    e.half_step_q16_rad = -1000;
    back_emf(4000, 0);
    TEST_ASSERT_INT16_WITHIN(1, 107, e.e_q13.beta);
}

void test_turn_is_at_most_half_a_radian_both_ways(void)
{
    params.rs_q16 = 0;
    tuning.ls_q16 = 65535u;
    e.half_step_q16_rad = 9000;
    back_emf(6000, 0);
    TEST_ASSERT_EQUAL_INT16(-5999, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(-2999, e.e_q13.beta);
    setUp();
    params.rs_q16 = 0;
    tuning.ls_q16 = 65535u;
    e.half_step_q16_rad = -9000;
    back_emf(6000, 0);
    TEST_ASSERT_EQUAL_INT16(3000, e.e_q13.beta);
}

void test_one_sample_voltage_is_not_turned(void)
{
    params.rs_q16 = 0;
    filtered_speed(20000);
    e.half_step_q16_rad = 4000;
    back_emf(800, 0);
    TEST_ASSERT_EQUAL_INT16(-1600, e.e_q13.alpha);
    TEST_ASSERT_EQUAL_INT16(0, e.e_q13.beta);
}

void test_small_turn_is_counter_clockwise_for_a_positive_angle(void)
{
    alphabeta_t x = estimator_turn(vector(8000, 0), 6554); /* 0.1 rad */
    TEST_ASSERT_EQUAL_INT16(8000, x.alpha);
    TEST_ASSERT_INT16_WITHIN(1, 800, x.beta);
    x = estimator_turn(vector(0, 8000), 6554);
    TEST_ASSERT_INT16_WITHIN(1, -800, x.alpha);
    TEST_ASSERT_EQUAL_INT16(8000, x.beta);
}

/* ---- Equation 2 and its sign ---- */

/** Speed of a steady filtered back-EMF at a filtered speed. */
static int16_t speed_of(int16_t e_d, int16_t e_q, int16_t filtered_erpm)
{
    setUp();
    e.e_d_q28 = (int32_t)e_d * 65536;
    e.e_q_q28 = (int32_t)e_q * 65536;
    filtered_speed(filtered_erpm);
    estimator_pll(&e, &params, &tuning, rotating(e_d, e_q));
    return e.omega_erpm;
}

void test_speed_is_back_emf_over_Kphi(void)
{
    /* 1000 rpm: 4.180 V of phase back-EMF are 1287 counts; 5000 electrical rpm */
    TEST_ASSERT_INT16_WITHIN(3, 5000, speed_of(0, 1287, 5000));
    TEST_ASSERT_INT16_WITHIN(3, -5000, speed_of(0, -1287, -5000));
}

void test_above_a_tenth_of_nominal_speed_Eq_decides_the_sign(void)
{
    TEST_ASSERT_EQUAL_INT16(INT32_C(900) * 7956 / 2048, speed_of(100, 1000, 1401));
    TEST_ASSERT_EQUAL_INT16(speed_of(0, -900, -1401), speed_of(100, -1000, -1401));
    /* even against the filtered speed */
    TEST_ASSERT_EQUAL_INT16(speed_of(0, -900, 1401), speed_of(100, -1000, 1401));
    TEST_ASSERT_EQUAL_INT16(INT32_C(900) * 7956 / 2048, speed_of(100, 1000, -1401));
}

void test_up_to_a_tenth_of_nominal_speed_the_filtered_speed_decides_the_sign(void)
{
    TEST_ASSERT_EQUAL_INT16(speed_of(0, -1100, 0), speed_of(100, -1000, 1400));
    TEST_ASSERT_EQUAL_INT16(speed_of(0, 1100, 0), speed_of(100, 1000, -1400));
    TEST_ASSERT_EQUAL_INT16(speed_of(0, 900, 0), speed_of(100, 1000, 1400));
    TEST_ASSERT_EQUAL_INT16(speed_of(0, -900, 0), speed_of(100, -1000, -1400));
}

void test_standstill_counts_as_forward(void)
{
    TEST_ASSERT_EQUAL_INT16(speed_of(0, -100, 0), speed_of(100, 0, 0));
    TEST_ASSERT_EQUAL_INT16(speed_of(0, -100, 0), speed_of(100, 0, 2000));
}

void test_speed_stops_short_of_the_word_on_both_sides(void)
{
    TEST_ASSERT_INT16_WITHIN(10, 32760, speed_of(0, 12000, 20000));
    TEST_ASSERT_INT16_WITHIN(10, -32760, speed_of(0, -12000, -20000));
    TEST_ASSERT_INT16_WITHIN(10, 32760, speed_of(-16000, 16000, 20000));
    TEST_ASSERT_TRUE(speed_of(0, 8433, 20000) < speed_of(0, 8434, 20000));
}

/* ---- Equations 1 and 7 ---- */

void test_angle_advances_by_the_unfiltered_speed(void)
{
    (void)speed_of(0, 1287, 0);
    TEST_ASSERT_EQUAL_HEX32((uint32_t)qm_mulss(e.omega_erpm, 3579), e.rho_q32);
    /* 4999 electrical rpm: 273 counts a period */
    TEST_ASSERT_EQUAL_UINT16(273, (uint16_t)(e.rho_q32 >> 16));
}

void test_angle_turns_back_for_a_negative_speed(void)
{
    (void)speed_of(0, -1287, -5000);
    TEST_ASSERT_EQUAL_UINT16(65536u - 274u, (uint16_t)(e.rho_q32 >> 16));
}

void test_angle_wraps_at_a_turn(void)
{
    setUp();
    e.rho_q32 = UINT32_C(0xFFFF0000);
    e.e_q_q28 = INT32_C(1287) * 65536;
    estimator_pll(&e, &params, &tuning, rotating(0, 1287));
    TEST_ASSERT_EQUAL_UINT16(272, (uint16_t)(e.rho_q32 >> 16));
}

void test_half_step_is_half_the_angle_step_in_radians(void)
{
    (void)speed_of(0, 1287, 5000);
    TEST_ASSERT_INT16_WITHIN(1, 858, e.half_step_q16_rad); /* 0.026180 / 2 rad * 65536 */
    (void)speed_of(0, -1287, -5000);
    TEST_ASSERT_INT16_WITHIN(1, -858, e.half_step_q16_rad);
}

void test_speed_filter_makes_its_share_of_the_way(void)
{
    int16_t omega = speed_of(0, 1287, 0);
    TEST_ASSERT_EQUAL_INT32((int32_t)omega * 1496, e.omega_filtered_q16);
    TEST_ASSERT_EQUAL_INT16(114, estimator_speed(&e));
}

void test_back_emf_filter_makes_its_share_of_the_way_on_both_axes(void)
{
    estimator_pll(&e, &params, &tuning, rotating(1000, -3000));
    TEST_ASSERT_EQUAL_INT32(INT32_C(1000) * 2400, e.e_d_q28);
    TEST_ASSERT_EQUAL_INT32(-INT32_C(3000) * 2400, e.e_q_q28);
    TEST_ASSERT_EQUAL_INT16(36, estimator_emf(&e).d);
    TEST_ASSERT_EQUAL_INT16(-110, estimator_emf(&e).q);
}

void test_next_angle_is_half_a_step_ahead_both_ways(void)
{
    e.rho_q32 = UINT32_C(0x80000000);
    e.half_step_q16_rad = 6283; /* 1000 counts */
    TEST_ASSERT_UINT16_WITHIN(1, 32768u + 1000u, estimator_next_angle(&e));
    e.half_step_q16_rad = -6283;
    TEST_ASSERT_UINT16_WITHIN(1, 32768u - 1000u, estimator_next_angle(&e));
    e.rho_q32 = UINT32_C(0xFFFF8000);
    e.half_step_q16_rad = 6283;
    TEST_ASSERT_UINT16_WITHIN(1, 999u, estimator_next_angle(&e));
}

/* ---- frames ---- */

/** Filtered back-EMF after one tick with a steady voltage along an angle and the filter at one half. */
static dq_t emf_after(uint16_t closed, angle_t voltage_angle, angle_t frame_angle)
{
    alphabeta_t v = inverse_park(rotating(16000, 0), trig_sincos(voltage_angle));
    tuning.kfilter_esdq_q16 = 32767;
    estimator_commanded(&e, v);
    estimator_commanded(&e, v);
    estimator_tick(&e, &params, &tuning, vector(0, 0), trig_sincos(frame_angle), !closed);
    return estimator_emf(&e);
}

void test_free_estimator_uses_its_own_angle(void)
{
    dq_t emf;
    e.rho_q32 = UINT32_C(0x30000000);
    emf = emf_after(0, 0x3000u + 16384u, 0);
    TEST_ASSERT_INT16_WITHIN(4, 0, emf.d);
    TEST_ASSERT_INT16_WITHIN(4, 2000, emf.q);
}

void test_closed_estimator_uses_the_control_frame_turned_back_by_half_a_step(void)
{
    static const int16_t half_steps[] = { 0, 5243, -5243 }; /* 0.08 rad: 834 counts */
    uint16_t n;
    for (n = 0; n < 3u; n++) {
        dq_t emf;
        angle_t frame = (angle_t)(20000 + ((n == 0u) ? 0 : (n == 1u) ? 834 : -834));
        setUp();
        e.half_step_q16_rad = half_steps[n];
        e.rho_q32 = UINT32_C(0x12340000); /* plays no part */
        emf = emf_after(1, 20000u + 16384u, frame);
        TEST_ASSERT_INT16_WITHIN(4, 0, emf.d);
        TEST_ASSERT_INT16_WITHIN(8, 2000, emf.q);
    }
}

/* ---- lock, with a turning motor that carries no current ---- */

#define STEP_7500_Q32 UINT32_C(26843546) /* 7500 electrical rpm */
#define EMF_7500_Q13 3861                /* its back-EMF, twice the counts for inverse Park */

static uint32_t true_q32;

/** Runs closed periods at +-7500 electrical rpm. */
static void run_motor(int16_t direction, uint16_t periods)
{
    sincos_t frame = trig_sincos(estimator_next_angle(&e));
    while (periods-- != 0u) {
        uint64_t turn = (direction > 0) ? STEP_7500_Q32 : UINT64_C(0x100000000) - STEP_7500_Q32;
        true_q32 = (uint32_t)((true_q32 + turn) & UINT32_C(0xFFFFFFFF)); /* now the angle of this sample */
        estimator_tick(&e, &params, &tuning, vector(0, 0), frame, 0);
        frame = trig_sincos(estimator_next_angle(&e));
        /* acts for the period centred on the next sample */
        estimator_commanded(&e, inverse_park(rotating(0, (int16_t)(direction * 2 * EMF_7500_Q13)),
                                             trig_sincos((angle_t)(((true_q32 + turn) >> 16) & 0xFFFFu))));
    }
}

/** Rotor ahead of the estimate, both half a period after the last sample. */
static int16_t angle_error(int16_t direction)
{
    uint16_t half = (uint16_t)(STEP_7500_Q32 >> 17);
    uint16_t truth = (uint16_t)((true_q32 >> 16) + ((direction > 0) ? half : 65536u - half));
    return (int16_t)(uint16_t)(truth - (uint16_t)(e.rho_q32 >> 16));
}

static void kphi(int16_t inv_kfi)
{
    tuning.inv_kfi = inv_kfi;
    tuning.emf_sum_max_q12 = (int16_t)qm_divud(UINT32_C(32767) * 2048u, (uint16_t)inv_kfi);
}

/** Angle error times the direction, after lock in. */
static int16_t locked_error(int16_t inv_kfi, int16_t direction)
{
    setUp();
    true_q32 = (direction > 0) ? 0 : UINT32_C(0x20000000);
    filtered_speed((int16_t)(direction * 7500));
    run_motor(direction, 1500);
    kphi(inv_kfi);
    run_motor(direction, 2000);
    TEST_ASSERT_INT16_WITHIN(25, (int16_t)(direction * 7500), estimator_speed(&e));
    return (int16_t)(direction * angle_error(direction));
}

void test_right_Kphi_locks_on_the_rotor_in_both_directions(void)
{
    TEST_ASSERT_INT16_WITHIN(91, 0, locked_error(7956, 1)); /* half a degree */
    TEST_ASSERT_INT16_WITHIN(91, 0, locked_error(7956, -1));
}

/* sqrt(2) sin(D + 45 deg) = K'/K gives D = -5.0, -24.3 and +17.1 degrees */

void test_Kphi_too_small_by_a_tenth_leads_by_5_degrees(void)
{
    TEST_ASSERT_INT16_WITHIN(91, -910, locked_error(8752, 1));
    TEST_ASSERT_INT16_WITHIN(91, -910, locked_error(8752, -1));
}

void test_Kphi_too_small_by_half_leads_by_24_degrees(void)
{
    TEST_ASSERT_INT16_WITHIN(91, -4423, locked_error(15912, 1));
    TEST_ASSERT_INT16_WITHIN(91, -4423, locked_error(15912, -1));
}

void test_Kphi_too_large_by_a_quarter_lags_by_17_degrees(void)
{
    TEST_ASSERT_INT16_WITHIN(91, 3116, locked_error(6365, 1));
    TEST_ASSERT_INT16_WITHIN(91, 3116, locked_error(6365, -1));
}

void test_Kphi_too_large_by_more_than_41_percent_has_no_lock(void)
{
    uint16_t n, slipped = 0;
    (void)locked_error(7956, 1);
    kphi(5300); /* 1.5 */
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
