/* A shaft that is held: may the rotor stand, does it, and does it turn again? */
#include "drive/held.h"

#include "control/tuned.h"
#include "drive/drive.h"
#include "drive/protection.h"

#define HELD_NOTHING ((dq_t){ 0, 0 })
#define HELD_QUARTER 16384                         /* of a turn, angle counts */
#define HELD_PERIOD_SHIFT (DEFER_DUTIES ? 11 : 12) /* from a period's turn, Q32, to a step's, angle counts */

/** The one place that writes the phase. */
static NOINLINE void held_enter(held_t *shaft, held_phase_t next)
{
    shaft->phase = (uint16_t)next;
    shaft->steps = 0;
    shaft->doubts = 0;
}

void held_forget(held_t *shaft)
{
    held_enter(shaft, HELD_NOT);
    shaft->act = (uint16_t)HELD_WAITS;
    shaft->stood = 0;
}

uint16_t held_angle_stands(const held_t *shaft)
{
    return (uint16_t)(shaft->phase >= (uint16_t)HELD_SETTLES);
}

/** qm_within(), once for all of this: it is long. */
static NOINLINE int16_t held_within(int32_t value, int16_t least, int16_t most)
{
    return qm_within(value, least, most);
}

/** A back-EMF's sum over so many steps. */
static NOINLINE int16_t held_times(int16_t emf_q12, uint16_t steps)
{
    return held_within(qm_mulsu(emf_q12, steps), -16383, 16383);
}

/** How far the back-EMF has moved: the sum of both parts' sizes. From nothing: how large it is. */
static NOINLINE uint16_t held_moved(dq_t emf, dq_t from)
{
    return (uint16_t)((uint16_t)qm_abs(qm_less(emf.d, from.d)) + (uint16_t)qm_abs(qm_less(emf.q, from.q)));
}

/** What the estimator makes of a sum of back-EMFs, with 1/Kphi and its limit from before the angle stopped: the model's may have moved since. */
static NOINLINE speed_erpm_t held_omega(const drive_run_t *run, int16_t sum_q12)
{
    return estimator_omega(sum_q12, run->held.emf_sum_max_q12, run->held.inv_kfi);
}

/** The sum that the estimator takes of a back-EMF. It fits a word, for the vector's length does. */
static int16_t held_sum(int16_t sign, dq_t emf)
{
    return (int16_t)(emf.q - sign * emf.d);
}

speed_erpm_t held_weakened_for(const drive_params_t *p, speed_erpm_t reference, speed_erpm_t speed)
{
    const speed_erpm_t from = p->fieldweak.on_speed_erpm;
    if (reference <= from || speed >= reference >> 1) {
        return reference;
    }
    return (int16_t)((speed > from >> 1) ? 2 * speed : from);
}

/** The angle that a sum of back-EMFs is, a step each: flux times it, and a quarter turn at most. */
static NOINLINE int16_t held_turned(const drive_run_t *run, const drive_params_t *p, int16_t sum_q12)
{
    return held_within(qm_mulss(held_omega(run, sum_q12), p->estimator.deltat_q32) >> HELD_PERIOD_SHIFT, -HELD_QUARTER, HELD_QUARTER);
}

int16_t held_lead(const drive_run_t *run, const drive_params_t *p, int16_t lag_q12)
{
    const speed_erpm_t more = held_omega(run, lag_q12);
    const uint32_t period_q32 = (uint32_t)qm_mulss(qm_abs(more), p->estimator.deltat_q32);
    const uint16_t k_q16 = (uint16_t)run->model.kfilter_esdq_q16;
    const uint16_t lead = ((uint16_t)(period_q32 >> 16) >= k_q16) ? 32767u : qm_divud(period_q32, k_q16);
    return qm_with_sign((int16_t)((lead > 32767u) ? 32767u : lead), more); /* half a turn at most */
}

/** Turns the frame back, and the vector that is commanded stays. @param lead angle counts */
static void held_turn_back(drive_t *d, const drive_params_t *p, int16_t lead)
{
    estimator_t *e = &d->run.estimator;
    (void)handover_turn_voltage(&d->run, lead);
    e->rho_q32 = qm_turn_sub(e->rho_q32, (uint32_t)(angle_t)lead << 16);
    e->next = (angle_t)(e->next - (angle_t)lead);
    handover_preset(d, p, e->next);
}

/** How much a step says for a rotor that stands: slower than half of its reference, and R i may be all of its back-EMF; or without one, once R is known. @param least that half */
static uint16_t held_doubts(const drive_t *d, const drive_params_t *p, dq_t emf, speed_erpm_t along, speed_erpm_t least)
{
    const drive_run_t *run = &d->run;
    if (run->held.stood) {
        const uint16_t off = (uint16_t)((run->held.steps < HELD_SLOW_STEPS) ? 0 : model_header_ri(p, qm_abs(run->control.i_q13.q)) >> HELD_R_SHIFT);
        return (uint16_t)((held_moved(emf, HELD_NOTHING) <= (uint16_t)p->adaptation.emf_least_q12 + off) ? HELD_DOUBTS_FAR : 0u);
    }
    if (along >= least || run->handover.phase != (uint16_t)START_DONE || mode_commands_current(d) || !protection_rotor_is_doubtful(run, p)) {
        return 0;
    }
    if (along < (least >> 2)) {
        return HELD_DOUBTS_FAR;
    }
    return (uint16_t)!observer_gate_is_closed(&run->observer); /* a load slows it down that the observer knows */
}

/** The same lead, or a little more or less: a phase whose current is near zero hides what turns across it in dead time. The q current's is at each sixth turn. */
QM_WRAPS static int16_t held_clear_of_zero(const drive_t *d, int16_t lead)
{
    const int16_t sixth = (int16_t)(6u * (uint16_t)(d->run.estimator.next - (angle_t)lead));
    const uint16_t clear = (uint16_t)((sixth < 0) ? HELD_CLEAR_ANGLE : -HELD_CLEAR_ANGLE);
    return qm_beyond(sixth, 6 * HELD_CLEAR_ANGLE) ? lead : (int16_t)(uint16_t)((uint16_t)lead + clear);
}

/** The angle stops where a rotor would be that stopped at once. */
static void held_stop_angle(drive_t *d, const drive_params_t *p, dq_t emf)
{
    held_t *shaft = &d->run.held;
    const uint16_t d_current_goes = qm_beyond(d->run.control.ref_q13.d, (int16_t)(p->current_max_q13 >> HELD_FAR_SHIFT));
    int16_t lead;
    shaft->inv_kfi = d->run.model.inv_kfi;
    shaft->emf_sum_max_q12 = d->run.model.emf_sum_max_q12;
    lead = held_lead(&d->run, p, shaft->lag_q12);
    if (d->run.probe_phase == (uint16_t)PROBE_TEST && emf.d > along_direction(d, emf.q) >> 1) { /* the back-EMF lies along the probe's current: R i */
        lead = (int16_t)(uint16_t)((uint16_t)(d->run.estimator.rho_q32 >> 16) - shaft->went);
    }
    shaft->patience = (uint16_t)((d_current_goes || qm_beyond(lead, HELD_FAR_LEAD)) ? 2u * HELD_PATIENCE_STEPS : HELD_PATIENCE_STEPS);
    held_turn_back(d, p, held_clear_of_zero(d, lead));
    held_enter(shaft, HELD_SETTLES);
    shaft->lag_q12 = emf.q;
    shaft->turned_q12 = 0;
    shaft->came_q12 = 0;
    shaft->run_on = 0;
    d->run.model.inv_kfi = 0;
    d->run.observer.omega_q16 = 0;
    d->run.observer.innovation_erpm = 0; /* it would seem wrong for as long */
    d->run.estimator.omega_filtered_q16 = 0;
}

/** A back-EMF's part along an axis that is so far ahead of the q axis: all of its length, where it points there. */
static int16_t held_along(dq_t emf, angle_t ahead)
{
    const alphabeta_t standing = { emf.d, emf.q };
    return (int16_t)(2 * park(standing, trig_sincos(ahead)).q);
}

/** The frame turns to where a back-EMF says that the rotor is: by its direction, and by what the filter is behind. @return its length, with its sign */
static int16_t held_turn_to(drive_t *d, const drive_params_t *p, dq_t emf, int16_t sign)
{
    const angle_t ahead = trig_direction((int16_t)(sign * emf.q), (int16_t)(-sign * emf.d));
    const int16_t length = held_along(emf, ahead);
    held_turn_back(d, p, (int16_t)(uint16_t) ~(uint16_t)(ahead + (uint16_t)held_lead(&d->run, p, length))); /* to a count */
    d->run.estimator.e_d_q28 = 0;
    d->run.estimator.e_q_q28 = (int32_t)length * 65536;
    return length;
}

/** The estimator goes on. @param stood 1: it stood, and turns now; 0: it has turned all the time */
static void held_go_on(drive_t *d, const drive_params_t *p, dq_t emf, uint16_t stood)
{
    drive_run_t *run = &d->run;
    held_t *shaft = &run->held;
    const int16_t sign = along_direction(d, 1);
    speed_erpm_t omega_erpm;
    if (stood) {
        if (shaft->stood == 1u) {
            run->observer.load_q16 = (int32_t)shaft->load * 65536;
        }
        shaft->stood = 2;
        held_turn_back(d, p, (int16_t)-held_turned(run, p, shaft->turned_q12));
    } else {
        emf.q = held_turn_to(d, p, emf, sign);
        emf.d = 0;
    }
    omega_erpm = held_omega(run, held_sum(sign, emf));
    run->estimator.sign = sign; /* while the angle stood it had none */
    run->estimator.omega_filtered_q16 = (int32_t)omega_erpm * 65536;
    run->model.inv_kfi = shaft->inv_kfi;
    held_enter(shaft, HELD_TURNS);
    run->observer.rho_q32 = run->estimator.rho_q32;
    run->observer.omega_q16 = run->estimator.omega_filtered_q16;
    run->observer.fast_share_q15 = 32767;
    run->observer.gate_level = 0;
    shaft->lag_q12 = 0;
    shaft->doubted_steps = 0;
    shaft->emf_q12 = emf;
}

/** 1 where the rotor has turned all the time: its back-EMF turned by what it said, or changed at once. 0: it was let go. @param turns it turned by what it said */
static uint16_t held_has_turned(const drive_t *d, uint16_t turns)
{
    return (uint16_t)(turns || (d->run.held.steps < HELD_ASK_STEPS && along_direction(d, d->run.held.emf_q12.q) >= 0));
}

/** Has it more of a d part than R i can have, that of a rotor which is ahead by more than 45 degrees? One that comes to its stop has less of it than before. */
static uint16_t held_is_ahead(const drive_t *d, dq_t emf, int16_t least_q12)
{
    const held_t *shaft = &d->run.held;
    return (uint16_t)(shaft->stood == 0u && shaft->steps > HELD_SETTLE_STEPS && emf.d <= shaft->emf_q12.d && -emf.d > along_direction(d, emf.q) && -emf.d > least_q12);
}

/** Both stand: has the back-EMF changed, or turned as a rotor's would? Where that were too little to tell it is asked on: one that changes then was let go, or is slow. */
static void held_compare(drive_t *d, const drive_params_t *p, dq_t emf, uint16_t moved)
{
    held_t *shaft = &d->run.held;
    const uint16_t most = (uint16_t)p->adaptation.emf_least_q12, least = most >> 1;                                                                                                        /* dead time shakes it by as much */
    const uint16_t steps = (uint16_t)((shaft->steps > 2u * HELD_ASK_STEPS) ? shaft->steps - 2u * HELD_ASK_STEPS : shaft->steps);                                                           /* since what it is compared with */
    const uint16_t half = (uint16_t)(3 * qm_abs(qm_mulhi(shaft->emf_q12.q, held_turned(&d->run, p, held_times(qm_less(shaft->emf_q12.q, along_direction(d, shaft->emf_q12.d)), steps))))); /* of a rotor's d part as fast as asked: pi, nearly */
    const uint16_t tells = (uint16_t)(half > least);
    const int16_t turned = qm_less(qm_clamp(shaft->emf_q12.d, INT16_MIN, 0), emf.d); /* -E sin: negative to either side, with E's sign that of the speed; what falls to 0 is the filter's tail */
    const uint16_t turns = (uint16_t)(steps >= HELD_ASK_STEPS && turned > (int16_t)(tells ? half : most) && (tells || shaft->steps > 2u * HELD_ASK_STEPS));
    if (turns || moved > 2u * most || along_direction(d, shaft->turned_q12) > p->adaptation.turned_q12) {
        shaft->act = (uint16_t)(held_has_turned(d, (uint16_t)(turns && tells)) ? HELD_HAS_TURNED : HELD_GOES_ON);
    } else if (shaft->steps >= HELD_ASK_MOST_STEPS || ((tells || along_direction(d, shaft->emf_q12.q) < 0) && steps >= HELD_ASK_STEPS)) {
        shaft->act = (uint16_t)HELD_LEARN;
    } else if (shaft->steps == 2u * HELD_ASK_STEPS) {
        shaft->emf_q12.d = emf.d;
        shaft->emf_q12.q = qm_less(shaft->emf_q12.q, (int16_t) - (shaft->turned_q12 >> HELD_MEAN_SHIFT)); /* a mean: one step's noise would add up */
        shaft->turned_q12 = 0;
    } else { /* it may turn slowly */
    }
}

/** The rotor stands: all of the back-EMF is R i, and turned the angle while it seemed one. */
static void held_learn(drive_t *d, const drive_params_t *p, dq_t emf)
{
    drive_run_t *run = &d->run;
    held_t *shaft = &run->held;
    const current_q13_t iq_q13 = run->control.i_q13.q;
    const uint16_t ri_q12 = (uint16_t)model_header_ri(p, qm_abs(iq_q13)), more_q12 = (uint16_t)qm_abs(emf.q);
    held_enter(shaft, HELD_STANDS);
    if (ri_q12 > (uint16_t)p->adaptation.emf_least_q12) {
        const int16_t part = (more_q12 < ri_q12) ? qm_share(more_q12, ri_q12) : 32767, share = ((iq_q13 ^ emf.q) < 0) ? (int16_t)-part : part;
        run->adaptation.rs_q31 = (int32_t)held_within((int32_t)qm_hi(run->adaptation.rs_q31) + share, p->adaptation.rs_least, p->adaptation.rs_most) * 65536;
        drive_update_model(run, p, run->control.reference_erpm, 0);
        run->estimator.e_d_q28 = 0; /* the filter would take a while */
        run->estimator.e_q_q28 = 0;
        emf.d = 0;
        emf.q = 0;
    }
    if (shaft->stood == 0u) { /* the frame in the next such slot: both at once would be the longest slow work */
        shaft->stood = 1;
        shaft->act = (uint16_t)HELD_TURN_BACK;
    }
    shaft->emf_q12 = emf;
}

/** What a filter of the back-EMF is behind: what the voltage has changed by, less what the estimator took back by itself through Ed. */
static void held_follow_lag(held_t *shaft, const drive_run_t *run, dq_t emf)
{
    const int16_t taken_back = held_within(qm_mulss((int16_t)(run->estimator.sign * emf.d), run->model.kfilter_esdq_q16) >> HELD_PERIOD_SHIFT, -16383, 16383);
    const int16_t lag = shaft->lag_q12, old = (int16_t)(lag >> HELD_LAG_SHIFT), left = (int16_t)(uint16_t)((uint16_t)emf.q - (uint16_t)old);
    const uint16_t at_once = (uint16_t)(shaft->doubted_steps != 0u || ((left ^ lag) < 0 && (run->estimator.sign ^ lag) >= 0)); /* the filter alone has a back-EMF: all counts */
    shaft->lag_q12 = qm_less(at_once ? lag : (int16_t)(uint16_t)((uint16_t)lag - (uint16_t)old), qm_less(taken_back, (int16_t)(uint16_t)((uint16_t)shaft->emf_q12.q - (uint16_t)emf.q)));
}

/** The angle turns, and something changes fast or the rotor is slow. */
static NOINLINE void held_watch(drive_t *d, const drive_params_t *p, dq_t emf)
{
    held_t *shaft = &d->run.held;
    const speed_erpm_t along = along_direction(d, observer_speed(&d->run.observer)), least = protection_least_speed(&d->run, p);
    uint16_t doubts = held_doubts(d, p, emf, along, least);
    held_follow_lag(shaft, &d->run, emf);
    shaft->doubted_steps = (uint16_t)((doubts != 0u) ? shaft->doubted_steps + 1u : 0u);
    if (along_direction(d, estimator_speed(&d->run.estimator)) >= least + (least >> 1)) { /* the observer's follows the current, too */
        shaft->went = (angle_t)(d->run.estimator.rho_q32 >> 16);                          /* what turns the frame in a dip may be R i */
    }
    if (shaft->phase != (uint16_t)HELD_NOT) { /* until it is back at its speed, or may be asked again */
        if (along >= least || (shaft->stood == 0u && shaft->steps >= HELD_AGAIN_STEPS)) {
            held_enter(shaft, HELD_NOT);
            shaft->stood = 0;
        }
        doubts = (uint16_t)((shaft->stood != 0u) ? doubts : 0u); /* it stood, and speeds up */
    }
    shaft->doubts = (uint16_t)((doubts != 0u) ? shaft->doubts + doubts : 0u);
    if (shaft->doubts >= HELD_DOUBTS_MOST && (shaft->doubts >= HELD_DOUBTS_SWINGS || d->run.control.swing_steps <= HELD_SWINGS * SPEED_SWING_STEPS)) {
        shaft->act = (uint16_t)HELD_STOP;
    }
}

/** The rotor stands, and the drive pushes: does it go? A frame that was turned back settles first, or its own voltage would be a rotor's. */
static void held_push(drive_t *d, const drive_params_t *p, dq_t emf, uint16_t moved)
{
    held_t *shaft = &d->run.held;
    if (shaft->act == (uint16_t)HELD_WAITS) { /* else the frame is turned back first */
        if (moved > (uint16_t)p->adaptation.emf_least_q12 && shaft->steps > HELD_REST_STEPS) {
            shaft->act = (uint16_t)((along_direction(d, emf.q) < 0 && shaft->steps > HELD_REST_STEPS + HELD_ASK_STEPS) ? HELD_LEARN : HELD_GOES_ON); /* the current grows, and R is less than was learnt */
            shaft->emf_q12 = emf;
            return;
        }
        if (shaft->steps <= 2u * HELD_PULL_STEPS && qm_abs(d->run.control.ref_q13.q) >= d->run.control.iq_limit_q13) { /* ahead, and back */
            shaft->run_on = along_direction(d, (int16_t)((shaft->steps <= HELD_PULL_STEPS) ? -HELD_PULL_ANGLE : HELD_PULL_ANGLE));
            shaft->act = (uint16_t)HELD_TURN_BACK;
        }
    }
    shaft->turned_q12 = 0; /* the load is what flows, and it grows */
    observer_preset(&d->run.observer, &p->observer, d->run.estimator.rho_q32, 0, salient_torque(&d->run, d->run.control.ref_q13.q));
}

/** Has the rotor turned all the time? A back-EMF that does not come to stand says so, and one that grows at once. One that shrinks is of a rotor that comes to its stop. */
static void held_settle(held_t *shaft, dq_t emf, uint16_t moved, uint16_t least_q12)
{
    const uint16_t size = held_moved(emf, HELD_NOTHING), before = held_moved(shaft->emf_q12, HELD_NOTHING), patient = (uint16_t)(shaft->steps <= HELD_PATIENCE_STEPS);
    if (moved > least_q12 >> 1 || shaft->steps < HELD_SETTLE_STEPS) { /* the current changes, or it turns */
        if (size + (moved >> 1) >= before && size > 2u * least_q12 && (shaft->steps > shaft->patience || (size > before + least_q12 && !patient))) {
            shaft->act = (uint16_t)HELD_HAS_TURNED;
        }
    } else {
        shaft->doubted_steps = (uint16_t)(patient ? shaft->doubted_steps + 1u : 0u); /* it stood, or came to its stop since */
        shaft->lag_q12 = qm_less(shaft->lag_q12, emf.q);
        shaft->came_q12 = qm_less(shaft->came_q12, qm_less(qm_less(held_times(emf.q, (uint16_t)(shaft->steps + shaft->doubted_steps)), (int16_t)(shaft->lag_q12 >> 1)), shaft->turned_q12)); /* R i did not come */
        shaft->turned_q12 = 0;
        held_enter(shaft, HELD_ASKED);
    }
    shaft->emf_q12 = emf;
}

/** The angle stands. */
static NOINLINE void held_ask(drive_t *d, const drive_params_t *p, dq_t emf)
{
    held_t *shaft = &d->run.held;
    const uint16_t moved = held_moved(emf, shaft->emf_q12), most = (uint16_t)p->adaptation.emf_least_q12;
    shaft->turned_q12 = qm_less(shaft->turned_q12, qm_less((shaft->phase == (uint16_t)HELD_SETTLES) ? 0 : shaft->emf_q12.q, emf.q));
    if (held_is_ahead(d, emf, (int16_t)most)) {
        shaft->act = (uint16_t)HELD_HAS_TURNED;
        return;
    }
    switch (shaft->phase) {
    case HELD_SETTLES: held_settle(shaft, emf, moved, most); break;
    case HELD_ASKED: held_compare(d, p, emf, moved); break;
    default: held_push(d, p, emf, moved); break; /* HELD_STANDS */
    }
}

void held_step(drive_t *d, const drive_params_t *p)
{
    held_t *shaft = &d->run.held;
    const dq_t emf = estimator_emf(&d->run.estimator);
    if (shaft->phase == (uint16_t)HELD_NOT && d->run.stall_steps == 0u && observer_gate_is_closed(&d->run.observer)) {
        shaft->load = qm_hi(d->run.observer.load_q16); /* as a rule: at its speed, and nothing changes fast */
        shaft->lag_q12 = 0;
        shaft->doubts = 0;
        shaft->emf_q12 = emf;
        return;
    }
    shaft->steps++;
    if (held_angle_stands(shaft)) {
        held_ask(d, p, emf);
    } else {
        held_watch(d, p, emf);
        shaft->emf_q12 = emf;
    }
}

NOINLINE void held_act(drive_t *d, const drive_params_t *p)
{
    held_t *shaft = &d->run.held;
    const dq_t emf = estimator_emf(&d->run.estimator);
    const uint16_t act = shaft->act;
    shaft->act = (uint16_t)HELD_WAITS;
    switch (act) {
    case HELD_STOP: held_stop_angle(d, p, emf); break;
    case HELD_HAS_TURNED:
    case HELD_GOES_ON: held_go_on(d, p, emf, (uint16_t)(act == (uint16_t)HELD_GOES_ON)); break;
    case HELD_LEARN:
        if (held_moved(emf, shaft->emf_q12) <= (uint16_t)p->adaptation.emf_least_q12 >> 1) { /* it was not let go while this waited */
            held_learn(d, p, emf);
        } else { /* nor did it stand */
            held_enter(shaft, HELD_SETTLES);
        }
        break;
    case HELD_TURN_BACK:
        held_turn_back(d, p, (int16_t)(uint16_t)((uint16_t)shaft->run_on + (uint16_t)held_lead(&d->run, p, shaft->lag_q12) - (uint16_t)held_turned(&d->run, p, shaft->came_q12)));
        shaft->lag_q12 = 0;
        shaft->came_q12 = 0;
        break;
    default: break; /* HELD_WAITS */
    }
}
