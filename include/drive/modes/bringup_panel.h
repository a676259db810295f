/* BRINGUP, the first steps: serial line, buttons, LEDs, potentiometer. */
#ifndef DRIVE_MODES_BRINGUP_PANEL_H
#define DRIVE_MODES_BRINGUP_PANEL_H

#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP

/** Says by which pin of the serial line it speaks, by one and the other in turn, until a button comes. */
void bringup_step_begin(bringup_guide_t *g, const panel_inputs_t *in);

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

#endif

#endif
