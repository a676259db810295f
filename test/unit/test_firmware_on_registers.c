/* The firmware on the host's registers, as any harness sees it: what firmware_init() leaves in every register, and a start by hand. */
#include "hurst_params.h"

#include "firmware/board/peripherals.c"
#include "firmware/app/panel.c"
#include "firmware/board/application.c"
#include "firmware/board/firmware.c"
#include "firmware/board/isr.c"
#include "firmware/board/selftest_run.c"
#include "firmware/board/status.c"
#include "firmware/board/watch.c"

#include <string.h>

#include "interrupts.h"
#include "press_s2.h"
#include "unity.h"

static void bus_volts(float bus_v)
{
    ADC1BUF3 = (uint16_t)(int16_t)(bus_v / 52.8F * 65536.0F - 32768.0F);
}

void setUp(void)
{
    host_registers_reset();
    bus_volts(24.0F);
    firmware_init();
}

/** Milliseconds of a healthy board: 20 control interrupts, timer 1's flag, some passes of the loop. */
static void board_ms(uint16_t ms)
{
    while (ms-- != 0u) {
        uint16_t n;
        for (n = 0; n < 20u; n++) {
            ADC1BUF0 = (AD1CHS0 == 8u) ? 0x0000u : 0x8000u; /* the potentiometer in its middle; an input that is switched off */
            a_period();
        }
        IFS0bits.T1IF = 1;
        firmware_background();
        firmware_background();
    }
}

/** State, fault and override: 0 all off, 0x0015 the low sides, 0x3F00 PWM. */
static void expect(drive_state_t state, drive_fault_t fault, uint16_t override)
{
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_NONE, board_selftest_failed);
    TEST_ASSERT_EQUAL_UINT16(state, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(fault, board_drive.fault);
    TEST_ASSERT_EQUAL_HEX16(override, P1OVDCON);
}

/* Every register that the start writes, with its value from the device facts; the rest stays as it was. */
static const struct {
    const char *name;
    uint16_t value, whole; /* 1: all of it is written, whatever was there */
} expected[] = {
    { "CORCON", 0x0024, 1 },   /* fractional, unsaturated; PSV: constants are read from flash */
    { "RCON", 0x0000, 0 },     /* read once and cleared: the next reset has its own cause */
    { "OSCCON", 0x3360, 0 },   /* crystal with PLL, locked; pin selection locked */
    { "PLLFBD", 38, 1 },       /* times 40 */
    { "CLKDIV", 0x0000, 1 },   /* by 2 before and 2 after, no doze */
    { "OSCTUN", 0x0000, 1 },
    { "P1TCON", 0x8002, 1 },   /* on, centre-aligned */
    { "P1TPER", 999, 1 },      /* 20 kHz */
    { "P1SECMP", 0x8000 | 939, 1 }, /* the trigger is 1.5 us after the peak, counting down */
    { "PWM1CON1", 0x0077, 1 }, /* three complementary pairs */
    { "PWM1CON2", 0x0000, 1 },
    { "P1DTCON1", 0x0068, 1 }, /* 2 us: 40 counts of two clocks */
    { "P1DTCON2", 0x0000, 1 }, /* unit A everywhere */
    { "P1FLTACON", 0x0087, 1 }, /* the fault input switches all pairs inactive, every cycle */
    { "P1OVDCON", 0x0000, 1 }, { "P1DC1", 0, 1 }, { "P1DC2", 0, 1 }, { "P1DC3", 0, 1 },
    { "AD1CON1", 0x836C, 1 },  /* ADON, FORM 3: signed fractional, SSRC 3: started by the PWM, SIMSAM, ASAM: all channels at once */
    { "AD1CON2", 0x0200, 1 },  /* CHPS 2: four channels, SMPI 0: an interrupt after each conversion, supply as reference */
    { "AD1CON3", 0x0003, 1 },  /* 100 ns */
    { "AD1CHS0", 0x0008, 1 },  /* CH0 = AN8, the potentiometer */
    { "AD1CHS123", 0x0000, 1 }, /* CH1..3 = AN0..2, currents and bus, against ground */
    { "AD1CSSL", 0x0000, 1 },
    { "AD1PCFGL", 0xFEF8, 1 }, /* analogue: AN0, AN1, AN2, AN8, currents, bus and potentiometer */
    { "RPINR12", 0x0008, 0 },  /* FLTA1 on RP8 */
    { "RPINR18", 0x1F14, 0 },  /* U1RX on RP20 */
    { "RPOR9", 0x0300, 0 },    /* U1TX on RP19 */
    { "LATA", 0, 1 }, { "LATB", 0, 1 }, { "LATC", 0, 1 },
    { "TRISA", 0xFFFF, 1 }, { "TRISB", 0xFFFF, 1 }, { "TRISC", 0xFF37, 1 }, /* outputs: RC3 transmits, RC6 and RC7 are LEDs */
    { "IEC0", 0x2080, 0 },     /* AD1IE, T2IE */
    { "IPC1", 0x3440, 0 },     /* T2IP 3 */
    { "IEC3", 0x8000, 0 },     /* FLTA1IE */
    { "IPC3", 0x0054, 0 },     /* AD1IP 5 */
    { "IPC15", 0x3000, 0 },    /* FLTA1IP 3 */
    { "T1CON", 0x8000, 1 },    /* on, internal clock, no prescaler: a millisecond at 40 MIPS */
    { "PR1", 39999u, 1 }, { "TMR1", 0, 1 },
    { "U1MODE", 0x8008, 1 },   /* on, high-speed divider, 8 bits, no parity, one stop bit */
    { "U1STA", 0x0510, 0 },    /* UTXEN */
    { "U1BRG", 86, 1 },
};

void test_every_register_after_the_start(void)
{
    size_t n, k;
    host_registers_reset();
    bus_volts(24.0F);
    IFS0 = 0x2088; /* AD1IF, T1IF and T2IF, and FLTA1IF: cleared before they can interrupt */
    IFS3 = 0x8000;
    for (k = 0; k < sizeof expected / sizeof expected[0]; k++) {
        if (expected[k].whole) {
            *host_sfr_find(expected[k].name) = 0x5555;
        }
    }
    firmware_init();
    for (n = 0; n < host_sfr_count; n++) {
        uint16_t value = host_sfr_table[n].reset;
        for (k = 0; k < sizeof expected / sizeof expected[0]; k++) {
            if (strcmp(expected[k].name, host_sfr_table[n].name) == 0) {
                value = expected[k].value;
            }
        }
        if (host_sfr_table[n].pointer != &ADC1BUF3) {
            TEST_ASSERT_EQUAL_HEX16_MESSAGE(value, *host_sfr_table[n].pointer, host_sfr_table[n].name);
        }
    }
}

/* Written at the start, but not for good, or not to steer anything: the rest is read back by the self-test. */
static const char *const not_read_back[] = { "RCON", "P1OVDCON", "P1DC1", "P1DC2", "P1DC3", "LATA", "LATB", "LATC", "TMR1", "U1MODE", "U1STA", "U1BRG",
                                             "RPINR18", "RPOR9", "AD1CSSL" };

void test_every_register_of_the_start_is_read_back_by_the_self_test(void)
{
    for (size_t k = 0; k < sizeof expected / sizeof expected[0]; k++) {
        uint16_t found = 0;
        for (size_t n = 0; n < sizeof not_read_back / sizeof not_read_back[0]; n++) {
            found |= (uint16_t)(strcmp(expected[k].name, not_read_back[n]) == 0);
        }
        for (size_t n = 0; n < sizeof written / sizeof written[0]; n++) {
            found |= (uint16_t)(written[n].place == host_sfr_find(expected[k].name) && (expected[k].value & written[n].mask) == written[n].value);
        }
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(1, found, expected[k].name);
    }
}

void test_S2_leads_over_bootstrap_to_pwm_and_stops_and_nothing_else_does(void)
{
    uint16_t bootstrap_ms = 0;
    board_ms(2000);
    expect(DRIVE_STOPPED, FAULT_NONE, 0x0000);
    PORTAbits.RA8 = 0;
    board_ms(29);
    expect(DRIVE_STOPPED, FAULT_NONE, 0x0000);
    board_ms(1);
    PORTAbits.RA8 = 1;
    while (P1OVDCON != 0x3F00u && bootstrap_ms < 50u) {
        board_ms(1);
        bootstrap_ms++;
    }
    TEST_ASSERT_UINT16_WITHIN(1, 11, bootstrap_ms);
    TEST_ASSERT_TRUE(P1DC1 != 0u || P1DC2 != 0u || P1DC3 != 0u);
    PORTBbits.RB4 = 0; /* S3 changes the range of a running motor */
    board_ms(29);
    TEST_ASSERT_EQUAL_INT16(0, app_panel.fast_range);
    board_ms(1);
    TEST_ASSERT_EQUAL_INT16(1, app_panel.fast_range);
    PORTAbits.RA8 = 0; /* and S2 again stops */
    board_ms(31);
    expect(DRIVE_STOPPED, FAULT_NONE, 0x0000);
}

void test_fault_is_cleared_by_S2_once_its_input_is_high_and_a_second_press_starts(void)
{
    board_ms(100);
    PORTBbits.RB8 = 0; /* its beginning alone makes an interrupt */
    _FLTA1Interrupt();
    press_s2();
    expect(DRIVE_FAULT, FAULT_OVERCURRENT_HW, 0x0000);
    PORTBbits.RB8 = 1;
    press_s2();
    expect(DRIVE_STOPPED, FAULT_NONE, 0x0000);
    PORTAbits.RA8 = 0;
    board_ms(35);
    expect(DRIVE_BOOTSTRAP, FAULT_NONE, 0x0015);
}

void test_silent_converter_is_found_through_timer_1(void)
{
    board_ms(100);
    PORTAbits.RA8 = 0;
    board_ms(60);
    IFS0bits.T1IF = 1;
    firmware_background();
    expect(DRIVE_ALIGN, FAULT_NONE, 0x3F00);
    IFS0bits.T1IF = 1;
    firmware_background();
    expect(DRIVE_FAULT, FAULT_ADC_LOST, 0x0000);
}

void test_second_start_of_the_firmware_begins_anew(void)
{
    board_ms(100);
    PORTAbits.RA8 = 0;
    board_ms(60);
    expect(DRIVE_ALIGN, FAULT_NONE, 0x3F00);
    firmware_init();
    expect(DRIVE_CALIBRATE, FAULT_NONE, 0x0000);
    TEST_ASSERT_EQUAL_INT16(0, board_drive.calibration.done);
}
