/* A salient motor in the drive: what its d current means to the model, the load observer, the speed controller, the limits and the probe. */
#include "hurst_params.h"

#undef MOTOR_SALIENCY_UH
#define MOTOR_SALIENCY_UH 960 /* Ld is half of Lq, and 8.3 A double the flux */

#include "law.c"
#include "drive_rig.h"

#define ONE_Q13 8192

void setUp(void)
{
    rig_closed(1, 8000);
    drive.run.control.vq_limit_q14 = 16000; /* plenty of voltage */
    drive.run.control.iq_limit_q13 = params.current_max_q13;
}

/** The slow steps' model with this d current. */
static void flux_of(current_q13_t id_q13)
{
    drive.run.control.i_q13.d = id_q13;
    model_update(&drive, &params);
}

static current_q13_t tenth(void)
{
    return (int16_t)(params.salience_q13 / 10u);
}

/** Steps of the limits with a q current until the d reference stands. */
static void limits_settle(current_q13_t iq_q13)
{
    uint16_t n;
    drive.run.control.ref_q13.q = iq_q13;
    for (n = 0; n < 200u; n++) {
        limits_current(&drive.run, &params);
    }
}

/* ---- parameters ---- */

void test_current_that_doubles_the_flux_is_psi_over_the_difference_of_the_inductances(void)
{
    TEST_ASSERT_UINT16_WITHIN(2, CURRENT_Q13(7.9826e-3 / 960e-6), params.salience_q13);
}

/* ---- model ---- */

void test_start_knows_the_magnets_flux_alone(void)
{
    rig_start(1);
    TEST_ASSERT_EQUAL_UINT16(ONE_Q13, drive.run.salience.flux_q13);
    TEST_ASSERT_EQUAL_INT16(NORM_INVKFIBASE, drive.run.model.inv_kfi);
}

void test_kphi_follows_the_d_current_in_closed_loop(void)
{
    flux_of((int16_t)-tenth());
    TEST_ASSERT_INT16_WITHIN(2, (int16_t)(NORM_INVKFIBASE / 1.1F), drive.run.model.inv_kfi);
    TEST_ASSERT_INT16_WITHIN(2, (int16_t)(32767L * 2048 / drive.run.model.inv_kfi), drive.run.model.emf_sum_max_q12);
    flux_of(tenth()); /* counts half more */
    TEST_ASSERT_INT16_WITHIN(3, (int16_t)(NORM_INVKFIBASE / 0.85F), drive.run.model.inv_kfi);
    flux_of(0);
    TEST_ASSERT_EQUAL_INT16(NORM_INVKFIBASE, drive.run.model.inv_kfi);
}

void test_what_was_learnt_is_applied_to_it(void)
{
    drive.run.adaptation.kfi_q31 = 8192L * 65536; /* the flux is a fifth weaker: the d current counts a quarter more */
    flux_of((int16_t)-tenth());
    TEST_ASSERT_INT16_WITHIN(4, (int16_t)(NORM_INVKFIBASE * 1.25F / 1.125F), drive.run.model.inv_kfi);
}

void test_kphi_of_little_flux_stays_in_its_format(void)
{
    drive_params_t weak = params;
    uint16_t n;
    for (n = 0; n < FIELDWEAK_ENTRIES; n++) {
        weak.fieldweak.inv_kfi[n] = 30000;
    }
    drive.run.salience.id_q13 = (int16_t)(3 * tenth());
    drive_update_model(&drive.run, &weak, 8000, 8000);
    TEST_ASSERT_EQUAL_INT16(32767, drive.run.model.inv_kfi);
}

void test_forced_angle_s_current_counts_in_the_estimator_s_frame(void)
{
    static const struct {
        int16_t ahead; /* the forced frame's angle */
        float d;       /* of its q current; three quarters more along the flux */
    } cases[] = { { 0, 0.0F }, { 0x4000, -1.0F }, { -0x4000, 1.75F }, { 0x2000, -0.7071F } };
    rig_lock(1);
    drive.state = (uint16_t)DRIVE_RAMP;
    EACH(n, cases) {
        drive.angle = (angle_t)(estimator_next_angle(&drive.run.estimator) + (angle_t)cases[n].ahead);
        drive.run.control.i_q13.d = 0;
        drive.run.control.i_q13.q = 2000;
        model_update_in_ramp(&drive, &params);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(4, (int16_t)(2000.0F * cases[n].d), drive.run.salience.id_q13, golden_row(n));
    }
}

/* ---- torque ---- */

void test_observer_counts_torque(void)
{
    observer_t expected;
    flux_of((int16_t)-tenth());
    drive.run.control.i_q13.q = 1000;
    expected = drive.run.observer;
    observer_step(&expected, &params.observer, drive.run.estimator.rho_q32, (int16_t)(1000L * drive.run.salience.flux_q13 >> 13));
    TEST_ASSERT_INT16_WITHIN(1, 1100, (int16_t)(1000L * drive.run.salience.flux_q13 >> 13));
    handover_observe(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT32(expected.omega_q16, drive.run.observer.omega_q16);
    TEST_ASSERT_EQUAL_INT32(expected.load_q16, drive.run.observer.load_q16);
}

void test_observer_begins_with_the_hand_over_s_torque(void)
{
    flux_of((int16_t)-tenth());
    drive.run.handover.phase = (uint16_t)START_OBSERVE;
    drive.run.control.ref_q13.q = 1000;
    handover_observe(&drive.run, &params);
    TEST_ASSERT_INT16_WITHIN(2, 1100, observer_load(&drive.run.observer, &params.observer));
    TEST_ASSERT_INT16_WITHIN(2, 1000, speed_current(&drive.run, &params, observer_speed(&drive.run.observer)));
}

void test_speed_controller_s_limit_is_that_of_the_current(void)
{
    drive.run.control.speed_kp_q13 = 8192;
    EACH_DIRECTION(direction) {
        flux_of((int16_t)-tenth());
        TEST_ASSERT_EQUAL_INT16(direction * drive.run.control.iq_limit_q13, speed_current(&drive.run, &params, (int16_t)(direction * 32767)));
    }
}

/* ---- limits ---- */

void test_d_reference_comes_to_the_least_current_in_both_directions(void)
{
    EACH_DIRECTION(direction) {
        float half = 0.5F * (float)params.salience_q13, i_q = 4000.0F;
        limits_settle((int16_t)(direction * 4000));
        /* d^2 + 2 half d = i_q^2 */
        TEST_ASSERT_INT16_WITHIN(9, 0, (int16_t)(((float)drive.run.control.ref_q13.d * ((float)drive.run.control.ref_q13.d - 2.0F * half) - i_q * i_q) / (2.0F * half)));
        TEST_ASSERT_LESS_THAN_INT16(-900, drive.run.control.ref_q13.d);
    }
}

void test_field_weakening_s_d_current_takes_its_place_where_it_is_more_and_the_trim_adds(void)
{
    int16_t least;
    limits_settle(4000);
    least = drive.run.control.ref_q13.d;
    drive.run.fieldweak.table_q13 = (int16_t)(least + 100);
    limits_settle(4000);
    TEST_ASSERT_EQUAL_INT16(least, drive.run.control.ref_q13.d);
    drive.run.fieldweak.table_q13 = (int16_t)(least - 100);
    limits_settle(4000);
    TEST_ASSERT_EQUAL_INT16(least - 100, drive.run.control.ref_q13.d);
    drive.run.fieldweak.trim_q13 = -500;
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(least - 100 - 500 + params.fieldweak.trim_step_q13, drive.run.control.ref_q13.d);
}

void test_probe_has_no_least_current_beside_it(void)
{
    limits_settle(4000);
    drive.run.probe_id_q13 = 700;
    limits_settle(4000);
    TEST_ASSERT_EQUAL_INT16(700, drive.run.control.ref_q13.d);
}

/* ---- probe ---- */

void test_probe_leaves_the_torque(void)
{
    int16_t asked;
    for (asked = 0; asked <= 4000; asked = (int16_t)(asked + 500)) {
        float d, q_square, reluctance, least;
        uint16_t n;
        flux_of(0);
        drive.run.control.ref_q13.q = asked;
        for (n = 0; n < 50u; n++) {
            drive.run.probe_most_q13 = protection_probe_most(&drive.run, &params);
        }
        d = (float)drive.run.probe_most_q13;
        q_square = (float)params.current_max_q13 * (float)params.current_max_q13 - d * d;
        reluctance = 1.0F - d / (float)params.salience_q13;
        least = 0.99F * (float)asked;
        TEST_ASSERT_TRUE_MESSAGE(reluctance > 0.0F && q_square * reluctance * reluctance > least * least, golden_row((uint32_t)asked));
        TEST_ASSERT_TRUE_MESSAGE(d > 0.29F * (float)params.current_max_q13, golden_row((uint32_t)asked));
        TEST_ASSERT_TRUE_MESSAGE(asked > 2500 || d > 0.68F * (float)params.current_max_q13, golden_row((uint32_t)asked));
    }
}
