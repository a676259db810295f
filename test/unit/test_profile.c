/* TORQUE_PROFILE: the learned current takes the place of a load that pulses with the shaft, keeps to its formats, and is forgotten. */
/* defines: -DTORQUE_PROFILE */
#include "hurst_params.h"

#include "law.c"
#include "drive_rig.h"

#include <math.h>

#define TURN 6.283185307
#define ACCELERATES 280.0 /* electrical rpm a second and count of q current: the Hurst's bare rotor */
#define STEP_S 0.0004
#define P (&params.profile)

static profile_t f;

void setUp(void)
{
    drive_zero(&f, sizeof f);
    rig_closed(1, 8000);
}

/** A shaft whose load pulses, held by a controller of Kp alone. */
typedef struct {
    double erpm, angle_turns, reference_erpm, pulse_q13, order, inertia, least, most;
} shaft_t;

static shaft_t shaft_at(double erpm, double pulse_q13, double order, double inertia)
{
    shaft_t s = { erpm, 0.3, erpm, pulse_q13, order, inertia, erpm, erpm };
    return s;
}

static double swing_of(const shaft_t *s)
{
    return s->most - s->least;
}

/** Turns for a while, with the learned current or without. */
static void shaft_turn(shaft_t *s, double time_s, int learns)
{
    s->least = 1e9;
    s->most = -1e9;
    for (double t = 0.0; t < time_s; t += STEP_S) {
        const double electrical = s->angle_turns * NOPOLESPAIRS;
        const angle_t at = profile_shaft(&f, P, (angle_t)(int32_t)floor((electrical - floor(electrical)) * 65536.0), (int16_t)s->erpm);
        const int16_t kp_error_q16 = (int16_t)fmax(fmin((s->reference_erpm - s->erpm) * params.speed_kp_q13 / 1024.0, P->error_most_q16), -P->error_most_q16);
        double u = 0.0;
        profile_follow(&f, P, (int16_t)s->erpm);
        if (learns) {
            profile_learn(&f, P, at, kp_error_q16);
            u = profile_current(&f, P, at);
        }
        u += (s->reference_erpm - s->erpm) * params.speed_kp_q13 / 8192.0 - s->pulse_q13 * sin(TURN * s->order * s->angle_turns);
        s->erpm += u * ACCELERATES * STEP_S / s->inertia;
        s->angle_turns += s->erpm / 60.0 / NOPOLESPAIRS * STEP_S;
        s->least = fmin(s->least, s->erpm);
        s->most = fmax(s->most, s->erpm);
    }
}

void test_a_load_that_pulses_once_or_twice_a_turn_is_met_in_both_directions_with_any_inertia(void)
{
    static const struct {
        double rpm, order, inertia, time_s;
    } cases[] = {
        { 500, 1, 1, 1.0 }, { 500, 1, 3, 1.5 }, { 500, 1, 9, 4.0 }, { 1190, 1, 1, 1.0 }, { 2500, 1, 3, 1.5 }, { 500, 2, 1, 1.0 }, { 1190, 2, 3, 1.5 },
        { -500, 1, 1, 1.0 }, { -1190, 1, 3, 1.5 }, { -1190, 2, 3, 1.5 },
    };
    EACH(n, cases) {
        shaft_t s = shaft_at(cases[n].rpm * NOPOLESPAIRS, 700.0, cases[n].order, cases[n].inertia);
        double swing;
        drive_zero(&f, sizeof f);
        shaft_turn(&s, 1.0, 0);
        swing = swing_of(&s);
        shaft_turn(&s, cases[n].time_s, 1);
        shaft_turn(&s, 0.3, 1);
        TEST_ASSERT_TRUE_MESSAGE(swing_of(&s) < 0.25 * swing, golden_row(n));
        TEST_ASSERT_DOUBLE_WITHIN(2000.0, 0.0, s.erpm - s.reference_erpm);
    }
}

void test_what_was_learned_goes_when_the_load_no_longer_pulses(void)
{
    shaft_t s = shaft_at(1190.0 * NOPOLESPAIRS, 700.0, 1.0, 1.0);
    shaft_turn(&s, 1.0, 1);
    TEST_ASSERT_TRUE(fabs(hypot(f.harmonic[0].cos_q29 / 65536.0, f.harmonic[0].sin_q29 / 65536.0) - 700.0) < 70.0);
    s.pulse_q13 = 0.0;
    shaft_turn(&s, 1.0, 1);
    TEST_ASSERT_TRUE(hypot(f.harmonic[0].cos_q29 / 65536.0, f.harmonic[0].sin_q29 / 65536.0) < 70.0);
}

void test_what_nothing_confirms_leaks_to_a_third_in_thirteen_seconds(void)
{
    f.harmonic[0].cos_q29 = 1000 * 65536L;
    for (int32_t n = 0; n < 13100000 / 400; n++) {
        profile_learn(&f, P, 0, 0);
    }
    TEST_ASSERT_INT16_WITHIN(10, 368, qm_hi(f.harmonic[0].cos_q29));
}

void test_the_shafts_angle_takes_all_of_the_pole_pairs_for_a_turn(void)
{
    for (int16_t direction = -1; direction <= 1; direction = (int16_t)(direction + 2)) {
        uint32_t turned = 0;
        angle_t before = profile_shaft(&f, P, f.rho, direction);
        for (int32_t n = 0; n < 1000 * NOPOLESPAIRS; n++) { /* a hundredth of an electrical turn and a bit */
            const angle_t now = profile_shaft(&f, P, (angle_t)(f.rho + (uint16_t)(direction * 656)), direction);
            const int16_t moved = (int16_t)(angle_t)(now - before);
            TEST_ASSERT_INT16_WITHIN(6, direction * 131, moved);
            turned += (uint32_t)(direction * moved);
            before = now;
        }
        TEST_ASSERT_UINT32_WITHIN(700, (uint32_t)(1000L * NOPOLESPAIRS * 656 / NOPOLESPAIRS), turned);
    }
}

void test_nothing_leaves_its_format_and_the_current_its_bound(void)
{
    uint32_t n;
    f.gain_q16 = PROFILE_GAIN_MOST_Q16;
    for (n = 0; n < 200000u; n++) {
        const angle_t at = (angle_t)(n * 257u);
        profile_learn(&f, P, at, (int16_t)((trig_sincos((angle_t)(at - f.lag[0])).cos > 0) ? 32767 : -32767));
        TEST_ASSERT_INT16_WITHIN(P->sum_most_q13, 0, profile_current(&f, P, at));
    }
    TEST_ASSERT_TRUE(qm_abs(qm_hi(f.harmonic[0].cos_q29)) >= P->most_q13 - 1); /* it did come to its end */
    for (int32_t speed = -32768; speed <= 32767; speed += 7) {
        profile_follow(&f, P, (int16_t)speed);
        TEST_ASSERT_TRUE(f.gain_q16 <= PROFILE_GAIN_MOST_Q16);
    }
}

/** A harmonic of the drive, and a step at 1600 rpm. */
static void drive_learned(int16_t cos_q13)
{
    drive.run.profile.harmonic[0].cos_q29 = cos_q13 * 65536L;
    drive.run.profile.learns = 1;
}

static void drive_step(void)
{
    drive.run.control.vq_limit_q14 = 16000;
    drive.run.control.iq_limit_q13 = params.current_max_q13;
    drive.run.control.brake_limit_q13 = params.current_max_q13;
    mode_profile_step(&drive, &params);
}

void test_below_its_least_speed_and_in_a_stop_it_is_forgotten_in_half_a_second(void)
{
    for (uint16_t stops = 0; stops <= 1u; stops++) {
        rig_closed(1, 8000);
        drive.run.control.reference_erpm = stops ? 8000 : (int16_t)(P->least_erpm - 1);
        drive.state = stops ? (uint16_t)DRIVE_STOPPING : (uint16_t)DRIVE_CLOSED;
        drive_learned(1000);
        for (uint16_t n = 0; n < 2000u; n++) {
            drive_step();
        }
        TEST_ASSERT_TRUE(drive.run.profile.harmonic[0].cos_q29 < 50 * 65536L);
    }
}

void test_a_ramp_a_load_step_and_a_hand_over_teach_nothing(void)
{
    for (uint16_t why = 0; why < 4u; why++) {
        rig_closed(1, 8000);
        drive.run.control.reference_erpm = 8000;
        drive.run.profile.reference_erpm = (int16_t)((why == 1u) ? 7990 : 8000);
        drive.run.observer.omega_q16 = 7500 * 65536L;
        drive.run.observer.fast_share_q15 = (q15_t)((why == 2u) ? 32767 : 0);
        drive.run.observer.gate_level = 0;
        drive.run.handover.offset = (int16_t)((why == 3u) ? 1000 : 0);
        drive_learned(0);
        mode_profile_follow(&drive.run, &params);
        drive_step();
        TEST_ASSERT_EQUAL_UINT16(why == 0u, drive.run.profile.harmonic[0].cos_q29 != 0 || drive.run.profile.harmonic[0].sin_q29 != 0);
    }
}

void test_a_load_that_keeps_the_gate_open_teaches(void)
{
    drive.run.control.reference_erpm = 8000;
    drive.run.profile.reference_erpm = 8000;
    drive.run.observer.omega_q16 = 7500 * 65536L;
    drive.run.observer.fast_share_q15 = 32767;
    drive.run.observer.gate_level = PROFILE_UNREST_STEPS;
    drive.run.handover.offset = 0;
    drive_learned(0);
    mode_profile_follow(&drive.run, &params);
    drive_step();
    TEST_ASSERT_TRUE(drive.run.profile.harmonic[0].cos_q29 != 0 || drive.run.profile.harmonic[0].sin_q29 != 0);
}

/** One turn of the shaft in closed loop with a current that is not there. */
static void drive_turn(voltage_q14_t v_q14, current_q13_t missing_q13, current_q13_t iq_q13)
{
    for (uint16_t n = 0; n < 100u; n++) {
        drive.run.observer.rho_q32 += 0x10000000u;
        drive.run.control.reference_erpm = (int16_t)(8000 + (n & 1u)); /* it learns nothing of its own */
        drive.run.control.v_q14.q = v_q14;
        drive.run.control.ref_q13.q = iq_q13;
        drive.run.control.i_q13.q = (int16_t)(iq_q13 - missing_q13);
        drive_step();
    }
}

void test_a_turn_without_voltage_or_current_takes_back_a_part_and_one_without_voltage_learns_nothing(void)
{
    static const struct {
        voltage_q14_t v_q14;
        current_q13_t missing_q13, iq_q13;
        uint16_t takes, learns;
    } cases[] = { { 8000, 500, 1000, 0, 1 }, { 16000, 500, 1000, 1, 0 }, { 16000, 50, 1000, 0, 1 }, { 8000, 0, 5000, 0, 1 }, { 8000, 0, 5200, 1, 1 } };
    EACH(n, cases) {
        rig_closed(1, 8000);
        drive_learned(1000);
        drive_turn(cases[n].v_q14, cases[n].missing_q13, (int16_t)((cases[n].iq_q13 == 5200) ? params.current_max_q13 : cases[n].iq_q13 / 2));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].takes, drive.run.profile.harmonic[0].cos_q29 < 990 * 65536L, golden_row(n));
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(cases[n].learns, drive.run.profile.learns, golden_row(n));
    }
}

void test_the_observer_does_not_see_it_and_the_controller_asks_for_it(void)
{
    current_q13_t without;
    drive.run.control.iq_limit_q13 = params.current_max_q13;
    drive.run.profile.now_q13 = 0;
    without = speed_current(&drive.run, &params, 8000);
    drive.run.profile.now_q13 = 300;
    TEST_ASSERT_EQUAL_INT16(without + 300, speed_current(&drive.run, &params, 8000));
    drive.run.handover.phase = (uint16_t)START_DONE;
    drive.run.control.i_q13.q = 300;
    drive.run.observer.load_q16 = 0;
    drive.run.observer.omega_q16 = 8000 * 65536L;
    drive.run.observer.rho_q32 = drive.run.estimator.rho_q32 - 8u * (uint32_t)qm_mulss(8000, params.observer.deltat_q32);
    handover_observe(&drive.run, &params);
    TEST_ASSERT_INT16_WITHIN(2, 8000, observer_speed(&drive.run.observer));
}
