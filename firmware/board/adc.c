/* ADC1: both phase currents, bus and potentiometer sampled at once at the centre of the low sides' conduction; the interrupts of a period. */
#include "board/mclv.h"
#include "board/peripherals.h"

void adc_init(void)
{
    AD1CON1 = BOARD_AD1CON1;
    AD1CON2 = BOARD_AD1CON2;
    AD1CON3 = BOARD_AD1CON3;
    AD1CHS0 = BOARD_AD1CHS0;
    AD1CHS123 = BOARD_AD1CHS123;
    AD1CSSL = 0;
    IFS0bits.AD1IF = 0;
    IPC3bits.AD1IP = 5;
    IEC0bits.AD1IE = 1;
    IFS0bits.T2IF = 0;
    IPC1bits.T2IP = 3; /* raised by the control interrupt alone, and below it */
    IEC0bits.T2IE = 1;
    AD1CON1bits.ADON = 1;
}
