/* A small ideal motor behind an ideal bridge with dead time, for closed-loop unit tests without the virtual board or libm. */
#ifndef TEST_IDEAL_MOTOR_H
#define TEST_IDEAL_MOTOR_H

#include "drive_rig.h"

/** State in SI units; the rotor's electrical angle as sine and cosine. */
typedef struct {
    float i_alpha, i_beta;  /* A */
    float sin_e, cos_e;     /* of the rotor flux */
    float omega;            /* electrical rad/s */
    float load_nm;          /* a brake: opposes rotation */
    float bus_v;
    int16_t blocked;
    duties_t acting;        /* duties in force until the next PWM boundary */
} ideal_motor_t;

static ideal_motor_t motor;

#define IDEAL_PSI (PARAM_F(MOTOR_KPHI_V_PER_KRPM) / PARAM_SQRT3 * 60.0F / (2000.0F * PARAM_PI) / PARAM_F(NOPOLESPAIRS)) /* V s */
#define IDEAL_SUBSTEPS 4
#define IDEAL_DT (PARAM_F(LOOPTIME_SEC) / 2.0F / (float)IDEAL_SUBSTEPS)
#define IDEAL_FRICTION_NM 0.004F
#define IDEAL_VISCOUS_NMS 15.3e-6F
#define IDEAL_A_PER_Q13 (4.0F * PARAM_F(NORM_CURRENT_CONST))

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

static inline void ideal_motor_half_period(duties_t duty, uint16_t outputs)
{
    int16_t n;
    for (n = 0; n < IDEAL_SUBSTEPS; n++) {
        const float inertia = PARAM_F(MOTOR_INERTIA_KGM2), pairs = PARAM_F(NOPOLESPAIRS);
        float i_a = motor.i_alpha, i_b = -0.5F * motor.i_alpha + 0.8660254F * motor.i_beta, i_c = -i_a - i_b;
        float torque, brake = IDEAL_FRICTION_NM + motor.load_nm;
        if (outputs == (uint16_t)OUTPUTS_PWM) {
            float a = ideal_leg(duty.a, i_a), b = ideal_leg(duty.b, i_b), c = ideal_leg(duty.c, i_c);
            float v_alpha = (2.0F * a - b - c) / 3.0F, v_beta = (b - c) / PARAM_SQRT3;
            float r = PARAM_F(MOTOR_RS_OHM), per_l = IDEAL_DT / (PARAM_F(MOTOR_LS_MH) * 0.001F);
            float e_alpha = -IDEAL_PSI * motor.omega * motor.sin_e, e_beta = IDEAL_PSI * motor.omega * motor.cos_e;
            motor.i_alpha += (v_alpha - r * motor.i_alpha - e_alpha) * per_l;
            motor.i_beta += (v_beta - r * motor.i_beta - e_beta) * per_l;
        } else {
            motor.i_alpha = 0.0F;
            motor.i_beta = 0.0F;
        }
        torque = 1.5F * pairs * IDEAL_PSI * (motor.i_beta * motor.cos_e - motor.i_alpha * motor.sin_e);
        torque -= IDEAL_VISCOUS_NMS * motor.omega / pairs + brake * ideal_limit(motor.omega / 20.0F, 1.0F);
        motor.omega = motor.blocked ? 0.0F : motor.omega + torque / inertia * pairs * IDEAL_DT;
        ideal_motor_turn(motor.omega * IDEAL_DT);
    }
}

/** At rest. @param cos_e,sin_e direction of the rotor flux */
static inline void ideal_motor_reset(float cos_e, float sin_e)
{
    static const ideal_motor_t at_rest;
    motor = at_rest;
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
        samples.i_a = ideal_raw_current(motor.i_alpha);
        samples.i_b = ideal_raw_current(-0.5F * motor.i_alpha + 0.8660254F * motor.i_beta);
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
