/* What the tick's proof takes from its blocks: vectors stay in their circles, and phase C bounds the beta current.
 *
 * options: -eva-use-spec pi_tick -eva-subdivide-non-linear-function vd_limit:100 -eva-slevel-function qm_abs:5,qm_clamp:5,set_bounds:40,largest_ls:40,circle_in_pieces:100 */
#include "any.h"

#include "bounds.h"

#include "firmware/control/transforms.c"

static int16_t d_low, d_high; /* piece of the d controller's result under proof */
static int16_t is_q;          /* the q controller comes next */

/*@ assigns pi->sum, is_q, \result \from pi->sum, gains->kp, err, limit, is_q, d_low, d_high;
    admit ensures turn: is_q == 1 - \old(is_q);
    admit ensures limited: -limit <= \result <= limit;
    admit ensures piece: \old(is_q) == 0 ==> d_low <= \result <= d_high; */ /* blocks.c, proof_pi; piece by piece for d */
int16_t pi_tick(pi_t *pi, const pi_gains_t *gains, int16_t err, int16_t limit);

static q15_t circle_in_pieces(q15_t x);
#define trig_circle circle_in_pieces
#include "firmware/control/current_control.c"
#undef trig_circle

/** One piece for each entry of the table, so that the analysis keeps neighbours together. */
static q15_t circle_in_pieces(q15_t x)
{
    for (int16_t k = 1; k < TRIG_CIRCLE_STEPS; k++) {
        if (x < 512 * k) {
            break;
        }
    }
    return trig_circle(x);
}

#define B_STEP 6

/** b from the given value on: a and c leave between them what the trip level allows. */
static void phase_c_from(int16_t b_low)
{
    int16_t oc = params.overcurrent_q13;
    int16_t b_high = (int16_t)(b_low + B_STEP - 1);
    int16_t low = (int16_t)((b_high < 0) ? -oc - b_high : -oc), high = (int16_t)((b_low > 0) ? oc - b_low : oc);
    alphabeta_t r = clarke(any(low, high), any(b_low, b_high));
    //@ check beta: -beta_max <= r.beta <= beta_max;
    //@ check alpha: -alpha_max <= r.alpha <= alpha_max;
}

/** Below the trip level in all three phases, beta is within beta_max. */
void proof_phase_c(void)
{
    set_bounds();
    //@ loop unroll 5000;
    for (int16_t b = (int16_t)-params.overcurrent_q13; b <= params.overcurrent_q13 - B_STEP; b += B_STEP) {
        phase_c_from(b);
    }
    phase_c_from((int16_t)(params.overcurrent_q13 - B_STEP + 1));
}

static void sincos_from(angle_t angle)
{
    sincos_t sc = trig_sincos((angle_t)(angle + any_u(0, 31)));
    int32_t square = qm_mulss(sc.sin, sc.sin) + qm_mulss(sc.cos, sc.cos);
    //@ check unit: square <= 1082331758; // 1.008 * 2^30
}

/** sin^2 + cos^2 <= 1.008 (pieces of 32 counts): a rotation lengthens no vector by more than 0.4 %. */
void proof_sincos_length(void)
{
    //@ loop unroll 2048;
    for (uint16_t k = 0; k < 2048; k++) {
        sincos_from((angle_t)(32u * k));
    }
}

#define D_PIECES 96

static int32_t largest_square;

static void circle_between(int16_t low, int16_t high)
{
    static const dq_t zero;
    static pi_t pi;
    static const pi_gains_t gains;
    voltage_circle_t circle;
    voltage_q14_t limit_q;
    dq_t v;
    int32_t square;

    voltage_circle_of(&circle, any(low, high));
    is_q = 0;
    v = current_control(&pi, &gains, &pi, &gains, zero, zero, &circle, &limit_q);
    square = qm_mulss(v.d, v.d) + qm_mulss(v.q, v.q);
    //@ check length: square <= largest_square;
    //@ check limit: 0 <= limit_q <= high;
}

/** Every radius in use, every Vd within its limit: no table is left, and Vd^2 + Vq^2 <= 1.05 radius^2 (pieces included). */
void proof_circle(void)
{
    int16_t low = 0, high = VOLTAGE_CIRCLE_LEAST_Q14;
    set_bounds();
    largest_square = qm_mulss(radius_max, radius_max) + qm_mulss(radius_max, radius_max) / 20;
    //@ loop unroll 200;
    while (low < radius_max) {
        int16_t most = vd_limit(high);
        //@ loop unroll D_PIECES;
        for (int16_t k = 0; k < D_PIECES; k++) {
            d_low = piece_low((int16_t)-most, most, k, D_PIECES);
            d_high = piece_low((int16_t)-most, most, (int16_t)(k + 1), D_PIECES);
            circle_between(low, high);
        }
        low = high;
        high = (int16_t)(high + high / 42);
        if (high > radius_max) {
            high = radius_max;
        }
    }
}

/** One filter of the back-EMF with y in low..high and any x. */
static void lowpass_piece(int16_t k, int16_t low, int16_t high)
{
    int32_t y = any_l(low * 65536l, high * 65536l + 65535);
    (void)qm_lowpass(&y, any((int16_t)-emf_dq_max, emf_dq_max), k);
    //@ check y: emf_dq_max * -65536 <= y <= emf_dq_max * 65536 + 65535;
}

/** Pieces of y that shrink towards its ends; the pieces from both ends meet. */
static void lowpass_with(int16_t k)
{
    static const int16_t widths[] = { -1, 0, 4, 20, 84, 340, 1364, 5460, 20000 };
    //@ loop unroll 8;
    for (int16_t i = 1; i < 9; i++) {
        lowpass_piece(k, (int16_t)(widths[i - 1] + 1 - emf_dq_max), (int16_t)(widths[i] - emf_dq_max));
        lowpass_piece(k, (int16_t)(emf_dq_max - widths[i]), (int16_t)(emf_dq_max - widths[i - 1] - 1));
    }
}

static void lowpass_from(int16_t k)
{
    //@ loop unroll 16;
    for (int16_t n = 0; n < 16; n++) {
        lowpass_with((int16_t)(k + 8 * n));
    }
}

/** The filtered back-EMF stays in the range of the back-EMF, with every filter that fieldweak_tick() can choose. */
void proof_lowpass(void)
{
    set_bounds();
    //@ check met: 2 * emf_dq_max <= 40000;
    lowpass_with(params.fieldweak.kfilter_esdq_q16);
    lowpass_with(params.fieldweak.kfilter_esdq_fw_q16);
    //@ loop unroll 128;
    for (int16_t k = FIELDWEAK_FILTER_LEAST; k < params.fieldweak.kfilter_esdq_q16 || k < params.fieldweak.kfilter_esdq_fw_q16; k += 128) {
        lowpass_from(k);
    }
}
