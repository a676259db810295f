/* The estimator against the reference for thousands of periods: start, speed steps, reversal, a wrong Kphi; and its mirror. */
#include "control/estimator.h"
#include "golden.h"
#include "golden_estimator_kphi.h"
#include "golden_estimator_quick.h"
#include "golden_estimator_reversal.h"
#include "golden_estimator_speed.h"
#include "golden_estimator_start.h"
#include "unity.h"

/** An estimator and the frame that its own angle gives. */
typedef struct {
    estimator_t e;
    sincos_t frame;
    uint16_t periods;
} runner_t;

#define PARAMS(name) \
    { \
        .rs_exp = GOLDEN_##name##_RS_EXP, .ls_exp = GOLDEN_##name##_LS_EXP, \
        .d_ilimit_ls_q14 = GOLDEN_##name##_D_ILIMIT_LS_Q14, .d_ilimit_hs_q14 = GOLDEN_##name##_D_ILIMIT_HS_Q14, \
        .deltat_q32 = GOLDEN_##name##_DELTAT_Q32, .half_step_q16_rad = (uint16_t)GOLDEN_##name##_HALF_STEP_Q16_RAD, \
        .kfilter_velestim_q16 = GOLDEN_##name##_KFILTER_VELESTIM_Q16, .nominal_erpm = GOLDEN_##name##_NOMINAL_ERPM, \
        .decimate_erpm = GOLDEN_##name##_DECIMATE_ERPM \
    }
static const estimator_params_t hurst = PARAMS(ESTIMATOR_START), quick = PARAMS(ESTIMATOR_QUICK);
static const estimator_params_t *params;
static motor_model_t tuning;
static runner_t ahead, mirror;

static void reset(runner_t *r)
{
    static const estimator_t zero;
    r->e = zero;
    estimator_turn_frame(&r->e);
    r->frame = trig_sincos(0);
    r->periods = 0;
}

void setUp(void)
{
    params = &hurst;
    tuning.rs_q16 = GOLDEN_ESTIMATOR_START_RS_Q16;
    tuning.ls_q16 = (uint16_t)GOLDEN_ESTIMATOR_START_LS_Q16;
    tuning.kfilter_esdq_q16 = GOLDEN_ESTIMATOR_START_KFILTER_ESDQ_Q16;
    reset(&ahead);
    reset(&mirror);
}

/** One row: the tick, the angle of the next one, the vector for the modulator. */
static void period(runner_t *r, alphabeta_t i, alphabeta_t v, uint16_t closed, int16_t inv_kfi)
{
    tuning.inv_kfi = inv_kfi;
    tuning.emf_sum_max_q12 = (int16_t)qm_divud(UINT32_C(32767) * 2048u, (uint16_t)inv_kfi);
    alphabeta_t emf;
    emf = estimator_back_emf(&r->e, params, &tuning, i);
    if (closed) {
        estimator_track(&r->e, params, &tuning, emf, r->frame);
    } else {
        estimator_run_along(&r->e, params, &tuning, emf);
    }
    r->frame = trig_sincos(estimator_next_angle(&r->e));
    estimator_commanded(&r->e, v);
    if ((++r->periods & 1u) == 0u) {
        estimator_filter_speed(&r->e, params);
        estimator_follow(&r->e, params);
        estimator_turn_frame(&r->e);
    }
}

/* Rows of all sequences have the same members but their own types. */
#define ROW_PERIOD(r, row, sign, closed, kfi) do { \
    alphabeta_t i = { row.i_alpha, (int16_t)((sign) * row.i_beta) }, v = { row.v_alpha, (int16_t)((sign) * row.v_beta) }; \
    period(&(r), i, v, (uint16_t)(closed), kfi); \
} while (0)

#define BASE_KFI GOLDEN_ESTIMATOR_START_INV_KFI

/** @param kfi 1/Kphi of a row */
#define CHECK_SEQUENCE(name, closed_from, kfi) \
    GOLDEN_EACH(name, row) { \
        ROW_PERIOD(ahead, row, 1, n + 1u > (closed_from), kfi); \
        TEST_ASSERT_EQUAL_INT16_MESSAGE(row.omega, ahead.e.omega_erpm, golden_row(n)); \
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(row.rho, (uint16_t)(ahead.e.rho_q32 >> 16), golden_row(n)); \
    }

void test_start_ramp_and_change_of_frame_equal_the_reference(void)
{
    CHECK_SEQUENCE(estimator_start, GOLDEN_ESTIMATOR_START_CLOSED_FROM, BASE_KFI)
}

void test_lock_speed_steps_and_field_weakening_equal_the_reference(void)
{
    CHECK_SEQUENCE(estimator_speed, GOLDEN_ESTIMATOR_SPEED_CLOSED_FROM, BASE_KFI)
}

void test_reversal_through_standstill_equals_the_reference(void)
{
    CHECK_SEQUENCE(estimator_reversal, GOLDEN_ESTIMATOR_REVERSAL_CLOSED_FROM, BASE_KFI)
}

void test_wrong_Kphi_equals_the_reference(void)
{
    CHECK_SEQUENCE(estimator_kphi, GOLDEN_ESTIMATOR_KPHI_CLOSED_FROM, row.inv_kfi)
}

void test_1225_Hz_in_counts_of_4_electrical_rpm_equal_the_reference(void)
{
    params = &quick;
    tuning.rs_q16 = GOLDEN_ESTIMATOR_QUICK_RS_Q16;
    tuning.ls_q16 = (uint16_t)GOLDEN_ESTIMATOR_QUICK_LS_Q16;
    tuning.kfilter_esdq_q16 = GOLDEN_ESTIMATOR_QUICK_KFILTER_ESDQ_Q16;
    CHECK_SEQUENCE(estimator_quick, GOLDEN_ESTIMATOR_QUICK_CLOSED_FROM, GOLDEN_ESTIMATOR_QUICK_INV_KFI)
}

/** With beta negated it must turn the other way; rounding toward minus infinity leaves a few counts. */
void test_mirrored_speed_steps_turn_backwards_alike(void)
{
    GOLDEN_EACH(estimator_speed, row) {
        ROW_PERIOD(ahead, row, 1, 1, BASE_KFI);
        ROW_PERIOD(mirror, row, -1, 1, BASE_KFI);
        if (n >= 500u) {
            TEST_ASSERT_INT16_WITHIN_MESSAGE(25, (int16_t)-ahead.e.omega_erpm, mirror.e.omega_erpm, golden_row(n));
            TEST_ASSERT_INT16_WITHIN_MESSAGE(60, 0, (int16_t)(uint16_t)((mirror.e.rho_q32 >> 16) + (ahead.e.rho_q32 >> 16)), golden_row(n));
        }
    }
}
