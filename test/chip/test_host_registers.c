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

#define EXPECT_VIEW(name, field, value, expected) \
    name##bits.field = (value); \
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(expected, name, #name "bits." #field)

void test_bit_views_sit_where_the_device_has_the_bits(void)
{
    EXPECT_VIEW(P1TCON, PTEN, 1, 0x8000);
    EXPECT_VIEW(PWM1CON1, PEN3H, 1, 0x0040);
    EXPECT_VIEW(AD1CON1, FORM, 3, 0x0300);
    EXPECT_VIEW(AD1CON1, SSRC, 3, 0x0360);
    EXPECT_VIEW(AD1CON1, SIMSAM, 1, 0x0368);
    EXPECT_VIEW(AD1CON1, ASAM, 1, 0x036C);
    EXPECT_VIEW(IFS0, AD1IF, 1, 0x2000);
    EXPECT_VIEW(IFS3, FLTA1IF, 1, 0x8000);
    EXPECT_VIEW(IFS3, PWM1IF, 1, 0x8200);
    EXPECT_VIEW(IPC1, T2IP, 3, 0x3440);
    EXPECT_VIEW(IPC3, AD1IP, 6, 0x0064);
    EXPECT_VIEW(IPC15, FLTA1IP, 7, 0x7000);
    EXPECT_VIEW(P1OVDCON, POVD3H, 0, 0x1F00);
    EXPECT_VIEW(P1OVDCON, POUT1L, 1, 0x1F01);
    EXPECT_VIEW(P1FLTACON, FLTAM, 1, 0x0080);
    EXPECT_VIEW(P1SECMP, SEVTDIR, 1, 0x8000);
    EXPECT_VIEW(RPOR9, RP19R, 3, 0x0300);
    EXPECT_VIEW(U1STA, UTXEN, 1, 0x0510);
    EXPECT_VIEW(CORCON, SATA, 1, 0x00A0);
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
