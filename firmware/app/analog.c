/* Application: a signal of 0..10 V on the potentiometer's input runs the motor. Above ANALOG_START it turns, MINIMUM_SPEED_RPM to MAXIMUM_SPEED_RPM;
 * below ANALOG_STOP it stops. A signal below ANALOG_STOP for ANALOG_CLEAR_MS clears a fault. The board needs a divider from 10 V to 3.3 V.
 *
 * 2..10 V and 4..20 mA, as 0.55..2.75 V at the pin: POT_LIVE_ZERO 0.167 in userparams.h; a broken wire is then the fault POTENTIOMETER. At 0..10 V the motor stops. */
#include "app/app.h"

#define ANALOG_STOP APP_SHARE(0.05)
#define ANALOG_START APP_SHARE(0.08)
#define ANALOG_CLEAR_MS 1000u

static uint16_t is_on, off_ms; /* since the signal has gone */

void app_init(void)
{
    is_on = 0;
    off_ms = 0;
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    const app_range_t all = { told->slow.low, told->fast.high };
    if (told->pot_is_lost) {
        asks->fault = (uint16_t)FAULT_POTENTIOMETER;
        off_ms = 0;
    }
    if (told->pot_q16 >= (is_on ? ANALOG_STOP : ANALOG_START)) {
        is_on = 1;
        off_ms = 0;
    } else {
        is_on = 0;
        off_ms = (uint16_t)((off_ms < ANALOG_CLEAR_MS) ? off_ms + told->elapsed_ms : off_ms);
    }
    asks->clear_fault = (uint16_t)(told->fault != (uint16_t)FAULT_NONE && off_ms >= ANALOG_CLEAR_MS);
    asks->run = (int16_t)(is_on && told->fault == (uint16_t)FAULT_NONE && !told->is_remote);
    asks->target_erpm = (int16_t)(told->towards * app_between(all, app_share(told->pot_q16, ANALOG_START, 65535u)));
    asks->outputs = app_lights(told);
}
