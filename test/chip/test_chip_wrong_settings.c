/* Settings: the effect that they have on silicon, and the registers that are named for wrong ones. */
#include "fake_firmware.inc"

void setUp(void); /* both in fake_firmware.inc */
void tearDown(void);

typedef struct {
    const char *what;
    struct {
        const char *name;
        uint16_t value;
    } set[2]; /* registers at the end of the initialisation */
    uint32_t periods;
    const char *named[2];
    struct {
        const char *key;
        double value, within;
    } seen[3]; /* after the periods; "calls": of the ADC handler */
} wrong_t;

static const wrong_t rows[] = {
    { "wrong PLL", { { "PLLFBD", 18 } }, 10, { "PLLFBD" },
      { { "cpu.fcy_hz", 20e6, 1.0 }, { "pwm.frequency_hz", 10000.0, 1e-6 }, { "pwm.dead_time_us", 4.0, 1e-9 } } },
    { "PLL outside its range", { { "PLLFBD", 78 }, { "CLKDIV", 0x001E } }, 1, { "CLKDIV", "PLLFBD" }, { { NULL, 0.0, 0.0 } } },
    { "fast RC oscillator", { { "OSCCON", 0x0020 } }, 1, { "OSCCON" }, { { "cpu.fcy_hz", 3.685e6, 1.0 } } },
    { "wrong period", { { "P1TPER", 1999 } }, 10, { "P1TPER" }, { { "pwm.frequency_hz", 10000.0, 1e-6 } } },
    { "edge-aligned mode", { { "P1TCON", 0x8000 }, { "P1SECMP", 500 } }, 10, { "P1TCON" }, { { "pwm.frequency_hz", 40000.0, 1e-6 } } },
    { "time base off", { { "P1TCON", 0x0002 } }, 500, { "P1TCON" },
      { { "pwm.outputs_seen", 0.0, 0.0 }, { "calls", 0.0, 0.0 }, { "time_s", 0.025, 1e-9 } } },
    { "both transistors on", { { "P1OVDCON", 0x003F } }, 2, { "P1OVDCON" }, { { "pwm.outputs_on", 0x2A, 0.0 } } },
    { "half of the outputs", { { "PWM1CON1", 0x0007 } }, 3, { "PWM1CON1" }, { { "pwm.outputs_seen", 0x15, 0.0 } } },
    { "fault input without a pin", { { "RPINR12", 0x001F } }, 5, { "RPINR12" }, { { "pwm.outputs_seen", 0.0, 0.0 } } },
    { "trigger beyond the period", { { "P1SECMP", 1500 } }, 10, { "P1SECMP" }, { { "calls", 0.0, 0.0 } } },
    { "ADC off", { { "AD1CON1", 0x036C } }, 200, { "AD1CON1" }, { { "calls", 0.0, 0.0 } } },
    { "interrupt disabled", { { "IEC0", 0 } }, 10, { "IEC0" }, { { "calls", 0.0, 0.0 }, { "reg.IFS0", 0x2000, 0.0 } } },
    { "priority zero", { { "IPC3", 0x0004 } }, 10, { "IPC3" }, { { "calls", 0.0, 0.0 } } },
    { "wrong inputs", { { "AD1CHS123", 1 } }, 6, { "AD1CHS123" }, { { NULL, 0.0, 0.0 } } },
    { "digital pins", { { "AD1PCFGL", 0xFFFF } }, 6, { "AD1PCFGL" }, { { "reg.ADC1BUF1", 0x8000, 0.0 } } },
    { "one channel", { { "AD1CON2", 0x0000 } }, 2, { "AD1CON2" }, { { "reg.ADC1BUF0", 0xC000, 0.0 }, { "reg.ADC1BUF3", 0.0, 0.0 } } },
    { "two sequences", { { "AD1CON2", 0x0204 } }, 10, { "AD1CON2" }, { { "calls", 5.0, 0.0 }, { "reg.ADC1BUF4", 0xC000, 0.0 } } },
    { "sequential sampling", { { "AD1CON1", 0x8364 } }, 2, { "AD1CON1" }, { { NULL, 0.0, 0.0 } } },
    { "conversions longer than the period", { { "AD1CON3", 63 } }, 100, { "AD1CON3" }, { { "calls", 50.0, 1.0 } } },
    { "all low sides on", { { "P1OVDCON", 0x0015 } }, 2, { NULL }, { { "pwm.outputs_on", 0x15, 0.0 }, { "pwm.outputs_seen", 0x15, 0.0 } } },
    { "special event postscaler", { { "PWM1CON2", 0x0100 } }, 100, { NULL }, { { "calls", 50.0, 0.0 } } },
    { "conversion clock too fast", { { "AD1CON3", 2 } }, 2, { "AD1CON3" }, { { NULL, 0.0, 0.0 } } },
};

void test_each_has_its_effect_and_is_named(void)
{
    for (const wrong_t *row = rows; row < rows + sizeof rows / sizeof rows[0]; row++) {
        fake_restart();
        for (unsigned n = 0; n < 2 && row->set[n].name != NULL; n++) {
            at_init(row->set[n].name, row->set[n].value);
        }
        set("adc.noise_lsb", 0.0);
        set("input.pot", 0.25);
        power_up();
        run(row->periods);
        for (unsigned n = 0; n < 3 && row->seen[n].key != NULL; n++) {
            double value = strcmp(row->seen[n].key, "calls") == 0 ? (double)fake_adc_calls : get(row->seen[n].key);
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(row->seen[n].within, row->seen[n].value, value, row->what);
        }
        for (unsigned n = 0; n < 2 && row->named[n] != NULL; n++) {
            TEST_ASSERT_TRUE_MESSAGE(warned_about(row->named[n]), row->what);
        }
        TEST_ASSERT_FALSE_MESSAGE(warned_about("AD1CHS0"), row->what); /* which nobody has touched */
    }
}
