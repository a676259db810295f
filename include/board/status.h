/* The status line on UART1: state, fault and speed, or what IDENTIFY has measured, twice a second. */
#ifndef BOARD_STATUS_H
#define BOARD_STATUS_H

#include <stdint.h>

/** The first line, version and cause of the last reset: "foc33 0.10.0 reset BOR POR". */
void status_init(void);

/** Composes the next line when it is due: "state 5 fault 0 speed 1000 rpm limit CURRENT RAMP"; in IDENTIFY "step 11 BUSY fault 0 R 2692 mohm
 *  Ld 1919 uH Lq 1920 uH Kphi 0 mV/krpm" in one line. */
void status_tick(uint16_t elapsed_ms);

/** Hands one character to the UART if it has room. */
void status_send(void);

#endif
