/* The unit of speed: chosen by the maximum speed, in every constant that has to do with speed, and within the formats at its ends. */
#include "hurst_params.h"

#include "drive/param_init.h"
#include "drive/param_limits.h"

#include "golden_params_quick.h"
#include "unity.h"

#include "law.c"

#define EXACT(value, expected) TEST_ASSERT_EQUAL_INT32_MESSAGE(expected, value, #value)

#define EXPECT_ESTIMATOR(p, unit) \
    do { \
        EXACT(SPEED_UNIT, GOLDEN_PARAMS_QUICK_##unit##_UNIT); \
        EXACT(NORM_INVKFIBASE, GOLDEN_PARAMS_QUICK_##unit##_INV_KFI); \
        EXACT((p).adaptation.rs_base_q16, GOLDEN_PARAMS_QUICK_##unit##_RS_Q16); \
        EXACT((p).fieldweak.ls_base_q16, GOLDEN_PARAMS_QUICK_##unit##_LS_Q16); \
        EXACT((p).estimator.d_ilimit_ls_q14, GOLDEN_PARAMS_QUICK_##unit##_D_ILIMIT_LS_Q14); \
        EXACT((p).estimator.d_ilimit_hs_q14, GOLDEN_PARAMS_QUICK_##unit##_D_ILIMIT_HS_Q14); \
        EXACT((p).estimator.deltat_q32, GOLDEN_PARAMS_QUICK_##unit##_DELTAT_Q32); \
        EXACT((p).estimator.half_step_q16_rad, GOLDEN_PARAMS_QUICK_##unit##_HALF_STEP_Q16_RAD); \
        EXACT((p).estimator.nominal_erpm, GOLDEN_PARAMS_QUICK_##unit##_NOMINAL_ERPM); \
        EXACT((p).estimator.decimate_erpm, GOLDEN_PARAMS_QUICK_##unit##_DECIMATE_ERPM); \
    } while (0)

#define EXPECT_OBSERVER(o, unit) \
    do { \
        EXACT((o).deltat_q32, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_DELTAT_Q32); \
        EXACT((o).per_turn_q12, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_PER_TURN_Q12); \
        EXACT((o).shift, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_SHIFT); \
        EXACT((o).per_current_q16, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_PER_CURRENT_Q16); \
        EXACT((o).per_unit_q15, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_PER_UNIT_Q15); \
        EXACT((o).innovation_max_erpm, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_INNOVATION_MAX); \
        EXACT((o).load_max, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_LOAD_MAX); \
        EXACT((o).full_erpm, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_FULL_ERPM); \
        EXACT((o).load_from, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_LOAD_FROM); \
        EXACT((o).gate_erpm, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_GATE_ERPM); \
        EXACT((o).gate_loaded_erpm, GOLDEN_PARAMS_QUICK_##unit##_OBSERVER_GATE_LOADED_ERPM); \
    } while (0)

void test_a_count_is_one_electrical_rpm_up_to_32000_of_them_then_two_then_four(void)
{
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 6400
    EXACT(SPEED_UNIT, 1);
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 6401
    EXACT(SPEED_UNIT, 2);
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 12800
    EXACT(SPEED_UNIT, 2);
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 12801
    EXACT(SPEED_UNIT, 4);
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 15000
    EXACT(SPEED_UNIT, 4);
}

/* ---- two electrical rpm: the Hurst motor for 7500 rpm at 10 kHz ---- */
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 7500
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.0001
#undef SPEED_BANDWIDTH_HZ
#define SPEED_BANDWIDTH_HZ 8
#undef LOAD_BANDWIDTH_HZ
#define LOAD_BANDWIDTH_HZ 60

void test_constants_in_counts_of_2_electrical_rpm_equal_the_reference(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXPECT_ESTIMATOR(p, U2);
    EXPECT_OBSERVER(p.observer, U2);
    EXACT(p.maximum_erpm, 18750);
    EXACT(p.fieldweak.index_per_count_q16, 2 * 64);
}

/* ---- four: a spindle for 10500 rpm with 7 pole pairs ---- */
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.00005
#undef NOPOLESPAIRS
#define NOPOLESPAIRS 7
#undef MOTOR_RS_OHM
#define MOTOR_RS_OHM 0.45
#undef MOTOR_LS_MH
#define MOTOR_LS_MH 0.3
#undef MOTOR_KPHI_V_PER_KRPM
#define MOTOR_KPHI_V_PER_KRPM 1.8
#undef MOTOR_INERTIA_KGM2
#define MOTOR_INERTIA_KGM2 2.5e-6
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 2.6
#undef NOMINAL_SPEED_RPM
#define NOMINAL_SPEED_RPM 10000
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 10500
#undef FW_START_SPEED_RPM
#define FW_START_SPEED_RPM 9900
#undef SPEED_BANDWIDTH_HZ
#define SPEED_BANDWIDTH_HZ 23
#undef LOAD_BANDWIDTH_HZ
#define LOAD_BANDWIDTH_HZ 54

void test_constants_in_counts_of_4_electrical_rpm_equal_the_reference(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXPECT_ESTIMATOR(p, U4);
    EXPECT_OBSERVER(p.observer, U4);
}

void test_every_speed_is_in_counts_and_every_gain_per_count(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXACT(p.minimum_erpm, 500 * 7 / 4);
    EXACT(p.nominal_erpm, 17500);
    EXACT(p.maximum_erpm, 18375);
    EXACT(p.end_erpm, 1750);
    EXACT(p.overspeed_erpm, 22969); /* a quarter more */
    EXACT(p.ramp_hold_erpm, 2188);
    EXACT(p.fieldweak.on_speed_erpm, 17325);
    EXACT(p.fieldweak.trim_speed_erpm, 10395);
    EXACT(p.fieldweak.index_per_count_q16, 4 * 64);
    EXACT(p.fieldweak.esdq_per_erpm_q13, 56221);         /* 4 * 14055.2 */
    EXACT(p.speed_ramp_q16, 183501);                     /* 4000 rpm/s * 7 * 0.4 ms / 4 */
    EXACT(p.speed_decel_q16, 183501);
    EXACT(p.tuning_step_q16, 8192);                      /* 1/8 of a count in eight periods: one electrical rpm in 16 */
    TEST_ASSERT_INT16_WITHIN(3, 22151, p.speed_kp_q13);  /* 23 Hz: 2 pi f J / Kt * 2 pi / 60 / 7 A per electrical rpm, four times */
    TEST_ASSERT_INT16_WITHIN(1, 362, p.sample_shift_q16); /* 1.5 us psi / L per electrical rpm, four times */
    EXACT(MAXIMUMSPEED_ELECTR, 73500);                   /* AN1292's names are in electrical rpm */
    EXACT(ENDSPEED_ELECTR, 7000);
    EXACT(NORM_DELTAT, 7158);
    EXACT(p.forced.end_speed_q10, PARAM_ROUND(1000.0F * 7.0F * 0.00005F / 60.0F * 67108864.0F)); /* an angle */
}

/* ---- where the formats end: the longest period with 4 electrical rpm, a sixteenth of a turn a period ---- */
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.00005855
#undef MAXIMUM_SPEED_RPM
#define MAXIMUM_SPEED_RPM 9144

void test_formats_hold_at_the_longest_period_of_the_largest_unit(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXACT(SPEED_UNIT, 4);
    TEST_ASSERT_INT32_WITHIN(1, 16765, p.estimator.deltat_q32);
    TEST_ASSERT_INT32_WITHIN(1, 52668, p.estimator.half_step_q16_rad);
    EXACT(p.fieldweak.esdq_per_erpm_q13, 65535); /* 65834: half a per cent less */
    TEST_ASSERT_TRUE(PARAM_TOP_ERPM * PARAM_F(LOOPTIME_SEC) > 3.74F && PARAM_TOP_ERPM * PARAM_F(LOOPTIME_SEC) < PARAM_F(PARAM_LARGEST_TURN));
}
