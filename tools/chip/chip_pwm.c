/* The motor-control PWM module: time base, duty buffers, dead-time generators, overrides, fault input, special event trigger. */
#include "chip_pwm_edges.h"

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
    UDIS_PATIENCE = 200, /* periods of blocked duty updates before they are mentioned */
    IDLE_PATIENCE = 400  /* periods without PWM, the same */
};

#define SAME_INSTANT_S 1e-12

/* What the two transistors of a leg are asked to be at the time `t_s` of the period; bit 0 low, bit 1 high. */
static uint8_t request_at(const chip_leg_t *leg, double t_s)
{
    if (leg->faulted) {
        return leg->fault_out;
    }
    bool reference = t_s < leg->a_s || t_s >= leg->b_s;
    unsigned pwm = reference ? PLANT_GATE_HIGH : PLANT_GATE_LOW;
    if (leg->idle) {
        pwm = PLANT_GATE_OFF;
    } else if (leg->independent) {
        pwm = reference ? PLANT_GATE_BOTH : PLANT_GATE_OFF;
    }
    unsigned module = (pwm & leg->povd) | (leg->pout & ~(unsigned)leg->povd);
    if (module == PLANT_GATE_BOTH && !leg->independent) {
        module = PLANT_GATE_HIGH; /* a complementary pair never drives both; the high side has priority */
    }
    return (uint8_t)((module & leg->pen) | (leg->port & ~(unsigned)leg->pen));
}

/* The request changes at `t_s`. */
static void change_request(chip_leg_state_t *s, double t_s, uint8_t request)
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
static double next_edge(const chip_leg_t *leg, double turn_on_s, double turn_off_s, uint8_t *gate)
{
    const chip_leg_state_t *s = &leg->state;
    double off_s = s->change_s + turn_off_s;
    double dead_s = s->to == PLANT_GATE_HIGH ? leg->dead_high_s : leg->dead_low_s;
    double on_s = s->change_s + turn_on_s + (leg->independent ? 0.0 : dead_s);
    *gate = s->to;
    if (s->to == PLANT_GATE_OFF) {
        return off_s;
    }
    if (s->from == PLANT_GATE_OFF || s->from == PLANT_GATE_BOTH || s->to == PLANT_GATE_BOTH) {
        return on_s;
    }
    if (s->stage == 1) {
        return plant_max(on_s, off_s);
    }
    *gate = off_s <= on_s ? PLANT_GATE_OFF : PLANT_GATE_BOTH;
    return plant_min(on_s, off_s);
}

/* Emit the edges before `until_s`. */
static void emit_edges(chip_t *chip, chip_leg_t *leg, double until_s)
{
    chip_leg_state_t *s = &leg->state;
    while (s->stage < 2) {
        uint8_t gate = 0;
        double t_s = next_edge(leg, chip->plant->inverter.turn_on_s, chip->plant->inverter.turn_off_s, &gate);
        if (t_s >= until_s || leg->count >= CHIP_EDGES) {
            return;
        }
        leg->edge_s[leg->count] = t_s;
        leg->edge_gate[leg->count] = gate;
        leg->count++;
        s->gate = gate;
        s->stage = gate == s->to ? 2 : 1;
    }
}

static void plan_leg(chip_t *chip, chip_leg_t *leg, double from_s, double until_s)
{
    leg->count = 0;
    leg->next = 0;
    change_request(&leg->state, from_s, request_at(leg, from_s));
    if (leg->a_s > from_s && leg->a_s < until_s) {
        emit_edges(chip, leg, leg->a_s);
        change_request(&leg->state, leg->a_s, request_at(leg, leg->a_s));
    }
    if (leg->b_s > from_s && leg->b_s < until_s && leg->b_s > leg->a_s) {
        emit_edges(chip, leg, leg->b_s);
        change_request(&leg->state, leg->b_s, request_at(leg, leg->b_s));
    }
    emit_edges(chip, leg, until_s);
}

static void decode_duty(chip_pwm_t *pwm)
{
    for (unsigned k = 0; k < 3; k++) {
        chip_leg_t *leg = &pwm->leg[k];
        double high_s = 0.5 * pwm->tick_s * (double)pwm->duty[k];
        leg->idle = !pwm->running;
        if (pwm->centre) {
            leg->a_s = plant_min(high_s, 0.5 * pwm->period_s);
            leg->b_s = pwm->period_s - leg->a_s;
        } else {
            leg->a_s = plant_min(high_s, pwm->period_s);
            leg->b_s = pwm->period_s;
        }
    }
}

static void decode_legs(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    unsigned con1 = CHIP_REG(chip, PWM1CON1);
    unsigned dtcon1 = CHIP_REG(chip, P1DTCON1);
    unsigned dtcon2 = CHIP_REG(chip, P1DTCON2);
    unsigned port = CHIP_REG(chip, LATB) & ~(unsigned)CHIP_REG(chip, TRISB);
    double tcy_s = 1.0 / chip->clock.fcy_hz;
    double unit_a_s = tcy_s * (double)((dtcon1 & 0x3Fu) << ((dtcon1 >> 6) & 3u));
    double unit_b_s = tcy_s * (double)(((dtcon1 >> 8) & 0x3Fu) << ((dtcon1 >> 14) & 3u));
    for (unsigned k = 0; k < 3; k++) {
        chip_leg_t *leg = &pwm->leg[k];
        leg->pen = (uint8_t)(((con1 >> k) & 1u) | (((con1 >> (4u + k)) & 1u) << 1));
        leg->independent = ((con1 >> (8u + k)) & 1u) != 0;
        leg->povd = (uint8_t)((pwm->ovdcon >> (8u + 2u * k)) & 3u);
        leg->pout = (uint8_t)((pwm->ovdcon >> (2u * k)) & 3u);
        /* PWM1H1/L1 are RB14/RB15, H2/L2 RB12/RB13, H3/L3 RB10/RB11 */
        leg->port = (uint8_t)(((port >> (15u - 2u * k)) & 1u) | (((port >> (14u - 2u * k)) & 1u) << 1));
        leg->dead_low_s = ((dtcon2 >> (2u * k)) & 1u) != 0 ? unit_b_s : unit_a_s;
        leg->dead_high_s = ((dtcon2 >> (2u * k + 1u)) & 1u) != 0 ? unit_b_s : unit_a_s;
        if (pwm->leg[k].pout == 3 && leg->povd != 3 && !leg->independent) {
            chip_warn(chip, "P1OVDCON: both transistors of pair %u are commanded on, a complementary pair drives the high side only",
                      k + 1u);
        }
    }
}

static void warn_settings(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    unsigned con1 = CHIP_REG(chip, PWM1CON1);
    if ((con1 & 0x77u) != 0x77u) {
        chip_warn(chip, "PWM1CON1: PENxH/PENxL is 0x%02X, outputs that are not enabled stay with the port", con1 & 0x77u);
    }
    if ((con1 & 0x700u) != 0) {
        chip_warn(chip, "PWM1CON1: PMODx makes a pair independent, both transistors switch together without dead time");
    }
    if (chip_ports_fault_used(chip) && (CHIP_REG(chip, P1FLTACON) & 7u) != 7u) {
        chip_warn(chip, "P1FLTACON: FAENx is %u, the fault input does not switch off every pair", CHIP_REG(chip, P1FLTACON) & 7u);
    }
    if ((CHIP_REG(chip, P1FLTACON) & 0x3F00u) != 0) {
        chip_warn(chip, "P1FLTACON: FAOVx keeps outputs driven during a fault");
    }
    for (unsigned k = 0; k < 3; k++) {
        double dead_s = plant_min(pwm->leg[k].dead_low_s, pwm->leg[k].dead_high_s);
        double margin_s = dead_s + chip->plant->inverter.turn_on_s - chip->plant->inverter.turn_off_s;
        if (!pwm->leg[k].independent && (dead_s <= 0.0 || margin_s < 0.0)) {
            chip_warn(chip, "P1DTCON1: a dead time of %.2f us lets both transistors of a leg conduct at once", dead_s * 1e6);
        }
    }
}

static void warn_time_base(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    unsigned mode = CHIP_REG(chip, P1TCON) & 3u;
    if (mode != 2) {
        chip_warn(chip, "P1TCON: PTMOD is %u, 2 is centre-aligned with one update a period%s", mode,
                mode == 1 ? "; single-event mode stops after one period" : "");
    }
    double hz = 1.0 / pwm->period_s;
    if (chip->expected_pwm_hz > 0.0 && fabs(hz / chip->expected_pwm_hz - 1.0) > 0.01) {
        chip_warn(chip, "P1TPER: the PWM runs at %.2f kHz, expected %.2f kHz", hz * 1e-3, chip->expected_pwm_hz * 1e-3);
    }
}

/* Instant of the special event trigger in this period. */
static void decode_trigger(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    unsigned secmp = CHIP_REG(chip, P1SECMP);
    unsigned compare = secmp & 0x7FFFu;
    pwm->trigger_s = PLANT_NEVER;
    if (compare > pwm->tper) {
        chip_warn(chip, "P1SECMP: compare value %u is above P1TPER %u, the ADC is never triggered", compare, pwm->tper);
        return;
    }
    bool down = (secmp & SEVTDIR) != 0;
    if (!pwm->centre && down) {
        chip_warn(chip, "P1SECMP: SEVTDIR asks for counting down, which this P1TCON mode never does");
        return;
    }
    double counts = down ? (double)pwm->ticks - (double)compare : (double)compare;
    pwm->trigger_s = counts >= (double)pwm->ticks ? 0.0 : counts * pwm->tick_s;
    if (pwm->centre && fabs(pwm->trigger_s - 0.5 * pwm->period_s) > 0.12 * pwm->period_s) {
        chip_warn(chip, "P1SECMP: the trigger comes %.1f us into the period, the low sides conduct around %.1f us",
                pwm->trigger_s * 1e6, 0.5e6 * pwm->period_s);
    }
}

/* True if the registers ask for a running time base. */
bool chip_pwm_enabled(const chip_t *chip)
{
    return (CHIP_REG(chip, P1TCON) & PTEN) != 0 && (CHIP_REG(chip, PMD1) & PWM1MD) == 0;
}

static void decode_time_base(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    unsigned tcon = CHIP_REG(chip, P1TCON);
    chip_clock_follow(chip);
    chip_clock_check(chip);
    pwm->tick_s = (double)(1u << (2u * ((tcon >> 2) & 3u))) / chip->clock.fcy_hz;
    pwm->centre = (tcon & 2u) != 0;
    pwm->double_update = (tcon & 3u) == 3u;
    pwm->running = chip_pwm_enabled(chip);
    if ((tcon & 3u) == 1u) {
        chip_warn(chip, "P1TCON: PTMOD is 1, the single-event mode is not modelled and the PWM stands still");
        pwm->running = false;
    }
}

static void load_duties(chip_t *chip)
{
    chip->pwm.duty[0] = CHIP_REG(chip, P1DC1);
    chip->pwm.duty[1] = CHIP_REG(chip, P1DC2);
    chip->pwm.duty[2] = CHIP_REG(chip, P1DC3);
    decode_duty(&chip->pwm);
}

/* Counter at zero: period and duty take over their buffers unless UDIS holds them. */
static void load_buffers(chip_t *chip, bool started)
{
    chip_pwm_t *pwm = &chip->pwm;
    bool load = (CHIP_REG(chip, PWM1CON2) & UDIS) == 0 || !pwm->running || started;
    if (load) {
        pwm->tper = (uint16_t)(CHIP_REG(chip, P1TPER) & 0x7FFFu);
    }
    pwm->ticks = (pwm->tper + 1u) * (pwm->centre ? 2u : 1u);
    pwm->period_s = (double)pwm->ticks * pwm->tick_s;
    if (load) {
        load_duties(chip);
    } else {
        decode_duty(pwm);
    }
}

/* True if a register that the module watches differs from what was last decoded. */
static bool settings_changed(chip_t *chip)
{
    static const uint16_t watched[16] = {
        SFR_P1TCON, SFR_P1TPER, SFR_P1SECMP, SFR_PWM1CON1, SFR_PWM1CON2, SFR_P1DTCON1, SFR_P1DTCON2, SFR_P1FLTACON,
        SFR_P1OVDCON, SFR_OSCCON, SFR_CLKDIV, SFR_PLLFBD, SFR_PMD1, SFR_RPINR12, SFR_LATB, SFR_TRISB,
    };
    uint16_t now[16];
    for (unsigned n = 0; n < 16; n++) {
        now[n] = chip_get(chip, watched[n]);
    }
    if (memcmp(now, chip->pwm.seen, sizeof now) == 0) {
        return false;
    }
    memcpy(chip->pwm.seen, now, sizeof now);
    return true;
}

void chip_pwm_reset(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    memset(pwm, 0, sizeof *pwm);
    memset(pwm->seen, 0xA5, sizeof pwm->seen); /* differs from every register, so that the first period decodes */
    chip_clock_follow(chip);
    chip_clock_check(chip);
    pwm->tick_s = 1.0 / chip->clock.fcy_hz;
    pwm->trigger_s = PLANT_NEVER;
    pwm->length_s = CHIP_IDLE_PERIOD_S;
    for (unsigned k = 0; k < 3; k++) {
        pwm->leg[k].state.stage = 2;
        pwm->leg[k].saved = pwm->leg[k].state;
    }
}

static void update_faulted_legs(chip_t *chip)
{
    unsigned fltacon = CHIP_REG(chip, P1FLTACON);
    for (unsigned k = 0; k < 3; k++) {
        chip_leg_t *leg = &chip->pwm.leg[k];
        leg->faulted = chip->fault.active && ((fltacon >> k) & 1u) != 0;
        leg->fault_out = (uint8_t)((fltacon >> (8u + 2u * k)) & 3u);
    }
}

/* Plan the rest of the period from now on. A leg in its fault state changes at once, without dead time. */
static void plan_rest(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    pwm->planned_from_s = chip->plant->now_s;
    for (unsigned k = 0; k < 3; k++) {
        chip_leg_t *leg = &pwm->leg[k];
        if (leg->faulted) {
            leg->state.from = leg->fault_out;
            leg->state.to = leg->fault_out;
            leg->state.gate = leg->fault_out;
            leg->state.stage = 2;
        }
        leg->saved = leg->state;
        plan_leg(chip, leg, chip->plant->now_s, pwm->length_s);
        if (chip->plant->inverter.gate[k] != (plant_gate_t)leg->saved.gate) {
            plant_inverter_gate(chip->plant, k, (plant_gate_t)leg->saved.gate);
        }
    }
}

static void idle_check(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    if (pwm->running) {
        return;
    }
    if (++pwm->idle_periods == IDLE_PATIENCE + chip->cpu.start_periods) {
        chip_warn(chip, "P1TCON: the PWM does not run (PTEN is %u), nothing triggers the ADC",
                  (CHIP_REG(chip, P1TCON) & PTEN) != 0 ? 1u : 0u);
    }
}

static void udis_check(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    pwm->udis_periods = (CHIP_REG(chip, PWM1CON2) & UDIS) != 0 ? pwm->udis_periods + 1u : 0u;
    if (pwm->udis_periods == UDIS_PATIENCE) {
        chip_warn(chip, "PWM1CON2: UDIS has been 1 for %d periods, new duty cycles do not reach the outputs", UDIS_PATIENCE);
    }
}

/* Special events and PWM interrupts pass postscalers. */
static void postscale(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    if (!pwm->running) {
        pwm->trigger_s = PLANT_NEVER;
        return;
    }
    decode_trigger(chip);
    unsigned every = ((CHIP_REG(chip, PWM1CON2) >> 8) & 0xFu) + 1u;
    if (++pwm->event_postscale < every) {
        pwm->trigger_s = PLANT_NEVER;
    } else {
        pwm->event_postscale = 0;
    }
    if (++pwm->postscale >= ((CHIP_REG(chip, P1TCON) >> 4) & 0xFu) + 1u) {
        pwm->postscale = 0;
        (void)chip_irq_raise(chip, CHIP_IRQ_PWM1);
    }
}

/* Start of a period (counter at zero), after chip_pwm_fault(): buffers load, settings are decoded, the edges of the period are planned. */
void chip_pwm_begin(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    bool was_running = pwm->running;
    bool changed = settings_changed(chip);
    if (changed) {
        decode_time_base(chip);
    }
    load_buffers(chip, !was_running);
    pwm->length_s = pwm->running ? pwm->period_s : CHIP_IDLE_PERIOD_S;
    udis_check(chip);
    idle_check(chip);
    if (changed) {
        pwm->ovdcon = CHIP_REG(chip, P1OVDCON);
        decode_legs(chip);
        if (pwm->running) {
            warn_settings(chip);
            warn_time_base(chip);
        }
    }
    update_faulted_legs(chip);
    pwm->seen_mask = chip_pwm_mask(chip);
    plan_rest(chip);
    postscale(chip);
}

/* Bring the dead-time generators, which were planned to the end of the period, back to now. */
static void replay(chip_t *chip)
{
    for (unsigned k = 0; k < 3; k++) {
        chip_leg_t *leg = &chip->pwm.leg[k];
        leg->state = leg->saved;
        plan_leg(chip, leg, chip->pwm.planned_from_s, chip->plant->now_s + SAME_INSTANT_S);
    }
}

/* The firmware has run or the fault input has changed: follow what acts within the period. */
static void replan(chip_t *chip)
{
    replay(chip);
    if ((CHIP_REG(chip, PWM1CON2) & IUE) != 0) {
        load_duties(chip);
    }
    decode_legs(chip);
    update_faulted_legs(chip);
    plan_rest(chip);
}

void chip_pwm_written(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    bool immediate = (CHIP_REG(chip, PWM1CON2) & IUE) != 0
                     && (pwm->duty[0] != CHIP_REG(chip, P1DC1) || pwm->duty[1] != CHIP_REG(chip, P1DC2)
                         || pwm->duty[2] != CHIP_REG(chip, P1DC3));
    bool override = (CHIP_REG(chip, PWM1CON2) & OSYNC) == 0 && pwm->ovdcon != CHIP_REG(chip, P1OVDCON);
    bool outputs = CHIP_REG(chip, PWM1CON1) != pwm->seen[3] || CHIP_REG(chip, P1FLTACON) != pwm->seen[7];
    if (override) {
        pwm->ovdcon = CHIP_REG(chip, P1OVDCON);
    }
    if (immediate || override || outputs) {
        replan(chip);
    }
}

/* Middle of a period: with P1TCON.PTMOD = 3 the duty buffers load here too. */
void chip_pwm_half(chip_t *chip)
{
    if ((CHIP_REG(chip, PWM1CON2) & UDIS) == 0) {
        replay(chip);
        load_duties(chip);
        plan_rest(chip);
    }
}

void chip_pwm_end(chip_t *chip)
{
    chip_pwm_t *pwm = &chip->pwm;
    double period_s = pwm->length_s;
    pwm->planned_from_s = 0.0;
    for (unsigned k = 0; k < 3; k++) {
        pwm->leg[k].state.change_s -= period_s;
        pwm->leg[k].saved = pwm->leg[k].state;
    }
    pwm->last_mask = pwm->seen_mask;
}

/* The running time base's count and direction bit at a time of the period. */
uint16_t chip_pwm_counter(const chip_t *chip, double now_s)
{
    const chip_pwm_t *pwm = &chip->pwm;
    double counts = now_s / pwm->tick_s;
    uint32_t n = counts >= (double)pwm->ticks ? pwm->ticks - 1u : (uint32_t)counts;
    return (uint16_t)(pwm->centre && n > pwm->tper ? 0x8000u | (pwm->ticks - n) : n);
}

/* Put the time base's present count and direction where the firmware reads them. */
void chip_pwm_show_counter(chip_t *chip)
{
    if (chip->pwm.running) {
        CHIP_REG(chip, P1TMR) = chip_pwm_counter(chip, chip->plant->now_s);
    }
}

/* End this period now: the time base starts or stops, or the device is reset. */
void chip_pwm_cut(chip_t *chip)
{
    chip->pwm.length_s = chip->plant->now_s;
}

/* Follow the fault pin. Outputs enter their fault state at once and leave it at the start of a period: by themselves in cycle-by-cycle
 * mode, after FLTA1IF was cleared in latched mode. */
void chip_pwm_fault(chip_t *chip, bool period_start)
{
    chip_fault_t *fault = &chip->fault;
    bool was = fault->pin;
    bool was_active = fault->active;
    fault->pin = chip_ports_fault(chip);
    if (fault->pin) {
        fault->active = true;
        fault->latched = (CHIP_REG(chip, P1FLTACON) & FLTAM) == 0;
        if (!was) {
            chip_ports_show(chip);
            (void)chip_irq_raise(chip, CHIP_IRQ_FLTA1);
        }
    } else if (period_start && fault->active && (!fault->latched || (CHIP_REG(chip, IFS3) & 0x8000u) == 0)) {
        fault->active = false;
    }
    if (!period_start && fault->active != was_active) {
        replan(chip);
    }
}
