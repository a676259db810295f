/* BRINGUP: the first day with a board. Step by step, with little current, the drive checks what no source confirms.
 *
 * The control interrupt is the instrument (bringup_tick.h): it drives a voltage vector until a current flows, turns it, and adds up what it
 * sees.
 * The background leads through the steps: bringup_guide.c takes the one that is due. The steps, in their order, are in bringup_panel.c,
 * bringup_rest.c, bringup_directions.c, bringup_gains.c and bringup_turn.c; they use the instrument by bringup_measure.c, judge by
 * bringup_judge.c and speak by bringup_say.c, whose lines board/modes/bringup_report.c writes.
 * `ready` names the owner of the instrument: 1 the background, 0 the interrupt. */
#ifndef DRIVE_MODES_BRINGUP_H
#define DRIVE_MODES_BRINGUP_H

#include "control/qmath.h"
#include "drive/param_scaling.h" /* userparams.h may define BRINGUP */

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
    X(UART_PIN, "BOARD_PIN_UART_TX and BOARD_UART_TX_PIN in include/board/mclv.h: take the other pin") \
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
    X(FAULT, "the drive stopped with the fault # of docs/faults.md") \
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

#endif
