/* The panel: debounced buttons, what S2 and S3 do in every state, the potentiometer's range and calm, and the LEDs. */
#include "panel_rig.h"

void setUp(void)
{
    panel_reset();
    rig_ready();
    panel_turn_pot(0);
}

void test_init_forgets_everything_and_puts_the_pot_at_its_lower_end(void)
{
    static const buttons_t nothing = { 0, 0, 1 };
    app_panel.s2.down_ms = 29;
    app_panel.s3.down_ms = 29;
    the_request.wish_run = 1;
    app_panel.fast_range = 1;
    app_panel.blink_ms = 999;
    panel_reset();
    TEST_ASSERT_EQUAL_UINT16(0, app_panel.s2.down_ms);
    TEST_ASSERT_EQUAL_UINT16(0, app_panel.s3.down_ms);
    TEST_ASSERT_EQUAL_INT16(0, the_request.wish_run);
    TEST_ASSERT_EQUAL_INT16(0, app_panel.fast_range);
    TEST_ASSERT_EQUAL_UINT16(0, app_panel.blink_ms);
    the_pot.now_q15 = -32768;
    panel_pass(&params, &nothing);
    TEST_ASSERT_INT16_WITHIN(6, 2500, drive.command.target_erpm);
}

/* ---- debouncing ---- */

void test_button_acts_once_after_30_ms_of_calm_contact(void)
{
    enum { MOST = 60000 };
    static const struct {
        const char *what;
        uint16_t ms, bounce_every, acts_at; /* 0: never */
    } cases[] = {
        { "a long press", MOST, 0, 30 },
        { "a contact that opens every 30 ms", 200, 30, 0 },
        { "one that opens every other millisecond", 200, 2, 0 },
    };
    EACH(n, cases) {
        button_t b = { 0 };
        uint16_t ms;
        for (ms = 1; ms <= cases[n].ms; ms++) {
            uint16_t down = (uint16_t)(cases[n].bounce_every == 0u || (ms % cases[n].bounce_every) != 0u);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(ms == cases[n].acts_at, button_pressed(&b, down, 1), cases[n].what);
        }
        for (ms = 0; ms < 50u; ms++) { /* bounces at release */
            TEST_ASSERT_EQUAL_UINT16_MESSAGE(0, button_pressed(&b, ms & 1u, 1), cases[n].what);
        }
    }
}

void test_a_button_that_is_held_for_minutes_acts_once(void)
{
    button_t b = { 0 };
    uint32_t ms;
    TEST_ASSERT_EQUAL_UINT16(1, button_pressed(&b, 1, 30));
    for (ms = 0; ms < 70000ul; ms++) { /* more than the counter's word holds */
        TEST_ASSERT_EQUAL_UINT16(0, button_pressed(&b, 1, 1));
    }
}

void test_each_press_acts_and_slow_passes_count_their_elapsed_time(void)
{
    static const uint16_t presses[][2] = { { 40, 1 }, { 29, 0 }, { 30, 1 }, { 31, 1 } };
    button_t b = { 0 };
    EACH(n, presses) {
        TEST_ASSERT_EQUAL_UINT16(presses[n][1], button_pressed(&b, 1, presses[n][0]));
        (void)button_pressed(&b, 0, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(0, button_pressed(&b, 1, 10));
    TEST_ASSERT_EQUAL_UINT16(0, button_pressed(&b, 1, 19));
    TEST_ASSERT_EQUAL_UINT16(1, button_pressed(&b, 1, 1));
}

void test_a_start_that_is_asked_for_is_not_begun_anew_before_the_interrupt_has_seen_it(void)
{
    static const buttons_t nothing = { 0, 0, 1 };
    the_request.wish_run = 1;
    panel_pass(&params, &nothing);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    drive.forced.speed_q10 = 77;
    panel_pass(&params, &nothing);
    TEST_ASSERT_EQUAL_INT32(77, drive.forced.speed_q10);
}

/* ---- S2 ---- */

void test_S2_starts_and_stops_and_nothing_else_starts(void)
{
    panel_and_drive_ms(1000);
    press_s3(100);
    press_s2(29);
    panel_and_drive_ms(100);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "no S2 yet");
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    press_s2(30);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
    rig_tick(500);
    EXPECT_DRIVE(DRIVE_ALIGN, FAULT_NONE, "started");
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    panel_and_drive_ms(100);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "stopped");
}

void test_S2_during_calibration_starts_only_after_it(void)
{
    panel_reset();
    rig_power_up();
    press_s2(40);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    panel_and_drive_ms(30);
    EXPECT_DRIVE(DRIVE_CALIBRATE, FAULT_NONE, "calibrating");
    panel_and_drive_ms(40);
    TEST_ASSERT_TRUE(drive.state > (uint16_t)DRIVE_STOPPED);
}

void test_S2_in_a_fault_only_clears_it_and_a_second_press_runs_again(void)
{
    press_s2(50);
    panel_and_drive_ms(50);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    panel_and_drive_ms(500);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERCURRENT_HW, "not yet cleared");
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.clear_fault);
    panel_and_drive_ms(500);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "cleared");
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    press_s2(50);
    panel_and_drive_ms(5);
    EXPECT_DRIVE(DRIVE_BOOTSTRAP, FAULT_NONE, "asked for again");
}

void test_S2_held_from_before_a_fault_does_not_clear_it(void)
{
    inputs.s2_down = 1;
    panel_and_drive_ms(100);
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    panel_and_drive_ms(1000);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERVOLTAGE, "held");
}

void test_S2_while_stopping_runs_on_at_once(void)
{
    press_s2(50);
    rig_tick(1);
    drive.state = (uint16_t)DRIVE_STOPPING;
    drive.command.run = 0;
    the_request.wish_run = 0;
    press_s2(29);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPING, drive.state); /* the drive itself goes on, from the present speed */
}

/* ---- S3 ---- */

void test_S3_changes_the_range_only_while_running_and_every_start_begins_in_the_low_range(void)
{
    press_s3(50);
    TEST_ASSERT_EQUAL_INT16(0, app_panel.fast_range);
    press_s2(50);
    press_s3(29);
    TEST_ASSERT_EQUAL_INT16(0, app_panel.fast_range);
    press_s3(50);
    TEST_ASSERT_EQUAL_INT16(1, app_panel.fast_range);
    TEST_ASSERT_INT16_WITHIN(15, 14000, drive.command.target_erpm);
    press_s3(50);
    TEST_ASSERT_EQUAL_INT16(0, app_panel.fast_range);
    TEST_ASSERT_INT16_WITHIN(15, 2500, drive.command.target_erpm);
    press_s3(50);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(0, app_panel.fast_range);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(0, app_panel.fast_range);
}

/* ---- potentiometer ---- */

void test_pot_spans_MINIMUM_to_NOMINAL_and_with_S3_NOMINAL_to_MAXIMUM(void)
{
    static const int16_t cases[][3] = { /* pot, target, with S3; half a converter step is 11500 / 2048 */
        { -32768, 2500, 14000 }, { -16384, 5375, 17375 }, { 0, 8250, 20750 }, { 32704, 14000, 27500 }, { 32767, 14000, 27500 }
    };
    int32_t pot;
    int16_t last = 0;
    EACH(n, cases) {
        TEST_ASSERT_INT16_WITHIN(6, cases[n][1], panel_target(&params, cases[n][0], 0, 1));
        TEST_ASSERT_INT16_WITHIN(7, cases[n][2], panel_target(&params, cases[n][0], 1, 1));
    }
    for (pot = -32768; pot <= 32767; pot += 61) {
        int16_t target = panel_target(&params, (int16_t)pot, 0, 1);
        TEST_ASSERT_TRUE(target >= 2500 && target <= 14000);
        TEST_ASSERT_TRUE(target >= last);
        last = target;
    }
    TEST_ASSERT_TRUE(panel_target(&params, 32767, 1, 1) <= 27500);
    TEST_ASSERT_TRUE(panel_target(&params, -32768, 1, 1) >= 14000);
}

void test_pot_arrives_at_the_command_over_ten_milliseconds(void)
{
    static const int16_t cases[][2] = { { 512, 8250 }, { 1023, 14000 }, { 0, 2500 } };
    EACH(n, cases) {
        panel_turn_pot((uint16_t)cases[n][0]);
        TEST_ASSERT_INT16_WITHIN(15, cases[n][1], drive.command.target_erpm);
    }
    the_pot.now_q15 = 32704;
    panel_ms(10); /* 1 - 0.9^10 = 65 % */
    TEST_ASSERT_INT16_WITHIN(300, (int16_t)(2500 + 0.65F * 11500.0F), drive.command.target_erpm);
}

void test_pot_noise_of_one_step_does_not_move_the_target_and_two_steps_do(void)
{
    int16_t before = 0, ms;
    panel_turn_pot(500);
    for (ms = 0; ms < 600; ms++) {
        the_pot.now_q15 = (int16_t)((uint16_t)((500u + (uint16_t)(ms & 1)) << 6) ^ 0x8000u);
        panel_ms(1);
        before = (ms <= 100) ? drive.command.target_erpm : before; /* settled */
        TEST_ASSERT_EQUAL_INT16(before, drive.command.target_erpm);
    }
    panel_turn_pot(500);
    before = drive.command.target_erpm;
    panel_turn_pot(502);
    TEST_ASSERT_GREATER_THAN_INT16(before, drive.command.target_erpm);
    before = drive.command.target_erpm;
    panel_turn_pot(499);
    TEST_ASSERT_LESS_THAN_INT16(before, drive.command.target_erpm);
}

void test_pot_is_held_within_half_a_converter_step(void)
{
    static const int16_t cases[][2] = { { 32, 1000 }, { -32, 1000 }, { 33, 1033 }, { -33, 967 } };
    EACH(n, cases) {
        the_pot.used_q15 = 1000;
        the_pot.now_q15 = (int16_t)(1000 + cases[n][0]);
        the_pot.smooth_q31 = (int32_t)the_pot.now_q15 * 65536; /* the filter has settled */
        panel_ms(400);
        TEST_ASSERT_INT16_WITHIN(cases[n][1] != 1000, cases[n][1], the_pot.used_q15);
    }
}

/* ---- LEDs ---- */

void test_run_LED_is_on_exactly_while_the_bridge_switches(void)
{
    EACH(state, rig_outputs) {
        drive.state = state;
        panel_ms(1);
        TEST_ASSERT_EQUAL_UINT16(rig_outputs[state] == (uint16_t)OUTPUTS_PWM, the_lights.led_run);
    }
}

/** What the alive LED does for a while. */
typedef struct {
    uint16_t on_ms, flashes, longest_dark_ms, lit_at_end;
} blinking_t;

static blinking_t watch_led(uint16_t ms)
{
    blinking_t seen = { 0, 0, 0, 0 };
    uint16_t dark = 0;
    while (ms-- != 0u) {
        uint16_t before = seen.lit_at_end;
        panel_ms(1);
        seen.lit_at_end = the_lights.led_alive;
        seen.on_ms = (uint16_t)(seen.on_ms + the_lights.led_alive);
        seen.flashes = (uint16_t)(seen.flashes + (the_lights.led_alive && !before));
        dark = (uint16_t)(the_lights.led_alive ? 0 : dark + 1);
        seen.longest_dark_ms = (dark > seen.longest_dark_ms) ? dark : seen.longest_dark_ms;
    }
    return seen;
}

void test_alive_LED_blinks_once_a_second(void)
{
    blinking_t seen;
    panel_reset();
    seen = watch_led(10000);
    TEST_ASSERT_UINT16_WITHIN(1, 10, (uint16_t)(seen.flashes - (seen.lit_at_end != 0u)));
    TEST_ASSERT_EQUAL_UINT16(5000, seen.on_ms);
    TEST_ASSERT_UINT16_WITHIN(1, 500, seen.longest_dark_ms);
}

void test_fault_LED_blinks_the_code_and_then_pauses(void)
{
    uint16_t code;
    for (code = 1; code < (uint16_t)FAULT_COUNT; code++) {
        uint16_t cycle_ms = (uint16_t)(500u * code + 1500u);
        blinking_t seen;
        panel_reset();
        drive.fault = code;
        drive.state = (uint16_t)DRIVE_FAULT;
        seen = watch_led(cycle_ms);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(code, seen.flashes - (seen.lit_at_end != 0u), "flashes in one cycle");
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(2, 1750, seen.longest_dark_ms, "last gap and pause");
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(1, code, watch_led(cycle_ms).flashes, "the next cycle");
    }
}

/* ---- dead ends of the travel ---- */

static drive_params_t dead_ends(void)
{
    drive_params_t with = params;
    with.pot_zero_q16 = 6554;  /* POT_LIVE_ZERO 0.1 */
    with.pot_scale_q15 = 40960; /* 1 / 0.8 */
    return with;
}

void test_travel_between_its_dead_ends_is_the_whole_range(void)
{
    static const struct {
        float share;
        int16_t target_erpm;
    } cases[] = { { 0.0F, 2500 }, { 0.1F, 2500 }, { 0.3F, 2500 + 11500 / 4 }, { 0.5F, 2500 + 11500 / 2 }, { 0.9F, 14000 }, { 1.0F, 14000 } };
    drive_params_t with = dead_ends();
    EACH(n, cases) {
        int16_t pot_q15 = (int16_t)((cases[n].share - 0.5F) * 65535.0F);
        TEST_ASSERT_INT16_WITHIN_MESSAGE(15, cases[n].target_erpm, panel_target(&with, pot_q15, 0, 1), golden_row(n));
    }
}

void test_signal_in_the_outer_half_of_a_dead_end_is_a_broken_wire_after_100_ms(void)
{
    static const struct {
        float share;
        uint16_t ms; /* until the fault, 0: never */
    } cases[] = { { 0.0F, 100 }, { 0.049F, 100 }, { 0.051F, 0 }, { 0.5F, 0 }, { 0.949F, 0 }, { 0.951F, 100 }, { 1.0F, 100 } };
    static const buttons_t nothing = { 0, 0, 1 };
    drive_params_t with = dead_ends();
    EACH(n, cases) {
        uint16_t ms;
        panel_reset();
        rig_ready();
        the_pot.now_q15 = (int16_t)((cases[n].share - 0.5F) * 65535.0F);
        for (ms = 1; ms < 1000u; ms++) {
            panel_pass(&with, &nothing);
            TEST_ASSERT_EQUAL_UINT16_MESSAGE((cases[n].ms != 0u && ms >= cases[n].ms) ? FAULT_POTENTIOMETER : FAULT_NONE, drive.fault, golden_row(n));
        }
        drive.fault = (uint16_t)FAULT_NONE;
    }
}

void test_the_outer_half_of_a_dead_end_ends_at_a_count(void)
{
    static const struct {
        uint16_t pot_q16, lost;
    } cases[] = { { 3276, 1 }, { 3277, 0 }, { 65535 - 3277, 0 }, { 65535 - 3276, 1 } };
    drive_params_t with = dead_ends();
    EACH(n, cases) {
        panel_reset();
        the_pot.now_q15 = (int16_t)(cases[n].pot_q16 ^ 0x8000u);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].lost, pot_is_broken(&the_pot, &with, 100), golden_row(n));
    }
}

void test_without_dead_ends_no_position_is_a_fault(void)
{
    static const buttons_t nothing = { 0, 0, 500 };
    TEST_ASSERT_EQUAL_UINT16(0, params.pot_zero_q16); /* the MCLV's potentiometer reaches both rails */
    the_pot.now_q15 = INT16_MIN;
    panel_pass(&params, &nothing);
    the_pot.now_q15 = INT16_MAX;
    panel_pass(&params, &nothing);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
}

void test_a_lost_potentiometer_stays_lost_for_longer_than_a_word_counts(void)
{
    drive_params_t with = dead_ends();
    uint32_t ms;
    the_pot.now_q15 = INT16_MIN;
    (void)pot_is_broken(&the_pot, &with, 100);
    for (ms = 0; ms < 70000ul; ms++) {
        TEST_ASSERT_EQUAL_UINT16(1, pot_is_broken(&the_pot, &with, 1));
    }
}

/* ---- wishes that nobody had ---- */

void test_a_flipped_bit_of_the_wish_or_of_the_range_shows_and_a_wish_does_not(void)
{
    uint16_t bit;
    for (bit = 0; bit < 64u; bit++) {
        const uint16_t is_range = (uint16_t)(bit & 16u);
        int16_t *word = is_range ? &app_panel.fast_range : &the_request.wish_run;
        panel_reset();
        rig_ready();
        if (bit >= 32u) {
            press_s2(100);
            press_s3(100);
            TEST_ASSERT_TRUE(the_request.wish_run == 1 && app_panel.fast_range == 1);
        }
        TEST_ASSERT_EQUAL_UINT16(1, request_holds(&the_request));
        *word = (int16_t)(*word ^ (int16_t)(1u << (bit & 15u)));
        panel_ms(2);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(is_range ? 1 : 0, request_holds(&the_request), golden_row(bit));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(is_range ? FAULT_APPLICATION : FAULT_NONE, drive.fault, golden_row(bit));
    }
}
