/* BRINGUP: the first day with a board. Step by step, with little current, the drive checks what no source confirms.
 *
 * The control interrupt is the instrument: it drives a voltage vector until a current flows, turns it, and adds up what it sees. The background
 * leads through the steps (bringup_steps.c), judges the instrument's numbers, and says what follows; board/modes/mode_board.c writes the lines.
 * `ready` names the owner of the instrument: 1 the background, 0 the interrupt. */
#ifndef DRIVE_MODES_BRINGUP_H
#define DRIVE_MODES_BRINGUP_H

#include "control/svm.h"
#include "drive/faults.h"
#include "drive/inputs.h"
#include "drive/modes/mode_table.h"

/** The most current that any step asks for, as a share of MAXIMUM_CURRENT_A. Over-current, bus and fault input protect as ever. */
#define BRINGUP_CURRENT_SHARE 0.3

/* Rows on lines of their own: clang-format would stagger them. */
/* clang-format off */

/** X(name, text): what the user is asked. # stands for a number, ~ for a pin or a phase. S2 and S3 answer. */
#define BRINGUP_QUESTION_TABLE(X) \
    X(BEGIN, "foc33 BRINGUP, sent by ~. Press S2") \
    X(UART, "did that line name ~? S2 = yes, S3 = no") \
    X(S3, "press S3") \
    X(LED_ALIVE, "the ALIVE LED alone is lit? S2 = yes, S3 = no") \
    X(LED_RUN, "the RUN LED alone is lit? S2 = yes, S3 = no") \
    X(LED_OTHER, "the other LED is lit instead? S2 = yes, S3 = no") \
    X(POT_LEFT, "turn the potentiometer fully left, then press S2") \
    X(POT_RIGHT, "turn it fully right, then press S2") \
    X(FAULT_INPUT, "pull the fault input (RB8) to ground by 1 kohm. S2 = it is, S3 = skip") \
    X(FAULT_OPEN, "take that away, then press S2") \
    X(CURRENT, "the shaft is free? The motor gets current now: S2 = yes, S3 = end") \
    X(AMMETER, "an ammeter in wire A shows # A within 10 %? S2 = yes or no ammeter, S3 = no") \
    X(DIRECTION, "the field turns forward. The shaft follows in the direction that you want? S2 = yes, S3 = no") \
    X(MARK, "mark where the shaft stands, then press S2") \
    X(TURNS, "it turns. Press S2 when the mark is back after one turn. S3 = it stands")

/** X(name, unit, decimals, text): what is measured. ~ stands for a phase. */
#define BRINGUP_VALUE_TABLE(X) \
    X(POT_LEFT, " %", 0, "potentiometer left") \
    X(POT_RIGHT, " %", 0, "potentiometer right") \
    X(BUS, " V", 2, "bus") \
    X(OFFSET, " A", 3, "offset of current ~") \
    X(NOISE, " A", 3, "noise of current ~") \
    X(RATIO, " %", 0, "current B against current A where both are alike") \
    X(RESISTANCE, " ohm", 3, "phase resistance with bridge") \
    X(DEAD_TIME, " us", 3, "dead time of the bridge") \
    X(POLE_PAIRS, "", 0, "electrical turns of one turn of the shaft")

/** X(name, remedy): what can be wrong. ~ stands for a phase. A remedy names what to look at first, then the line to change. */
#define BRINGUP_FINDING_TABLE(X) \
    X(UART_PIN, "swap BOARD_PIN_UART_TX and BOARD_OTHER_TX in include/board/mclv.h") \
    X(BUTTON_DOWN, "a button is down at rest: BOARD_PIN_S2, BOARD_PIN_S3 in include/board/mclv.h") \
    X(BUTTONS_SWAPPED, "swap BOARD_PIN_S2 and BOARD_PIN_S3 in include/board/mclv.h") \
    X(BUTTON_DEAD, "no other button came: BOARD_PIN_S2, BOARD_PIN_S3 in include/board/mclv.h") \
    X(LEDS_SWAPPED, "swap BOARD_PIN_LED_ALIVE and BOARD_PIN_LED_RUN in include/board/mclv.h") \
    X(LED_DARK, "its pin: BOARD_PIN_LED_ALIVE or _RUN in include/board/mclv.h") \
    X(POT_DEAD, "its wires; BOARD_PIN_POT in include/board/mclv.h") \
    X(POT_REVERSED, "swap the potentiometer's outer wires") \
    X(POT_RANGE, "its supply; POT_LIVE_ZERO in userparams.h") \
    X(BUS_DIVIDER, "the supply; BUS_FULL_SCALE_V in userparams.h, bus_divider in tuning/boards/*.toml") \
    X(OFFSET, "reference of amplifier ~; [shunt] reference in tuning/boards/*.toml, BOARD_PIN_CURRENT_~ in include/board/mclv.h") \
    X(NOISE, "filter, ground and shield of current ~; BOARD_PIN_CURRENT_~ in include/board/mclv.h") \
    X(FAULT_LOW, "the fault input is low at rest: polarity of the comparator, its pull-up; BOARD_PIN_FAULT in include/board/mclv.h") \
    X(FAULT_DEAD, "the fault input stays high: its wire; BOARD_PIN_FAULT in include/board/mclv.h. No motor before it works") \
    X(NO_CURRENT, "no current in any direction: motor wires, supply of the bridge, both current signals") \
    X(PHASE_OPEN, "the wire of phase ~, or its driver") \
    X(HIGH_SIDE, "the high side of phase ~ never turns on: driver, bootstrap, transistor; BOARD_PIN_PWM_~ in include/board/mclv.h") \
    X(LOW_SIDE, "the low side of phase ~ never turns on: driver, transistor; the pin below BOARD_PIN_PWM_~ in include/board/mclv.h") \
    X(CURRENT_DEAD, "current signal ~ does not follow: amplifier, wire; BOARD_PIN_CURRENT_~ in include/board/mclv.h") \
    X(CURRENTS_SWAPPED, "swap the current signals (BOARD_PIN_CURRENT_A and _B in include/board/mclv.h), or the drivers of A and B if the direction is wrong, too") \
    X(DRIVER_SWAPPED, "current ~ follows driver C: swap the drivers of ~ and C (BOARD_PIN_PWM_~ and _C in include/board/mclv.h)") \
    X(CURRENTS_MIXED, "the currents do not belong to two legs: check all three drivers and both current signals") \
    X(SHUNT_INVERTED, "change the sign of KCURR~ in userparams.h, or inverted in tuning/boards/*.toml") \
    X(SHUNT_GAIN, "KCURR~ in userparams.h: divide it by the share that the ammeter shows; shunt and amplifier of phase ~") \
    X(SHUNT_GAINS, "NORM_CURRENT_CONST in userparams.h; [shunt] resistance, amplifier_gain in tuning/boards/*.toml") \
    X(RESISTANCE, "another motor than MOTOR_RS_OHM in userparams.h says; with the ammeter in doubt NORM_CURRENT_CONST") \
    X(DEAD_TIME, "the driver adds or takes off: DEADTIME_SEC in userparams.h, dead_time in tuning/boards/*.toml") \
    X(SHORT_CIRCUIT, "the fault input tripped: dead time too short, a transistor that never turns off, a short in the motor") \
    X(OVERCURRENT, "more current than OVER_CURRENT_THRESHOLD_A: a short in the motor, offsets, or the current signals") \
    X(FAULT, "the drive stopped with the fault $ of docs/faults.md") \
    X(DIRECTION, "swap any two motor wires") \
    X(POLE_PAIRS, "NOPOLESPAIRS in userparams.h, pole_pairs in tuning/motors/*.toml") \
    X(STANDS, "the shaft does not turn: free it, take the load off")

/* clang-format on */

#ifdef BRINGUP
#define BRINGUP_QUESTION_ENUM(name, text) BRINGUP_ASK_##name,

typedef enum { BRINGUP_QUESTION_TABLE(BRINGUP_QUESTION_ENUM) BRINGUP_QUESTIONS } bringup_question_t;

#define BRINGUP_VALUE_ENUM(name, unit, decimals, text) BRINGUP_VALUE_##name,

typedef enum { BRINGUP_VALUE_TABLE(BRINGUP_VALUE_ENUM) BRINGUP_VALUES } bringup_value_t;

#define BRINGUP_FINDING_ENUM(name, remedy) BRINGUP_##name,

typedef enum { BRINGUP_FINDING_TABLE(BRINGUP_FINDING_ENUM) BRINGUP_FINDINGS } bringup_finding_t;

/** The instrument: part of a run, so a start clears it. */
typedef struct {
    volatile uint16_t ready;         /**< 1: the sums are complete and belong to the background; 0: the interrupt works */
    volatile uint16_t wait;          /**< periods before the sums begin, counted once the amplitude stands */
    volatile uint16_t left;          /**< periods to sum */
    volatile int16_t most;           /**< amplitude to go to, duty counts */
    volatile int16_t stop_q13;       /**< it stays where |A| + |B| reaches this */
    volatile uint16_t keeps_current; /**< 1: the amplitude, up to `most`, follows stop_q13 */
    volatile uint16_t turning;       /**< 1: the vector turns by whole electrical turns, with a pause after each */
    volatile angle_t angle;          /**< of the vector; the background writes it at amplitude 0 */
    volatile uint16_t turns;         /**< electrical turns done */
    volatile int32_t sum_a, sum_b;   /**< of the currents */
    volatile int32_t off_a, off_b;   /**< of what they are off mean_a_q13 and mean_b_q13 */
    volatile current_q13_t mean_a_q13, mean_b_q13;
    /* The interrupt's own. */
    volatile int16_t amplitude; /**< duty counts along the vector; the background reads it */
    volatile int16_t part[3];   /**< of it in each phase, as rounded; the background reads them */
    int32_t carried_q21;        /**< |A| + |B|, filtered */
    uint32_t turn_q32;          /**< of the turn that goes on */
    uint16_t pause;             /**< periods of the pause after a turn */
} bringup_run_t;

#define BRINGUP_FULL_Q13 CURRENT_Q13(PARAM_F(BRINGUP_CURRENT_SHARE) * PARAM_F(MAXIMUM_CURRENT_A)) /* |A| + |B| of a step */
#define BRINGUP_STATE bringup_run_t bringup;
#else
#define BRINGUP_STATE
#endif

#ifdef BRINGUP
#define BRINGUP_HALF_DUTY (PWM_FULL_DUTY / 2)

/** Adds up, in every state. @param settled the amplitude stands */
void bringup_add(drive_t *d, uint16_t settled);

/** 1, 0 or -1: where the amplitude goes. A measurement stays at the amplitude where the current is reached; a vector that turns keeps the
 *  current, for dead time takes more or less of it at each angle. */
int16_t bringup_direction(bringup_run_t *t, int16_t carried_q13);

/** A period of an electrical turn, or of the pause after it. */
void bringup_turn(bringup_run_t *t);

/** A period with the bridge switching: no law, no compensation, just a vector. */
void bringup_run(drive_t *d, const drive_params_t *p, duties_t *duty);

/** The background's first word of a start: the instrument is its own. */
void bringup_start(drive_t *d, const drive_params_t *p);
#endif

/** A period with the bridge off: the mode may add up the samples. */
void mode_idle(drive_t *d);

/* ---- The judge: what currents in six directions say: which signal follows which leg, what is open or dead, resistance and dead time ---- */

#ifdef BRINGUP
#define BRINGUP_DIRECTIONS 6u

/** Currents and amplitudes of the six directions +A, -C, +B, -A, +C, -B at one level. */
typedef struct {
    current_q13_t a[BRINGUP_DIRECTIONS], b[BRINGUP_DIRECTIONS];
    int16_t amplitude[BRINGUP_DIRECTIONS]; /**< duty counts of the direction's phase */
} bringup_level_t;

/** What the currents say of the wires. Masks: bit 0 phase or signal A, 1 B, 2 C. */
typedef struct {
    uint16_t dead;            /**< current signals that do not follow */
    uint16_t leg[2];          /**< the leg that each signal follows, 0..2 */
    uint16_t inverted;        /**< signals with the wrong sign */
    uint16_t open, high, low; /**< phases that carry nothing; whose high, whose low side never turns on */
} bringup_wiring_t;

/** What the bridge says to two levels of current. */
typedef struct {
    uint16_t resistance_mohm; /**< by signal A */
    uint16_t b_percent_of_a;  /**< both signals where their legs carry the same: along the third phase */
    uint16_t dead_time_ns;
} bringup_bridge_t;

/** @param full all of the current @return what is connected to what */
bringup_wiring_t bringup_wiring(const bringup_level_t *full);

/** @param half less current than full @param w whose signals follow two legs @param bus_10mv of the bridge */
bringup_bridge_t bringup_bridge(const bringup_level_t *half, const bringup_level_t *full, const bringup_wiring_t *w, uint16_t bus_10mv);

/** A current in mA. */
int16_t bringup_ma(current_q13_t i_q13);

/* ---- The guide, in the background: what it knows of the board so far, and what it says next ---- */

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

/** X(name, call): steps in their order, and what each does in a pass: panel, rest, currents in six directions, gains, turns of the shaft. */
#define BRINGUP_STEP_TABLE(X) \
    X(BEGIN, bringup_step_begin(g, in)) \
    X(S3, bringup_step_s3(g)) \
    X(UART, bringup_step_uart(g)) \
    X(LED_ALIVE, bringup_step_led(g, 0)) \
    X(LED_ALIVE_OTHER, bringup_step_led_other(g, 0)) \
    X(LED_RUN, bringup_step_led(g, 1)) \
    X(LED_RUN_OTHER, bringup_step_led_other(g, 1)) \
    X(POT_LEFT, bringup_step_pot_end(g, pot_q15, 0)) \
    X(POT_RIGHT, bringup_step_pot_end(g, pot_q15, 1)) \
    X(POT, bringup_step_pot(g)) \
    X(BUS, bringup_step_bus(g, d)) \
    X(OFFSETS, bringup_step_rest(g, d, 0)) \
    X(NOISES, bringup_step_rest(g, d, 1)) \
    X(SIGNALS, bringup_step_signals(g, d, p)) \
    X(FAULT_REST, bringup_step_fault_rest(g, d)) \
    X(FAULT_INPUT, bringup_step_fault_input(g, d)) \
    X(FAULT_OPEN, bringup_step_fault_open(g, d)) \
    X(CURRENT, bringup_step_current(g, d)) \
    X(DRIVE, bringup_step_drive(g, d, p)) \
    X(SHOW, bringup_step_show(g, d)) \
    X(WIRING, bringup_step_wiring(g)) \
    X(BRIDGE, bringup_step_bridge(g, d)) \
    X(AMMETER, bringup_step_ammeter(g, d, p)) \
    X(GAINS, bringup_step_gains(g)) \
    X(DIRECTION, bringup_step_direction(g, d)) \
    X(MARK, bringup_step_mark(g, d)) \
    X(TURNS, bringup_step_turns(g, d)) \
    X(LAST, bringup_step_last(g, d)) \
    X(END, bringup_step_end(g))

#define BRINGUP_STEP_ENUM(name, call) BRINGUP_STEP_##name,

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

/** A pass of the background, in place of application_tick(). @param pot_q15 signed fractional */
lights_t bringup_pass(bringup_guide_t *g, drive_t *d, const drive_params_t *p, const buttons_t *in, int16_t pot_q15);

/** A line without a value. */
void bringup_say(bringup_guide_t *g, bringup_kind_t kind, uint16_t code, uint16_t part);

/** On to a step, from its beginning. */
void bringup_go(bringup_guide_t *g, bringup_step_t step);

/** Something is wrong; the rest can be checked nevertheless. */
void bringup_find(bringup_guide_t *g, bringup_finding_t finding, uint16_t part);

/** Something is wrong, and the rest has no meaning or is dangerous: to the end. */
void bringup_give_up(bringup_guide_t *g, bringup_finding_t finding, uint16_t part);

/** A value with its range. @return 1 if it is inside */
uint16_t bringup_tell(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high);

/** A value with its range; outside of it the finding follows. */
void bringup_tell_or_find(bringup_guide_t *g, bringup_value_t what, uint16_t part, int32_t value, int32_t low, int32_t high, bringup_finding_t finding);

/** Asks once and waits. @return the button that answers, 2 or 3; 0: none yet */
uint16_t bringup_answered(bringup_guide_t *g, bringup_question_t question, uint16_t part, int32_t value);

#define BRINGUP_10MV(volts) ((int32_t)(PARAM_F(volts) * 100.0F + 0.5F))
#define BRINGUP_SWING_PERIODS PARAM_PERIODS(0.3F) /* the rotor swings into the field */

/* Most amplitude: 1.6 times what R and half as much again as what dead time take. Whatever the signals say, it bounds the current. */
#define BRINGUP_MOST_A (1.6F * PARAM_F(BRINGUP_CURRENT_SHARE) * PARAM_F(MAXIMUM_CURRENT_A))
#define BRINGUP_MOST_V (BRINGUP_MOST_A * (PARAM_F(MOTOR_RS_OHM) + 0.05F) + 1.5F * 4.0F / 3.0F * PARAM_DEAD_TIME_V)
#define BRINGUP_MOST_ROOM (PARAM_F(PWM_TOP_DUTY) - PARAM_F(PWM_FULL_DUTY) / 2.0F)
#define BRINGUP_MOST_AMPLITUDE ((int16_t)PARAM_MIN(BRINGUP_MOST_V / PARAM_F(NOMINAL_BUS_V) * PARAM_F(PWM_FULL_DUTY), BRINGUP_MOST_ROOM))

/** Sums anew, after so many periods at the amplitude. Write all else before: from here on the interrupt owns the instrument. */
void bringup_measure(drive_t *d, uint16_t wait);

/** The mean of a complete sum. */
int16_t bringup_mean_of(int32_t sum);

/** The bridge begins to switch, without a vector. Phase 0 of the step becomes 1. @return 1 when it does, or when it will not */
uint16_t bringup_started(bringup_guide_t *g, drive_t *d, const drive_params_t *p);

/** What has switched the bridge off is a finding, and ends it. @return 1 if something has */
uint16_t bringup_has_tripped(bringup_guide_t *g, const drive_t *d);

/** The bus voltage. */
uint16_t bringup_bus_10mv(const drive_t *d);

/* ---- The steps (bringup_steps.c): what each does in a pass ---- */

/** Says by which pin of the serial line it speaks, by one and the other in turn, until a button comes. */
void bringup_step_begin(bringup_guide_t *g, const buttons_t *in);

/** The other button: S3, unless both have changed places. */
void bringup_step_s3(bringup_guide_t *g);

/** Which of the two pins the user's line came by. */
void bringup_step_uart(bringup_guide_t *g);

/** One LED is lit: is it the right one? @param led 0: ALIVE, 1: RUN */
void bringup_step_led(bringup_guide_t *g, uint16_t led);

/** It is not: is the other one lit, or none? @param led 0: ALIVE, 1: RUN */
void bringup_step_led_other(bringup_guide_t *g, uint16_t led);

/** The user turns the potentiometer to an end. @param pot_q15 signed fractional @param right 0: left */
void bringup_step_pot_end(bringup_guide_t *g, int16_t pot_q15, uint16_t right);

/** Judges both ends. */
void bringup_step_pot(bringup_guide_t *g);

/** The supply as it is measured, against NOMINAL_BUS_V. */
void bringup_step_bus(bringup_guide_t *g, const drive_t *d);

/** Means of both current signals first, then how far their samples are off them. @param noises 1: the second time */
void bringup_step_rest(bringup_guide_t *g, drive_t *d, uint16_t noises);

/** Judges offset and noise of both signals. */
void bringup_step_signals(bringup_guide_t *g, const drive_t *d, const drive_params_t *p);

/** The fault input is high at rest. */
void bringup_step_fault_rest(bringup_guide_t *g, drive_t *d);

/** It trips when the user pulls it low ... */
void bringup_step_fault_input(bringup_guide_t *g, const drive_t *d);

/** ... and is high again afterwards. */
void bringup_step_fault_open(bringup_guide_t *g, drive_t *d);

/** The user lets current flow, or ends it. */
void bringup_step_current(bringup_guide_t *g, const drive_t *d);

/** Half the current, all of it, none, in one direction after the other. A press ends it. */
void bringup_step_drive(bringup_guide_t *g, drive_t *d, const drive_params_t *p);

/** Shows what was measured, a line for each direction. */
void bringup_step_show(bringup_guide_t *g, const drive_t *d);

/** What is wrong with wires, transistors, signals. */
void bringup_step_wiring(bringup_guide_t *g);

/** Gain of B against A, resistance, dead time. */
void bringup_step_bridge(bringup_guide_t *g, const drive_t *d);

/** Current along phase A, which the user compares with an ammeter. A press before the question ends it. */
void bringup_step_ammeter(bringup_guide_t *g, drive_t *d, const drive_params_t *p);

/** What the ammeter and the resistance say of the gains. */
void bringup_step_gains(bringup_guide_t *g);

/** Turns forward by electrical turns. */
void bringup_step_direction(bringup_guide_t *g, drive_t *d);

/** Stands, so that the user can mark the shaft. */
void bringup_step_mark(bringup_guide_t *g, drive_t *d);

/** Turns until the mark is back, and counts. */
void bringup_step_turns(bringup_guide_t *g, drive_t *d);

/** Says how many findings there are; the motor is off. */
void bringup_step_last(bringup_guide_t *g, drive_t *d);

/** S2 begins anew. */
void bringup_step_end(bringup_guide_t *g);
#endif

#endif
