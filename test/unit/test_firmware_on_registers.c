/* The firmware on the host's registers, as any harness sees it: what firmware_init() leaves in every register, and a start by hand. */
#include "hurst_params.h"

#include "firmware/board/adc.c"
#include "firmware/board/clock.c"
#include "firmware/board/firmware.c"
#include "firmware/board/isr.c"
#include "firmware/board/pins.c"
#include "firmware/board/pwm.c"
#include "firmware/board/status.c"
#include "firmware/board/timer.c"
#include "firmware/board/uart.c"
#include "firmware/board/watch.c"

#include <string.h>

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
            _ADC1Interrupt();
        }
        IFS0bits.T1IF = 1;
        firmware_background();
        firmware_background();
    }
}

/* S2 down and up again, both for longer than it bounces. */
static void press_s2(void)
{
    PORTAbits.RA8 = 0;
    board_ms(40);
    PORTAbits.RA8 = 1;
    board_ms(10);
}

/** State, fault and override: 0 all off, 0x0015 the low sides, 0x3F00 PWM. */
static void expect(drive_state_t state, drive_fault_t fault, uint16_t override)
{
    TEST_ASSERT_EQUAL_UINT16(state, board_drive.state);
    TEST_ASSERT_EQUAL_UINT16(fault, board_drive.fault);
    TEST_ASSERT_EQUAL_HEX16(override, P1OVDCON);
}

/* Every register that the start changes, with its value from the device facts; the rest stays as it was. */
static const struct {
    const char *name;
    uint16_t value;
} expected[] = {
    { "CORCON", 0x0024 }, /* fractional, unsaturated; PSV: constants are read from flash */
    { "RCON", 0x0000 },   /* read once and cleared: the next reset has its own cause */
    { "OSCCON", 0x3360 }, /* crystal with PLL, locked; pin selection locked */
    { "PLLFBD", 38 },
    { "CLKDIV", 0x0000 },
    { "P1TCON", 0x8002 },
    { "P1TPER", 999 },
    { "P1SECMP", 0x8000 | 939 },
    { "PWM1CON1", 0x0077 },
    { "P1DTCON1", 0x0068 },
    { "P1FLTACON", 0x0087 },
    { "P1OVDCON", 0x0000 },
    { "AD1CON1", 0x836C },
    { "AD1CON2", 0x0200 },
    { "AD1CON3", 0x0002 },
    { "AD1CHS0", 0x0008 },
    { "AD1PCFGL", 0xFEF8 },
    { "RPINR12", 0x0008 }, /* FLTA1 on RP8 */
    { "RPINR18", 0x1F14 }, /* U1RX on RP20 */
    { "RPOR9", 0x0300 },   /* U1TX on RP19 */
    { "TRISA", 0xFFFF },
    { "TRISB", 0xFFFF },
    { "TRISC", 0xFF37 },
    { "IEC0", 0x2000 },    /* AD1IE */
    { "IEC3", 0x8000 },    /* FLTA1IE */
    { "IPC3", 0x0054 },    /* AD1IP 5 */
    { "IPC15", 0x5000 },   /* FLTA1IP 5 */
    { "T1CON", 0x8000 },
    { "PR1", 39999u },
    { "U1MODE", 0x8008 },
    { "U1STA", 0x0510 },   /* UTXEN */
    { "U1BRG", 86 },
};

void test_every_register_after_the_start(void)
{
    size_t n, k;
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
