/* The application of the MCLV board: S2 starts, stops and clears a fault, S3 changes the range, the potentiometer is the target. */
#include "app/app.h"

#define PANEL_BLINK_MS 250u
#define PANEL_PAUSE_MS 1500u

/** State of the panel. */
typedef struct {
    button_t s2, s3;
    int16_t fast_range; /**< S3: NOMINAL..MAXIMUM instead of MINIMUM..NOMINAL */
    int16_t kept;       /**< its complement: a flipped bit would change the speed */
    uint16_t blink_ms;
} panel_t;

static panel_t app_panel;

/** Nothing pressed, low range. */
static void panel_init(panel_t *panel)
{
    static const panel_t fresh = { .kept = -1 };
    *panel = fresh;
}

static void panel_buttons(panel_t *panel, const app_told_t *told, app_asks_t *asks)
{
    if (button_pressed(&panel->s2, told->inputs & APP_S2, told->elapsed_ms)) {
        asks->clear_fault = (uint16_t)(told->fault != (uint16_t)FAULT_NONE);
        asks->run = (int16_t)(!asks->clear_fault && !asks->run);
        asks->take_command = 1;
        panel->fast_range = 0;
    }
    if (button_pressed(&panel->s3, told->inputs & APP_S3, told->elapsed_ms) && asks->run) {
        panel->fast_range ^= 1;
    }
}

/** A fault's code, blinked. @param burst_ms how long that takes */
static uint16_t panel_fault_light(uint16_t blink_ms, uint16_t burst_ms)
{
    return (uint16_t)(blink_ms < burst_ms && (blink_ms / PANEL_BLINK_MS) % 2u == 0u);
}

/** LED ALIVE blinks once a second; in a fault it blinks the code, then pauses. LED RUN is on while the bridge switches. */
static uint16_t panel_lights(panel_t *panel, const app_told_t *told)
{
    uint16_t burst_ms = (uint16_t)(2u * PANEL_BLINK_MS * told->fault), lit;
    uint16_t blink_ms = (uint16_t)(panel->blink_ms + told->elapsed_ms);
    if (blink_ms >= ((burst_ms == 0u) ? 4u * PANEL_BLINK_MS : burst_ms + PANEL_PAUSE_MS)) {
        blink_ms = 0;
    }
    panel->blink_ms = blink_ms;
    lit = (burst_ms == 0u) ? (uint16_t)(blink_ms < 2u * PANEL_BLINK_MS) : panel_fault_light(blink_ms, burst_ms);
    return (uint16_t)((lit ? (uint16_t)APP_LED_ALIVE : 0u) | (told->is_running ? (uint16_t)APP_LED_RUN : 0u));
}

/** A pass. S2 in a fault only clears the fault; else it starts and stops. S3 changes the range of a running motor. */
static void panel_tick(panel_t *panel, const app_told_t *told, app_asks_t *asks)
{
    if (panel->fast_range != ~panel->kept) {
        asks->fault = (uint16_t)FAULT_APPLICATION;
    } else if (told->pot_is_lost) {
        asks->fault = (uint16_t)FAULT_POTENTIOMETER;
    } else { /* as a rule */
    }
    panel_buttons(panel, told, asks);
    asks->target_erpm = (int16_t)(told->towards * app_between(panel->fast_range ? told->fast : told->slow, told->pot_q16));
    asks->outputs = panel_lights(panel, told);
    if (asks->fault != (uint16_t)FAULT_APPLICATION) {
        panel->kept = (int16_t)~panel->fast_range;
    }
}

void app_init(void)
{
    panel_init(&app_panel);
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    panel_tick(&app_panel, told, asks);
}
