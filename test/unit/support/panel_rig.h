/* A person at the board for unit tests: presses buttons, turns the potentiometer and reads the LEDs, millisecond by millisecond. */
#ifndef TEST_PANEL_RIG_H
#define TEST_PANEL_RIG_H

#include "drive_rig.h"

#include "drive/panel.h"

static panel_t the_panel;
static panel_inputs_t inputs;
static panel_lights_t the_lights;

/** Milliseconds of the panel alone. */
static inline void panel_ms(uint16_t ms)
{
    while (ms-- != 0u) {
        inputs.elapsed_ms = 1;
        the_lights = panel_tick(&the_panel, &drive, &params, &inputs);
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
    the_panel.pot_q15 = (int16_t)((uint16_t)(result << 6) ^ 0x8000u);
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
    static const panel_inputs_t nothing;
    panel_init(&the_panel);
    inputs = nothing;
}

#endif
