/* BRINGUP, a pass of the background: buttons, the line that is still to be said, the step that is due. */
#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

#include "drive/modes/bringup_directions.h"
#include "drive/modes/bringup_gains.h"
#include "drive/modes/bringup_panel.h"
#include "drive/modes/bringup_rest.h"
#include "drive/modes/bringup_say.h"
#include "drive/modes/bringup_turn.h"
#include "drive/panel_tick.h"

#define CURRENT_MS 60000u /* patience while current flows */

static void step_last(bringup_guide_t *g, drive_t *d)
{
    d->command.run = 0;
    bringup_say(g, BRINGUP_ENDS, 0, 0);
    g->message.value = (int32_t)g->found;
    bringup_go(g, BRINGUP_STEP_END);
}

void bringup_init(bringup_guide_t *g)
{
    g->message.kind = (uint16_t)BRINGUP_SILENT;
    g->found = 0;
    g->blocked = 0;
    g->s2.down_ms = 0;
    g->s3.down_ms = 0;
    g->swapped = 0;
    g->leds = 0;
    g->leds_judged = 0;
    g->mean[0] = 0;
    g->mean[1] = 0;
    g->pending = (uint16_t)BRINGUP_FINDINGS;
    g->sender = 1;
    bringup_go(g, BRINGUP_STEP_BEGIN);
}

/** The steps that let current flow, and those after them. */
static void step_with_current(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    switch (g->step) {
    case BRINGUP_STEP_DRIVE: bringup_step_drive(g, d, p); break;
    case BRINGUP_STEP_SHOW: bringup_step_show(g, d); break;
    case BRINGUP_STEP_WIRING: bringup_step_wiring(g); break;
    case BRINGUP_STEP_BRIDGE: bringup_step_bridge(g, d); break;
    case BRINGUP_STEP_AMMETER: bringup_step_ammeter(g, d, p); break;
    case BRINGUP_STEP_GAINS: bringup_step_gains(g); break;
    case BRINGUP_STEP_DIRECTION: bringup_step_direction(g, d); break;
    case BRINGUP_STEP_MARK: bringup_step_mark(g, d); break;
    case BRINGUP_STEP_TURNS: bringup_step_turns(g, d); break;
    case BRINGUP_STEP_LAST: step_last(g, d); break;
    default: /* END: S2 begins anew */
        if (g->button == 2u) {
            bringup_init(g);
        }
        break;
    }
}

static void take_step(bringup_guide_t *g, drive_t *d, const drive_params_t *p, const panel_inputs_t *in, int16_t pot_q15)
{
    switch (g->step) {
    case BRINGUP_STEP_BEGIN: bringup_step_begin(g, in); break;
    case BRINGUP_STEP_S3: bringup_step_s3(g); break;
    case BRINGUP_STEP_UART: bringup_step_uart(g); break;
    case BRINGUP_STEP_LED_ALIVE: bringup_step_led(g, 0); break;
    case BRINGUP_STEP_LED_ALIVE_OTHER: bringup_step_led_other(g, 0); break;
    case BRINGUP_STEP_LED_RUN: bringup_step_led(g, 1); break;
    case BRINGUP_STEP_LED_RUN_OTHER: bringup_step_led_other(g, 1); break;
    case BRINGUP_STEP_POT_LEFT: bringup_step_pot_end(g, pot_q15, 0); break;
    case BRINGUP_STEP_POT_RIGHT: bringup_step_pot_end(g, pot_q15, 1); break;
    case BRINGUP_STEP_POT: bringup_step_pot(g); break;
    case BRINGUP_STEP_BUS: bringup_step_bus(g, d); break;
    case BRINGUP_STEP_OFFSETS: bringup_step_rest(g, d, 0); break;
    case BRINGUP_STEP_NOISES: bringup_step_rest(g, d, 1); break;
    case BRINGUP_STEP_SIGNALS: bringup_step_signals(g, d, p); break;
    case BRINGUP_STEP_FAULT_REST: bringup_step_fault_rest(g, d); break;
    case BRINGUP_STEP_FAULT_INPUT: bringup_step_fault_input(g, d); break;
    case BRINGUP_STEP_FAULT_OPEN: bringup_step_fault_open(g, d); break;
    case BRINGUP_STEP_CURRENT: bringup_step_current(g, d); break;
    default: step_with_current(g, d, p); break;
    }
}

/** The button that has been pressed, by the name on it. */
static void read_buttons(bringup_guide_t *g, const panel_inputs_t *in)
{
    uint16_t s2 = button_pressed(&g->s2, in->s2_down, in->elapsed_ms), s3 = button_pressed(&g->s3, in->s3_down, in->elapsed_ms);
    if (s2 || s3) {
        g->button = (uint16_t)((s2 != g->swapped) ? 2u : 3u);
    }
}

panel_lights_t bringup_pass(bringup_guide_t *g, drive_t *d, const drive_params_t *p, const panel_inputs_t *in, int16_t pot_q15)
{
    panel_lights_t lights;
    read_buttons(g, in);
    g->waited_ms = (uint16_t)((g->waited_ms > UINT16_MAX - in->elapsed_ms) ? UINT16_MAX : g->waited_ms + in->elapsed_ms);
    if (drive_is_running(d) && g->asked && g->waited_ms >= CURRENT_MS) {
        bringup_go(g, BRINGUP_STEP_LAST);
    }
    if (g->message.kind != (uint16_t)BRINGUP_SILENT) {
        /* it is still being said */
    } else if (g->pending != (uint16_t)BRINGUP_FINDINGS) {
        bringup_finding_t finding = (bringup_finding_t)g->pending;
        g->pending = (uint16_t)BRINGUP_FINDINGS;
        bringup_find(g, finding, g->pending_part);
    } else {
        take_step(g, d, p, in, pot_q15);
    }
    lights.led_alive = g->leds & 1u;
    lights.led_run = (uint16_t)(g->leds >> 1);
    return lights;
}

#endif
