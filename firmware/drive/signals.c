/* Do the measured currents fit? An open phase and a wrong current signal, by two rules that see different motors: the table is in the header. */
#include "drive/signals.h"

#include "drive/drive.h"

/** Takes the sizes of the phases' currents into sums. @param a,b,c Q13; as a structure they would go over the stack
 *  @param shift so many sums of the largest current must fit a word */
static void signals_add_sizes(uint16_t *sums, current_q13_t a, current_q13_t b, current_q13_t c, uint16_t shift)
{
    sums[0] = (uint16_t)(sums[0] + ((uint16_t)qm_abs(a) >> shift));
    sums[1] = (uint16_t)(sums[1] + ((uint16_t)qm_abs(b) >> shift));
    sums[2] = (uint16_t)(sums[2] + ((uint16_t)qm_abs(c) >> shift));
}

/* ---- the law's rule: voltages and currents fit the motor ---- */

#define SIGNALS_WRONG_SHIFT 6                                                       /* SIGNALS_CHECKS_END sums of a current at the trip level fit a word */
#define SIGNALS_CHECKS_MOST 512u                                                    /* in the sums: more of them are halved */
#define SIGNALS_CHECKS_END 528u                                                     /* and forgotten where no judgement comes */
#define SIGNALS_DEAD_TIMES ((int16_t)(1.0F / PARAM_F(ADAPTATION_EMF_SHARE) + 0.5F)) /* emf_least_q12 is a fifth of what dead time takes */

/** 1 where neither a back-EMF in its direction nor R off by all of it nor dead time explains the voltage: one is commanded that drives no current. */
static uint16_t signals_voltage_is_unexplained(const drive_run_t *run, const drive_params_t *p)
{
    dq_t i = run->control.i_q13, emf = estimator_emf(&run->estimator);
    int16_t unturned_q12 = (int16_t)(qm_abs(emf.d) - qm_abs(emf.q)); /* beyond a back-EMF in its direction */
    uint16_t ri_q12, dead_q12;
    if (unturned_q12 <= 0) { /* as a rule */
        return 0;
    }
    /* fits a word: no current flows for which R takes more voltage than there is */
    ri_q12 = (uint16_t)((uint16_t)model_header_ri(p, qm_abs(i.d)) + (uint16_t)model_header_ri(p, qm_abs(i.q)));
    dead_q12 = (uint16_t)(SIGNALS_DEAD_TIMES * p->adaptation.emf_least_q12);
    return (uint16_t)((uint16_t)unturned_q12 > ri_q12 + dead_q12);
}

/** 1 near the end of a stop, where what dead time leaves can make innovations that do not end: the currents of a rotor that slows down by
 *  itself are too small to tell its sign. A wrong signal would ask for more. */
static uint16_t signals_stop_is_blurred(const drive_t *d, const drive_params_t *p)
{
    return (uint16_t)(d->state == (uint16_t)DRIVE_STOPPING && !d->command.run
                      && !qm_beyond(estimator_emf(&d->run.estimator).q, (int16_t)(SIGNALS_BLUR_TIMES * p->dead_emf_q12 - 1))
                      && !qm_beyond(d->run.control.ref_q13.q, (int16_t)(p->id_off_q13 - 1)));
}

/** Currents that do not fit the motor, with or without a phase that carries hardly any. */
static drive_fault_t signals_which_is_wrong(const uint16_t *sums)
{
    uint16_t most = 0, least = 0xFFFFu, n;
    for (n = 0; n < 3u; n++) { /* wcet: at most 3 turns */
        most = (sums[n] > most) ? sums[n] : most;
        least = (sums[n] < least) ? sums[n] : least;
    }
    return (least < (most >> SIGNALS_OPEN_SHIFT)) ? FAULT_OPEN_PHASE : FAULT_CURRENT_SENSOR;
}

/** Adds x times a pointer. */
static void signals_add_along(signals_beat_t *sum, int16_t x, sincos_t at)
{
    sum->cosine += qm_hi(2 * qm_mulss(x, at.cos));
    sum->sine += qm_hi(2 * qm_mulss(x, at.sin));
}

/** Takes an innovation into the sums. That of a rotor which all but stands turns with no pointer. */
static void signals_gather_beats(signals_evidence_t *e, const drive_t *d, int16_t x)
{
    const sincos_t at = d->frame;
    sincos_t double_angle;
    if (qm_beyond(d->run.control.reference_erpm >> SIGNALS_STANDS_SHIFT, qm_abs(estimator_speed(&d->run.estimator)))) {
        return;
    }
    double_angle.cos = (int16_t)(qm_mulhi(at.cos, at.cos) - qm_mulhi(at.sin, at.sin)); /* half */
    double_angle.sin = (int16_t)(2 * qm_mulhi(at.cos, at.sin));
    signals_add_along(&e->once, x, at);
    signals_add_along(&e->twice, (int16_t)(2 * qm_limit(x, 16383)), double_angle);
}

/** Takes a step into the sums. */
static void signals_gather(signals_evidence_t *e, const drive_t *d, uint16_t unexplained)
{
    const int16_t x = d->run.observer.innovation_erpm;
    signals_gather_beats(e, d, x);
    e->size += (uint16_t)qm_abs(x);
    e->checks++;
    e->unexplained = (uint16_t)(e->unexplained + unexplained);
    signals_add_sizes(e->phases, d->phases_q13.a, d->phases_q13.b, d->phases_q13.c, SIGNALS_WRONG_SHIFT);
}

/** How much of the sum turns with its pointer. @return 1 to 1.4 times that */
static NOINLINE uint32_t signals_beat(const signals_beat_t *sum)
{
    return (uint32_t)((sum->cosine < 0) ? -sum->cosine : sum->cosine) + (uint32_t)((sum->sine < 0) ? -sum->sine : sum->sine);
}

/** 1 where it swings with the field, as only a wrong signal does. */
static uint16_t signals_swing(const signals_evidence_t *e)
{
    const uint32_t least = e->size / 2u + e->size / 8u;
    return (uint16_t)(signals_beat(&e->once) > least || signals_beat(&e->twice) > least);
}

/** Begins anew; member by member, for the longest path knows of no loop over bytes. */
static NOINLINE void signals_forget(signals_evidence_t *e)
{
    e->once.cosine = 0;
    e->once.sine = 0;
    e->twice = e->once;
    e->size = 0;
    e->checks = 0;
    e->unexplained = 0;
    e->phases[0] = 0;
    e->phases[1] = 0;
    e->phases[2] = 0;
}

/** Half of all that proves nothing. */
static NOINLINE void signals_fade(signals_evidence_t *e)
{
    uint16_t n;
    e->once.cosine /= 2;
    e->once.sine /= 2;
    e->twice.cosine /= 2;
    e->twice.sine /= 2;
    e->size >>= 1;
    e->checks = (uint16_t)((e->checks + 1u) >> 1); /* the mean size does not grow by rounding */
    e->unexplained >>= 1;
    for (n = 0; n < 3u; n++) { /* wcet: at most 3 turns */
        e->phases[n] >>= 1;
    }
}

void signals_check(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    const uint16_t unexplained = signals_voltage_is_unexplained(run, p);
    if (unexplained) {
        run->observer.wrong_steps = (uint16_t)(run->observer.wrong_steps + SIGNALS_UNEXPLAINED);
    }
    if (run->observer.wrong_steps != 0u && run->evidence.checks < SIGNALS_CHECKS_END) {
        signals_gather(&run->evidence, d, unexplained);
    } else if (run->evidence.checks != 0u) {
        signals_forget(&run->evidence);
    } else { /* as a rule: nothing is wrong */
    }
}

void signals_judge(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    signals_evidence_t *e = &run->evidence;
    const uint16_t goes_on = (uint16_t)(run->observer.wrong_steps > p->wrong_steps);
    /* a swing of fast turns need not go on: no load's step lasts for a turn of the field, and a shaken observer answers slowly */
    const uint16_t swings = (uint16_t)((goes_on || (e->checks > p->wrong_steps && qm_beyond(observer_speed(&run->observer), SIGNALS_TURN_ERPM / SPEED_UNIT)))
                                       && signals_swing(e));
    if (!goes_on && !swings) {
        if (e->checks > SIGNALS_CHECKS_MOST) { /* what comes and goes has no end */
            signals_fade(e);
        }
    } else if (signals_stop_is_blurred(d, p)) {
        drive_enter(d, DRIVE_STOPPED); /* as at a stop's end: the bridge goes off and the rotor runs out */
    } else if (swings || e->size > qm_muluu(e->checks, p->load_erpm) || e->unexplained > e->checks / 2u) {
        drive_raise(d, signals_which_is_wrong(e->phases)); /* only a wrong signal can be behind it */
    } else {
        run->observer.wrong_steps >>= 1;
        signals_fade(e);
    }
}

/* ---- the background's rule: what flows follows what is asked for ---- */

#define SIGNALS_SAMPLE_SHIFT 4 /* so many sums of half the range fit a word */
#define SIGNALS_WAIT_LEAST 16u /* periods from a sample to the next: 16 to 23, each in turn, so that no speed meets the same angles again and again */
#define SIGNALS_WAIT_STEP 5u
#define SIGNALS_WAIT_MASK 7u

/** Takes the phases' currents into their sums. What is asked for goes by the next period's angle: in the mean over a turn they agree. */
static void signals_add(signals_sums_t *sums, const drive_t *d)
{
    phases_t asked = phases_of(d->run.control.ref_q13, d->frame);
    signals_add_sizes(sums->asked, asked.a, asked.b, asked.c, SIGNALS_SAMPLE_SHIFT);
    signals_add_sizes(sums->flows, d->phases_q13.a, d->phases_q13.b, d->phases_q13.c, SIGNALS_SAMPLE_SHIFT);
}

/** 1 where a phase is asked for more than noise and carries less than a quarter of the share of it that the phase with the most current does. */
static uint16_t signals_lack_a_phase(const signals_sums_t *sums, const drive_params_t *p)
{
    const uint16_t least = (uint16_t)(((uint16_t)p->id_off_q13 * SIGNALS_SAMPLES) >> SIGNALS_SAMPLE_SHIFT);
    uint16_t n, flows = 0, asked = 0;
    for (n = 3; n != 0u; n--) {
        if (sums->flows[n - 1u] >= flows) {
            flows = sums->flows[n - 1u];
            asked = sums->asked[n - 1u];
        }
    }
    flows = (flows < asked) ? flows : asked; /* more is noise */
    for (n = 0; n < 3u; n++) {
        if (sums->asked[n] >= least && qm_muluu(sums->flows[n], asked) < (qm_muluu(flows, sums->asked[n]) >> SIGNALS_OPEN_SHIFT)) {
            return 1;
        }
    }
    return 0;
}

/** 1 in closed loop after the hand-over; a reversal's ramp forgets nothing. */
static uint16_t signals_are_judged(const drive_t *d)
{
    return (uint16_t)(drive_is_closed(d) && d->run.handover.id_q13 == 0);
}

uint16_t signals_phases(signals_t *s, const drive_t *d, const drive_params_t *p)
{
    const uint16_t now = d->ticks;
    uint16_t wait;
    if (!drive_is_running(d) || s->sums.samples >= SIGNALS_SAMPLES) {
        drive_zero(&s->sums, sizeof s->sums);
    }
    wait = (uint16_t)(SIGNALS_WAIT_LEAST + ((s->sums.samples * SIGNALS_WAIT_STEP) & SIGNALS_WAIT_MASK));
    if (!signals_are_judged(d) || (uint16_t)(now - s->sampled_tick) < wait) {
        return (uint16_t)FAULT_NONE;
    }
    s->sampled_tick = now;
    signals_add(&s->sums, d);
    s->sums.samples++;
    return (uint16_t)((s->sums.samples >= SIGNALS_SAMPLES && signals_lack_a_phase(&s->sums, p)) ? FAULT_OPEN_PHASE : FAULT_NONE);
}

uint16_t signals_d_current(signals_t *s, const drive_t *d, const drive_params_t *p)
{
    const drive_control_t *c = &d->run.control;
    int32_t off_q16;
    int16_t size;
    if (!drive_is_running(d)) {
        s->id_q16 = 0;
    }
    if (!signals_are_judged(d)) {
        return (uint16_t)FAULT_NONE;
    }
    size = qm_clamp(qm_abs((int16_t)(c->ref_q13.d - c->i_q13.d)), 0, (int16_t)(SIGNALS_MOST_TIMES * p->id_off_q13));
    off_q16 = (int32_t)size * 65536 - s->id_q16;
    s->id_q16 += qm_mulsu(qm_hi(off_q16), 1u << (16 - SIGNALS_MEAN_SHIFT)) + (int32_t)((uint16_t)off_q16 >> SIGNALS_MEAN_SHIFT); /* off >> shift */
    return (uint16_t)((qm_hi(s->id_q16) > p->id_off_q13) ? FAULT_CURRENT_SENSOR : FAULT_NONE);
}

#define SIGNALS_TURN_MOST_MS 1024u /* a turn that does not end is none */

uint16_t signals_offset(signals_t *s, const drive_t *d, const drive_params_t *p)
{
    const dq_t emf = estimator_emf(&d->run.estimator);
    const sincos_t at = d->frame;
    const uint16_t whole = (uint16_t)(s->sine_q15 < 0 && at.sin >= 0), before = s->emf_stood;
    s->sine_q15 = at.sin;
    if (!signals_are_judged(d) || held_angle_stands(&d->run.held) || qm_beyond(observer_speed(&d->run.observer), SIGNALS_TURN_ERPM / SPEED_UNIT)
        || s->emf_ms >= SIGNALS_TURN_MOST_MS) {
        s->emf_stood = 0;
    } else if (!whole || s->emf_ms < SIGNALS_TURNS_MS) {
        s->emf_q12.cosine += qm_hi(2 * (qm_mulss(emf.d, at.cos) - qm_mulss(emf.q, at.sin)));
        s->emf_q12.sine += qm_hi(2 * (qm_mulss(emf.d, at.sin) + qm_mulss(emf.q, at.cos)));
        s->emf_ms++;
        return (uint16_t)FAULT_NONE;
    } else {
        const uint16_t most_q12 = (uint16_t)(p->adaptation.emf_least_q12 << (qm_beyond(d->run.control.i_q13.q, SIGNALS_FLOWS_Q13) ? 0 : 1));
        const uint32_t ends = 2u * (uint32_t)(uint16_t)qm_abs(emf.q); /* the turn's ends are a millisecond wide: at most sqrt 2 of it on both axes */
        s->emf_stood = (uint16_t)(signals_beat(&s->emf_q12) > ends + qm_muluu(s->emf_ms, most_q12));
    }
    s->emf_q12.cosine = 0;
    s->emf_q12.sine = 0;
    s->emf_ms = 0;
    return (uint16_t)((before & s->emf_stood) ? FAULT_CURRENT_SENSOR : FAULT_NONE);
}
