/* A small ideal motor behind an ideal bridge with dead time, for closed-loop unit tests without the virtual board or libm. */
#ifndef TEST_IDEAL_MOTOR_H
#define TEST_IDEAL_MOTOR_H

#include "drive_rig.h"

/** Machine and state in SI units; the rotor's electrical angle as sine and cosine. */
typedef struct {
    float rs, ld, lq, psi;  /* per phase: ohm, H, V s */
    float inertia, friction_nm, viscous_nms;
    float load_nm;          /* a brake: opposes rotation */
    float bus_v;
    int16_t blocked;
    uint16_t open_phase;    /* 1..3, 4 = no motor at all */

    float i_alpha, i_beta;  /* A */
    float sin_e, cos_e;     /* of the rotor flux */
    float omega;            /* electrical rad/s */
    float omega_rest;       /* what its last step has lost by rounding */
    float highest_a;        /* largest current of phases a and b so far */
    duties_t acting;        /* duties in force until the next PWM boundary */
} ideal_motor_t;

static ideal_motor_t motor;

#define IDEAL_SUBSTEPS 4
#define IDEAL_DT (PARAM_F(LOOPTIME_SEC) / 2.0F / (float)IDEAL_SUBSTEPS)
#define IDEAL_A_PER_Q13 (4.0F * PARAM_F(NORM_CURRENT_CONST))

/** Flux of a Kphi in V peak line to line per 1000 mechanical rpm. */
static inline float ideal_psi(float kphi)
{
    return kphi / PARAM_SQRT3 * 60.0F / (2000.0F * PARAM_PI) / PARAM_F(NOPOLESPAIRS);
}

static inline float ideal_limit(float x, float limit)
{
    return (x > limit) ? limit : (x < -limit) ? -limit : x;
}

/** Voltage of a leg against the negative rail: duty less what dead time takes. */
static inline float ideal_leg(duty_t duty, float current_a)
{
    float knee_a = (float)DEAD_TIME_KNEE_Q13 * IDEAL_A_PER_Q13;
    float lost = (float)DEAD_TIME_DUTY * ideal_limit(current_a / knee_a, 1.0F);
    return ((float)duty - lost) / (float)PWM_FULL_DUTY * motor.bus_v;
}

static inline void ideal_motor_turn(float angle)
{
    float c = motor.cos_e - motor.sin_e * angle, s = motor.sin_e + motor.cos_e * angle;
    float shrink = 1.5F - 0.5F * (c * c + s * s); /* back to length 1 */
    motor.cos_e = c * shrink;
    motor.sin_e = s * shrink;
}

/** Takes the current of an open wire out: what is left flows along the other two. */
static inline void ideal_motor_open_wire(void)
{
    static const float axis[5][2] = { { 0, 0 }, { 0, 1 }, { 0.8660254F, 0.5F }, { 0.8660254F, -0.5F }, { 0, 0 } };
    if (motor.open_phase != 0u) {
        float x = axis[motor.open_phase][0], y = axis[motor.open_phase][1];
        float along = motor.i_alpha * x + motor.i_beta * y;
        motor.i_alpha = along * x;
        motor.i_beta = along * y;
    }
}

static inline float ideal_motor_phase_b(void)
{
    return -0.5F * motor.i_alpha + 0.8660254F * motor.i_beta;
}

/** A small step of a large speed: what single precision rounds away belongs to the next one. */
static inline void ideal_motor_accelerate(float step)
{
    float whole = step + motor.omega_rest, before = motor.omega;
    motor.omega = motor.blocked ? 0.0F : before + whole;
    motor.omega_rest = motor.blocked ? 0.0F : whole - (motor.omega - before);
}

static inline void ideal_motor_half_period(duties_t duty, uint16_t outputs)
{
    int16_t n;
    for (n = 0; n < IDEAL_SUBSTEPS; n++) {
        float pairs = PARAM_F(NOPOLESPAIRS), c = motor.cos_e, s = motor.sin_e;
        float i_b = ideal_motor_phase_b();
        float v_a = ideal_leg(duty.a, motor.i_alpha), v_b = ideal_leg(duty.b, i_b), v_c = ideal_leg(duty.c, -motor.i_alpha - i_b);
        float v_alpha = (2.0F * v_a - v_b - v_c) / 3.0F, v_beta = (v_b - v_c) / PARAM_SQRT3;
        float i_d = motor.i_alpha * c + motor.i_beta * s, i_q = motor.i_beta * c - motor.i_alpha * s;
        float v_d = v_alpha * c + v_beta * s, v_q = v_beta * c - v_alpha * s, torque;
        if (outputs == (uint16_t)OUTPUTS_BOOTSTRAP) { /* a short circuit */
            v_d = 0.0F;
            v_q = 0.0F;
        }
        if (outputs == (uint16_t)OUTPUTS_OFF) {
            i_d = 0.0F;
            i_q = 0.0F;
        } else {
            float d = (v_d - motor.rs * i_d + motor.omega * motor.lq * i_q) / motor.ld;
            i_q += IDEAL_DT * (v_q - motor.rs * i_q - motor.omega * (motor.ld * i_d + motor.psi)) / motor.lq;
            i_d += IDEAL_DT * d;
        }
        torque = 1.5F * pairs * (motor.psi + (motor.ld - motor.lq) * i_d) * i_q - motor.viscous_nms * motor.omega / pairs;
        torque -= (motor.friction_nm + motor.load_nm) * ideal_limit(motor.omega / 20.0F, 1.0F);
        ideal_motor_accelerate(torque / motor.inertia * pairs * IDEAL_DT);
        ideal_motor_turn(motor.omega * IDEAL_DT);
        motor.i_alpha = i_d * motor.cos_e - i_q * motor.sin_e;
        motor.i_beta = i_d * motor.sin_e + i_q * motor.cos_e;
        ideal_motor_open_wire();
    }
}

/** The motor of the parameters, at rest. @param cos_e,sin_e direction of the rotor flux */
static inline void ideal_motor_reset(float cos_e, float sin_e)
{
    static const ideal_motor_t at_rest;
    motor = at_rest;
    motor.rs = PARAM_F(MOTOR_RS_OHM);
    motor.ld = PARAM_F(MOTOR_LS_MH) * 0.001F;
    motor.lq = motor.ld;
    motor.psi = ideal_psi(PARAM_F(MOTOR_KPHI_V_PER_KRPM));
    motor.inertia = PARAM_F(MOTOR_INERTIA_KGM2);
    motor.friction_nm = 0.004F;
    motor.viscous_nms = 15.3e-6F;
    motor.cos_e = cos_e;
    motor.sin_e = sin_e;
    motor.bus_v = PARAM_F(NOMINAL_BUS_V);
}

static inline int16_t ideal_raw_current(float current_a)
{
    return (int16_t)ideal_limit(-current_a / PARAM_F(NORM_CURRENT_CONST), 32767.0F);
}

/** Periods of drive and motor together. A duty acts from half a period after its sample. */
static inline void ideal_motor_run(uint32_t periods)
{
    while (periods-- != 0u) {
        float i_a = motor.i_alpha, i_b = ideal_motor_phase_b();
        float largest = (i_a * i_a > i_b * i_b) ? i_a : i_b;
        largest = (largest < 0.0F) ? -largest : largest;
        motor.highest_a = (largest > motor.highest_a) ? largest : motor.highest_a;
        samples.i_a = ideal_raw_current(i_a);
        samples.i_b = ideal_raw_current(i_b);
        rig_bus(motor.bus_v);
        rig_tick(1);
        ideal_motor_half_period(motor.acting, out.outputs);
        motor.acting = out.duty;
        ideal_motor_half_period(motor.acting, out.outputs);
    }
}

/** Runs until a state is reached, at most `most` periods. @return periods, or most + 1 */
static inline uint32_t ideal_motor_run_until(drive_state_t state, uint32_t most)
{
    uint32_t periods = 0;
    while (drive.state != (uint16_t)state && periods <= most) {
        ideal_motor_run(1);
        periods++;
    }
    return periods;
}

/** Electrical rpm of the shaft. */
static inline float ideal_motor_erpm(void)
{
    return motor.omega * 60.0F / (2.0F * PARAM_PI);
}

/** Sine of (true angle - control angle), both at the next sample. */
static inline float ideal_motor_angle_error(void)
{
    sincos_t estimated = trig_sincos(drive.angle);
    return (motor.sin_e * (float)estimated.cos - motor.cos_e * (float)estimated.sin) / 32767.0F;
}

#endif
