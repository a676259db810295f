/* The catch of a rotor that turns at the start: the two looks, the pause between them, and the estimator's begin. */
#include "drive/catch.h"

#include "drive/drive.h"
#include "drive/tick.h"

#define CATCH_LOOK_PERIODS (CATCH_LOOK_STEPS * SLOW_PERIODS)                /**< of a look at a slow rotor */
#define CATCH_STANDS_Q11 ((int16_t)(CATCH_STANDS * CATCH_LOOK_PERIODS - 1)) /**< the sum of a whole look's currents up to it is none: two steps of the converter in the mean */
#define CATCH_BUS_PERIODS (2048u * SLOW_PERIODS)                            /**< a rotor that holds the bus there slows down, and the bus falls with it: within some tenths of a second */
#define CATCH_MOST_FLUX_Q11 24000                                           /**< flux of a look that its format holds */

/** The one place that writes the phase. */
static void catch_enter(catch_t *c, catch_phase_t next)
{
    c->phase = (uint16_t)next;
}

void catch_begin(drive_run_t *run, const drive_params_t *p)
{
    catch_enter(&run->catching, (mode_hands_over() && p->flying_start) ? CATCH_FIRST_LOOK : CATCH_NO_LOOK);
}

/** 1 with the bus so high that switching anything on would trip: a very fast rotor holds it there through the diodes. */
static uint16_t catch_bus_is_high(const drive_t *d, const drive_params_t *p)
{
    return (uint16_t)(qm_hi(d->bus_q31) > (int16_t)(p->bus_over_q15 - (p->bus_over_q15 >> CATCH_BUS_SHIFT)));
}

uint16_t catch_waits_for_bus(drive_t *d, const drive_params_t *p)
{
    if (!catch_bus_is_high(d, p)) {
        return 0;
    }
    catch_enter(&d->run.catching, CATCH_BUS_HIGH);
    return 1;
}

/** An axis of L i + R int(i dt), voltage times periods. @param i_q14 at the end @param sum_q11 of all samples */
static int16_t catch_flux_q11(const drive_run_t *run, const estimator_params_t *p, int16_t i_q14, int16_t sum_q11)
{
    int32_t inductive = (qm_mulsu(i_q14, run->model.ls_q16) >> 15) * (1 << p->ls_exp);
    int32_t resistive = (qm_mulsu((int16_t)(sum_q11 - (i_q14 >> 4)), run->model.rs_q16) >> 15) * (1 << p->rs_exp);
    return qm_within(inductive + resistive, -CATCH_MOST_FLUX_Q11, CATCH_MOST_FLUX_Q11);
}

uint16_t catch_pause(const drive_run_t *run, const drive_params_t *p, alphabeta_t flux_q11, uint16_t samples)
{
    int16_t alpha = qm_abs(flux_q11.alpha), beta = qm_abs(flux_q11.beta);
    int16_t length = (int16_t)((alpha > beta) ? alpha + (beta >> 2) : beta + (alpha >> 2)); /* to 11 per cent */
    uint16_t half_emf_q12 = qm_divud(qm_muluu((uint16_t)length, 4u), (uint16_t)(4u * samples - 1u));
    uint16_t sum_max_q12 = (uint16_t)run->model.emf_sum_max_q12;
    uint16_t emf_q12 = (half_emf_q12 > sum_max_q12 >> 1) ? sum_max_q12 : (uint16_t)(2u * half_emf_q12);
    speed_erpm_t speed = (int16_t)(qm_mulss((int16_t)emf_q12, run->model.inv_kfi) >> 11); /* estimator_omega() within its limit */
    uint16_t step = (uint16_t)qm_mulhi(speed, p->estimator.deltat_q32), pause = CATCH_PAUSE_MOST;
    if (step > CATCH_PAUSE_TURN / CATCH_PAUSE_MOST) {
        pause = qm_divud(CATCH_PAUSE_TURN, step);
    }
    return (pause < CATCH_PAUSE_LEAST) ? CATCH_PAUSE_LEAST : pause;
}

speed_erpm_t catch_speed(const drive_params_t *p, int16_t size, uint16_t half_periods)
{
    /* turn 2^16 / (half_periods / 2) / deltat, with what divides brought into a word */
    uint32_t part = (uint32_t)(uint16_t)size << 16, whole = qm_muluu(half_periods, (uint16_t)p->estimator.deltat_q32) >> 1;
    uint16_t divisor;
    while ((uint16_t)(whole >> 16) != 0u) { /* wcet: at most 15 turns */
        whole >>= 1;
        part >>= 1;
    }
    divisor = (uint16_t)whole;
    if ((uint16_t)(part >> 15) < divisor) {
        return (int16_t)(qm_divud(2u * part, divisor) >> 1); /* as a half of twice as much it is within the word */
    }
    return INT16_MAX;
}

/** The second look has ended: the turn since the first one. @return CATCH_NO_LOOK of a rotor that stands, CATCH_TOO_FAST, CATCH_SEEN */
static catch_phase_t catch_see(drive_t *d, const drive_params_t *p, angle_t direction, uint16_t samples)
{
    drive_run_t *run = &d->run;
    catch_t *c = &run->catching;
    int16_t turn = (int16_t)(angle_t)(direction - c->direction), size = qm_abs(turn), speed;
    if (size < CATCH_LEAST_TURN) {
        return CATCH_NO_LOOK;
    }
    speed = catch_speed(p, size, (uint16_t)(c->half_periods + samples));
    run->estimator.omega_erpm = qm_with_sign(speed, turn);
    if (speed > p->maximum_erpm) {
        c->pause = CATCH_PAUSE_MOST;
        return CATCH_TOO_FAST;
    }
    c->pause = 0;
    return CATCH_SEEN;
}

/* wcet: catch_look excludes drive_update_model adaptation_learn handover_decay svm_compensation */
uint16_t catch_look(drive_t *d, const drive_params_t *p)
{
    catch_t *c = &d->run.catching;
    alphabeta_t i = clarke(d->phases_q13.a, d->phases_q13.b), flux;
    int16_t most = (int16_t)(p->current_max_q13 / 5), alpha = qm_abs(i.alpha), beta = qm_abs(i.beta);
    uint16_t samples = d->periods;
    catch_phase_t next = CATCH_NO_LOOK; /* it stands */
    angle_t direction;
    c->sum_q11.alpha = (int16_t)(c->sum_q11.alpha + (i.alpha >> 3));
    c->sum_q11.beta = (int16_t)(c->sum_q11.beta + (i.beta >> 3));
    if (samples < CATCH_LOOK_PERIODS && alpha < most && beta < most) {
        return 0;
    }
    flux.alpha = catch_flux_q11(&d->run, &p->estimator, i.alpha, c->sum_q11.alpha);
    flux.beta = catch_flux_q11(&d->run, &p->estimator, i.beta, c->sum_q11.beta);
    direction = trig_direction((int16_t)-flux.alpha, (int16_t)-flux.beta);
    if (samples < CATCH_LOOK_PERIODS || qm_beyond(c->sum_q11.alpha, CATCH_STANDS_Q11) || qm_beyond(c->sum_q11.beta, CATCH_STANDS_Q11)) {
        if (c->phase == (uint16_t)CATCH_FIRST_LOOK) {
            c->pause = catch_pause(&d->run, p, flux, samples);
            samples = (uint16_t)(samples + 2u * c->pause);
            next = CATCH_PAUSE;
        } else {
            next = catch_see(d, p, direction, samples);
        }
        c->half_periods = samples;
    }
    catch_enter(c, next);
    c->direction = direction;
    c->sum_q11.alpha = 0;
    c->sum_q11.beta = 0;
    return (uint16_t)(next != CATCH_NO_LOOK);
}

/** While the bus is too high, for nothing else is waited for so long: 1 when it has not fallen since it was last asked, some tenths of a second before. */
static uint16_t catch_bus_stays(drive_t *d)
{
    catch_t *c = &d->run.catching;
    int16_t bus = qm_hi(d->bus_q31), before = c->bus_q15;
    if ((d->periods & (CATCH_BUS_PERIODS - 1u)) != 1u) {
        return 0;
    }
    c->bus_q15 = bus;
    return (uint16_t)(d->periods != 1u && bus > before - (before >> CATCH_FALL_SHIFT));
}

drive_state_t catch_pass(drive_t *d, const drive_params_t *p)
{
    catch_t *c = &d->run.catching;
    if (!d->command.run) {
        return DRIVE_STOPPED;
    }
    d->periods = (uint16_t)(d->periods + 1u); /* wraps where the bus is waited for: the pause begins anew */
    if (catch_bus_stays(d)) {
        drive_raise(d, FAULT_OVERVOLTAGE);
        return DRIVE_FAULT;
    }
    if (c->phase == (uint16_t)CATCH_SEEN || d->periods < c->pause || catch_bus_is_high(d, p)) {
        return DRIVE_CATCH;
    }
    if (c->phase == (uint16_t)CATCH_PAUSE) {
        catch_enter(c, CATCH_SECOND_LOOK);
    } else {
        catch_begin(&d->run, p);
    }
    return DRIVE_BOOTSTRAP;
}

QM_WRAPS void catch_preset_estimator(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    estimator_t *e = &run->estimator;
    const catch_t *c = &run->catching;
    int16_t ahead = qm_with_sign(0x4000, e->omega_erpm);
    uint16_t emf, most;
    int32_t half_step_q32 = qm_mulss(e->omega_erpm, p->estimator.deltat_q32) / 2;
    e->rho_q32 = ((uint32_t)(angle_t)(c->direction - (angle_t)ahead) << 16) + (uint32_t)half_step_q32 * (uint32_t)(uint16_t)(c->half_periods + 2u * d->periods + 1u);
    e->next = estimator_ahead(e->rho_q32, 2 * half_step_q32);
    e->half_step_q16_rad = qm_mulhi_su(e->omega_erpm, p->estimator.half_step_q16_rad);
    e->omega_filtered_q16 = (int32_t)e->omega_erpm * 65536;
    estimator_choose_span(e, &p->estimator);
    estimator_follow(e, &p->estimator);
    drive_update_model(run, p, e->omega_erpm, e->omega_erpm);
    emf = qm_divud(qm_muluu((uint16_t)qm_abs(e->omega_erpm), 2048u), (uint16_t)run->model.inv_kfi);
    e->e_q_q28 = (int32_t)qm_with_sign((int16_t)emf, ahead) * 65536;
    emf = (uint16_t)(4u * ((emf > 8191u) ? 8191u : emf));
    most = (uint16_t)d->circle.limit_q14;
    run->control.v_q14.q = qm_with_sign((int16_t)((emf > most) ? most : emf), ahead);
}

void catch_close(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    drive_control_t *c = &run->control;
    drive_set_direction(d, qm_with_sign(1, run->estimator.omega_erpm));
    c->reference_erpm = run->estimator.omega_erpm;
    c->ref_q13.d = run->fieldweak.table_q13;
    c->ref_q13.q = 0;
    c->v_q14.d = 0;
    handover_preset(d, p, estimator_next_angle(&run->estimator));
    deferred_preset(run, inverse_park_q(c->v_q14.q, d->frame));
    handover_enter(&run->handover, START_OBSERVE);
    drive_enter(d, DRIVE_CLOSED);
}

/* wcet: catch_step/catch_preset_estimator excludes estimator_remember catch_look calibration_step startup_bootstrap idle_move */
void catch_step(drive_t *d, const drive_params_t *p)
{
    if (d->run.catching.phase != (uint16_t)CATCH_SEEN || d->periods < CATCH_PAUSE_LEAST) { /* the look's current goes first */
        return;
    }
    catch_preset_estimator(d, p);
    if (qm_abs(d->run.estimator.omega_erpm) >= p->minimum_erpm) {
        catch_close(d, p);
    } else {
        startup_ramp_from_here(d, p);
    }
}
