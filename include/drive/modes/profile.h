/* TORQUE_PROFILE: a learned q current by the turn's position meets a load that pulses with the shaft, a piston pump's or a compressor's.
 *
 * For each of the first harmonics of the turn the drive learns a cosine and a sine of the mechanical angle. They follow the speed's error, turned
 * back by what the shaft and the loop let the speed lag behind the torque (adaptive feed-forward cancellation):
 *
 *     u = sum a_k cos k theta + b_k sin k theta,    da_k/dt = G e cos(k theta - lag) - a_k/T,    db_k/dt = G e sin(k theta - lag) - b_k/T
 *
 * The load observer does not see u as torque: what u meets is no load to it. The turns of the estimator's angle are counted modulo
 * NOPOLESPAIRS. Where the count begins does not matter, and a slip costs a new lesson only. */
#ifndef DRIVE_MODES_PROFILE_H
#define DRIVE_MODES_PROFILE_H

#include "control/transforms.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

#ifdef TORQUE_PROFILE
/** Harmonics of the turn that are learned, from the first on: a piston's torque has little of the third. */
#define PROFILE_ORDERS 2u

/** Constants. A step is that of the speed controller, SLOW_PERIODS. */
typedef struct {
    uint16_t pole_pairs;
    uint16_t per_pole_q16;      /**< a turn of the shaft over its pole pairs */
    uint16_t per_erpm_q31;      /**< turns of the shaft a step and count of speed */
    uint16_t gain_q8;           /**< share of the speed controller's current that a step learns, over the turns of a step */
    int16_t corner_q16;         /**< turns a step from which shaft and loop lag by a quarter of a turn */
    speed_erpm_t least_erpm;    /**< it learns from this reference on; below it forgets */
    int16_t error_most_q16;     /**< most of the speed controller's current that it learns from, counts * 8 */
    current_q13_t most_q13;     /**< of each cosine and sine */
    current_q13_t sum_most_q13; /**< and of their sum */
} profile_params_t;

/** Times the harmonic's order it fits a word. */
#define PROFILE_GAIN_MOST_Q16 (32767u / PROFILE_ORDERS)

/** What may limit a turn. */
#define PROFILE_CURRENT 1u
#define PROFILE_VOLTAGE 2u

/** A cosine and a sine of the turn: q current, Q13 with 16 fraction bits. */
typedef struct {
    int32_t cos_q29, sin_q29;
} profile_harmonic_t;

/** State. */
typedef struct {
    uint16_t poles;              /**< electrical turns since the shaft's turn began, below pole_pairs */
    angle_t rho;                 /**< the estimator's angle a step ago */
    angle_t shaft;               /**< and the shaft's */
    speed_erpm_t reference_erpm; /**< and the reference */
    uint16_t learns;             /**< 1 where the last turn had voltage enough */
    uint16_t limited;            /**< what this turn has met: PROFILE_CURRENT, PROFILE_VOLTAGE */
    current_q13_t now_q13;       /**< the learned current of this step */
    uint16_t gain_q16;           /**< share of the speed controller's current that the first harmonic learns in its step */
    uint16_t next;               /**< whose step it is: the harmonics take turns */
    angle_t lag[PROFILE_ORDERS]; /**< of the speed behind the torque, along the shaft's angle */
    profile_harmonic_t harmonic[PROFILE_ORDERS];
} profile_t;

#define PROFILE_PARAMS profile_params_t profile;
#define PROFILE_STATE profile_t profile;

#define PARAM_PROFILE_INIT \
    .profile = { \
        .pole_pairs = NOPOLESPAIRS, \
        .per_pole_q16 = (uint16_t)PARAM_MIN(65536.0F / PARAM_F(NOPOLESPAIRS) + 0.5F, 65535.0F), \
        .per_erpm_q31 = (uint16_t)PARAM_MIN(2147483648.0F / 60.0F * PARAM_STEP_SEC * PARAM_F(SPEED_UNIT) / PARAM_F(NOPOLESPAIRS) + 0.5F, 65535.0F), \
        .gain_q8 = (uint16_t)PARAM_MIN(256.0F * PARAM_F(PROFILE_ORDERS) * PARAM_F(PROFILE_RATE) / PARAM_F(SPEED_BANDWIDTH_HZ) + 0.5F, 65535.0F), \
        .corner_q16 = (int16_t)PARAM_MIN(65536.0F * PARAM_F(PROFILE_CORNER_RATIO) * PARAM_F(SPEED_BANDWIDTH_HZ) * PARAM_STEP_SEC, 32767.0F), \
        .least_erpm = (int16_t)SPEED_COUNTS(PARAM_F(PROFILE_LEAST_SHARE) * PARAM_F(NOMINAL_SPEED_RPM) * PARAM_F(NOPOLESPAIRS)), \
        .error_most_q16 = (int16_t)PARAM_MIN(8.0F * PARAM_F(PROFILE_ERROR_SHARE) * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)), 32767.0F), \
        .most_q13 = (int16_t)(PARAM_F(PROFILE_MOST_SHARE) * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A))), \
        .sum_most_q13 = (int16_t)(PARAM_F(PROFILE_SUM_SHARE) * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A))) \
    },

/** The shaft's angle, some constant apart: counts the electrical turns. @param rho the estimator's angle @param speed its sign counts @return 65536 = a turn */
angle_t profile_shaft(profile_t *f, const profile_params_t *p, angle_t rho, speed_erpm_t speed);

/** How gain and lags follow the speed. */
void profile_follow(profile_t *f, const profile_params_t *p, speed_erpm_t speed);

/** A harmonic learns what the speed controller has to ask for at this angle, and leaks. @param error_q16 Kp times the speed's error, counts * 8, within error_most_q16 */
void profile_learn(profile_t *f, const profile_params_t *p, angle_t shaft, int16_t error_q16);

/** The learned current at this angle. */
current_q13_t profile_current(const profile_t *f, const profile_params_t *p, angle_t shaft);
#else
#define PROFILE_PARAMS
#define PROFILE_STATE
#define PARAM_PROFILE_INIT
#endif

/** A step of the learned current, before the speed controller's. */
void mode_profile_step(drive_t *d, const drive_params_t *p);

/** Lags and gain follow the speed; every 16 periods. */
void mode_profile_follow(drive_run_t *run, const drive_params_t *p);

/** The learned q current of this step; 0 without the mode. */
current_q13_t mode_profile_current(const drive_run_t *run);

/** The same with 13 fraction bits. */
int32_t mode_profile_current_q26(const drive_run_t *run);

#endif
