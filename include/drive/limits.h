/* Limits of the current: the d axis takes what field weakening and hand-over ask for, the q axis gets the rest of the circle,
 * and braking what the bus absorbs. */
#ifndef DRIVE_LIMITS_H
#define DRIVE_LIMITS_H

#include "drive/drive.h"
#include "drive/limit_reasons.h"
#include "drive/salient.h"

#define LIMITS_MISSING_Q14 4       /**< voltage counts that a count of missing q current asks for */
#define LIMITS_BURN_STEP_Q13 32    /**< a step of the d current that burns: MAXIMUM_CURRENT_A takes a twentieth of a second */
#define LIMITS_MISSING_MOST_Q13 64 /**< missing q current that counts at most */

/** Voltage that the q axis has left, less what the missing q current asks for: a limit that is only touched now and then takes no more d
 *  current than it must, and one that costs speed takes what it needs. */
QM_INLINE voltage_q14_t limits_free_voltage(const drive_control_t *c)
{
    int16_t missing = (int16_t)(c->ref_q13.q - c->i_q13.q);
    if (c->ref_q13.q < 0) {
        missing = (int16_t)-missing;
    }
    return (int16_t)(c->vq_limit_q14 - qm_size(c->v_q14.q) - LIMITS_MISSING_Q14 * qm_clamp(missing, -LIMITS_MISSING_MOST_Q13, LIMITS_MISSING_MOST_Q13));
}

/** Most that the d axis and braking ask for: what the current controllers overshoot stays within MAXIMUM_CURRENT_A. */
QM_INLINE current_q13_t limits_asked_most(const drive_params_t *p)
{
    return (int16_t)(p->current_max_q13 - (p->current_max_q13 >> 5));
}

/** 1 while the bus, and not the circle, holds the q current. With no braking current at all its reference is 0, which has no sign. */
QM_INLINE uint16_t limits_bus_holds(const drive_control_t *c, speed_erpm_t speed)
{
    return (uint16_t)(c->brake_limit_q13 < c->iq_limit_q13 && qm_size(c->ref_q13.q) == c->brake_limit_q13 && (c->ref_q13.q == 0 || (c->ref_q13.q ^ speed) < 0));
}

/** The d current that burns the rotor's energy in the winding: more while the bus holds the braking current back, less while the circle does or
 *  nothing. Where both do alike, the vector is as long as it may be and the bus takes nothing. Before the next limits_braking(). */
QM_INLINE void limits_burn(drive_run_t *run, const drive_params_t *p)
{
    drive_control_t *c = &run->control;
    int16_t step = (int16_t)(limits_bus_holds(c, observer_speed(&run->observer)) ? LIMITS_BURN_STEP_Q13 : -LIMITS_BURN_STEP_Q13);
    c->burn_q13 = qm_clamp((int16_t)(c->burn_q13 + step), 0, p->burn_most_q13);
}

/** What a circle leaves beside a current of the other axis, by the circle table.
 *  @param reciprocal 2^25 / most_q13 @param other_q13 not negative @return 0..most_q13 */
NOINLINE current_q13_t limits_circle(current_q13_t most_q13, uint16_t reciprocal, uint16_t other_q13)
{
    uint32_t ratio = qm_muluu(other_q13, reciprocal) >> 10;
    if (ratio > 32767u) {
        ratio = 32767u;
    }
    return qm_mulhi_su(most_q13, (uint16_t)(2u * (uint16_t)trig_circle((int16_t)ratio)));
}

/** What MAXIMUM_CURRENT_A leaves. A pointer to the parameters would keep all of them in the image. */
QM_INLINE current_q13_t limits_beside(const drive_params_t *p, uint16_t other_q13)
{
    return limits_circle(p->current_max_q13, p->current_max_reciprocal, other_q13);
}

/** d current: what is left of the hand-over, the table with its trim or what is burnt, the rotor's probe; the q current gets the rest of the circle. */
QM_INLINE void limits_current(drive_run_t *run, const drive_params_t *p)
{
    drive_control_t *c = &run->control;
    int16_t id_max = limits_asked_most(p), id_q13;

    fieldweak_trim(&run->fieldweak, &p->fieldweak, limits_free_voltage(c), estimator_speed(&run->estimator));
    id_q13 = (int16_t)(run->handover.id_q13 + salient_id(run, p) + run->fieldweak.trim_q13 + run->probe_id_q13 - c->burn_q13);
    c->ref_q13.d = qm_limit_called(id_q13, id_max);
    c->iq_limit_q13 = limits_beside(p, (uint16_t)qm_size(c->ref_q13.d));
}

/** Largest braking current: falls to nothing over the 2 V above REGEN_LIMIT_V. @param bus_q15 of this moment: a filter's lag would let the bus
 *  capacitor and this limit swing */
QM_INLINE void limits_braking(drive_run_t *run, const drive_params_t *p, int16_t bus_q15)
{
    int16_t over = (int16_t)(bus_q15 - p->bus_regen_q15);
    int16_t most = limits_asked_most(p);

    if (over > 0) {
        int32_t less = qm_mulss(over, p->brake_per_bus_q8) >> 8;
        most = (int16_t)((less > most) ? 0 : most - less);
    }
    run->control.brake_limit_q13 = most;
}

/** Limits braking current to what the bus absorbs. @param iq_q13 the speed controller's output @return the q current */
QM_INLINE current_q13_t limits_apply_braking(const drive_control_t *c, speed_erpm_t speed, current_q13_t iq_q13)
{
    if ((iq_q13 ^ speed) < 0) {
        return qm_limit_called(iq_q13, c->brake_limit_q13);
    }
    return iq_q13;
}

#endif
