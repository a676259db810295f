/* The blocks of the control law, each with all inputs and all parameters of their ranges. */
#include "any.h"

#include "control/current_control.h"
#include "control/estimator.h"
#include "control/fieldweak.h"
#include "control/forced_angle.h"
#include "control/speed_ramp.h"
#include "control/svm.h"

/** qmath.h: every function, every int16. */
void proof_qmath(void)
{
    int16_t a = ANY16(), b = ANY16(), low = ANY16();
    uint16_t u = ANYU16();
    (void)qm_mulss(a, b);
    (void)qm_mulsu(a, u);
    (void)qm_muluu(u, ANYU16());
    (void)qm_mulhi(a, b);
    (void)qm_mulhi_su(a, u);
    (void)qm_mulhi_uu(u, ANYU16());
    (void)qm_clamp(a, low, b);
    a = qm_abs(a);
    //@ check 0 <= a <= 32767;
    a = qm_sub_limited(ANY16(), ANY16());
    //@ check -16383 <= a <= 16383;
}

/** trig.h: every angle; sine and cosine stay within Q15. */
void proof_trig(void)
{
    for (uint16_t k = 0; k < 512; k++) {
        sincos_t r = trig_sincos((angle_t)(any_u(0, 127) + 128u * k));
        //@ check -32767 <= r.sin <= 32767 && -32767 <= r.cos <= 32767;
    }
    for (int16_t k = 0; k < 64; k++) {
        q15_t y = trig_circle(any((int16_t)(512 * k), (int16_t)(512 * k + 511)));
        //@ check 0 <= y <= 32767;
    }
}
