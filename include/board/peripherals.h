/* The peripherals of the board room: clock, pins, PWM1, ADC1, timer 1, the slow work's interrupt, UART1. */
#ifndef BOARD_PERIPHERALS_H
#define BOARD_PERIPHERALS_H

#include "control/qmath.h"

/** Starts the PLL and switches to it. @return 0, or 1 when it did not lock in a bounded time */
uint16_t clock_init(void);

/** Opens the selection of remappable pins for changes. */
void pins_unlock(void);

/** Closes the selection of remappable pins. */
void pins_lock(void);

/** Pin directions, analogue pins, remappable inputs and outputs. */
void pins_init(void);

/** PWM1 running with all six outputs off, fault input armed. */
void pwm_init(void);

/** ADC1 triggered by PWM1; its interrupt is the control interrupt. */
void adc_init(void);

/** Timer 1: a 1 ms flag that is independent of the control interrupt. */
void timer_init(void);

/** 1 once for each millisecond of timer 1. */
uint16_t timer_ms_passed(void);

/** UART1 at 115200 8N1. */
void uart_init(void);

/** 1 if the transmitter has room. */
uint16_t uart_has_room(void);

/** Sends one character if the transmitter has room. @return 1 when it was taken */
uint16_t uart_send(char c);

/** A character that has come in. @return 0 to 255, or -1: none; when some were lost for want of room, what waited is lost, too */
int16_t uart_receive(void);

/** All six outputs inactive, whatever else happens. */
void pwm_outputs_off(void);

#endif
