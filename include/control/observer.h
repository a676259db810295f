/* The load observer: from the speed that the estimator sees and the q current, the rotor's speed and the load on it.
 *
 * The shaft obeys J dw/dt = Kt (i_q - i_load). The observer runs this model beside the motor and corrects it by what the estimated
 * speed w^ says, with both poles at the rate r:
 *
 *     dw/dt = Kt/J (i_q - i_load) + 2 r (w^ - w),    d i_load/dt = -r^2 J/Kt (w^ - w)
 *
 * i_load goes to the controller as it is, so the loop is stiff without waiting for an integral. The rate follows what is known: slow
 * without load, where dead time disturbs the back-EMF most; quicker under load; quickest for a while after a large innovation
 * w^ - w; and all in proportion to the speed at low speed, for the estimator's own lock is as quick as the rotor turns. What counts as
 * large grows while large ones go on, and one that turns back ends the answer: a step of the load stands out from the calm before it and
 * has one direction, the loop's own swing does not. */
#ifndef CONTROL_OBSERVER_H
#define CONTROL_OBSERVER_H

#include "control/qmath.h"

/** Constants; `erpm` stands for counts of speed_erpm_t. A step is eight periods, with deferred duties sixteen.
 *  Accelerations have a unit of their own, erpm per step / 2^shift, chosen so that a count of current gives 1/2 to 1 of it. */
typedef struct {
    int16_t deltat_q32;                      /**< angle in an eighth of a step and erpm: per period, see estimator_params_t */
    int16_t per_turn_q12;                    /**< speed that turns 2^16 counts of the angle's 2^32 further in a step, erpm * 4096 */
    uint16_t shift;                          /**< 0..15 */
    uint16_t per_current_q16;                /**< units a count of q current, 32768..65535 */
    uint16_t per_unit_q15;                   /**< counts of q current a unit: 2^31 / per_current_q16 */
    int16_t innovation_max_erpm;             /**< |w^ - w| counts up to here, erpm: keeps a step of the load in its word */
    int16_t load_max;                        /**< largest |load|, units */
    int16_t quiet_q16, loaded_q16, fast_q16; /**< rate * step: without load, under load, after a large innovation */
    speed_erpm_t full_erpm;                  /**< speed reference from which the rates are these; below in proportion */
    int16_t load_from, load_width;           /**< the load that begins to count, and over what more it counts, units */
    int16_t load_slope_q15;                  /**< 32767 / load_width */
    int16_t gate_erpm, gate_loaded_erpm;     /**< what a large innovation is: without and under load, and 1/32 of the speed more */
} observer_params_t;

/** State. */
typedef struct {
    int32_t omega_q16;       /**< speed, erpm with 16 fraction bits */
    int32_t load_q16;        /**< acceleration that the load takes, units with 16 fraction bits */
    uint32_t rho_q32;        /**< the estimator's angle a step ago */
    int16_t rate_q16;        /**< rate * step in use */
    int16_t wrong_erpm;      /**< larger innovations are not dead time's; twice as much without load, when it disturbs most */
    int16_t gate_erpm;       /**< a large innovation begins here */
    q15_t fast_share_q15;    /**< 1 = a large innovation was just seen */
    int16_t innovation_erpm; /**< of the last step: the speed that was seen, less the one expected */
    uint16_t wrong_steps;    /**< steps with an innovation above wrong_erpm, less those without */
    int16_t gate_last_erpm;  /**< the last large innovation */
    uint16_t gate_level;     /**< four for each step that was not calm, less one for each that was */
    q15_t share_q15;         /**< of the full rates, by the speed */
} observer_t;

/** Speed, electrical rpm. */
speed_erpm_t observer_speed(const observer_t *o);

/** The q current that holds the load, with 13 fraction bits. */
int32_t observer_load_q26(const observer_t *o, const observer_params_t *p);

/** observer_load_q26() in whole counts. */
current_q13_t observer_load(const observer_t *o, const observer_params_t *p);

/** 1 while nothing changes fast: no innovation has been large in the last 50 ms or so. */
uint16_t observer_gate_is_closed(const observer_t *o);

/** a + (b - a) * share; b - a fits a word. @param share 0..1 */
int16_t observer_between(int16_t a, int16_t b, q15_t share);

/** 2 * share, at most 1. @param share 0..1 */
q15_t observer_twice(q15_t share);

/** The speed and a change of it, within the format. @param change at most 2^30 */
int32_t observer_sum(int32_t omega_q16, int32_t change);

/** Begins at a known angle and speed with a known q current, calm. @param speed_erpm at most 32700 */
void observer_preset(observer_t *o, const observer_params_t *p, uint32_t rho_q32, speed_erpm_t speed_erpm, current_q13_t iq_q13);

/** What counts as a large innovation after so much unrest: up to 16 times as much. @param calm_erpm 0..32767 @param gate_level some thousand at most */
int16_t observer_gate(int16_t calm_erpm, uint16_t gate_level);

/** As much unrest as at the hand-over, at least. */
void observer_raise_gate(observer_t *o);

/** The rate for the next step. @param speed magnitude of the speed reference @param iq_q13 q current asked for, above -32768 */
void observer_schedule(observer_t *o, const observer_params_t *p, speed_erpm_t speed, current_q13_t iq_q13);

/** By how much the angle has turned further in a step than the speed says, as a speed. The mean over the step, not a sample: a step of current gives the
 *  back-EMF a pulse and, over the derivative's eight samples, its opposite, which cancel over eight periods. The difference wraps with the angle, so no speed
 *  is too high. @param rho_q32 the estimator's angle @param omega_erpm speed in the middle of the step @return erpm, within innovation_max_erpm */
int16_t observer_innovation(observer_t *o, const observer_params_t *p, uint32_t rho_q32, speed_erpm_t omega_erpm);

/** By how much the load's estimate falls: innovation * rate^2 in all its bits, for a slow rate's square is below a word's last.
 *  @param innovation erpm @param rate_q16 rate * step @return the observer's units, 16 fraction bits */
int32_t observer_load_step(const observer_params_t *p, int16_t innovation, int16_t rate_q16);

/** What a step's innovation calls for: in full from one and a half of what is large; none while it is the loop's own swing. */
void observer_answer(observer_t *o, int16_t innovation);

/** One step. @param rho_q32 the estimator's angle @param iq_q13 measured q current */
void observer_step(observer_t *o, const observer_params_t *p, uint32_t rho_q32, current_q13_t iq_q13);

#endif
