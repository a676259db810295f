/* The blocks of the control law, each with all inputs and all parameters of their ranges.
 *
 * minutes: proof_between proof_omega
 * options: -eva-split-return-function qm_beyond:full -eva-slevel-function qm_abs:5,qm_beyond:5,qm_clamp:5,qm_limit:5,set_bounds:40,largest_ls:40
 *     -eva-subdivide-non-linear-function estimator_oldest:100 */
#include "any.h"

#include "bounds.h"

#include "firmware/control/motor_model.c"
#include "firmware/control/current_control.c"
#include "firmware/control/estimator.c"
#include "firmware/control/transforms.c"
#include "firmware/control/observer.c"
#include "firmware/control/svm.c"
#include "firmware/drive/speed.c"

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
    b = qm_share(u, any_u(1, UINT16_MAX));
    //@ check 0 <= b;
    a = qm_abs(a);
    //@ check 0 <= a <= 32767;
    a = qm_sub_limited(ANY16(), ANY16());
    //@ check -16383 <= a <= 16383;
}

static void clamp_hi_between(int16_t low, int16_t high)
{
    int32_t x = qm_clamp_hi(any_l(INT32_MIN, INT32_MAX), low, high);
    //@ check limited: low * 65536 <= x <= high * 65536;
}

/** qm_clamp_hi: the limits that the build gives it, and the widest; qm_shift: a number that fits keeps its sign. */
void proof_qmath_long(void)
{
    set_bounds();
    clamp_hi_between(params.adaptation.kfi_least, params.adaptation.kfi_most);
    clamp_hi_between(params.adaptation.rs_least, params.adaptation.rs_most);
    clamp_hi_between((int16_t)-params.observer.load_max, params.observer.load_max);
    clamp_hi_between(INT16_MIN, INT16_MAX);
    //@ loop unroll 16;
    for (uint16_t bits = 0; bits < 16; bits++) {
        int32_t most = (int32_t)(INT32_MAX >> bits), y = qm_shift(any_l(0, most), bits), z = qm_shift(any_l(-most, -1), bits);
        //@ check sign: 0 <= y && z < 0;
    }
}

/** 256 values from `low` on, each alone; the analyser keeps loops of that length apart quickly. */
#define EACH_OF_256(x, low) for (uint16_t x = (uint16_t)(low), end = (uint16_t)((low) + 255u), more = 1; more; more = (uint16_t)(x++ != end))

static void between_from(uint16_t low)
{
    //@ loop unroll 256;
    EACH_OF_256(apart, low) {
        int16_t up = observer_between(0, (int16_t)apart, any(0, 32767)), down = observer_between((int16_t)apart, 0, any(0, 32767));
        int16_t rising[] = { 0, (int16_t)apart }, falling[] = { (int16_t)apart, 0 };
        int16_t rises = fieldweak_between(rising, 0, ANYU16()), falls = fieldweak_between(falling, 0, ANYU16());
        //@ check between: 0 <= up <= apart && 0 <= down <= apart && 0 <= rises <= apart && 0 <= falls <= apart;
    }
}

/** observer_between, fieldweak_between: for numbers that are not negative, the result is between them, whatever their difference. */
void proof_between(void)
{
    //@ loop unroll 128;
    for (uint16_t low = 0; low <= 32512u; low = (uint16_t)(low + 256u)) {
        between_from(low);
    }
}

static void omega_of(int16_t least, int16_t most)
{
    static const adaptation_params_t p;
    static const adaptation_t a;
    motor_model_t model;
    int16_t omega;
    model.inv_kfi = any(least, most);
    adaptation_apply(&a, &p, &model);
    omega = estimator_omega(ANY16(), model.emf_sum_max_q12, model.inv_kfi);
    //@ check speed: -32767 <= omega <= 32767;
}

static void omega_from(uint16_t low)
{
    //@ loop unroll 256;
    EACH_OF_256(inv_kfi, low) {
        omega_of((int16_t)inv_kfi, (int16_t)inv_kfi);
    }
}

/** All 1/Kphi of each limit: larger ones share theirs with their neighbours. */
static void omega_limited_from(uint16_t low)
{
    const uint32_t k = 32767ul * 2048ul;
    //@ loop unroll 256;
    EACH_OF_256(limit, low) {
        omega_of((int16_t)(k / (limit + 1ul) + 1ul), (int16_t)(k / limit));
    }
}

/** estimator_omega: every 1/Kphi, with the limit that adaptation_apply() leaves beside it, keeps the speed in 16 bits; and 0 with any of them. */
void proof_omega(void)
{
    int16_t stands = estimator_omega(ANY16(), any(2048, 32767), 0);
    //@ check stands: stands == 0;
    omega_of(1024, 2047);
    //@ loop unroll 24;
    for (uint16_t low = 2048; low <= 7936u; low = (uint16_t)(low + 256u)) {
        omega_from(low);
    }
    //@ loop unroll 24;
    for (uint16_t low = 2048; low <= 7936u; low = (uint16_t)(low + 256u)) {
        omega_limited_from(low);
    }
}

/** Sine and circle: every angle and every x; sine, cosine and chord stay within Q15. */
void proof_trig(void)
{
    //@ loop unroll 512;
    for (uint16_t k = 0; k < 512; k++) {
        sincos_t r = trig_sincos((angle_t)(any_u(0, 127) + 128u * k));
        //@ check unit: -32767 <= r.sin <= 32767 && -32767 <= r.cos <= 32767;
    }
    //@ loop unroll 64;
    for (int16_t k = 0; k < TRIG_CIRCLE_STEPS; k++) {
        q15_t y = trig_circle(any((int16_t)(512 * k), (int16_t)(512 * k + 511)));
        //@ check unit: 0 <= y <= 32767;
    }
}

/** Park and its inverse: every int16 with every sine and cosine. Clarke: see circle.c. */
void proof_transforms(void)
{
    alphabeta_t x = { ANY16(), ANY16() };
    dq_t y = { ANY16(), ANY16() };
    sincos_t sc = { any(-32767, 32767), any(-32767, 32767) };
    (void)park(x, sc);
    (void)inverse_park(y, sc);
}

/** One controller with a piece of its integrator, its error and its gain. */
static void pi_piece(int16_t shift, int16_t error_max, int16_t limit_low, int16_t limit_high, int16_t sum, int16_t err, int16_t gain)
{
    pi_gains_t gains;
    pi_t pi;
    int16_t out;

    gains.kp = PIECE(0, INT16_MAX, gain, 8);
    gains.ki = any(0, INT16_MAX);
    gains.kc = any(PI_KC_MIN, INT16_MAX);
    gains.shift = (uint16_t)shift;
    pi.sum = any_l(SUM_MAX / 8 * sum, SUM_MAX / 8 * (sum + 1));
    out = pi_tick(&pi, &gains, PIECE((int16_t)-error_max, error_max, err, 24), any(limit_low, limit_high));
    //@ check limited: -limit_high <= out <= limit_high;
    //@ check integrator: -SUM_MAX <= pi.sum <= SUM_MAX;
}

static void pi_pieces(int16_t shift, int16_t error_max, int16_t limit_low, int16_t limit_high)
{
    //@ loop unroll 16;
    for (int16_t sum = -8; sum < 8; sum++) {
        //@ loop unroll 24;
        for (int16_t err = 0; err < 24; err++) {
            //@ loop unroll 8;
            for (int16_t gain = 0; gain < 8; gain++) {
                pi_piece(shift, error_max, limit_low, limit_high, sum, err, gain);
            }
        }
    }
}

/** pi_tick: the integrator keeps its bound for all gains, errors and limits. */
void proof_pi(void)
{
    pi_pieces(CURRENT_PI_SHIFT, PI_ERROR_MAX, 0, INT16_MAX);
}

/** Presetting an integrator for any output stays within its bound. */
void proof_pi_preset(void)
{
    pi_gains_t gains = { any(0, INT16_MAX), 0, 0, CURRENT_PI_SHIFT };
    pi_t pi;
    pi_preset(&pi, &gains, 0, ANY16());
    //@ check current: -SUM_MAX <= pi.sum <= SUM_MAX;
}

#define SVM_PIECES 24
#define SVM_VOLTAGE_MAX 16500 /* Q13: a circle at twice the nominal bus */

/** Smallest distance of the piece from zero. */
static int16_t nearest(int16_t k)
{
    int16_t low = piece_low(-SVM_VOLTAGE_MAX, SVM_VOLTAGE_MAX, k, SVM_PIECES);
    int16_t high = piece_low(-SVM_VOLTAGE_MAX, SVM_VOLTAGE_MAX, (int16_t)(k + 1), SVM_PIECES);
    return (low > 0) ? low : (high < 0) ? (int16_t)-high : 0;
}

static void dead_time_from(uint16_t low)
{
    svm_params_t p;
    //@ loop unroll 256;
    EACH_OF_256(knee, low) {
        int16_t duty;
        p.knee_q13 = (int16_t)knee;
        p.dead_time = any(20, 120);
        p.dead_slope_q8 = (int16_t)(p.dead_time * 256 / knee);
        duty = svm_dead_time(&p, ANY16());
        //@ check most: -120 <= duty <= 120;
    }
}

/** svm_dead_time: every knee; what is given back is at most what dead time takes. */
void proof_dead_time(void)
{
    //@ loop unroll 32;
    for (uint16_t low = 2; low <= 8192u; low = (uint16_t)(low + 256u)) {
        dead_time_from(low);
    }
}

static void svm_piece(int16_t alpha, int16_t beta, uint16_t ratio)
{
    svm_params_t p;
    alphabeta_t v;
    phases_t measured;
    dead_duties_t dead;
    duties_t d;

    p.full = any(1600, 5600);
    p.top = any(1280, 5480);
    p.turn_q13 = any(0, 8192);
    v.alpha = PIECE(-SVM_VOLTAGE_MAX, SVM_VOLTAGE_MAX, alpha, SVM_PIECES);
    v.beta = PIECE(-SVM_VOLTAGE_MAX, SVM_VOLTAGE_MAX, beta, SVM_PIECES);
    dead.a = any(-120, 120); /* see proof_dead_time */
    dead.b = any(-120, 120);
    dead.c = any(-120, 120);
    measured.a = ANY16();
    measured.b = ANY16();
    measured.c = ANY16();
    svm(&p, v, any_u(8192u * ratio, 8192u * ratio + 8191u), &dead, &measured, &d);
    //@ check duties: d.a <= 5600 && d.b <= 5600 && d.c <= 5600;
}

/** svm.c: every vector of the circle that the formats allow, every bus, every current, all timings. */
void proof_svm(void)
{
    //@ loop unroll SVM_PIECES;
    for (int16_t alpha = 0; alpha < SVM_PIECES; alpha++) {
        //@ loop unroll SVM_PIECES;
        for (int16_t beta = 0; beta < SVM_PIECES; beta++) {
            if (qm_mulss(nearest(alpha), nearest(alpha)) + qm_mulss(nearest(beta), nearest(beta)) > qm_mulss(SVM_VOLTAGE_MAX, SVM_VOLTAGE_MAX)) {
                continue;
            }
            //@ loop unroll 8;
            for (uint16_t ratio = 0; ratio < 8; ratio++) {
                svm_piece(alpha, beta, ratio);
            }
        }
    }
}

/** The voltage feedback, all parameters. */
void proof_fieldweak_trim(void)
{
    fieldweak_params_t p;
    fieldweak_t fw;
    p.trim_max_q13 = any(0, 8192);
    p.trim_step_q13 = any(1, 16);
    p.trim_most_q13 = any(1, 32);
    p.trim_speed_erpm = any(0, INT16_MAX);
    fw.trim_q13 = any(-8192, 0);
    fieldweak_trim(&fw, &p, any(-28000, 28000), ANY16());
    //@ check trim: -8192 <= fw.trim_q13 <= 0;
}

static void ramp_piece(int16_t step, int16_t end)
{
    int16_t inside = (int16_t)(32767 - 2 * step); /* further out, the target is nearer than two steps, or inwards */
    int16_t low = (int16_t)((end < 0) ? -32767 : (end > 0) ? inside + 1 : -inside);
    int16_t high = (int16_t)((end < 0) ? -inside - 1 : (end > 0) ? 32767 : inside);
    int16_t y = speed_ramp(any(low, high), any(-32767, 32767), step);
    //@ check range: -32767 <= y <= 32767;
}

/** speed_ramp: every reference and target, steps over the parameter's whole range. */
void proof_speed_ramp(void)
{
    //@ loop unroll 4801;
    for (int16_t step = 1; step <= 4800; step += 13) {
        ramp_piece(step, -1);
        ramp_piece(step, 0);
        ramp_piece(step, 1);
    }
}

/** The forced angle: all parameters, both directions. */
void proof_forced_angle(void)
{
    forced_angle_params_t p = { any_l(0, 8000000l), any(1, 2000) };
    forced_angle_t f = { any_l(0, p.end_speed_q10), any_ul(0, UINT32_MAX), any_ul(0, UINT32_MAX), any(0, 6000) };
    (void)forced_angle_accelerate(&f, &p, any(0, 1) ? 1 : -1, any_u(1, 2));
    //@ check speed: 0 <= f.speed_q10 <= 8000000;
    forced_angle_move(&f);
    (void)forced_angle(&f);
}

/** estimator.c: what is kept of two currents is no larger than they are. Beta ends at 16364: the trip level is at most 86.5 %. */
void proof_estimator_oldest(void)
{
    //@ loop unroll 80;
    for (int16_t k = 0; k < 80; k++) {
        int16_t most = (int16_t)(256 * k + 255);
        int16_t oldest = estimator_oldest(any((int16_t)-most, most), any((int16_t)-most, most));
        //@ check between: -most <= oldest <= most;
    }
}

/** estimator.c: the small blocks with every int16. */
void proof_estimator_blocks(void)
{
    estimator_t e;
    alphabeta_t x = { any(-21844, 21844), any(-21844, 21844) };
    e.rho_q32 = any_ul(0, UINT32_MAX);
    (void)estimator_ahead(e.rho_q32, any_l(INT32_MIN, INT32_MAX));
    e.omega_filtered_q16 = any_l(INT32_MIN, INT32_MAX);
    e.e_d_q28 = any_l(INT32_MIN, INT32_MAX);
    e.e_q_q28 = any_l(INT32_MIN, INT32_MAX);
    (void)estimator_speed(&e);
    (void)estimator_emf(&e);
    (void)estimator_turn(x, ANY16());
}
