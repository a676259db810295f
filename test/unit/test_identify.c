/* The identification's arithmetic and its bookkeeping with exact data: numbers of 16 bits, sums, timing of the square voltage, results. */
/* defines: -DIDENTIFY */
#include "panel_rig.h"
#include "unity.h"

#include "firmware/drive/drive.c"
#include "firmware/drive/identify.c"
#include "firmware/drive/panel.c"

static identify_t *const id = &drive.identify;

void setUp(void)
{
    panel_reset();
    rig_ready();
    drive_start(&drive, &params, 1);
}

void tearDown(void)
{
}

/* ---- Numbers ---- */

static void expect_number(uint16_t m, int16_t e, identify_number_t n)
{
    TEST_ASSERT_EQUAL_UINT16(m, n.m);
    TEST_ASSERT_EQUAL_INT16(e, n.e);
}

void test_number_keeps_the_upper_16_bits(void)
{
    expect_number(0, 0, number_of(0));
    expect_number(32768u, -15, number_of(1));
    expect_number(65535u, 0, number_of(65535u));
    expect_number(32768u, 1, number_of(65536ul));
    expect_number(65535u, 16, number_of(0xFFFFFFFFul));
    expect_number(40000u, -3 - 4, number_scaled(5000u, 4));
}

void test_products_and_quotients_are_right_to_a_few_parts_in_65536(void)
{
    static const uint32_t value[] = { 1, 3, 19, 255, 4097, 50000ul, 65535ul, 1000003ul, 87654321ul };
    uint16_t i, j;
    for (i = 0; i < sizeof value / sizeof value[0]; i++) {
        for (j = 0; j < sizeof value / sizeof value[0]; j++) {
            identify_number_t p = number_mul(number_of(value[i]), number_of(value[j]));
            identify_number_t q = number_div(p, number_of(value[j]));
            uint32_t back = (q.e >= 0) ? (uint32_t)q.m << (uint16_t)q.e : (((uint32_t)q.m >> (uint16_t)(-q.e - 1)) + 1u) >> 1;
            uint32_t miss = (back > value[i]) ? back - value[i] : value[i] - back;
            TEST_ASSERT_TRUE(miss <= (value[i] >> 13));
        }
    }
}

void test_division_by_zero_gives_zero(void)
{
    expect_number(0, 0, number_div(number_of(7), number_of(0)));
    expect_number(0, 0, number_div(number_of(0), number_of(1)));
    TEST_ASSERT_EQUAL_UINT16(0, number_to_uint16(number_div(number_of(0), number_of(1))));
}

void test_whole_numbers_are_rounded_and_limited(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, number_to_uint16(number_of(0)));
    TEST_ASSERT_EQUAL_UINT16(1, number_to_uint16(number_of(1)));
    TEST_ASSERT_EQUAL_UINT16(3, number_to_uint16(number_scaled(5, 1)));
    TEST_ASSERT_EQUAL_UINT16(2, number_to_uint16(number_scaled(9, 2)));
    TEST_ASSERT_EQUAL_UINT16(1, number_to_uint16(number_scaled(1, 1)));
    TEST_ASSERT_EQUAL_UINT16(0, number_to_uint16(number_scaled(1, 2)));
    TEST_ASSERT_EQUAL_UINT16(65535u, number_to_uint16(number_of(65535u)));
    TEST_ASSERT_EQUAL_UINT16(65535u, number_to_uint16(number_of(65536ul)));
    TEST_ASSERT_EQUAL_UINT16(65535u, number_to_uint16(number_of(0xFFFFFFFFul)));
}

void test_signed_products(void)
{
    TEST_ASSERT_EQUAL_INT32(-100000l, number_times(-40000l, number_scaled(5, 1)));
    TEST_ASSERT_EQUAL_INT32(100000l, number_times(40000l, number_scaled(5, 1)));
    TEST_ASSERT_EQUAL_INT32(0, number_times(0, number_of(5)));
    TEST_ASSERT_EQUAL_INT32(0, number_times(3, number_scaled(1, 20)));
    TEST_ASSERT_EQUAL_INT32(0x3FFFFFFFl, number_times(0x3FFFFFFFl, number_of(65535u)));
    TEST_ASSERT_INT32_WITHIN(20000l, 1000000000l, number_times(1000000l, number_of(1000)));
}

void test_square_roots_are_exact(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, root(0));
    TEST_ASSERT_EQUAL_UINT16(1, root(3));
    TEST_ASSERT_EQUAL_UINT16(2, root(4));
    TEST_ASSERT_EQUAL_UINT16(23169u, root(536848899ul));
    TEST_ASSERT_EQUAL_UINT16(23170u, root(536848900ul));
    TEST_ASSERT_EQUAL_UINT16(46340u, root(0x7FFFFFFFul));
    TEST_ASSERT_EQUAL_UINT16(5, length(-3, 4));
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
    drive.control.ref_q13.d = 2000;
    standing_sums(15 + 358, 2000);
    id->step = IDENTIFY_ALIGN;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESISTANCE, id->step);
    TEST_ASSERT_EQUAL_INT16(params.open_loop_q13 >> 1, drive.control.ref_q13.d);
    standing_sums(15 + 179, 1000);
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_BIAS, id->step);
    TEST_ASSERT_UINT16_WITHIN(1, 1333, id->values.rs_mohm); /* 179 * 4 mV / 0.5371 A */
    TEST_ASSERT_INT32_WITHIN(1, 80, id->dead_q13); /* the 15 counts are those of 83.8 current counts; 3/pi of it when turning */
}

void test_slow_controller_follows_from_voltage_and_current_at_the_end_of_RISE(void)
{
    drive.control.v_q14.d = 4000;
    drive.control.i_q13.d = 1312;
    id->ready = 1;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_CONNECT, id->step);
    TEST_ASSERT_EQUAL_INT16(60, id->ki_d); /* 25 / s * 50 us * 2^14 = 20 times v / i */
    TEST_ASSERT_EQUAL_INT16(0, id->kp_d);
    TEST_ASSERT_EQUAL_INT16(0, id->ki_q);
    setUp();
    drive.control.v_q14.d = 10;
    drive.control.i_q13.d = 1312;
    id->ready = 1;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(1, id->ki_d); /* it moves, however small R is */
}

void test_slow_controller_of_a_tiny_current_stays_inside_the_division(void)
{
    id->rise_q13 = 2;
    drive.control.v_q14.d = 8000;
    drive.control.i_q13.d = 1; /* 160000 does not fit the quotient */
    id->ready = 1;
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(2500, id->ki_d); /* as for 64 counts */
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
    id->duty_per_amp = number_scaled(1, 3);
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

void test_absurd_back_emf_is_limited_before_it_is_squared(void)
{
    spin(IDENTIFY_SPIN_FULL, 40000u, 60000u);
    stretches(256, 0, 0, 8191, -8191);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_IDLE, id->step);
    TEST_ASSERT_EQUAL_INT32(-23170l * 256, id->emf_d_sum);
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
    (void)identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_SPIN_HALF, id->step);
    TEST_ASSERT_INT16_WITHIN(2, 1634, id->kp_d); /* 2 pi 200 Hz * 1.92 mH = 2.413 V/A; 0.6615 * 1024 counts each */
    TEST_ASSERT_INT16_WITHIN(2, 634, id->kp_q); /* 0.745 mH */
    TEST_ASSERT_EQUAL_INT16(id->ki_d, id->ki_q);
    TEST_ASSERT_INT16_WITHIN(1, 114, id->ki_d);  /* 2 pi 200 Hz * 2.67 ohm * 50 us = 0.1678 V/A a period */
    TEST_ASSERT_INT32_WITHIN(2, 2000l << 10, drive.control.pi_d.sum); /* nothing jumps */
    TEST_ASSERT_EQUAL_INT16(32767, gain(number_of(70000ul)));
    TEST_ASSERT_EQUAL_INT16(1, gain(number_scaled(1, 9)));
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
