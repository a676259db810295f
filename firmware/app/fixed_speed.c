/* Application: one speed. It starts at power-up and turns at FIXED_RPM. After a fault that may pass it waits, and tries again FIXED_TRIES times. */
#include "app/app.h"

#define FIXED_RPM 1500
#define FIXED_TRIES 3u       /* then the fault stays until the next power-up */
#define FIXED_PAUSE_MS 3000u /* before a fault is cleared */
#define FIXED_CALM_MS 60000u /* so long without a fault, and all tries are left again */

static uint16_t tries, had_fault, since_ms; /* since a fault has come or gone */

void app_init(void)
{
    tries = FIXED_TRIES;
    had_fault = 0;
    since_ms = 0;
}

/** Counts the time with a fault, or without one. */
static void count(uint16_t has_fault, uint16_t elapsed_ms)
{
    if (has_fault != had_fault) {
        had_fault = has_fault;
        since_ms = 0;
    } else if (since_ms < FIXED_CALM_MS) {
        since_ms = (uint16_t)(since_ms + elapsed_ms);
    } else { /* long enough */
    }
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    const uint16_t has_fault = (uint16_t)(told->fault != (uint16_t)FAULT_NONE);
    count(has_fault, told->elapsed_ms);
    if (!has_fault && since_ms >= FIXED_CALM_MS) {
        tries = FIXED_TRIES;
    } else if (has_fault && since_ms >= FIXED_PAUSE_MS && tries != 0u && app_may_pass(told->fault)) {
        tries--;
        since_ms = 0;
        asks->clear_fault = 1;
    } else { /* it runs, or waits */
    }
    asks->run = (int16_t)(!has_fault && !told->is_remote); /* it starts again when a client has given the command back */
    asks->target_erpm = ((DIRECTION_INPUT_USED) && (told->inputs & APP_DIRECTION) != 0u) ? APP_RPM(-FIXED_RPM) : APP_RPM(FIXED_RPM);
    asks->outputs = app_lights(told);
}
