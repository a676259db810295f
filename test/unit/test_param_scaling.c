/* From engineering units to counts: the constants that AN1292 publishes, and every derived parameter. */
#include "hurst_params.h"

#include "drive/param_init.h"

#include "golden_params.h"
#include "unity.h"

#undef KFILTER_ESDQ_FW /* AN1292's */
#define KFILTER_ESDQ_FW 164

/** The estimator's part against the reference in float64. */
static void expect_estimator(const estimator_params_t *p, uint16_t rs_q16, uint16_t rs_exp, uint16_t ls_exp, int16_t limit_ls,
                             int16_t limit_hs)
{
    TEST_ASSERT_EQUAL_UINT16(rs_q16, p->rs_q16);
    TEST_ASSERT_EQUAL_UINT16(rs_exp, p->rs_exp);
    TEST_ASSERT_EQUAL_UINT16(ls_exp, p->ls_exp);
    TEST_ASSERT_EQUAL_INT16(limit_ls, p->d_ilimit_ls_q14);
    TEST_ASSERT_EQUAL_INT16(limit_hs, p->d_ilimit_hs_q14);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_C440_DELTAT_Q32, p->deltat_q32);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_C440_HALF_STEP_Q16_RAD, p->half_step_q16_rad);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_C440_KFILTER_VELESTIM_Q16, p->kfilter_velestim_q16);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_C440_NOMINAL_ERPM, p->nominal_erpm);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_C440_DECIMATE_ERPM, p->decimate_erpm);
}

/* ---- 3.95 A of full scale: the constants of 2012 ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST (3.95 / 32768)

void test_constants_at_3_95_A_are_12990_1460_7956_and_1790(void)
{
    TEST_ASSERT_INT16_WITHIN(1, 12990, NORM_RS);
    TEST_ASSERT_INT16_WITHIN(1, 1460, NORM_LSDTBASE);
    TEST_ASSERT_INT16_WITHIN(1, 7956, NORM_INVKFIBASE);
    TEST_ASSERT_EQUAL_INT16(1790, NORM_DELTAT);
}

void test_estimator_at_3_95_A_equals_the_reference(void)
{
    static const estimator_params_t p = PARAM_ESTIMATOR_INIT;
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    expect_estimator(&p, GOLDEN_PARAMS_C395_RS_Q16, GOLDEN_PARAMS_C395_RS_EXP, GOLDEN_PARAMS_C395_LS_EXP,
                     GOLDEN_PARAMS_C395_D_ILIMIT_LS_Q14, GOLDEN_PARAMS_C395_D_ILIMIT_HS_Q14);
    TEST_ASSERT_EQUAL_UINT16((uint16_t)GOLDEN_PARAMS_C395_LS_Q16, fw.ls_base_q16);
}

/* The note's limits 1502 and 6117 are 2 f Ts of the whole scale. Ours are 2 pi f Ts of the largest current, so that a sine
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
    TEST_ASSERT_INT16_WITHIN(1, 23316, NORM_RS);
    TEST_ASSERT_INT16_WITHIN(1, 2620, NORM_LSDTBASE);
    TEST_ASSERT_INT16_WITHIN(1, 7956, NORM_INVKFIBASE);
    expect_estimator(&p, (uint16_t)GOLDEN_PARAMS_C709_RS_Q16, GOLDEN_PARAMS_C709_RS_EXP, GOLDEN_PARAMS_C709_LS_EXP,
                     GOLDEN_PARAMS_C709_D_ILIMIT_LS_Q14, GOLDEN_PARAMS_C709_D_ILIMIT_HS_Q14);
    TEST_ASSERT_EQUAL_UINT16((uint16_t)GOLDEN_PARAMS_C709_LS_Q16, fw.ls_base_q16);
}

/* ---- 22 A: beyond a word, so with exponents ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST (22.0 / 32768)

void test_constants_at_22_A_get_exponents_and_keep_their_size(void)
{
    static const estimator_params_t p = PARAM_ESTIMATOR_INIT;
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    expect_estimator(&p, (uint16_t)GOLDEN_PARAMS_C2200_RS_Q16, GOLDEN_PARAMS_C2200_RS_EXP, GOLDEN_PARAMS_C2200_LS_EXP,
                     GOLDEN_PARAMS_C2200_D_ILIMIT_LS_Q14, GOLDEN_PARAMS_C2200_D_ILIMIT_HS_Q14);
    TEST_ASSERT_EQUAL_UINT16(GOLDEN_PARAMS_C2200_LS_Q16, fw.ls_base_q16);
    /* published 9044 * 16 and 8129 * 256 in Q15 */
    TEST_ASSERT_INT32_WITHIN(20, INT32_C(9044) * 16, (int32_t)p.rs_q16 << p.rs_exp);
    TEST_ASSERT_INT32_WITHIN(20, INT32_C(8129) * 256 / 8, (int32_t)fw.ls_base_q16 << p.ls_exp);
}

void test_exponents_change_where_a_word_ends(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, PARAM_EXP(65534.0F));
    TEST_ASSERT_EQUAL_UINT16(1, PARAM_EXP(65536.0F));
    TEST_ASSERT_EQUAL_UINT16(1, PARAM_EXP(131070.0F));
    TEST_ASSERT_EQUAL_UINT16(2, PARAM_EXP(131072.0F));
    TEST_ASSERT_EQUAL_UINT16(2, PARAM_EXP(262142.0F));
    TEST_ASSERT_EQUAL_UINT16(3, PARAM_EXP(262144.0F));
}

void test_scaled_constants_are_rounded_to_the_nearest(void)
{
    TEST_ASSERT_EQUAL_UINT16(10, PARAM_SCALED(10.4F, 0));
    TEST_ASSERT_EQUAL_UINT16(11, PARAM_SCALED(10.6F, 0));
    TEST_ASSERT_EQUAL_UINT16(11, PARAM_SCALED(42.4F, 2));
    TEST_ASSERT_EQUAL_UINT16(10, PARAM_SCALED(41.6F, 2));
}

/* ---- 0.000121 A a count: the note's NORM_CURRENT ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST 0.000121

void test_NORM_CURRENT_of_1_41_A_is_11653(void)
{
    TEST_ASSERT_EQUAL_INT16(11653, NORM_CURRENT(1.41));
    TEST_ASSERT_INT16_WITHIN(1, -11653, NORM_CURRENT(-1.41));
}

void test_Q15_rounds_as_the_note_does(void)
{
    TEST_ASSERT_EQUAL_INT16(32767, Q15(1.0));
    TEST_ASSERT_EQUAL_INT16(-32768, Q15(-1.0));
    TEST_ASSERT_EQUAL_INT16(16384, Q15(0.5));
    TEST_ASSERT_EQUAL_INT16(-16384, Q15(-0.5));
    TEST_ASSERT_EQUAL_INT16(0, Q15(0.00001));
    TEST_ASSERT_EQUAL_INT16(1, Q15(0.00003));
    TEST_ASSERT_EQUAL_INT16(-1, Q15(-0.00003));
}

void test_rounding_is_to_the_nearest_for_both_signs(void)
{
    TEST_ASSERT_EQUAL_INT32(2, PARAM_ROUND(1.5F));
    TEST_ASSERT_EQUAL_INT32(1, PARAM_ROUND(1.4F));
    TEST_ASSERT_EQUAL_INT32(-2, PARAM_ROUND(-1.5F));
    TEST_ASSERT_EQUAL_INT32(-1, PARAM_ROUND(-1.4F));
}

/* ---- 4.4 A: shunt and amplifier in theory; the rest of the file ---- */
#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST 0.0001342773

void test_constants_at_4_4_A_are_14470_and_1626(void)
{
    static const estimator_params_t p = PARAM_ESTIMATOR_INIT;
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    TEST_ASSERT_EQUAL_INT16(14470, NORM_RS);
    TEST_ASSERT_EQUAL_INT16(1626, NORM_LSDTBASE);
    TEST_ASSERT_EQUAL_INT16(7956, NORM_INVKFIBASE);
    TEST_ASSERT_EQUAL_INT16(1790, NORM_DELTAT);
    expect_estimator(&p, GOLDEN_PARAMS_C440_RS_Q16, GOLDEN_PARAMS_C440_RS_EXP, GOLDEN_PARAMS_C440_LS_EXP,
                     GOLDEN_PARAMS_C440_D_ILIMIT_LS_Q14, GOLDEN_PARAMS_C440_D_ILIMIT_HS_Q14);
    TEST_ASSERT_EQUAL_UINT16((uint16_t)GOLDEN_PARAMS_C440_LS_Q16, fw.ls_base_q16);
}

void test_angle_step_constants_are_3579_and_11244(void)
{
    static const estimator_params_t p = PARAM_ESTIMATOR_INIT;
    TEST_ASSERT_EQUAL_INT16(3579, p.deltat_q32); /* 50 us / 60 * 2^32 */
    TEST_ASSERT_INT16_WITHIN(1, 11244, p.half_step_q16_rad);
}

void test_forced_angle_ends_at_279620_for_1000_rpm(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    TEST_ASSERT_EQUAL_INT32(279620, p.forced.end_speed_q10);
    TEST_ASSERT_EQUAL_INT16(10, p.forced.increase_rate_q10);
}

void test_speeds_are_electrical_rpm(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    TEST_ASSERT_EQUAL_INT16(2500, p.minimum_erpm);
    TEST_ASSERT_EQUAL_INT16(14000, p.nominal_erpm);
    TEST_ASSERT_EQUAL_INT16(27500, p.maximum_erpm);
    TEST_ASSERT_EQUAL_INT16(5000, p.end_erpm);
    TEST_ASSERT_EQUAL_INT16(13000, p.fieldweak.on_speed_erpm);
    TEST_ASSERT_EQUAL_INT16(1400, p.estimator.decimate_erpm);
}

void test_speed_ramp_of_4000_rpm_per_second_is_8_per_slow_step(void)
{
    TEST_ASSERT_EQUAL_INT16(8, SPEEDREFRAMP);
}

void test_TUNING_ramp_is_one_electrical_rpm_every_16_periods(void)
{
    TEST_ASSERT_EQUAL_INT32(INT32_C(32768), TUNING_STEP_Q16); /* half of one in eight periods */
}

void test_currents_are_Q13_of_full_scale(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    TEST_ASSERT_EQUAL_INT16(8192, CURRENT_Q13(4.4));
    TEST_ASSERT_EQUAL_INT16(-4096, CURRENT_Q13(-2.2));
    TEST_ASSERT_EQUAL_INT16(2625, p.open_loop_q13);
    TEST_ASSERT_EQUAL_INT16(5120, p.current_max_q13);
    TEST_ASSERT_EQUAL_INT16(7075, p.overcurrent_q13);
    TEST_ASSERT_EQUAL_UINT16(6554, p.current_max_reciprocal); /* 2^25 / 5120 */
}

void test_voltages_are_Q14_of_the_largest_phase_voltage(void)
{
    TEST_ASSERT_FLOAT_WITHIN(1e-9F, 4.05949e-4F, NORM_VOLTAGE_CONST);
    TEST_ASSERT_INT16_WITHIN(1, 16384, VOLTAGE_Q14(13.3021));
    TEST_ASSERT_EQUAL_INT16(14895, BUS_Q15(24.0)); /* 24 / 52.8 * 32768 */
}

void test_modulator_is_that_of_the_reference(void)
{
    static const svm_params_t p = PARAM_SVM_INIT;
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_SVM_FULL, p.full);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_SVM_TOP, p.top);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_SVM_DEAD_TIME, p.dead_time);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_SVM_KNEE_Q13, p.knee_q13);
    TEST_ASSERT_EQUAL_UINT16((uint16_t)GOLDEN_PARAMS_SVM_DEAD_SLOPE_Q16, p.dead_slope_q16);
    TEST_ASSERT_EQUAL_INT16(GOLDEN_PARAMS_SVM_TURN_Q13, p.turn_q13);
}

static uint16_t bus_q16(int16_t bus_q15)
{
    return (uint16_t)((uint16_t)bus_q15 << 1);
}

static uint16_t duty_per_volt(uint16_t bus)
{
    return qm_divud(DUTY_PER_VOLT_NUMERATOR, bus);
}

void test_duty_per_volt_follows_the_bus(void)
{
    TEST_ASSERT_UINT16_WITHIN(1, GOLDEN_PARAMS_DUTY_PER_VOLT_24, duty_per_volt(bus_q16(BUS_Q15(24.0))));
    TEST_ASSERT_UINT16_WITHIN(2, GOLDEN_PARAMS_DUTY_PER_VOLT_12, duty_per_volt(bus_q16(BUS_Q15(12.0))));
}

void test_voltage_circle_follows_the_bus(void)
{
    TEST_ASSERT_INT16_WITHIN(1, GOLDEN_PARAMS_RADIUS_24, (int16_t)qm_mulhi_uu(bus_q16(BUS_Q15(24.0)), VOLTAGE_LIMIT_PER_BUS_Q16));
    TEST_ASSERT_INT16_WITHIN(1, GOLDEN_PARAMS_RADIUS_34, (int16_t)qm_mulhi_uu(bus_q16(BUS_Q15(34.0)), VOLTAGE_LIMIT_PER_BUS_Q16));
}

void test_current_loop_gains_cancel_the_motors_pole(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    /* 2 pi 800 L = 9.651 V/A is 3.1923 full scales, 2 pi 800 R Ts = 0.6710 V/A is 0.22196; both times 2^11 */
    TEST_ASSERT_EQUAL_INT16(6538, p.pi_d.kp);
    TEST_ASSERT_EQUAL_INT16(455, p.pi_d.ki);
    TEST_ASSERT_EQUAL_UINT16(10, p.pi_d.shift);
    TEST_ASSERT_EQUAL_INT16(p.pi_d.kp, p.pi_q.kp);
    TEST_ASSERT_EQUAL_INT16(p.pi_d.ki, p.pi_q.ki);
    TEST_ASSERT_EQUAL_INT16(32734, p.pi_q.kc); /* 0.999 */
    TEST_ASSERT_EQUAL_INT16(p.pi_d.kc, p.pi_q.kc);
    TEST_ASSERT_EQUAL_UINT16(p.pi_d.shift, p.pi_q.shift);
}

void test_published_gains_can_be_given_instead(void)
{
#define GIVEN_PTERM 0.02
#define GIVEN_ITERM 0.002
    static const pi_gains_t gains = PARAM_PI_INIT(GIVEN_PTERM, PARAM_CURRENT_KI(GIVEN_ITERM), 0.999, CURRENT_PI_SHIFT);
    /* 16 * 0.02 of full scale: 0.64 Q14 counts per Q13 count, times 2^10 */
    TEST_ASSERT_EQUAL_INT16(655, gains.kp);
    TEST_ASSERT_EQUAL_INT16(4, gains.ki);
    TEST_ASSERT_EQUAL_INT16(164, PARAM_SPEED_KI(0.01)); /* eight periods a step */
}

void test_speed_loop_gains_follow_the_inertia(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    /* Kp = 2 pi 25 J/Kt = 0.014429 A s/rad = 0.56265 counts Q13 per electrical rpm, times 2^13; Ki = Kp 2 pi 25/3 400 us */
    TEST_ASSERT_INT16_WITHIN(2, 4609, p.pi_speed.kp);
    TEST_ASSERT_INT16_WITHIN(1, 96, p.pi_speed.ki);
    TEST_ASSERT_EQUAL_UINT16(13, p.pi_speed.shift);
    TEST_ASSERT_FLOAT_WITHIN(0.000001F, 0.0598743F, PARAM_KT);
}

void test_braking_current_falls_from_the_maximum_to_nothing_in_2_V(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    TEST_ASSERT_EQUAL_INT16(1056, p.brake_per_bus_q8); /* 5120 counts in 1241 counts of the bus, times 256 */
}

void test_trim_moves_by_2_7_A_per_second_up_to_its_limit(void)
{
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    TEST_ASSERT_EQUAL_INT16(2, fw.trim_step_q13);      /* 1.07 mA in 400 us */
    TEST_ASSERT_EQUAL_INT16(1489, fw.trim_max_q13);    /* 0.8 A */
    TEST_ASSERT_INT16_WITHIN(1, 296, fw.margin_q14);   /* a hundredth of the bus */
    TEST_ASSERT_EQUAL_INT16(7800, fw.trim_speed_erpm); /* 60 % of the start speed */
}

void test_filters_have_twice_the_notes_Q15_constants(void)
{
    static const fieldweak_params_t fw = PARAM_FIELDWEAK_INIT;
    TEST_ASSERT_EQUAL_INT16(2400, fw.kfilter_esdq_q16);
    TEST_ASSERT_EQUAL_INT16(328, fw.kfilter_esdq_fw_q16);
}

void test_times_are_periods_and_slow_steps(void)
{
    static const drive_params_t p = DRIVE_PARAMS_INIT;
    TEST_ASSERT_EQUAL_UINT16(200, p.bootstrap_periods); /* 10 ms */
    TEST_ASSERT_EQUAL_UINT16(4000, p.lock_periods);
    TEST_ASSERT_EQUAL_UINT32(UINT32_C(0x40000000) / 2000u, p.lock_sweep_q32); /* a quarter turn in half the time */
    TEST_ASSERT_EQUAL_UINT16(50, p.ready_slots);                              /* 20 ms */
    TEST_ASSERT_EQUAL_UINT16(500, p.ready_timeout_slots);                     /* 200 ms */
    TEST_ASSERT_EQUAL_UINT16(750, p.stall_slots);                             /* 0.3 s */
    TEST_ASSERT_EQUAL_UINT16(125, p.lost_lock_slots);                         /* 50 ms */
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
    TEST_ASSERT_INT16_WITHIN(1, 2386, NORM_DELTAT);
    TEST_ASSERT_INT16_WITHIN(1, 7051, NORM_RS);          /* 2.67 * I0/U0 * 2^14 */
    TEST_ASSERT_INT16_WITHIN(1, 594, NORM_LSDTBASE);     /* 1.92 mH / 66.667 us * I0/U0 * 2^7 */
    TEST_ASSERT_INT16_WITHIN(1, 13061, NORM_INVKFIBASE); /* sqrt(3) * 4000 * U0 / 7.24 * 2^14 */
    TEST_ASSERT_EQUAL_INT16(2667, PWM_FULL_DUTY);
    TEST_ASSERT_EQUAL_INT16(40, DEAD_TIME_DUTY);
    TEST_ASSERT_EQUAL_INT32(11200, NOMINAL_SPEED_ERPM);
}
