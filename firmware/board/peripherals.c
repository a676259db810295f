/* The peripherals of the board room: clock, pins, PWM1, ADC1, timer 1, the slow work's interrupt, UART1. */
#include "board/peripherals.h"

#include "board/mclv.h"

#include <xc.h>

uint16_t timer_ms_passed(void)
{
    if (!IFS0bits.T1IF) {
        return 0;
    }
    IFS0bits.T1IF = 0;
    return 1;
}

uint16_t uart_has_room(void)
{
    return (uint16_t)!U1STAbits.UTXBF;
}

uint16_t uart_send(char c)
{
    if (!uart_has_room()) {
        return 0;
    }
    U1TXREG = (uint16_t)(uint8_t)c;
    return 1;
}

INLINE void pwm_outputs_off(void)
{
    P1OVDCON = BOARD_OUTPUTS_OFF;
}

/** The lower byte of OSCCON: a request to switch the clock, the lock of the pin selection. */
static void clock_write_low(uint16_t low)
{
    __builtin_write_OSCCONL(low);
}

/** @param needs bits of OSCCON that tell that the source is ready @return 0, or 1 if it is not the clock */
static uint16_t clock_switch(uint16_t source, uint16_t needs)
{
    const uint16_t mask = (uint16_t)(0x7000u | needs), ready = (uint16_t)((uint16_t)(source << 12) | needs); /* COSC */
    uint16_t loops;
    __builtin_write_OSCCONH(source);
    clock_write_low((uint16_t)(OSCCON | 0x0001u));
    for (loops = BOARD_WAIT_LOOPS; loops != 0u; loops--) {
        if ((OSCCON & mask) == ready) {
            return 0;
        }
        ClrWdt(); /* the wait is bounded, but longer than the watchdog's time */
    }
    return 1;
}

uint16_t clock_init(void)
{
    /* After any reset but power-on the old clock goes on, and a PLL that is in use must not be changed. */
    if (OSCCONbits.COSC != BOARD_NOSC_FRC && clock_switch(BOARD_NOSC_FRC, 0)) {
        return 1;
    }
    PLLFBD = BOARD_PLLFBD;
    CLKDIV = BOARD_CLKDIV;
    OSCTUN = 0;
    return clock_switch(BOARD_NOSC_PRIPLL, BOARD_OSCCON_LOCK);
}

void pins_unlock(void)
{
    clock_write_low((uint16_t)(OSCCON & ~0x0040u));
}

void pins_lock(void)
{
    clock_write_low((uint16_t)(OSCCON | 0x0040u));
}

void pins_init(void)
{
    AD1PCFGL = BOARD_AD1PCFGL;
    LATA = BOARD_LAT(A);
    LATB = BOARD_LAT(B);
    LATC = BOARD_LAT(C);
    TRISA = BOARD_TRIS(A);
    TRISB = BOARD_TRIS(B);
    TRISC = BOARD_TRIS(C);
    if (DIRECTION_INPUT_USED) {
        CNPU1 = BOARD_CNPU1;
        CNPU2 = BOARD_CNPU2;
    }

    pins_unlock();
    RPINR12 = BOARD_FLTA_RP;
    RPINR18 = 0x1F00u | BOARD_UART_RX_RP; /* U1CTS stays without a pin */
    PIN_OUTPUT(BOARD_PIN_UART_TX) = BOARD_UART_TX_FUNCTION;
    pins_lock();
}

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
    IPC15bits.FLTA1IP = BOARD_PRIORITY_FAULT;
    IEC3bits.FLTA1IE = BOARD_FLTA_USED;
    P1TCON = BOARD_P1TCON;
}

void adc_init(void)
{
    AD1CON1 = BOARD_AD1CON1;
    AD1CON2 = BOARD_AD1CON2;
    AD1CON3 = BOARD_AD1CON3;
    AD1CHS0 = BOARD_AD1CHS0;
    AD1CHS123 = BOARD_AD1CHS123;
    AD1CSSL = 0;
    IFS0bits.AD1IF = 0;
    IPC3bits.AD1IP = BOARD_PRIORITY_CONTROL;
    IEC0bits.AD1IE = 1;
    IFS0bits.T2IF = 0;
    IPC1bits.T2IP = BOARD_PRIORITY_SLOW;
    IEC0bits.T2IE = 1;
    AD1CON1bits.ADON = 1;
}

void timer_init(void)
{
    T1CON = 0;
    TMR1 = 0;
    PR1 = (uint16_t)(BOARD_FCY_HZ / 1000ul - 1ul);
    IFS0bits.T1IF = 0;
    T1CON = 0x8000u;
}

void uart_init(void)
{
    U1MODE = 0x0008u; /* BRGH */
    U1BRG = BOARD_U1BRG;
    U1MODE = 0x8008u; /* on, 8N1 */
    U1STAbits.UTXEN = 1;
}

int16_t uart_receive(void)
{
    if (U1STAbits.OERR) {
        U1STAbits.OERR = 0; /* the receiver stands still until then */
    }
    return (int16_t)(U1STAbits.URXDA ? (int16_t)(U1RXREG & 0xFFu) : -1);
}
