/* An application that takes 100 ms while S2 is down, and is stuck from the moment when S3 is pressed. */
#include "app/app.h"

static volatile uint16_t stuck;
static volatile uint32_t turns;

void app_init(void)
{
    stuck = 0;
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    asks->run = 1;
    asks->target_erpm = APP_RPM(1500);
    for (turns = (told->inputs & APP_S2) ? 200000ul : 0ul; turns != 0ul; turns--) {
    }
    stuck = (uint16_t)(told->inputs & APP_S3);
    while (stuck) {
    }
}
