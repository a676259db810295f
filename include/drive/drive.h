/* The drive's types: parameters, requests, a run, and the one object with everything the machine knows. */
#ifndef DRIVE_DRIVE_H
#define DRIVE_DRIVE_H

#include "control/motor_model.h"
#include "control/current_control.h"
#include "control/observer.h"
#include "control/svm.h"
#include "drive/catch.h"
#include "drive/held.h"
#include "drive/model.h"
#include "drive/modes/modes.h"
#include "drive/protection.h"
#include "drive/selftest.h"
#include "drive/signals.h"
#include "drive/startup.h"

/** Constants of the machine around the control law. Times in periods, or in steps of the slot that counts them (drive/schedule.h): 8, 16
 *  or 32 periods apart, with deferred duties twice as many. */
struct drive_params {
    estimator_params_t estimator;
    fieldweak_params_t fieldweak;
    forced_angle_params_t forced;
    svm_params_t svm;
    pi_gains_t pi_d, pi_q;
    adaptation_params_t adaptation;
    observer_params_t observer;
    int16_t speed_kp_q13, speed_kp_fast_q13; /**< q current counts * 8192 per erpm: as a rule, and after a large innovation */
    int16_t sample_shift_q16;                /**< q current that a sample after the centre of the low sides' conduction misses, counts
                                                   * 65536 per erpm: delay * psi / L */

    q15_t kcurr_a, kcurr_b; /**< gain of the samples; Q15 sample to Q13 current by the high word */
    int16_t offset_max_q13; /**< largest plausible offset */
    uint16_t bootstrap_periods;
    uint16_t flying_start; /**< 1: a start looks whether the rotor turns (FLYING_START) */
    uint16_t align_periods;
    uint16_t agree_steps;         /**< agreement needed for the hand-over */
    uint16_t wait_periods;        /**< how long it may take at the end of the ramp */
    uint16_t align_rate_q12;      /**< by which the current of ALIGN grows every period, Q13 counts * 4096 */
    voltage_q14_t align_rise_q14; /**< what the header's R takes more from turn to turn of ALIGN; 0: R is not measured */
    int32_t align_speed_q10;      /**< of the forced angle in ALIGN */
    speed_erpm_t early_erpm;      /**< from this forced speed on the estimator may take over */

    current_q13_t open_loop_q13;        /**< Q_CURRENT_REF_OPENLOOP */
    current_q13_t current_max_q13;      /**< MAXIMUM_CURRENT_A */
    current_q13_t flux_brake_most_q13;  /**< most d current that burns energy in the winding; 0 where that would be no gain */
    current_q13_t supply_limit_q13;     /**< SUPPLY_CURRENT_LIMIT_A as a q current at the voltage circle; 0: none */
    int16_t derate_per_bus_q8;          /**< driving current per bus count below DERATE_BELOW_V, Q13 counts * 256; 0: none is taken off */
    uint16_t current_max_reciprocal;    /**< 2^25 / current_max: current * this >> 10 is a Q15 ratio */
    current_q13_t overcurrent_q13;      /**< OVER_CURRENT_THRESHOLD_A */
    int32_t i2t_most_q25;               /**< square of I2T_CURRENT_A; 0: no I2t */
    uint16_t i2t_rate_q16;              /**< OVERLOAD_STEP_MS / I2T_TIME_SEC */
    uint16_t bus_shift;                 /**< 1..3: bus_q15 shifted by it fills a word */
    uint16_t voltage_limit_per_bus_q16; /**< see scaling/current_voltage.h */
    uint32_t duty_per_volt_numerator;
    int16_t bus_over_q15, bus_under_q15; /**< trip levels */
    int16_t bus_used_q15;                /**< most of it that the law makes use of: the formats end */
    int16_t bus_regen_q15;               /**< braking current falls from here */
    int16_t brake_per_bus_q8;            /**< braking current taken off per bus count above, Q13 counts * 256 */
    int16_t bus_nominal_q15;             /**< start value of the bus filter */

    speed_erpm_t minimum_erpm, nominal_erpm, maximum_erpm, end_erpm;
    uint16_t pot_zero_q16;     /**< dead end of the potentiometer's travel, POT_LIVE_ZERO */
    uint16_t pot_scale_q15;    /**< 1 / (1 - 2 POT_LIVE_ZERO) */
    int32_t speed_ramp_q16;    /**< reference step every 8 periods, electrical rpm with 16 fraction bits */
    int32_t speed_decel_q16;   /**< the same towards standstill, SPEEDREF_DECEL_RPM_PER_S or speed_ramp_q16 */
    int32_t tuning_step_q16;   /**< the same in TUNING */
    int16_t ramp_hold_erpm;    /**< the ramp waits while the motor is this far behind (or ahead when slowing) */
    uint16_t stall_steps;      /**< steps of 16 periods below half the reference that are a stall */
    uint16_t lost_lock_steps;  /**< of 16 periods: out of lock that are a lost one */
    uint16_t wrong_steps;      /**< of 8 periods: voltages and currents do not fit the motor */
    uint16_t load_erpm;        /**< mean innovation that no load can make that the motor can carry */
    uint16_t impossible_steps; /**< of 32 periods: flux or resistance beyond what a motor can have */
    q15_t kfi_impossible;      /**< change of 1/Kphi that asks for more flux than the header's may be off */
    current_q13_t id_off_q13;  /**< d current's mean deviation that noise and dead time make at most */
    q15_t rs_impossible;       /**< change of R that no winding survives; INT16_MAX: the format ends before */
    q15_t rs_off_least;        /**< how far R may be below the header's, as a share of it: negative */
    q15_t rs_off_most;         /**< and above */
    q15_t ls_off;              /**< how far L may be off, to either side */
    int16_t dead_emf_q12;      /**< what dead time may put into the back-EMF */
    speed_erpm_t overspeed_erpm;
    HEAT_PARAMS
    SALIENT_PARAMS
    PROFILE_PARAMS
};

/** Requests from the background; 16-bit, so written in one instruction. */
typedef struct {
    volatile int16_t run;         /**< 1: start and keep running (see drive_start()), 0: stop in order; faults clear it */
    volatile int16_t clear_fault; /**< 1: one request, taken back by the tick */
    volatile int16_t target_erpm; /**< speed target, signed; TORQUE_MODE: q current, Q13 */
} drive_command_t;

/** Controller variables of the closed loop. */
typedef struct {
    speed_erpm_t reference_erpm;   /**< ramped speed reference */
    uint16_t ramp_q16;             /**< what its last step left below a whole electrical rpm */
    uint16_t ramp_waits;           /**< 1: its last step waited for the motor */
    dq_t ref_q13;                  /**< current references */
    current_q13_t iq_limit_q13;    /**< sqrt(Imax^2 - Id^2); of a driving current also what supply and bus allow */
    current_q13_t supply_q13;      /**< q current that the supply's limit allows, damped */
    uint16_t limited_by;           /**< the reason for an iq_limit_q13 below the circle, limit_reason_t */
    current_q13_t over_q13;        /**< q current beyond its reference, for which its limit is lower */
    current_q13_t brake_limit_q13; /**< largest braking current, from the bus */
    current_q13_t flux_brake_q13;  /**< d current that burns what the bus does not take, 0 or more */
    dq_t i_q13;                    /**< measured currents in the control frame */
    dq_t v_q14;                    /**< commanded voltages in the control frame */
    voltage_q14_t vq_limit_q14;
    pi_t pi_d, pi_q;
    int16_t speed_kp_q13;             /**< the speed controller's gain in use */
    int32_t iq_trim_q26;              /**< what its load's estimate misses at rest */
    speed_erpm_t trim_reference_erpm; /**< the reference at its last step */
    speed_erpm_t swung_erpm;          /**< its sign is that of the last large error */
    uint16_t swing_steps;             /**< large errors to either side, SPEED_SWING_STEPS each, less the time since */
    int16_t iq_rest_q26;              /**< what its last step left below a whole count of q current */
    current_q13_t sample_shift_q13;   /**< q current that the sample misses at this speed */
} drive_control_t;

/** What a start begins anew: all of it is cleared. */
struct drive_run {
    estimator_t estimator;
    motor_model_t model; /**< the motor's constants, from the tables and the adaptation */
    fieldweak_t fieldweak;
    adaptation_t adaptation;
    observer_t observer;
    handover_t handover;
    held_t held;
    align_t align;
    catch_t catching;
    drive_control_t control;
    uint16_t stall_steps;         /**< of 16 periods below half the reference, less four for each above */
    uint16_t probe_phase;         /**< probe_phase_t, of the probe whether the rotor turns; written by probe_enter() only */
    uint16_t probe_steps;         /**< in the phase */
    uint16_t probe_asked;         /**< 1: something changed fast since the last one, so the next comes soon */
    uint16_t dip_steps;           /**< how long the speed has been a quarter below the reference; more than a dip while the probe's own lasts */
    current_q13_t probe_id_q13;   /**< its d current */
    current_q13_t probe_most_q13; /**< and the most of it */
    signals_evidence_t evidence;  /**< while wrong_steps grow */
    uint16_t impossible_steps;    /**< how long flux or resistance has been impossible */
    uint16_t lost_lock_steps;     /**< two for each 16 periods out of lock, less one for each in lock */
    alphabeta_t deferred_v_q13;   /**< the vector whose duties wait for the next control interrupt, where they do */
    SALIENT_STATE
    MODE_STATE
};

/** Everything the drive knows. Owned by the board; zero plus drive_init() is the start. */
struct drive {
    drive_command_t command;
    volatile uint16_t state; /**< drive_state_t; written by states_write() only */
    volatile uint16_t fault; /**< drive_fault_t, kept until cleared; drive_raise(), drive_clear_fault() */
    volatile uint16_t ticks; /**< periods since power-up, wraps; the background's time base */
    uint16_t periods;        /**< in the present state: CALIBRATE, BOOTSTRAP, CATCH and ALIGN count it, RAMP at its end, BRAKE without current */
    int16_t direction;       /**< +1 or -1, of the run; of a rotor that was caught backwards until it is reversed */

    calibration_t calibration;
    phases_t phases_q13;     /**< measured */
    int32_t bus_q31;         /**< filtered bus, upper word Q15 of full scale */
    voltage_circle_t circle; /**< voltage circle at this bus */
    uint16_t duty_per_volt_q16;
    forced_angle_t forced;     /**< a start clears it, with all that follows (drive_start()) */
    dead_duties_t dead;        /**< dead-time compensation of the next two pulses, or of the first */
    dead_duties_t dead_second; /**< of the second pulse to come, where each has its own */
    angle_t angle;             /**< control angle of the next sample */
    sincos_t frame;            /**< its sine and cosine */
    drive_run_t run;
    HEAT_STATE
    SELFTEST_STATE
};

#define CALIBRATION_LOG2 10 /* 1024 samples: 51 ms at 20 kHz */

#endif
