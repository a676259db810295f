/* The identification's bookkeeping with exact data: sums, timing of the square voltage, results. */
/* defines: -DIDENTIFY */
#include "panel_rig.h"
#include "unity.h"

#include "firmware/drive/drive.c"
#include "firmware/drive/modes/identify.c"
#include "firmware/drive/panel.c"

static identify_t *const id = &drive.run.identify;

void setUp(void)
{
    panel_reset();
    rig_ready();
    drive_start(&drive, &params, 1);
}

void tearDown(void)
{
}

/* ---- Sums ---- */

#define BUS_Q16 29789u /* 24 V */

/** A mean over 4096 periods of a resistance at some current, with the voltage that dead time leaves over. */
static void standing_sums(int32_t duty, int32_t i_q13)
{
    id->sum[0] = duty << MEAN_LOG2;
    id->sum[1] = i_q13 << MEAN_LOG2;
    id->sum[2] = -(i_q13 << (MEAN_LOG2 - 1));
    id->sum[3] = (int32_t)BUS_Q16 << MEAN_LOG2;
    id->ready = 1;
}

/* 1 ohm: 24 V / 6000 duty counts = 4 mV, 0.5371 mA a current count: 0.134273 duty counts each */
void test_two_exact_levels_give_R_to_a_milliohm(void)
{
    drive.run.control.ref_q13.d = 2000;
    standing_sums(15 + 358, 2000);
    id->step = IDENTIFY_ALIGN;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESISTANCE, id->step);
    TEST_ASSERT_EQUAL_INT16(params.open_loop_q13 >> 1, drive.run.control.ref_q13.d);
    standing_sums(15 + 179, 1000);
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_BIAS, id->step);
    TEST_ASSERT_UINT16_WITHIN(1, 1333, id->values.rs_mohm); /* 179 * 4 mV / 0.5371 A */
    TEST_ASSERT_INT32_WITHIN(1, 80, id->dead_q13); /* the 15 counts are those of 83.8 current counts; 3/pi of it when turning */
}

void test_slow_controller_follows_from_voltage_and_current_at_the_end_of_RISE(void)
{
    drive.run.control.v_q14.d = 4000;
    drive.run.control.i_q13.d = 1312;
    id->ready = 1;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_CONNECT, id->step);
    TEST_ASSERT_EQUAL_INT16(60, id->ki_d); /* 25 / s * 50 us * 2^14 = 20 times v / i */
    TEST_ASSERT_EQUAL_INT16(0, id->kp_d);
    TEST_ASSERT_EQUAL_INT16(0, id->ki_q);
    setUp();
    drive.run.control.v_q14.d = 10;
    drive.run.control.i_q13.d = 1312;
    id->ready = 1;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(1, id->ki_d); /* it moves, however small R is */
}

void test_slow_controller_of_a_tiny_current_stays_inside_the_division(void)
{
    id->rise_q13 = 2;
    drive.run.control.v_q14.d = 8000;
    drive.run.control.i_q13.d = 1; /* 160000 does not fit the quotient */
    id->ready = 1;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(2500, id->ki_d); /* as for 64 counts */
}

void test_current_that_breaks_down_at_the_end_of_RISE_counts_as_half_of_what_was_reached(void)
{
    id->rise_q13 = 1312;
    drive.run.control.v_q14.d = 4000;
    drive.run.control.i_q13.d = 100;
    id->ready = 1;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(4000l * 20 / 656, id->ki_d);
}

void test_voltage_grows_by_a_128th_every_16_periods_while_the_current_rises(void)
{
    int16_t n;
    (void)rig_tick_until(DRIVE_ALIGN, params.bootstrap_periods + 2u);
    TEST_ASSERT_EQUAL_INT16(16, drive.run.control.v_q14.d);
    drive.run.control.pi_d.sum = 128l << 14;
    drive.ticks = 0;
    for (n = 0; n < 16; n++) {
        (void)identify_voltage(&drive, 1);
        drive.ticks++;
    }
    TEST_ASSERT_EQUAL_INT32(129l << 14, drive.run.control.pi_d.sum);
    drive.ticks = 17; /* the even half of 32 periods is as good as the odd one */
    for (n = 0; n < 15; n++) {
        (void)identify_voltage(&drive, 1);
        drive.ticks++;
    }
    TEST_ASSERT_EQUAL_INT32(129l << 14, drive.run.control.pi_d.sum);
    TEST_ASSERT_EQUAL_INT16(130, identify_voltage(&drive, 1).d);
    id->ready = 1;
    TEST_ASSERT_EQUAL_INT16(130, identify_voltage(&drive, 1).d);
}

/** CONNECT with a current in phase B against the frame's d axis, and its half in phase A. @return the step after it */
static uint16_t connect_with(int16_t mean_q13, int16_t v_q14)
{
    setUp();
    drive.run.control.ref_q13.d = 1600;
    drive.run.control.v_q14.d = v_q14;
    id->step = IDENTIFY_CONNECT;
    id->sum[1] = (int32_t)mean_q13 << (MEAN_LOG2 - 1);
    id->sum[2] = -((int32_t)mean_q13 << MEAN_LOG2);
    id->ready = 1;
    (void)identify_background(&drive, &params);
    return id->step;
}

void test_current_an_eighth_below_its_reference_is_reached_and_less_is_not(void)
{
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_ALIGN, connect_with(1400, 4000));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_IDLE, connect_with(1399, 4000));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_CURRENT_NOT_REACHED, id->result);
}

void test_less_than_a_quarter_of_the_reference_is_no_current(void)
{
    (void)connect_with(400, 4000);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_CURRENT_NOT_REACHED, id->result);
    (void)connect_with(399, 4000);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NO_CURRENT, id->result);
}

void test_current_that_takes_three_quarters_of_the_circle_is_not_reached(void)
{
    int16_t most = identify_most(&drive.circle);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_ALIGN, connect_with(1600, (int16_t)(most - 1)));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_IDLE, connect_with(1600, most));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_CURRENT_NOT_REACHED, id->result);
}

/** CONNECT at full current in phase B; phases A and C share it unequally. @return the result */
static uint16_t connect_with_phase_a(int16_t a_q13)
{
    setUp();
    drive.run.control.ref_q13.d = 1600;
    drive.run.control.v_q14.d = 4000;
    id->step = IDENTIFY_CONNECT;
    id->sum[1] = (int32_t)a_q13 << MEAN_LOG2;
    id->sum[2] = -(1600l << MEAN_LOG2);
    id->ready = 1;
    (void)identify_background(&drive, &params);
    return id->result;
}

void test_phases_that_share_a_current_very_unequally_are_not_connected(void)
{
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, connect_with_phase_a(1200));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NO_CURRENT, connect_with_phase_a(1201));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, connect_with_phase_a(400));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NO_CURRENT, connect_with_phase_a(399));
}

void test_sweep_ends_exactly_along_phase_A(void)
{
    uint16_t n;
    id->mode = (uint16_t)IDENTIFY_CURRENT;
    id->sweep = 1;
    for (n = 0; n < 20000u && id->sweep; n++) {
        TEST_ASSERT_EQUAL_UINT16(0, identify_turn(&drive, &params));
    }
    TEST_ASSERT_UINT16_WITHIN(10, 10000, n); /* half a second */
    TEST_ASSERT_EQUAL_HEX32(0, drive.forced.angle_q32);
    TEST_ASSERT_EQUAL_UINT16(1, identify_turn(&drive, &params));
}

void test_resistance_out_of_range_is_named(void)
{
    static const int32_t second[] = { 373, 400, 372 }; /* none, negative, 8 mohm */
    uint16_t n;
    for (n = 0; n < 3u; n++) {
        setUp();
        id->duty_first = (int32_t)373 << MEAN_LOG2;
        id->i_first = (int32_t)2000 << MEAN_LOG2;
        id->bus_first = (int32_t)BUS_Q16 << MEAN_LOG2;
        id->step = IDENTIFY_RESISTANCE;
        standing_sums(second[n], 1000);
        TEST_ASSERT_EQUAL_UINT16(1, identify_background(&drive, &params));
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_R_RANGE, id->result);
        TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    }
}

/** Two levels that differ by a sum of duties and a sum of current counts. @return the result */
static uint16_t resistance_of(int32_t duty, int32_t i)
{
    setUp();
    id->duty_first = duty;
    id->i_first = i;
    id->bus_first = (int32_t)BUS_Q16 << MEAN_LOG2;
    id->step = IDENTIFY_RESISTANCE;
    id->sum[3] = (int32_t)BUS_Q16 << MEAN_LOG2;
    id->ready = 1;
    (void)identify_background(&drive, &params);
    return id->result;
}

void test_resistance_is_believed_from_20_mohm_to_40_ohm(void)
{
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_R_RANGE, resistance_of(10725, 4096000l));
    TEST_ASSERT_EQUAL_UINT16(19, id->values.rs_mohm);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, resistance_of(10726, 4096000l));
    TEST_ASSERT_EQUAL_UINT16(20, id->values.rs_mohm);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, resistance_of(22887000l, 4261000l));
    TEST_ASSERT_EQUAL_UINT16(40000u, id->values.rs_mohm);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_R_RANGE, resistance_of(22887500l, 4261000l));
    TEST_ASSERT_EQUAL_UINT16(40001u, id->values.rs_mohm);
}

void test_smallest_difference_of_two_levels_gives_a_resistance(void)
{
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, resistance_of(1, 1));
    TEST_ASSERT_UINT16_WITHIN(2, 7448, id->values.rs_mohm); /* a count of 4 mV over one of 0.5371 mA */
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_R_RANGE, resistance_of(0, 1));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_R_RANGE, resistance_of(1, 0));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_R_RANGE, resistance_of(1, -1));
}

/** Sums of a coil whose current changes by di in a period between samples in which the voltage had one sign, by nothing where it
 *  changed. @return uH */
static uint16_t coil(int16_t duties, int16_t di_q13, uint16_t on_q)
{
    int16_t n, before = 0, i_q13 = 1000;
    id->mode = (uint16_t)IDENTIFY_INJECT;
    id->on_q = on_q;
    id->half_left = 2;
    id->half = 4;
    go(id, IDENTIFY_INDUCTANCE_D, 8, 800);
    drive.bus_q31 = (int32_t)(BUS_Q16 / 2u) * 65536 + 32768;
    for (n = 0; n < 808; n++) {
        int16_t sign;
        i_q13 = (int16_t)(i_q13 + di_q13 * (id->sign + before) / 2);
        before = id->sign;
        drive.i_a_q13 = (int16_t)(on_q ? 0 : i_q13);
        drive.i_b_q13 = (int16_t)(on_q ? i_q13 / 2 : 0);
        identify_record(&drive, &params, 1);
        sign = identify_square(id);
        id->sign_before = id->sign;
        id->sign = sign;
        id->duty = (int16_t)(500 + sign * duties); /* the bias has no say */
        id->i_before_q13 = identify_current(&drive);
    }
    TEST_ASSERT_EQUAL_UINT16(1, id->ready);
    return inductance(id);
}

/* L = 50 us * duties * 4 mV / (di * 0.5371 mA) */
void test_exact_square_wave_gives_L_exactly(void)
{
    TEST_ASSERT_UINT16_WITHIN(1, 745, coil(200, 100, 0));
    TEST_ASSERT_UINT16_WITHIN(1, 1490, coil(400, 100, 1));
    TEST_ASSERT_UINT16_WITHIN(1, 149, coil(40, 100, 0));
    TEST_ASSERT_UINT16_WITHIN(30, 18617, coil(1000, 20, 0));
}

void test_periods_in_which_the_voltage_changes_sign_do_not_count(void)
{
    (void)coil(200, 100, 0);
    TEST_ASSERT_EQUAL_INT32(600l * 400, id->sum[0]); /* three of four periods, two duties each */
    TEST_ASSERT_EQUAL_INT32(600l * 100, id->sum[2]);
    TEST_ASSERT_EQUAL_INT32(0, id->sum[1]);
}

void test_resistance_is_taken_from_the_voltage(void)
{
    uint16_t without = coil(200, 100, 0);
    id->duty_per_amp = soft_float_scaled(1, 3);
    id->sum[1] = 80000l;
    TEST_ASSERT_UINT16_WITHIN(1, (uint16_t)((uint32_t)without * 230u / 240u), inductance(id));
}

void test_time_constant_of_two_periods_costs_its_two_per_cent(void)
{
    uint16_t without = coil(200, 100, 0);
    id->values.rs_mohm = (uint16_t)(10u * without); /* R Ts = L / 2 */
    TEST_ASSERT_UINT16_WITHIN(1, (uint16_t)(without - (without * 3u + 64u) / 128u), inductance(id));
}

void test_sums_without_sense_are_no_inductance(void)
{
    (void)coil(200, 100, 0);
    id->sum[2] = 0;
    TEST_ASSERT_EQUAL_UINT16(0, inductance(id));
    id->sum[2] = -5;
    TEST_ASSERT_EQUAL_UINT16(0, inductance(id));
    id->sum[2] = 60000l;
    id->sum[0] = 0;
    TEST_ASSERT_EQUAL_UINT16(0, inductance(id));
    id->sum[0] = 600;
    TEST_ASSERT_EQUAL_UINT16(0, inductance(id)); /* 2 uH */
    (void)coil(200, 100, 0);
    id->values.rs_mohm = 40000u;
    TEST_ASSERT_EQUAL_UINT16(0, inductance(id)); /* the time constant is below half a period */
}

/** Sums of a coil without resistance. @return uH */
static uint16_t coil_of(int32_t volts, int32_t change)
{
    id->values.rs_mohm = 0;
    id->duty_per_amp = soft_float_of(0);
    id->bus_q16 = BUS_Q16;
    id->sum[0] = volts;
    id->sum[2] = change;
    return inductance(id);
}

void test_inductance_is_believed_from_20_uH_to_60_mH(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, coil_of(6284, 60000l));
    TEST_ASSERT_EQUAL_UINT16(20, coil_of(6285, 60000l));
    TEST_ASSERT_EQUAL_UINT16(60000u, coil_of(19338200l, 60000l));
    TEST_ASSERT_EQUAL_UINT16(0, coil_of(19338300l, 60000l));
}

void test_resistance_within_a_period_may_take_less_than_half_of_the_inductance(void)
{
    (void)coil(200, 100, 0);
    id->values.rs_mohm = 34350u;
    TEST_ASSERT_EQUAL_UINT16(374, inductance(id));
    id->values.rs_mohm = 34360u;
    TEST_ASSERT_EQUAL_UINT16(0, inductance(id));
}

/* ---- The square voltage and its search ---- */

void test_square_voltage_has_halves_of_the_asked_length(void)
{
    static const int16_t expected[] = { 1, 1, -1, -1, -1, -1, 1, 1, 1, 1, -1 };
    uint16_t n;
    id->half = 4;
    id->half_left = 2;
    for (n = 0; n < sizeof expected / sizeof expected[0]; n++) {
        id->sign = identify_square(id);
        TEST_ASSERT_EQUAL_INT16(expected[n], id->sign);
    }
}

static void try_with(int16_t square_q14, uint16_t half, int32_t seen)
{
    id->mode = (uint16_t)IDENTIFY_INJECT;
    id->step = IDENTIFY_TRY_D;
    id->bias_q14 = 1000;
    id->square_q14 = square_q14;
    id->half = half;
    id->sum[2] = seen;
    id->ready = 1;
    (void)identify_background(&drive, &params);
}

void test_search_doubles_the_voltage_then_the_length(void)
{
    int16_t most = square_most(&drive);
    try_with(100, 4, 10);
    TEST_ASSERT_EQUAL_INT16(200, id->square_q14);
    TEST_ASSERT_EQUAL_UINT16(4, id->half);
    most = square_most(&drive);
    try_with((int16_t)(most / 2 + 10), 4, 10);
    TEST_ASSERT_EQUAL_INT16(most, id->square_q14);
    try_with(most, 4, 10);
    TEST_ASSERT_EQUAL_INT16(most, id->square_q14);
    TEST_ASSERT_EQUAL_UINT16(8, id->half);
    TEST_ASSERT_EQUAL_UINT16(512, id->left);
    try_with(most, 64, 10);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_L_RANGE, id->result);
}

void test_search_ends_at_a_sixth_of_the_current(void)
{
    try_with(100, 4, (int32_t)(params.open_loop_q13 >> 1) * 21 - 1);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_TRY_D, id->step);
    try_with(100, 4, (int32_t)(params.open_loop_q13 >> 1) * 21);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_INDUCTANCE_D, id->step);
    TEST_ASSERT_EQUAL_UINT16(8192, id->left);
}

void test_search_on_the_q_axis_ends_at_the_same_current(void)
{
    id->on_q = 1; /* phase A + 2 B is 1.73 times as much; 1.5 is asked for */
    try_with(100, 4, (int32_t)(params.open_loop_q13 - (params.open_loop_q13 >> 2)) * 21 - 1);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_TRY_D, id->step);
    try_with(100, 4, (int32_t)(params.open_loop_q13 - (params.open_loop_q13 >> 2)) * 21);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_INDUCTANCE_D, id->step);
}

void test_every_square_voltage_has_two_cycles_to_settle(void)
{
    try_with(100, 16, 10);
    TEST_ASSERT_EQUAL_UINT16(64, id->wait);
    TEST_ASSERT_EQUAL_UINT16(1024, id->left);
    try_with(100, 16, 100000l);
    TEST_ASSERT_EQUAL_UINT16(64, id->wait);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_INDUCTANCE_D, id->step);
}

void test_search_starts_with_a_128th_of_the_circle_and_short_halves(void)
{
    id->step = IDENTIFY_BIAS;
    drive.run.control.v_q14.d = 3000;
    id->ready = 1;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_TRY_D, id->step);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_INJECT, id->mode);
    TEST_ASSERT_EQUAL_INT16(3000, id->bias_q14);
    TEST_ASSERT_EQUAL_INT16(drive.circle.limit_q14 >> 7, id->square_q14);
    TEST_ASSERT_EQUAL_UINT16(4, id->half);
    TEST_ASSERT_EQUAL_UINT16(16, id->wait);
    TEST_ASSERT_EQUAL_UINT16(256, id->left);
}

void test_search_on_the_q_axis_starts_with_half_the_square_of_the_d_axis(void)
{
    (void)coil(200, 100, 0);
    id->step = IDENTIFY_INDUCTANCE_D;
    id->square_q14 = 700;
    id->half = 8;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_TRY_Q, id->step);
    TEST_ASSERT_EQUAL_UINT16(1, id->on_q);
    TEST_ASSERT_EQUAL_INT16(350, id->square_q14);
    TEST_ASSERT_EQUAL_UINT16(32, id->wait);
    TEST_ASSERT_EQUAL_UINT16(512, id->left);
}

void test_inductance_that_cannot_be_ends_the_procedure_on_either_axis(void)
{
    static const identify_step_t step[] = { IDENTIFY_INDUCTANCE_D, IDENTIFY_INDUCTANCE_Q };
    uint16_t n;
    for (n = 0; n < 2u; n++) {
        setUp();
        id->step = (uint16_t)step[n];
        id->ready = 1; /* no sums at all */
        (void)identify_background(&drive, &params);
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_IDLE, id->step);
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_L_RANGE, id->result);
    }
}

void test_square_voltage_is_added_to_the_bias_on_one_axis_only(void)
{
    dq_t v;
    id->mode = (uint16_t)IDENTIFY_INJECT;
    id->bias_q14 = 3000;
    id->square_q14 = 700;
    v = identify_voltage(&drive, -1);
    TEST_ASSERT_EQUAL_INT16(2300, v.d);
    TEST_ASSERT_EQUAL_INT16(0, v.q);
    id->on_q = 1;
    v = identify_voltage(&drive, -1);
    TEST_ASSERT_EQUAL_INT16(3000, v.d);
    TEST_ASSERT_EQUAL_INT16(-700, v.q);
}

void test_square_voltage_begins_in_the_middle_of_a_half(void)
{
    static const int16_t expected[] = { 1, 1, -1, -1, -1, -1, 1 };
    uint16_t n;
    for (n = 0; n < sizeof expected / sizeof expected[0]; n++) {
        id->sign = identify_square(id);
        TEST_ASSERT_EQUAL_INT16(expected[n], id->sign);
    }
}

/* ---- Back-EMF ---- */

/** One stretch: means of voltage and current. */
static void stretch(int16_t v_d, int16_t v_q, int16_t i_d, int16_t i_q)
{
    id->sum[0] = (int32_t)v_d * 32;
    id->sum[1] = (int32_t)v_q * 32;
    id->sum[2] = (int32_t)i_d * 32;
    id->sum[3] = (int32_t)i_q * 32;
    id->ready = 1;
    (void)identify_background(&drive, &params);
}

static void spin(identify_step_t step, uint16_t rs_mohm, uint16_t ld_uh)
{
    setUp();
    id->step = (uint16_t)step;
    id->halvings = (uint16_t)(step == IDENTIFY_SPIN_HALF);
    id->values.rs_mohm = rs_mohm;
    id->values.ld_uh = ld_uh;
    id->kphi_half = 7240;
}

static void stretches(uint16_t count, int16_t v_d, int16_t v_q, int16_t i_d, int16_t i_q)
{
    while (count-- != 0u) {
        stretch(v_d, v_q, i_d, i_q);
    }
}

/* 1000 rpm, 7.24 V line to line: 4.18 V = 5148 counts of 0.8119 mV */
void test_back_emf_of_a_current_free_motor_is_the_voltage(void)
{
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretches(256, 3089, 4118, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, id->result);
    TEST_ASSERT_UINT16_WITHIN(3, 7240, id->values.kphi_mv_per_krpm);
}

/* 1.41 A: R i = 3.765 V = 4637 counts, w L i = 523.6 * 1.92 mH * 1.41 A = 1.4175 V = 1746 counts */
void test_R_and_L_are_taken_from_it(void)
{
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretches(256, 4637, 1746 + 5148, 2625, 0);
    TEST_ASSERT_UINT16_WITHIN(4, 7240, id->values.kphi_mv_per_krpm);
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretches(256, -1746, 4637 + 5148, 0, 2625);
    TEST_ASSERT_UINT16_WITHIN(4, 7240, id->values.kphi_mv_per_krpm);
}

void test_what_dead_time_takes_along_the_current_is_taken_from_it(void)
{
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    id->dead_q13 = 656;
    stretches(256, 4637 + 1159, 1746 + 5148, 2625, 0); /* a quarter of R i more */
    TEST_ASSERT_UINT16_WITHIN(4, 7240, id->values.kphi_mv_per_krpm);
    TEST_ASSERT_INT32_WITHIN(256l * 4, 0, id->emf_d_sum);
}

void test_half_speed_is_followed_by_full_speed(void)
{
    spin(IDENTIFY_SPIN_HALF, 2670, 1920);
    stretches(256, 0, 2574, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_SPIN_FULL, id->step);
    TEST_ASSERT_EQUAL_UINT16(0, id->halvings);
    TEST_ASSERT_UINT16_WITHIN(4, 7240, id->kphi_half);
    TEST_ASSERT_EQUAL_UINT16(0, id->values.kphi_mv_per_krpm);
    TEST_ASSERT_EQUAL_UINT16(0, id->blocks);
}

void test_swinging_does_not_shorten_the_mean(void)
{
    uint16_t n;
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    for (n = 0; n < 128u; n++) {
        stretch(1760, 4838, 0, 0); /* 20 degrees to one side */
        stretch(-1760, 4838, 0, 0);
    }
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, id->result);
    TEST_ASSERT_UINT16_WITHIN(4, 7240, id->values.kphi_mv_per_krpm);
}

/** Stretches of 5148 counts that point to both sides of an axis in turn. @return the result */
static uint16_t swing(int16_t along, int16_t across, uint16_t along_q)
{
    uint16_t n;
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    for (n = 0; n < 128u; n++) {
        stretch(along_q ? across : along, along_q ? along : across, 0, 0);
        stretch(along_q ? (int16_t)-across : along, along_q ? along : (int16_t)-across, 0, 0);
    }
    return id->result;
}

void test_stretches_agree_when_they_lie_within_41_degrees_to_both_sides(void)
{
    uint16_t on_q;
    for (on_q = 0; on_q < 2u; on_q++) {
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, swing(3944, 3309, on_q)); /* 40 degrees */
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, swing(3765, 3511, on_q)); /* 43 degrees */
    }
}

void test_each_stretch_is_followed_by_the_next_until_there_are_256(void)
{
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretches(255, 0, 5148, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_SPIN_FULL, id->step);
    TEST_ASSERT_EQUAL_UINT16(0, id->ready);
    TEST_ASSERT_EQUAL_UINT16(0, id->wait);
    TEST_ASSERT_EQUAL_UINT16(32, id->left);
    TEST_ASSERT_EQUAL_INT32(0, id->sum[1]);
    stretch(0, 5148, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, id->result);
}

void test_half_and_full_speed_agree_within_an_eighth(void)
{
    static const struct {
        int16_t half_more;
        identify_result_t expected;
    } cases[] = { { 904, IDENTIFY_RESULT_DONE }, { 905, IDENTIFY_RESULT_NOT_TURNING },
                  { -904, IDENTIFY_RESULT_DONE }, { -905, IDENTIFY_RESULT_NOT_TURNING } };
    uint16_t n;
    for (n = 0; n < 4u; n++) {
        spin(IDENTIFY_SPIN_FULL, 2670, 1920);
        stretches(256, 0, 5148, 0, 0);
        TEST_ASSERT_EQUAL_UINT16(7239, id->values.kphi_mv_per_krpm); /* an eighth is 904 */
        spin(IDENTIFY_SPIN_FULL, 2670, 1920);
        id->kphi_half = (uint16_t)(7239 + cases[n].half_more);
        stretches(256, 0, 5148, 0, 0);
        TEST_ASSERT_EQUAL_UINT16(cases[n].expected, id->result);
    }
}

/** At 7/40 of the usual speed: a few stretches with a count more. @return the result */
static uint16_t slow_spin(int16_t v_q, uint16_t more)
{
    drive_params_t slow = params;
    uint16_t n;
    slow.forced.end_speed_q10 = (uint16_t)(params.forced.end_speed_q10 / 40 * 7);
    spin(IDENTIFY_SPIN_HALF, 0, 0);
    for (n = 0; n < 256u; n++) {
        id->sum[0] = 0;
        id->sum[1] = (int32_t)(v_q + (n < more)) * 32;
        id->ready = 1;
        (void)identify_background(&drive, &slow);
    }
    return id->result;
}

void test_back_emf_is_believed_from_500_to_65000_mV(void)
{
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, slow_spin(31, 19));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, slow_spin(31, 20));
    TEST_ASSERT_EQUAL_UINT16(500, id->kphi_half);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, slow_spin(4044, 63));
    TEST_ASSERT_EQUAL_UINT16(64999u, id->kphi_half);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_KPHI_RANGE, slow_spin(4044, 64));
}

void test_slipping_missing_or_constant_back_emf_is_not_turning(void)
{
    uint16_t n;
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    for (n = 0; n < 64u; n++) {
        stretch(5148, 0, 0, 0);
        stretch(0, 5148, 0, 0);
        stretch(-5148, 0, 0, 0);
        stretch(0, -5148, 0, 0);
    }
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, id->result);
    spin(IDENTIFY_SPIN_HALF, 2670, 1920);
    stretches(256, 0, 150, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, id->result);
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretches(256, 0, 4400, 0, 0); /* 15 % less than at half speed */
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, id->result);
}

void test_voltage_at_the_limit_is_named(void)
{
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretch(0, (int16_t)(drive.circle.limit_q14 - 100), 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_VOLTAGE_LIMIT, id->result);
}

void test_voltage_limit_is_seven_eighths_of_the_circle(void)
{
    int16_t most = (int16_t)(drive.circle.limit_q14 - (drive.circle.limit_q14 >> 3));
    spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretch(0, most, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, id->result);
    stretch((int16_t)-most, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, id->result);
    stretch(0, (int16_t)(most + 1), 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_VOLTAGE_LIMIT, id->result);
}

void test_absurd_back_emf_is_limited_before_it_is_squared(void)
{
    spin(IDENTIFY_SPIN_FULL, 40000u, 60000u);
    stretches(256, 0, 0, 8191, -8191);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_IDLE, id->step);
    TEST_ASSERT_EQUAL_INT32(-23170l * 256, id->emf_d_sum);
}

void test_mean_of_a_stretch_is_limited_to_what_can_be_squared_in_31_bits(void)
{
    TEST_ASSERT_EQUAL_INT16(23170, emf_mean(23170l * 32));
    TEST_ASSERT_EQUAL_INT16(23170, emf_mean(23171l * 32));
    TEST_ASSERT_EQUAL_INT16(23170, emf_mean(1000000l * 32));
    TEST_ASSERT_EQUAL_INT16(-23170, emf_mean(-23170l * 32));
    TEST_ASSERT_EQUAL_INT16(-23170, emf_mean(-23171l * 32));
    TEST_ASSERT_EQUAL_INT16(-23170, emf_mean(-1000000l * 32));
}

/* ---- Gains ---- */

void test_current_gains_follow_from_R_and_L(void)
{
    (void)coil(200, 100, 0);
    id->step = IDENTIFY_INDUCTANCE_Q;
    id->values.rs_mohm = 2670;
    id->values.ld_uh = 1920;
    id->bias_q14 = 2000;
    id->ready = 1;
    drive.run.control.pi_q.sum = 100000l;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_SPIN_HALF, id->step);
    TEST_ASSERT_INT16_WITHIN(2, 1634, id->kp_d); /* 2 pi 200 Hz * 1.92 mH = 2.413 V/A; 0.6615 * 1024 counts each */
    TEST_ASSERT_INT16_WITHIN(2, 634, id->kp_q); /* 0.745 mH */
    TEST_ASSERT_EQUAL_INT16(id->ki_d, id->ki_q);
    TEST_ASSERT_INT16_WITHIN(1, 114, id->ki_d);  /* 2 pi 200 Hz * 2.67 ohm * 50 us = 0.1678 V/A a period */
    TEST_ASSERT_INT32_WITHIN(2, 2000l << 10, drive.run.control.pi_d.sum); /* nothing jumps */
    TEST_ASSERT_EQUAL_INT32(0, drive.run.control.pi_q.sum);
    TEST_ASSERT_EQUAL_UINT16(SETTLE_PERIODS, id->wait);
    TEST_ASSERT_EQUAL_UINT16(32, id->left);
    TEST_ASSERT_EQUAL_UINT16(0, id->blocks);
    TEST_ASSERT_EQUAL_INT16(32767, gain(soft_float_of(70000ul)));
    TEST_ASSERT_EQUAL_INT16(32767, gain(soft_float_of(32768ul)));
    TEST_ASSERT_EQUAL_INT16(32767, gain(soft_float_of(32767ul)));
    TEST_ASSERT_EQUAL_INT16(1, gain(soft_float_scaled(1, 9)));
}

void test_each_axis_has_its_own_gain(void)
{
    dq_t v;
    id->mode = (uint16_t)IDENTIFY_CURRENT;
    id->shift = 10;
    id->kp_d = 1024;
    id->kp_q = 3072;
    id->ki_d = 1;
    id->ki_q = 2;
    drive.run.control.pi_d.sum = 0;
    drive.run.control.pi_q.sum = 0;
    drive.run.control.ref_q13.d = 100;
    drive.run.control.ref_q13.q = 100;
    drive.run.control.i_q13.d = 0;
    drive.run.control.i_q13.q = 0;
    v = identify_voltage(&drive, 1);
    TEST_ASSERT_EQUAL_INT16(100, v.d);
    TEST_ASSERT_EQUAL_INT16(300, v.q);
    TEST_ASSERT_EQUAL_INT32(100, drive.run.control.pi_d.sum);
    TEST_ASSERT_EQUAL_INT32(200, drive.run.control.pi_q.sum);
}

/* ---- Hand-over between interrupt and background ---- */

void test_sums_begin_after_the_wait_and_only_while_settled(void)
{
    id->mode = (uint16_t)IDENTIFY_CURRENT;
    go(id, IDENTIFY_CONNECT, 3, 2);
    drive.i_a_q13 = 7;
    identify_record(&drive, &params, 0);
    TEST_ASSERT_EQUAL_UINT16(3, id->wait);
    identify_record(&drive, &params, 1);
    identify_record(&drive, &params, 1);
    identify_record(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT32(0, id->sum[1]);
    identify_record(&drive, &params, 1);
    TEST_ASSERT_EQUAL_UINT16(0, id->ready);
    identify_record(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT32(14, id->sum[1]);
    TEST_ASSERT_EQUAL_UINT16(1, id->ready);
    identify_record(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT32(14, id->sum[1]);
}

void test_background_does_nothing_until_the_interrupt_is_ready(void)
{
    id->step = IDENTIFY_ALIGN;
    id->ready = 0;
    TEST_ASSERT_EQUAL_UINT16(0, identify_background(&drive, &params));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_ALIGN, id->step);
}
