/* The panel: debounced buttons, what S2 and S3 do in every state, the potentiometer's range and calm, and the LEDs. */
#include "panel_rig.h"
#include "unity.h"

void setUp(void)
{
    panel_reset();
    rig_ready();
    panel_turn_pot(0);
}

void tearDown(void)
{
}

void test_init_forgets_everything_and_puts_the_pot_at_its_lower_end(void)
{
    static const panel_inputs_t nothing = { 0, 0, 1 };
    the_panel.s2.down_ms = 29;
    the_panel.s3.down_ms = 29;
    the_panel.wish_run = 1;
    the_panel.fast_range = 1;
    the_panel.blink_ms = 999;
    panel_init(&the_panel);
    TEST_ASSERT_EQUAL_UINT16(0, the_panel.s2.down_ms);
    TEST_ASSERT_EQUAL_UINT16(0, the_panel.s3.down_ms);
    TEST_ASSERT_EQUAL_INT16(0, the_panel.wish_run);
    TEST_ASSERT_EQUAL_INT16(0, the_panel.fast_range);
    TEST_ASSERT_EQUAL_UINT16(0, the_panel.blink_ms);
    the_panel.pot_q15 = -32768;
    the_lights = panel_tick(&the_panel, &drive, &params, &nothing);
    TEST_ASSERT_INT16_WITHIN(6, 2500, drive.command.target_erpm);
}

/* ---- debouncing ---- */

void test_button_acts_after_30_ms(void)
{
    button_t b = { 0 };
    uint16_t ms;
    for (ms = 1; ms < 30u; ms++) {
        TEST_ASSERT_EQUAL_UINT16(0, button_pressed(&b, 1, 1));
    }
    TEST_ASSERT_EQUAL_UINT16(1, button_pressed(&b, 1, 1));
}

void test_long_press_acts_once(void)
{
    button_t b = { 0 };
    uint16_t ms, acts = 0;
    for (ms = 0; ms < 60000u; ms++) {
        acts = (uint16_t)(acts + button_pressed(&b, 1, 1));
    }
    TEST_ASSERT_EQUAL_UINT16(1, acts);
}

void test_bouncing_contact_does_not_act_before_it_is_calm(void)
{
    button_t b = { 0 };
    uint16_t ms;
    for (ms = 0; ms < 200u; ms++) {
        TEST_ASSERT_EQUAL_UINT16(0, button_pressed(&b, (uint16_t)((ms % 30u) != 29u), 1));
    }
}

void test_bounces_at_release_do_not_act_again(void)
{
    button_t b = { 0 };
    uint16_t ms, acts = 0;
    for (ms = 0; ms < 100u; ms++) {
        (void)button_pressed(&b, 1, 1);
    }
    for (ms = 0; ms < 50u; ms++) {
        acts = (uint16_t)(acts + button_pressed(&b, ms & 1u, 1));
    }
    TEST_ASSERT_EQUAL_UINT16(0, acts);
}

void test_each_press_acts(void)
{
    button_t b = { 0 };
    uint16_t press, acts = 0;
    for (press = 0; press < 5u; press++) {
        acts = (uint16_t)(acts + button_pressed(&b, 1, 40));
        (void)button_pressed(&b, 0, 1);
    }
    TEST_ASSERT_EQUAL_UINT16(5, acts);
}

void test_slow_passes_count_their_elapsed_time(void)
{
    button_t b = { 0 };
    TEST_ASSERT_EQUAL_UINT16(0, button_pressed(&b, 1, 10));
    TEST_ASSERT_EQUAL_UINT16(0, button_pressed(&b, 1, 19));
    TEST_ASSERT_EQUAL_UINT16(1, button_pressed(&b, 1, 1));
}

/* ---- S2 ---- */

void test_S2_starts(void)
{
    press_s2(29);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    press_s2(30);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
    TEST_ASSERT_EQUAL_INT16(1, drive.direction);
}

void test_S2_stops(void)
{
    press_s2(50);
    rig_tick(500);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_ALIGN, drive.state);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    rig_tick(1);
    panel_and_drive_ms(100);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
}

void test_no_start_without_S2(void)
{
    panel_and_drive_ms(1000);
    press_s3(100);
    panel_and_drive_ms(100);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
}

void test_S2_during_calibration_starts_only_after_it(void)
{
    panel_reset();
    rig_power_up();
    press_s2(40);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    panel_and_drive_ms(30);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_CALIBRATE, drive.state);
    TEST_ASSERT_EQUAL_UINT16(OUTPUTS_OFF, out.outputs);
    panel_and_drive_ms(40);
    TEST_ASSERT_TRUE(drive.state > (uint16_t)DRIVE_STOPPED);
}

void test_S2_in_a_fault_only_clears_it(void)
{
    drive_raise(&drive, FAULT_STALL);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.clear_fault);
    panel_and_drive_ms(500);
    TEST_ASSERT_EQUAL_UINT16(FAULT_NONE, drive.fault);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
}

void test_fault_while_running_needs_two_presses_to_run_again(void)
{
    press_s2(50);
    panel_and_drive_ms(50);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    panel_and_drive_ms(500);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_FAULT, drive.state);
    press_s2(50);
    panel_and_drive_ms(500);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_STOPPED, drive.state);
    press_s2(50);
    panel_and_drive_ms(5);
    TEST_ASSERT_EQUAL_UINT16(DRIVE_BOOTSTRAP, drive.state);
}

void test_S2_held_from_before_a_fault_does_not_clear_it(void)
{
    inputs.s2_down = 1;
    panel_and_drive_ms(100);
    drive_raise(&drive, FAULT_OVERVOLTAGE);
    panel_and_drive_ms(1000);
    TEST_ASSERT_EQUAL_UINT16(FAULT_OVERVOLTAGE, drive.fault);
}

void test_S2_while_stopping_starts_again_after_the_stop(void)
{
    press_s2(50);
    rig_tick(1);
    drive.state = (uint16_t)DRIVE_STOPPING;
    drive.command.run = 0;
    the_panel.wish_run = 0;
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    drive.state = (uint16_t)DRIVE_STOPPED;
    panel_ms(1);
    TEST_ASSERT_EQUAL_INT16(1, drive.command.run);
}

/* ---- S3 ---- */

void test_S3_changes_the_range_only_while_running(void)
{
    press_s3(50);
    TEST_ASSERT_EQUAL_INT16(0, the_panel.fast_range);
    press_s2(50);
    press_s3(29);
    TEST_ASSERT_EQUAL_INT16(0, the_panel.fast_range);
    press_s3(50);
    TEST_ASSERT_EQUAL_INT16(1, the_panel.fast_range);
    TEST_ASSERT_INT16_WITHIN(15, 14000, drive.command.target_erpm);
    press_s3(50);
    TEST_ASSERT_EQUAL_INT16(0, the_panel.fast_range);
    TEST_ASSERT_INT16_WITHIN(15, 2500, drive.command.target_erpm);
}

void test_every_start_begins_in_the_low_range(void)
{
    press_s2(50);
    press_s3(50);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(0, the_panel.fast_range);
    press_s2(50);
    TEST_ASSERT_EQUAL_INT16(0, the_panel.fast_range);
}

/* ---- potentiometer ---- */

void test_pot_spans_MINIMUM_to_NOMINAL(void)
{
    TEST_ASSERT_INT16_WITHIN(6, 2500, panel_target(&params, -32768, 0, 1));
    TEST_ASSERT_INT16_WITHIN(6, 14000, panel_target(&params, 32704, 0, 1)); /* half a converter step: 11500 / 2048 */
    TEST_ASSERT_INT16_WITHIN(6, 8250, panel_target(&params, 0, 0, 1));
    TEST_ASSERT_INT16_WITHIN(6, 5375, panel_target(&params, -16384, 0, 1));
}

void test_pot_with_S3_spans_NOMINAL_to_MAXIMUM(void)
{
    TEST_ASSERT_INT16_WITHIN(7, 14000, panel_target(&params, -32768, 1, 1));
    TEST_ASSERT_INT16_WITHIN(7, 27500, panel_target(&params, 32704, 1, 1));
    TEST_ASSERT_INT16_WITHIN(7, 20750, panel_target(&params, 0, 1, 1));
}

void test_pot_never_leaves_its_range(void)
{
    int32_t pot;
    int16_t last = 0;
    for (pot = -32768; pot <= 32767; pot += 61) {
        int16_t target = panel_target(&params, (int16_t)pot, 0, 1);
        TEST_ASSERT_TRUE(target >= 2500 && target <= 14000);
        TEST_ASSERT_TRUE(target >= last);
        last = target;
    }
    TEST_ASSERT_TRUE(panel_target(&params, 32767, 1, 1) <= 27500);
    TEST_ASSERT_TRUE(panel_target(&params, -32768, 1, 1) >= 14000);
}

void test_pot_arrives_at_the_command(void)
{
    panel_turn_pot(512);
    TEST_ASSERT_INT16_WITHIN(15, 8250, drive.command.target_erpm);
    panel_turn_pot(1023);
    TEST_ASSERT_INT16_WITHIN(15, 14000, drive.command.target_erpm);
    panel_turn_pot(0);
    TEST_ASSERT_INT16_WITHIN(15, 2500, drive.command.target_erpm);
}

void test_pot_noise_of_one_step_does_not_move_the_target(void)
{
    int16_t before = 0, ms;
    panel_turn_pot(500);
    for (ms = 0; ms < 600; ms++) {
        the_panel.pot_q15 = (int16_t)((uint16_t)((500u + (uint16_t)(ms & 1)) << 6) ^ 0x8000u);
        panel_ms(1);
        if (ms == 100) { /* settled */
            before = drive.command.target_erpm;
        }
        if (ms > 100) {
            TEST_ASSERT_EQUAL_INT16(before, drive.command.target_erpm);
        }
    }
}

/** Value in use after the pot has rested at a distance from it. */
static int16_t used_at_distance(int16_t counts)
{
    the_panel.pot_used_q15 = 1000;
    the_panel.pot_q15 = (int16_t)(1000 + counts);
    the_panel.pot_q31 = (int32_t)the_panel.pot_q15 * 65536; /* the filter has settled */
    panel_ms(400);
    return the_panel.pot_used_q15;
}

void test_pot_is_held_within_half_a_converter_step(void)
{
    TEST_ASSERT_EQUAL_INT16(1000, used_at_distance(32));
    TEST_ASSERT_EQUAL_INT16(1000, used_at_distance(-32));
    TEST_ASSERT_INT16_WITHIN(1, 1033, used_at_distance(33));
    TEST_ASSERT_INT16_WITHIN(1, 967, used_at_distance(-33));
}

void test_pot_moves_the_target_from_two_steps_on(void)
{
    int16_t before;
    panel_turn_pot(500);
    before = drive.command.target_erpm;
    panel_turn_pot(502);
    TEST_ASSERT_GREATER_THAN_INT16(before, drive.command.target_erpm);
    before = drive.command.target_erpm;
    panel_turn_pot(499);
    TEST_ASSERT_LESS_THAN_INT16(before, drive.command.target_erpm);
}

void test_pot_is_filtered_over_ten_milliseconds(void)
{
    panel_turn_pot(0);
    the_panel.pot_q15 = 32704;
    panel_ms(10); /* 1 - 0.9^10 = 65 % */
    TEST_ASSERT_INT16_WITHIN(300, (int16_t)(2500 + 0.65F * 11500.0F), drive.command.target_erpm);
}

/* ---- LEDs ---- */

void test_run_LED_is_on_exactly_while_the_bridge_switches(void)
{
    uint16_t state;
    for (state = 0; state < (uint16_t)DRIVE_STATE_COUNT; state++) {
        drive.state = state;
        panel_ms(1);
        TEST_ASSERT_EQUAL_UINT16(state >= (uint16_t)DRIVE_ALIGN && state <= (uint16_t)DRIVE_STOPPING, the_lights.led_run);
    }
}

void test_alive_LED_blinks_once_a_second(void)
{
    uint16_t ms, on = 0, edges = 0, last;
    panel_ms(1);
    last = the_lights.led_alive;
    for (ms = 0; ms < 10000u; ms++) {
        panel_ms(1);
        on = (uint16_t)(on + the_lights.led_alive);
        edges = (uint16_t)(edges + (the_lights.led_alive != last));
        last = the_lights.led_alive;
    }
    TEST_ASSERT_EQUAL_UINT16(20, edges);
    TEST_ASSERT_EQUAL_UINT16(5000, on);
}

void test_fault_LED_blinks_the_code_and_then_pauses(void)
{
    uint16_t code;
    for (code = 1; code < (uint16_t)FAULT_COUNT; code++) {
        uint16_t ms, flashes = 0, last = 0, dark = 0, longest_dark = 0;
        panel_reset();
        drive.fault = code;
        drive.state = (uint16_t)DRIVE_FAULT;
        for (ms = 0; ms < (uint16_t)(500u * code + 1500u); ms++) {
            panel_ms(1);
            flashes = (uint16_t)(flashes + (the_lights.led_alive && !last));
            dark = (uint16_t)(the_lights.led_alive ? 0 : dark + 1);
            longest_dark = (dark > longest_dark) ? dark : longest_dark;
            last = the_lights.led_alive;
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(code, flashes - (uint16_t)(last != 0u), "flashes in one cycle");
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(2, 1750, longest_dark, "last gap and pause");
        flashes = 0;
        for (ms = 0; ms < (uint16_t)(500u * code + 1500u); ms++) {
            panel_ms(1);
            flashes = (uint16_t)(flashes + (the_lights.led_alive && !last));
            last = the_lights.led_alive;
        }
        TEST_ASSERT_UINT16_WITHIN_MESSAGE(1, code, flashes, "the next cycle");
    }
}
