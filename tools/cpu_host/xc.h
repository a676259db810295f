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

/* For the firmware's self-tests: a flash of made-up words with its CRC in the last two, and in the two before the pages of kept parameters, RAM that nothing else uses, the place of a stack,
 * processor registers whose bits can be stuck, and a watchdog whose time passes only while it is waited for. A test plants faults here. */
enum { HOST_FLASH_WORDS = 0x5800 / 2, HOST_FREE_WORDS = 64, HOST_STACK_WORDS = 16, HOST_W_REGISTERS = 16 };
enum { HOST_KEPT_WORD = 0x5000 / 2, HOST_PAGE_WORDS = 0x0400 / 2 };
extern uint32_t host_flash[HOST_FLASH_WORDS];
extern volatile uint16_t host_free_ram[HOST_FREE_WORDS], host_stack[HOST_STACK_WORDS];
extern uint16_t host_w_stuck_at_1[HOST_W_REGISTERS], host_w_stuck_at_0[HOST_W_REGISTERS];
extern uint16_t host_watchdog_counts; /* of timer 1 until it resets; 0: it never does */
extern volatile uint16_t host_cpu_holds;
void host_cpu_test(void);
uint16_t host_watchdog_bites(void);
/* The firmware's variables, where the build has put them into one stretch (make live-board): what a client on the serial line can reach, from 0x0800 on. */
uint8_t *host_window(void);
size_t host_window_bytes(void);
#define __builtin_tblrdl(offset) ((uint16_t)host_flash[(offset) / 2u])
#define __builtin_tblrdh(offset) ((uint16_t)(host_flash[(offset) / 2u] >> 16))

/* Programming of host_flash by NVMCON: a page of 512 words is erased, or a word programmed. What is written is there at once, unless the supply fails:
 * with so many operations left, counted down, the last one is done in part, and host_power_fails() follows, from which a test jumps away. */
extern uint16_t host_nvm_left; /* HOST_NVM_FOREVER: the supply does not fail */
extern void (*host_power_fails)(void);
enum { HOST_NVM_FOREVER = 0xFFFF };
void host_table_write(unsigned offset, uint32_t value, uint32_t mask);
void host_write_nvm(void);
/* The kept parameters' pages from a file and to it. 0, or -1: it cannot be read, or written; none is no error of the first. */
int host_kept_load(const char *path);
int host_kept_save(const char *path);
#define __builtin_tblwtl(offset, value) host_table_write((offset), (value), 0x00FFFFu)
#define __builtin_tblwth(offset, value) host_table_write((offset), (uint32_t)(value) << 16, 0xFF0000u)
#define __builtin_write_NVM() host_write_nvm()

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

/* Bit views: the register NAME once more, as NAMEbits, for those whose bits the firmware or a test names; whoever needs another adds its
 * line from the data sheet. Every struct lists its fields from bit 0 upwards; u(n) are unimplemented bits. */
#define HOST_TEXT_OF(x) #x
#define HOST_TEXT(x) HOST_TEXT_OF(x)
#define HOST_BITS(name, ...) \
    typedef struct __VA_ARGS__ name##BITS; \
    extern volatile name##BITS name##bits __asm__(HOST_TEXT(__USER_LABEL_PREFIX__) #name);
#define u(bits) uint16_t : bits

HOST_BITS(SR, { uint16_t C:1, Z:1, OV:1, N:1, RA:1, IPL:3, DC:1, DA:1, SAB:1, OAB:1, SB:1, SA:1, OB:1, OA:1; })
HOST_BITS(CORCON, { uint16_t IF:1, RND:1, PSV:1, IPL3:1, ACCSAT:1, SATDW:1, SATB:1, SATA:1, DL:3, EDT:1, US:1; u(3); })
HOST_BITS(INTCON1, {
    u(1); uint16_t OSCFAIL:1, STKERR:1, ADDRERR:1, MATHERR:1; u(1); uint16_t DIV0ERR:1, SFTACERR:1, COVTE:1, OVBTE:1, OVATE:1,
    COVBERR:1, COVAERR:1, OVBERR:1, OVAERR:1, NSTDIS:1;
})
HOST_BITS(IFS0, {
    uint16_t INT0IF:1, IC1IF:1, OC1IF:1, T1IF:1; u(1); uint16_t IC2IF:1, OC2IF:1, T2IF:1, T3IF:1, SPI1EIF:1, SPI1IF:1, U1RXIF:1,
    U1TXIF:1, AD1IF:1; u(2);
})
HOST_BITS(IFS3, { u(9); uint16_t PWM1IF:1, QEI1IF:1; u(4); uint16_t FLTA1IF:1; })
HOST_BITS(IEC0, {
    uint16_t INT0IE:1, IC1IE:1, OC1IE:1, T1IE:1; u(1); uint16_t IC2IE:1, OC2IE:1, T2IE:1, T3IE:1, SPI1EIE:1, SPI1IE:1, U1RXIE:1,
    U1TXIE:1, AD1IE:1; u(2);
})
HOST_BITS(IEC3, { u(9); uint16_t PWM1IE:1, QEI1IE:1; u(4); uint16_t FLTA1IE:1; })
HOST_BITS(IPC0, { uint16_t INT0IP:3; u(1); uint16_t IC1IP:3; u(1); uint16_t OC1IP:3; u(1); uint16_t T1IP:3; u(1); })
HOST_BITS(IPC1, { u(4); uint16_t OC2IP:3; u(1); uint16_t IC2IP:3; u(1); uint16_t T2IP:3; u(1); })
HOST_BITS(IPC3, { uint16_t U1TXIP:3; u(1); uint16_t AD1IP:3; u(9); })
HOST_BITS(IPC15, { u(12); uint16_t FLTA1IP:3; u(1); })
HOST_BITS(OSCCON, {
    uint16_t OSWEN:1, LPOSCEN:1; u(1); uint16_t CF:1; u(1); uint16_t LOCK:1, IOLOCK:1, CLKLOCK:1, NOSC:3; u(1); uint16_t COSC:3; u(1);
})

#define HOST_PORT_C(p) uint16_t p##0:1, p##1:1, p##2:1, p##3:1, p##4:1, p##5:1, p##6:1, p##7:1, p##8:1, p##9:1; u(6);
HOST_BITS(PORTA, { uint16_t RA0:1, RA1:1, RA2:1, RA3:1, RA4:1; u(2); uint16_t RA7:1, RA8:1, RA9:1, RA10:1; u(5); })
HOST_BITS(PORTB, {
    uint16_t RB0:1, RB1:1, RB2:1, RB3:1, RB4:1, RB5:1, RB6:1, RB7:1, RB8:1, RB9:1, RB10:1, RB11:1, RB12:1, RB13:1, RB14:1, RB15:1;
})
HOST_BITS(PORTC, { HOST_PORT_C(RC) })
HOST_BITS(LATA, { uint16_t LATA0:1, LATA1:1, LATA2:1, LATA3:1, LATA4:1; u(2); uint16_t LATA7:1, LATA8:1, LATA9:1, LATA10:1; u(5); })
HOST_BITS(LATC, { HOST_PORT_C(LATC) })
HOST_BITS(TRISC, { HOST_PORT_C(TRISC) })
#undef HOST_PORT_C

HOST_BITS(RPINR12, { uint16_t FLTA1R:5; u(11); })
HOST_BITS(RPINR18, { uint16_t U1RXR:5; u(3); uint16_t U1CTSR:5; u(3); })
#define HOST_RPOR(n, low, high) HOST_BITS(RPOR##n, { uint16_t RP##low##R:5; u(3); uint16_t RP##high##R:5; u(3); })
HOST_RPOR(0, 0, 1) HOST_RPOR(1, 2, 3) HOST_RPOR(2, 4, 5) HOST_RPOR(3, 6, 7) HOST_RPOR(4, 8, 9) HOST_RPOR(5, 10, 11) HOST_RPOR(6, 12, 13)
HOST_RPOR(7, 14, 15) HOST_RPOR(8, 16, 17) HOST_RPOR(9, 18, 19) HOST_RPOR(10, 20, 21) HOST_RPOR(11, 22, 23) HOST_RPOR(12, 24, 25)
#undef HOST_RPOR
#define HOST_CAPTURE(n) HOST_BITS(IC##n##CON, { uint16_t ICM:3, ICBNE:1, ICOV:1, ICI:2, ICTMR:1; u(5); uint16_t ICSIDL:1; u(2); })
HOST_CAPTURE(1) HOST_CAPTURE(2)
#undef HOST_CAPTURE
HOST_BITS(P1TCON, { uint16_t PTMOD:2, PTCKPS:2, PTOPS:4; u(5); uint16_t PTSIDL:1; u(1); uint16_t PTEN:1; })
HOST_BITS(P1TMR, { uint16_t PTMR:15, PTDIR:1; })
HOST_BITS(P1SECMP, { uint16_t SEVTCMP:15, SEVTDIR:1; })
HOST_BITS(PWM1CON1, {
    uint16_t PEN1L:1, PEN2L:1, PEN3L:1; u(1); uint16_t PEN1H:1, PEN2H:1, PEN3H:1; u(1); uint16_t PMOD1:1, PMOD2:1, PMOD3:1; u(5);
})
HOST_BITS(P1FLTACON, {
    uint16_t FAEN1:1, FAEN2:1, FAEN3:1; u(4); uint16_t FLTAM:1, FAOV1L:1, FAOV1H:1, FAOV2L:1, FAOV2H:1, FAOV3L:1, FAOV3H:1; u(2);
})
HOST_BITS(P1OVDCON, {
    uint16_t POUT1L:1, POUT1H:1, POUT2L:1, POUT2H:1, POUT3L:1, POUT3H:1; u(2); uint16_t POVD1L:1, POVD1H:1, POVD2L:1, POVD2H:1,
    POVD3L:1, POVD3H:1; u(2);
})
HOST_BITS(AD1CON1, {
    uint16_t DONE:1, SAMP:1, ASAM:1, SIMSAM:1; u(1); uint16_t SSRC:3, FORM:2, AD12B:1; u(2); uint16_t ADSIDL:1; u(1); uint16_t ADON:1;
})
HOST_BITS(U1STA, {
    uint16_t URXDA:1, OERR:1, FERR:1, PERR:1, RIDLE:1, ADDEN:1, URXISEL:2, TRMT:1, UTXBF:1, UTXEN:1, UTXBRK:1; u(1); uint16_t UTXISEL0:1,
    UTXINV:1, UTXISEL1:1;
})

#undef u
#undef HOST_BITS

/* The device's macros that tell code which part it is compiled for are deliberately absent: firmware tests __XC16__. */

#endif
