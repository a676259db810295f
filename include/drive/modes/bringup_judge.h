/* BRINGUP: what currents in six directions say: which signal follows which leg, what is open or dead, resistance and dead time. */
#ifndef DRIVE_MODES_BRINGUP_JUDGE_H
#define DRIVE_MODES_BRINGUP_JUDGE_H

#include "drive/modes/bringup.h"

#ifdef BRINGUP

#define BRINGUP_DIRECTIONS 6u
#define BRINGUP_LEAST_Q13 (BRINGUP_FULL_Q13 / 8) /* less is no current */

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

#endif

#endif
