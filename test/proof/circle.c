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

#define RADIUS_PIECES 64
#define D_PIECES 256

static int16_t d_piece;

/** The d controller's result in pieces, the q controller's whole; both are what proof_pi shows: within the limit. */
static inline int16_t pi_tick_piece(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit)
{
    int16_t k = d_piece;
    (void)pi;
    (void)gains;
    (void)err;
    d_piece = -1;
    return (k >= 0) ? any(piece_low((int16_t)-limit, limit, k, D_PIECES), piece_low((int16_t)-limit, limit, (int16_t)(k + 1), D_PIECES))
                    : any((int16_t)-limit, limit);
}

/** Every radius in use, every Vd within its limit: the tables are not left, and Vd^2 + Vq^2 <= 1.03 radius^2. */
void proof_circle(void)
{
    set_bounds();
    for (int16_t i = 0; i < RADIUS_PIECES; i++) {
        for (d_piece = 0; d_piece < D_PIECES; d_piece++) {
        }
    }
}
