/* PWM1: three complementary pairs, 20 kHz centre-aligned, dead time, fault input; outputs off until the drive asks. */
#include "board/mclv.h"
#include "board/peripherals.h"

void pwm_init(void)
{
    P1TCON = 0;
    pwm_outputs_off();
    P1TPER = BOARD_P1TPER;
    PWM1CON1 = BOARD_PWM1CON1;
    PWM1CON2 = 0; /* duties load at the period's boundary, overrides at once */
    P1DTCON1 = BOARD_P1DTCON1;
    P1DTCON2 = 0;
    P1FLTACON = BOARD_P1FLTACON;
    P1DC1 = 0;
    P1DC2 = 0;
    P1DC3 = 0;
    P1SECMP = BOARD_P1SECMP;
    IFS3bits.FLTA1IF = 0;
    IPC15bits.FLTA1IP = 3; /* as the slow work: neither disturbs the other's state; the pins are off by hardware */
    IEC3bits.FLTA1IE = 1;
    P1TCON = BOARD_P1TCON;
}
