/* Pulses at the command input, as of an RC receiver or a controller's PWM output. An application that includes this file is told how long they are
 * (told->pulse_200ns, told->period_200ns): 90 Hz to 10 kHz; pulses themselves up to 11 ms also where they come less often. Timer 3 is used then. */
#ifndef APP_PULSE_H
#define APP_PULSE_H

#include "app/app.h"

/** Counts of a length in us that is a constant, 0..13107. */
#define APP_PULSE_US(us) ((uint16_t)((us)*5u))

#endif
