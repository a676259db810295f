/* What a person does at the board: buttons S2 and S3, the potentiometer, and what the LEDs say. */
#ifndef DRIVE_PANEL_H
#define DRIVE_PANEL_H

#include "drive/remote_state.h"
#include "drive/state.h"

#define PANEL_DEBOUNCE_MS 30

/** One debounced button: acts once when it has been down for PANEL_DEBOUNCE_MS. */
typedef struct {
    uint16_t down_ms; /**< how long it has been down, saturated */
} button_t;

/** Inputs of one background pass. */
typedef struct {
    uint16_t s2_down, s3_down; /**< not 0: pressed */
    uint16_t elapsed_ms;       /**< time since the last pass, 1 or more */
    REMOTE_INPUT
} panel_inputs_t;

/** What the LEDs show. */
typedef struct {
    uint16_t led_alive; /**< blinks once a second; in a fault blinks the code: code times, then a pause */
    uint16_t led_run;   /**< on while the bridge is switching */
} panel_lights_t;

/** State of the panel. */
typedef struct {
    button_t s2, s3;
    int16_t wish_run;         /**< the user wants the motor to run */
    int16_t interrupted;      /**< a fault has ended a run that the user still wished; S2 forgets it. For the retry: 0 without */
    int16_t fast_range;       /**< S3: NOMINAL..MAXIMUM instead of MINIMUM..NOMINAL */
    volatile int16_t pot_q15; /**< last sample of the potentiometer, signed fractional; the control interrupt writes it */
    int32_t pot_q31;          /**< filtered potentiometer */
    int16_t pot_used_q15;     /**< the value in use: follows the filtered one with half a converter step of hysteresis */
    uint16_t pot_broken_ms;   /**< how long its signal has been where no position is */
    uint16_t blink_ms;
    uint16_t kept; /**< complement of wish_run and fast_range, see panel_keep() */
} panel_t;

/** Complement of the user's wishes, in which no bit of either goes unseen. */
QM_INLINE uint16_t panel_complement(const panel_t *panel)
{
    return (uint16_t) ~((uint16_t)panel->wish_run + (uint16_t)panel->fast_range);
}

/** 1 if the wishes are as they were written: a flipped bit could start the motor, or change its speed. The self-test of VARIABLES asks. */
QM_INLINE uint16_t panel_holds(const panel_t *panel)
{
    return (uint16_t)(panel->kept == panel_complement(panel));
}

/** After a write of wishes. @param held panel_holds() before it: what has not held must be found */
QM_INLINE void panel_keep(panel_t *panel, uint16_t held)
{
    if (held) {
        panel->kept = panel_complement(panel);
    }
}

#endif
