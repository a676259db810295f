/* The identification's bookkeeping with exact data: sums, timing of the square voltage, inertia and friction, results. */
/* defines: -DIDENTIFY */
#include "hurst_params.h"

#include "law.c"
#include "panel_rig.h"

#include "drive/request.h"

static identify_t *const id = &drive.run.identify;
static drive_control_t *const control = &drive.run.control;

void setUp(void)
{
    panel_reset();
    rig_ready();
    drive_start(&drive, &params, 1);
}

/** A step that the interrupt has finished, for the background. @return the result so far */
static uint16_t finished(identify_step_t step)
{
    uint16_t ended;
    id->step = (uint16_t)step;
    id->ready = 1;
    ended = identify_background(&drive, &params);
    TEST_ASSERT_EQUAL_UINT16(id->step == (uint16_t)IDENTIFY_IDLE, ended);
    return id->result;
}

static void set_sums(int32_t a, int32_t b, int32_t c, int32_t d)
{
    id->sum[0] = a;
    id->sum[1] = b;
    id->sum[2] = c;
    id->sum[3] = d;
}

/* ---- Rise: the slow controller ---- */

void test_slow_controller_follows_from_voltage_and_current_at_the_end_of_RISE(void)
{
    static const struct {
        const char *what;
        int16_t v_q14, i_q13, rise_q13, ki; /* 25 / s * 50 us * 2^14 = 20 times v / i */
    } cases[] = {
        { "usual", 4000, 1312, 0, 60 },
        { "it moves, however small R is", 10, 1312, 0, 1 },
        { "a tiny current, as for 64 counts, stays inside the division", 8000, 1, 2, 2500 },
        { "a current that breaks down counts as half of what was reached", 4000, 100, 1312, 4000l * 20 / 656 },
    };
    EACH(n, cases) {
        setUp();
        control->v_q14.d = cases[n].v_q14;
        control->i_q13.d = cases[n].i_q13;
        if (cases[n].rise_q13 != 0) {
            id->rise_q13 = cases[n].rise_q13;
        }
        (void)finished(IDENTIFY_RISE);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(IDENTIFY_CONNECT, id->step, cases[n].what);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].ki, id->ki_d, cases[n].what);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(0, id->kp_d, cases[n].what);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(0, id->ki_q, cases[n].what);
    }
}

void test_voltage_grows_by_a_128th_every_16_periods_while_the_current_rises(void)
{
    int16_t n;
    (void)rig_tick_until(DRIVE_ALIGN, params.bootstrap_periods + 2u);
    rig_tick(1);
    TEST_ASSERT_EQUAL_INT16(16, control->v_q14.d);
    control->pi_d.sum = 128l << 14;
    for (n = 0; n < 31; n++) {
        drive.ticks = (uint16_t)((n < 16) ? n : n + 1); /* the even half of 32 periods is as good as the odd one */
        (void)identify_voltage(&drive, 1);
        TEST_ASSERT_EQUAL_INT32(129l << 14, control->pi_d.sum);
    }
    drive.ticks = 32;
    TEST_ASSERT_EQUAL_INT16(130, identify_voltage(&drive, 1).d);
    id->ready = 1;
    TEST_ASSERT_EQUAL_INT16(130, identify_voltage(&drive, 1).d);
}

/* ---- Connect ---- */

void test_current_must_reach_its_reference_within_the_voltage_and_the_phases_must_share_it(void)
{
    enum { REF = 1600 };
    static const struct {
        const char *what;
        int16_t b_q13; /* twice the current along phase B, against the frame's d axis */
        int16_t a_q13; /* twice that of phase A */
        int16_t v_below_most;
        identify_result_t result;
    } cases[] = {
        { "an eighth below", 2 * 1400, 1400, 1, IDENTIFY_RESULT_BUSY },
        { "less", 2 * 1399, 1399, 1, IDENTIFY_RESULT_CURRENT_NOT_REACHED },
        { "a quarter", 2 * 400, 400, 1, IDENTIFY_RESULT_CURRENT_NOT_REACHED },
        { "less than a quarter", 2 * 399, 399, 1, IDENTIFY_RESULT_NO_CURRENT },
        { "at three quarters of the circle", 2 * REF, REF, 0, IDENTIFY_RESULT_CURRENT_NOT_REACHED },
        { "phase A has three quarters", 2 * REF, 2 * 1200, 1, IDENTIFY_RESULT_BUSY },
        { "more", 2 * REF, 2 * 1201, 1, IDENTIFY_RESULT_NO_CURRENT },
        { "phase A has a quarter", 2 * REF, 2 * 400, 1, IDENTIFY_RESULT_BUSY },
        { "less than that", 2 * REF, 2 * 399, 1, IDENTIFY_RESULT_NO_CURRENT },
    };
    EACH(n, cases) {
        setUp();
        control->ref_q13.d = REF;
        control->v_q14.d = (int16_t)(identify_most(&drive.circle) - cases[n].v_below_most);
        id->across_q13 = (int16_t)((2 * cases[n].a_q13 - cases[n].b_q13) / 2); /* as it was before: the rotor rests */
        set_sums(0, (int32_t)cases[n].a_q13 << (MEAN_LOG2 - 1), -((int32_t)cases[n].b_q13 << (MEAN_LOG2 - 1)), 0);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].result, finished(IDENTIFY_CONNECT), cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].result == IDENTIFY_RESULT_BUSY ? IDENTIFY_ALIGN : IDENTIFY_IDLE, id->step, cases[n].what);
    }
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

/* ---- Resistance ---- */

#define BUS_Q16 29789u /* 24 V */
#define BUS_SUM ((int32_t)BUS_Q16 << MEAN_LOG2)

/* 1 ohm: 24 V / 6000 duty counts = 4 mV, 0.5371 mA a current count: 0.134273 duty counts each; dead time leaves 15 over */
void test_two_exact_levels_give_R_to_a_milliohm(void)
{
    control->ref_q13.d = 2000;
    set_sums((15l + 358) << MEAN_LOG2, 2000l << MEAN_LOG2, -(1000l << MEAN_LOG2), BUS_SUM);
    (void)finished(IDENTIFY_ALIGN);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESISTANCE, id->step);
    TEST_ASSERT_EQUAL_INT16(params.open_loop_q13 >> 1, control->ref_q13.d);
    set_sums((15l + 179) << MEAN_LOG2, 1000l << MEAN_LOG2, -(500l << MEAN_LOG2), BUS_SUM);
    (void)finished(IDENTIFY_RESISTANCE);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_BIAS, id->step);
    TEST_ASSERT_UINT32_WITHIN(500, 1333200, id->values.rs_uohm); /* 179 * 4 mV / 0.5371 A */
    TEST_ASSERT_INT32_WITHIN(1, 80, id->dead_q13); /* the 15 counts are those of 83.8 current counts; 3/pi of it when turning */
}

void test_resistance_is_believed_from_5_mohm_to_40_ohm(void)
{
    static const struct {
        int32_t duty, i; /* by how much two levels differ */
        uint32_t rs_uohm, tolerance;
        identify_result_t result;
    } cases[] = {
        { 2749, 4096000l, 4998, 2, IDENTIFY_RESULT_R_RANGE },
        { 2751, 4096000l, 5002, 2, IDENTIFY_RESULT_BUSY },
        { 22885000l, 4261000l, 39998000ul, 2000, IDENTIFY_RESULT_BUSY },
        { 22889500l, 4261000l, 40005000ul, 2000, IDENTIFY_RESULT_R_RANGE },
        { 1, 1, 7448000ul, 2000, IDENTIFY_RESULT_BUSY }, /* a count of 4 mV over one of 0.5371 mA */
        { 0, 1, 0, 0, IDENTIFY_RESULT_R_RANGE },
        { 1, 0, 0, 0, IDENTIFY_RESULT_R_RANGE },
        { 1, -1, 0, 0, IDENTIFY_RESULT_R_RANGE },
        { -27 * (1l << MEAN_LOG2), 1000l << MEAN_LOG2, 0, 0, IDENTIFY_RESULT_R_RANGE },
    };
    EACH(n, cases) {
        setUp();
        id->duty_first = cases[n].duty;
        id->i_first = cases[n].i;
        id->bus_first = BUS_SUM;
        set_sums(0, 0, 0, BUS_SUM);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].result, finished(IDENTIFY_RESISTANCE), golden_row(n));
        TEST_ASSERT_UINT32_WITHIN_MESSAGE(cases[n].tolerance, cases[n].rs_uohm, id->values.rs_uohm, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].result == IDENTIFY_RESULT_BUSY, drive.command.run, golden_row(n));
    }
}

/* ---- Inductance ---- */

/** Sums of a coil whose current changes by di in a period between samples in which the voltage had one sign, by nothing where it
 *  changed. @return nH */
static uint32_t coil(int16_t duties, int16_t di_q13, uint16_t on_q)
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
        drive.phases_q13.a = (int16_t)(on_q ? 0 : i_q13);
        drive.phases_q13.b = (int16_t)(on_q ? i_q13 / 2 : 0);
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
    TEST_ASSERT_UINT32_WITHIN(300, 1489600, coil(400, 100, 1));
    TEST_ASSERT_UINT32_WITHIN(30, 148960, coil(40, 100, 0));
    TEST_ASSERT_UINT32_WITHIN(4000, 18620000ul, coil(1000, 20, 0));
    TEST_ASSERT_UINT32_WITHIN(200, 744800, coil(200, 100, 0));
    TEST_ASSERT_EQUAL_INT32(600l * 400, id->sum[0]); /* three of four periods, without a change of sign: two duties each */
    TEST_ASSERT_EQUAL_INT32(600l * 100, id->sum[2]);
    TEST_ASSERT_EQUAL_INT32(0, id->sum[1]);
}

void test_resistance_is_taken_from_the_voltage_and_corrects_a_short_time_constant(void)
{
    uint32_t without = coil(200, 100, 0);
    id->duty_per_amp = soft_float_scaled(1, 3);
    id->sum[1] = 80000l;
    TEST_ASSERT_UINT32_WITHIN(100, without * 23u / 24u, inductance(id));
    without = coil(200, 100, 0);
    id->duty_per_amp = soft_float_of(0);
    id->values.rs_uohm = 10u * without; /* R Ts = L / 2: its two per cent */
    TEST_ASSERT_UINT32_WITHIN(100, without - without * 3u / 128u, inductance(id));
    id->values.rs_uohm = 34380000ul; /* R may take less than half of the inductance within a period */
    TEST_ASSERT_UINT32_WITHIN(600, 373000, inductance(id));
    id->values.rs_uohm = 34440000ul;
    TEST_ASSERT_EQUAL_UINT32(0, inductance(id));
    id->values.rs_uohm = 40000000ul; /* the time constant is below half a period */
    TEST_ASSERT_EQUAL_UINT32(0, inductance(id));
}

void test_inductance_is_believed_from_5_uH_to_60_mH_and_sums_without_sense_are_none(void)
{
    static const struct {
        int32_t volts, change;
        uint32_t nh, tolerance;
    } cases[] = {
        { 1611, 60000l, 0, 0 }, { 1612, 60000l, 5000, 5 }, { 19337000l, 60000l, 59998000ul, 3000 }, { 19341000l, 60000l, 0, 0 },
        { 240000l, 0, 0, 0 }, { 240000l, -5, 0, 0 }, { 0, 60000l, 0, 0 }, { 600, 60000l, 0, 0 }, /* the last: 2 uH */
    };
    static const identify_step_t axes[] = { IDENTIFY_INDUCTANCE_D, IDENTIFY_INDUCTANCE_Q };
    EACH(n, cases) {
        id->values.rs_uohm = 0;
        id->duty_per_amp = soft_float_of(0);
        id->bus_q16 = BUS_Q16;
        set_sums(cases[n].volts, 0, cases[n].change, 0);
        TEST_ASSERT_UINT32_WITHIN_MESSAGE(cases[n].tolerance, cases[n].nh, inductance(id), golden_row(n));
    }
    EACH(n, axes) { /* no sums at all end the procedure */
        setUp();
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_L_RANGE, finished(axes[n]));
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_IDLE, id->step);
    }
}

/* ---- The square voltage and its search ---- */

void test_square_voltage_begins_in_the_middle_of_a_half_and_is_added_to_the_bias_on_one_axis_only(void)
{
    static const int16_t expected[] = { 1, 1, -1, -1, -1, -1, 1, 1, 1, 1, -1 };
    dq_t v;
    EACH(n, expected) {
        id->sign = identify_square(id);
        TEST_ASSERT_EQUAL_INT16(expected[n], id->sign);
    }
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

/** A step of the search that has seen this change of current. */
static void expect_search(int16_t square_q14, uint16_t half, int32_t seen, identify_step_t step, int16_t next_q14, uint16_t next_half)
{
    id->mode = (uint16_t)IDENTIFY_INJECT;
    id->bias_q14 = 1000;
    id->square_q14 = square_q14;
    id->half = half;
    id->sum[2] = seen;
    (void)finished(IDENTIFY_TRY_D);
    TEST_ASSERT_EQUAL_UINT16(step, id->step);
    TEST_ASSERT_EQUAL_INT16(next_q14, id->square_q14);
    TEST_ASSERT_EQUAL_UINT16(next_half, id->half);
    TEST_ASSERT_EQUAL_UINT16(4u * next_half, id->wait); /* two cycles to settle */
    TEST_ASSERT_EQUAL_UINT16((step == IDENTIFY_TRY_D) ? 64u * next_half : 8192u, id->left);
}

void test_search_doubles_the_voltage_then_the_length_and_ends_at_a_sixth_of_the_current(void)
{
    int32_t enough_d = (int32_t)(params.open_loop_q13 >> 1) * 21;
    int32_t enough_q = (int32_t)(params.open_loop_q13 - (params.open_loop_q13 >> 2)) * 21; /* A + 2 B is 1.73 times A; 1.5 is asked for */
    int16_t most;
    id->bias_q14 = 1000;
    most = square_most(&drive);
    expect_search(100, 4, 10, IDENTIFY_TRY_D, 200, 4);
    expect_search(100, 16, 10, IDENTIFY_TRY_D, 200, 16);
    expect_search((int16_t)(most / 2 + 10), 4, 10, IDENTIFY_TRY_D, most, 4);
    expect_search(most, 4, 10, IDENTIFY_TRY_D, most, 8);
    expect_search(100, 4, enough_d - 1, IDENTIFY_TRY_D, 200, 4);
    expect_search(100, 4, enough_d, IDENTIFY_INDUCTANCE_D, 100, 4);
    expect_search(100, 16, 100000l, IDENTIFY_INDUCTANCE_D, 100, 16);
    id->on_q = 1;
    expect_search(100, 4, enough_q - 1, IDENTIFY_TRY_D, 200, 4);
    expect_search(100, 4, enough_q, IDENTIFY_INDUCTANCE_D, 100, 4);
    id->on_q = 0;
    id->square_q14 = most;
    id->half = 64;
    id->sum[2] = 10;
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_L_RANGE, finished(IDENTIFY_TRY_D));
}

void test_the_largest_square_voltage_and_the_bias_are_seven_eighths_of_the_circle(void)
{
    static const int16_t biases[] = { 0, 1000, 5000 };
    EACH(n, biases) {
        id->bias_q14 = biases[n];
        TEST_ASSERT_INT16_WITHIN(1, (int16_t)(7 * (int32_t)drive.circle.limit_q14 / 8), (int16_t)(square_most(&drive) + biases[n]));
    }
}

void test_search_starts_with_a_128th_of_the_circle_and_on_the_q_axis_with_half_the_square_of_the_d_axis(void)
{
    control->v_q14.d = 3000;
    (void)finished(IDENTIFY_BIAS);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_TRY_D, id->step);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_INJECT, id->mode);
    TEST_ASSERT_EQUAL_INT16(3000, id->bias_q14);
    TEST_ASSERT_EQUAL_INT16(drive.circle.limit_q14 >> 7, id->square_q14);
    TEST_ASSERT_EQUAL_UINT16(4, id->half);
    TEST_ASSERT_EQUAL_UINT16(16, id->wait);
    TEST_ASSERT_EQUAL_UINT16(256, id->left);
    (void)coil(200, 100, 0);
    id->square_q14 = 700;
    id->half = 8;
    (void)finished(IDENTIFY_INDUCTANCE_D);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_TRY_Q, id->step);
    TEST_ASSERT_EQUAL_UINT16(1, id->on_q);
    TEST_ASSERT_EQUAL_INT16(350, id->square_q14);
    TEST_ASSERT_EQUAL_UINT16(32, id->wait);
    TEST_ASSERT_EQUAL_UINT16(512, id->left);
}

/* ---- Back-EMF ---- */

static void begin_spin(identify_step_t step, uint16_t rs_mohm, uint16_t ld_uh)
{
    setUp();
    id->step = (uint16_t)step;
    id->halvings = (uint16_t)(step == IDENTIFY_SPIN_HALF);
    id->values.rs_uohm = 1000ul * rs_mohm;
    id->values.ld_nh = 1000ul * ld_uh;
    id->kphi_half = 7240000ul;
}

/** Stretches with these means of voltage and current. */
static void stretches(uint16_t count, int16_t v_d, int16_t v_q, int16_t i_d, int16_t i_q)
{
    while (count-- != 0u) {
        set_sums((int32_t)v_d * 32, (int32_t)v_q * 32, (int32_t)i_d * 32, (int32_t)i_q * 32);
        id->ready = 1;
        (void)identify_background(&drive, &params);
    }
}

/** Pairs of stretches, the voltage turned to one side and to the other. @return the result */
static uint16_t swing(int16_t d, int16_t q, int16_t other_d, int16_t other_q)
{
    uint16_t n;
    begin_spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    for (n = 0; n < 128u; n++) {
        stretches(1, d, q, 0, 0);
        stretches(1, other_d, other_q, 0, 0);
    }
    return id->result;
}

/* 1000 rpm, 7.24 V line to line: 4.18 V = 5148 counts of 0.8119 mV. 1.41 A: R i = 3.765 V = 4637 counts,
 * w L i = 523.6 * 1.92 mH * 1.41 A = 1.4175 V = 1746 counts. */
void test_back_emf_is_the_voltage_less_R_L_and_dead_time(void)
{
    static const struct {
        const char *what;
        int16_t v_d, v_q, i_d, i_q, dead_q13;
    } cases[] = {
        { "no current", 3089, 4118, 0, 0, 0 },
        { "along d", 4637, 1746 + 5148, 2625, 0, 0 },
        { "along q", -1746, 4637 + 5148, 0, 2625, 0 },
        { "dead time takes a quarter of R i more", 4637 + 1159, 1746 + 5148, 2625, 0, 656 },
    };
    EACH(n, cases) {
        begin_spin(IDENTIFY_SPIN_FULL, 2670, 1920);
        id->dead_q13 = cases[n].dead_q13;
        stretches(256, cases[n].v_d, cases[n].v_q, cases[n].i_d, cases[n].i_q);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(IDENTIFY_RESULT_BUSY, id->result, cases[n].what);
        TEST_ASSERT_UINT32_WITHIN_MESSAGE(4000, 7240000ul, id->values.kphi_uv_per_krpm, cases[n].what);
    }
    TEST_ASSERT_INT32_WITHIN(256l * 4, 0, id->emf_d_sum);
}

void test_half_speed_is_followed_by_full_speed(void)
{
    begin_spin(IDENTIFY_SPIN_HALF, 2670, 1920);
    stretches(256, 0, 2574, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_SPIN_FULL, id->step);
    TEST_ASSERT_EQUAL_UINT16(0, id->halvings);
    TEST_ASSERT_UINT32_WITHIN(4000, 7240000ul, id->kphi_half);
    TEST_ASSERT_EQUAL_UINT32(0, id->values.kphi_uv_per_krpm);
    TEST_ASSERT_EQUAL_UINT16(0, id->blocks);
    TEST_ASSERT_EQUAL_INT32(0, id->emf_d_sum);
    TEST_ASSERT_EQUAL_INT32(0, id->emf_q_sum);
}

void test_full_speed_follows_where_twice_the_voltage_is_fifteen_sixteenths_of_the_circle_exactly(void)
{
    static const struct {
        int16_t limit_q14;
        identify_result_t result;
    } cases[] = { { 5491, IDENTIFY_RESULT_BUSY }, { 5490, IDENTIFY_RESULT_VOLTAGE_LIMIT } }; /* 5148 and 5147 */
    EACH(n, cases) {
        begin_spin(IDENTIFY_SPIN_HALF, 2670, 1920);
        drive.circle.limit_q14 = cases[n].limit_q14;
        stretches(256, 0, 2574, 0, 0);
        TEST_ASSERT_EQUAL_UINT16(cases[n].result, id->result);
    }
}

void test_stretches_agree_when_they_lie_within_41_degrees_to_both_sides_and_swinging_does_not_shorten_the_mean(void)
{
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, swing(1760, 4838, -1760, 4838)); /* 20 degrees */
    TEST_ASSERT_UINT32_WITHIN(4000, 7240000ul, id->values.kphi_uv_per_krpm);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, swing(3944, 3309, 3944, -3309)); /* 40 degrees */
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, swing(3309, 3944, -3309, 3944));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, swing(3765, 3511, 3765, -3511)); /* 43 degrees */
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, swing(3511, 3765, -3511, 3765));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, swing(5148, 0, -5148, 0)); /* it slips */
}

void test_each_stretch_is_followed_by_the_next_until_there_are_256(void)
{
    begin_spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretches(255, 0, 5148, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_SPIN_FULL, id->step);
    TEST_ASSERT_EQUAL_UINT16(0, id->ready);
    TEST_ASSERT_EQUAL_UINT16(0, id->wait);
    TEST_ASSERT_EQUAL_UINT16(32, id->left);
    TEST_ASSERT_EQUAL_INT32(0, id->sum[1]);
    stretches(1, 0, 5148, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_MECHANICS, id->step);
}

void test_half_and_full_speed_agree_within_an_eighth(void)
{
    static const struct {
        int16_t half_more;
        identify_result_t expected;
    } cases[] = { { 900, IDENTIFY_RESULT_BUSY }, { 910, IDENTIFY_RESULT_NOT_TURNING },
                  { -900, IDENTIFY_RESULT_BUSY }, { -910, IDENTIFY_RESULT_NOT_TURNING } };
    EACH(n, cases) {
        begin_spin(IDENTIFY_SPIN_FULL, 2670, 1920);
        id->kphi_half = 1000ul * (uint16_t)(7239 + cases[n].half_more); /* an eighth is 904.9 */
        stretches(256, 0, 5148, 0, 0);
        TEST_ASSERT_EQUAL_UINT16(cases[n].expected, id->result);
    }
}

/** At 7/40 of the usual speed, and a share of that: a few stretches with a count more. @return the result */
static uint16_t slow_spin(uint16_t share, int16_t v_q, uint16_t more)
{
    drive_params_t slow = params;
    uint16_t n;
    slow.forced.end_speed_q10 = params.forced.end_speed_q10 / 40 * 7 / share;
    begin_spin(IDENTIFY_SPIN_HALF, 0, 0);
    for (n = 0; n < 256u; n++) {
        id->sum[0] = 0;
        id->sum[1] = (int32_t)(v_q + (n < more)) * 32;
        id->ready = 1;
        (void)identify_background(&drive, &slow);
    }
    return id->result;
}

void test_back_emf_is_believed_from_a_tenth_of_a_volt_to_2000_V(void)
{
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_NOT_TURNING, slow_spin(1, 6, 50));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, slow_spin(1, 6, 60));
    TEST_ASSERT_UINT32_WITHIN(2000, 100400, id->kphi_half);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, slow_spin(32, 3875, 0));
    TEST_ASSERT_UINT32_WITHIN(4000000ul, 1995000000ul, id->kphi_half);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_KPHI_RANGE, slow_spin(32, 3895, 0));
}

void test_back_emf_below_an_eighth_of_what_the_inductance_takes_is_a_blocked_shaft(void)
{
    static const struct {
        int16_t emf;
        identify_result_t result;
    } cases[] = { { 210, IDENTIFY_RESULT_NOT_TURNING }, { 226, IDENTIFY_RESULT_BUSY } }; /* w L I: 1746 counts */
    EACH(n, cases) {
        begin_spin(IDENTIFY_SPIN_FULL, 2670, 1920);
        id->kphi_half = (uint32_t)cases[n].emf * 1406u;
        stretches(256, 4637, (int16_t)(1746 + cases[n].emf), 2625, 0);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].result, id->result, golden_row(n));
    }
}

void test_voltage_limit_is_seven_eighths_of_the_circle(void)
{
    int16_t most = (int16_t)(drive.circle.limit_q14 - (drive.circle.limit_q14 >> 3));
    begin_spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    stretches(1, 0, most, 0, 0);
    stretches(1, (int16_t)-most, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_BUSY, id->result);
    stretches(1, 0, (int16_t)(most + 1), 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_VOLTAGE_LIMIT, id->result);
}

void test_mean_of_a_stretch_is_limited_to_what_can_be_squared_in_31_bits(void)
{
    static const int32_t cases[][2] = { { 23170, 23170 }, { 23171, 23170 }, { 1000000l, 23170 } };
    EACH(n, cases) {
        TEST_ASSERT_EQUAL_INT16(cases[n][1], emf_mean(cases[n][0] * 32));
        TEST_ASSERT_EQUAL_INT16(-cases[n][1], emf_mean(-cases[n][0] * 32));
    }
    begin_spin(IDENTIFY_SPIN_FULL, 40000u, 60000u);
    stretches(256, 0, 0, 8191, -8191);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_IDLE, id->step);
    TEST_ASSERT_EQUAL_INT32(-23170l * 256, id->emf_d_sum);
}

/* ---- Inertia and friction ---- */

typedef struct {
    float inertia, coulomb_nm, viscous_nms, speed;
    int16_t most_q13, brakes;
} shaft_t;

#define RAD_S_TO_Q10 (5.0F / 6.2831853F * 67108864.0F * 0.00005F)
#define NM_PER_COUNT (1.5F * 7.24F / 1.7320508F / 104.71976F * 4.0F * 0.000134F) /* 7.24 V/krpm */

/** SPIN_FULL has found 7.24 V/krpm at the header's speed. */
static void begin_mechanics(int16_t v_d)
{
    begin_spin(IDENTIFY_SPIN_FULL, 2670, 1920);
    id->values.lq_nh = 60000000ul; /* so large that the samples miss nothing worth a count */
    id->ki_q = 100;
    stretches(256, v_d, 5148, 0, 0);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_MECHANICS, id->step);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_FOLLOW, id->mode);
    TEST_ASSERT_EQUAL_INT16(0, control->ref_q13.d);
    TEST_ASSERT_EQUAL_INT16(id->push_q13, control->ref_q13.q);
}

void test_the_frame_follows_a_quick_rotor_with_controllers_twice_as_fast_and_no_less_integral_than_damps(void)
{
    enum { LOOP = 671088 }; /* 200 Hz, as the current controllers: 0.01 turns a period */
    static const struct {
        uint32_t speed;
        int16_t kp, ki, follow_kp, ki_d, ki_q;
    } cases[] = {
        { LOOP - 10, 1600, 110, 1600, 110, 440 }, { LOOP - 10, 800, 4, 800, 50, 50 }, { LOOP + 10, 1600, 110, 3200, 400, 440 },
        { LOOP + 10, 800, 300, 1600, 300, 1200 }, { LOOP + 10, 20000, 20000, 32767, 20000, 32767 }
    };
    EACH(n, cases) {
        id->kp_d = cases[n].kp;
        id->kp_q = cases[n].kp;
        id->ki_d = cases[n].ki;
        id->ki_q = cases[n].ki;
        follow_gains(id, cases[n].speed);
        TEST_ASSERT_EQUAL_INT16(cases[n].follow_kp, id->kp_d);
        TEST_ASSERT_EQUAL_INT16(cases[n].follow_kp, id->kp_q);
        TEST_ASSERT_EQUAL_INT16(cases[n].ki_d, id->ki_d);
        TEST_ASSERT_EQUAL_INT16(cases[n].ki_q, id->ki_q);
    }
}

/** A shaft answers the q current, a stretch and eight periods for the background at a time. @return seconds until the end */
static float turn_shaft(shaft_t *shaft)
{
    float seconds = 0.0F;
    while (id->step == (uint16_t)IDENTIFY_MECHANICS && seconds < 200.0F) {
        uint16_t left = id->left;
        float step_s = (float)(left + 8u) * 0.00005F;
        float torque = NM_PER_COUNT * (float)control->ref_q13.q - shaft->coulomb_nm - shaft->viscous_nms * shaft->speed;
        shaft->speed += torque / shaft->inertia * step_s;
        shaft->most_q13 = (control->ref_q13.q > shaft->most_q13) ? control->ref_q13.q : shaft->most_q13;
        shaft->brakes = (int16_t)(shaft->brakes | (control->ref_q13.q < 0));
        id->at = (uint16_t)(id->at + left + 8u);
        set_sums((int32_t)(shaft->speed * RAD_S_TO_Q10) * (int32_t)left, (int32_t)control->ref_q13.q * (int32_t)left, 0, 0);
        id->ready = 1;
        (void)identify_background(&drive, &params);
        seconds += step_s;
    }
    return seconds;
}

void test_inertia_and_friction_of_an_exact_shaft(void)
{
    static const shaft_t cases[] = {
        { 5.5e-6F, 0.004F, 15.3e-6F, 105.0F, 0, 0 }, { 2e-4F, 0.004F, 15.3e-6F, 105.0F, 0, 0 }, { 1.8e-6F, 0.002F, 0.0F, 105.0F, 0, 0 },
        { 2e-5F, 0.0F, 30e-6F, 105.0F, 0, 0 }, { 5.5e-6F, 0.02F, 0.0F, 105.0F, 0, 0 },
    };
    EACH(n, cases) {
        shaft_t shaft = cases[n];
        begin_mechanics((int16_t)(n * 100));
        (void)turn_shaft(&shaft);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(IDENTIFY_RESULT_DONE, id->result, golden_row(n));
        TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.02F * shaft.inertia + 1e-9F, shaft.inertia, (float)id->values.inertia_1e9_kgm2 * 1e-9F, golden_row(n));
        TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.03F * shaft.coulomb_nm + 1.2e-4F, shaft.coulomb_nm, (float)id->values.coulomb_1e8_nm * 1e-8F, golden_row(n));
        TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.03F * shaft.viscous_nms + 2.5e-6F, shaft.viscous_nms, (float)id->values.viscous_1e9_nms * 1e-9F, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(0, shaft.brakes, "it never brakes");
        TEST_ASSERT_TRUE(shaft.most_q13 <= params.open_loop_q13);
    }
}

void test_a_shaft_without_friction_coasts_twice_for_ten_seconds_and_has_an_inertia(void)
{
    shaft_t shaft = { 5.5e-6F, 0.0F, 0.0F, 105.0F, 0, 0 };
    begin_mechanics(0);
    TEST_ASSERT_FLOAT_WITHIN(2.0F, 22.0F, turn_shaft(&shaft)); /* at two speeds */
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESULT_DONE, id->result);
    TEST_ASSERT_UINT32_WITHIN(120, 5500, id->values.inertia_1e9_kgm2);
    TEST_ASSERT_UINT32_WITHIN(4000, 0, id->values.coulomb_1e8_nm);
    TEST_ASSERT_UINT32_WITHIN(100, 0, id->values.viscous_1e9_nms);
}

void test_a_shaft_that_does_not_accelerate_gets_more_current_up_to_all_of_it_and_then_its_name(void)
{
    static const shaft_t cases[] = { { 2.0F, 0.004F, 0.0F, 105.0F, 0, 0 }, { 1e-4F, 0.1F, 0.0F, 105.0F, 0, 0 } };
    EACH(n, cases) {
        shaft_t shaft = cases[n];
        begin_mechanics(0);
        (void)turn_shaft(&shaft);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(IDENTIFY_RESULT_NOT_ACCELERATING, id->result, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(params.open_loop_q13, shaft.most_q13, golden_row(n));
        TEST_ASSERT_UINT32_WITHIN(4000, 7240000ul, id->values.kphi_uv_per_krpm);
        TEST_ASSERT_EQUAL_UINT32(0, id->values.inertia_1e9_kgm2);
    }
}

void test_an_inertia_or_friction_beyond_the_range_is_named_and_not_a_value(void)
{
    static const struct {
        const char *what;
        uint32_t kphi_uv;
        int32_t push_slope, coast_slope;
        identify_result_t result;
    } cases[] = {
        { "usual", 7240000ul, 40000l, -4000l, IDENTIFY_RESULT_DONE },
        { "too heavy", 1000000000ul, 400l, -40l, IDENTIFY_RESULT_INERTIA_RANGE },
        { "too light", 100000ul, 400000000l, -4000l, IDENTIFY_RESULT_INERTIA_RANGE },
        { "too much friction", 400000000ul, 40000l, -400000l, IDENTIFY_RESULT_FRICTION_RANGE },
    };
    EACH(n, cases) {
        uint16_t part;
        begin_mechanics(0);
        id->values.kphi_uv_per_krpm = cases[n].kphi_uv;
        for (part = 0; part < 3u; part++) {
            identify_part_t whole = { 64, 0, 64 * 20000l, cases[n].coast_slope, 262080l, 63, 2520 };
            whole.current = (part == (uint16_t)PART_PUSH) ? 64 * 32 * 2000l : 0;
            whole.slope = (part == (uint16_t)PART_PUSH) ? cases[n].push_slope : cases[n].coast_slope;
            whole.speed = (part == (uint16_t)PART_SLOW) ? 64 * 12000l : 64 * 16000l;
            id->parts[part] = whole;
        }
        mechanics_done(&drive);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].result, id->result, cases[n].what);
        TEST_ASSERT_EQUAL_MESSAGE(cases[n].result == IDENTIFY_RESULT_INERTIA_RANGE, id->values.inertia_1e9_kgm2 == 0u, cases[n].what);
        TEST_ASSERT_EQUAL_MESSAGE(cases[n].result != IDENTIFY_RESULT_DONE, id->values.coulomb_1e8_nm == 0u, cases[n].what);
    }
}

void test_the_least_acceleration_has_an_inertia_and_none_has_not(void)
{
    identify_part_t *push = &id->parts[PART_PUSH];
    begin_mechanics(0);
    for (uint16_t part = 0; part < 3u; part++) {
        const identify_part_t whole = { 64, (part == (uint16_t)PART_PUSH) ? 64 * 32 * 2000l : 0, 64 * 16000l, 0, 262080l, 63, 2520 };
        id->parts[part] = whole;
    }
    TEST_ASSERT_EQUAL_INT32(0, part_rate(push));
    TEST_ASSERT_EQUAL_UINT32(0, inertia(id));
    while (part_rate(push) == 0) {
        push->slope++;
    }
    TEST_ASSERT_EQUAL_INT32(1, part_rate(push));
    TEST_ASSERT_GREATER_THAN_UINT32(0, inertia(id));
}

void test_what_a_light_rotor_s_first_cycle_has_seen_of_its_coasting_does_not_count(void)
{
    for (uint16_t heavy = 0; heavy < 2u; heavy++) {
        begin_mechanics(0);
        for (uint16_t part = 0; part < 3u; part++) {
            id->parts[part].periods = 1000;
        }
        id->heavy = heavy;
        first_cycle_done(id, id->top_q10);
        TEST_ASSERT_EQUAL_INT32(1000, id->parts[PART_PUSH].periods);
        TEST_ASSERT_EQUAL_INT32(heavy ? 1000 : 0, id->parts[PART_FAST].periods);
        TEST_ASSERT_EQUAL_INT32(heavy ? 1000 : 0, id->parts[PART_SLOW].periods);
    }
}

void test_a_rotor_coasts_down_to_three_eighths_of_the_top_speed_and_a_count_further(void)
{
    begin_mechanics(0);
    id->coasting = 1;
    coast_block(&drive, bottom_of(id));
    TEST_ASSERT_EQUAL_UINT16(1, id->coasting);
    TEST_ASSERT_EQUAL_UINT16(0, id->cycles);
    coast_block(&drive, bottom_of(id) - 1);
    TEST_ASSERT_EQUAL_UINT16(0, id->coasting);
    TEST_ASSERT_EQUAL_UINT16(1, id->cycles);
}

void test_a_push_begins_at_the_speed_of_the_last_stretch_before_it_if_that_was_less(void)
{
    int32_t before_q10;
    begin_mechanics(0);
    before_q10 = id->seen_q10 / 2;
    set_sums(before_q10 * 32, 0, 0, 0);
    (void)finished(IDENTIFY_MECHANICS);
    mechanics_current(&drive, id->push_q13);
    set_sums((before_q10 + 1000) * 32, 0, 0, 0);
    (void)finished(IDENTIFY_MECHANICS);
    TEST_ASSERT_EQUAL_UINT16(1, id->phase_blocks);
    TEST_ASSERT_EQUAL_INT32(before_q10 - (before_q10 >> 3), id->first_q10);
}

void test_friction_that_does_not_grow_is_constant_and_one_that_begins_below_zero_grows_from_zero(void)
{
    static const int32_t cases[][4] = { /* slopes of slow and fast, and what comes of it: more than nothing? */
        { -4000, -3000, 1, 0 }, { -4000, -5000, 1, 1 }, { -4000, -9000, 0, 1 }
    };
    EACH(n, cases) {
        uint16_t part;
        begin_mechanics(0);
        for (part = 0; part < 3u; part++) {
            identify_part_t whole = { 64, 0, 64 * 16000l, 40000l, 262080l, 63, 2520 };
            whole.current = (part == (uint16_t)PART_PUSH) ? 64 * 32 * 2000l : 0;
            if (part != (uint16_t)PART_PUSH) {
                whole.slope = cases[n][(part == (uint16_t)PART_SLOW) ? 0 : 1];
                whole.speed = (part == (uint16_t)PART_SLOW) ? 64 * 12000l : 64 * 20000l;
            }
            id->parts[part] = whole;
        }
        mechanics_done(&drive);
        TEST_ASSERT_EQUAL_MESSAGE(cases[n][2], id->values.coulomb_1e8_nm > 0u, golden_row(n));
        TEST_ASSERT_EQUAL_MESSAGE(cases[n][3], id->values.viscous_1e9_nms > 0u, golden_row(n));
    }
}

void test_a_rotor_that_swings_is_waited_for_a_minute_at_most(void)
{
    uint16_t n;
    control->ref_q13.d = 2000;
    for (n = 1; n < REST_MOST; n++) { /* across the axis 200 and 400 */
        set_sums(0, (int32_t)(((n & 1u) ? 2200l : 2400l) << MEAN_LOG2), (int32_t)-(1000l << MEAN_LOG2), BUS_SUM);
        (void)finished(IDENTIFY_ALIGN);
        TEST_ASSERT_EQUAL_UINT16(IDENTIFY_ALIGN, id->step);
    }
    set_sums(0, 2100l << MEAN_LOG2, -(900l << MEAN_LOG2), BUS_SUM);
    (void)finished(IDENTIFY_ALIGN);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESISTANCE, id->step);
    TEST_ASSERT_EQUAL_UINT16(1, id->swung);
    setUp();
    control->ref_q13.d = 2000;
    set_sums(0, 2000l << MEAN_LOG2, -(1000l << MEAN_LOG2), BUS_SUM);
    (void)finished(IDENTIFY_ALIGN);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_RESISTANCE, id->step);
    TEST_ASSERT_EQUAL_UINT16(0, id->swung);
}

void test_the_vector_waits_for_a_rotor_that_falls_behind_but_not_for_a_lasting_load(void)
{
    uint16_t n;
    id->swing = 1000l << SWING_LOG2;
    id->swing_mean = 1000l << SWING_MEAN_LOG2;
    control->v_q14.d = 1000;
    drive.forced.step_q32 = 1000000ul;
    identify_damp(&drive);
    TEST_ASSERT_EQUAL_UINT32(1000000ul, drive.forced.step_q32);
    control->v_q14.d = 1640; /* 10 of 64 in the filter at once */
    identify_damp(&drive);
    TEST_ASSERT_EQUAL_UINT32(1000000ul - 10ul * SWING_GAIN * 64u, drive.forced.step_q32);
    for (n = 0; n < 60000u; n++) {
        drive.forced.step_q32 = 1000000ul;
        identify_damp(&drive);
    }
    TEST_ASSERT_UINT32_WITHIN(128, 1000000ul, drive.forced.step_q32);
}

void test_the_first_push_is_what_friction_takes_and_a_sixteenth(void)
{
    begin_mechanics(0);
    TEST_ASSERT_EQUAL_INT16(params.open_loop_q13 >> 4, id->push_q13);
    begin_mechanics(1287); /* a quarter of Eq: 14 degrees, 0.2425 of the length */
    TEST_ASSERT_INT16_WITHIN(3, (int16_t)((float)params.open_loop_q13 * (0.2425F + 0.0625F)), id->push_q13);
    begin_mechanics(-1287);
    TEST_ASSERT_EQUAL_INT16(params.open_loop_q13 >> 4, id->push_q13);
}

void test_the_first_push_of_a_rotor_without_friction_is_a_sixteenth_exactly(void)
{
    drive_params_t strong = params;
    strong.open_loop_q13 = 6000;
    begin_spin(IDENTIFY_SPIN_FULL, 267, 1920);
    id->emf_sum = 2000ul << BLOCKS_LOG2;
    id->emf_d_sum = 0;
    mechanics_start(&drive, &strong);
    TEST_ASSERT_EQUAL_INT16(375, id->push_q13);
}

void test_top_speed_is_twice_END_SPEED_RPM_within_seven_eighths_of_the_voltage(void)
{
    int32_t twice = 2 * params.forced.end_speed_q10;
    begin_mechanics(0);
    TEST_ASSERT_INT32_WITHIN(twice / 100, twice - twice / 40, id->top_q10 - twice / 40);
    begin_spin(IDENTIFY_SPIN_FULL, 267, 1920);
    drive.circle.limit_q14 = 8000; /* 7000 less R i of half the current */
    stretches(256, 0, 5148, 0, 0);
    TEST_ASSERT_INT32_WITHIN(twice / 100, (int32_t)((float)params.forced.end_speed_q10
                                                   * (7000.0F - 0.0527F * 0.5F * (float)params.open_loop_q13 * 3.353F) / 5148.0F), id->top_q10);
}

void test_top_speed_ends_at_30000_electrical_rpm_where_the_formats_do(void)
{
    static const int32_t cases[][2] = { { 838800, 2 * 838800 }, { 838900, 1677721 }, { 1000000, 1677721 } }; /* END_SPEED_RPM, top: 0.025 turns a period */
    EACH(n, cases) {
        drive_params_t quick = params;
        quick.forced.end_speed_q10 = cases[n][0];
        begin_spin(IDENTIFY_SPIN_FULL, 267, 1920);
        id->emf_sum = 2000ul << BLOCKS_LOG2; /* twice that is less than seven eighths of the circle */
        mechanics_start(&drive, &quick);
        TEST_ASSERT_EQUAL_INT32(cases[n][1], id->top_q10);
    }
}

void test_the_frame_follows_the_rotor_by_its_back_emf(void)
{
    uint32_t before;
    id->speed_per_emf_q5 = 1760; /* 55 */
    id->emf_q22 = 5000l * 256;
    control->v_q14.q = 5400;
    control->v_q14.d = -150;
    id->drop_q_q14 = 300;
    id->drop_d_q14 = 250; /* 5400 - 300 + 150 - 250 = 5000 */
    before = drive.forced.angle_q32;
    identify_follow(&drive);
    TEST_ASSERT_EQUAL_INT32(275000l, drive.forced.speed_q10);
    TEST_ASSERT_EQUAL_HEX32(before + (275000ul << 6), drive.forced.angle_q32);
    control->v_q14.d = 250; /* it leads: slower, a quarter of the way */
    identify_follow(&drive);
    TEST_ASSERT_EQUAL_INT32(4900l * 55, drive.forced.speed_q10);
    control->v_q14.q = -16384;
    id->emf_q22 = 0;
    identify_follow(&drive);
    TEST_ASSERT_EQUAL_INT32(0, drive.forced.speed_q10);
}

/* ---- Gains ---- */

void test_current_gains_follow_from_R_and_L(void)
{
    (void)coil(200, 100, 0);
    id->values.rs_uohm = 2670000ul;
    id->values.ld_nh = 1920000ul;
    id->bias_q14 = 2000;
    control->pi_q.sum = 100000l;
    (void)finished(IDENTIFY_INDUCTANCE_Q);
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_SPIN_HALF, id->step);
    TEST_ASSERT_INT16_WITHIN(2, 1634, id->kp_d); /* 2 pi 200 Hz * 1.92 mH = 2.413 V/A; 0.6615 * 1024 counts each */
    TEST_ASSERT_INT16_WITHIN(2, 634, id->kp_q); /* 0.745 mH */
    TEST_ASSERT_EQUAL_INT16(id->ki_d, id->ki_q);
    TEST_ASSERT_INT16_WITHIN(1, 114, id->ki_d);  /* 2 pi 200 Hz * 2.67 ohm * 50 us = 0.1678 V/A a period */
    TEST_ASSERT_INT32_WITHIN(2, 2000l << 10, control->pi_d.sum); /* nothing jumps */
    TEST_ASSERT_EQUAL_INT32(0, control->pi_q.sum);
    TEST_ASSERT_EQUAL_UINT16(SETTLE_PERIODS, id->wait);
    TEST_ASSERT_EQUAL_UINT16(32, id->left);
    TEST_ASSERT_EQUAL_UINT16(0, id->blocks);
    TEST_ASSERT_EQUAL_INT16(32767, gain_of(soft_float_of(70000ul)));
    TEST_ASSERT_EQUAL_INT16(32767, gain_of(soft_float_of(32768ul)));
    TEST_ASSERT_EQUAL_INT16(32767, gain_of(soft_float_of(32767ul)));
    TEST_ASSERT_EQUAL_INT16(1, gain_of(soft_float_scaled(1, 9)));
}

void test_each_axis_has_its_own_gain(void)
{
    dq_t v, ref = { 100, 100 }, none = { 0, 0 };
    id->mode = (uint16_t)IDENTIFY_CURRENT;
    id->shift = 10;
    id->kp_d = 1024;
    id->kp_q = 3072;
    id->ki_d = 1;
    id->ki_q = 2;
    control->pi_d.sum = 0;
    control->pi_q.sum = 0;
    control->ref_q13 = ref;
    control->i_q13 = none;
    v = identify_voltage(&drive, 1);
    TEST_ASSERT_EQUAL_INT16(100, v.d);
    TEST_ASSERT_EQUAL_INT16(300, v.q);
    TEST_ASSERT_EQUAL_INT32(100, control->pi_d.sum);
    TEST_ASSERT_EQUAL_INT32(200, control->pi_q.sum);
}

void test_both_integrators_give_back_all_but_a_thousandth_of_an_excess(void)
{
    const dq_t none = { 0, 0 };
    int32_t most_d, most_q;
    id->mode = (uint16_t)IDENTIFY_CURRENT;
    id->shift = 10;
    id->kp_d = 1024;
    id->kp_q = 1024;
    most_d = (int32_t)drive.circle.vd_most_q14 * 1024;
    most_q = (int32_t)vq_limit(&drive.circle, drive.circle.vd_most_q14) * 1024;
    control->pi_d.sum = most_d + 6553600l;
    control->pi_q.sum = most_q + 6553600l;
    control->ref_q13 = none;
    control->i_q13 = none;
    (void)identify_voltage(&drive, 1);
    TEST_ASSERT_INT32_WITHIN(300, 6700, control->pi_d.sum - most_d);
    TEST_ASSERT_INT32_WITHIN(300, 6700, control->pi_q.sum - most_q);
}

/* ---- Hand-over between interrupt and background ---- */

void test_sums_begin_after_the_wait_and_only_while_settled(void)
{
    static const int16_t sums[] = { 0, 0, 0, 7, 14, 14 }; /* three periods of waiting, two of sums, and no more */
    id->mode = (uint16_t)IDENTIFY_CURRENT;
    go(id, IDENTIFY_CONNECT, 3, 2);
    drive.phases_q13.a = 7;
    identify_record(&drive, &params, 0);
    TEST_ASSERT_EQUAL_UINT16(3, id->wait);
    EACH(n, sums) {
        identify_record(&drive, &params, 1);
        TEST_ASSERT_EQUAL_INT32(sums[n], id->sum[1]);
        TEST_ASSERT_EQUAL_UINT16(sums[n] == 14, id->ready);
    }
}

void test_background_does_nothing_until_the_interrupt_is_ready(void)
{
    id->step = IDENTIFY_ALIGN;
    id->ready = 0;
    TEST_ASSERT_EQUAL_UINT16(0, identify_background(&drive, &params));
    TEST_ASSERT_EQUAL_UINT16(IDENTIFY_ALIGN, id->step);
}
