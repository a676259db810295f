/* Do the measured currents fit? An open phase and a wrong current signal, by two rules that see different motors.
 *
 *                   the law's rule: signals_check()                      the background's rule: signals_phases(), _d_current(), _offset()
 * asks first        are innovations large in time with the electrical
 *                   angle, or beyond what a load can do?
 * asks              do voltages and currents fit the motor?              does what flows follow what is asked for?
 * sums              |current| of each phase, while they do not fit       |current| of each phase, asked and measured, over 64 samples
 * OPEN_PHASE        the least sum is below a quarter of the largest      a phase's measured sum, as a share of what is asked of it, is
 *                                                                        below a quarter of the best phase's share
 * CURRENT_SENSOR    else                                                 the d current stays off its reference
 *                                                                        or whole turns leave a back-EMF
 * finds             what the observer or the voltage shows, in 0.1 s     what the controllers hide from the model: noise, a small load,
 *                                                                        an offset that swings a slow rotor
 * no limit excuses  a voltage that drives no current                     the d axis takes its voltage first, each phase its share */
#ifndef DRIVE_SIGNALS_H
#define DRIVE_SIGNALS_H

#include "control/qmath.h"
#include "drive/forward.h"

/* ---- the law's rule, in the control law's slow work ---- */

/** Sums of something times a turning pointer: large where it turns with the pointer. */
typedef struct {
    int32_t cosine, sine;
} signals_beat_t;

/** What the innovations are like while many are large. Those of a load follow the shaft; those of a wrong current signal follow the electrical angle or
 *  twice that, or are larger than any load makes them. All of it is halved where it proves nothing. */
typedef struct {
    signals_beat_t once, twice; /**< innovations times cosine and sine of the angle, and of twice the angle, erpm */
    uint32_t size;              /**< sum of their sizes */
    uint16_t checks;            /**< in the sums */
    uint16_t unexplained;       /**< of them, with a voltage that nothing explains */
    uint16_t phases[3];         /**< |current| of the phases, Q13 / 64 */
} signals_evidence_t;

/** Looks whether the voltage equation holds with what is measured, and gathers evidence while it does not: many large innovations of the load observer,
 *  or voltage that nothing explains. Slot 14 in closed loop; while something is wrong slots 3, 7, 11, 15 in its place, for the phases' sums must not meet
 *  the same angles of each turn. */
void signals_check(drive_t *d, const drive_params_t *p);

/** After a tenth of a second of it, of fast turns also where it comes and goes: the verdict. Evidence that a load can explain is halved. Slots 3 and 11 in closed loop. */
void signals_judge(drive_t *d, const drive_params_t *p);

/* ---- the background's rule ---- */

/** Sums of the phases' currents. */
typedef struct {
    uint16_t asked[3], flows[3]; /**< |current| that the references ask of the phases and that is measured, Q13 / 16 */
    uint16_t samples;            /**< in the sums */
} signals_sums_t;

/** Mean size of the d current's deviation over half a second, what the phases carry, and what stands in the back-EMF. Zero is a valid start. */
typedef struct {
    int32_t id_q16; /**< Q13 counts with 16 fraction bits */
    signals_sums_t sums;
    uint16_t sampled_tick;  /**< period of the last sample */
    signals_beat_t emf_q12; /**< sum of the back-EMF along the stator's alpha and beta axes */
    uint16_t emf_ms;        /**< in the sum */
    uint16_t emf_stood;     /**< 1: the last sum was too large */
    int16_t sine_q15;       /**< of the frame's angle when it was last looked at: a whole turn ends where it becomes positive */
} signals_t;

/** Every pass of the background. @return drive_fault_t: OPEN_PHASE when a phase carries next to none of what is asked of it, or none */
uint16_t signals_phases(signals_t *s, const drive_t *d, const drive_params_t *p);

/** Every millisecond in the background. @return drive_fault_t: CURRENT_SENSOR when the d current stays further off than dead time and noise make it, or none */
uint16_t signals_d_current(signals_t *s, const drive_t *d, const drive_params_t *p);

/** Every millisecond in the background, up to 100 turns of the field a second. Over whole turns the mean of a back-EMF is zero in the stator's frame, however
 *  the speed swings, for its integral is the flux, a function of the angle. What stays is R dI + V_dead 2/pi asin(dI/I) of a current signal that is off by dI,
 *  for the controllers let the current flow of which the signal makes a sine. Legs whose dead times differ by a fifth leave as much as is allowed; where hardly
 *  any current flows the converter's step leaves a fifth more. A sum's ends are a millisecond wide, so it may have a look of the back-EMF too many or too few:
 *  twice that is allowed on top. @return drive_fault_t: CURRENT_SENSOR when it is more over two times a quarter of a second and the turn's rest, or none */
uint16_t signals_offset(signals_t *s, const drive_t *d, const drive_params_t *p);

#endif
