/* Current limits: the circle that the d reference leaves to q, and braking current that fades with the bus. */
#include "drive_rig.h"

#include "drive/limits.h"
#include "golden_current_limit.h"

static drive_params_t limited;

void setUp(void)
{
    rig_closed(1, 8000);
    drive.run.fieldweak.table_q13 = 0;
    drive.run.fieldweak.trim_q13 = 0;
    drive.run.control.vq_limit_q14 = 16000; /* plenty of voltage */
    limited = params;
}

/* ---- the circle ---- */

void test_limits_equal_the_reference(void)
{
    GOLDEN_EACH(current_limit, v) {
        limited.current_max_q13 = v.maximum;
        limited.current_max_reciprocal = v.reciprocal;
        drive.run.handover.id_q13 = v.wanted_d;
        drive.run.control.ref_q13.d = v.ref_d; /* it grows no more */
        limits_current(&drive.run, &limited);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.ref_d, drive.run.control.ref_q13.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.iq_limit, drive.run.control.iq_limit_q13, golden_row(n));
    }
}

void test_current_vector_fills_its_circle_and_never_leaves_it(void)
{
    int16_t i_d;
    for (i_d = -5120; i_d <= 5120; i_d++) {
        int32_t square;
        drive.run.handover.id_q13 = i_d;
        limits_current(&drive.run, &params);
        square = qm_mulss(drive.run.control.ref_q13.d, drive.run.control.ref_q13.d)
                 + qm_mulss(drive.run.control.iq_limit_q13, drive.run.control.iq_limit_q13);
        TEST_ASSERT_TRUE_MESSAGE(square <= INT32_C(5120) * 5120, golden_row((uint32_t)(i_d + 5120)));
        TEST_ASSERT_TRUE_MESSAGE(square >= INT32_C(5090) * 5090, golden_row((uint32_t)(i_d + 5120)));
        TEST_ASSERT_TRUE_MESSAGE(drive.run.control.iq_limit_q13 > 0, golden_row((uint32_t)(i_d + 5120)));
    }
}

void test_a_current_beyond_its_circle_leaves_the_other_axis_as_little_as_one_at_its_end(void)
{
    const int16_t at_end = limits_circle(5120, 6554, 5120);
    TEST_ASSERT_INT16_WITHIN(40, 40, at_end);
    TEST_ASSERT_EQUAL_INT16(at_end, limits_circle(5120, 6554, 5200));
    TEST_ASSERT_EQUAL_INT16(at_end, limits_circle(5120, 6554, 8192));
    TEST_ASSERT_EQUAL_INT16(5119, limits_circle(5120, 6554, 0));
}

void test_d_current_grows_by_a_slice_a_step_and_goes_at_once(void)
{
    const int16_t slice = (int16_t)(params.current_max_q13 >> LIMITS_GROWS_SHIFT);
    drive.run.control.ref_q13.d = 0;
    drive.run.fieldweak.table_q13 = -2000;
    for (int16_t n = 1; n <= 3; n++) {
        limits_current(&drive.run, &params);
        TEST_ASSERT_EQUAL_INT16(-n * slice, drive.run.control.ref_q13.d);
    }
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(-2000, drive.run.control.ref_q13.d);
    drive.run.fieldweak.table_q13 = 0;
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.ref_q13.d);
}

void test_what_flows_far_beyond_the_q_reference_lowers_its_limit_and_is_forgotten(void)
{
    const int16_t slice = (int16_t)(params.current_max_q13 >> LIMITS_SLACK_SHIFT);
    EACH_DIRECTION(direction) {
        drive_control_t *c = &drive.run.control;
        int16_t free_limit;
        c->over_q13 = 0;
        c->ref_q13.q = (int16_t)(direction * 1000);
        c->i_q13.q = (int16_t)(direction * (1000 + slice));
        limits_current(&drive.run, &params);
        free_limit = c->iq_limit_q13;
        c->i_q13.q = (int16_t)(direction * (1000 + slice + 800));
        limits_current(&drive.run, &params);
        TEST_ASSERT_EQUAL_INT16(free_limit - 800, c->iq_limit_q13);
        c->i_q13.q = 0;
        limits_current(&drive.run, &params);
        TEST_ASSERT_EQUAL_INT16(free_limit - 700, c->iq_limit_q13);
        c->ref_q13.q = (int16_t)(-direction * 100);
        c->i_q13.q = (int16_t)(-direction * 8000); /* more than the limit itself */
        limits_current(&drive.run, &params);
        TEST_ASSERT_EQUAL_INT16(0, c->iq_limit_q13);
    }
}

void test_d_reference_is_the_sum_of_hand_over_table_trim_and_probe(void)
{
    drive.run.probe_id_q13 = 700;
    drive.run.handover.id_q13 = 500;
    drive.run.fieldweak.table_q13 = -900;
    drive.run.fieldweak.trim_q13 = -100;
    limits_current(&drive.run, &params); /* the trim goes back by one step */
    TEST_ASSERT_EQUAL_INT16(500 - 900 - 100 + 700 + params.fieldweak.trim_step_q13, drive.run.control.ref_q13.d);
}

void test_trim_sees_the_voltage_that_q_leaves_unused_in_both_directions(void)
{
    EACH_DIRECTION(direction) {
        rig_speed((int16_t)(direction * 20000));
        drive.run.control.v_q14.q = (int16_t)(direction * (16000 + 32));
        limits_current(&drive.run, &params);
        TEST_ASSERT_EQUAL_INT16(-4, drive.run.control.ref_q13.d);
        drive.run.control.v_q14.q = (int16_t)(direction * (16000 - 32));
        limits_current(&drive.run, &params);
        TEST_ASSERT_EQUAL_INT16(0, drive.run.control.ref_q13.d);
    }
}

void test_missing_q_current_asks_for_voltage_and_current_to_spare_gives_it_back(void)
{
    static const struct {
        int16_t ref_q13, i_q13, free_q14;
    } cases[] = {
        { 1000, 1000, 1000 }, { 1000, 990, 960 }, { 1000, 1010, 1040 }, { 1000, 936, 744 }, { 1000, 0, 744 }, { 1000, 1064, 1256 },
        { 1000, 3000, 1256 }, { 0, -10, 960 }, { 0, 10, 1040 },
    };
    EACH(n, cases) {
        EACH_DIRECTION(direction) {
            if (cases[n].ref_q13 != 0 || direction > 0) { /* without a reference the sign is the positive direction's */
                drive.run.control.v_q14.q = (int16_t)(direction * 15000);
                TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].free_q14, limits_free_voltage(&drive.run.control, (int16_t)(cases[n].ref_q13 - cases[n].i_q13)),
                                                golden_row(n));
            }
        }
    }
}

/* ---- braking ---- */

void test_braking_current_fades_between_27_and_29_volts(void)
{
    static const struct {
        float bus_v;
        int16_t limit_q13, tolerance;
    } cases[] = {
        { 24.0F, 4960, 0 }, { 27.0F, 4960, 0 }, { 27.1F, 4704, 20 }, { 28.0F, 2400, 20 }, { 29.0F, 0, 20 }, { 29.2F, 0, 0 },
        { 52.0F, 0, 0 }, { 26.0F, 4960, 0 }, /* 31/32 of MAXIMUM_CURRENT_A: the controllers overshoot it */
    };
    EACH(n, cases) {
        limits_braking(&drive.run, &params, (int16_t)(cases[n].bus_v / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(cases[n].tolerance, cases[n].limit_q13, drive.run.control.brake_limit_q13, golden_row(n));
    }
    limits_braking(&drive.run, &params, (int16_t)(params.bus_regen_q15 + 1));
    TEST_ASSERT_LESS_THAN_INT16(4960, drive.run.control.brake_limit_q13);
}

/** The filter would let the bus of a small capacitor rise by another volt or two before braking ends. */
void test_braking_follows_the_bus_of_the_moment(void)
{
    rig_closed(1, 5000);
    rig_bus(24.0F);
    rig_tick(400);
    TEST_ASSERT_EQUAL_INT16(4960, drive.run.control.brake_limit_q13);
    rig_bus(29.2F);
    rig_tick(8);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.brake_limit_q13);
    rig_tick(400);
    rig_bus(24.0F);
    rig_tick(8);
    TEST_ASSERT_EQUAL_INT16(4960, drive.run.control.brake_limit_q13);
}

void test_brake_limit_holds_braking_current_and_leaves_driving_current(void)
{
    static const struct {
        int16_t reference_erpm, speed_erpm, limit_q13, iq_q13;
    } cases[] = { { 5000, 20000, 700, -700 }, { -5000, -20000, 700, 700 }, { 5000, 20000, 0, 0 }, { -5000, -20000, 0, 0 } };
    EACH(n, cases) {
        rig_closed((int16_t)((cases[n].reference_erpm > 0) ? 1 : -1), cases[n].reference_erpm);
        drive.run.control.brake_limit_q13 = cases[n].limit_q13;
        rig_speed(cases[n].speed_erpm);
        speed_step(&drive, &params);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(cases[n].iq_q13, drive.run.control.ref_q13.q, golden_row(n));
    }
    EACH_DIRECTION(direction) {
        rig_closed(direction, (int16_t)(direction * 20000));
        drive.run.control.brake_limit_q13 = 0;
        rig_speed((int16_t)(direction * 5000));
        speed_step(&drive, &params);
        TEST_ASSERT_TRUE(direction * drive.run.control.ref_q13.q > 1000);
    }
}

void test_braking_that_was_limited_leaves_nothing_behind(void)
{
    uint16_t n;
    rig_closed(1, 5000);
    drive.run.control.brake_limit_q13 = 300;
    rig_speed(9000);
    for (n = 0; n < 2500u; n++) {
        speed_step(&drive, &params);
    }
    TEST_ASSERT_EQUAL_INT16(-300, drive.run.control.ref_q13.q);
    rig_speed(4990); /* just below: the current must turn at once */
    speed_step(&drive, &params);
    TEST_ASSERT_GREATER_THAN_INT16(0, drive.run.control.ref_q13.q);
}

/* ---- what the supply allows ---- */

/** Limit after so many steps at these voltages and currents; 1 A of supply at 24 V, 24 W. */
static int16_t supplied(uint16_t steps, int16_t direction, float v_d, float v_q, float i_d, float i_q)
{
    drive_control_t *c = &drive.run.control;
    limited = params;
    limited.supply_limit_q13 = CURRENT_Q13(2.0 / 1.7320508 / 0.936);
    rig_closed(direction, (int16_t)(direction * 8000));
    bus_update_voltage_limit(&drive, &limited);
    c->v_q14.d = VOLTAGE_Q14(v_d);
    c->v_q14.q = (int16_t)(direction * VOLTAGE_Q14(v_q));
    c->ref_q13.d = CURRENT_Q13(i_d);
    c->ref_q13.q = (int16_t)(direction * CURRENT_Q13(i_q));
    c->supply_q13 = limited.current_max_q13;
    while (steps-- != 0u) {
        c->iq_limit_q13 = 5000;
        limits_driving(&drive, &limited);
    }
    return c->iq_limit_q13;
}

void test_supply_current_leaves_the_q_current_that_takes_its_power_at_this_voltage(void)
{
    static const struct {
        float v_d, v_q, i_d, iq_a;
    } cases[] = { { 0.0F, 10.0F, 0.0F, 1.6F }, { 0.0F, 8.0F, 0.0F, 2.0F }, { -6.0F, 10.0F, -1.0F, 1.0F }, { -4.0F, 12.0F, -1.0F, 1.0F }, { -8.0F, 10.0F, -2.5F, 0.0F } };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            int16_t limit_q13 = supplied(60, direction, cases[n].v_d, cases[n].v_q, cases[n].i_d, 0.5F);
            TEST_ASSERT_INT16_WITHIN_MESSAGE(CURRENT_Q13(0.02), CURRENT_Q13(cases[n].iq_a), limit_q13, golden_row(n));
            TEST_ASSERT_EQUAL_HEX16(LIMIT_SUPPLY, drive.run.control.limited_by);
        }
    }
}

void test_supply_that_gives_more_than_the_largest_current_takes_leaves_the_circle_alone(void)
{
    TEST_ASSERT_EQUAL_INT16(5000, supplied(60, 1, 0.0F, 5.0F, 0.0F, 0.5F));
    TEST_ASSERT_EQUAL_HEX16(LIMIT_NONE, drive.run.control.limited_by);
    TEST_ASSERT_EQUAL_INT16(5000, supplied(60, 1, 0.0F, 0.0F, 0.0F, 0.5F));
    TEST_ASSERT_EQUAL_INT16(5000, supplied(60, 1, 0.0F, -5.0F, 0.0F, 0.5F)); /* it gives back */
}

void test_supply_s_limit_leaves_braking_current_alone(void)
{
    EACH_DIRECTION(direction) {
        TEST_ASSERT_EQUAL_INT16(5000, supplied(60, direction, 0.0F, 10.0F, 0.0F, -0.5F));
    }
}

void test_supply_s_limit_comes_by_a_quarter_a_step_and_ends_where_it_should(void)
{
    int16_t end = supplied(60, 1, 0.0F, 10.0F, 0.0F, 0.5F);
    TEST_ASSERT_INT16_WITHIN(2, (int16_t)(5120 - (5120 - end) / 4), supplied(1, 1, 0.0F, 10.0F, 0.0F, 0.5F));
    drive.run.control.supply_q13 = 0;
    for (uint16_t n = 0; n < 60u; n++) {
        (void)limits_supply(&drive, &limited);
    }
    TEST_ASSERT_INT16_WITHIN(4, end, drive.run.control.supply_q13);
}

/** Parameters that derate below 20 V; the trip is 12 V. */
#undef DERATE_BELOW_V
#define DERATE_BELOW_V 20
static const drive_params_t derated = DRIVE_PARAMS_INIT;
#undef DERATE_BELOW_V
#define DERATE_BELOW_V 0

void test_driving_current_falls_from_all_to_a_fifth_between_DERATE_BELOW_and_the_trip(void)
{
    static const struct {
        float bus_v;
        int16_t most_q13;
    } cases[] = { { 30.0F, 5120 }, { 24.0F, 5120 }, { 20.0F, 5120 }, { 18.0F, 4096 }, { 16.0F, 3072 }, { 14.0F, 2048 }, { 12.0F, 1024 }, { 11.0F, 1024 }, { 0.0F, 1024 } };
    EACH(n, cases) {
        int16_t most_q13 = limits_derated(&derated, (int16_t)(cases[n].bus_v / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F));
        TEST_ASSERT_INT16_WITHIN_MESSAGE(5, cases[n].most_q13, most_q13, golden_row(n));
    }
}

/** Limit of a circle of 5000 at this bus, with a q current in this direction of the rotor. */
static int16_t derated_at(float bus_v, int16_t direction, int16_t iq_q13)
{
    drive_control_t *c = &drive.run.control;
    rig_closed(direction, (int16_t)(direction * 8000));
    drive.bus_q31 = (int32_t)(bus_v / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F) * 65536;
    c->ref_q13.q = (int16_t)(direction * iq_q13);
    c->iq_limit_q13 = 5000;
    limits_driving(&drive, &derated);
    return c->iq_limit_q13;
}

void test_low_bus_narrows_the_driving_current_alone_and_says_so(void)
{
    EACH_DIRECTION(direction) {
        TEST_ASSERT_INT16_WITHIN(5, 2048, derated_at(14.0F, direction, 500));
        TEST_ASSERT_EQUAL_HEX16(LIMIT_LOW_BUS, drive.run.control.limited_by);
        TEST_ASSERT_EQUAL_INT16(5000, derated_at(14.0F, direction, -500));
        TEST_ASSERT_EQUAL_HEX16(LIMIT_NONE, drive.run.control.limited_by);
        TEST_ASSERT_EQUAL_INT16(5000, derated_at(20.0F, direction, 500));
    }
}

void test_a_reason_goes_with_its_limit(void)
{
    (void)derated_at(14.0F, 1, 500);
    TEST_ASSERT_EQUAL_HEX16(LIMIT_LOW_BUS, drive.run.control.limited_by);
    drive.bus_q31 = (int32_t)(24.0F / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F) * 65536;
    drive.run.control.iq_limit_q13 = 5000;
    limits_driving(&drive, &derated);
    TEST_ASSERT_EQUAL_INT16(5000, drive.run.control.iq_limit_q13);
    TEST_ASSERT_EQUAL_HEX16(LIMIT_NONE, drive.run.control.limited_by);
}

void test_the_narrower_of_supply_and_low_bus_counts(void)
{
    drive_params_t both = derated;
    (void)supplied(60, 1, 0.0F, 10.0F, 0.0F, 0.5F); /* 1.6 A */
    both.supply_limit_q13 = limited.supply_limit_q13;
    drive.run.control.iq_limit_q13 = 5000;
    drive.bus_q31 = (int32_t)(18.0F / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F) * 65536;
    limits_driving(&drive, &both);
    TEST_ASSERT_EQUAL_HEX16(LIMIT_SUPPLY, drive.run.control.limited_by);
    drive.run.control.iq_limit_q13 = 5000;
    drive.bus_q31 = (int32_t)(13.0F / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F) * 65536;
    limits_driving(&drive, &both);
    TEST_ASSERT_EQUAL_HEX16(LIMIT_LOW_BUS, drive.run.control.limited_by);
    TEST_ASSERT_INT16_WITHIN(5, 1536, drive.run.control.iq_limit_q13);
}

void test_without_a_supply_limit_nothing_is_narrowed(void)
{
    (void)supplied(0, 1, 0.0F, 10.0F, 0.0F, 0.5F);
    drive.run.control.iq_limit_q13 = 5000;
    limits_driving(&drive, &params);
    TEST_ASSERT_EQUAL_INT16(5000, drive.run.control.iq_limit_q13);
    TEST_ASSERT_EQUAL_INT16(0, params.supply_limit_q13);
}

/* ---- what the bus does not take ---- */

static current_q13_t burnt_with(const drive_params_t *p, uint16_t steps, int16_t brake_limit_q13, int16_t iq_q13)
{
    drive_control_t *c = &drive.run.control;
    rig_speed(10000);
    c->brake_limit_q13 = brake_limit_q13;
    c->ref_q13.q = limits_apply_braking(c, 10000, iq_q13);
    while (steps-- != 0u) {
        limits_flux_brake(&drive.run, p);
    }
    return c->flux_brake_q13;
}

static current_q13_t burnt_after(uint16_t steps, int16_t brake_limit_q13, int16_t iq_q13)
{
    return burnt_with(&params, steps, brake_limit_q13, iq_q13);
}

void test_d_current_grows_while_the_bus_holds_braking_back_and_goes_when_it_does_not(void)
{
    drive.run.control.iq_limit_q13 = 5120;
    TEST_ASSERT_EQUAL_INT16(0, burnt_after(100, 700, -699));
    TEST_ASSERT_EQUAL_INT16(0, burnt_after(100, 700, 700));     /* it drives */
    TEST_ASSERT_EQUAL_INT16(1600, burnt_after(50, 0, -500));    /* no braking current at all */
    TEST_ASSERT_EQUAL_INT16(3200, burnt_after(50, 700, -701));
    TEST_ASSERT_EQUAL_INT16(4960, burnt_after(200, 700, -5120)); /* 31/32 of MAXIMUM_CURRENT_A */
    TEST_ASSERT_EQUAL_INT16(4640, burnt_after(10, 700, -600));
    TEST_ASSERT_EQUAL_INT16(0, burnt_after(150, 700, 0));
}

void test_a_winding_that_would_burn_less_than_dead_time_gives_back_burns_nothing(void)
{
    drive.run.control.iq_limit_q13 = 5120;
    limited = params;
    limited.flux_brake_most_q13 = 0;
    TEST_ASSERT_EQUAL_INT16(0, burnt_with(&limited, 200, 0, -5120));
}

void test_d_current_gives_way_where_the_circle_and_not_the_bus_holds_braking_back(void)
{
    drive.run.control.iq_limit_q13 = 2000;
    drive.run.control.flux_brake_q13 = 4000;
    TEST_ASSERT_EQUAL_INT16(3968, burnt_after(1, 2000, -5120));
    TEST_ASSERT_EQUAL_INT16(4000, burnt_after(1, 1999, -5120));
}

void test_what_is_burnt_and_field_weakening_share_the_largest_current(void)
{
    drive.run.control.flux_brake_q13 = 3000;
    drive.run.fieldweak.table_q13 = -1000;
    for (uint16_t n = 0; n < 16u; n++) {
        limits_current(&drive.run, &params);
    }
    TEST_ASSERT_EQUAL_INT16(-4000, drive.run.control.ref_q13.d);
    TEST_ASSERT_INT16_WITHIN(20, 3196, drive.run.control.iq_limit_q13); /* sqrt(5120^2 - 4000^2) */
    drive.run.control.flux_brake_q13 = 4960;
    for (uint16_t n = 0; n < 4u; n++) {
        limits_current(&drive.run, &params);
    }
    TEST_ASSERT_EQUAL_INT16(-4960, drive.run.control.ref_q13.d);
}

/* ---- braking for every current range: from here on the parameters are others ---- */
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 1.0
static const drive_params_t at_1_A = DRIVE_PARAMS_INIT;
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 0.6
static const drive_params_t at_600_mA = DRIVE_PARAMS_INIT;

void test_braking_current_ends_2_V_above_REGEN_LIMIT_for_every_current_range(void)
{
    static const drive_params_t *const ranges[] = { &params, &at_1_A, &at_600_mA };
    EACH(n, ranges) {
        int16_t above_v, full = ranges[n]->current_max_q13;
        for (above_v = 0; above_v <= 2; above_v++) {
            float bus_v = PARAM_F(REGEN_LIMIT_V) + (float)above_v;
            limits_braking(&drive.run, ranges[n], (int16_t)(bus_v / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F));
            TEST_ASSERT_INT16_WITHIN(full / 20, full - above_v * full / 2, drive.run.control.brake_limit_q13);
        }
    }
}
