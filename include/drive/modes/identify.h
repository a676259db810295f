/* IDENTIFY: the drive measures R, Ld, Lq, Kphi, inertia and friction of an unknown motor.
 *
 * The control interrupt is the instrument (identify_run()): it holds a current, superposes a square voltage, turns a current vector
 * or lets it follow the rotor, and adds up what it sees. The background measures (identify_background()): it takes the sums, computes, and asks
 * for the next step. `ready` names the owner; the other side must not access the guarded fields. */
#ifndef DRIVE_MODES_IDENTIFY_H
#define DRIVE_MODES_IDENTIFY_H

#include "control/current_control.h"
#include "control/qmath.h"
#include "control/soft_float.h"
#include "control/svm.h"
#include "control/transforms.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

/** X(name, meaning): steps of the procedure. */
#define IDENTIFY_STEP_TABLE(X) \
    X(IDLE, "nothing is being measured") \
    X(RISE, "the voltage rises until current flows") \
    X(CONNECT, "current in a direction where all three phases carry some") \
    X(ALIGN, "the current turns to phase A and takes the rotor along; R, first level: all of the current") \
    X(RESISTANCE, "R, second level: half of the current") \
    X(BIAS, "three quarters of the current, for the inductances") \
    X(TRY_D, "square voltage on the d axis: search for an amplitude") \
    X(INDUCTANCE_D, "Ld") \
    X(TRY_Q, "the same on the q axis") \
    X(INDUCTANCE_Q, "Lq") \
    X(SPIN_HALF, "the vector turns at half of END_SPEED_RPM: back-EMF, for comparison") \
    X(SPIN_FULL, "the vector turns at END_SPEED_RPM: Kphi") \
    X(MECHANICS, "q current accelerates the rotor to twice END_SPEED_RPM, then it coasts, again and again: inertia and friction")

/** X(code, name, cause, remedy): how it went. Codes never change their meaning. */
#define IDENTIFY_RESULT_TABLE(X) \
    X(0, NONE, "nothing has been measured yet", "press S2") \
    X(1, BUSY, "the measurement is running", "wait; it takes about twelve seconds, minutes with a heavy rotor") \
    X(2, DONE, "all of it has been measured", "write them into the motor file") \
    X(3, STOPPED, "S2 or a fault ended it", "see the fault, if there is one; press S2 to begin anew") \
    X(4, NO_CURRENT, "current does not flow through all three phases: motor not connected, or a phase open", "check the three wires") \
    X(5, CURRENT_NOT_REACHED, "the bus voltage cannot drive Q_CURRENT_REF_OPENLOOP through the winding", \
      "lower Q_CURRENT_REF_OPENLOOP; check NORM_CURRENT_CONST") \
    X(6, R_RANGE, "R is not between 5 mohm and 40 ohm, the bridge included", "check KCURRA, KCURRB, NORM_CURRENT_CONST and the wires") \
    X(7, L_RANGE, "L is not between 5 uH and 60 mH, or changes the current too little to be measured", \
      "raise Q_CURRENT_REF_OPENLOOP; check the wires") \
    X(8, NOT_TURNING, "the rotor did not follow: its back-EMF is missing, slips, or is not proportional to speed", \
      "free the shaft and take the load off; raise Q_CURRENT_REF_OPENLOOP, lower OPENLOOP_RAMPSPEED_INCREASERATE") \
    X(9, VOLTAGE_LIMIT, "the bus voltage is too low for END_SPEED_RPM", "lower END_SPEED_RPM") \
    X(10, KPHI_RANGE, "Kphi is above 2000 V per 1000 rpm", "check NOPOLESPAIRS") \
    X(11, NOT_ACCELERATING, "Q_CURRENT_REF_OPENLOOP does not accelerate the rotor to twice END_SPEED_RPM, or loses it", \
      "take the load off; raise Q_CURRENT_REF_OPENLOOP or lower END_SPEED_RPM; R, L and Kphi are valid") \
    X(12, INERTIA_RANGE, "the inertia is not between 5e-8 and 2 kg m2", \
      "lower or raise Q_CURRENT_REF_OPENLOOP tenfold, or take the inertia from a drawing; R, L and Kphi are valid") \
    X(13, FRICTION_RANGE, "the friction is above 3 N m", "take the load off; R, L, Kphi and inertia are valid")

#define IDENTIFY_RESULT_NAME(code, name, cause, remedy) #name,

#ifdef IDENTIFY

#define IDENTIFY_STEP_ENUM(name, meaning) IDENTIFY_##name,

typedef enum { IDENTIFY_STEP_TABLE(IDENTIFY_STEP_ENUM) IDENTIFY_STEP_COUNT } identify_step_t;

#define IDENTIFY_RESULT_ENUM(code, name, cause, remedy) IDENTIFY_RESULT_##name = (code),

typedef enum { IDENTIFY_RESULT_TABLE(IDENTIFY_RESULT_ENUM) IDENTIFY_RESULT_COUNT } identify_result_t;

/** What the interrupt does with the bridge. */
typedef enum {
    IDENTIFY_CURRENT, /**< d current by its controller, q voltage likewise; gains 0 hold the voltage */
    IDENTIFY_GROW,    /**< the same, and the d voltage grows by 1/128 every 16 periods until ready */
    IDENTIFY_INJECT,  /**< fixed voltage and a square one */
    IDENTIFY_TURN,    /**< currents controlled while the frame turns */
    IDENTIFY_FOLLOW   /**< the same while it follows the rotor by its back-EMF */
} identify_mode_t;

/** What has been measured, in engineering units; 0 = not yet. Loop values: winding, bridge and wires together. */
typedef struct {
    uint32_t rs_uohm;          /**< phase resistance, uohm */
    uint32_t ld_nh, lq_nh;     /**< phase inductances, nH */
    uint32_t kphi_uv_per_krpm; /**< back-EMF, uV peak line to line per 1000 mechanical rpm */
    uint32_t inertia_1e9_kgm2; /**< of all that turns, 10^-9 kg m2 */
    uint32_t coulomb_1e8_nm;   /**< friction at standstill, taken from two speeds, 10^-8 N m */
    uint32_t viscous_1e9_nms;  /**< and what it grows by, 10^-9 N m s */
} identify_values_t;

/** Sums over a part of the rotor's speeds, accelerating or coasting; a line is laid through the speeds of each passage. */
typedef struct {
    int32_t units;   /**< stretches of the first length */
    int32_t current; /**< of their sums of q current */
    int32_t speed;   /**< of their speeds / 16 */
    int32_t slope;   /**< of the passages' slopes, each times its weight */
    int32_t weight;  /**< n (n^2 - 1) of a passage of n stretches, six times what belongs to the slopes */
    int32_t steps;   /**< from stretch to stretch */
    int32_t periods; /**< that they took */
} identify_part_t;

/** State. */
typedef struct {
    volatile uint16_t ready;                 /**< 1: the interrupt has finished, all of this belongs to the background; 0: the other way round */
    volatile uint16_t mode;                  /**< identify_mode_t */
    volatile uint16_t wait;                  /**< periods before the sums begin, counted once the frame stands or has its speed */
    volatile uint16_t left;                  /**< periods to sum */
    volatile uint16_t sweep;                 /**< 1: the frame turns to phase A */
    volatile uint16_t halvings;              /**< IDENTIFY_TURN: up to END_SPEED_RPM / 2^halvings */
    volatile int16_t kp_d, ki_d, kp_q, ki_q; /**< gains of the current controllers */
    volatile uint16_t shift;                 /**< and their shift */
    volatile current_q13_t rise_q13;         /**< IDENTIFY_GROW ends at this current */
    volatile int16_t bias_q14;               /**< IDENTIFY_INJECT: d voltage */
    volatile int16_t square_q14;             /**< amplitude of the square voltage */
    volatile uint16_t on_q;                  /**< 1: it is on the q axis */
    volatile uint16_t half;                  /**< periods of one half of it */
    volatile int16_t drop_d_q14, drop_q_q14; /**< IDENTIFY_FOLLOW: what the q current takes of the voltage: w Lq i_q, and R i_q */
    volatile uint16_t speed_per_emf_q5;      /**< 1/1024 angle counts a period per count of back-EMF, * 32 */
    volatile int32_t swing, swing_mean;      /**< IDENTIFY_TURN: d voltage filtered, times the filters' periods */
    volatile int32_t emf_q22;                /**< filtered back-EMF */
    volatile int32_t sum[4];                 /**< see identify_add() */
    volatile uint16_t at;                    /**< drive_t.ticks when the sums were complete */
    volatile uint16_t bus_q16;               /**< bus when the sums were complete, Q16 of full scale */

    /* The interrupt's own. */
    uint16_t half_left;        /**< periods until the square voltage changes sign */
    int16_t sign, sign_before; /**< of the square voltage commanded one and two periods ago; the next one is decided anew */
    int16_t duty;              /**< duties commanded one period ago, along the axis */
    int16_t i_before_q13;      /**< current along the axis one period ago */

    /* The background's own. */
    volatile uint16_t step;   /**< identify_step_t */
    volatile uint16_t result; /**< identify_result_t */
    identify_values_t values;
    soft_float_t duty_per_amp;              /**< duty counts per current count along phase A: R before it is scaled */
    int32_t duty_first, i_first, bus_first; /**< sums of the first level */
    int16_t ki_slow;                        /**< of the slow current controller */
    int16_t across_q13;                     /**< sqrt(3) times the current across the axis, mean of the last time */
    uint16_t unrest, swung, ramps;          /**< means in which the rotor did not rest; 1: there were some; ramps that it did not follow */
    int32_t dead_q13;                       /**< what dead time and diodes take beyond the compensation, as the current for which R takes it */
    uint16_t blocks;                        /**< stretches of back-EMF that have been evaluated */
    uint32_t emf_sum;                       /**< their lengths */
    int32_t emf_d_sum, emf_q_sum;           /**< and their components */
    uint32_t kphi_half;                     /**< uV per 1000 rpm at half speed */
    int32_t top_q10;                        /**< MECHANICS: up to this speed, and down to 3/8 of it */
    current_q13_t push_q13;                 /**< q current that accelerates */
    int32_t seen_q10;                       /**< speed in the last stretch */
    int32_t first_q10;                      /**< a rotor that is slower now than with this speed does not follow it */
    uint16_t gentler;                       /**< times that the push was too quick */
    uint16_t coasting, cycles;
    uint16_t phase_blocks, phase_units;  /**< stretches since the current changed, counted as they are and in the first length */
    uint16_t follow_log2;                /**< periods of a stretch */
    uint16_t settle[2], heavy;           /**< phase_units before stretches count, with current and without; 1: it coasts for long */
    uint16_t look_units;                 /**< when the push is looked at again */
    int32_t look_q10;                    /**< speed at the last look */
    uint16_t part;                       /**< where the passage belongs that is under way, counted from 1; 0 = none is */
    uint16_t passed, began_at, ended_at; /**< its stretches, and when the first and the last one ended */
    int32_t from_q10;                    /**< speed of the first one */
    int32_t rise, rise_moment;           /**< sums of the others' differences from it / 16, and of those times the number of the stretch */
    identify_part_t parts[3];            /**< accelerating, coasting above the middle, coasting below it */
} identify_t;

#define IDENTIFY_STATE identify_t identify;

#else
#define IDENTIFY_STATE
#endif

/* ---- IDENTIFY, the interrupt's part: one PWM period of holding, injecting or turning a vector, or of following the rotor, and of adding up ---- */

#ifdef IDENTIFY

#define IDENTIFY_START_ANGLE_Q32 0xD5555555ul /**< -60 degrees: all three phases carry current */

/** Largest voltage that holds a current: the rest is for the square voltage. */
voltage_q14_t identify_most(const voltage_circle_t *circle);

/** Current along the axis of the square voltage, in counts that both axes share: phase A, or A + 2 B = sqrt(3) beta. */
int16_t identify_current(const drive_t *d);

/** Moves the frame along with the rotor. As in the estimator (Equation 2), the sum of both components is the speed; a frame that leads has
 *  a negative speed of its own. The voltage that was commanded a period ago is centred on this sample, whose frame this still is. */
void identify_follow(drive_t *d);

/** A rotor on a current vector swings without friction: while it falls behind, which is seen in the d voltage, the frame waits for it. */
void identify_damp(drive_t *d);

/** Moves the frame. @return 1 when it stands or has reached its speed */
uint16_t identify_turn(drive_t *d, const drive_params_t *p);

/** Sign of the square voltage in the next period. */
int16_t identify_square(identify_t *id);

/** Next voltage in the frame. @param sign of the square voltage */
dq_t identify_voltage(drive_t *d, int16_t sign);

/** One period of sums.
 *
 *  Standing: duties along phase A less the dead-time compensation in them, current of phase A, of phase B, and the bus.
 *  Square voltage: with the sign s as instrument, duties, currents and current differences. A voltage commanded at sample n acts for
 *  one period from the boundary after it, half of it before sample n+1 and half after; so between the last two samples acted
 *  the mean of the vectors commanded one and two periods before this one; where their signs differ it says nothing, else both are alike.
 *  Turning: voltage d and q (centred on the sample, as commanded a period ago), current d and q. Following: speed, q current. */
void identify_add(drive_t *d, const drive_params_t *p);

/** Waits, then adds up, then hands over to the background. @param settled the frame stands or has its speed */
void identify_record(drive_t *d, const drive_params_t *p, uint16_t settled);

/** A period with the bridge switching; S2 stops at once. */
void identify_run(drive_t *d, const drive_params_t *p, duties_t *duty);

/** Prepares the first step. */
void identify_start(drive_t *d, const drive_params_t *p);

/** The background's part: evaluates a finished step and asks for the next one. Once a millisecond.
 *  @return 1 when the procedure is not running: the bridge is to be off */
uint16_t identify_background(drive_t *d, const drive_params_t *p);

#endif

/** A pass of the background. @return 1 when the motor is to stop */
uint16_t mode_background(drive_t *d, const drive_params_t *p);

#endif
