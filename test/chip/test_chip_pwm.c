/* What the PWM module makes of its registers: period, duty, dead time, overrides, fault input, and the warnings about them. */
#include "fake_firmware.inc"

void setUp(void); /* both in fake_firmware.inc */
void tearDown(void);

void test_the_notes_settings_give_20_khz_2_us_and_no_warning(void)
{
    start(1000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 20000.0, get("pwm.frequency_hz"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2.0, get("pwm.dead_time_us"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5, get("pwm.duty1"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.05, get("time_s"));
    TEST_ASSERT_EQUAL_UINT(1000, fake_adc_calls);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(NULL, vb_warning(board, 0), "no warning expected");
}

void test_duties_load_at_the_start_of_the_next_period(void)
{
    start(3);
    set_duties(600, 1000, 1400);
    run(1); /* the handler of this period writes them */
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5, get("pwm.duty1"));
    run(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.3, get("pwm.duty1"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.7, get("pwm.duty3"));
}

static void change_duty_in_third_call(void)
{
    if (fake_adc_calls == 3) {
        fake_duty[0] = 600;
    }
}

void test_a_handler_acts_in_the_next_period_a_late_one_a_period_later(void)
{
    static const double isr_us[] = { 13.0, 30.0 }; /* trigger at 25 us, conversion 4.8 us */
    for (unsigned late = 0; late < 2; late++) {
        fake_restart();
        fake_adc_hook = change_duty_in_third_call;
        set("cpu.isr_us", isr_us[late]);
        start(3 + late);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5, get("pwm.duty1"));
        run(1);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.3, get("pwm.duty1"));
    }
}

void test_udis_holds_the_duties_back(void)
{
    start(3);
    set("reg.PWM1CON2", 1.0);
    set_duties(600, 1000, 1400);
    run(300);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5, get("pwm.duty1"));
    TEST_ASSERT_TRUE(warned_about("PWM1CON2"));
    set("reg.PWM1CON2", 0.0);
    run(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.3, get("pwm.duty1"));
}

static uint16_t seen_counter;

static void note_counter(void)
{
    seen_counter = P1TMR;
}

void test_the_handler_sees_the_counter_on_its_way_down(void)
{
    fake_adc_hook = note_counter;
    set("cpu.isr_us", 10.0);
    start(2);
    /* trigger at 25.025 us, 48 TAD of 100 ns, 10 us: 39.825 us = 1593 counts up and down again */
    TEST_ASSERT_TRUE((seen_counter & 0x8000u) != 0);
    TEST_ASSERT_UINT_WITHIN(1, 2000u - 1593u, seen_counter & 0x7FFFu);
}

void test_mean_terminal_voltage_follows_the_duties(void)
{
    make_ideal();
    at_init("P1DTCON1", 0); /* no dead time */
    run_blocked(5, 1500, 500, 500);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 24.0 * 0.5 * 2.0 / 3.0, get("plant.v_d")); /* rotor on phase A */
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.0, get("plant.v_q"));
}

void test_short_pulses_meet_the_dead_time(void)
{
    static const struct {
        uint16_t duty[3];
        unsigned seen;
    } row[] = {
        { { 2000, 0, 2400 }, 0x26 },   /* full and zero duty never switch */
        { { 60, 1000, 1000 }, 0x3D },  /* 1.5 us, shorter than the dead time */
        { { 100, 1000, 1000 }, 0x3F }, /* 2.5 us around the start of the period: on 2.1 us after its begin, off 0.15 us after its end */
    };
    for (unsigned n = 0; n < sizeof row / sizeof row[0]; n++) {
        fake_restart();
        set_duties(row[n].duty[0], row[n].duty[1], row[n].duty[2]);
        start(5);
        TEST_ASSERT_EQUAL_HEX(row[n].seen, (unsigned)get("pwm.outputs_seen"));
    }
}

void test_override_switches_everything_off_within_the_period(void)
{
    start(5);
    set("reg.P1OVDCON", 0.0);
    run(2);
    TEST_ASSERT_EQUAL_HEX(0, (unsigned)get("pwm.outputs_on"));
    TEST_ASSERT_EQUAL_HEX(0, (unsigned)get("pwm.outputs_seen"));
}

static void stop_in_handler(void)
{
    P1OVDCON = 0x0000;
}

void test_override_written_by_the_handler_acts_at_that_instant(void)
{
    start(5);
    fake_adc_hook = stop_in_handler;
    run(1);
    TEST_ASSERT_EQUAL_HEX(0, (unsigned)get("pwm.outputs_on"));
    TEST_ASSERT_TRUE(get("pwm.outputs_seen") > 0.0);
}

void test_synchronised_override_waits_for_the_next_period(void)
{
    power_up();
    set("reg.PWM1CON2", 2.0);
    run(5);
    fake_adc_hook = stop_in_handler;
    run(1);
    TEST_ASSERT_TRUE(get("pwm.outputs_on") > 0.0);
    run(1);
    TEST_ASSERT_EQUAL_HEX(0, (unsigned)get("pwm.outputs_on"));
}

void test_no_dead_time_shoots_through_trips_the_comparator_and_is_named(void)
{
    at_init("P1DTCON1", 0); /* no dead time */
    start(20);
    TEST_ASSERT_TRUE(warned_about("P1DTCON1"));
    TEST_ASSERT_TRUE(get("inverter.trip_count") > 0.0);
    set("inverter.trip_a", 0.0);
    start(20);
    TEST_ASSERT_TRUE(get("bus.current_a") > 1.0);
}

void test_fault_input_stops_the_outputs_and_lets_them_go_on_cycle_by_cycle(void)
{
    start(5);
    set("input.flta", 1.0);
    run(2);
    TEST_ASSERT_EQUAL_HEX(0, (unsigned)get("pwm.outputs_seen"));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, get("pin.RB8"));
    TEST_ASSERT_EQUAL_UINT(1, IFS3bits.FLTA1IF);
    set("input.flta", 0.0);
    run(2);
    TEST_ASSERT_TRUE(get("pwm.outputs_seen") > 0.0);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, get("pin.RB8"));
}

void test_latched_fault_holds_the_outputs_until_the_flag_is_cleared(void)
{
    at_init("P1FLTACON", 0x0007);
    start(5);
    set("input.flta", 1.0);
    run(2);
    set("input.flta", 0.0);
    run(20);
    TEST_ASSERT_EQUAL_HEX(0, (unsigned)get("pwm.outputs_seen"));
    IFS3bits.FLTA1IF = 0;
    run(2);
    TEST_ASSERT_TRUE(get("pwm.outputs_seen") > 0.0);
}

void test_fault_interrupt_is_served_once_per_edge(void)
{
    at_init("IEC3", 0x8000); /* FLTA1IE */
    start(5);
    set("input.flta", 1.0);
    run(10);
    TEST_ASSERT_EQUAL_UINT(1, fake_fault_calls);
    set("input.flta", 0.0);
    run(10);
    set("input.flta", 1.0);
    run(10);
    TEST_ASSERT_EQUAL_UINT(2, fake_fault_calls);
}

void test_a_disabled_fault_input_does_nothing_and_is_named(void)
{
    at_init("P1FLTACON", 0);
    power_up();
    set("input.flta", 1.0);
    run(5);
    TEST_ASSERT_TRUE(get("pwm.outputs_seen") > 0.0);
    TEST_ASSERT_TRUE(warned_about("P1FLTACON"));
}

void test_over_current_trips_within_the_period_and_ends_the_current(void)
{
    set("inverter.trip_a", 3.0);
    set("load.locked", 1.0);
    set_duties(2000, 0, 0); /* 6 A if nothing stops it */
    power_up();
    set("stat.reset", 1.0);
    run(400);
    TEST_ASSERT_TRUE(get("inverter.trip_count") >= 1.0);
    TEST_ASSERT_TRUE(get("stat.i_peak_a") < 3.2);
}

static void start_high(void)
{
    fake_duty[0] = 2000;
}

static void touch_fault_settings(void)
{
    P1FLTACON = (uint16_t)(P1FLTACON ^ 0x0080u); /* makes the board plan the rest of the period anew */
}

void test_a_write_that_changes_nothing_does_not_disturb_the_edges(void)
{
    double i_a[2];
    for (int k = 0; k < 2; k++) {
        fake_restart();
        fake_adc_hook = k == 1 ? touch_fault_settings : NULL;
        set("cpu.isr_us", 10.1); /* with two of the duties this falls into a dead time */
        set("load.locked", 1.0);
        set_duties(900, 880, 500);
        start(200);
        i_a[k] = get("plant.i_a");
    }
    TEST_ASSERT_EQUAL_DOUBLE(i_a[0], i_a[1]);
}

void test_legs_at_the_same_duty_leave_a_resting_motor_without_current(void)
{
    start(200); /* in every dead time all three terminals float at zero current */
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, get("stat.i_peak_a"));
}

void test_immediate_updates_act_in_the_same_period(void)
{
    at_init("PWM1CON2", 0x0004);
    set("cpu.isr_us", 0.0);
    set_duties(400, 400, 400);
    start(5);
    fake_adc_hook = start_high; /* at 28.6 us, while every low side is on */
    run(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.0, get("pwm.duty1"));
}

void test_double_update_mode_loads_in_the_middle_of_the_period_too(void)
{
    at_init("P1TCON", 0x8003);
    set("cpu.isr_us", 0.0);
    set_duties(400, 400, 400);
    start(5);
    set("reg.P1DC1", 1600.0);
    run(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.8, get("pwm.duty1"));
    TEST_ASSERT_TRUE(warned_about("P1TCON"));
}
