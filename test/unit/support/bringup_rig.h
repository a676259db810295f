/* BRINGUP on the bench for unit tests: a user who answers, and a bridge of ohms and dead time behind the drive. */
#ifndef TEST_BRINGUP_RIG_H
#define TEST_BRINGUP_RIG_H

#include "panel_rig.h"

#include "drive/modes/bringup_guide.h"

#define PRESS_MS (PANEL_DEBOUNCE_MS + 5u)

static bringup_guide_t guide;
static int16_t pot;
static float rs_ohm, gain_a, gain_b;
static int16_t carried_most_q13;
static bringup_message_t said[64];
static uint16_t said_count;
static uint16_t press_ms, pressed;
static uint16_t no_answer; /* the question that nobody answers */
static uint16_t answers[BRINGUP_QUESTIONS];

/** Power-up, a right board, the right answers. */
static inline void bringup_reset(void)
{
    static const panel_inputs_t nothing;
    uint16_t n;
    bringup_init(&guide);
    inputs = nothing;
    rig_power_up();
    rs_ohm = 2.67F;
    gain_a = 1.0F;
    gain_b = 1.0F;
    pot = 0;
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

/** Current of a phase of a winding that follows at once: what its duty leaves beyond dead time. */
static inline int16_t phase_q13(int16_t part)
{
    float counts = (float)part, lost = 80.0F * (float)((part > 0) - (part < 0));
    float rest = (counts * counts > lost * lost) ? counts - lost : 0.0F;
    return CURRENT_Q13(rest / 2000.0F * 24.0F / rs_ohm);
}

static inline void bridge_period(void)
{
    int16_t a = 0, b = 0;
    if (drive_is_running(&drive) && out.duty.a != 0u) { /* in the first period the low sides are still on */
        a = phase_q13((int16_t)(out.duty.a - BRINGUP_HALF_DUTY));
        b = phase_q13((int16_t)(out.duty.b - BRINGUP_HALF_DUTY));
    }
    if (qm_abs(a) + qm_abs(b) > carried_most_q13) {
        carried_most_q13 = (int16_t)(qm_abs(a) + qm_abs(b));
    }
    rig_currents((int16_t)(gain_a * (float)a), (int16_t)(gain_b * (float)b));
    rig_tick(1);
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

/** 1 if this has been found. */
static inline uint16_t found(bringup_finding_t finding)
{
    uint16_t n;
    for (n = 0; n < said_count; n++) {
        if (said[n].kind == (uint16_t)BRINGUP_FINDS && said[n].code == (uint16_t)finding) {
            return 1;
        }
    }
    return 0;
}

#endif
