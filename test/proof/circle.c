/* What the tick's proof takes from its blocks: vectors stay in their circles, and phase C bounds the beta current. */
#include "any.h"

#include "control/pi.h"
#include "control/transforms.h"

static inline int16_t pi_tick_piece(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit);
#define pi_tick pi_tick_piece
#include "control/current_control.h"
#undef pi_tick

#include "bounds.h"

/** Below the trip level in all three phases, beta fits its format: |beta| <= beta_max, for every single b. */
void proof_phase_c(void)
{
    set_bounds();
    for (int16_t b = (int16_t)-params.overcurrent_q13; b <= params.overcurrent_q13; b++) {
        int16_t oc = params.overcurrent_q13;
        int16_t low = (int16_t)((b < 0) ? -oc - b : -oc), high = (int16_t)((b > 0) ? oc - b : oc); /* |a|, |-a - b| <= oc */
        alphabeta_t r = clarke(any(low, high), b);
        //@ check beta: -beta_max <= r.beta <= beta_max;
        //@ check alpha: -alpha_max <= r.alpha <= alpha_max;
    }
}

/** sin^2 + cos^2 <= 1.001: no rotation lengthens a vector. */
void proof_sincos_length(void)
{
    for (uint16_t k = 0; k < 8192; k++) {
        sincos_t sc = trig_sincos((angle_t)(any_u(0, 7) + 8u * k));
        int32_t square = qm_mulss(sc.sin, sc.sin) + qm_mulss(sc.cos, sc.cos);
        //@ check unit: square <= 1074815565; // 1.001 * 2^30
    }
}

#define D_PIECES 128

static int16_t d_piece;
static int32_t largest_square;

/** The d controller's result in pieces, the q controller's whole; both are what proof_pi shows: within the limit. */
static inline int16_t pi_tick_piece(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit)
{
    int16_t k = d_piece;
    (void)pi;
    (void)gains;
    (void)err;
    d_piece = -1;
    return (k >= 0) ? PIECE((int16_t)-limit, limit, k, D_PIECES) : any((int16_t)-limit, limit);
}

static void circle_between(int16_t low, int16_t high)
{
    for (int16_t k = 0; k < D_PIECES; k++) {
        static const dq_t zero;
        static pi_t pi;
        static const pi_gains_t gains;
        voltage_circle_t circle;
        voltage_q14_t limit_q;
        dq_t v;
        int32_t square;

        circle.limit_q14 = any(low, high);
        circle.reciprocal = voltage_circle_reciprocal(circle.limit_q14);
        d_piece = k;
        v = current_control(&pi, &gains, &pi, &gains, zero, zero, &circle, &limit_q);
        square = qm_mulss(v.d, v.d) + qm_mulss(v.q, v.q);
        //@ check length: square <= largest_square;
        //@ check limit: 0 <= limit_q <= high;
    }
}

/** Every radius in use, every Vd within its limit: no table is left, and Vd^2 + Vq^2 <= 1.05 radius^2 of the pieces. */
void proof_circle(void)
{
    int16_t low = 0, high = VOLTAGE_CIRCLE_LEAST_Q14;
    set_bounds();
    largest_square = qm_mulss(radius_max, radius_max) + qm_mulss(radius_max, radius_max) / 20;
    while (low < radius_max) {
        circle_between(low, high);
        low = high;
        high = (int16_t)(high + high / 64);
        if (high > radius_max) {
            high = radius_max;
        }
    }
}
