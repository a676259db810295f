/* An unknown motor for the identification's tests: any R, Ld, Lq and flux, behind a bridge with dead time; wires may be open. */
#ifndef TEST_IDENTIFY_RIG_H
#define TEST_IDENTIFY_RIG_H

#include "ideal_motor.h"
#include "panel_rig.h"

/** SI units, per phase. */
typedef struct {
    float rs, ld, lq, psi, inertia, friction_nm;
    int16_t blocked;
    uint16_t open_phase; /* 1..3, 4 = no motor at all */
} unknown_motor_t;

static unknown_motor_t unknown;
static float highest_a; /* largest phase current so far */

/** psi of a Kphi in V peak line to line per 1000 mechanical rpm. */
static inline float unknown_psi(float kphi)
{
    return kphi / PARAM_SQRT3 * 60.0F / (2000.0F * PARAM_PI) / PARAM_F(NOPOLESPAIRS);
}

static inline void unknown_set(float rs, float ld_mh, float lq_mh, float kphi)
{
    static const unknown_motor_t nothing;
    unknown = nothing;
    unknown.rs = rs;
    unknown.ld = ld_mh * 0.001F;
    unknown.lq = lq_mh * 0.001F;
    unknown.psi = unknown_psi(kphi);
    unknown.inertia = 5.5e-6F;
    unknown.friction_nm = 0.002F;
    highest_a = 0.0F;
    ideal_motor_reset(-0.6F, 0.8F);
}

/** Takes the current of an open wire out: what is left flows along the other two. */
static inline void unknown_open(void)
{
    static const float axis[5][2] = { { 0, 0 }, { 0, 1 }, { 0.8660254F, 0.5F }, { 0.8660254F, -0.5F }, { 0, 0 } };
    if (unknown.open_phase != 0u) {
        float x = axis[unknown.open_phase][0], y = axis[unknown.open_phase][1];
        float along = motor.i_alpha * x + motor.i_beta * y;
        motor.i_alpha = along * x;
        motor.i_beta = along * y;
    }
}

static inline void unknown_half_period(duties_t duty, uint16_t outputs)
{
    int16_t n;
    for (n = 0; n < IDEAL_SUBSTEPS; n++) {
        float pairs = PARAM_F(NOPOLESPAIRS), c = motor.cos_e, s = motor.sin_e;
        float i_a = motor.i_alpha, i_b = -0.5F * i_a + 0.8660254F * motor.i_beta, i_c = -i_a - i_b;
        float a = ideal_leg(duty.a, i_a), b = ideal_leg(duty.b, i_b), g = ideal_leg(duty.c, i_c);
        float v_alpha = (2.0F * a - b - g) / 3.0F, v_beta = (b - g) / PARAM_SQRT3;
        float i_d = motor.i_alpha * c + motor.i_beta * s, i_q = motor.i_beta * c - motor.i_alpha * s;
        float v_d = v_alpha * c + v_beta * s, v_q = v_beta * c - v_alpha * s, torque;
        if (outputs != (uint16_t)OUTPUTS_PWM) {
            i_d = 0.0F;
            i_q = 0.0F;
        } else {
            float d = (v_d - unknown.rs * i_d + motor.omega * unknown.lq * i_q) / unknown.ld;
            i_q += IDEAL_DT * (v_q - unknown.rs * i_q - motor.omega * (unknown.ld * i_d + unknown.psi)) / unknown.lq;
            i_d += IDEAL_DT * d;
        }
        torque = 1.5F * pairs * (unknown.psi + (unknown.ld - unknown.lq) * i_d) * i_q;
        torque -= unknown.friction_nm * ideal_limit(motor.omega / 20.0F, 1.0F);
        motor.omega = unknown.blocked ? 0.0F : motor.omega + torque / unknown.inertia * pairs * IDEAL_DT;
        ideal_motor_turn(motor.omega * IDEAL_DT);
        motor.i_alpha = i_d * motor.cos_e - i_q * motor.sin_e;
        motor.i_beta = i_d * motor.sin_e + i_q * motor.cos_e;
        unknown_open();
    }
}

/** A millisecond of panel, drive and motor. */
static inline void unknown_ms(void)
{
    int16_t n;
    for (n = 0; n < 20; n++) {
        float i_b = -0.5F * motor.i_alpha + 0.8660254F * motor.i_beta;
        samples.i_a = ideal_raw_current(motor.i_alpha);
        samples.i_b = ideal_raw_current(i_b);
        highest_a = (motor.i_alpha > highest_a) ? motor.i_alpha : (-motor.i_alpha > highest_a) ? -motor.i_alpha : highest_a;
        highest_a = (i_b > highest_a) ? i_b : (-i_b > highest_a) ? -i_b : highest_a;
        rig_bus(motor.bus_v);
        rig_tick(1);
        unknown_half_period(motor.acting, out.outputs);
        motor.acting = out.duty;
        unknown_half_period(motor.acting, out.outputs);
    }
    panel_ms(1);
}

/** S2 pressed and released, with the motor running on. */
static inline void unknown_press_s2(void)
{
    int16_t n;
    inputs.s2_down = 1;
    for (n = 0; n < 40; n++) {
        unknown_ms();
    }
    inputs.s2_down = 0;
    unknown_ms();
}

/** Power-up, calibration, S2: the procedure has begun. */
static inline void unknown_begin(void)
{
    panel_reset();
    rig_ready();
    unknown_press_s2();
}

/** Until a step is reached or the procedure has ended. @return milliseconds */
static inline uint16_t unknown_until(identify_step_t step)
{
    uint16_t ms = 0;
    while (drive.run.identify.step != (uint16_t)step && drive.run.identify.result == (uint16_t)IDENTIFY_RESULT_BUSY && ms < 20000u) {
        unknown_ms();
        ms++;
    }
    return ms;
}

/** From S2 to the end. @return the result */
static inline uint16_t unknown_identify(void)
{
    unknown_begin();
    (void)unknown_until(IDENTIFY_IDLE);
    return drive.run.identify.result;
}

#endif
