/* The chip around the core: oscillator, watchdog, resets, ports, pin selection, timers and UART1 of the 33FJ32MC204.
 *
 * PWM1 and ADC1 belong to the board that the chip is on (soc_board_t): it reads and writes their registers in the core's data memory and
 * is told when the firmware has written one that acts at once. Without a board these two are plain memory.
 */
#ifndef FOC33_ISS33F_SFR_H
#define FOC33_ISS33F_SFR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "image.h"
#include "iss.h"
#include "sfr_table.h"

typedef struct soc soc_t;

/* What is soldered to the chip. Every function may be NULL.
 *   pins      levels that the circuits around give to the pins of port 0..2 (A..C) that are inputs; default all high
 *   counter   P1TMR now
 *   written   the firmware has changed a register of SOC_ACTING_LIST; soc_run() returns at the end of the instruction
 *   send      a character has left UART1
 *   receive   the next character for UART1, or -1; asked when the receiver is idle, and again after soc_uart_wake()
 *   clock     the instruction clock has changed
 *   reset     the device has been reset while it ran; soc_run() returns
 *   note      the firmware uses a peripheral in a way that cannot work; a text that starts with the register's name */
typedef struct {
    void *context;
    uint16_t (*pins)(void *context, unsigned port);
    uint16_t (*counter)(void *context);
    void (*written)(void *context, uint16_t address);
    void (*send)(void *context, uint8_t character);
    int (*receive)(void *context);
    void (*clock)(void *context);
    void (*reset)(void *context);
    void (*note)(void *context, const char *text);
} soc_board_t;

/* Registers whose change a board must see at once. */
#define SOC_ACTING_LIST(X) \
    X(P1TCON) X(PWM1CON1) X(PWM1CON2) X(P1FLTACON) X(P1OVDCON) X(P1DC1) X(P1DC2) X(P1DC3)

/* Clocks and times, settable before a reset. The crystal is the board's; the others the data sheet gives as ranges: assumptions.h. */
typedef struct {
    double crystal_hz;    /* default 8 MHz */
    double frc_hz;
    double lprc_hz;
    double pll_lock_s;
    double crystal_start; /* oscillator periods that the start-up timer counts */
} soc_times_t;

/* A chip with this image in its flash, in power-on reset. NULL if memory ran out. `board` may be NULL; it is copied. */
soc_t *soc_create(const image_t *image, const soc_board_t *board);
void soc_destroy(soc_t *soc);

iss_t *soc_core(soc_t *soc);
soc_times_t *soc_times(soc_t *soc);

/* Reset by `cause`; after ISS_RESET_POR everything has its power-on value. */
void soc_reset(soc_t *soc, iss_reset_cause_t cause);

/* Go on to at least `until_cycle`. ISS_STOP_NONE: reached; ISS_STOP_REQUEST: the board must look at something, or somebody called
 * soc_break(); other stops are the core's. */
iss_stop_t soc_run(soc_t *soc, uint64_t until_cycle);

/* End the present soc_run() after this instruction. */
void soc_break(soc_t *soc);

/* Instruction clock, and the time since power-on. */
double soc_fcy_hz(const soc_t *soc);
double soc_seconds(const soc_t *soc);

/* Set a flag in IFS0..IFS4 (address of the register, bit number). */
void soc_flag(soc_t *soc, uint16_t address, unsigned bit);

/* There may be characters for UART1 again. */
void soc_uart_wake(soc_t *soc);

/* Resets since soc_create() other than the first. */
unsigned soc_resets(const soc_t *soc);

/* Address of a register by its name in Microchip's header, or -1. */
int soc_register(const char *name);

/* Name of the register at an even address, NULL if there is none. */
const char *soc_register_name(uint16_t address);

/* UART1 on a pseudo-terminal: opens one and writes its path to `path`. 0, or -1. soc_pty_step() moves characters both ways. */
typedef struct soc_pty soc_pty_t;
soc_pty_t *soc_pty_open(char *path, size_t size);
void soc_pty_close(soc_pty_t *pty);
void soc_pty_send(void *pty, uint8_t character);
int soc_pty_receive(void *pty);

#endif
