/* The application of the MCLV board: buttons S2 and S3, the potentiometer, and what the LEDs say. */
#ifndef APP_PANEL_H
#define APP_PANEL_H

#include "app/app.h"

/** State of the panel. */
typedef struct {
    button_t s2, s3;
    int16_t fast_range; /**< S3: NOMINAL..MAXIMUM instead of MINIMUM..NOMINAL */
    int16_t kept;       /**< its complement: a flipped bit would change the speed */
    uint16_t blink_ms;
} panel_t;

/** Nothing pressed, low range. */
void panel_init(panel_t *panel);

/** A pass. S2 in a fault only clears the fault; else it starts and stops. S3 changes the range of a running motor. */
void panel_tick(panel_t *panel, const app_told_t *told, app_asks_t *asks);

#endif
