/* The load observer and the adaptation, each with all inputs and all parameters that the build accepts.
 *
 * options: -eva-slevel-function qm_abs:5,qm_beyond:5,qm_clamp:5,qm_limit:5,observer_step:200,observer_answer:200,observer_sum:10,adaptation_learn:100
 *     -eva-split-return-function qm_beyond:full -eva-domains octagon,equality,symbolic-locations -eva-octagon-through-calls -inline-calls qm_hi,qm_abs,shift_in_pieces */
#include "any.h"

#include "bounds.h"

static int32_t shift_in_pieces(int32_t x, uint16_t bits);
static q15_t share_bounded(uint16_t part, uint16_t whole);
#define qm_shift shift_in_pieces
#define qm_share share_bounded
#include "firmware/control/motor_model.c"
#include "firmware/control/observer.c"
#undef qm_shift
#undef qm_share

/** x * 2^bits as the caller promises; a piece for each sign. */
static int32_t shift_in_pieces(int32_t x, uint16_t bits)
{
    //@ check fits: -2147483648 <= x * (1 << bits) <= 2147483647;
    if (x < 0) {
        return qm_shift(x, bits);
    }
    return qm_shift(x, bits);
}

/** blocks.c, proof_qmath. */
static q15_t share_bounded(uint16_t part, uint16_t whole)
{
    int16_t fits = (int16_t)(part < whole);
    //@ check below_one: fits == 1;
    return any(0, 32767);
}

/** The rates of a LOAD_BANDWIDTH_HZ at the end of their range, up to a fifth above `quick`; what a speed innovation may be with them. */
static void any_observer(observer_params_t *p, int16_t quick, uint16_t shift)
{
    int64_t innovation = (16000ll << 32) / qm_mulss(quick, quick) >> shift;
    p->deltat_q32 = any(2863, 16780); /* LOOPTIME_SEC of 40 to 140 us, a sixteenth of a turn a period at most */
    p->per_turn_q12 = any(1999, 11719);
    p->shift = shift;
    p->per_current_q16 = any_u(32768, 65535);
    p->innovation_max_erpm = any(1, (int16_t)((innovation > 16383) ? 16383 : innovation));
    p->load_max = any(1, 8192);
}

static void observer_piece(int16_t quick, int16_t next, uint16_t shift, int16_t calm_low, int16_t calm_high)
{
    observer_params_t p;
    observer_t o;
    any_observer(&p, quick, shift);
    o.omega_q16 = any_l(-32767 * 65536l, 32767 * 65536l);
    o.load_q16 = any_l(-8193 * 65536l, 8192 * 65536l);
    o.rho_q32 = any_ul(0, UINT32_MAX);
    o.rate_q16 = any(0, next);
    o.gate_erpm = ANY16();
    o.wrong_erpm = ANY16();
    o.wrong_steps = any_u(0, 65534); /* a fault ends the run long before */
    o.gate_level = ANYU16();
    o.gate_last_erpm = ANY16();
    o.fast_share_q15 = any(calm_low, calm_high);
    observer_step(&o, &p, any_ul(0, UINT32_MAX), any(-IQ_MAX, IQ_MAX));
    //@ check speed: -32767 * 65536 <= o.omega_q16 <= 32767 * 65536;
    //@ check load: -8192 * 65536 <= o.load_q16 <= 8192 * 65536;
    //@ check innovation: -16383 <= o.innovation_erpm <= 16383;
    //@ check quick: calm_low == 16384 || 0 <= o.fast_share_q15;
}

/** Every rate and every inertia: no step of speed or load leaves its format. */
void proof_observer_step(void)
{
    //@ loop unroll 16;
    for (uint16_t shift = 0; shift <= 15; shift++) {
        //@ loop unroll 100;
        for (int16_t quick = 128, next; quick < RATE_MOST_Q16; quick = next) {
            /* a small square's high word alone is coarse: finer pieces where the shift makes much of it */
            next = (int16_t)(quick + quick / ((shift > 13u && quick < 1024) ? 32 : 8));
            observer_piece(quick, next, shift, 16384, 32767);
        }
    }
}

/** The quick rate fades to none, piece by piece. */
void proof_observer_calm(void)
{
    //@ loop unroll 16;
    for (int32_t least = 1; least <= 16384; least *= 2) {
        observer_piece(128, 144, 1, (int16_t)((least == 1) ? 0 : least), (int16_t)(2 * least - 1));
    }
}

/** Every back-EMF and every R i: the bounds of what is learnt hold. */
void proof_adaptation_learn(void)
{
    adaptation_params_t p;
    adaptation_t a;
    dq_t emf = { ANY16(), ANY16() };
    p.rate_q16 = any(0, 8192);
    p.kfi_least = any(-16384, 0);
    p.kfi_most = any(0, 16384);
    p.rs_least = any(-16384, 0);
    p.rs_most = any(0, 24576);
    p.emf_least_q12 = any(1, 32767);
    a.kfi_q31 = any_l(-16384 * 65536l, 16384 * 65536l);
    a.rs_q31 = any_l(-16384 * 65536l, 24576 * 65536l);
    adaptation_learn(&a, &p, emf, ANY16());
    //@ check kfi: -16384 * 65536 <= a.kfi_q31 <= 16384 * 65536;
    //@ check rs: -16384 * 65536 <= a.rs_q31 <= 24576 * 65536;
}

/** Every table entry, every R and every change: the estimator's limit fits 16 bits. */
void proof_adaptation_apply(void)
{
    adaptation_params_t p;
    adaptation_t a;
    motor_model_t model;
    p.rs_base_q16 = ANYU16();
    a.kfi_q31 = any_l(-16384 * 65536l, 16384 * 65536l);
    a.rs_q31 = any_l(-16384 * 65536l, 24576 * 65536l);
    model.inv_kfi = any(0, INT16_MAX);
    adaptation_apply(&a, &p, &model);
    //@ check kfi: ADAPTATION_KFI_LEAST <= model.inv_kfi;
    //@ check limit: 2048 <= model.emf_sum_max_q12 <= 32767;
}
