/* The motor-control PWM module: time base, duty buffers, dead-time generators, overrides, fault input, special event trigger. */
#include "vb_internal.h"

#include <math.h>
#include <string.h>

enum {
    PTEN = 0x8000,
    UDIS = 0x0001,
    OSYNC = 0x0002,
    IUE = 0x0004,
    FLTAM = 0x0080,
    SEVTDIR = 0x8000,
    PWM1MD = 0x0200,
    UDIS_PATIENCE = 200, /* periods of blocked duty updates before the board mentions it */
    IDLE_PATIENCE = 400, /* periods without PWM, the same */
    LIVE_PATIENCE = 4000 /* the same when the start-up takes its time */
};

#define SAME_INSTANT_S 1e-12

/* What the two transistors of a leg are asked to be at the time `t_s` of the period; bit 0 low, bit 1 high. */
static uint8_t request_at(const vb_leg_t *leg, double t_s)
{
    if (leg->faulted) {
        return leg->fault_out;
    }
    bool reference = t_s < leg->a_s || t_s >= leg->b_s;
    unsigned pwm = reference ? VB_GATE_HIGH : VB_GATE_LOW;
    if (leg->idle) {
        pwm = VB_GATE_OFF;
    } else if (leg->independent) {
        pwm = reference ? VB_GATE_BOTH : VB_GATE_OFF;
    }
    unsigned module = (pwm & leg->povd) | (leg->pout & ~(unsigned)leg->povd);
    if (module == VB_GATE_BOTH && !leg->independent) {
        module = VB_GATE_HIGH; /* a complementary pair never drives both; the high side has priority */
    }
    return (uint8_t)((module & leg->pen) | (leg->port & ~(unsigned)leg->pen));
}

/* The request changes at `t_s`. */
static void change_request(vb_leg_state_t *s, double t_s, uint8_t request)
{
    if (request == s->to) {
        return;
    }
    s->from = s->gate;
    s->to = request;
    s->change_s = t_s;
    s->stage = s->gate == request ? 2 : 0;
}

/* Next edge of a change that is under way: its time, and the gate state after it. */
static double next_edge(const vb_leg_t *leg, double turn_on_s, double turn_off_s, uint8_t *gate)
{
    const vb_leg_state_t *s = &leg->state;
    double off_s = s->change_s + turn_off_s;
    double dead_s = s->to == VB_GATE_HIGH ? leg->dead_high_s : leg->dead_low_s;
    double on_s = s->change_s + turn_on_s + (leg->independent ? 0.0 : dead_s);
    *gate = s->to;
    if (s->to == VB_GATE_OFF) {
        return off_s;
    }
    if (s->from == VB_GATE_OFF || s->from == VB_GATE_BOTH || s->to == VB_GATE_BOTH) {
        return on_s;
    }
    if (s->stage == 1) {
        return vb_max(on_s, off_s);
    }
    *gate = off_s <= on_s ? VB_GATE_OFF : VB_GATE_BOTH;
    return vb_min(on_s, off_s);
}

/* Emit the edges before `until_s`. */
static void emit_edges(vb_t *vb, vb_leg_t *leg, double until_s)
{
    vb_leg_state_t *s = &leg->state;
    while (s->stage < 2) {
        uint8_t gate = 0;
        double t_s = next_edge(leg, vb->inverter.turn_on_s, vb->inverter.turn_off_s, &gate);
        if (t_s >= until_s || leg->count >= VB_EDGES) {
            return;
        }
        leg->edge_s[leg->count] = t_s;
        leg->edge_gate[leg->count] = gate;
        leg->count++;
        s->gate = gate;
        s->stage = gate == s->to ? 2 : 1;
    }
}

static void plan_leg(vb_t *vb, vb_leg_t *leg, double from_s, double until_s)
{
    leg->count = 0;
    leg->next = 0;
    change_request(&leg->state, from_s, request_at(leg, from_s));
    if (leg->a_s > from_s && leg->a_s < until_s) {
        emit_edges(vb, leg, leg->a_s);
        change_request(&leg->state, leg->a_s, request_at(leg, leg->a_s));
    }
    if (leg->b_s > from_s && leg->b_s < until_s && leg->b_s > leg->a_s) {
        emit_edges(vb, leg, leg->b_s);
        change_request(&leg->state, leg->b_s, request_at(leg, leg->b_s));
    }
    emit_edges(vb, leg, until_s);
}

static double period_of(const vb_pwm_t *pwm)
{
    return pwm->length_s;
}

static void decode_duty(vb_pwm_t *pwm)
{
    for (unsigned k = 0; k < 3; k++) {
        vb_leg_t *leg = &pwm->leg[k];
        double high_s = 0.5 * pwm->tick_s * (double)pwm->duty[k];
        leg->idle = !pwm->running;
        if (pwm->centre) {
            leg->a_s = vb_min(high_s, 0.5 * pwm->period_s);
            leg->b_s = pwm->period_s - leg->a_s;
        } else {
            leg->a_s = vb_min(high_s, pwm->period_s);
            leg->b_s = pwm->period_s;
        }
    }
}

static void decode_legs(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    unsigned con1 = *vb->reg.pwm1con1;
    unsigned dtcon1 = *vb->reg.p1dtcon1;
    unsigned dtcon2 = *vb->reg.p1dtcon2;
    unsigned port = *vb->reg.latb & ~(unsigned)*vb->reg.trisb;
    double tcy_s = 1.0 / pwm->fcy_hz;
    double unit_a_s = tcy_s * (double)((dtcon1 & 0x3Fu) << ((dtcon1 >> 6) & 3u));
    double unit_b_s = tcy_s * (double)(((dtcon1 >> 8) & 0x3Fu) << ((dtcon1 >> 14) & 3u));
    for (unsigned k = 0; k < 3; k++) {
        vb_leg_t *leg = &pwm->leg[k];
        leg->pen = (uint8_t)(((con1 >> k) & 1u) | (((con1 >> (4u + k)) & 1u) << 1));
        leg->independent = ((con1 >> (8u + k)) & 1u) != 0;
        leg->povd = (uint8_t)((pwm->ovdcon >> (8u + 2u * k)) & 3u);
        leg->pout = (uint8_t)((pwm->ovdcon >> (2u * k)) & 3u);
        /* PWM1H1/L1 are RB14/RB15, H2/L2 RB12/RB13, H3/L3 RB10/RB11 */
        leg->port = (uint8_t)(((port >> (15u - 2u * k)) & 1u) | (((port >> (14u - 2u * k)) & 1u) << 1));
        leg->dead_low_s = ((dtcon2 >> (2u * k)) & 1u) != 0 ? unit_b_s : unit_a_s;
        leg->dead_high_s = ((dtcon2 >> (2u * k + 1u)) & 1u) != 0 ? unit_b_s : unit_a_s;
        if (pwm->leg[k].pout == 3 && leg->povd != 3 && !leg->independent) {
            vb_warn(vb, "P1OVDCON: both transistors of pair %u are commanded on, a complementary pair drives the high side only", k + 1u);
        }
    }
}

static void warn_settings(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    unsigned con1 = *vb->reg.pwm1con1;
    if ((con1 & 0x77u) != 0x77u) {
        vb_warn(vb, "PWM1CON1: PENxH/PENxL is 0x%02X, outputs that are not enabled stay with the port", con1 & 0x77u);
    }
    if ((con1 & 0x700u) != 0) {
        vb_warn(vb, "PWM1CON1: PMODx makes a pair independent, both transistors switch together without dead time");
    }
    if ((*vb->reg.p1fltacon & 7u) != 7u) {
        vb_warn(vb, "P1FLTACON: FAENx is %u, the fault input does not switch off every pair", *vb->reg.p1fltacon & 7u);
    }
    if ((*vb->reg.p1fltacon & 0x3F00u) != 0) {
        vb_warn(vb, "P1FLTACON: FAOVx keeps outputs driven during a fault");
    }
    for (unsigned k = 0; k < 3; k++) {
        double dead_s = vb_min(pwm->leg[k].dead_low_s, pwm->leg[k].dead_high_s);
        double margin_s = dead_s + vb->inverter.turn_on_s - vb->inverter.turn_off_s;
        if (!pwm->leg[k].independent && (dead_s <= 0.0 || margin_s < 0.0)) {
            vb_warn(vb, "P1DTCON1: a dead time of %.2f us lets both transistors of a leg conduct at once", dead_s * 1e6);
        }
    }
}

static void warn_time_base(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    unsigned mode = *vb->reg.p1tcon & 3u;
    if (mode != 2) {
        vb_warn(vb, "P1TCON: PTMOD is %u, 2 is centre-aligned with one update a period%s", mode,
                mode == 1 ? "; single-event mode stops after one period" : "");
    }
    double hz = 1.0 / pwm->period_s;
    if (vb->expected_pwm_hz > 0.0 && fabs(hz / vb->expected_pwm_hz - 1.0) > 0.01) {
        vb_warn(vb, "P1TPER: the PWM runs at %.2f kHz, expected %.2f kHz", hz * 1e-3, vb->expected_pwm_hz * 1e-3);
    }
}

/* Instant of the special event trigger in this period. */
static void decode_trigger(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    unsigned secmp = *vb->reg.p1secmp;
    unsigned compare = secmp & 0x7FFFu;
    pwm->trigger_s = VB_NEVER;
    if (compare > pwm->tper) {
        vb_warn(vb, "P1SECMP: compare value %u is above P1TPER %u, the ADC is never triggered", compare, pwm->tper);
        return;
    }
    bool down = (secmp & SEVTDIR) != 0;
    if (!pwm->centre && down) {
        vb_warn(vb, "P1SECMP: SEVTDIR asks for counting down, which this P1TCON mode never does");
        return;
    }
    double counts = down ? (double)pwm->ticks - (double)compare : (double)compare;
    pwm->trigger_s = counts >= (double)pwm->ticks ? 0.0 : counts * pwm->tick_s;
    if (pwm->centre && fabs(pwm->trigger_s - 0.5 * pwm->period_s) > 0.12 * pwm->period_s) {
        vb_warn(vb, "P1SECMP: the trigger comes %.1f us into the period, the low sides conduct around %.1f us",
                pwm->trigger_s * 1e6, 0.5e6 * pwm->period_s);
    }
}

static void decode_time_base(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    unsigned tcon = *vb->reg.p1tcon;
    pwm->fcy_hz = vb_clock_fcy_hz(vb);
    pwm->tick_s = (double)(1u << (2u * ((tcon >> 2) & 3u))) / pwm->fcy_hz;
    pwm->centre = (tcon & 2u) != 0;
    pwm->double_update = (tcon & 3u) == 3u;
    pwm->running = (tcon & PTEN) != 0 && (*vb->reg.pmd1 & PWM1MD) == 0;
    if ((tcon & 3u) == 1u) {
        vb_warn(vb, "P1TCON: PTMOD is 1, the single-event mode is not modelled and the PWM stands still");
        pwm->running = false;
    }
}

static void load_duties(vb_t *vb)
{
    vb->pwm.duty[0] = *vb->reg.p1dc1;
    vb->pwm.duty[1] = *vb->reg.p1dc2;
    vb->pwm.duty[2] = *vb->reg.p1dc3;
    decode_duty(&vb->pwm);
}

/* Counter at zero: period and duty take over their buffers unless UDIS holds them. */
static void load_buffers(vb_t *vb, bool started)
{
    vb_pwm_t *pwm = &vb->pwm;
    bool load = (*vb->reg.pwm1con2 & UDIS) == 0 || !pwm->running || started;
    if (load) {
        pwm->tper = (uint16_t)(*vb->reg.p1tper & 0x7FFFu);
    }
    pwm->ticks = (pwm->tper + 1u) * (pwm->centre ? 2u : 1u);
    pwm->period_s = (double)pwm->ticks * pwm->tick_s;
    if (load) {
        load_duties(vb);
    } else {
        decode_duty(pwm);
    }
}

/* True if a register that the module watches differs from what was last decoded. */
static bool settings_changed(vb_t *vb)
{
    const vb_regs_t *r = &vb->reg;
    uint16_t now[16] = {
        *r->p1tcon,    *r->p1tper,    *r->p1secmp, *r->pwm1con1, *r->pwm1con2, *r->p1dtcon1, *r->p1dtcon2, *r->p1fltacon,
        *r->p1ovdcon,  *r->osccon,    *r->clkdiv,  *r->pllfbd,   *r->pmd1,     *r->rpinr12,  *r->latb,     *r->trisb,
    };
    if (memcmp(now, vb->pwm.seen, sizeof now) == 0) {
        return false;
    }
    memcpy(vb->pwm.seen, now, sizeof now);
    return true;
}

void vb_pwm_reset(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    memset(pwm, 0, sizeof *pwm);
    memset(pwm->seen, 0xA5, sizeof pwm->seen); /* differs from every register, so that the first period decodes */
    pwm->fcy_hz = vb_clock_fcy_hz(vb);
    pwm->tick_s = 1.0 / pwm->fcy_hz;
    pwm->trigger_s = VB_NEVER;
    pwm->length_s = VB_IDLE_PERIOD_S;
    for (unsigned k = 0; k < 3; k++) {
        pwm->leg[k].state.stage = 2;
        pwm->leg[k].saved = pwm->leg[k].state;
    }
}

/* The gates as they are now, bits as in P1OVDCON. */
uint8_t vb_pwm_mask(const vb_t *vb)
{
    unsigned mask = 0;
    for (unsigned k = 0; k < 3; k++) {
        mask |= (unsigned)vb->inverter.gate[k] << (2u * k);
    }
    return (uint8_t)mask;
}

static void update_faulted_legs(vb_t *vb)
{
    unsigned fltacon = *vb->reg.p1fltacon;
    for (unsigned k = 0; k < 3; k++) {
        vb_leg_t *leg = &vb->pwm.leg[k];
        leg->faulted = vb->fault.active && ((fltacon >> k) & 1u) != 0;
        leg->fault_out = (uint8_t)((fltacon >> (8u + 2u * k)) & 3u);
    }
}

/* Plan the rest of the period from now on. A leg in its fault state changes at once, without dead time. */
static void plan_rest(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    pwm->planned_from_s = vb->now_s;
    for (unsigned k = 0; k < 3; k++) {
        vb_leg_t *leg = &pwm->leg[k];
        if (leg->faulted) {
            leg->state.from = leg->fault_out;
            leg->state.to = leg->fault_out;
            leg->state.gate = leg->fault_out;
            leg->state.stage = 2;
        }
        leg->saved = leg->state;
        plan_leg(vb, leg, vb->now_s, period_of(pwm));
        if (vb->inverter.gate[k] != (vb_gate_t)leg->saved.gate) {
            vb_inverter_gate(vb, k, (vb_gate_t)leg->saved.gate);
        }
    }
}

static void idle_check(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    if (pwm->running) {
        return;
    }
    if (++pwm->idle_periods == (vb->live != NULL ? LIVE_PATIENCE : IDLE_PATIENCE)) {
        vb_warn(vb, "P1TCON: the PWM does not run (PTEN is %u), nothing triggers the ADC", (*vb->reg.p1tcon & PTEN) != 0 ? 1u : 0u);
    }
}

static void udis_check(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    pwm->udis_periods = (*vb->reg.pwm1con2 & UDIS) != 0 ? pwm->udis_periods + 1u : 0u;
    if (pwm->udis_periods == UDIS_PATIENCE) {
        vb_warn(vb, "PWM1CON2: UDIS has been 1 for %d periods, new duty cycles do not reach the outputs", UDIS_PATIENCE);
    }
}

/* Special events and PWM interrupts pass postscalers. */
static void postscale(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    if (!pwm->running) {
        pwm->trigger_s = VB_NEVER;
        return;
    }
    decode_trigger(vb);
    unsigned every = ((*vb->reg.pwm1con2 >> 8) & 0xFu) + 1u;
    if (++pwm->event_postscale < every) {
        pwm->trigger_s = VB_NEVER;
    } else {
        pwm->event_postscale = 0;
    }
    if (++pwm->postscale >= ((*vb->reg.p1tcon >> 4) & 0xFu) + 1u) {
        pwm->postscale = 0;
        (void)vb_raise(vb, VB_VECTOR_PWM1);
    }
}

/* Start of a period (counter at zero): buffers load, settings are decoded, the edges of the period are planned. */
void vb_pwm_begin(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    vb_fault_check(vb, true);
    bool was_running = pwm->running;
    bool changed = settings_changed(vb);
    if (changed) {
        decode_time_base(vb);
    }
    load_buffers(vb, !was_running);
    pwm->length_s = pwm->running ? pwm->period_s : VB_IDLE_PERIOD_S;
    udis_check(vb);
    idle_check(vb);
    if (changed) {
        pwm->ovdcon = *vb->reg.p1ovdcon;
        decode_legs(vb);
        if (pwm->running) {
            warn_settings(vb);
            warn_time_base(vb);
        }
    }
    update_faulted_legs(vb);
    pwm->seen_mask = vb_pwm_mask(vb);
    plan_rest(vb);
    postscale(vb);
}

/* Bring the dead-time generators, which were planned to the end of the period, back to now. */
static void replay(vb_t *vb)
{
    for (unsigned k = 0; k < 3; k++) {
        vb_leg_t *leg = &vb->pwm.leg[k];
        leg->state = leg->saved;
        plan_leg(vb, leg, vb->pwm.planned_from_s, vb->now_s + SAME_INSTANT_S);
    }
}

/* The firmware has run or the fault input has changed: follow what acts within the period. */
void vb_pwm_replan(vb_t *vb)
{
    replay(vb);
    if ((*vb->reg.pwm1con2 & IUE) != 0) {
        load_duties(vb);
    }
    decode_legs(vb);
    update_faulted_legs(vb);
    plan_rest(vb);
}

void vb_pwm_registers_changed(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    bool immediate = (*vb->reg.pwm1con2 & IUE) != 0
                     && (pwm->duty[0] != *vb->reg.p1dc1 || pwm->duty[1] != *vb->reg.p1dc2 || pwm->duty[2] != *vb->reg.p1dc3);
    bool override = (*vb->reg.pwm1con2 & OSYNC) == 0 && pwm->ovdcon != *vb->reg.p1ovdcon;
    bool outputs = *vb->reg.pwm1con1 != pwm->seen[3] || *vb->reg.p1fltacon != pwm->seen[7];
    if (override) {
        pwm->ovdcon = *vb->reg.p1ovdcon;
    }
    if (immediate || override || outputs) {
        vb_pwm_replan(vb);
    }
}

/* Middle of a period: with P1TCON.PTMOD = 3 the duty buffers load here too. */
void vb_pwm_half(vb_t *vb)
{
    if ((*vb->reg.pwm1con2 & UDIS) == 0) {
        replay(vb);
        load_duties(vb);
        plan_rest(vb);
    }
}

void vb_pwm_end(vb_t *vb)
{
    vb_pwm_t *pwm = &vb->pwm;
    double period_s = period_of(pwm);
    pwm->planned_from_s = 0.0;
    for (unsigned k = 0; k < 3; k++) {
        pwm->leg[k].state.change_s -= period_s;
        pwm->leg[k].saved = pwm->leg[k].state;
    }
    pwm->last_mask = pwm->seen_mask;
}

/* The running time base's count and direction bit at a time of the period. */
uint16_t vb_pwm_counter(const vb_t *vb, double now_s)
{
    const vb_pwm_t *pwm = &vb->pwm;
    double counts = now_s / pwm->tick_s;
    uint32_t n = counts >= (double)pwm->ticks ? pwm->ticks - 1u : (uint32_t)counts;
    return (uint16_t)(pwm->centre && n > pwm->tper ? 0x8000u | (pwm->ticks - n) : n);
}

/* Put the time base's present count and direction where the firmware reads them. */
void vb_pwm_show_counter(vb_t *vb)
{
    if (vb->pwm.running) {
        *vb->reg.p1tmr = vb_pwm_counter(vb, vb->now_s);
    }
}

/* Follow the fault pin. Outputs enter their fault state at once and leave it at the start of a period: by themselves in cycle-by-cycle mode,
 * after FLTA1IF was cleared in latched mode. */
void vb_fault_check(vb_t *vb, bool period_start)
{
    vb_fault_t *fault = &vb->fault;
    double limit_a = vb->inverter.trip_a;
    bool over = limit_a > 0.0 && vb_inverter_bus_a(vb) > limit_a;
    if (over && !fault->comparator) {
        fault->trips += 1.0;
    }
    fault->comparator = over || (fault->comparator && !period_start);
    bool was = fault->pin;
    bool was_active = fault->active;
    fault->pin = vb_io_fault_pin(vb);
    if (fault->pin) {
        fault->active = true;
        fault->latched = (*vb->reg.p1fltacon & FLTAM) == 0;
        if (!was) {
            vb_io_ports(vb);
            (void)vb_raise(vb, VB_VECTOR_FLTA1);
        }
    } else if (period_start && fault->active && (!fault->latched || (*vb->reg.ifs3 & 0x8000u) == 0)) {
        fault->active = false;
    }
    if (!period_start && fault->active != was_active) {
        vb_pwm_replan(vb);
    }
}
