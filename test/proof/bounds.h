/* The bounds that the proofs share; each is what one function promises and the next one may rely on. */
#ifndef PROOF_BOUNDS_H
#define PROOF_BOUNDS_H

#include "drive/drive.h"
#include "drive/param_init.h"

/** The parameters under proof: those of the userparams.h on the include path. */
static drive_params_t params;

static int16_t alpha_max;   /**< alpha current below the trip level, Q14: 2 OC */
static int16_t beta_max;    /**< beta current, Q14: 4/sqrt(3) OC, rounded up */
static int16_t radius_max;  /**< voltage circle at the over-voltage trip, Q14 */
static int16_t voltage_max; /**< alpha or beta voltage of a vector in that circle, Q13, and 3 % for the pieces of its proof */
static int16_t emf_dq_max;  /**< d or q back-EMF, Q12 */
static int16_t erpm_max;    /**< speed command */
static int16_t current_max; /**< d and q reference, Q13 */
static int16_t sample_shift_max; /**< q current that a sample misses, Q13 */
static int32_t forced_max;  /**< speed of the forced angle: the ramp's end, or a rotor's that the ramp takes over, 1/1024 angle counts a period */
static uint16_t rs_max;     /**< R with the adaptation's largest change */

/** Largest integrator of the current controllers. */
#define RATE_MOST_Q16 24576 /* LOAD_BANDWIDTH_HZ's relation in param_limits.h */
#define SUM_MAX 1350000000l
/** Inputs of the controllers for which that is proved. */
#define PI_ERROR_MAX 22400
#define PI_KC_MIN 29491 /* 0.9 */
/** Measured q current with what the sample misses, Q13. */
#define IQ_MAX 22000

/** Largest ls_q16 that field weakening can set. */
static uint16_t largest_ls(void)
{
    int16_t most = 0;
    for (int i = 0; i < FIELDWEAK_ENTRIES; i++) {
        if (params.fieldweak.ls_over2ls0_q15[i] > most) {
            most = params.fieldweak.ls_over2ls0_q15[i];
        }
    }
    return (uint16_t)(qm_muluu(params.fieldweak.ls_base_q16, (uint16_t)most) >> 14);
}

/** Largest rs_q16 that the adaptation can set. */
static uint16_t largest_rs(void)
{
    const adaptation_params_t *a = &params.adaptation;
    int32_t rs = a->rs_base_q16 + 2 * (int32_t)qm_mulhi_su(a->rs_most, a->rs_base_q16);
    return (uint16_t)((rs > 65535) ? 65535 : rs);
}

/** Length of Equation 4's vector in Q13: circle, resistance, and an inductance with both axes at their limit. */
static int32_t longest_emf(void)
{
    const estimator_params_t *e = &params.estimator;
    int32_t resistive = ((int32_t)qm_mulhi_uu((uint16_t)beta_max, rs_max) + 2) * (1 << e->rs_exp); /* no vector is longer than the largest beta */
    int32_t fast = (int32_t)qm_mulhi_su((int16_t)(8 * e->d_ilimit_hs_q14), largest_ls()) * (1 << e->ls_exp);
    int32_t slow = (int32_t)qm_mulhi_su(e->d_ilimit_ls_q14, largest_ls()) * (1 << e->ls_exp) * 9 / 8; /* turned: sqrt(1 + 0.5^2) */
    int32_t inductive = (fast > slow) ? fast : slow;
    return voltage_max + resistive + inductive * 1449 / 1024 + 8;
}

static void set_bounds(void)
{
    const drive_params_t from_user = DRIVE_PARAMS_INIT; /* not static: the analyser does not fold conditions on floats */
    int32_t half_step;
    params = from_user;
    alpha_max = (int16_t)(2 * params.overcurrent_q13);
    beta_max = (int16_t)(((int32_t)params.overcurrent_q13 * 18919 >> 13) + 8);
    radius_max = (int16_t)qm_mulhi_uu((uint16_t)((uint16_t)params.bus_used_q15 << params.bus_shift), params.voltage_limit_per_bus_q16);
    rs_max = largest_rs();
    voltage_max = (int16_t)(radius_max / 2 + radius_max / 64 + 8);
    /* Park halves it; the turn by half a step h to the middle of the period lengthens it by sqrt(1 + h^2) < 1 + h^2 / 2 */
    half_step = qm_mulhi_su(32767, params.estimator.half_step_q16_rad) + 1;
    emf_dq_max = (int16_t)(longest_emf() / 2 + (longest_emf() * (half_step * half_step / 65536) >> 18) + 4);
    erpm_max = params.maximum_erpm;
    current_max = params.current_max_q13;
    sample_shift_max = (int16_t)(qm_mulhi(32767, params.sample_shift_q16) + 1);
    forced_max = (qm_mulss(32767, params.estimator.deltat_q32) >> 6) + 1;
    forced_max = (params.forced.end_speed_q10 > forced_max) ? params.forced.end_speed_q10 : forced_max;
}

#endif
