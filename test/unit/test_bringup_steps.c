/* BRINGUP's steps one by one: what each says of a right board, and what it finds on a wrong one. */
/* defines: -DBRINGUP */
#include "hurst_params.h"

#include "law.c"
#include "bringup_rig.h"

#include "drive/request.h"

void setUp(void)
{
    bringup_reset();
}

void test_buttons(void)
{
    static const struct {
        const char *what;
        uint16_t begin, s3;
        bringup_finding_t finding;
        bringup_step_t step; /* where it goes on */
    } cases[] = {
        { "right", 2, 3, BRINGUP_FINDINGS, BRINGUP_STEP_UART },
        { "swapped", 3, 2, BRINGUP_BUTTONS_SWAPPED, BRINGUP_STEP_UART },
        { "S3 acts as S2", 2, 2, BRINGUP_BUTTON_DEAD, BRINGUP_STEP_END },
        { "S2 acts as S3", 3, 3, BRINGUP_BUTTON_DEAD, BRINGUP_STEP_END },
    };
    EACH(n, cases) {
        setUp();
        no_answer = BRINGUP_ASK_UART;
        answers[BRINGUP_ASK_BEGIN] = cases[n].begin;
        answers[BRINGUP_ASK_S3] = cases[n].s3;
        until(cases[n].step);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].step, guide.step, cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].finding != BRINGUP_FINDINGS, found(cases[n].finding), cases[n].what);
    }
}

void test_swapped_buttons_count_by_the_names_on_them(void)
{
    answers[BRINGUP_ASK_BEGIN] = 3; /* S2, at the pin of S3 */
    answers[BRINGUP_ASK_S3] = 2;
    answers[BRINGUP_ASK_UART] = 3;
    until(BRINGUP_STEP_LED_ALIVE);
    TEST_ASSERT_EQUAL_UINT16(0, guide.sender); /* S2: yes */
    TEST_ASSERT_FALSE(found(BRINGUP_UART_PIN));
}

void test_a_button_that_is_down_at_rest_ends_it(void)
{
    inputs.s3_down = 1;
    inputs.elapsed_ms = 1;
    the_lights = bringup_pass(&guide, &drive, &params, &inputs, pot);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_BUTTON_DOWN, guide.message.code);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_LAST, guide.step);
}

void test_the_first_line_comes_by_both_pins_in_turn(void)
{
    no_answer = BRINGUP_ASK_BEGIN;
    ms(2500);
    TEST_ASSERT_EQUAL_UINT16(3, said_count);
    TEST_ASSERT_EQUAL_UINT16(0, said[0].part);
    TEST_ASSERT_EQUAL_UINT16(1, said[1].part);
    TEST_ASSERT_EQUAL_UINT16(0, said[2].part);
}

void test_potentiometer(void)
{
    static const struct {
        int16_t left, right;
        bringup_finding_t finding;
    } cases[] = { { -32768, 32704, BRINGUP_FINDINGS }, { -27000, 27000, BRINGUP_FINDINGS }, { 32704, -32768, BRINGUP_POT_REVERSED },
                  { 0, 1000, BRINGUP_POT_DEAD }, { -32768, -22000, BRINGUP_POT_RANGE }, { -20000, 32704, BRINGUP_POT_RANGE },
                  { -32768, 20000, BRINGUP_POT_RANGE } };
    EACH(n, cases) {
        setUp();
        pot_ends[0] = cases[n].left;
        pot_ends[1] = cases[n].right;
        until(BRINGUP_STEP_FAULT_REST);
        TEST_ASSERT_EQUAL_UINT16(cases[n].finding != BRINGUP_FINDINGS, guide.found);
        TEST_ASSERT_EQUAL_UINT16(cases[n].finding != BRINGUP_FINDINGS, found(cases[n].finding));
    }
}

void test_the_potentiometers_ends_may_be_a_tenth_off(void)
{
    until(BRINGUP_STEP_FAULT_REST);
    TEST_ASSERT_EQUAL_INT32(10, line_of(BRINGUP_TELLS, BRINGUP_VALUE_POT_LEFT)->high);
    TEST_ASSERT_EQUAL_INT32(90, line_of(BRINGUP_TELLS, BRINGUP_VALUE_POT_RIGHT)->low);
}

void test_nobody_presses_s3(void)
{
    no_answer = BRINGUP_ASK_S3;
    until(BRINGUP_STEP_S3);
    ms(100);
    guide.waited_ms = BUTTON_MS - 5u;
    ms(2);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_S3, guide.step);
    ms(10);
    TEST_ASSERT_TRUE(found(BRINGUP_BUTTON_DEAD));
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_END, guide.step);
}

void test_a_button_counts_as_down_at_rest_for_the_first_tenth_of_a_second(void)
{
    no_answer = BRINGUP_ASK_BEGIN;
    ms(REST_MS - 5u);
    pressed = 2;
    press_ms = PRESS_MS;
    ms(10);
    TEST_ASSERT_TRUE(found(BRINGUP_BUTTON_DOWN));
}

void test_leds(void)
{
    static const struct {
        const char *what;
        uint16_t alive, run, other; /* answers */
        bringup_finding_t finding;
        uint16_t asks_run;
    } cases[] = {
        { "right", 2, 2, 2, BRINGUP_FINDINGS, 1 },
        { "swapped", 3, 2, 2, BRINGUP_LEDS_SWAPPED, 0 },
        { "ALIVE dark", 3, 2, 3, BRINGUP_LED_DARK, 1 },
        { "RUN dark", 2, 3, 3, BRINGUP_LED_DARK, 1 },
    };
    EACH(n, cases) {
        setUp();
        answers[BRINGUP_ASK_LED_ALIVE] = cases[n].alive;
        answers[BRINGUP_ASK_LED_RUN] = cases[n].run;
        answers[BRINGUP_ASK_LED_OTHER] = cases[n].other;
        until(BRINGUP_STEP_POT_LEFT);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(BRINGUP_STEP_POT_LEFT, guide.step, cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].finding != BRINGUP_FINDINGS, guide.found, cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].finding != BRINGUP_FINDINGS, found(cases[n].finding), cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].asks_run, asked(BRINGUP_ASK_LED_RUN), cases[n].what);
    }
}

void test_the_led_that_is_asked_for_is_lit_alone(void)
{
    until(BRINGUP_STEP_LED_ALIVE);
    TEST_ASSERT_EQUAL_UINT16(1, the_lights.led_alive);
    TEST_ASSERT_EQUAL_UINT16(0, the_lights.led_run);
    until(BRINGUP_STEP_LED_RUN);
    TEST_ASSERT_EQUAL_UINT16(0, the_lights.led_alive);
    TEST_ASSERT_EQUAL_UINT16(1, the_lights.led_run);
}

void test_the_bus_may_be_a_tenth_off(void)
{
    static const struct {
        float bus_v;
        uint16_t found;
    } cases[] = { { 21.4F, 1 }, { 21.8F, 0 }, { 24.0F, 0 }, { 26.2F, 0 }, { 26.6F, 1 } };
    EACH(n, cases) {
        setUp();
        rig_bus(cases[n].bus_v);
        until(BRINGUP_STEP_FAULT_REST);
        TEST_ASSERT_EQUAL_UINT16(cases[n].found, found(BRINGUP_BUS_DIVIDER));
        TEST_ASSERT_INT32_WITHIN(5, (int32_t)(100.0F * cases[n].bus_v), line_of(BRINGUP_TELLS, BRINGUP_VALUE_BUS)->value);
    }
}

/** The line after the first one of a value: signal B's. */
static const bringup_message_t *of_b(const bringup_message_t *a)
{
    TEST_ASSERT_EQUAL_UINT16(0, a[0].part);
    TEST_ASSERT_EQUAL_UINT16(1, a[2].part);
    TEST_ASSERT_EQUAL_UINT16(a[0].code, a[2].code);
    return &a[2];
}

void test_offset_and_noise_of_each_signal_are_its_own(void)
{
    const bringup_message_t *offset, *noise;
    rest_a_q13 = 500;
    rest_b_q13 = -300;
    noise_b_q13 = 40;
    until(BRINGUP_STEP_BUS);
    rest_a_q13 = 600; /* after the calibration: both count */
    until(BRINGUP_STEP_FAULT_REST);
    offset = line_of(BRINGUP_TELLS, BRINGUP_VALUE_OFFSET);
    noise = line_of(BRINGUP_TELLS, BRINGUP_VALUE_NOISE);
    TEST_ASSERT_INT32_WITHIN(3, bringup_ma(600), offset->value);
    TEST_ASSERT_INT32_WITHIN(3, bringup_ma(-300), of_b(offset)->value);
    TEST_ASSERT_INT32_WITHIN(2, 0, noise->value);
    TEST_ASSERT_INT32_WITHIN(2, bringup_ma(40), of_b(noise)->value);
    TEST_ASSERT_EQUAL_UINT16(0, guide.found);
}

void test_a_noisy_signal_is_found_and_the_rest_goes_on(void)
{
    noise_b_q13 = 60;
    until(BRINGUP_STEP_DRIVE);
    TEST_ASSERT_EQUAL_UINT16(1, guide.found);
    TEST_ASSERT_EQUAL_UINT16(1, line_of(BRINGUP_FINDS, BRINGUP_NOISE)->part);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_DRIVE, guide.step);
}

void test_an_offset_far_off_keeps_the_current_away(void)
{
    rest_b_q13 = -1100;
    until(BRINGUP_STEP_END);
    TEST_ASSERT_EQUAL_UINT16(1, line_of(BRINGUP_FINDS, BRINGUP_OFFSET)->part);
    TEST_ASSERT_FALSE(asked(BRINGUP_ASK_CURRENT));
}

void test_the_fault_input(void)
{
    static const struct {
        const char *what;
        uint16_t answer, reacts, stays;
        bringup_finding_t finding;
        bringup_step_t step;
    } cases[] = {
        { "right", 2, 1, 0, BRINGUP_FINDINGS, BRINGUP_STEP_CURRENT },
        { "skipped", 3, 0, 0, BRINGUP_FINDINGS, BRINGUP_STEP_CURRENT },
        { "dead", 2, 0, 0, BRINGUP_FAULT_DEAD, BRINGUP_STEP_END },
        { "stays low", 2, 1, 1, BRINGUP_FAULT_LOW, BRINGUP_STEP_END },
    };
    EACH(n, cases) {
        setUp();
        no_answer = BRINGUP_ASK_CURRENT;
        answers[BRINGUP_ASK_FAULT_INPUT] = cases[n].answer;
        until(BRINGUP_STEP_FAULT_INPUT);
        fault_input_low = cases[n].reacts;
        until(cases[n].reacts ? BRINGUP_STEP_FAULT_OPEN : cases[n].step);
        fault_input_low = cases[n].stays;
        until(cases[n].step);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].step, guide.step, cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].finding != BRINGUP_FINDINGS, guide.found, cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].finding != BRINGUP_FINDINGS, found(cases[n].finding), cases[n].what);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].stays ? FAULT_OVERCURRENT_HW : FAULT_NONE, drive.fault, cases[n].what);
    }
}

void test_a_fault_input_that_is_low_at_rest_ends_it(void)
{
    fault_input_low = 1;
    until(BRINGUP_STEP_END);
    TEST_ASSERT_TRUE(found(BRINGUP_FAULT_LOW));
    TEST_ASSERT_FALSE(asked(BRINGUP_ASK_FAULT_INPUT));
}

void test_a_fault_input_may_come_back_slowly(void)
{
    until(BRINGUP_STEP_FAULT_REST);
    ms(CLEAR_MS - 50u); /* a clear averages the offsets before anything can trip again */
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    ms(60);
    TEST_ASSERT_TRUE(found(BRINGUP_FAULT_LOW));
}

void test_a_fault_is_waited_for_the_whole_time_from_its_clear(void)
{
    uint16_t n = 0;
    until(BRINGUP_STEP_FAULT_REST);
    bringup_go(&guide, BRINGUP_STEP_FAULT_REST);
    guide.waited_ms = 77; /* before the clear */
    ms(1);
    while (guide.step == (uint16_t)BRINGUP_STEP_FAULT_REST && n < 1000u) {
        ms(1);
        n++;
    }
    TEST_ASSERT_EQUAL_UINT16(CLEAR_MS, n);
}

void test_a_bridge_that_will_not_start_ends_it(void)
{
    until(BRINGUP_STEP_CURRENT);
    drive_raise(&drive, FAULT_UNDERVOLTAGE);
    bringup_go(&guide, BRINGUP_STEP_DRIVE);
    ms(START_MS + 10u);
    TEST_ASSERT_EQUAL_INT32(FAULT_UNDERVOLTAGE, line_of(BRINGUP_FINDS, BRINGUP_FAULT)->value);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_END, guide.step);
}

void test_a_measurement_begins_after_its_wait(void)
{
    rig_ready();
    rig_currents(100, -50);
    bringup_measure(&drive, 5);
    rig_tick(5);
    TEST_ASSERT_EQUAL_INT32(0, drive.run.bringup.sum_a);
    rig_tick(SUM_PERIODS - 1u);
    TEST_ASSERT_FALSE(drive.run.bringup.ready);
    rig_tick(1);
    TEST_ASSERT_TRUE(drive.run.bringup.ready);
    TEST_ASSERT_EQUAL_INT16(100, bringup_mean_of(drive.run.bringup.sum_a));
    TEST_ASSERT_EQUAL_INT16(-50, bringup_mean_of(drive.run.bringup.sum_b));
}

void test_no_current_flows_with_a_fault_or_without_leave(void)
{
    no_answer = BRINGUP_ASK_CURRENT;
    until(BRINGUP_STEP_CURRENT);
    drive_raise(&drive, FAULT_UNDERVOLTAGE);
    guide.button = 2;
    ms(10);
    TEST_ASSERT_EQUAL_INT32(FAULT_UNDERVOLTAGE, line_of(BRINGUP_FINDS, BRINGUP_FAULT)->value);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_END, guide.step);
    setUp();
    answers[BRINGUP_ASK_CURRENT] = 3;
    until(BRINGUP_STEP_END);
    TEST_ASSERT_EQUAL_INT16(0, carried_most_q13);
    TEST_ASSERT_EQUAL_UINT16(0, guide.found);
}

void test_six_directions_are_shown_with_voltage_and_both_currents(void)
{
    static const int16_t shares[BRINGUP_DIRECTIONS][2] = { { 2, -1 }, { 1, 1 }, { -1, 2 }, { -2, 1 }, { -1, -1 }, { 1, -2 } };
    uint16_t n;
    until(BRINGUP_STEP_SHOW);
    TEST_ASSERT_FALSE(drive_is_running(&drive));
    TEST_ASSERT_INT16_WITHIN(guide.full.a[0] / 8, guide.full.a[0] / 2, guide.half.a[0]);
    until(BRINGUP_STEP_AMMETER);
    for (n = 0; n < BRINGUP_DIRECTIONS; n++) {
        const bringup_message_t *m = line_of(BRINGUP_SHOWS, n);
        int32_t sum_ma = qm_abs((int16_t)m->low) + qm_abs((int16_t)m->high), unit_ma = sum_ma / ((n % 3u == 1u) ? 2 : 3), along_ma = 2 * unit_ma;
        TEST_ASSERT_INT32_WITHIN(60, bringup_ma(BRINGUP_FULL_Q13), sum_ma);
        TEST_ASSERT_INT32_WITHIN(15, shares[n][0] * unit_ma, m->low);
        TEST_ASSERT_INT32_WITHIN(15, shares[n][1] * unit_ma, m->high);
        TEST_ASSERT_INT32_WITHIN(8, (int32_t)(0.1F * rs_ohm * (float)along_ma) + 128, m->value); /* and 4/3 of 0.96 V */
    }
}

void test_the_six_directions_are_sixths_of_a_turn(void)
{
    uint16_t seen = 0;
    until(BRINGUP_STEP_DRIVE);
    for (uint16_t n = 0; n < 20000u && guide.step == (uint16_t)BRINGUP_STEP_DRIVE; n++) {
        ms(1);
        if (guide.step == (uint16_t)BRINGUP_STEP_DRIVE && guide.phase >= 2u) {
            TEST_ASSERT_EQUAL_UINT16((guide.index * 65536ul + 3u) / 6u, drive.run.bringup.angle);
            seen |= (uint16_t)(1u << guide.index);
        }
    }
    TEST_ASSERT_EQUAL_HEX16(0x3F, seen);
}

void test_what_is_measured_of_a_right_bridge(void)
{
    until(BRINGUP_STEP_DIRECTION);
    TEST_ASSERT_EQUAL_UINT16(0, guide.found);
    TEST_ASSERT_INT32_WITHIN(2, 100, line_of(BRINGUP_TELLS, BRINGUP_VALUE_RATIO)->value);
    TEST_ASSERT_INT32_WITHIN(130, 2670, line_of(BRINGUP_TELLS, BRINGUP_VALUE_RESISTANCE)->value);
    TEST_ASSERT_INT32_WITHIN(100, 2000, line_of(BRINGUP_TELLS, BRINGUP_VALUE_DEAD_TIME)->value);
    TEST_ASSERT_INT32_WITHIN(30, bringup_ma(BRINGUP_FULL_Q13) * 2 / 3, line_of(BRINGUP_ASKS, BRINGUP_ASK_AMMETER)->value);
}

void test_each_answer_of_the_wiring_is_its_finding(void)
{
    static const struct {
        bringup_wiring_t wiring; /* dead, legs, inverted, open, high, low */
        bringup_finding_t finding;
        uint16_t part;
        bringup_step_t step;
    } cases[] = {
        { { 0, { 0, 1 }, 0, 0, 0, 0 }, BRINGUP_FINDINGS, 0, BRINGUP_STEP_AMMETER },
        { { 1, { 0, 1 }, 0, 0, 0, 0 }, BRINGUP_CURRENT_DEAD, 0, BRINGUP_STEP_END },
        { { 2, { 0, 1 }, 0, 0, 0, 0 }, BRINGUP_CURRENT_DEAD, 1, BRINGUP_STEP_END },
        { { 0, { 0, 1 }, 1, 0, 0, 0 }, BRINGUP_SHUNT_INVERTED, 0, BRINGUP_STEP_AMMETER },
        { { 0, { 0, 1 }, 2, 0, 0, 0 }, BRINGUP_SHUNT_INVERTED, 1, BRINGUP_STEP_AMMETER },
        { { 0, { 0, 1 }, 0, 4, 0, 0 }, BRINGUP_PHASE_OPEN, 2, BRINGUP_STEP_END },
        { { 0, { 0, 1 }, 0, 7, 0, 0 }, BRINGUP_NO_CURRENT, 0, BRINGUP_STEP_END },
        { { 0, { 0, 1 }, 0, 0, 4, 0 }, BRINGUP_HIGH_SIDE, 2, BRINGUP_STEP_END },
        { { 0, { 0, 1 }, 0, 0, 0, 2 }, BRINGUP_LOW_SIDE, 1, BRINGUP_STEP_END },
        { { 0, { 1, 0 }, 0, 0, 0, 0 }, BRINGUP_CURRENTS_SWAPPED, 0, BRINGUP_STEP_AMMETER },
        { { 0, { 2, 1 }, 0, 0, 0, 0 }, BRINGUP_DRIVER_SWAPPED, 0, BRINGUP_STEP_AMMETER },
        { { 0, { 0, 2 }, 0, 0, 0, 0 }, BRINGUP_DRIVER_SWAPPED, 1, BRINGUP_STEP_AMMETER },
        { { 0, { 1, 2 }, 0, 0, 0, 0 }, BRINGUP_CURRENTS_MIXED, 0, BRINGUP_STEP_AMMETER },
        { { 0, { 2, 0 }, 0, 0, 0, 0 }, BRINGUP_CURRENTS_MIXED, 0, BRINGUP_STEP_AMMETER },
        { { 0, { 0, 0 }, 0, 0, 0, 0 }, BRINGUP_CURRENTS_MIXED, 0, BRINGUP_STEP_END },
    };
    until(BRINGUP_STEP_WIRING);
    EACH(n, cases) {
        said_count = 0;
        guide.found = 0;
        guide.wiring = cases[n].wiring;
        bringup_go(&guide, BRINGUP_STEP_WIRING);
        until(cases[n].step);
        TEST_ASSERT_EQUAL_UINT16(cases[n].step, guide.step);
        TEST_ASSERT_EQUAL_UINT16(cases[n].finding != BRINGUP_FINDINGS, guide.found);
        if (cases[n].finding != BRINGUP_FINDINGS) {
            TEST_ASSERT_TRUE(found(cases[n].finding));
            TEST_ASSERT_EQUAL_UINT16(cases[n].part, line_of(BRINGUP_FINDS, (uint16_t)cases[n].finding)->part);
        }
        TEST_ASSERT_EQUAL_UINT16(cases[n].step != BRINGUP_STEP_END, line_of(BRINGUP_TELLS, BRINGUP_VALUE_DEAD_TIME) != 0);
    }
}

void test_dead_time_may_be_a_quarter_off(void)
{
    static const struct {
        uint16_t ns, found;
    } cases[] = { { 1450, 1 }, { 1550, 0 }, { 2600, 0 }, { 2700, 1 } };
    EACH(n, cases) {
        bringup_go(&guide, BRINGUP_STEP_BRIDGE);
        said_count = 0;
        guide.index = 2;
        guide.bridge.dead_time_ns = cases[n].ns;
        ms(5);
        TEST_ASSERT_EQUAL_UINT16(cases[n].found, found(BRINGUP_DEAD_TIME));
    }
}

void test_ammeter_ratio_and_resistance_tell_which_gain_is_wrong(void)
{
    static const struct {
        uint16_t yes, percent, mohm;
        bringup_finding_t finding;
        uint16_t part;
    } cases[] = {
        { 1, 100, 2670, BRINGUP_FINDINGS, 0 },
        { 1, 88, 2670, BRINGUP_FINDINGS, 0 },
        { 1, 114, 2670, BRINGUP_FINDINGS, 0 },
        { 1, 87, 2670, BRINGUP_SHUNT_GAIN, 1 },
        { 1, 115, 2670, BRINGUP_SHUNT_GAIN, 1 },
        { 0, 50, 2670, BRINGUP_SHUNT_GAIN, 0 },
        { 0, 100, 2670, BRINGUP_SHUNT_GAINS, 0 },
        { 1, 100, 1800, BRINGUP_RESISTANCE, 0 },
        { 1, 100, 4200, BRINGUP_RESISTANCE, 0 },
        { 1, 100, 1900, BRINGUP_FINDINGS, 0 },
        { 1, 100, 4050, BRINGUP_FINDINGS, 0 },
    };
    EACH(n, cases) {
        guide.found = 0;
        guide.yes = cases[n].yes;
        guide.bridge.b_percent_of_a = cases[n].percent;
        guide.bridge.resistance_mohm = cases[n].mohm;
        bringup_step_gains(&guide);
        TEST_ASSERT_EQUAL_UINT16(cases[n].finding != BRINGUP_FINDINGS, guide.found);
        if (guide.found != 0u) {
            TEST_ASSERT_EQUAL_UINT16(cases[n].finding, guide.message.code);
            TEST_ASSERT_EQUAL_UINT16(cases[n].part, guide.message.part);
        }
        TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_DIRECTION, guide.step);
    }
}

void test_the_ammeter_has_its_say(void)
{
    answers[BRINGUP_ASK_AMMETER] = 3;
    until(BRINGUP_STEP_DIRECTION);
    TEST_ASSERT_EQUAL_UINT16(1, guide.found);
    TEST_ASSERT_TRUE(found(BRINGUP_SHUNT_GAINS));
}

void test_nobody_looks_at_an_ammeter_where_signal_a_is_not_in_wire_a(void)
{
    until(BRINGUP_STEP_AMMETER);
    guide.wiring.leg[0] = 1;
    guide.wiring.leg[1] = 0;
    until(BRINGUP_STEP_DIRECTION);
    TEST_ASSERT_FALSE(asked(BRINGUP_ASK_AMMETER));
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_DIRECTION, guide.step);
}

void test_the_user_tells_the_direction(void)
{
    uint16_t answer;
    for (answer = 2; answer <= 3u; answer++) {
        setUp();
        answers[BRINGUP_ASK_DIRECTION] = answer;
        until(BRINGUP_STEP_MARK);
        TEST_ASSERT_EQUAL_UINT16(answer == 3u, found(BRINGUP_DIRECTION));
        TEST_ASSERT_EQUAL_INT16(BRINGUP_MOST_AMPLITUDE, drive.run.bringup.most); /* dead time takes more at other angles */
    }
}

void test_the_field_stands_while_the_shaft_is_marked_and_keeps_its_current_while_it_turns(void)
{
    uint16_t turns;
    no_answer = BRINGUP_ASK_MARK;
    until(BRINGUP_STEP_MARK);
    TEST_ASSERT_NOT_EQUAL(0, drive.run.bringup.turn_q32);
    ms(500); /* the turn's end */
    TEST_ASSERT_EQUAL_UINT32(0, drive.run.bringup.turn_q32);
    turns = drive.run.bringup.turns;
    TEST_ASSERT_NOT_EQUAL(0, turns);
    ms(2100);
    TEST_ASSERT_EQUAL_UINT16(turns, drive.run.bringup.turns);
    TEST_ASSERT_EQUAL_UINT32(0, drive.run.bringup.turn_q32);
    TEST_ASSERT_INT16_WITHIN(BRINGUP_FULL_Q13 / 8, BRINGUP_FULL_Q13, (int16_t)(drive.run.bringup.carried_q21 >> 8));
    guide.button = 2;
    no_answer = BRINGUP_ASK_TURNS;
    ms(100);
    TEST_ASSERT_EQUAL_UINT16(0, drive.run.bringup.turns);
    ms(800); /* a pause and a turn */
    TEST_ASSERT_EQUAL_UINT16(1, drive.run.bringup.turns);
    TEST_ASSERT_TRUE(drive.run.bringup.amplitude > guide.half.amplitude[0]);
}

void test_electrical_turns_of_a_turn_of_the_shaft(void)
{
    static const struct {
        uint16_t turns, button;
        bringup_finding_t finding;
    } cases[] = { { NOPOLESPAIRS, 2, BRINGUP_FINDINGS }, { NOPOLESPAIRS - 1, 2, BRINGUP_POLE_PAIRS }, { NOPOLESPAIRS + 1, 2, BRINGUP_POLE_PAIRS },
                  { 4, 3, BRINGUP_STANDS } };
    EACH(n, cases) {
        setUp();
        no_answer = BRINGUP_ASK_TURNS;
        until(BRINGUP_STEP_TURNS);
        ms(10);
        drive.run.bringup.turns = cases[n].turns;
        guide.button = cases[n].button;
        until(BRINGUP_STEP_END);
        TEST_ASSERT_EQUAL_UINT16(cases[n].finding != BRINGUP_FINDINGS, guide.found);
        TEST_ASSERT_EQUAL_UINT16(cases[n].finding != BRINGUP_FINDINGS, found(cases[n].finding));
        TEST_ASSERT_FALSE(drive_is_running(&drive));
    }
}

void test_a_trip_ends_every_step_with_current(void)
{
    static const bringup_step_t steps[] = { BRINGUP_STEP_DRIVE, BRINGUP_STEP_AMMETER, BRINGUP_STEP_DIRECTION, BRINGUP_STEP_MARK, BRINGUP_STEP_TURNS };
    EACH(n, steps) {
        setUp();
        answers[BRINGUP_ASK_TURNS] = 0;
        until(steps[n]);
        ms(100);
        drive_raise(&drive, FAULT_OVERCURRENT_SW);
        ms(5);
        TEST_ASSERT_TRUE(found(BRINGUP_OVERCURRENT));
        TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_END, guide.step);
    }
}

void test_a_user_may_think_as_long_as_no_current_flows(void)
{
    no_answer = BRINGUP_ASK_LED_ALIVE;
    until(BRINGUP_STEP_LED_ALIVE);
    guide.waited_ms = CURRENT_MS;
    ms(5);
    TEST_ASSERT_EQUAL_UINT16(BRINGUP_STEP_LED_ALIVE, guide.step);
    guide.waited_ms = UINT16_MAX;
    ms(1);
    TEST_ASSERT_EQUAL_UINT16(UINT16_MAX, guide.waited_ms);
}

void test_a_new_begin_forgets_the_last_one(void)
{
    static const bringup_guide_t zero;
    static bringup_guide_t fresh;
    rig_bus(19.0F);
    answers[BRINGUP_ASK_BEGIN] = 3;
    answers[BRINGUP_ASK_S3] = 2;
    answers[BRINGUP_ASK_LED_ALIVE] = 3;
    until(BRINGUP_STEP_END);
    fresh = zero;
    bringup_init(&fresh);
    guide.button = 2;
    inputs.s2_down = 0;
    inputs.s3_down = 0;
    the_lights = bringup_pass(&guide, &drive, &params, &inputs, pot);
    TEST_ASSERT_EQUAL_UINT16(fresh.step, guide.step);
    TEST_ASSERT_EQUAL_UINT16(0, guide.blocked);
    TEST_ASSERT_EQUAL_UINT16(0, guide.swapped);
    TEST_ASSERT_EQUAL_UINT16(0, guide.leds);
    TEST_ASSERT_EQUAL_UINT16(0, guide.leds_judged);
    TEST_ASSERT_EQUAL_UINT16(0, guide.found);
    TEST_ASSERT_EQUAL_UINT16(fresh.sender, guide.sender);
    TEST_ASSERT_EQUAL_UINT16(fresh.pending, guide.pending);
}
