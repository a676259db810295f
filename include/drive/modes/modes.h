/* The seam between the drive and its modes: each mode defines its hook twice, with the mode and without it.
 *
 * hook                  mode                   what it takes over
 * MODE_RUN              IDENTIFY, BRINGUP      a period with the bridge switching
 * MODE_ALIGNS           IDENTIFY, BRINGUP      what ALIGN does in slots 0, 4, 8, 12
 * mode_start            IDENTIFY, BRINGUP      the end of drive_start()
 * mode_idle             BRINGUP                a period with the bridge off
 * mode_background       IDENTIFY               a pass of the background
 * mode_reference_step   TUNING                 the speed reference in closed loop
 * mode_speed_target     TUNING                 the speed that the reference goes to
 * mode_current_step     TORQUE_MODE            the speed controller in closed loop
 * mode_limit_reasons    TORQUE_MODE            why the commanded current is not given
 * mode_target_range     TORQUE_MODE            what the potentiometer's travel means
 * mode_profile_step     TORQUE_PROFILE         the learned current, before the speed controller's step
 * mode_profile_follow   TORQUE_PROFILE         its gain and lags
 * mode_profile_current  TORQUE_PROFILE         what the speed controller adds and the load observer does not see
 * mode_pot_split        BIDIRECTIONAL_SPEED    the potentiometer's direction
 * mode_hands_over       OPEN_LOOP_FUNCTIONING  the hand-over
 * MODE_PARAMS_PLACE     PARAMS_IN_RAM, TUNING  where the parameters are
 * mode_asked            SCOPE                  the currents that the controllers are asked for
 * mode_observed         SCOPE                  the angle that the load observer sees
 *
 * SNAPSHOT is called by the board, which owns its arrays. With BRINGUP the board calls bringup_pass() in place of application_tick(). */
#ifndef DRIVE_MODES_MODES_H
#define DRIVE_MODES_MODES_H

#include "drive/inputs.h"
#include "drive/modes/bringup.h"
#include "drive/modes/identify.h"
#include "drive/modes/profile.h"

/** What runs a period with the bridge switching; and 1 where ALIGN is the start's. */
#if defined IDENTIFY
#define MODE_RUN identify_run
#define MODE_ALIGNS 0
#elif defined BRINGUP
#define MODE_RUN bringup_run
#define MODE_ALIGNS 0
#else
#define MODE_RUN drive_run
#define MODE_ALIGNS 1
#endif

/** The last thing that drive_start() prepares. */
void mode_start(drive_t *d, const drive_params_t *p);

/* ---- What the modes add to the state of a run: nothing unless userparams.h or DEFINES switches one on ---- */

/* A sine that a client on the serial line adds to measure the loops (make response, docs/response.md); it ends by itself, and with the run.
 * The current loops are opened at their reference, the speed loop where the load observer gets its angle. */
#if SCOPE
/** The sine: the client writes `left` last, and sizes within what the loops carry. */
typedef struct {
    uint16_t left;        /**< slow steps until it ends, of SLOW_PERIODS; 0: there is none */
    angle_t step;         /**< of a period, 65536 = one turn */
    angle_t angle;        /**< in this period */
    int16_t size_iq_q16;  /**< peak beside the q current asked for, of full scale; both together stay within the largest current */
    int16_t size_rho_q17; /**< peak beside the estimator's angle, turns: at most a quarter */
} sine_t;
#define SINE_STATE sine_t sine;
#else
#define SINE_STATE
#endif

/** Members of drive_run_t. */
#define MODE_STATE IDENTIFY_STATE BRINGUP_STATE PROFILE_STATE SINE_STATE

/** 1 where the mode has work in every period. */
#ifdef SNAPSHOT
#define MODE_RECORDS 1
#else
#define MODE_RECORDS 0
#endif

/** 1 where the slow work is called in every period, whether its slots are due or not: the scope and SNAPSHOT look at each. */
#define MODE_SEES_EVERY_PERIOD (SCOPE || MODE_RECORDS)

/** 0 where no state has a closed loop: what belongs to it is left out. */
#if defined BRINGUP || defined IDENTIFY
#define MODE_CLOSES_LOOP 0
#else
#define MODE_CLOSES_LOOP 1
#endif

/* ---- OPEN_LOOP_FUNCTIONING: the forced angle keeps turning the motor at END_SPEED_RPM, for a first look at currents and voltages ---- */

/** 1 if the end of the ramp leads to closed loop. */
uint16_t mode_hands_over(void);

/* ---- TUNING: in closed loop the reference climbs slowly to the maximum speed, whatever the potentiometer says ---- */

/** The speed that the reference goes to. STOPPING ramps to three quarters of the minimum speed, where it ends: the rates follow the reference. */
speed_erpm_t mode_speed_target(const drive_t *d, const drive_params_t *p);

/** One step of the reference in closed loop. @return 1 if the mode has taken it; a stop is never its own */
uint16_t mode_reference_step(drive_t *d, const drive_params_t *p);

/* ---- BIDIRECTIONAL_SPEED: the middle of the potentiometer is the lowest speed, its two halves are the two directions ---- */

#ifdef BIDIRECTIONAL_SPEED
#define MODE_TWO_DIRECTIONS 1
#else
#define MODE_TWO_DIRECTIONS 0
#endif

/** The potentiometer's travel and direction. @param direction of the running motor, which the middle keeps; becomes +1 or -1 @return the travel, Q16 */
uint16_t mode_pot_split(uint16_t pot_q16, int16_t *direction);

/* ---- TORQUE_MODE: the potentiometer commands the q current; speed is only limited ---- */

/** What the ends of the potentiometer's travel mean: speeds, or q currents in Q13. @param fast_range S3's speed range, NOMINAL to MAXIMUM; not with two directions */
pot_range_t mode_target_range(const drive_params_t *p, int16_t fast_range);

/** 1 while the mode, and no speed controller, makes the q current. */
uint16_t mode_commands_current(const drive_t *d);

/** The q current in CLOSED: as commanded, between what would hold the minimum speed, below which the estimator would lose the rotor, and
 *  what holds the maximum speed. Both come from the speed controller's own law, which has no memory: limits are met and left without
 *  a bounce, and a stop goes on from what is there. @param iq_q13 the result @return 1 if the mode has taken the step */
uint16_t mode_current_step(drive_t *d, const drive_params_t *p, current_q13_t *iq_q13);

/** Why the commanded current is not given. @param reasons the result @return 1 if the mode, and no speed reference, is in command */
uint16_t mode_limit_reasons(const drive_t *d, const drive_params_t *p, uint16_t *reasons);

/* ---- SCOPE: the sine that measures the loops ---- */

/** The currents that the controllers are asked for in this period: the references, and the sine's next value. */
dq_t mode_asked(drive_run_t *run, const drive_params_t *p);

/** A slow step of the sine's time. */
void mode_sine_step(drive_run_t *run);

/** The angle that the load observer sees: the estimator's, and the sine's. @return 2^32 = one turn */
uint32_t mode_observed(const drive_run_t *run);

/* ---- SNAPSHOT, AN1292's recorder: four arrays filled with one row every SNAPDELAY periods, on request ---- */

/** Recorder; the arrays belong to the board and bear AN1292's names. */
typedef struct {
    int16_t *column[4];       /**< SnapBuf1..4: phase current a, q current, filtered speed, angle */
    uint16_t rows;            /**< DATA_BUFFER_SIZE */
    uint16_t delay;           /**< SNAPDELAY, periods per row */
    volatile uint16_t *start; /**< set to 1 to record; goes back to 0 when done */
    volatile uint16_t *done;  /**< 1 when the arrays are full */
    uint16_t row, wait;
} snapshot_t;

/** One period of the recorder. Currents are in AN1292's format (Q15 of full scale). */
void snapshot_tick(snapshot_t *s, const drive_t *d);

#endif
