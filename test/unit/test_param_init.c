/* What of the parameter structure test_param_scaling.c does not see: bus levels, tables, the braking limit in use, another loop time. */
#include "drive_rig.h"
#include "unity.h"

void test_gains_and_offsets_of_the_samples(void)
{
    TEST_ASSERT_EQUAL_INT16(1024, params.offset_max_q13);
    TEST_ASSERT_EQUAL_INT16(-16384, params.kcurr_a);
    TEST_ASSERT_EQUAL_INT16(-16384, params.kcurr_b);
}

void test_the_ramp_waits_for_a_motor_that_is_an_eighth_of_nominal_speed_behind(void)
{
    TEST_ASSERT_EQUAL_INT16(1750, params.ramp_hold_erpm);
}

void test_bus_levels(void)
{
    TEST_ASSERT_EQUAL_INT16(14895, params.bus_nominal_q15); /* 24 / 52.8 */
    TEST_ASSERT_EQUAL_INT16(16756, params.bus_regen_q15);   /* 27 / 52.8 */
    TEST_ASSERT_EQUAL_INT16(21101, params.bus_over_q15);
    TEST_ASSERT_EQUAL_INT16(7447, params.bus_under_q15);
}

void test_field_weakening_tables_reach_the_drive(void)
{
    TEST_ASSERT_EQUAL_INT16(0, params.fieldweak.idref_q13[0]);
    TEST_ASSERT_EQUAL_INT16(CURRENT_Q13(IDREF_SPEED7), params.fieldweak.idref_q13[7]);
    TEST_ASSERT_EQUAL_INT16(CURRENT_Q13(IDREF_SPEED17), params.fieldweak.idref_q13[17]);
    TEST_ASSERT_EQUAL_INT16(NORM_INVKFIBASE, params.fieldweak.inv_kfi[0]);
    TEST_ASSERT_EQUAL_INT16(NORM_INVKFIBASE, params.fieldweak.inv_kfi[17]);
    TEST_ASSERT_EQUAL_INT16(16384, params.fieldweak.ls_over2ls0_q15[0]);
    TEST_ASSERT_EQUAL_INT16(16384, params.fieldweak.ls_over2ls0_q15[17]);
}

#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 1.0
static const drive_params_t at_1_A = DRIVE_PARAMS_INIT;
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 0.6
static const drive_params_t at_600_mA = DRIVE_PARAMS_INIT;

static int16_t brake_limit(const drive_params_t *p, float above_v)
{
    rig_closed(1, 8000);
    drive.bus_q31 = (int32_t)((PARAM_F(REGEN_LIMIT_V) + above_v) / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F) * 65536;
    limits_braking(&drive.run, p, qm_hi(drive.bus_q31));
    return drive.run.control.brake_limit_q13;
}

static void expect_braking_to_end_2_V_above(const drive_params_t *p)
{
    int16_t full = p->current_max_q13;
    TEST_ASSERT_INT16_WITHIN(full / 20, full, brake_limit(p, 0.0F));
    TEST_ASSERT_INT16_WITHIN(full / 20, full / 2, brake_limit(p, 1.0F));
    TEST_ASSERT_INT16_WITHIN(full / 20, 0, brake_limit(p, 2.0F));
}

void test_braking_current_ends_2_V_above_REGEN_LIMIT_for_every_current_range(void)
{
    expect_braking_to_end_2_V_above(&params);
    expect_braking_to_end_2_V_above(&at_1_A);
    expect_braking_to_end_2_V_above(&at_600_mA);
}

#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 2.75
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.0001
static const drive_params_t at_10_khz = DRIVE_PARAMS_INIT;

void test_loop_time_scales_every_time_and_duty(void)
{
    TEST_ASSERT_EQUAL_UINT16(100, at_10_khz.bootstrap_periods);
    TEST_ASSERT_EQUAL_UINT16(375, at_10_khz.stall_slots);
    TEST_ASSERT_EQUAL_INT16(4000, at_10_khz.svm.full);
    TEST_ASSERT_EQUAL_INT16(80, at_10_khz.svm.dead_time); /* the same 2 us */
    TEST_ASSERT_EQUAL_INT16(3872, at_10_khz.svm.top);
    TEST_ASSERT_EQUAL_INT16(7158, at_10_khz.estimator.deltat_q32);
    TEST_ASSERT_EQUAL_INT16(16, at_10_khz.speed_ramp_erpm);
}
