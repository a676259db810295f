/* An unknown motor for the identification's tests: any R, Ld, Lq and flux, behind a bridge with dead time; wires may be open. */
#ifndef TEST_IDENTIFY_RIG_H
#define TEST_IDENTIFY_RIG_H

#include "ideal_motor.h"
#include "panel_rig.h"

/** @param rs ohm @param kphi V peak line to line per 1000 rpm */
static inline void unknown_set(float rs, float ld_mh, float lq_mh, float kphi)
{
    ideal_motor_reset(-0.6F, 0.8F);
    motor.rs = rs;
    motor.ld = ld_mh * 0.001F;
    motor.lq = lq_mh * 0.001F;
    motor.psi = ideal_psi(kphi);
    motor.inertia = 5.5e-6F;
    motor.friction_nm = 0.002F;
    motor.viscous_nms = 0.0F;
}

/** A millisecond of panel, drive and motor. */
static inline void unknown_ms(void)
{
    ideal_motor_run(20);
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
static inline uint32_t unknown_until(identify_step_t step)
{
    uint32_t ms = 0;
    while (drive.run.identify.step != (uint16_t)step && drive.run.identify.result == (uint16_t)IDENTIFY_RESULT_BUSY && ms < 300000ul) {
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
