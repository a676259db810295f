/* BRINGUP, the background's part: what it knows of the board so far, and what it says next. */
#ifndef DRIVE_MODES_BRINGUP_GUIDE_H
#define DRIVE_MODES_BRINGUP_GUIDE_H

#include "drive/modes/bringup_judge.h"
#include "drive/panel.h"

#ifdef BRINGUP

/** What kind of line is said next. */
typedef enum {
    BRINGUP_SILENT,
    BRINGUP_ASKS,  /**< code: bringup_question_t, value */
    BRINGUP_TELLS, /**< code: bringup_value_t; value, and low to high, within which it is right */
    BRINGUP_SHOWS, /**< code: the direction; value: its voltage in 10 mV, low and high: both currents in mA */
    BRINGUP_FINDS, /**< code: bringup_finding_t, value */
    BRINGUP_ENDS   /**< value: how many findings */
} bringup_kind_t;

/** A line to be said. Whoever has said it makes it BRINGUP_SILENT. */
typedef struct {
    uint16_t kind; /**< bringup_kind_t */
    uint16_t code;
    uint16_t part; /**< phase or signal, 0: A; for questions of the serial line, its pin */
    int32_t value, low, high;
} bringup_message_t;

#define BRINGUP_LINES_BOTH 2u /* not one of the two pins, but both */

/** X(name): steps in their order. */
#define BRINGUP_STEP_TABLE(X) \
    X(BEGIN) \
    X(S3) \
    X(UART) \
    X(LED_ALIVE) \
    X(LED_ALIVE_OTHER) \
    X(LED_RUN) \
    X(LED_RUN_OTHER) \
    X(POT_LEFT) \
    X(POT_RIGHT) \
    X(POT) \
    X(BUS) \
    X(OFFSETS) \
    X(NOISES) \
    X(SIGNALS) \
    X(FAULT_REST) \
    X(FAULT_INPUT) \
    X(FAULT_OPEN) \
    X(CURRENT) \
    X(DRIVE) \
    X(SHOW) \
    X(WIRING) \
    X(BRIDGE) \
    X(AMMETER) \
    X(GAINS) \
    X(DIRECTION) \
    X(MARK) \
    X(TURNS) \
    X(LAST) \
    X(END)

#define BRINGUP_STEP_ENUM(name) BRINGUP_STEP_##name,
typedef enum { BRINGUP_STEP_TABLE(BRINGUP_STEP_ENUM) BRINGUP_STEPS } bringup_step_t;

/** All of it. */
typedef struct {
    bringup_message_t message;
    uint16_t pending, pending_part; /**< a finding that follows a value: bringup_finding_t; BRINGUP_FINDINGS: none */
    uint16_t step;                  /**< bringup_step_t */
    uint16_t index;                 /**< what a step is at */
    uint16_t phase;                 /**< of a measurement: 0 before it */
    uint16_t waited_ms;
    uint16_t found;   /**< findings so far */
    uint16_t blocked; /**< 1: no current before it is mended */
    uint16_t sender;  /**< pin of the serial line, 0, 1, or BRINGUP_LINES_BOTH */
    button_t s2, s3;
    uint16_t asked, button;      /**< 1 once the question is asked; the button since, 0, 2 or 3 */
    uint16_t first;              /**< the button that came first */
    uint16_t swapped;            /**< 1: S2 and S3 have changed places */
    uint16_t leds;               /**< bit 0 ALIVE, bit 1 RUN */
    uint16_t leds_judged;        /**< 1: no further question about them */
    int16_t pot_left, pot_right; /**< % */
    uint16_t yes;                /**< the ammeter shows what it should */
    current_q13_t mean[2], off[2];
    bringup_level_t half, full;
    bringup_wiring_t wiring;
    bringup_bridge_t bridge;
} bringup_guide_t;

/** Begins anew. */
void bringup_init(bringup_guide_t *g);

/** A pass of the background, in place of panel_tick(). @param pot_q15 signed fractional */
panel_lights_t bringup_pass(bringup_guide_t *g, drive_t *d, const drive_params_t *p, const panel_inputs_t *in, int16_t pot_q15);

#endif

#endif
