/* Application: one speed. It starts at power-up, turns at FIXED_RPM, and after a fault tries again FIXED_TRIES times, with a pause between. */
#include "app/app.h"

#define FIXED_RPM 1500
#define FIXED_TRIES 3u       /* then the fault stays until the next power-up */
#define FIXED_PAUSE_MS 5000u /* before a fault is cleared */
#define FIXED_CALM_MS 60000u /* so long without a fault, and all tries are left again */

static uint16_t tries, waited_ms;

void app_init(void)
{
    tries = FIXED_TRIES;
    waited_ms = 0;
}

/** Counts a time. @return 1 once when it is over */
static uint16_t is_over(uint16_t elapsed_ms, uint16_t time_ms)
{
    const uint16_t before = waited_ms;
    waited_ms = (uint16_t)((before < time_ms) ? before + elapsed_ms : before);
    return (uint16_t)(before < time_ms && waited_ms >= time_ms);
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    static uint16_t had_fault;
    const uint16_t has_fault = (uint16_t)(told->fault != (uint16_t)FAULT_NONE);
    if (has_fault != had_fault) {
        had_fault = has_fault;
        waited_ms = 0;
    }
    if (!has_fault) {
        asks->run = 1;
        if (is_over(told->elapsed_ms, FIXED_CALM_MS)) {
            tries = FIXED_TRIES;
        }
    } else if (tries != 0u && is_over(told->elapsed_ms, FIXED_PAUSE_MS)) {
        tries--;
        asks->clear_fault = 1;
        asks->run = 0;
    } else { /* it stays */
    }
    asks->target = APP_RPM(FIXED_RPM);
    asks->outputs = (uint16_t)(told->is_running ? APP_LED_RUN : 0) | (uint16_t)(has_fault ? 0 : APP_LED_ALIVE);
}
