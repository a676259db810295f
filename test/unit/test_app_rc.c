/* defines: -DAPP_PULSE=1 */
/* The application rc with an RC receiver: arming, thresholds, odd pulses, a signal that is lost, and its return. */
#include "firmware/app/rc.c"

#include "app_rig.h"

#define FRAME_MS 20u

static uint16_t now_ms;

/** Frames with pulses of this length, `frame_ms` apart. @return clears of a fault */
static uint16_t frames(uint16_t count, uint16_t pulse_us, uint16_t frame_ms)
{
    uint16_t n, clears = 0;
    for (n = 0; n < count * frame_ms; n++, now_ms++) {
        const uint16_t has_come = (uint16_t)(n % frame_ms == frame_ms - 1u && pulse_us != 0u);
        told.pulse_200ns = (uint16_t)(has_come ? 5u * pulse_us : 0u);
        told.period_200ns = (uint16_t)((frame_ms > 12u) ? 65535u : 5000u * frame_ms);
        rig_ms();
        clears = (uint16_t)(clears + asks.clear_fault);
    }
    return clears;
}

/** The usual ones. */
static void pulses(uint16_t count, uint16_t pulse_us)
{
    (void)frames(count, pulse_us, FRAME_MS);
}

/** A stick from one place to another as a hand does it. */
static void moves(uint16_t from_us, uint16_t to_us)
{
    uint16_t n;
    for (n = 1; n <= 20u; n++) {
        pulses(1, (uint16_t)(from_us + (int16_t)(to_us - from_us) * n / 20));
    }
}

/** Armed at rest. */
static void at_rest(void)
{
    pulses(30, 1000);
}

static void running(uint16_t pulse_us)
{
    at_rest();
    moves(1000, pulse_us);
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
    told.is_running = 1;
}

void setUp(void)
{
    rig_fresh();
    now_ms = 0;
}

void tearDown(void)
{
}

void test_with_the_stick_up_at_power_up_it_does_not_start_before_the_stick_has_been_at_rest(void)
{
    pulses(200, 1600);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    for (uint16_t n = 0; n < 5u; n++) {
        moves(1600, 1000);
        pulses(10, 1000); /* not long enough, also not together */
        moves(1000, 1600);
        pulses(100, 1600);
        TEST_ASSERT_EQUAL_INT16(0, asks.run);
    }
    moves(1600, 1000);
    at_rest();
    moves(1000, 1600);
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_without_any_signal_it_never_starts_and_the_fault_has_its_name(void)
{
    frames(1, 0, PULSE_LOST_MS - 1u);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, asks.fault);
    frames(1, 0, 1);
    TEST_ASSERT_EQUAL_UINT16(FAULT_POTENTIOMETER, asks.fault);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    TEST_ASSERT_EQUAL_UINT16(0, frames(1, 0, 60000));
    TEST_ASSERT_EQUAL_UINT16(FAULT_POTENTIOMETER, asks.fault);
}

void test_it_starts_above_the_one_threshold_and_stops_below_the_other(void)
{
    static const struct {
        uint16_t us;
        int16_t run;
    } steps[] = { { 1000, 0 }, { 1060, 0 }, { 1079, 0 }, { 1081, 1 }, { 1060, 1 }, { 1051, 1 }, { 1049, 0 }, { 1079, 0 }, { 1085, 1 } };
    at_rest();
    EACH(n, steps) {
        pulses(2, steps[n].us);
        TEST_ASSERT_EQUAL_INT16(steps[n].run, asks.run);
    }
}

void test_one_to_two_ms_are_minimum_to_maximum_speed_at_every_pace(void)
{
    static const struct {
        uint16_t us;
        int16_t speed;
    } at[] = { { 1080, 500 }, { 1310, 1375 }, { 1540, 2250 }, { 1770, 3125 }, { 2000, 4000 }, { 2150, 4000 } };
    static const uint16_t paces_ms[] = { 3, 5, 10, 20, 24 }; /* 2.5 ms come as 2 and 3 */
    at_rest();
    EACH(n, at) {
        EACH(k, paces_ms) {
            (void)frames(10, at[n].us, paces_ms[k]);
            TEST_ASSERT_INT16_WITHIN(4, at[n].speed, asks.target_erpm);
        }
        moves(at[n].us, (uint16_t)(at[n].us + 100u));
    }
}

void test_an_odd_pulse_alone_changes_nothing(void)
{
    static const uint16_t odd_us[] = { 1, 500, 790, 1000, 1800, 2000, 2210, 3000, 10900 };
    int16_t target;
    running(1540);
    target = asks.target_erpm;
    EACH(n, odd_us) {
        pulses(1, odd_us[n]);
        TEST_ASSERT_EQUAL_INT16(target, asks.target_erpm);
        pulses(5, 1540);
        TEST_ASSERT_EQUAL_INT16(target, asks.target_erpm);
        TEST_ASSERT_EQUAL_INT16(1, asks.run);
        TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, asks.fault);
    }
}

void test_a_third_of_the_pulses_odd_is_ridden_through(void)
{
    uint16_t n;
    running(1540);
    for (n = 0; n < 100u; n++) {
        pulses(1, 3000);
        pulses(3, 1540);
        TEST_ASSERT_EQUAL_INT16(1, asks.run);
    }
}

/** Milliseconds until it asks for a stop, from a running motor. */
static uint16_t lost_after_ms(uint16_t pulse_us, uint16_t frame_ms)
{
    rig_fresh();
    running(1540);
    now_ms = 0;
    while (asks.run && now_ms < 5000u) {
        (void)frames(1, pulse_us, frame_ms);
    }
    return now_ms;
}

void test_a_signal_that_cannot_be_is_lost_after_its_time(void)
{
    static const uint16_t wrong_us[] = { 0, 500, 790, 2210, 3000, 10900 };
    EACH(n, wrong_us) {
        TEST_ASSERT_UINT16_WITHIN(FRAME_MS, PULSE_LOST_MS, lost_after_ms(wrong_us[n], FRAME_MS));
    }
    TEST_ASSERT_UINT16_WITHIN(10, PULSE_LOST_MS, lost_after_ms(1500, 2)); /* 500 Hz: not of a receiver */
    TEST_ASSERT_GREATER_OR_EQUAL_UINT16(5000, lost_after_ms(1500, 3)); /* never */
}

void test_pulses_that_come_too_seldom_are_lost(void)
{
    TEST_ASSERT_UINT16_WITHIN(700, 800, lost_after_ms(1540, 100));
}

void test_a_jittering_signal_is_lost_within_a_second_and_a_little_jitter_is_not(void)
{
    static uint16_t random = 1;
    uint16_t spread_us, n;
    for (spread_us = 50; spread_us <= 800u; spread_us = (uint16_t)(spread_us * 4u)) {
        rig_fresh();
        running(1540);
        for (n = 0; n < 50u; n++) {
            random = (uint16_t)(random * 25173u + 13849u);
            pulses(1, (uint16_t)(1540u - spread_us / 2u + ((uint32_t)spread_us * random >> 16)));
        }
        TEST_ASSERT_EQUAL_INT16(spread_us < 700u, asks.run);
    }
}

void test_a_lost_signal_stops_it_in_order_and_only_then_is_the_fault(void)
{
    running(1540);
    pulses(100, 0);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, asks.fault);
    told.is_running = 0;
    rig_ms();
    TEST_ASSERT_EQUAL_UINT16(FAULT_POTENTIOMETER, asks.fault);
}

void test_a_signal_that_returns_while_it_stops_keeps_the_stop_and_the_fault_gets_its_name(void)
{
    running(1540);
    pulses(20, 0);
    pulses(50, 1540);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    told.is_running = 0;
    rig_ms();
    TEST_ASSERT_EQUAL_UINT16(FAULT_POTENTIOMETER, asks.fault);
    told.fault = FAULT_POTENTIOMETER;
    rig_ms();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, asks.fault);
}

void test_after_a_loss_it_starts_only_when_the_stick_has_been_at_rest_which_clears_the_fault(void)
{
    running(1540);
    pulses(20, 0);
    told.is_running = 0;
    told.fault = FAULT_POTENTIOMETER;
    TEST_ASSERT_EQUAL_UINT16(0, frames(200, 1540, FRAME_MS));
    moves(1540, 1000);
    TEST_ASSERT_EQUAL_UINT16(0, frames(20, 1000, FRAME_MS));
    TEST_ASSERT_GREATER_THAN_UINT16(0, frames(10, 1000, FRAME_MS));
    told.fault = FAULT_NONE;
    moves(1000, 1540);
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_one_pulse_of_a_lost_signal_does_not_bring_it_back(void)
{
    at_rest();
    pulses(500, 0);
    told.fault = FAULT_POTENTIOMETER;
    pulses(3, 1000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_POTENTIOMETER, asks.fault);
    pulses(20, 1000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, asks.fault);
}

void test_any_fault_needs_the_stick_at_rest_again(void)
{
    running(1540);
    told.is_running = 0;
    told.fault = FAULT_STALL;
    TEST_ASSERT_EQUAL_UINT16(0, frames(100, 1540, FRAME_MS));
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    told.fault = FAULT_NONE; /* by the retry */
    pulses(50, 1540);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    told.fault = FAULT_STALL;
    moves(1540, 1000);
    TEST_ASSERT_GREATER_THAN_UINT16(0, frames(30, 1000, FRAME_MS));
}

void test_a_client_in_command_is_left_alone(void)
{
    running(1540);
    told.is_remote = 1;
    pulses(50, 0);
    TEST_ASSERT_EQUAL_INT16(0, asks.run);
    told.is_running = 0;
    rig_ms();
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, asks.fault);
}
