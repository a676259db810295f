/* Application: a fan whose speed follows a temperature. It starts at 40 degrees Celsius with FAN_LOW_RPM, reaches FAN_HIGH_RPM at 70, and stops at 37.
 * A fan that the wind turns is caught: the drive does so at each start. A fault that may pass is cleared after FAN_PAUSE_MS, again and again.
 *
 * The sensor is on the potentiometer's input: an NTC thermistor of 10 kohm, B = 3435 K, to ground, 10 kohm to 3.3 V. With a broken wire or a short circuit
 * the fan turns at FAN_HIGH_RPM. Another sensor: other shares; where more voltage is warmer, warmth_q16 = told->pot_q16. */
#include "app/app.h"

/* The thermistor's share of the resistance falls with the temperature: 1 less it rises. */
#define FAN_OFF APP_SHARE(1.0 - 0.390)   /* 37 degrees Celsius */
#define FAN_ON APP_SHARE(1.0 - 0.365)    /* 40 */
#define FAN_FULL APP_SHARE(1.0 - 0.181)  /* 70 */
#define FAN_BROKEN APP_SHARE(1.0 - 0.98) /* below it a wire is broken; a short circuit reads as hot */
#define FAN_LOW_RPM 800
#define FAN_HIGH_RPM 3000
#define FAN_CALM_MS 500u /* so long on the other side of its threshold: at power-up the input begins at 0, and a wire that breaks passes all */
#define FAN_PAUSE_MS 10000u

static uint16_t is_on, turned_ms, fault_ms;

void app_init(void)
{
    is_on = 0;
    turned_ms = 0;
    fault_ms = 0;
}

/** Clears a fault that may pass, after a pause. @return 1 at its end */
static uint16_t retries(const app_told_t *told)
{
    if (!app_may_pass(told->fault)) {
        fault_ms = 0;
        return 0;
    }
    fault_ms = (uint16_t)(fault_ms + told->elapsed_ms);
    if (fault_ms < FAN_PAUSE_MS) {
        return 0;
    }
    fault_ms = 0;
    return 1;
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    const app_range_t speeds = { APP_RPM(FAN_LOW_RPM), APP_RPM(FAN_HIGH_RPM) };
    uint16_t has_turned, warmth_q16 = (uint16_t)~told->pot_q16;
    if (warmth_q16 < FAN_BROKEN) {
        warmth_q16 = 65535u;
    }
    has_turned = (uint16_t)(is_on != (warmth_q16 >= (is_on ? FAN_OFF : FAN_ON)));
    turned_ms = (uint16_t)(has_turned ? turned_ms + told->elapsed_ms : 0);
    if (turned_ms >= FAN_CALM_MS) {
        is_on ^= 1u;
    }
    asks->target_erpm = app_between(speeds, app_share(warmth_q16, FAN_ON, FAN_FULL));
    asks->clear_fault = retries(told);
    asks->run = (int16_t)(is_on && told->fault == (uint16_t)FAULT_NONE && !told->is_remote);
    asks->outputs = app_lights(told);
}
