/* What a person does at the board: buttons, potentiometer, contacts; and what the LEDs show. */
#ifndef DRIVE_INPUTS_H
#define DRIVE_INPUTS_H

#include "control/qmath.h"
#include "drive/forward.h"

#define BUTTON_DEBOUNCE_MS 30

/** One debounced button: acts once when it has been down for BUTTON_DEBOUNCE_MS. */
typedef struct {
    uint16_t down_ms; /**< how long it has been down, saturated */
} button_t;

/** 1 once per press. The application calls it, too. */
uint16_t button_pressed(button_t *b, uint16_t down, uint16_t elapsed_ms) APP_CALLS;

/** A contact: its level counts when it has stood for BUTTON_DEBOUNCE_MS, the first one at once. */
typedef struct {
    uint16_t is_on;    /**< the level that counts */
    uint16_t other_ms; /**< how long the other one has stood */
} contact_t;

/** Off until the first contact_settled(). */
void contact_init(contact_t *c);

/** A pass of the background. @param on not 0: the contact is on @return 1 where it counts as on */
uint16_t contact_settled(contact_t *c, uint16_t on, uint16_t elapsed_ms);

/** Buttons of one background pass. */
typedef struct {
    uint16_t s2_down, s3_down; /**< not 0: pressed */
    uint16_t elapsed_ms;       /**< time since the last pass, 1 or more */
} buttons_t;

/** What the LEDs show. */
typedef struct {
    uint16_t led_alive, led_run;
} lights_t;

/** The potentiometer. */
typedef struct {
    volatile int16_t now_q15; /**< last sample, signed fractional; the slow work writes it */
    int32_t smooth_q31;       /**< filtered */
    int16_t used_q15;         /**< the value in use: follows the filtered one with half a converter step of hysteresis */
    uint16_t broken_ms;       /**< how long its signal has been where no position is */
} pot_t;

/** What the ends of its travel mean: speeds, electrical rpm, or q currents, Q13, as its user says. */
typedef struct {
    int16_t low, high;
} pot_range_t;

/** At its lower end. */
void pot_init(pot_t *pot);

/** Share of the travel between its dead ends, Q16, of a sample. */
uint16_t pot_travel(const drive_params_t *p, int16_t pot_q15);

/** Filters the sample (10 ms) and holds it within a converter step, so that noise does not move the reference. Every millisecond. @return Q15 */
int16_t pot_smooth(pot_t *pot);

/** 1 after a tenth of a second in the outer half of a dead end: a wire is broken. Never without dead ends (POT_LIVE_ZERO 0). */
uint16_t pot_is_broken(pot_t *pot, const drive_params_t *p, uint16_t elapsed_ms);

#endif
