/* Salient motors: what the d current does to torque and back-EMF, and the d current of the least current for the torque (MTPA).
 *
 * With Lq in Equation 4 the back-EMF lies on the q axis and belongs to the flux psi - (Lq - Ld) i_d, which also makes the torque. With the
 * current I = psi/(Lq - Ld) that is psi (1 - i_d/I). The least current for a torque has i_q^2 = i_d^2 - I i_d. */
#ifndef CONTROL_SALIENCE_H
#define CONTROL_SALIENCE_H

#include "control/qmath.h"

#define SALIENCE_LEAST_SHIFT 2               /**< the d current follows in four rare steps */
#define SALIENCE_MOST_Q13 16383              /**< d current that counts: twice full scale */
#define SALIENCE_MOST_Q26 (INT32_C(1) << 28) /**< q current that can be converted: four times full scale */

/** State. Zero and salience_update() are a valid start. */
typedef struct {
    current_q13_t id_q13;    /**< d current in the rotor's frame */
    current_q13_t least_q13; /**< what the least current takes of negative d current, 0 or more */
    uint16_t flux_q13;       /**< flux over the magnets', 0.5 .. 3; 8192 = 1 */
    uint16_t per_flux_q15;   /**< one over it */
} salience_t;

/** The flux at this d current. @param double_q13 I: -i_d that doubles the flux, 256..57343 @param kfi change of 1/Kphi that was learnt */
QM_INLINE void salience_update(salience_t *s, uint16_t double_q13, q15_t kfi)
{
    int16_t least = (int16_t)((double_q13 < SALIENCE_MOST_Q13 / 2) ? -2 * (int16_t)double_q13 : -SALIENCE_MOST_Q13);
    int16_t most = (int16_t)((double_q13 < 32768u) ? double_q13 / 2u - 1u : SALIENCE_MOST_Q13);
    int16_t i_d = qm_clamp(s->id_q13, -SALIENCE_MOST_Q13, SALIENCE_MOST_Q13);
    uint16_t change;
    /* a weaker flux is changed more by the same current */
    i_d = qm_clamp((int16_t)(i_d + qm_hi(2 * qm_mulss(i_d, kfi))), least, most);
    change = qm_divud((uint32_t)(uint16_t)qm_abs(i_d) << 13, double_q13);
    s->flux_q13 = (uint16_t)((i_d < 0) ? 8192u + change : 8192u - change);
    s->per_flux_q15 = qm_divud(UINT32_C(1) << 28, s->flux_q13);
}

/** q current that would make the same torque without d current. @param iq_q13 within full scale */
QM_INLINE current_q13_t salience_torque(const salience_t *s, current_q13_t iq_q13)
{
    return (int16_t)(qm_mulsu(iq_q13, s->flux_q13) >> 13);
}

/** The q current that makes such a torque. Both with 13 fraction bits. */
QM_INLINE int32_t salience_current_q26(const salience_t *s, int32_t torque_q26)
{
    int32_t x = (torque_q26 > SALIENCE_MOST_Q26) ? SALIENCE_MOST_Q26 : (torque_q26 < -SALIENCE_MOST_Q26) ? -SALIENCE_MOST_Q26
                                                                                                         : torque_q26;
    return 2 * qm_mulsu(qm_hi(x), s->per_flux_q15) + (int32_t)(qm_muluu((uint16_t)x, s->per_flux_q15) >> 15);
}

/** 1/Kphi of the flux. @return below 65536 */
QM_INLINE int32_t salience_kfi(const salience_t *s, int16_t inv_kfi)
{
    return (int32_t)(qm_muluu((uint16_t)inv_kfi, s->per_flux_q15) >> 15);
}

/** A step towards the least current: -i_d = i_q^2/(I - i_d), which comes to its root by itself. @param double_q13 I @param iq_q13 q current; its
 *  square is below 65536 I @param wanted 0: none of it */
QM_INLINE void salience_least(salience_t *s, uint16_t double_q13, current_q13_t iq_q13, uint16_t wanted)
{
    int16_t to = 0;
    if (wanted) {
        to = (int16_t)qm_divud((uint32_t)qm_mulss(iq_q13, iq_q13), (uint16_t)(double_q13 + (uint16_t)s->least_q13));
    }
    s->least_q13 = (int16_t)(s->least_q13 + ((to - s->least_q13) >> SALIENCE_LEAST_SHIFT));
}

#endif
