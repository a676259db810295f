/* What a person does at the board: buttons S2 and S3, the potentiometer, and what the LEDs say; the retry does it in their place. */
#ifndef DRIVE_PANEL_H
#define DRIVE_PANEL_H

#include "drive/remote.h"

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
struct panel {
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
};

/** 1 if the wishes are as they were written: a flipped bit could start the motor, or change its speed. The self-test of VARIABLES asks. */
uint16_t panel_holds(const panel_t *panel);

/** After a write of wishes. @param held panel_holds() before it: what has not held must be found */
void panel_keep(panel_t *panel, uint16_t held);

/** Nothing pressed, nothing wished, potentiometer at its lower end. */
void panel_init(panel_t *panel);

/** 1 once per press. */
uint16_t button_pressed(button_t *b, uint16_t down, uint16_t elapsed_ms);

/** Speed target for a potentiometer position; TORQUE_MODE: q current in Q13. @param pot_q15 signed fractional sample, -32768 = lower end
 *  @param direction of the running motor: in BIDIRECTIONAL_SPEED the middle keeps it */
int16_t panel_target(const drive_params_t *p, int16_t pot_q15, int16_t fast_range, int16_t direction);

/** One pass: buttons to requests, potentiometer to target, state to lights. S2 in a fault only clears the fault. */
panel_lights_t panel_tick(panel_t *panel, drive_t *d, const drive_params_t *p, const panel_inputs_t *in);

/* ---- the retry: a run that a passing fault has ended starts again by itself, after a pause and a stated number of times ---- */

/** State of the retry. */
typedef struct {
    uint16_t left;      /**< retries left before a fault stays */
    uint16_t first;     /**< drive_fault_t that began it; FAULT_NONE: nothing to tell */
    uint16_t fault;     /**< the one that the pause is for */
    uint16_t asked;     /**< 1: the fault has been asked to go */
    uint32_t waited_ms; /**< in the pause, or in closed loop since the last fault */
} retry_t;

/** All retries left. */
void retry_init(retry_t *r);

/** A pass of the background, after panel_tick(): it clears a fault and wishes a run as S2 would. RETRY_COUNT 0: never. */
void retry_tick(retry_t *r, panel_t *panel, drive_t *d, uint16_t elapsed_ms);

#endif
