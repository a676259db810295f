/* From engineering units to counts: the constants that AN1292 publishes, and every derived parameter. */
#include "hurst_params.h"

#include "drive/param_init.h"

#include "golden_params.h"
#include "unity.h"

#undef KFILTER_ESDQ_FW /* AN1292's */
#define KFILTER_ESDQ_FW 164

/* A value, what it must be, and by how much it may miss that. */
#define NEAR(value, expected, miss) TEST_ASSERT_INT32_WITHIN_MESSAGE(miss, expected, value, #value)
#define EXACT(value, expected) TEST_ASSERT_EQUAL_INT32_MESSAGE(expected, value, #value)

/** The estimator's part against the reference in float64, at a full scale of the current. */
#define EXPECT_ESTIMATOR(p, fw, learns, scale) \
    do { \
        EXACT((learns).rs_base_q16, GOLDEN_PARAMS_##scale##_RS_Q16); \
        EXACT((p).rs_exp, GOLDEN_PARAMS_##scale##_RS_EXP); \
        EXACT((fw).ls_base_q16, GOLDEN_PARAMS_##scale##_LS_Q16); \
        EXACT((p).ls_exp, GOLDEN_PARAMS_##scale##_LS_EXP); \
        EXACT((p).d_ilimit_ls_q14, GOLDEN_PARAMS_##scale##_D_ILIMIT_LS_Q14); \
        EXACT((p).d_ilimit_hs_q14, GOLDEN_PARAMS_##scale##_D_ILIMIT_HS_Q14); \
        EXACT((p).deltat_q32, GOLDEN_PARAMS_##scale##_DELTAT_Q32); \
        EXACT((p).half_step_q16_rad, GOLDEN_PARAMS_##scale##_HALF_STEP_Q16_RAD); \
        EXACT((p).kfilter_velestim_q16, GOLDEN_PARAMS_##scale##_KFILTER_VELESTIM_Q16); \
        EXACT((p).nominal_erpm, GOLDEN_PARAMS_##scale##_NOMINAL_ERPM); \
        EXACT((p).decimate_erpm, GOLDEN_PARAMS_##scale##_DECIMATE_ERPM); \
    } while (0)

/* ---- 3.95 A of full scale: the constants of 2012 ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST (3.95 / 32768)

void test_constants_at_3_95_A_are_12990_1460_7956_and_1790(void)
{
    static const estimator_params_t p = PARAM_ESTIMATOR_INIT;
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    static const adaptation_params_t learns = PARAM_ADAPTATION_INIT;
    NEAR(NORM_RS, 12990, 1);
    NEAR(NORM_LSDTBASE, 1460, 1);
    NEAR(NORM_INVKFIBASE, 7956, 1);
    EXACT(NORM_DELTAT, 1790);
    EXPECT_ESTIMATOR(p, fw, learns, C395);
}

/* AN1292's limits 1502 and 6117 are 2 f Ts of the whole scale. Ours are 2 pi f Ts of the largest current, so that a sine
 * of that current is not clipped: pi MAXIMUM_CURRENT_A / 3.95 A = 2.19 times as much. */
void test_derivative_limits_let_a_sine_of_the_maximum_current_pass(void)
{
    TEST_ASSERT_INT16_WITHIN(4, 3285, D_ILIMIT_HS);
    TEST_ASSERT_INT16_WITHIN(4, 13379, D_ILIMIT_LS);
}

void test_derivative_limits_with_the_notes_slope_are_1502_and_6117(void)
{
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A (3.95 / 3.14159265)
    TEST_ASSERT_INT16_WITHIN(2, 1502, D_ILIMIT_HS);
    TEST_ASSERT_INT16_WITHIN(2, 6117, D_ILIMIT_LS);
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 2.75
}

void test_derivative_limits_end_where_their_products_end(void)
{
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 20
    TEST_ASSERT_EQUAL_INT16(4095, D_ILIMIT_HS_Q14);
    TEST_ASSERT_EQUAL_INT16(16383, D_ILIMIT_LS_Q14);
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 2.75
}

void test_the_notes_R_and_L_end_at_the_largest_number_instead_of_wrapping(void)
{
#undef MOTOR_RS_OHM
#define MOTOR_RS_OHM 10.0
#undef MOTOR_LS_MH
#define MOTOR_LS_MH 60.0
    TEST_ASSERT_EQUAL_INT16(32767, NORM_RS);
    TEST_ASSERT_EQUAL_INT16(32767, NORM_LSDTBASE);
#undef MOTOR_RS_OHM
#define MOTOR_RS_OHM 2.67
#undef MOTOR_LS_MH
#define MOTOR_LS_MH 1.92
}

/* ---- 7.09 A: the constants of 2014 ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST (7.09 / 32768)

void test_constants_at_7_09_A_are_23316_and_2620(void)
{
    static const estimator_params_t p = PARAM_ESTIMATOR_INIT;
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    static const adaptation_params_t learns = PARAM_ADAPTATION_INIT;
    NEAR(NORM_RS, 23316, 1);
    NEAR(NORM_LSDTBASE, 2620, 1);
    NEAR(NORM_INVKFIBASE, 7956, 1);
    EXPECT_ESTIMATOR(p, fw, learns, C709);
}

/* ---- 22 A: beyond a word, so with exponents ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST (22.0 / 32768)

void test_constants_at_22_A_get_exponents_and_keep_their_size(void)
{
    static const estimator_params_t p = PARAM_ESTIMATOR_INIT;
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    static const adaptation_params_t learns = PARAM_ADAPTATION_INIT;
    EXPECT_ESTIMATOR(p, fw, learns, C2200);
    /* published 9044 * 16 and 8129 * 256 in Q15 */
    TEST_ASSERT_INT32_WITHIN(20, INT32_C(9044) * 16, (int32_t)learns.rs_base_q16 << p.rs_exp);
    TEST_ASSERT_INT32_WITHIN(20, INT32_C(8129) * 256 / 8, (int32_t)fw.ls_base_q16 << p.ls_exp);
}

void test_exponents_change_where_a_word_ends_and_scaled_constants_are_rounded(void)
{
    EXACT(PARAM_EXP(65534.0F), 0);
    EXACT(PARAM_EXP(65536.0F), 1);
    EXACT(PARAM_EXP(131070.0F), 1);
    EXACT(PARAM_EXP(131072.0F), 2);
    EXACT(PARAM_EXP(262142.0F), 2);
    EXACT(PARAM_EXP(262144.0F), 3);
    EXACT(PARAM_SCALED(10.4F, 0), 10);
    EXACT(PARAM_SCALED(10.6F, 0), 11);
    EXACT(PARAM_SCALED(42.4F, 2), 11);
    EXACT(PARAM_SCALED(41.6F, 2), 10);
}

/* ---- 0.000121 A a count: AN1292's NORM_CURRENT ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST 0.000121

void test_NORM_CURRENT_of_1_41_A_is_11653_and_Q15_rounds_as_AN1292_does(void)
{
    EXACT(CURRENT_Q15(1.41), 11653);
    NEAR(CURRENT_Q15(-1.41), -11653, 1);
    EXACT(PARAM_Q15(1.0), 32767);
    EXACT(PARAM_Q15(-1.0), -32768);
    EXACT(PARAM_Q15(0.5), 16384);
    EXACT(PARAM_Q15(-0.5), -16384);
    EXACT(PARAM_Q15(0.00001), 0);
    EXACT(PARAM_Q15(0.00003), 1);
    EXACT(PARAM_Q15(-0.00003), -1);
    EXACT(PARAM_ROUND(1.5F), 2);
    EXACT(PARAM_ROUND(1.4F), 1);
    EXACT(PARAM_ROUND(-1.5F), -2);
    EXACT(PARAM_ROUND(-1.4F), -1);
}

/* ---- 4.4 A: shunt and amplifier in theory; the rest of the file ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST 0.0001342773

static uint16_t bus_q16(int16_t bus_q15)
{
    return (uint16_t)((uint16_t)bus_q15 << 1);
}

static int32_t duty_per_volt(int16_t bus_q15)
{
    return qm_divud(DUTY_PER_VOLT_NUMERATOR, bus_q16(bus_q15));
}

static int32_t radius(int16_t bus_q15)
{
    return qm_mulhi_uu(bus_q16(bus_q15), VOLTAGE_LIMIT_PER_BUS_Q16);
}

void test_constants_at_4_4_A_are_14470_and_1626(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXACT(NORM_RS, 14470);
    EXACT(NORM_LSDTBASE, 1626);
    EXACT(NORM_INVKFIBASE, 7956);
    EXACT(NORM_DELTAT, 1790);
    EXPECT_ESTIMATOR(p.estimator, p.fieldweak, p.adaptation, C440);
    TEST_ASSERT_FLOAT_WITHIN(1e-9F, 4.05949e-4F, NORM_VOLTAGE_CONST);
    TEST_ASSERT_FLOAT_WITHIN(0.000001F, 0.0598743F, PARAM_KT);
}

void test_currents_voltages_and_modulator(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXACT(CURRENT_Q13(4.4), 8192);
    EXACT(CURRENT_Q13(-2.2), -4096);
    EXACT(p.open_loop_q13, 2625);
    EXACT(p.current_max_q13, 5120);
    EXACT(p.flux_brake_most_q13, 4960); /* 2.67 ohm * 2.75 A are more than half of 0.96 V */
    EXACT(p.overcurrent_q13, 7075);
    EXACT(p.current_max_reciprocal, 6554); /* 2^25 / 5120 */
    EXACT(p.kcurr_a, -16384);
    EXACT(p.kcurr_b, -16384);
    EXACT(p.offset_max_q13, 1024);
    NEAR(VOLTAGE_Q14(13.3021), 16384, 1);
    EXACT(p.bus_nominal_q15, 14895); /* 24 / 52.8 * 32768 */
    EXACT(p.bus_used_q15, 18618); /* 30 V of 52.8 V: 1.25 times 24 V */
    EXACT(p.bus_regen_q15, 16756);
    EXACT(p.bus_over_q15, 21101);
    EXACT(p.bus_under_q15, 7447);
    EXACT(p.brake_per_bus_q8, 1056); /* 5120 counts in the 1241 counts of 2 V, times 256 */
    EXACT(p.svm.full, GOLDEN_PARAMS_SVM_FULL);
    EXACT(p.svm.top, GOLDEN_PARAMS_SVM_TOP);
    EXACT(p.svm.dead_time, GOLDEN_PARAMS_SVM_DEAD_TIME);
    EXACT(p.svm.knee_q13, GOLDEN_PARAMS_SVM_KNEE_Q13);
    EXACT(p.svm.dead_slope_q8, GOLDEN_PARAMS_SVM_DEAD_SLOPE_Q8);
    EXACT(p.svm.turn_q13, GOLDEN_PARAMS_SVM_TURN_Q13);
    NEAR(duty_per_volt(BUS_Q15(24.0)), GOLDEN_PARAMS_DUTY_PER_VOLT_24, 1);
    NEAR(duty_per_volt(BUS_Q15(12.0)), GOLDEN_PARAMS_DUTY_PER_VOLT_12, 2);
    NEAR(radius(BUS_Q15(24.0)), GOLDEN_PARAMS_RADIUS_24, 1);
    NEAR(radius(BUS_Q15(34.0)), GOLDEN_PARAMS_RADIUS_34, 1);
}

void test_speeds_and_times(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXACT(p.minimum_erpm, 2500);
    EXACT(p.nominal_erpm, 14000);
    EXACT(p.maximum_erpm, 27500);
    EXACT(p.end_erpm, 5000);
    EXACT(p.fieldweak.on_speed_erpm, 13000);
    EXACT(p.forced.end_speed_q10, 279620);
    EXACT(p.forced.increase_rate_q10, 10);
    EXACT(SPEEDREFRAMP, 524288);     /* 4000 rpm a second: 8 erpm in 400 us, 16 fraction bits */
    EXACT(p.ramp_hold_erpm, 1750);   /* an eighth of nominal speed */
    EXACT(TUNING_STEP_Q16, 32768);   /* one electrical rpm every 16 periods: half of one in eight */
    EXACT(p.bootstrap_periods, 200); /* 10 ms */
    EXACT(p.align_periods, 10000);
    EXACT(p.align_rate_q12, 1075); /* 1.41 A in half a second */
    EXACT(p.align_rise_q14, 927);  /* 2.67 ohm * 1.41 A / 5 of 26.6 V = 32768 counts */
    EXACT(p.align_speed_q10, 5l * 67108864 / LOCK_TIME); /* five turns */
    EXACT(p.early_erpm, 3125);                           /* 1.25 times the minimum speed */
    EXACT(p.agree_steps, 50);                            /* 20 ms */
    EXACT(p.wait_periods, 4000);                /* 200 ms */
    EXACT(p.id_off_q13, 197);                            /* 2.75 A / 32 + 0.2 * 0.96 V / (2 pi 800 Hz 1.92 mH) */
    EXACT(p.stall_steps, 288);                           /* 0.23 s */
    EXACT(p.lost_lock_steps, 75);                        /* 60 ms */
    EXACT(p.rs_impossible, GOLDEN_PARAMS_ADAPTATION_RS_MOST);
}

void test_controllers(void)
{
#define GIVEN_PTERM 0.02
#define GIVEN_ITERM 0.002
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    static const pi_gains_t given = PARAM_PI_INIT(GIVEN_PTERM, PARAM_CURRENT_KI(GIVEN_ITERM), 0.999, CURRENT_PI_SHIFT);
    /* 2 pi 800 L = 9.651 V/A is 3.1923 full scales, 2 pi 800 R Ts = 0.6710 V/A is 0.22196; both times 2^11 */
    EXACT(p.pi_d.kp, 6538);
    EXACT(p.pi_q.kp, 6538);
    EXACT(p.pi_d.ki, 455);
    EXACT(p.pi_q.ki, 455);
    EXACT(p.pi_d.kc, 32734);
    EXACT(p.pi_q.kc, 32734); /* 0.999 */
    EXACT(p.pi_d.shift, 10);
    EXACT(p.pi_q.shift, 10);
    /* Kp = 2 pi 13 J/Kt = 0.0075031 A s/rad = 0.29258 counts Q13 per electrical rpm, times 2^13; 1.8 times that after a load step */
    NEAR(p.speed_kp_q13, 2397, 1);
    NEAR(p.speed_kp_fast_q13, 4314, 1);
    EXACT(given.kp, 655); /* 16 * 0.02 of full scale: 0.64 Q14 counts per Q13 count, times 2^10 */
    EXACT(given.ki, 4);
}

/* AN1292's motor: 0.89337 erpm a step and Q13 count are 0.11167 * 2^3; 33 Hz of 110 Hz under load; 1.22 * 13 Hz without. */
void test_load_observer_and_what_belongs_to_low_speed(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
#define OBSERVER(field, FIELD) EXACT(p.observer.field, GOLDEN_PARAMS_OBSERVER_##FIELD)
    OBSERVER(deltat_q32, DELTAT_Q32);
    OBSERVER(per_turn_q12, PER_TURN_Q12);
    OBSERVER(shift, SHIFT);
    OBSERVER(per_current_q16, PER_CURRENT_Q16);
    OBSERVER(per_unit_q15, PER_UNIT_Q15);
    OBSERVER(innovation_max_erpm, INNOVATION_MAX);
    OBSERVER(load_max, LOAD_MAX);
    OBSERVER(quiet_q16, QUIET_Q16);
    OBSERVER(loaded_q16, LOADED_Q16);
    OBSERVER(fast_q16, FAST_Q16);
    OBSERVER(full_erpm, FULL_ERPM);
    OBSERVER(load_from, LOAD_FROM);
    OBSERVER(load_width, LOAD_WIDTH);
    OBSERVER(load_slope_q15, LOAD_SLOPE_Q15);
    NEAR(p.observer.gate_erpm, 149, 1); /* 0.13 of the dead time's 0.96 V at 1196 erpm a volt */
    NEAR(p.observer.gate_loaded_erpm, 34, 1);
    NEAR(p.sample_shift_q16, 80, 0);                  /* 1.5 us * 7.983 mV s/1.92 mH, in counts per erpm */
    NEAR(p.fieldweak.esdq_per_erpm_q13, 14055, 1);    /* 2 pi 5/60 * 50 us * 2^29 */
    EXACT(p.svm.dead_time, 80);
    TEST_ASSERT_FLOAT_WITHIN(0.5F, 746.4F, PARAM_LOWEST_ERPM); /* 149.3 rpm */
    TEST_ASSERT_FLOAT_WITHIN(0.01F, 16.67F, PARAM_CALM_HZ);   /* 0.4 of 500 rpm, for that is more than of 489 */
}

/* The loop's bandwidth and the load's scale with the slow step; a small motor's acceleration changes the observer's unit. */
void test_the_observer_s_unit_keeps_a_count_of_current_between_a_half_and_one(void)
{
    EXACT(PARAM_ACCEL_SHIFT, 3);
    TEST_ASSERT_FLOAT_WITHIN(0.0002F, 0.8934F, PARAM_ACCEL_UNITS);
#undef MOTOR_INERTIA_KGM2
#define MOTOR_INERTIA_KGM2 1.3e-6
    EXACT(PARAM_ACCEL_SHIFT, 1);
    TEST_ASSERT_FLOAT_WITHIN(0.0005F, 0.9449F, PARAM_ACCEL_UNITS);
#undef MOTOR_INERTIA_KGM2
#define MOTOR_INERTIA_KGM2 5.5e-3
    EXACT(PARAM_ACCEL_SHIFT, 13);
    TEST_ASSERT_FLOAT_WITHIN(0.0005F, 0.9148F, PARAM_ACCEL_UNITS);
#undef MOTOR_INERTIA_KGM2
#define MOTOR_INERTIA_KGM2 5.5e-6
}

void test_adaptation(void)
{
    static const adaptation_params_t p = PARAM_ADAPTATION_INIT;
    EXACT(p.rate_q16, GOLDEN_PARAMS_ADAPTATION_RATE_Q16);
    EXACT(p.kfi_least, GOLDEN_PARAMS_ADAPTATION_KFI_LEAST);
    EXACT(p.kfi_most, GOLDEN_PARAMS_ADAPTATION_KFI_MOST);
    EXACT(p.rs_least, GOLDEN_PARAMS_ADAPTATION_RS_LEAST);
    EXACT(p.rs_most, GOLDEN_PARAMS_ADAPTATION_RS_MOST);
    EXACT(p.emf_least_q12, GOLDEN_PARAMS_ADAPTATION_EMF_LEAST_Q12);
    EXACT(p.turned_q12, GOLDEN_PARAMS_ADAPTATION_TURNED_Q12);
}

void test_a_turn_of_a_rotor_with_little_flux_is_more_than_what_dead_time_may_shake_and_one_with_much_has_the_format(void)
{
#undef MOTOR_KPHI_V_PER_KRPM
#define MOTOR_KPHI_V_PER_KRPM 0.5
    static const adaptation_params_t little = PARAM_ADAPTATION_INIT;
#undef MOTOR_KPHI_V_PER_KRPM
#define MOTOR_KPHI_V_PER_KRPM 900.0
    static const adaptation_params_t much = PARAM_ADAPTATION_INIT;
    NEAR(little.turned_q12, 2 * GOLDEN_PARAMS_ADAPTATION_EMF_LEAST_Q12, 1);
    EXACT(much.turned_q12, INT16_MAX);
#undef MOTOR_KPHI_V_PER_KRPM
#define MOTOR_KPHI_V_PER_KRPM 7.24
}

void test_with_a_high_trip_level_resistance_and_derivative_share_the_back_emf_s_format(void)
{
#undef OVER_CURRENT_THRESHOLD_A
#define OVER_CURRENT_THRESHOLD_A 5.0
    static const adaptation_params_t p = PARAM_ADAPTATION_INIT;
    static const estimator_params_t e = PARAM_ESTIMATOR_INIT;
    static const drive_params_t d = DRIVE_PARAMS_INIT;
    NEAR(p.rs_most, GOLDEN_PARAMS_TIGHT_RS_MOST, 1); /* single precision */
    EXACT(d.rs_impossible, INT16_MAX);
    EXACT(e.d_ilimit_hs_q14, GOLDEN_PARAMS_TIGHT_D_ILIMIT_HS_Q14);
    TEST_ASSERT_TRUE(p.rs_most >= 0 && p.rs_most < GOLDEN_PARAMS_ADAPTATION_RS_MOST);
#undef OVER_CURRENT_THRESHOLD_A
#define OVER_CURRENT_THRESHOLD_A 3.8
}

void test_field_weakening(void)
{
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    EXACT(fw.trim_step_q13, 4);      /* 2.7 A a second: 2.15 mA in 800 us */
    EXACT(fw.trim_most_q13, 24);
    EXACT(fw.trim_max_q13, 1489);    /* 0.8 A */
    EXACT(fw.trim_speed_erpm, 7800); /* 60 % of the start speed */
    EXACT(fw.kfilter_esdq_q16, 2400);
    EXACT(fw.kfilter_esdq_fw_q16, 328); /* twice AN1292's Q15 */
    EXACT(fw.idref_q13[0], 0);
    EXACT(fw.idref_q13[7], CURRENT_Q13(IDREF_SPEED7));
    EXACT(fw.idref_q13[17], CURRENT_Q13(IDREF_SPEED17));
    EXACT(fw.inv_kfi[0], NORM_INVKFIBASE);
    EXACT(fw.inv_kfi[17], NORM_INVKFIBASE);
    EXACT(fw.ls_over2ls0_q15[0], 16384);
    EXACT(fw.ls_over2ls0_q15[17], 16384);
}

/* ---- tables ---- */
#undef IDREF_SPEED3
#define IDREF_SPEED3 -1.0
#undef INVKFI_SPEED5
#define INVKFI_SPEED5 8500
#undef LS_OVER2LS0_SPEED17
#define LS_OVER2LS0_SPEED17 0.27

#define PLACE(i) i

void test_every_table_entry_has_its_own_parameter(void)
{
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    static const int16_t place[] = PARAM_18(PLACE);
    int16_t n;
    for (n = 0; n < FIELDWEAK_ENTRIES; n++) {
        TEST_ASSERT_EQUAL_INT16(n, place[n]);
    }
    TEST_ASSERT_INT16_WITHIN(1, -1862, fw.idref_q13[3]);
    TEST_ASSERT_EQUAL_INT16(8500, fw.inv_kfi[5]);
    TEST_ASSERT_EQUAL_INT16(8847, fw.ls_over2ls0_q15[17]);
}

/* ---- another loop time ---- */
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.0001

void test_loop_time_scales_every_time_and_duty(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXACT(p.bootstrap_periods, 100);
    EXACT(p.stall_steps, 144);
    EXACT(p.svm.full, 4000);
    EXACT(p.svm.dead_time, 80); /* the same 2 us */
    EXACT(p.svm.top, 3872);
    EXACT(p.estimator.deltat_q32, 7158);
    EXACT(p.speed_ramp_q16, 16 * 65536);
}

/* ---- another motor: 4 pole pairs, 15 kHz, 48 V ---- */
#undef NOPOLESPAIRS
#define NOPOLESPAIRS 4
#undef LOOPTIME_SEC
#define LOOPTIME_SEC 0.0000666667
#undef NOMINAL_BUS_V
#define NOMINAL_BUS_V 48.0
#undef DEADTIME_SEC
#define DEADTIME_SEC 0.000001

void test_constants_follow_period_bus_and_pole_pairs(void)
{
    /* U0 = 48 V / sqrt(3) * (1 - 1/66.667) / 32768 */
    TEST_ASSERT_FLOAT_WITHIN(2e-9F, 8.330420e-4F, NORM_VOLTAGE_CONST);
    NEAR(NORM_DELTAT, 2386, 1);
    NEAR(NORM_RS, 7051, 1);          /* 2.67 * I0/U0 * 2^14 */
    NEAR(NORM_LSDTBASE, 594, 1);     /* 1.92 mH / 66.667 us * I0/U0 * 2^7 */
    NEAR(NORM_INVKFIBASE, 13061, 1); /* sqrt(3) * 4000 * U0 / 7.24 * 2^14 */
    EXACT(PWM_FULL_DUTY, 2667);
    EXACT(DEAD_TIME_DUTY, 40);
    EXACT(NOMINAL_SPEED_ERPM, 11200);
}

/* ---- half of 0.72 V, which dead time takes here, is 0.131 ohm at 2.75 A ---- */
#undef MOTOR_RS_OHM
#define MOTOR_RS_OHM 0.1305

void test_a_winding_below_half_of_dead_time_s_voltage_burns_nothing(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    TEST_ASSERT_FLOAT_WITHIN(1e-4F, 0.72F, PARAM_DEAD_TIME_V);
    EXACT(p.flux_brake_most_q13, 0);
}

#undef MOTOR_RS_OHM
#define MOTOR_RS_OHM 0.1314

void test_a_winding_above_it_burns_with_all_but_a_32nd_of_the_largest_current(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXACT(p.flux_brake_most_q13, CURRENT_Q13(PARAM_F(MAXIMUM_CURRENT_A) * 31.0F / 32.0F));
    TEST_ASSERT_INT16_WITHIN(1, p.current_max_q13 - p.current_max_q13 / 32, p.flux_brake_most_q13);
}

void test_dead_ends_of_the_potentiometer_are_rounded_to_the_nearest_count(void)
{
#undef POT_LIVE_ZERO
#define POT_LIVE_ZERO 0.16
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    EXACT(p.pot_zero_q16, 10486);  /* 10485.8 */
    EXACT(p.pot_scale_q15, 48188); /* 1 / 0.68: 48188.2 */
}
