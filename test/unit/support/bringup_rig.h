/* BRINGUP on the bench for unit tests: a user who answers, and a bridge of ohms and dead time behind the drive. */
#ifndef TEST_BRINGUP_RIG_H
#define TEST_BRINGUP_RIG_H

#include "panel_rig.h"

#include "drive/modes/bringup.h"

#define PRESS_MS (BUTTON_DEBOUNCE_MS + 5u)

static bringup_guide_t guide;
static int16_t pot, pot_ends[2]; /* where it stands; left, right */
static float rs_ohm, gain_a, gain_b;
static int16_t rest_a_q13, rest_b_q13, noise_b_q13; /* of the signals without current */
static uint16_t fault_input_low;
static int16_t carried_most_q13;
static bringup_message_t said[64];
static uint16_t said_count;
static uint16_t press_ms, pressed;
static uint16_t no_answer; /* the question that nobody answers */
static uint16_t answers[BRINGUP_QUESTIONS];

/** Power-up, a right board, the right answers. */
static inline void bringup_reset(void)
{
    static const buttons_t nothing;
    uint16_t n;
    bringup_init(&guide);
    inputs = nothing;
    rig_power_up();
    rs_ohm = 2.67F;
    gain_a = 1.0F;
    gain_b = 1.0F;
    pot = 0;
    pot_ends[0] = -32768;
    pot_ends[1] = 32704;
    rest_a_q13 = 0;
    rest_b_q13 = 0;
    noise_b_q13 = 0;
    fault_input_low = 0;
    said_count = 0;
    carried_most_q13 = 0;
    no_answer = BRINGUP_QUESTIONS;
    press_ms = 0;
    for (n = 0; n < (uint16_t)BRINGUP_QUESTIONS; n++) {
        answers[n] = 2;
    }
    answers[BRINGUP_ASK_S3] = 3;
    answers[BRINGUP_ASK_FAULT_INPUT] = 3;
}

#define DEAD_COUNTS 80.0F /* duty counts that a leg loses: 2 us */

/** Currents of a winding that follows at once: R behind what dead time leaves of the duties. */
static inline void bridge_currents(const float *part, float *i_a)
{
    float volts[3], mean = 0.0F;
    uint16_t k;
    for (k = 0; k < 3u; k++) {
        volts[k] = part[k] - DEAD_COUNTS * (float)((part[k] > 0.0F) - (part[k] < 0.0F));
        mean += volts[k] / 3.0F;
    }
    for (k = 0; k < 3u; k++) {
        i_a[k] = ((volts[k] - mean) * part[k] > 0.0F) ? (volts[k] - mean) / 2000.0F * 24.0F / rs_ohm : 0.0F;
    }
}

static inline void bridge_period(void)
{
    float i_a[3] = { 0.0F, 0.0F, 0.0F };
    int16_t a, b;
    if (drive_is_running(&drive) && out.duty.a != 0u) { /* in the first period the low sides are still on */
        const float part[3] = { (float)out.duty.a - BRINGUP_HALF_DUTY, (float)out.duty.b - BRINGUP_HALF_DUTY, (float)out.duty.c - BRINGUP_HALF_DUTY };
        bridge_currents(part, i_a);
    }
    a = CURRENT_Q13(i_a[0]);
    b = CURRENT_Q13(i_a[1]);
    noise_b_q13 = (int16_t)-noise_b_q13;
    if (qm_abs(a) + qm_abs(b) > carried_most_q13) {
        carried_most_q13 = (int16_t)(qm_abs(a) + qm_abs(b));
    }
    rig_currents((int16_t)(gain_a * (float)a + (float)rest_a_q13), (int16_t)(gain_b * (float)b + (float)(rest_b_q13 + noise_b_q13)));
    rig_tick(1);
}

/** What the user turns, and what the board does by itself. */
static inline void take_hold(void)
{
    if (guide.message.kind == (uint16_t)BRINGUP_ASKS && guide.message.code == (uint16_t)BRINGUP_ASK_POT_LEFT) {
        pot = pot_ends[0];
    } else if (guide.message.kind == (uint16_t)BRINGUP_ASKS && guide.message.code == (uint16_t)BRINGUP_ASK_POT_RIGHT) {
        pot = pot_ends[1];
    }
    if (fault_input_low && drive.fault == (uint16_t)FAULT_NONE) {
        drive_raise(&drive, FAULT_OVERCURRENT_HW);
    }
}

/** Milliseconds with a user who answers. Lines are said at once. */
static inline void ms(uint16_t count)
{
    uint16_t n;
    while (count-- != 0u) {
        for (n = 0; n < 20u; n++) {
            bridge_period();
        }
        if (guide.message.kind == (uint16_t)BRINGUP_ASKS && guide.message.code != no_answer) {
            pressed = answers[guide.message.code];
            press_ms = 2 * PRESS_MS; /* let go of the last one first */
        }
        take_hold();
        if (guide.message.kind != (uint16_t)BRINGUP_SILENT && said_count < 64u) {
            said[said_count++] = guide.message;
        }
        guide.message.kind = (uint16_t)BRINGUP_SILENT;
        press_ms = (uint16_t)((press_ms == 0u) ? 0u : press_ms - 1u);
        inputs.s2_down = (uint16_t)(press_ms != 0u && press_ms <= PRESS_MS && pressed == 2u);
        inputs.s3_down = (uint16_t)(press_ms != 0u && press_ms <= PRESS_MS && pressed == 3u);
        inputs.elapsed_ms = 1;
        the_lights = bringup_pass(&guide, &drive, &params, &inputs, pot);
    }
}

/** Until a step, or the end. */
static inline void until(bringup_step_t step)
{
    uint16_t n;
    for (n = 0; n < 20000u && guide.step != (uint16_t)step && guide.step != (uint16_t)BRINGUP_STEP_END; n++) {
        ms(1);
    }
    ms(2);
}

/** The first line of this kind and code. @return NULL: none */
static inline const bringup_message_t *line_of(bringup_kind_t kind, uint16_t code)
{
    uint16_t n;
    for (n = 0; n < said_count; n++) {
        if (said[n].kind == (uint16_t)kind && said[n].code == code) {
            return &said[n];
        }
    }
    return 0;
}

/** 1 if this has been found. */
static inline uint16_t found(bringup_finding_t finding)
{
    return (uint16_t)(line_of(BRINGUP_FINDS, (uint16_t)finding) != 0);
}

/** 1 if this has been asked. */
static inline uint16_t asked(bringup_question_t question)
{
    return (uint16_t)(line_of(BRINGUP_ASKS, (uint16_t)question) != 0);
}

#endif
