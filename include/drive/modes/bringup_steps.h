/* BRINGUP, the steps in their order: panel, rest, currents in six directions, gains, turns of the shaft. */
#ifndef DRIVE_MODES_BRINGUP_STEPS_H
#define DRIVE_MODES_BRINGUP_STEPS_H

#include "drive/modes/bringup.h"

#ifdef BRINGUP
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
#endif

#endif
