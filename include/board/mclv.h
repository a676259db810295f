/* The dsPICDEM MCLV with a dsPIC33FJ32MC204: its pins, channels and the values of their registers in one place.
 *
 * [?] marks what no published source confirms; check it against your board's schematic before you rely on it. One such fact is used
 * elsewhere: the bus divider of 16 [?, known for the MCLV-2 only] in userparams.h's BUS_FULL_SCALE_V = 16 * 3.3 V. */
#ifndef BOARD_MCLV_H
#define BOARD_MCLV_H

#include <xc.h>

#include "board/pin_table.h"
#include "drive/param_scaling.h"

/* ---- Pins, as port and bit: the only place that chooses them. "what; known from" feeds docs/pins.md ----
 * currents and bus: AN0..2 or AN3..5 in this order, which the converter samples at once; FAULT and UART: a pin with an RP number. */
#define BOARD_PIN_CURRENT_A A, 0  /* current of phase A, 0.375 V/A around 1.65 V; AN1292 and published code for this board */
#define BOARD_PIN_CURRENT_B A, 1  /* current of phase B; AN1292 and published code */
#define BOARD_PIN_BUS B, 0        /* bus voltage / 16; published code, the divider is known for the MCLV-2 only [?] */
#define BOARD_PIN_POT C, 2        /* potentiometer; published code */
#define BOARD_PIN_MOTOR_NTC C, 0  /* NTC of the motor, to ground, with a resistor to 3.3 V; MOTOR_NTC_USED; [?] a spare input, follow it on the board */
#define BOARD_PIN_BRIDGE_NTC C, 1 /* NTC of the bridge, the same; BRIDGE_NTC_USED; [?] a spare input, follow it on the board */
#define BOARD_PIN_S2 A, 8         /* S2, low when pressed; published code */
#define BOARD_PIN_S3 B, 4         /* S3, low when pressed; published code */
#define BOARD_PIN_FAULT B, 8      /* FLTA1, the over-current comparator, low on a fault; published code */
#define BOARD_PIN_UART_TX C, 3    /* serial line, transmits at 115200 baud; [?] if no line comes, swap it with BOARD_OTHER_TX, RP21 */
#define BOARD_OTHER_TX C, 5       /* BRINGUP tries this one, too: never the same pin */
#define BOARD_PIN_UART_RX C, 4    /* serial line, receives; one other program for this board, its board unknown [?] */
#define BOARD_PIN_LED_ALIVE C, 6  /* LED: alive, fault code; [?] a free pin until it is known */
#define BOARD_PIN_LED_RUN C, 7    /* LED: running; [?] a free pin until it is known */
/* The next four are used where the parameter of userparams.h says so; a board's switches for them need pull-downs, so that a chip in reset leaves them off. */
#define BOARD_PIN_DIRECTION A, 4       /* direction input, DIRECTION_INPUT_USED, with the chip's pull-up; [?] a free pin */
#define BOARD_PIN_FAULT_OUTPUT A, 7    /* relay: fault, FAULT_OUTPUT_USED; [?] a free pin */
#define BOARD_PIN_RUNNING_OUTPUT A, 10 /* relay: running, RUNNING_OUTPUT_USED; [?] a free pin */
#define BOARD_PIN_CHOPPER A, 9         /* brake resistor's switch, BRAKE_CHOPPER_V; [?] a free pin */
/* Their levels when on. A fault is low: its relay is held by a high pin and drops with a fault, a chip in reset, or no supply. */
#define BOARD_LEVEL_DIRECTION 0u      /* turns the direction round: a contact to ground; an open one, or a broken wire, is forward */
#define BOARD_LEVEL_FAULT_OUTPUT 0u   /* while there is a fault, and from power-up until the first period says that there is none */
#define BOARD_LEVEL_RUNNING_OUTPUT 1u /* while the bridge conducts */
#define BOARD_LEVEL_CHOPPER 1u        /* while the brake resistor is on */
#define BOARD_PIN_PULSE B, 7          /* pulses as a command, of an application with app/pulse.h; [?] a free pin until it is known */
/* The chip fixes the PWM pins; a low side is one bit above its high side. */
#define BOARD_PIN_PWM_A B, 14 /* PWM of phase A (M1), high side; published code */
#define BOARD_PIN_PWM_B B, 12 /* PWM of phase B (M2), high side; published code */
#define BOARD_PIN_PWM_C B, 10 /* PWM of phase C (M3), high side; published code */

PIN_NEEDS(currents_and_bus_are_AN0_to_2_or_AN3_to_5,
          (PIN_AN(BOARD_PIN_CURRENT_A) == 0 || PIN_AN(BOARD_PIN_CURRENT_A) == 3) && PIN_AN(BOARD_PIN_CURRENT_B) == PIN_AN(BOARD_PIN_CURRENT_A) + 1
              && PIN_AN(BOARD_PIN_BUS) == PIN_AN(BOARD_PIN_CURRENT_A) + 2);
PIN_NEEDS(potentiometer_and_NTCs_have_AN_numbers, PIN_AN(BOARD_PIN_POT) >= 0 && PIN_AN(BOARD_PIN_MOTOR_NTC) >= 0 && PIN_AN(BOARD_PIN_BRIDGE_NTC) >= 0);
PIN_NEEDS(fault_input_has_an_RP_number, PIN_RP(BOARD_PIN_FAULT) >= 0);
PIN_NEEDS(direction_input_has_a_pull_up, !(DIRECTION_INPUT_USED) || PIN_CN(BOARD_PIN_DIRECTION) >= 0);
PIN_NEEDS(serial_line_has_RP_numbers, PIN_RP(BOARD_PIN_UART_TX) >= 0 && PIN_RP(BOARD_PIN_UART_RX) >= 0);
PIN_NEEDS(BOARD_OTHER_TX_is_another_pin_with_an_RP_number, PIN_RP(BOARD_OTHER_TX) >= 0 && PIN_RP(BOARD_OTHER_TX) != PIN_RP(BOARD_PIN_UART_TX));
PIN_NEEDS(pulses_have_an_RP_number, PIN_RP(BOARD_PIN_PULSE) >= 0);

#ifdef __XC16__
#define BOARD_ISR __attribute__((interrupt, no_auto_psv, externally_visible))
#define BOARD_ISR_SHADOW __attribute__((interrupt, shadow, no_auto_psv, externally_visible)) /* one set of shadow registers: for one priority, which does not nest */
#else
#define BOARD_ISR
#define BOARD_ISR_SHADOW
#endif

/* ---- Priorities of the interrupts: set by peripherals.c, tested by selftest_run.c, read by the stack's proof (tools/image/stack.py) ---- */
#define BOARD_PRIORITY_CONTROL 5u /* the control interrupt, alone at its level: its shadow registers do not nest */
#define BOARD_PRIORITY_SLOW 3u    /* the slow work: raised by the control interrupt alone, and below it */
#define BOARD_PRIORITY_FAULT 3u   /* the fault input: as the slow work, so that neither disturbs the other's state; the pins are off by hardware */

/* ---- Clock: 8 MHz crystal * 40 / (2 * 2) = 80 MHz, 40 MIPS ---- */
#define BOARD_FCY_HZ 40000000ul
#define BOARD_PLLFBD 38u     /* M = 40 */
#define BOARD_CLKDIV 0x0000u /* N1 = 2, N2 = 2 */
#define BOARD_NOSC_FRC 0u
#define BOARD_NOSC_PRIPLL 3u
#define BOARD_OSCCON_LOCK 0x0020u
#define BOARD_WAIT_LOOPS 60000u /* bound of every wait on the oscillator, far above its 2 ms */

/* ---- PWM1: centre-aligned, 20 kHz, three complementary pairs ---- */
#define BOARD_P1TPER ((uint16_t)(PWM_FULL_DUTY / 2 - 1))
#define BOARD_P1TCON 0x8002u                                                  /* on, up/down counting */
#define BOARD_PWM1CON1 0x0077u                                                /* pairs 1-3 enabled, complementary */
#define BOARD_P1DTCON1 ((uint16_t)(0x0040u | (uint16_t)(DEAD_TIME_DUTY / 2))) /* unit A, two clocks a count */
/* Without the fault input no pair follows it, no interrupt comes, and its pin stays free. */
#define BOARD_FLTA_USED ((FAULT_INPUT_USED) ? 1u : 0u)
#define BOARD_P1FLTACON ((uint16_t)(0x0087u * BOARD_FLTA_USED)) /* FLTA: pairs 1-3 inactive, cycle by cycle */
#define BOARD_FLTA_RP ((uint16_t)(BOARD_FLTA_USED ? (unsigned)PIN_RP(BOARD_PIN_FAULT) : 0x1Fu))
#define BOARD_FLTA_LOW() (BOARD_FLTA_USED && PIN_LOW(BOARD_PIN_FAULT)) /* the comparator holds the outputs off */
#define BOARD_OUTPUTS_OFF 0x0000u
#define BOARD_OUTPUTS_BOOTSTRAP 0x0015u /* all low sides on */
#define BOARD_OUTPUTS_PWM 0x3F00u
/* Special event SAMPLE_DELAY_CLOCKS after the counter's peak, counting down: at the highest duty the low sides have then been on for SAMPLE_WINDOW_SEC
 * and this delay less the dead time, and stay on for SAMPLE_WINDOW_SEC less this delay. */
#define BOARD_P1SECMP ((uint16_t)(0x8000u | (BOARD_P1TPER - SAMPLE_DELAY_CLOCKS)))

/* ---- ADC1: four channels at once, 10 bits, signed fractional, started by the PWM; conversion 12 TAD * 4 * 100 ns = 4.8 us ---- */
#define BOARD_AD1CON1 0x036Cu                                                    /* FORM 3, SSRC 3 (PWM), SIMSAM, ASAM; ADON separately */
#define BOARD_AD1CON2 0x0200u                                                    /* CHPS 2: CH0..CH3 */
#define BOARD_AD1CON3 0x0003u                                                    /* TAD = 4 Tcy = 100 ns; the converter needs 76 ns */
#define BOARD_AD1CHS0 ((uint16_t)PIN_AN(BOARD_PIN_POT))                          /* CH0 */
#define BOARD_AD1CHS123 ((uint16_t)((PIN_AN(BOARD_PIN_CURRENT_A) == 0) ? 0 : 1)) /* CH1: I_A, CH2: I_B, CH3: bus */
#define BOARD_AD1PCFGL ((uint16_t) ~(PIN_AN_MASK(BOARD_PIN_CURRENT_A) | PIN_AN_MASK(BOARD_PIN_CURRENT_B) | PIN_AN_MASK(BOARD_PIN_BUS) \
                                     | PIN_AN_MASK(BOARD_PIN_POT) | BOARD_NTC_MASK)) /* 0 is analogue */
#define BOARD_NTC_MASK (((MOTOR_NTC_USED) ? PIN_AN_MASK(BOARD_PIN_MOTOR_NTC) : 0u) | ((BRIDGE_NTC_USED) ? PIN_AN_MASK(BOARD_PIN_BRIDGE_NTC) : 0u))
/* CH0 of the motor's sensor and of the bridge's, between two of the potentiometer's; one without a sensor is the other's turn. */
#define BOARD_CH0_MOTOR ((uint16_t)((MOTOR_NTC_USED) ? PIN_AN(BOARD_PIN_MOTOR_NTC) : PIN_AN(BOARD_PIN_BRIDGE_NTC)))
#define BOARD_CH0_BRIDGE ((uint16_t)((BRIDGE_NTC_USED) ? PIN_AN(BOARD_PIN_BRIDGE_NTC) : PIN_AN(BOARD_PIN_MOTOR_NTC)))

/** An analogue input that AD1PCFGL switches off: the multiplexer gives AVSS. */
#define BOARD_AN_IS_OFF(an) ((BOARD_AD1PCFGL & (1u << (an))) != 0u)
#define BOARD_AN_OFF ((uint16_t)(BOARD_AN_IS_OFF(6) ? 6 : BOARD_AN_IS_OFF(7) ? 7 \
                                                      : BOARD_AN_IS_OFF(5)   ? 5 \
                                                      : BOARD_AN_IS_OFF(1)   ? 1 \
                                                                             : 2))

/* ---- Buttons, active low ---- */
#define BOARD_S2_DOWN() PIN_LOW(BOARD_PIN_S2) /* start, stop, clear a fault */
#define BOARD_S3_DOWN() PIN_LOW(BOARD_PIN_S3) /* speed range */

/* ---- Direction input ---- */
#define BOARD_DIRECTION_ON() ((DIRECTION_INPUT_USED) && ((PIN_LOW(BOARD_PIN_DIRECTION) == 0u) == (BOARD_LEVEL_DIRECTION != 0u)))
#define BOARD_CNPU1 ((uint16_t)((DIRECTION_INPUT_USED) ? PIN_CN_MASK(0, BOARD_PIN_DIRECTION) : 0u))  /* pull-ups of CN0 to 15 */
#define BOARD_CNPU2 ((uint16_t)((DIRECTION_INPUT_USED) ? PIN_CN_MASK(16, BOARD_PIN_DIRECTION) : 0u)) /* and of CN16 to 30 */

/* ---- UART1: 115200 8N1, status lines ---- */
#define BOARD_U1BRG 86u           /* BRGH 1: 40e6 / (4 * 87) = 114943 baud, -0.2 % */
#define BOARD_UART_TX_FUNCTION 3u /* RPnR code of U1TX */
#define BOARD_UART_RX_RP ((uint16_t)PIN_RP(BOARD_PIN_UART_RX))

/* ---- Pulses, with app/pulse.h: IC1 captures where they begin, IC2 where they end, both timer 3 on a count of 200 ns ---- */
#define BOARD_PULSE_LOW 0 /* 1: a pulse is low at the pin, as behind an opto-coupler */
#define BOARD_RPINR7 ((uint16_t)(PIN_RP(BOARD_PIN_PULSE) * 0x0101u))
#define BOARD_T3CON 0x8010u                        /* 1:8 */
#define BOARD_IC1CON ((BOARD_PULSE_LOW) ? 2u : 3u) /* ICM: every falling or rising edge; no interrupt */
#define BOARD_IC2CON ((BOARD_PULSE_LOW) ? 3u : 2u)

/* ---- LEDs ---- */
#define BOARD_LED_ALIVE PIN_LATCH(BOARD_PIN_LED_ALIVE)
#define BOARD_LED_RUN PIN_LATCH(BOARD_PIN_LED_RUN)
/** A bit of a port: one instruction for each of its values, where an assignment takes seven. */
#define BOARD_SWITCH(bit, on) \
    do { \
        if (on) { \
            (bit) = 1; \
        } else { \
            (bit) = 0; \
        } \
    } while (0)
/** An output of a row above on (1) or off (0), at its level. */
#define BOARD_SIGNAL(output, on) BOARD_SWITCH(PIN_LATCH(BOARD_PIN_##output), ((on) != 0u) == (BOARD_LEVEL_##output != 0u))
/** An output's bit of a port if it is used; and the same if its pin is high while it has this state. */
#define BOARD_BIT_OF(used, port, ...) ((used) ? PIN_MASK(__VA_ARGS__, port) : 0u)
#define BOARD_HIGH(used, level, port, ...) BOARD_BIT_OF((used) && (level) != 0u, port, __VA_ARGS__)
/** Directions of a port: its outputs are the LEDs, U1TX, and what userparams.h asks for; the PWM module takes its pins when it is enabled. */
#define BOARD_TRIS(port) \
    ((uint16_t) ~(PIN_MASK(BOARD_PIN_LED_ALIVE, port) | PIN_MASK(BOARD_PIN_LED_RUN, port) | PIN_MASK(BOARD_PIN_UART_TX, port) \
                  | BOARD_BIT_OF(FAULT_OUTPUT_USED, port, BOARD_PIN_FAULT_OUTPUT) | BOARD_BIT_OF(RUNNING_OUTPUT_USED, port, BOARD_PIN_RUNNING_OUTPUT) \
                  | BOARD_BIT_OF(CHOPPER_USED, port, BOARD_PIN_CHOPPER)))
/** Levels of a port's outputs from power-up on: a fault, not running, no brake resistor. */
#define BOARD_LAT(port) \
    ((uint16_t)(BOARD_HIGH(FAULT_OUTPUT_USED, BOARD_LEVEL_FAULT_OUTPUT, port, BOARD_PIN_FAULT_OUTPUT) \
                | BOARD_HIGH(RUNNING_OUTPUT_USED, !BOARD_LEVEL_RUNNING_OUTPUT, port, BOARD_PIN_RUNNING_OUTPUT) \
                | BOARD_HIGH(CHOPPER_USED, !BOARD_LEVEL_CHOPPER, port, BOARD_PIN_CHOPPER)))

#endif
