/* Application: a fan whose speed follows a temperature. It starts at 40 degrees Celsius with FAN_LOW_RPM, reaches FAN_HIGH_RPM at 70, and stops at 37.
 * A fan that the wind turns is caught: the drive does so at each start. A fault that may pass is cleared after FAN_PAUSE_MS, again and again.
 *
 * The temperature is the bridge's with BRIDGE_NTC_USED. Else an NTC thermistor is on the potentiometer's input: 10 kohm, B = 3435 K, to ground, 10 kohm to
 * 3.3 V; with a broken wire or a short circuit the fan turns at FAN_HIGH_RPM. Another sensor there: other shares. */
#include "app/app.h"

#if BRIDGE_NTC_USED
#define FAN_WARMTH(told) ((uint16_t)((told)->bridge_q4 - APP_CELSIUS(-41)))
#define FAN_AT(celsius, share) ((uint16_t)APP_CELSIUS((celsius) + 41))
#else
#define FAN_WARMTH(told) ((uint16_t) ~(told)->pot_q16)
#define FAN_AT(celsius, share) APP_SHARE(1.0 - (share)) /* the thermistor's share of the resistance falls with the temperature */
#endif
#define FAN_OFF FAN_AT(37, 0.390)
#define FAN_ON FAN_AT(40, 0.365)
#define FAN_FULL FAN_AT(70, 0.181)
#define FAN_BROKEN FAN_AT(-40, 0.98) /* below it a wire is broken; a short circuit reads as hot */
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
    fault_ms = (uint16_t)(app_may_pass(told->fault) ? fault_ms + told->elapsed_ms : 0);
    if (fault_ms < FAN_PAUSE_MS) {
        return 0;
    }
    fault_ms = 0;
    return 1;
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    const app_range_t speeds = { APP_RPM(FAN_LOW_RPM), APP_RPM(FAN_HIGH_RPM) };
    uint16_t has_turned, warmth = FAN_WARMTH(told);
    if (warmth < FAN_BROKEN) {
        warmth = 65535u;
    }
    has_turned = (uint16_t)(is_on != (warmth >= (is_on ? FAN_OFF : FAN_ON)));
    turned_ms = (uint16_t)(has_turned ? turned_ms + told->elapsed_ms : 0);
    if (turned_ms >= FAN_CALM_MS) {
        is_on ^= 1u;
    }
    asks->target_erpm = app_between(speeds, app_share(warmth, FAN_ON, FAN_FULL));
    asks->clear_fault = retries(told);
    asks->run = (int16_t)(is_on && told->fault == (uint16_t)FAULT_NONE && !told->is_remote);
    asks->outputs = app_lights(told);
}
