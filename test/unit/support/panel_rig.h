/* A person at the board for unit tests: presses buttons, turns the potentiometer and reads the LEDs, millisecond by millisecond. */
#ifndef TEST_PANEL_RIG_H
#define TEST_PANEL_RIG_H

#include "drive_rig.h"

#include "firmware/app/panel.c"

#include "drive/request.h"

static request_t the_request;
static pot_t the_pot;
static buttons_t inputs;
static lights_t the_lights;
#if SCOPE
static remote_t *the_client;
#endif

/** What the panel is told by a board with these parameters. */
static inline app_told_t panel_told(const drive_params_t *p, const buttons_t *in)
{
    app_told_t told = { .elapsed_ms = in->elapsed_ms, .state = drive.state, .fault = drive.fault, .is_running = drive_is_running(&drive), .towards = drive.direction,
                        .slow = mode_target_range(p, 0), .fast = mode_target_range(p, 1) };
    told.inputs = (uint16_t)((in->s2_down ? (uint16_t)APP_S2 : 0u) | (in->s3_down ? (uint16_t)APP_S3 : 0u));
    told.pot_is_lost = pot_is_broken(&the_pot, p, in->elapsed_ms);
    told.pot_q16 = mode_pot_split(pot_travel(p, pot_smooth(&the_pot)), &told.towards);
    return told;
}

/** A pass of panel and request, as the board makes it. */
static inline void panel_pass(const drive_params_t *p, const buttons_t *in)
{
    const app_told_t told = panel_told(p, in);
    app_asks_t asks = { .run = request_stands(&the_request), .target_erpm = drive.command.target_erpm };
    asked_t asked;
    panel_tick(&app_panel, &told, &asks);
    if (asks.fault != (uint16_t)FAULT_NONE) {
        drive_raise(&drive, (drive_fault_t)asks.fault);
    }
    asked.run = asks.run;
    asked.target_erpm = asks.target_erpm;
    asked.clear_fault = asks.clear_fault;
    asked.take_command = asks.take_command;
    asked.elapsed_ms = in->elapsed_ms;
#if SCOPE
    asked.remote = the_client;
#endif
    request_tick(&the_request, &drive, p, &asked);
    the_lights.led_alive = (uint16_t)((asks.outputs & APP_LED_ALIVE) != 0u);
    the_lights.led_run = (uint16_t)((asks.outputs & APP_LED_RUN) != 0u);
}

/** The panel's target at a potentiometer's sample. */
static inline int16_t panel_target(const drive_params_t *p, int16_t pot_q15, int16_t fast_range, int16_t direction)
{
    static const buttons_t nothing = { 0, 0, 1 };
    app_told_t told = panel_told(p, &nothing);
    app_asks_t asks = { 0 };
    panel_t panel;
    panel_init(&panel);
    panel.fast_range = fast_range;
    panel.kept = (int16_t)~fast_range;
    told.towards = direction;
    told.pot_q16 = mode_pot_split(pot_travel(p, pot_q15), &told.towards);
    panel_tick(&panel, &told, &asks);
    return asks.target_erpm;
}

/** Milliseconds of the panel alone. */
static inline void panel_ms(uint16_t ms)
{
    while (ms-- != 0u) {
        inputs.elapsed_ms = 1;
        panel_pass(&params, &inputs);
    }
}

/** Milliseconds of panel and drive together, 20 periods each. */
static inline void panel_and_drive_ms(uint16_t ms)
{
    while (ms-- != 0u) {
        rig_tick(20);
        panel_ms(1);
    }
}

/** Potentiometer at a 10-bit converter result, long enough for the filter. */
static inline void panel_turn_pot(uint16_t result)
{
    the_pot.now_q15 = (int16_t)((uint16_t)(result << 6) ^ 0x8000u);
    panel_ms(400);
}

static inline void press_s2(uint16_t ms)
{
    inputs.s2_down = 1;
    panel_ms(ms);
    inputs.s2_down = 0;
    panel_ms(1);
}

static inline void press_s3(uint16_t ms)
{
    inputs.s3_down = 1;
    panel_ms(ms);
    inputs.s3_down = 0;
    panel_ms(1);
}

static inline void panel_reset(void)
{
    static const buttons_t nothing;
    panel_init(&app_panel);
    request_init(&the_request);
    pot_init(&the_pot);
    inputs = nothing;
}

#endif
