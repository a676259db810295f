/* A shaft that is held: the rotor stands while the drive turns it, and then it is let go.
 *
 * The estimator cannot see a rotor that stands: R i and a back-EMF look alike. Its angle runs away, and a shaft that is let go is thrown wherever the
 * angle has come to. So where the rotor may stand, the angle stands, too, and the current with it. A back-EMF that stands still is R i alone: it tells R,
 * and how far the angle had run. One that turns or changes is a rotor that turns: where it has turned all the time, its direction in the frame that
 * stands says where the rotor is, and the estimator goes on from there. The less of it there is, the longer the question takes: dead time must not hide it. */
#ifndef DRIVE_HELD_H
#define DRIVE_HELD_H

#include "control/transforms.h"
#include "drive/forward.h"

/** What is known of the rotor. From HELD_SETTLES on the angle stands. */
typedef enum {
    HELD_NOT,     /**< it turns as it should */
    HELD_TURNS,   /**< it was asked, and turns */
    HELD_SETTLES, /**< the angle stands, until the back-EMF does */
    HELD_ASKED,   /**< both stand: does the back-EMF turn as a rotor would? */
    HELD_STANDS   /**< the rotor stands, until the back-EMF moves */
} held_phase_t;

/** What follows from a step, a while later: each of them takes a slot of its own. */
enum {
    HELD_WAITS,      /**< nothing */
    HELD_STOP,       /**< the angle stops */
    HELD_HAS_TURNED, /**< the rotor has turned all the time */
    HELD_LEARN,      /**< the rotor stands: all of the back-EMF is R i */
    HELD_TURN_BACK,  /**< the frame turns back by what R i had turned it, and on by what the rotor came */
    HELD_GOES_ON     /**< it stood, and turns now */
};

/** A rotor that may be held. A step is two of the load observer's, 16 periods. Zero is a valid start. */
typedef struct {
    uint16_t phase;          /**< held_phase_t; written by held_enter() only */
    uint16_t act;            /**< HELD_WAITS .. HELD_GOES_ON: what waits for the rotor's next step */
    uint16_t steps;          /**< in the phase */
    uint16_t doubts;         /**< steps that look like a held rotor; a rotor far below its reference counts three */
    uint16_t doubted_steps;  /**< since then; from HELD_ASKED on those that R i had turned the frame in */
    int16_t turned_q12;      /**< from HELD_ASKED on the sum of what the back-EMF's q part gained, a step each: flux times the angle turned; before, of all of it */
    int16_t came_q12;        /**< that sum until it was asked, less that of R i: what it turned by that came to its stop, and what the filter was behind */
    uint16_t patience;       /**< steps that the back-EMF has to settle */
    uint16_t stood;          /**< since the rotor was as fast as it should be: 1 it has stood, so R is known; 2 and has turned again */
    dq_t emf_q12;            /**< filtered back-EMF of the last step; of an older one from HELD_ASKED on */
    int16_t lag_q12;         /**< back-EMF that is in the filter alone: how far it is behind; that which was when the angle stopped */
    int16_t inv_kfi;         /**< of the model when the angle stopped */
    int16_t emf_sum_max_q12; /**< and its limit of the sum of back-EMFs */
    int16_t load;            /**< the load before all that, in units of the load observer: high word of its load_q16 */
    int16_t run_on;          /**< by how much the frame turns back next, besides, angle counts */
    angle_t went;            /**< the frame's angle when the speed was last above three quarters of the reference */
} held_t;

/** 1 while the angle stands. The model's 1/Kphi is 0 then: no back-EMF turns the angle. */
uint16_t held_angle_stands(const held_t *shaft);

/** Begins anew: the angle turns, and nothing is known of the rotor. For a ramp that follows the closed loop, and for any start. */
void held_forget(held_t *shaft);

/** The speed whose field weakening is used: a rotor below half of the reference needs that of twice its speed, or none. Both are not negative. */
speed_erpm_t held_weakened_for(const drive_params_t *p, speed_erpm_t reference, speed_erpm_t speed);

/** Angle counts by which the filter y += K (x - y) turned the frame on from a rotor that stopped at once: w/K periods' turns, w of lag_q12 by held_t's inv_kfi. Half a turn at most. */
int16_t held_lead(const drive_run_t *run, const drive_params_t *p, int16_t lag_q12);

/** A step, slots 5 and 13 in closed loop. */
void held_step(drive_t *d, const drive_params_t *p);

/** What the last step has decided, slots 1 and 9. */
void held_act(drive_t *d, const drive_params_t *p);

#endif
