/* A drive on the bench for unit tests: amperes and volts go in, duties and states come out; no board and no register. */
#ifndef TEST_DRIVE_RIG_H
#define TEST_DRIVE_RIG_H

#include "hurst_params.h"

#include "drive/speed.h"
#include "drive/tick.h"
#include "drive/param_init.h"
#include "golden.h"
#include "unity.h"

static const drive_params_t params = DRIVE_PARAMS_INIT;
static drive_t drive;
static drive_samples_t samples;
static struct {
    duties_t duty;
    uint16_t outputs;
} out;

/** What drives the bridge in each state. */
static const uint16_t rig_outputs[DRIVE_STATE_COUNT] = {
    OUTPUTS_OFF, OUTPUTS_OFF, OUTPUTS_BOOTSTRAP, OUTPUTS_PWM, OUTPUTS_PWM, OUTPUTS_PWM, OUTPUTS_PWM, OUTPUTS_OFF, OUTPUTS_OFF, OUTPUTS_OFF
};

/** State and fault after a period, and the outputs that go with the state. */
#define EXPECT_DRIVE(expected_state, expected_fault, what) do { \
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(expected_fault, drive.fault, what); \
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(expected_state, drive.state, what); \
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(rig_outputs[expected_state], out.outputs, what); \
    } while (0)

/** EACH_DIRECTION(direction) { ... }: -1, then 1. */
#define EACH_DIRECTION(direction) for (int16_t direction = -1; direction <= 1; direction = (int16_t)(direction + 2))

/** EACH(n, table) { ... }: the index of each row. */
#define EACH(n, table) for (uint16_t n = 0; n < sizeof (table) / sizeof (table)[0]; n++)

/** Converter result that the drive measures as exactly this current (gain -1 and no offset). */
static inline int16_t rig_raw_current(int16_t current_q13)
{
    return (int16_t)(-4 * current_q13);
}

/** Converter result of a bus voltage. */
static inline int16_t rig_raw_bus(float bus_v)
{
    return (int16_t)(bus_v / PARAM_F(BUS_FULL_SCALE_V) * 65536.0F - 32767.5F);
}

static inline void rig_bus(float bus_v)
{
    samples.v_bus = rig_raw_bus(bus_v);
}

static inline void rig_currents(int16_t a_q13, int16_t b_q13)
{
    samples.i_a = rig_raw_current(a_q13);
    samples.i_b = rig_raw_current(b_q13);
}

/** Periods with the present samples. */
static inline void rig_tick(uint16_t periods)
{
    while (periods-- != 0u) {
        if (!drive_tick(&drive, &params, &samples, &out.duty) || drive_slow_follows(&drive)) {
            (void)drive_slow(&drive, &params, &samples);
        }
        out.outputs = drive_outputs(&drive);
        if (drive_latch_fault(&drive)) {
            out.outputs = (uint16_t)OUTPUTS_OFF;
        }
    }
}

/** Periods until the state is reached, at most `most`. @return how many it took, or most + 1 */
static inline uint16_t rig_tick_until(drive_state_t state, uint16_t most)
{
    uint16_t periods = 0;
    while (drive.state != (uint16_t)state && periods <= most) {
        rig_tick(1);
        periods++;
    }
    return periods;
}

/** Power-up with zero current and nominal bus. */
static inline void rig_power_up(void)
{
    rig_currents(0, 0);
    rig_bus(PARAM_F(NOMINAL_BUS_V));
    drive_init(&drive, &params);
}

/** Power-up and calibration: the drive is STOPPED. */
static inline void rig_ready(void)
{
    rig_power_up();
    rig_tick(1u << CALIBRATION_LOG2);
}

/** Ready, then started; the next tick is the first of BOOTSTRAP. */
static inline void rig_start(int16_t direction)
{
    rig_ready();
    drive_start(&drive, &params, direction);
}

/** Started, with the first period of ALIGN done. */
static inline void rig_lock(int16_t direction)
{
    rig_start(direction);
    (void)rig_tick_until(DRIVE_ALIGN, params.bootstrap_periods + 2u);
    rig_tick(1); /* its first period with the law */
}

/** The speed, as the estimator's filter and the observer see it. */
static inline void rig_speed(int16_t speed_erpm)
{
    drive.run.observer.omega_q16 = (int32_t)speed_erpm * 65536;
    drive.run.estimator.omega_filtered_q16 = (int32_t)speed_erpm * 65536;
    estimator_choose_span(&drive.run.estimator, &params.estimator);
    drive.run.estimator.omega_erpm = speed_erpm; /* as steady as it is filtered */
    drive.run.estimator.omega_before_erpm = speed_erpm;
}

/** In RAMP, so many steps of agreement. */
static inline void rig_agreed(uint16_t steps)
{
    drive.run.handover.agreed_steps = steps;
    handover_enter(&drive.run.handover, (steps >= params.agree_steps) ? START_RELEASE : START_AGREE);
}

static inline void rig_emf(int16_t d_q12, int16_t q_q12)
{
    drive.run.estimator.e_d_q28 = (int32_t)d_q12 * 65536;
    drive.run.estimator.e_q_q28 = (int32_t)q_q12 * 65536;
}

/** Header's R times a current is this share of a back-EMF of 4000. */
static inline int16_t rig_current_of_ri(float share)
{
    return (int16_t)(share * 4000.0F * 65536.0F / (float)params.adaptation.rs_base_q16 / (float)(1 << params.estimator.rs_exp));
}

/** In closed loop without the way there: the estimator turns at a speed and nothing changes it but the samples. */
static inline void rig_closed(int16_t direction, int16_t speed_erpm)
{
    rig_start(direction);
    rig_tick(1);
    drive.state = (uint16_t)DRIVE_CLOSED;
    drive.command.target_erpm = speed_erpm;
    drive.run.control.reference_erpm = speed_erpm;
    drive.run.control.ref_q13.q = 0;
    rig_speed(speed_erpm);
    drive.run.handover.phase = (uint16_t)START_DONE;
    speed_follow(&drive.run, &params);
}

/** Counter of the periods brought to a value, so that the next tick runs this part of the slow work. */
static inline void rig_next_part(uint16_t part)
{
    drive.ticks = (uint16_t)((drive.ticks & ~(SLOW_ROUND_STEPS * SLOW_PERIODS - 1u)) + SLOW_EVERY * part - 1u);
}

/** This part of the slow work alone, without the period before it. */
static inline void rig_slow(uint16_t part)
{
    drive.ticks = (uint16_t)(SLOW_ROUND_STEPS * SLOW_PERIODS + SLOW_EVERY * part);
    (void)drive_slow(&drive, &params, &samples);
}

#endif
