/* What the running motor teaches: when it may, what it sees, and what becomes of it. */
#include "drive_rig.h"

/** In lock at 5000 erpm with 0.5 A and an Ed that says something; the adaptation may learn. */
static void teachable(int16_t direction)
{
    rig_closed(direction, (int16_t)(direction * 5000));
    drive.run.control.i_q13.q = (int16_t)(direction * CURRENT_Q13(0.5));
    drive.run.control.ref_q13.q = drive.run.control.i_q13.q;
    drive.run.control.v_q14.q = (int16_t)(direction * 4000);
    drive.run.control.vq_limit_q14 = 15000;
    drive.run.estimator.e_q_q28 = (int32_t)direction * 600 * 65536;
    drive.run.estimator.e_d_q28 = 60L * 65536;
}

/** 1 if a step learns. */
static int16_t learns(void)
{
    adaptation_t before = drive.run.adaptation;
    model_learn_step(&drive.run, &params);
    return (int16_t)(drive.run.adaptation.kfi_q31 != before.kfi_q31 || drive.run.adaptation.rs_q31 != before.rs_q31);
}

/** R of the model over the header's. */
static float rs_in_use(void)
{
    return (float)drive.run.model.rs_q16 / (float)params.adaptation.rs_base_q16;
}

void setUp(void)
{
    teachable(1);
}

/* ---- when ---- */

void test_motor_in_lock_at_an_even_speed_teaches(void)
{
    EACH_DIRECTION(direction) {
        teachable(direction);
        TEST_ASSERT_EQUAL_INT16(1, learns());
        TEST_ASSERT_LESS_THAN_INT32(0, drive.run.adaptation.kfi_q31); /* Ed above zero: 1/Kphi is too large, or R too small */
        TEST_ASSERT_GREATER_THAN_INT32(0, drive.run.adaptation.rs_q31);
    }
}

void test_it_rests_until_the_observer_runs(void)
{
    drive.run.handover.phase = (uint16_t)START_OBSERVE;
    TEST_ASSERT_EQUAL_INT16(0, learns());
}

void test_it_rests_while_the_speed_changes_fast(void)
{
    drive.run.observer.fast_share_q15 = 4096;
    TEST_ASSERT_EQUAL_INT16(0, learns());
    drive.run.observer.fast_share_q15 = 4095;
    TEST_ASSERT_EQUAL_INT16(1, learns());
}

void test_it_rests_at_the_voltage_limit(void)
{
    EACH_DIRECTION(direction) {
        drive.run.control.v_q14.q = (int16_t)(direction * 15000);
        TEST_ASSERT_EQUAL_INT16(0, learns());
        drive.run.control.v_q14.q = (int16_t)(direction * 14999);
        TEST_ASSERT_EQUAL_INT16(1, learns());
    }
}

void test_it_rests_at_the_current_limit(void)
{
    drive.run.control.iq_limit_q13 = 2000;
    EACH_DIRECTION(direction) {
        drive.run.control.ref_q13.q = (int16_t)(direction * 2000);
        TEST_ASSERT_EQUAL_INT16(0, learns());
        drive.run.control.ref_q13.q = (int16_t)(direction * 1999);
        TEST_ASSERT_EQUAL_INT16(1, learns());
    }
}

void test_it_rests_where_there_is_no_back_emf(void)
{
    drive.run.estimator.e_q_q28 = (params.adaptation.emf_least_q12 - 1) * 65536L;
    TEST_ASSERT_EQUAL_INT16(0, learns());
    drive.run.estimator.e_q_q28 = params.adaptation.emf_least_q12 * 65536L;
    TEST_ASSERT_EQUAL_INT16(1, learns());
}

void test_it_learns_every_32nd_period_of_the_closed_loop_only(void)
{
    static const drive_state_t states[] = { DRIVE_CLOSED, DRIVE_STOPPING, DRIVE_RAMP, DRIVE_STOPPED };
    EACH(n, states) {
        for (uint16_t part = 0; part < SLOW_PARTS; part++) {
            teachable(1);
            drive.state = (uint16_t)states[n];
            rig_slow(part);
            TEST_ASSERT_EQUAL_INT16_MESSAGE(part == 10u && n < 2u, drive.run.adaptation.kfi_q31 != 0, golden_row(n));
        }
    }
}

void test_in_the_ramp_flux_alone_is_learnt_every_8th_period_where_it_turns_the_estimator_that_agrees_or_is_waited_for(void)
{
    static const struct {
        int16_t at_end, agrees, off, sign, learns; /* sign: of Ed; learns: that of 1/Kphi's change */
    } cases[] = { { 0, 0, 1, 1, 0 }, { 0, 1, 1, 1, -1 }, { 1, 0, 1, 1, -1 }, { 1, 1, 1, 1, -1 }, { 0, 1, 0, 1, 0 }, { 1, 0, 0, 1, 0 }, { 0, 1, 1, -1, 1 }, { 1, 0, 1, -1, 1 }, { 0, 1, 0, -1, 0 }, { 0, 0, 1, -1, 0 } };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            int32_t before = 0;
            teachable(direction);
            drive.state = (uint16_t)DRIVE_RAMP;
            drive.run.estimator.e_d_q28 = (int32_t)cases[n].sign * (params.adaptation.emf_least_q12 + cases[n].off) * 65536;
            drive.forced.speed_q10 = cases[n].at_end ? params.forced.end_speed_q10 : params.forced.end_speed_q10 / 8 * 7;
            rig_speed((int16_t)(direction * (cases[n].agrees ? handover_forced_erpm(&drive, &params) : 0)));
            for (uint16_t part = 0; part < SLOW_PARTS; part++) {
                rig_slow(part);
                TEST_ASSERT_EQUAL_INT16_MESSAGE((part % 4u) == 0u ? cases[n].learns : 0, (drive.run.adaptation.kfi_q31 > before) - (drive.run.adaptation.kfi_q31 < before), golden_row(n));
                before = drive.run.adaptation.kfi_q31;
            }
            TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
        }
    }
}

void test_flux_of_the_ramp_stays_within_what_may_be_learnt(void)
{
    EACH_DIRECTION(sign) {
        teachable(1);
        drive.run.estimator.e_d_q28 = (int32_t)sign * 300 * 65536;
        for (uint16_t n = 0; n < 2000u; n++) {
            model_learn_flux(&drive.run, &params);
        }
        TEST_ASSERT_EQUAL_INT16((sign > 0) ? params.adaptation.kfi_least : params.adaptation.kfi_most, qm_hi(drive.run.adaptation.kfi_q31));
    }
}

/** Field weakening off, the back-EMF's filter in full, and what was learnt: nothing waits for the hand-over. */
void test_in_the_ramp_the_model_is_that_of_the_end_speed_with_what_was_learnt(void)
{
    teachable(1);
    drive.state = (uint16_t)DRIVE_RAMP;
    drive.run.adaptation.kfi_q31 = 3277l * 65536; /* a tenth */
    drive.run.model.kfilter_esdq_q16 = 0;
    rig_slow(14);
    TEST_ASSERT_EQUAL_INT16(2 * KFILTER_ESDQ, drive.run.model.kfilter_esdq_q16);
    TEST_ASSERT_INT16_WITHIN(2, (int16_t)(1.1F * (float)params.fieldweak.inv_kfi[0]), drive.run.model.inv_kfi);
}

/* ---- what ---- */

void test_resistive_voltage_is_that_of_the_learnt_resistance_and_the_measured_current(void)
{
    /* 1 A at 2.67 ohm: 2.67 V of 13.3 V, 4096 counts full scale */
    static const struct {
        float change;
        uint16_t exp;
        int16_t ri_q12;
    } cases[] = { { 1.0F, 0, 822 }, { 1.5F, 0, 1233 }, { 0.7F, 0, 575 }, { 1.0F, 1, 1644 } };
    EACH(n, cases) {
        drive_params_t p = params;
        p.estimator.rs_exp = cases[n].exp;
        drive.run.model.rs_q16 = (uint16_t)(cases[n].change * (float)params.adaptation.rs_base_q16);
        EACH_DIRECTION(direction) {
            drive.run.control.i_q13.q = (int16_t)(direction * CURRENT_Q13(1.0));
            TEST_ASSERT_INT16_WITHIN_MESSAGE(3, (int16_t)(direction * cases[n].ri_q12), model_ri(&drive.run, &p), golden_row(n));
        }
    }
}

/* ---- what becomes of it ---- */

void test_what_was_learnt_comes_into_the_model_with_the_tables_and_a_start_forgets_it(void)
{
    int16_t inv_kfi = drive.run.model.inv_kfi;
    uint16_t rs_q16 = drive.run.model.rs_q16;
    drive.run.adaptation.kfi_q31 = -0x10000000l; /* 1/8 less */
    drive.run.adaptation.rs_q31 = 0x20000000l;   /* 1/4 more */
    rig_slow(14);
    TEST_ASSERT_INT16_WITHIN(2, (int16_t)(inv_kfi - inv_kfi / 8), drive.run.model.inv_kfi);
    TEST_ASSERT_UINT16_WITHIN(2, rs_q16 + rs_q16 / 4, drive.run.model.rs_q16);
    TEST_ASSERT_INT16_WITHIN(1, (int16_t)(INT32_C(32767) * 2048 / drive.run.model.inv_kfi), drive.run.model.emf_sum_max_q12);
    drive.command.run = 0;
    drive.state = (uint16_t)DRIVE_STOPPED;
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT16(inv_kfi, drive.run.model.inv_kfi);
    TEST_ASSERT_EQUAL_UINT16(rs_q16, drive.run.model.rs_q16);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.kfi_q31);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.adaptation.rs_q31);
}

/* ---- R of a start ---- */

void test_R_is_a_sixteenth_less_while_d_current_of_the_hand_over_is_left(void)
{
    drive.run.adaptation.rs_q31 = INT32_C(1) << 29; /* a quarter more than the header's */
    drive.run.handover.offset = -1;
    model_update(&drive, &params);
    TEST_ASSERT_FLOAT_WITHIN(0.001F, 1.25F * 15.0F / 16.0F, rs_in_use());
    drive.run.handover.offset = 0;
    model_update(&drive, &params);
    TEST_ASSERT_FLOAT_WITHIN(0.001F, 1.25F, rs_in_use());
}

void test_R_is_a_sixteenth_less_in_the_ramp_and_not_in_align(void)
{
    drive.run.adaptation.rs_q31 = 0;
    model_update(&drive, &params);
    drive.state = (uint16_t)DRIVE_ALIGN;
    model_update_in_ramp(&drive, &params);
    TEST_ASSERT_FLOAT_WITHIN(0.001F, 1.0F, rs_in_use());
    drive.state = (uint16_t)DRIVE_RAMP;
    model_update_in_ramp(&drive, &params);
    TEST_ASSERT_FLOAT_WITHIN(0.001F, 15.0F / 16.0F, rs_in_use());
}
