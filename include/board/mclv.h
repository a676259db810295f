/* The dsPICDEM MCLV with a dsPIC33FJ32MC204: its pins, channels and the values of their registers in one place.
 *
 * [?] marks what no published source confirms; check it against your board's schematic before you rely on it. Two such facts are used
 * elsewhere: the bus divider of 16 [?, known for the MCLV-2 only] in userparams.h's BUS_FULL_SCALE_V = 16 * 3.3 V, and the
 * debugger's pins PGC3/PGD3 [?] in config.c. */
#ifndef BOARD_MCLV_H
#define BOARD_MCLV_H

#include <xc.h>

#include "drive/param_scaling.h"

#ifdef __XC16__
#define BOARD_ISR __attribute__((interrupt, no_auto_psv))
#else
#define BOARD_ISR
#endif

/* ---- Clock: 8 MHz crystal * 40 / (2 * 2) = 80 MHz, 40 MIPS ---- */
#define BOARD_FCY_HZ 40000000ul
#define BOARD_PLLFBD 38u     /* M = 40 */
#define BOARD_CLKDIV 0x0000u /* N1 = 2, N2 = 2 */
#define BOARD_NOSC_FRC 0u
#define BOARD_NOSC_PRIPLL 3u
#define BOARD_OSCCON_LOCK 0x0020u
#define BOARD_WAIT_LOOPS 60000u /* bound of every wait on the oscillator, far above its 2 ms */

/* ---- PWM1: centre-aligned, 20 kHz, three complementary pairs; M1 = RB14/15, M2 = RB12/13, M3 = RB10/11 ---- */
#define BOARD_P1TPER ((uint16_t)(PWM_FULL_DUTY / 2 - 1))
#define BOARD_P1TCON 0x8002u                                                  /* on, up/down counting */
#define BOARD_PWM1CON1 0x0077u                                                /* pairs 1-3 enabled, complementary */
#define BOARD_P1DTCON1 ((uint16_t)(0x0040u | (uint16_t)(DEAD_TIME_DUTY / 2))) /* unit A, two clocks a count */
#define BOARD_P1FLTACON 0x0087u                                               /* FLTA: pairs 1-3 inactive, cycle by cycle */
#define BOARD_FLTA_RP 8u                                                      /* FLTA1 on RP8/RB8 */
#define BOARD_FLTA_LOW() ((uint16_t)(PORTBbits.RB8 == 0u))                    /* the comparator holds the outputs off */
#define BOARD_OUTPUTS_OFF 0x0000u
#define BOARD_OUTPUTS_BOOTSTRAP 0x0015u /* all low sides on */
#define BOARD_OUTPUTS_PWM 0x3F00u
/* Special event 1.5 us (SAMPLE_DELAY_CLOCKS) after the counter's peak, counting down: the low sides have then been on for
 * SAMPLE_WINDOW_SEC + 1.5 us - dead time, and stay on for SAMPLE_WINDOW_SEC - 1.5 us, at the highest duty. */
#define BOARD_P1SECMP ((uint16_t)(0x8000u | (BOARD_P1TPER - SAMPLE_DELAY_CLOCKS)))

/* ---- ADC1: four channels at once, 10 bits, signed fractional, started by the PWM; conversion 12 TAD * 4 * 100 ns = 4.8 us ---- */
#define BOARD_AD1CON1 0x036Cu               /* FORM 3, SSRC 3 (PWM), SIMSAM, ASAM; ADON separately */
#define BOARD_AD1CON2 0x0200u               /* CHPS 2: CH0..CH3 */
#define BOARD_AD1CON3 0x0003u               /* TAD = 4 Tcy = 100 ns; the converter needs 76 ns */
#define BOARD_AD1CHS0 0x0008u               /* CH0: AN8, potentiometer (RC2) */
#define BOARD_AD1CHS123 0x0000u             /* CH1: AN0 I_A (RA0), CH2: AN1 I_B (RA1), CH3: AN2 bus (RB0) */
#define BOARD_AD1PCFGL ((uint16_t)~0x0107u) /* analogue: AN0, AN1, AN2, AN8 */

/* ---- Buttons, active low ---- */
#define BOARD_S2_DOWN() ((uint16_t)(PORTAbits.RA8 == 0u)) /* start, stop, clear a fault */
#define BOARD_S3_DOWN() ((uint16_t)(PORTBbits.RB4 == 0u)) /* speed range */

/* ---- UART1: 115200 8N1, status lines. RP19/RC3 transmits, RP20/RC4 receives [?] ---- */
#define BOARD_U1BRG 86u /* BRGH 1: 40e6 / (4 * 87) = 114943 baud, -0.2 % */
#define BOARD_UART_TX_PIN RPOR9bits.RP19R
#define BOARD_UART_TX_FUNCTION 3u /* RPnR code of U1TX */
#define BOARD_UART_RX_RP 20u

/* ---- LEDs [?]: pins are not confirmed for this board; free pins until they are ---- */
#define BOARD_LED_ALIVE LATCbits.LATC6
#define BOARD_LED_RUN LATCbits.LATC7
#define BOARD_TRISC_OUTPUTS ((uint16_t)((1u << 6) | (1u << 7) | (1u << 3))) /* LEDs and U1TX */

#endif
