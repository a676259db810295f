/* The parameter structure of the frozen Hurst motor, number by number, and what other motors and loop times make of it. */
#include "drive_rig.h"
#include "unity.h"

void setUp(void)
{
}

void tearDown(void)
{
}

/* ---- the note's constants for the Hurst motor; userparams.h holds 4.40 A full scale ---- */

void test_note_constants_at_4_40_A_full_scale(void)
{
    TEST_ASSERT_EQUAL_INT16(14470, NORM_RS);
    TEST_ASSERT_EQUAL_INT16(1626, NORM_LSDTBASE);
    TEST_ASSERT_EQUAL_INT16(7956, NORM_INVKFIBASE);
    TEST_ASSERT_EQUAL_INT16(1790, NORM_DELTAT);
    TEST_ASSERT_FLOAT_WITHIN(1e-9F, 4.05949e-4F, NORM_VOLTAGE_CONST);
}

void test_speeds_in_electrical_rpm(void)
{
    TEST_ASSERT_EQUAL_INT32(2500, MINIMUM_SPEED_ERPM);
    TEST_ASSERT_EQUAL_INT32(14000, NOMINAL_SPEED_ERPM);
    TEST_ASSERT_EQUAL_INT32(27500, MAXIMUMSPEED_ELECTR);
    TEST_ASSERT_EQUAL_INT32(5000, ENDSPEED_ELECTR);
    TEST_ASSERT_EQUAL_INT32(1400, DECIMATE_NOMINAL_SPEED);
    TEST_ASSERT_EQUAL_INT32(13000, FW_START_SPEED_ERPM);
}

void test_fractions_round_as_the_note_does(void)
{
    TEST_ASSERT_EQUAL_INT16(-16384, Q15(-0.5));
    TEST_ASSERT_EQUAL_INT16(16384, Q15(0.5)); /* 16383.5 + 0.5 */
    TEST_ASSERT_EQUAL_INT16(32734, Q15(0.999));
    TEST_ASSERT_EQUAL_INT16(0, Q15(0.0));
}

void test_currents_in_both_formats_agree(void)
{
    TEST_ASSERT_INT16_WITHIN(2, 10500, NORM_CURRENT(1.41));
    TEST_ASSERT_EQUAL_INT16(2625, CURRENT_Q13(1.41));
    TEST_ASSERT_EQUAL_INT16(-2625, CURRENT_Q13(-1.41));
}

/* ---- the drive's parameters ---- */

void test_times_in_periods_and_slow_steps(void)
{
    TEST_ASSERT_EQUAL_UINT16(200, params.bootstrap_periods);   /* 10 ms */
    TEST_ASSERT_EQUAL_UINT16(4000, params.lock_periods);       /* 0.2 s */
    TEST_ASSERT_EQUAL_UINT16(50, params.ready_slots);          /* 20 ms */
    TEST_ASSERT_EQUAL_UINT16(500, params.ready_timeout_slots); /* 0.2 s */
    TEST_ASSERT_EQUAL_UINT16(750, params.stall_slots);         /* 0.3 s */
    TEST_ASSERT_EQUAL_UINT16(125, params.lost_lock_slots);     /* 50 ms */
}

void test_currents_of_the_drive(void)
{
    TEST_ASSERT_EQUAL_INT16(2625, params.open_loop_q13);
    TEST_ASSERT_EQUAL_INT16(5120, params.current_max_q13);
    TEST_ASSERT_EQUAL_INT16(7075, params.overcurrent_q13);
    TEST_ASSERT_EQUAL_INT16(1489, params.fieldweak.trim_max_q13);
    TEST_ASSERT_EQUAL_INT16(1024, params.offset_max_q13);
    TEST_ASSERT_UINT16_WITHIN(1, 6554, params.current_max_reciprocal); /* 2^25 / 5120 */
    TEST_ASSERT_EQUAL_INT16(-16384, params.kcurr_a);
    TEST_ASSERT_EQUAL_INT16(-16384, params.kcurr_b);
}

void test_bus_levels(void)
{
    TEST_ASSERT_EQUAL_INT16(14895, params.bus_nominal_q15); /* 24 / 52.8 */
    TEST_ASSERT_EQUAL_INT16(16756, params.bus_regen_q15);   /* 27 / 52.8 */
    TEST_ASSERT_EQUAL_INT16(21101, params.bus_over_q15);
    TEST_ASSERT_EQUAL_INT16(7447, params.bus_under_q15);
}

void test_speeds_of_the_drive(void)
{
    TEST_ASSERT_EQUAL_INT16(2500, params.minimum_erpm);
    TEST_ASSERT_EQUAL_INT16(14000, params.nominal_erpm);
    TEST_ASSERT_EQUAL_INT16(27500, params.maximum_erpm);
    TEST_ASSERT_EQUAL_INT16(5000, params.end_erpm);
    TEST_ASSERT_EQUAL_INT16(8, params.speed_ramp_erpm);    /* 4000 rpm/s */
    TEST_ASSERT_EQUAL_INT32(32768, params.tuning_step_q16); /* 250 rpm/s */
    TEST_ASSERT_EQUAL_INT16(1750, params.ramp_hold_erpm);
}

void test_ramp_of_the_forced_angle(void)
{
    TEST_ASSERT_INT32_WITHIN(1, 279620, params.forced.end_speed_q10); /* 1000 rpm * 5 / 60 * 50 us * 65536 * 1024 */
    TEST_ASSERT_EQUAL_INT16(10, params.forced.increase_rate_q10);
    TEST_ASSERT_UINT32_WITHIN(1, 0x40000000ul / 2000ul, params.lock_sweep_q32);
}

void test_estimator_constants(void)
{
    /* Equation 5 in Q16 of Q14 current to Q13 voltage: Rs I0 / (2 U0) * 65536 = 28940 */
    TEST_ASSERT_UINT16_WITHIN(1, 28940, params.estimator.rs_q16);
    TEST_ASSERT_EQUAL_UINT16(0, params.estimator.rs_exp);
    TEST_ASSERT_UINT16_WITHIN(10, 52028, params.fieldweak.ls_base_q16); /* 1625.9 * 32 */
    TEST_ASSERT_EQUAL_UINT16(0, params.estimator.ls_exp);
    TEST_ASSERT_EQUAL_INT16(3579, params.estimator.deltat_q32);         /* 50 us / 60 * 2^32 */
    TEST_ASSERT_EQUAL_INT16(11244, params.estimator.half_step_q16_rad); /* 50 us * pi / 60 * 2^32 */
    TEST_ASSERT_EQUAL_INT16(1496, params.estimator.kfilter_velestim_q16);
    TEST_ASSERT_EQUAL_INT16(14000, params.estimator.nominal_erpm);
    TEST_ASSERT_EQUAL_INT16(1400, params.estimator.decimate_erpm);
}

void test_current_difference_limits_are_the_slope_of_the_largest_sine(void)
{
    /* 2 pi f Ts I: 0.396 A at 5500 rpm, 0.2016 A at 2800 rpm; Q14 counts of 0.26855 mA */
    TEST_ASSERT_INT16_WITHIN(2, 1474, params.estimator.d_ilimit_hs_q14);
    TEST_ASSERT_INT16_WITHIN(4, 6005, params.estimator.d_ilimit_ls_q14);
}

void test_current_controllers_cancel_the_motors_pole(void)
{
    /* Kp = 2 pi 800 Hz L = 9.651 V/A, Ki = 2 pi 800 Hz R Ts = 0.6710 V/A; Q13 error (0.5371 mA) to Q14 volts (0.8119 mV) << 10 */
    TEST_ASSERT_INT16_WITHIN(6, 6538, params.pi_d.kp);
    TEST_ASSERT_INT16_WITHIN(2, 455, params.pi_d.ki);
    TEST_ASSERT_EQUAL_UINT16(10, params.pi_d.shift);
    TEST_ASSERT_EQUAL_INT16(Q15(0.999), params.pi_d.kc);
    TEST_ASSERT_EQUAL_INT16(params.pi_d.kp, params.pi_q.kp);
    TEST_ASSERT_EQUAL_INT16(params.pi_d.ki, params.pi_q.ki);
    TEST_ASSERT_EQUAL_INT16(params.pi_d.kc, params.pi_q.kc);
    TEST_ASSERT_EQUAL_UINT16(params.pi_d.shift, params.pi_q.shift);
}

void test_speed_controller_has_its_bandwidth(void)
{
    /* Kp = 2 pi 25 Hz J / Kt = 0.3020 mA per erpm = 0.5622 counts << 13; zero at 8.33 Hz, 400 us steps */
    TEST_ASSERT_INT16_WITHIN(10, 4607, params.pi_speed.kp);
    TEST_ASSERT_INT16_WITHIN(1, 96, params.pi_speed.ki);
    TEST_ASSERT_EQUAL_UINT16(13, params.pi_speed.shift);
}

void test_modulator_constants(void)
{
    TEST_ASSERT_EQUAL_INT16(2000, params.svm.full);
    TEST_ASSERT_EQUAL_INT16(1872, params.svm.top);      /* 1.6 us of 25 us */
    TEST_ASSERT_EQUAL_INT16(80, params.svm.dead_time);  /* 2 us of 50 us */
    TEST_ASSERT_INT16_WITHIN(1, 737, params.svm.turn_q13); /* 0.396 A a period at 5500 rpm and 2.75 A */
    /* the compensation is whole at the knee, and no steeper than a duty count per current count */
    TEST_ASSERT_TRUE(params.svm.knee_q13 >= params.svm.dead_time && params.svm.knee_q13 <= 4 * params.svm.dead_time);
    TEST_ASSERT_INT16_WITHIN(1, params.svm.dead_time, qm_mulhi_su(params.svm.knee_q13, params.svm.dead_slope_q16));
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
    TEST_ASSERT_EQUAL_INT16(13000, params.fieldweak.on_speed_erpm);
    TEST_ASSERT_EQUAL_INT16(2 * KFILTER_ESDQ, params.fieldweak.kfilter_esdq_q16);
    TEST_ASSERT_EQUAL_INT16(2 * KFILTER_ESDQ_FW, params.fieldweak.kfilter_esdq_fw_q16);
    TEST_ASSERT_INT16_WITHIN(1, 296, params.fieldweak.margin_q14); /* 1 % of 24 V */
    TEST_ASSERT_EQUAL_INT16(7800, params.fieldweak.trim_speed_erpm);
}

/* ---- other parameter sets: the same macros with other values ---- */

#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST 0.00012054443 /* 3.95 A full scale: the 2012 set */

void test_note_constants_at_3_95_A_are_the_published_ones(void)
{
    TEST_ASSERT_EQUAL_INT16(12990, NORM_RS);
    TEST_ASSERT_INT16_WITHIN(1, 1460, NORM_LSDTBASE); /* 1459.5 */
    TEST_ASSERT_EQUAL_INT16(7956, NORM_INVKFIBASE);
    TEST_ASSERT_EQUAL_INT16(1790, NORM_DELTAT);
}

#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST 0.00021636963 /* 7.09 A full scale: the 2014 set */

void test_note_constants_at_7_09_A_are_the_published_ones(void)
{
    TEST_ASSERT_INT16_WITHIN(1, 23316, NORM_RS);
    TEST_ASSERT_EQUAL_INT16(2620, NORM_LSDTBASE);
}

#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST 0.000121

void test_1_41_A_is_11653_counts_at_the_calibrated_scale(void)
{
    TEST_ASSERT_EQUAL_INT16(11653, NORM_CURRENT(1.41));
    TEST_ASSERT_EQUAL_INT16(2913, CURRENT_Q13(1.41));
}

#undef NORM_CURRENT_CONST
#define NORM_CURRENT_CONST 0.0001342773

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
#undef MOTOR_RS_OHM
#define MOTOR_RS_OHM 10.0
#undef MOTOR_LS_MH
#define MOTOR_LS_MH 6.0
static const drive_params_t big_motor = DRIVE_PARAMS_INIT;

void test_large_resistance_and_inductance_take_an_exponent(void)
{
    /* 108389 and 162587 in Q16 */
    TEST_ASSERT_EQUAL_UINT16(1, big_motor.estimator.rs_exp);
    TEST_ASSERT_UINT16_WITHIN(3, 54195, big_motor.estimator.rs_q16);
    TEST_ASSERT_EQUAL_UINT16(2, big_motor.estimator.ls_exp);
    TEST_ASSERT_UINT16_WITHIN(6, 40647, big_motor.fieldweak.ls_base_q16);
}

#undef MOTOR_RS_OHM
#define MOTOR_RS_OHM 2.67
#undef MOTOR_LS_MH
#define MOTOR_LS_MH 1.92
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
