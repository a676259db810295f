/* The host's device header: start values, bit views, the clock switch, look-up by name. */
#define FAKE_OWN_SETUP
#include "fake_firmware.inc"

void tearDown(void);

void setUp(void)
{
    fake_setup();
    host_registers_reset();
}

void test_start_values_let_an_initialisation_pass_its_waits(void)
{
    TEST_ASSERT_EQUAL_UINT(3, OSCCONbits.COSC);
    TEST_ASSERT_EQUAL_UINT(1, OSCCONbits.LOCK);
    TEST_ASSERT_EQUAL_UINT(0, OSCCONbits.OSWEN);
    TEST_ASSERT_EQUAL_UINT(1, P1TMRbits.PTDIR);
    TEST_ASSERT_EQUAL_UINT(500, P1TMRbits.PTMR);
    TEST_ASSERT_EQUAL_UINT(1, U1STAbits.TRMT);
    TEST_ASSERT_EQUAL_UINT(0, U1STAbits.UTXBF);
    TEST_ASSERT_EQUAL_UINT(1, PORTAbits.RA8);
    TEST_ASSERT_EQUAL_UINT(1, PORTBbits.RB8);
    TEST_ASSERT_EQUAL_HEX16(0x0003, RCON);
}

void test_bit_views_sit_where_the_device_has_the_bits(void)
{
    P1TCONbits.PTEN = 1;
    TEST_ASSERT_EQUAL_HEX16(0x8000, P1TCON);
    PWM1CON1bits.PEN3H = 1;
    TEST_ASSERT_EQUAL_HEX16(0x0040, PWM1CON1);
    AD1CON1bits.FORM = 3;
    AD1CON1bits.SSRC = 3;
    AD1CON1bits.SIMSAM = 1;
    AD1CON1bits.ASAM = 1;
    TEST_ASSERT_EQUAL_HEX16(0x036C, AD1CON1);
    IFS0bits.AD1IF = 1;
    TEST_ASSERT_EQUAL_HEX16(0x2000, IFS0);
    IFS3bits.FLTA1IF = 1;
    IFS3bits.PWM1IF = 1;
    TEST_ASSERT_EQUAL_HEX16(0x8200, IFS3);
    IPC3bits.AD1IP = 6;
    TEST_ASSERT_EQUAL_HEX16(0x0064, IPC3);
    IPC15bits.FLTA1IP = 7;
    TEST_ASSERT_EQUAL_HEX16(0x7000, IPC15);
    P1OVDCONbits.POVD3H = 0;
    P1OVDCONbits.POUT1L = 1;
    TEST_ASSERT_EQUAL_HEX16(0x1F01, P1OVDCON);
    P1FLTACONbits.FLTAM = 1;
    TEST_ASSERT_EQUAL_HEX16(0x0080, P1FLTACON);
    P1SECMPbits.SEVTDIR = 1;
    TEST_ASSERT_EQUAL_HEX16(0x8000, P1SECMP);
    RPOR9bits.RP19R = 3;
    TEST_ASSERT_EQUAL_HEX16(0x0300, RPOR9);
    U1STAbits.UTXEN = 1;
    TEST_ASSERT_EQUAL_HEX16(0x0510, U1STA);
    CORCONbits.SATA = 1;
    TEST_ASSERT_EQUAL_HEX16(0x00A0, CORCON);
}

void test_a_clock_switch_completes_when_it_is_requested(void)
{
    __builtin_write_OSCCONH(0x02);
    TEST_ASSERT_EQUAL_HEX16(0x3220, OSCCON);
    __builtin_write_OSCCONL(OSCCON | 1);
    TEST_ASSERT_EQUAL_HEX16(0x2200, OSCCON); /* no PLL, no lock */
    __builtin_write_OSCCONH(0x03);
    __builtin_write_OSCCONL(OSCCON | 1);
    TEST_ASSERT_EQUAL_HEX16(0x3320, OSCCON);
}

void test_the_pin_lock_is_kept_and_read_only_bits_are_not_written(void)
{
    __builtin_write_OSCCONL(0x40);
    TEST_ASSERT_EQUAL_UINT(1, OSCCONbits.IOLOCK);
    __builtin_write_OSCCONL(0x08);
    TEST_ASSERT_EQUAL_UINT(0, OSCCONbits.IOLOCK);
    TEST_ASSERT_EQUAL_UINT(0, OSCCONbits.CF);
    TEST_ASSERT_EQUAL_UINT(1, OSCCONbits.LOCK);
}

void test_interrupts_can_be_masked_and_restored(void)
{
    unsigned saved = 0;
    SET_AND_SAVE_CPU_IPL(saved, 5);
    TEST_ASSERT_EQUAL_UINT(0, saved);
    TEST_ASSERT_EQUAL_UINT(5, SRbits.IPL);
    RESTORE_CPU_IPL(saved);
    __builtin_disable_interrupts();
    TEST_ASSERT_EQUAL_UINT(7, SRbits.IPL);
    __builtin_enable_interrupts();
    TEST_ASSERT_EQUAL_UINT(0, SRbits.IPL);
}

void test_registers_are_found_by_name(void)
{
    TEST_ASSERT_EQUAL_PTR(&P1DC3, host_sfr_find("P1DC3"));
    TEST_ASSERT_NULL(host_sfr_find("P1DC4"));
    TEST_ASSERT_NULL(host_sfr_find("p1dc3"));
}

void test_reset_restores_every_register(void)
{
    for (size_t n = 0; n < host_sfr_count; n++) {
        *host_sfr_table[n].pointer = 0x5AA5;
    }
    host_registers_reset();
    for (size_t n = 0; n < host_sfr_count; n++) {
        TEST_ASSERT_EQUAL_HEX16_MESSAGE(host_sfr_table[n].reset, *host_sfr_table[n].pointer, host_sfr_table[n].name);
    }
}

void test_a_clock_above_the_devices_limit_is_named(void)
{
    at_init("PLLFBD", 58);
    set("expect.fcy_hz", 0.0);
    start(1);
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 60e6, get("cpu.fcy_hz"));
    TEST_ASSERT_TRUE(warned_about("PLLFBD"));
}
