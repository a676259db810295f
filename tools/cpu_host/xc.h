/* The host's device header: dsPIC33FJ32MC204 special function registers as plain 16-bit globals under Microchip's names.
 *
 * firmware/ includes <xc.h> on both sides: XC16 finds the vendor's file, the PC finds this one. Registers are memory here:
 * nothing answers while the firmware runs, a harness (tools/vboard or a test) writes inputs and reads outputs between calls.
 */
#ifndef FOC33_HOST_XC_H
#define FOC33_HOST_XC_H

#include <stddef.h>
#include <stdint.h>

#include "../chip/chip_registers.h"

/* Every register of the part is a variable. They start with the silicon's reset values, except those that nothing would change while the
 * firmware waits for them (xc.c). */
#define HOST_SFR_DECLARE(name, address, reset) extern volatile uint16_t name;
SFR_TABLE(HOST_SFR_DECLARE)
#undef HOST_SFR_DECLARE

/* A harness that takes a character from U1TXREG writes this value back, because a write of the same character twice would not show. */
#define HOST_U1TXREG_EMPTY 0xFFFFu

/* One register: its name in Microchip's header, its place on the host, and the value that it starts with. */
typedef struct {
    const char *name;
    volatile uint16_t *pointer;
    uint16_t reset;
} host_sfr_t;

/* Every register in the order of SFR_TABLE, and how many there are. */
extern host_sfr_t host_sfr_table[];
extern const size_t host_sfr_count;

/* Put every register back to its start value, as power-up does. */
void host_registers_reset(void);

/* The register called `name`, or NULL if there is none of that name. */
volatile uint16_t *host_sfr_find(const char *name);

/* Low byte of OSCCON after the unlock sequence. A requested clock switch (OSWEN) completes at once: COSC becomes NOSC, LOCK follows. */
void host_write_oscconl(unsigned value);

/* High byte of OSCCON after the unlock sequence: NOSC only, COSC is read-only. */
void host_write_oscconh(unsigned value);

/* Interrupt vectors. A firmware defines those that it uses; callers that are not sure must declare them weak. */
void _OscillatorFail(void);
void _AddressError(void);
void _StackError(void);
void _MathError(void);
void _T1Interrupt(void);
void _T2Interrupt(void);
void _T3Interrupt(void);
void _U1RXInterrupt(void);
void _U1TXInterrupt(void);
void _U1ErrInterrupt(void);
void _ADC1Interrupt(void);
void _CNInterrupt(void);
void _MPWM1Interrupt(void);
void _FLTA1Interrupt(void);
void _DefaultInterrupt(void);

/** How often the firmware has served the watchdog; there is none on a PC. */
extern volatile uint16_t host_watchdog_serves;
void host_clear_watchdog(void);

/* What XC16 builds in, and the instructions with no effect on a PC. */
#define __builtin_write_OSCCONL(value) host_write_oscconl((unsigned)(value))
#define __builtin_write_OSCCONH(value) host_write_oscconh((unsigned)(value))
#define __builtin_disable_interrupts() ((void)(SR = (uint16_t)(SR | 0x00E0u)))
#define __builtin_enable_interrupts() ((void)(SR = (uint16_t)(SR & ~0x00E0u)))
#define Nop() ((void)0)
#define ClrWdt() host_clear_watchdog()
#define Idle() ((void)0)
#define Sleep() ((void)0)
#define SET_CPU_IPL(level) ((void)(SRbits.IPL = (uint16_t)((level) & 7)))
#define SET_AND_SAVE_CPU_IPL(save, level) ((void)((save) = SRbits.IPL, SRbits.IPL = (uint16_t)((level) & 7)))
#define RESTORE_CPU_IPL(save) SET_CPU_IPL(save)

/* Bit views: the register NAME once more, as NAMEbits. Every struct lists its fields from bit 0 upwards; u(n) are unimplemented bits. */
#define HOST_TEXT_OF(x) #x
#define HOST_TEXT(x) HOST_TEXT_OF(x)
#define HOST_VIEW(name, type) extern volatile type##BITS name##bits __asm__(HOST_TEXT(__USER_LABEL_PREFIX__) #name);
#define HOST_BITS(name, ...) typedef struct __VA_ARGS__ name##BITS; HOST_VIEW(name, name)
#define u(bits) uint16_t : bits

HOST_BITS(SR, { uint16_t C:1, Z:1, OV:1, N:1, RA:1, IPL:3, DC:1, DA:1, SAB:1, OAB:1, SB:1, SA:1, OB:1, OA:1; })
HOST_BITS(CORCON, { uint16_t IF:1, RND:1, PSV:1, IPL3:1, ACCSAT:1, SATDW:1, SATB:1, SATA:1, DL:3, EDT:1, US:1; u(3); })

HOST_BITS(INTCON1, {
    u(1); uint16_t OSCFAIL:1, STKERR:1, ADDRERR:1, MATHERR:1; u(1); uint16_t DIV0ERR:1, SFTACERR:1, COVTE:1, OVBTE:1, OVATE:1,
    COVBERR:1, COVAERR:1, OVBERR:1, OVAERR:1, NSTDIS:1;
})
HOST_BITS(INTCON2, { uint16_t INT0EP:1, INT1EP:1, INT2EP:1; u(11); uint16_t DISI:1, ALTIVT:1; })
HOST_BITS(INTTREG, { uint16_t VECNUM:7; u(1); uint16_t ILR:4; u(4); })

HOST_BITS(IFS0, {
    uint16_t INT0IF:1, IC1IF:1, OC1IF:1, T1IF:1; u(1); uint16_t IC2IF:1, OC2IF:1, T2IF:1, T3IF:1, SPI1EIF:1, SPI1IF:1, U1RXIF:1,
    U1TXIF:1, AD1IF:1; u(2);
})
HOST_BITS(IFS1, {
    uint16_t SI2C1IF:1, MI2C1IF:1; u(1); uint16_t CNIF:1, INT1IF:1; u(1); uint16_t IC7IF:1, IC8IF:1; u(5); uint16_t INT2IF:1; u(2);
})
HOST_BITS(IFS3, { u(9); uint16_t PWM1IF:1, QEI1IF:1; u(4); uint16_t FLTA1IF:1; })
HOST_BITS(IFS4, { u(1); uint16_t U1EIF:1; u(7); uint16_t PWM2IF:1, FLTA2IF:1; u(5); })
HOST_BITS(IEC0, {
    uint16_t INT0IE:1, IC1IE:1, OC1IE:1, T1IE:1; u(1); uint16_t IC2IE:1, OC2IE:1, T2IE:1, T3IE:1, SPI1EIE:1, SPI1IE:1, U1RXIE:1,
    U1TXIE:1, AD1IE:1; u(2);
})
HOST_BITS(IEC1, {
    uint16_t SI2C1IE:1, MI2C1IE:1; u(1); uint16_t CNIE:1, INT1IE:1; u(1); uint16_t IC7IE:1, IC8IE:1; u(5); uint16_t INT2IE:1; u(2);
})
HOST_BITS(IEC3, { u(9); uint16_t PWM1IE:1, QEI1IE:1; u(4); uint16_t FLTA1IE:1; })
HOST_BITS(IEC4, { u(1); uint16_t U1EIE:1; u(7); uint16_t PWM2IE:1, FLTA2IE:1; u(5); })

HOST_BITS(IPC0, { uint16_t INT0IP:3; u(1); uint16_t IC1IP:3; u(1); uint16_t OC1IP:3; u(1); uint16_t T1IP:3; u(1); })
HOST_BITS(IPC1, { u(4); uint16_t IC2IP:3; u(1); uint16_t OC2IP:3; u(1); uint16_t T2IP:3; u(1); })
HOST_BITS(IPC2, { uint16_t T3IP:3; u(1); uint16_t SPI1EIP:3; u(1); uint16_t SPI1IP:3; u(1); uint16_t U1RXIP:3; u(1); })
HOST_BITS(IPC3, { uint16_t U1TXIP:3; u(1); uint16_t AD1IP:3; u(9); })
HOST_BITS(IPC4, { uint16_t SI2C1IP:3; u(1); uint16_t MI2C1IP:3; u(5); uint16_t CNIP:3; u(1); })
HOST_BITS(IPC5, { uint16_t INT1IP:3; u(5); uint16_t IC7IP:3; u(1); uint16_t IC8IP:3; u(1); })
HOST_BITS(IPC7, { u(4); uint16_t INT2IP:3; u(9); })
HOST_BITS(IPC14, { u(4); uint16_t PWM1IP:3; u(1); uint16_t QEI1IP:3; u(5); })
HOST_BITS(IPC15, { u(12); uint16_t FLTA1IP:3; u(1); })
HOST_BITS(IPC16, { u(4); uint16_t U1EIP:3; u(9); })
HOST_BITS(IPC18, { u(4); uint16_t PWM2IP:3; u(1); uint16_t FLTA2IP:3; u(5); })

HOST_BITS(OSCCON, {
    uint16_t OSWEN:1, LPOSCEN:1; u(1); uint16_t CF:1; u(1); uint16_t LOCK:1, IOLOCK:1, CLKLOCK:1, NOSC:3; u(1); uint16_t COSC:3; u(1);
})
HOST_BITS(CLKDIV, { uint16_t PLLPRE:5; u(1); uint16_t PLLPOST:2, FRCDIV:3, DOZEN:1, DOZE:3, ROI:1; })
HOST_BITS(PLLFBD, { uint16_t PLLDIV:9; u(7); })
HOST_BITS(OSCTUN, { uint16_t TUN:6; u(10); })
HOST_BITS(RCON, {
    uint16_t POR:1, BOR:1, IDLE:1, SLEEP:1, WDTO:1, SWDTEN:1, SWR:1, EXTR:1, VREGS:1, CM:1; u(4); uint16_t IOPUWR:1, TRAPR:1;
})
HOST_BITS(PMD1, {
    uint16_t AD1MD:1; u(2); uint16_t SPI1MD:1; u(1); uint16_t U1MD:1; u(1); uint16_t I2C1MD:1; u(1); uint16_t PWM1MD:1, QEI1MD:1, T1MD:1,
    T2MD:1, T3MD:1; u(2);
})
HOST_BITS(PMD2, { uint16_t OC1MD:1, OC2MD:1; u(6); uint16_t IC1MD:1, IC2MD:1; u(4); uint16_t IC7MD:1, IC8MD:1; })
HOST_BITS(PMD3, { u(4); uint16_t PWM2MD:1; u(11); })
HOST_BITS(NVMCON, { uint16_t NVMOP:4; u(2); uint16_t ERASE:1; u(6); uint16_t WRERR:1, WREN:1, WR:1; })

#define HOST_PORT_A(p) uint16_t p##0:1, p##1:1, p##2:1, p##3:1, p##4:1; u(2); uint16_t p##7:1, p##8:1, p##9:1, p##10:1; u(5);
#define HOST_PORT_B(p) uint16_t p##0:1, p##1:1, p##2:1, p##3:1, p##4:1, p##5:1, p##6:1, p##7:1, p##8:1, p##9:1, p##10:1, p##11:1, \
    p##12:1, p##13:1, p##14:1, p##15:1;
#define HOST_PORT_C(p) uint16_t p##0:1, p##1:1, p##2:1, p##3:1, p##4:1, p##5:1, p##6:1, p##7:1, p##8:1, p##9:1; u(6);
HOST_BITS(PORTA, { HOST_PORT_A(RA) })
HOST_BITS(PORTB, { HOST_PORT_B(RB) })
HOST_BITS(PORTC, { HOST_PORT_C(RC) })
HOST_BITS(LATA, { HOST_PORT_A(LATA) })
HOST_BITS(LATB, { HOST_PORT_B(LATB) })
HOST_BITS(LATC, { HOST_PORT_C(LATC) })
HOST_BITS(TRISA, { HOST_PORT_A(TRISA) })
HOST_BITS(TRISB, { HOST_PORT_B(TRISB) })
HOST_BITS(TRISC, { HOST_PORT_C(TRISC) })
HOST_BITS(ODCA, { HOST_PORT_A(ODCA) })
HOST_BITS(ODCB, { HOST_PORT_B(ODCB) })
HOST_BITS(ODCC, { HOST_PORT_C(ODCC) })
#undef HOST_PORT_A
#undef HOST_PORT_B
#undef HOST_PORT_C
#define HOST_CN_1(n, x) uint16_t CN0##x:1, CN1##x:1, CN2##x:1, CN3##x:1, CN4##x:1, CN5##x:1, CN6##x:1, CN7##x:1, CN8##x:1, CN9##x:1, \
    CN10##x:1, CN11##x:1, CN12##x:1, CN13##x:1, CN14##x:1, CN15##x:1;
#define HOST_CN_2(n, x) uint16_t CN16##x:1, CN17##x:1, CN18##x:1, CN19##x:1, CN20##x:1, CN21##x:1, CN22##x:1, CN23##x:1, CN24##x:1, \
    CN25##x:1, CN26##x:1, CN27##x:1, CN28##x:1, CN29##x:1, CN30##x:1; u(1);
HOST_BITS(CNEN1, { HOST_CN_1(1, IE) })
HOST_BITS(CNEN2, { HOST_CN_2(2, IE) })
HOST_BITS(CNPU1, { HOST_CN_1(1, PUE) })
HOST_BITS(CNPU2, { HOST_CN_2(2, PUE) })
#undef HOST_CN_1
#undef HOST_CN_2

HOST_BITS(RPINR0, { u(8); uint16_t INT1R:5; u(3); })
HOST_BITS(RPINR1, { uint16_t INT2R:5; u(11); })
HOST_BITS(RPINR3, { uint16_t T2CKR:5; u(3); uint16_t T3CKR:5; u(3); })
HOST_BITS(RPINR7, { uint16_t IC1R:5; u(3); uint16_t IC2R:5; u(3); })
HOST_BITS(RPINR10, { uint16_t IC7R:5; u(3); uint16_t IC8R:5; u(3); })
HOST_BITS(RPINR11, { uint16_t OCFAR:5; u(11); })
HOST_BITS(RPINR12, { uint16_t FLTA1R:5; u(11); })
HOST_BITS(RPINR13, { uint16_t FLTA2R:5; u(11); })
HOST_BITS(RPINR14, { uint16_t QEA1R:5; u(3); uint16_t QEB1R:5; u(3); })
HOST_BITS(RPINR15, { uint16_t INDX1R:5; u(11); })
HOST_BITS(RPINR18, { uint16_t U1RXR:5; u(3); uint16_t U1CTSR:5; u(3); })
HOST_BITS(RPINR20, { uint16_t SDI1R:5; u(3); uint16_t SCK1R:5; u(3); })
HOST_BITS(RPINR21, { uint16_t SS1R:5; u(11); })
#define HOST_RPOR(even, odd) { uint16_t RP##even##R:5; u(3); uint16_t RP##odd##R:5; u(3); }
HOST_BITS(RPOR0, HOST_RPOR(0, 1))
HOST_BITS(RPOR1, HOST_RPOR(2, 3))
HOST_BITS(RPOR2, HOST_RPOR(4, 5))
HOST_BITS(RPOR3, HOST_RPOR(6, 7))
HOST_BITS(RPOR4, HOST_RPOR(8, 9))
HOST_BITS(RPOR5, HOST_RPOR(10, 11))
HOST_BITS(RPOR6, HOST_RPOR(12, 13))
HOST_BITS(RPOR7, HOST_RPOR(14, 15))
HOST_BITS(RPOR8, HOST_RPOR(16, 17))
HOST_BITS(RPOR9, HOST_RPOR(18, 19))
HOST_BITS(RPOR10, HOST_RPOR(20, 21))
HOST_BITS(RPOR11, HOST_RPOR(22, 23))
HOST_BITS(RPOR12, HOST_RPOR(24, 25))
#undef HOST_RPOR

HOST_BITS(T1CON, { u(1); uint16_t TCS:1, TSYNC:1; u(1); uint16_t TCKPS:2, TGATE:1; u(6); uint16_t TSIDL:1; u(1); uint16_t TON:1; })
HOST_BITS(T2CON, { u(1); uint16_t TCS:1; u(1); uint16_t T32:1, TCKPS:2, TGATE:1; u(6); uint16_t TSIDL:1; u(1); uint16_t TON:1; })
HOST_BITS(T3CON, { u(1); uint16_t TCS:1; u(2); uint16_t TCKPS:2, TGATE:1; u(6); uint16_t TSIDL:1; u(1); uint16_t TON:1; })

HOST_BITS(P1TCON, { uint16_t PTMOD:2, PTCKPS:2, PTOPS:4; u(5); uint16_t PTSIDL:1; u(1); uint16_t PTEN:1; })
HOST_BITS(P1TMR, { uint16_t PTMR:15, PTDIR:1; })
HOST_BITS(P1TPER, { uint16_t PTPER:15; u(1); })
HOST_BITS(P1SECMP, { uint16_t SEVTCMP:15, SEVTDIR:1; })
HOST_BITS(PWM1CON1, {
    uint16_t PEN1L:1, PEN2L:1, PEN3L:1; u(1); uint16_t PEN1H:1, PEN2H:1, PEN3H:1; u(1); uint16_t PMOD1:1, PMOD2:1, PMOD3:1; u(5);
})
HOST_BITS(PWM1CON2, { uint16_t UDIS:1, OSYNC:1, IUE:1; u(5); uint16_t SEVOPS:4; u(4); })
HOST_BITS(P1DTCON1, { uint16_t DTA:6, DTAPS:2, DTB:6, DTBPS:2; })
HOST_BITS(P1DTCON2, { uint16_t DTS1I:1, DTS1A:1, DTS2I:1, DTS2A:1, DTS3I:1, DTS3A:1; u(10); })
HOST_BITS(P1FLTACON, {
    uint16_t FAEN1:1, FAEN2:1, FAEN3:1; u(4); uint16_t FLTAM:1, FAOV1L:1, FAOV1H:1, FAOV2L:1, FAOV2H:1, FAOV3L:1, FAOV3H:1; u(2);
})
HOST_BITS(P1OVDCON, {
    uint16_t POUT1L:1, POUT1H:1, POUT2L:1, POUT2H:1, POUT3L:1, POUT3H:1; u(2); uint16_t POVD1L:1, POVD1H:1, POVD2L:1, POVD2H:1,
    POVD3L:1, POVD3H:1; u(2);
})
HOST_BITS(PWM2CON1, { uint16_t PEN1L:1; u(3); uint16_t PEN1H:1; u(3); uint16_t PMOD1:1; u(7); })
HOST_BITS(P2FLTACON, { uint16_t FAEN1:1; u(6); uint16_t FLTAM:1, FAOV1L:1, FAOV1H:1; u(6); })
HOST_BITS(P2OVDCON, { uint16_t POUT1L:1, POUT1H:1; u(6); uint16_t POVD1L:1, POVD1H:1; u(6); })

HOST_BITS(AD1CON1, {
    uint16_t DONE:1, SAMP:1, ASAM:1, SIMSAM:1; u(1); uint16_t SSRC:3, FORM:2, AD12B:1; u(2); uint16_t ADSIDL:1; u(1); uint16_t ADON:1;
})
HOST_BITS(AD1CON2, { uint16_t ALTS:1, BUFM:1, SMPI:4; u(1); uint16_t BUFS:1, CHPS:2, CSCNA:1; u(2); uint16_t VCFG:3; })
HOST_BITS(AD1CON3, { uint16_t ADCS:8, SAMC:5; u(2); uint16_t ADRC:1; })
HOST_BITS(AD1CHS0, { uint16_t CH0SA:5; u(2); uint16_t CH0NA:1, CH0SB:5; u(2); uint16_t CH0NB:1; })
HOST_BITS(AD1CHS123, { uint16_t CH123SA:1, CH123NA:2; u(5); uint16_t CH123SB:1, CH123NB:2; u(5); })
HOST_BITS(AD1CSSL, { uint16_t CSS0:1, CSS1:1, CSS2:1, CSS3:1, CSS4:1, CSS5:1, CSS6:1, CSS7:1, CSS8:1; u(7); })
HOST_BITS(AD1PCFGL, { uint16_t PCFG0:1, PCFG1:1, PCFG2:1, PCFG3:1, PCFG4:1, PCFG5:1, PCFG6:1, PCFG7:1, PCFG8:1; u(7); })

HOST_BITS(U1MODE, {
    uint16_t STSEL:1, PDSEL:2, BRGH:1, URXINV:1, ABAUD:1, LPBACK:1, WAKE:1, UEN:2; u(1); uint16_t RTSMD:1, IREN:1, USIDL:1; u(1);
    uint16_t UARTEN:1;
})
HOST_BITS(U1STA, {
    uint16_t URXDA:1, OERR:1, FERR:1, PERR:1, RIDLE:1, ADDEN:1, URXISEL:2, TRMT:1, UTXBF:1, UTXEN:1, UTXBRK:1; u(1); uint16_t UTXISEL0:1,
    UTXINV:1, UTXISEL1:1;
})

/* The second PWM module has the first one's registers. */
HOST_VIEW(P2TCON, P1TCON)
HOST_VIEW(P2TMR, P1TMR)
HOST_VIEW(P2TPER, P1TPER)
HOST_VIEW(P2SECMP, P1SECMP)
HOST_VIEW(PWM2CON2, PWM1CON2)
HOST_VIEW(P2DTCON1, P1DTCON1)
HOST_VIEW(P2DTCON2, P1DTCON2)

#undef u
#undef HOST_BITS
#undef HOST_VIEW

/* The device's macros that tell code which part it is compiled for are deliberately absent: firmware tests __XC16__. */

#endif
