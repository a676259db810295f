/* AN1292's watch variables: each shows its quantity in AN1292's format. */
/* defines: -DPARAMS_IN_RAM */
#include "hurst_params.h"

#include "firmware/board/watch.c"

#include "drive/param_init.h"
#include "unity.h"

drive_t board_drive;
request_t board_request;
static const drive_params_t fresh = DRIVE_PARAMS_INIT;
drive_params_t board_params = DRIVE_PARAMS_INIT;
retry_t board_retry;

void setUp(void)
{
    board_params = fresh;
    drive_init(&board_drive, &board_params);
}

void test_currents_are_Q15_of_full_scale_and_limited_to_it(void)
{
    drive_control_t *c = &board_drive.run.control;
    board_drive.phases_q13.a = CURRENT_Q13(1.41);
    board_drive.phases_q13.b = CURRENT_Q13(-1.41);
    c->i_q13.d = CURRENT_Q13(-0.5);
    c->i_q13.q = CURRENT_Q13(2.0);
    c->ref_q13.d = CURRENT_Q13(-1.0);
    c->ref_q13.q = CURRENT_Q13(1.5);
    watch_refresh();
    TEST_ASSERT_INT16_WITHIN(4, 10500, ParkParm.qIa); /* 1.41 A of 4.40 A; the drive's count is four of AN1292's */
    TEST_ASSERT_INT16_WITHIN(4, -10500, ParkParm.qIb);
    TEST_ASSERT_INT16_WITHIN(4, CURRENT_Q15(1.41), ParkParm.qIa);
    TEST_ASSERT_INT16_WITHIN(4, CURRENT_Q15(-0.5), ParkParm.qId);
    TEST_ASSERT_INT16_WITHIN(4, CURRENT_Q15(2.0), ParkParm.qIq);
    TEST_ASSERT_INT16_WITHIN(4, CURRENT_Q15(-1.0), CtrlParm.qVdRef);
    TEST_ASSERT_INT16_WITHIN(4, CURRENT_Q15(1.5), CtrlParm.qVqRef);
    TEST_ASSERT_EQUAL_INT16(CtrlParm.qVdRef, FdWeakParm.qIdRef);
    board_drive.phases_q13.a = 9000;
    board_drive.phases_q13.b = -9000;
    watch_refresh();
    TEST_ASSERT_EQUAL_INT16(32764, ParkParm.qIa);
    TEST_ASSERT_EQUAL_INT16(-32764, ParkParm.qIb);
}

void test_voltages_are_Q15_of_full_scale_and_back_emf_of_four_times_it(void)
{
    board_drive.run.control.v_q14.d = VOLTAGE_Q14(-3.0);
    board_drive.run.control.v_q14.q = VOLTAGE_Q14(10.0);
    board_drive.run.estimator.e_d_q28 = -1000L * 65536;
    board_drive.run.estimator.e_q_q28 = 4096L * 65536; /* full scale */
    watch_refresh();
    TEST_ASSERT_INT16_WITHIN(2, -7390, ParkParm.qVd); /* 3 V / 13.302 V * 32768 */
    TEST_ASSERT_INT16_WITHIN(2, 24634, ParkParm.qVq);
    TEST_ASSERT_EQUAL_INT16(-2000, EstimParm.qEsdf);
    TEST_ASSERT_EQUAL_INT16(8192, EstimParm.qEsqf);
    board_drive.run.control.v_q14.q = 20000;
    watch_refresh();
    TEST_ASSERT_EQUAL_INT16(32766, ParkParm.qVq);
}

void test_angles_are_65536_a_turn_and_speeds_electrical_rpm(void)
{
    board_drive.angle = 0xC123;
    board_drive.run.estimator.rho_q32 = 0xA1234567ul;
    board_drive.run.estimator.omega_filtered_q16 = 5000L * 65536 + 1;
    board_drive.run.estimator.omega_erpm = -4900;
    board_drive.run.control.reference_erpm = -12345;
    fieldweak_tick(&board_drive.run.fieldweak, &board_params.fieldweak, &board_drive.run.model, 27500);
    watch_refresh();
    TEST_ASSERT_EQUAL_HEX16(0xC123, ParkParm.qAngle);
    TEST_ASSERT_EQUAL_HEX16(0xA123, EstimParm.qRho);
    TEST_ASSERT_EQUAL_INT16(5000, EstimParm.qVelEstim);
    TEST_ASSERT_EQUAL_INT16(-4900, EstimParm.qOmegaMr);
    TEST_ASSERT_EQUAL_INT16(-12345, CtrlParm.qVelRef);
    TEST_ASSERT_EQUAL_INT16(14, FdWeakParm.qIndex);
    TEST_ASSERT_EQUAL_INT16(13000, FdWeakParm.qFwOnSpeed);
}

void test_motor_constants_are_shown_as_adaptation_and_a_debugger_left_them(void)
{
    watch_refresh();
    TEST_ASSERT_EQUAL_INT16(14470, MotorEstimParm.qRs);
    TEST_ASSERT_INT16_WITHIN(1, 1626, MotorEstimParm.qLsDt);
    TEST_ASSERT_EQUAL_INT16(7956, MotorEstimParm.qInvKFi);
    TEST_ASSERT_EQUAL_INT16(1790, MotorEstimParm.qDeltaT);
    board_drive.run.model.ls_q16 = (uint16_t)(board_drive.run.model.ls_q16 / 2u);
    board_drive.run.model.inv_kfi = 12345;
    board_drive.run.model.rs_q16 = 20001;
    board_params.estimator.deltat_q32 = 1234;
    watch_refresh();
    TEST_ASSERT_EQUAL_INT16(10000, MotorEstimParm.qRs);
    TEST_ASSERT_INT16_WITHIN(1, 813, MotorEstimParm.qLsDt);
    TEST_ASSERT_EQUAL_INT16(12345, MotorEstimParm.qInvKFi);
    TEST_ASSERT_EQUAL_INT16(617, MotorEstimParm.qDeltaT);
}

void test_resistance_beyond_AN1292s_format_reads_32767(void)
{
    board_drive.run.model.rs_q16 = 65535u;
    watch_refresh();
    TEST_ASSERT_EQUAL_INT16(32767, MotorEstimParm.qRs);
    board_drive.run.model.rs_q16 = 32768u;
    board_params.estimator.rs_exp = 1;
    watch_refresh();
    TEST_ASSERT_EQUAL_INT16(32767, MotorEstimParm.qRs);
}

void test_load_observer_shows_its_speed_and_the_current_that_holds_the_load(void)
{
    static const float loads_a[] = { 0.5F, -0.5F, 2.0F, 0.0F };
    for (uint16_t n = 0; n < 4u; n++) {
        int16_t load_q13 = (int16_t)(loads_a[n] / PARAM_F(NORM_CURRENT_CONST) / 4.0F);
        board_drive.run.observer.omega_q16 = -12345 * 65536L;
        board_drive.run.observer.load_q16 = qm_mulsu(load_q13, board_params.observer.per_current_q16);
        watch_refresh();
        TEST_ASSERT_EQUAL_INT16(-12345, LoadParm.qVel);
        TEST_ASSERT_INT16_WITHIN(8, CURRENT_Q15(loads_a[n]), LoadParm.qLoad);
    }
}

void test_changes_of_flux_and_resistance_are_Q15_of_the_header_s(void)
{
    watch_refresh();
    TEST_ASSERT_EQUAL_INT16(0, AdaptParm.qInvKFi);
    TEST_ASSERT_EQUAL_INT16(0, AdaptParm.qRs);
    board_drive.run.adaptation.kfi_q31 = -0x10000000l; /* 1/8 less: the magnets are colder */
    board_drive.run.adaptation.rs_q31 = 0x20000000l;   /* 1/4 more */
    watch_refresh();
    TEST_ASSERT_EQUAL_INT16(-4096, AdaptParm.qInvKFi);
    TEST_ASSERT_EQUAL_INT16(8192, AdaptParm.qRs);
}

void test_1_over_Kphi_is_in_rpm_per_volt_by_the_formula_of_its_comment(void)
{
    float rpm_per_v;
    watch_refresh();
    rpm_per_v = (float)MotorEstimParm.qInvKFi / (float)NORM_INVKFIBASE * 1000.0F / PARAM_F(MOTOR_KPHI_V_PER_KRPM);
    TEST_ASSERT_FLOAT_WITHIN(0.02F, 138.12F, rpm_per_v);
}

void test_reasons_of_a_limit_are_those_of_now_and_those_seen_since_the_status_line_took_them(void)
{
    drive_control_t *c = &board_drive.run.control;
    LimitParm.seen = 0;
    watch_refresh();
    TEST_ASSERT_EQUAL_HEX16(0, LimitParm.now);
    board_drive.state = (uint16_t)DRIVE_CLOSED;
    c->iq_limit_q13 = 1000;
    c->brake_limit_q13 = 1000;
    c->ref_q13.q = 1000;
    c->vq_limit_q14 = 1000;
    watch_refresh();
    TEST_ASSERT_EQUAL_HEX16(LIMIT_CURRENT, LimitParm.now);
    c->ref_q13.q = 0;
    c->v_q14.q = 1000;
    watch_refresh();
    TEST_ASSERT_EQUAL_HEX16(LIMIT_VOLTAGE, LimitParm.now);
    TEST_ASSERT_EQUAL_HEX16(LIMIT_CURRENT | LIMIT_VOLTAGE, LimitParm.seen);
}

void test_retries_left_and_what_began_them(void)
{
    board_retry.left = 2;
    board_retry.first = (uint16_t)FAULT_STALL;
    watch_refresh();
    TEST_ASSERT_EQUAL_UINT16(2, RetryParm.left);
    TEST_ASSERT_EQUAL_UINT16(FAULT_STALL, RetryParm.first);
}
