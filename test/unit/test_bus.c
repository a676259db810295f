/* The bus: its filter, the modulator's gain and the voltage circle that follow it, and both ends of their formats. */
#include "drive/limits.h"
#include "drive_rig.h"

void setUp(void)
{
    rig_ready();
}

/** A bus that has been there for long. */
static void settle(float bus_v)
{
    rig_bus(bus_v);
    rig_tick(400);
}

void test_start_values_are_those_of_the_nominal_supply(void)
{
    drive_t settled = drive;
    drive_init(&drive, &params);
    TEST_ASSERT_UINT16_WITHIN(settled.duty_per_volt_q16 / 500u, settled.duty_per_volt_q16, drive.duty_per_volt_q16);
    TEST_ASSERT_INT16_WITHIN(settled.circle.limit_q14 / 500, settled.circle.limit_q14, drive.circle.limit_q14);
    TEST_ASSERT_UINT16_WITHIN(settled.circle.reciprocal / 500u, settled.circle.reciprocal, drive.circle.reciprocal);
}

void test_bus_is_filtered_over_four_slow_steps(void)
{
    int16_t at_24;
    settle(24.0F);
    at_24 = qm_hi(drive.bus_q31);
    rig_bus(30.0F);
    rig_tick(8);
    TEST_ASSERT_INT16_WITHIN(4, (int16_t)(at_24 + BUS_Q15(6.0) / 4), qm_hi(drive.bus_q31));
    settle(30.0F);
    TEST_ASSERT_INT16_WITHIN(2, BUS_Q15(30.0), qm_hi(drive.bus_q31));
}

/** The filter would need four slow steps; until then the modulator would give a quarter too much. */
void test_modulators_gain_is_that_of_the_last_sample(void)
{
    uint16_t gain_at_24;
    settle(24.0F);
    gain_at_24 = drive.duty_per_volt_q16;
    rig_bus(30.0F);
    rig_tick(8);
    TEST_ASSERT_UINT16_WITHIN(gain_at_24 / 500u, (uint16_t)((float)gain_at_24 * 24.0F / 30.0F), drive.duty_per_volt_q16);
}

void test_commanded_volts_arrive_and_the_circle_follows_whatever_the_bus(void)
{
    /* 4 V in alpha: 6 V between a and b. The circle: 93.6 % of the bus / sqrt(3), of at most 1.25 times its nominal voltage */
    static const struct {
        float bus_v, sign, circle_v;
    } cases[] = {
        { 24.0F, 1.0F, 12.970F }, { 12.5F, 1.0F, 6.755F }, { 18.0F, 1.0F, 9.728F }, { 29.0F, 1.0F, 15.673F }, { 30.0F, -1.0F, 16.213F }, { 33.0F, 1.0F, 16.213F },
    };
    EACH(n, cases) {
        static const phases_t none;
        static const dead_duties_t no_dead_time;
        alphabeta_t v = { (int16_t)(cases[n].sign * (VOLTAGE_Q14(4.0) / 2)), 0 };
        duties_t duty;
        settle(cases[n].bus_v);
        svm(&params.svm, v, drive.duty_per_volt_q16, &no_dead_time, &none, &duty);
        TEST_ASSERT_FLOAT_WITHIN(0.05F, cases[n].sign * 6.0F, ((float)duty.a - (float)duty.b) / (float)PWM_FULL_DUTY * cases[n].bus_v);
        TEST_ASSERT_INT16_WITHIN(20, (int16_t)(cases[n].circle_v / 12.970F * VOLTAGE_Q14(12.970)), drive.circle.limit_q14);
    }
}

void test_bus_beyond_the_trip_levels_keeps_circle_and_gain_in_their_formats(void)
{
    int16_t circle_at_34;
    uint16_t gain_at_12;
    settle(34.0F);
    circle_at_34 = drive.circle.limit_q14;
    settle(52.7F);
    TEST_ASSERT_INT16_WITHIN(20, circle_at_34, drive.circle.limit_q14);
    TEST_ASSERT_GREATER_THAN_INT16(0, drive.circle.limit_q14);
    settle(12.0F);
    gain_at_12 = drive.duty_per_volt_q16;
    settle(0.0F);
    TEST_ASSERT_UINT16_WITHIN(gain_at_12 / 200u, gain_at_12, drive.duty_per_volt_q16);
}

#undef NOMINAL_BUS_V
#define NOMINAL_BUS_V 8.0
#undef OVER_VOLTAGE_V
#define OVER_VOLTAGE_V 15.0

/** The circle on a supply of 8 V, whose trip level is below a third of the range: the bus is shifted up to fill its word. */
void test_circle_of_a_supply_that_is_a_seventh_of_the_bus_range(void)
{
    static const drive_params_t small = DRIVE_PARAMS_INIT;
    static const struct {
        float bus_v, circle_v;
    } cases[] = { { 8.0F, 4.323F }, { 6.0F, 3.243F }, { 9.5F, 5.134F }, { 10.0F, 5.404F }, { 10.5F, 5.404F /* that of 1.25 times 8 V */ }, { 30.0F, 5.404F } };
    TEST_ASSERT_EQUAL_UINT16(2u, small.bus_shift);
    EACH(n, cases) {
        drive.bus_q31 = (int32_t)BUS_Q15(cases[n].bus_v) * 65536;
        bus_update_voltage_limit(&drive, &small);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(20, VOLTAGE_Q14(cases[n].circle_v), drive.circle.limit_q14, golden_row(n));
    }
}
