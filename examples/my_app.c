/* My application: the motor turns while S2 is down; the potentiometer is the speed, 500 to 3000 rpm; S3 clears a fault. */
#include "app/app.h"

void app_init(void)
{
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    const app_range_t speeds = { APP_RPM(500), APP_RPM(3000) };
    asks->run = (told->inputs & APP_S2) != 0 && told->fault == FAULT_NONE;
    asks->target_erpm = app_between(speeds, told->pot_q16);
    asks->clear_fault = (told->inputs & APP_S3) != 0;
    asks->outputs = app_lights(told);
}
