/* An application that is stuck from the moment when S3 is pressed. */
#include "app/app.h"

static volatile uint16_t stuck;

void app_init(void)
{
    stuck = 0;
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    asks->run = 1;
    asks->target = APP_RPM(1500);
    stuck = (uint16_t)(told->inputs & APP_S3);
    while (stuck) {
    }
}
