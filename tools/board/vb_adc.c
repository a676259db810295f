/* The 10-bit ADC with its four sample-and-holds, and the board's analogue front end: shunts, bus divider, potentiometer. */
#include "vb_internal.h"

#include <math.h>
#include <string.h>

enum {
    ADON = 0x8000,
    AD12B = 0x0400,
    SIMSAM = 0x0008,
    ASAM = 0x0004,
    SAMP = 0x0002,
    DONE = 0x0001,
    AD1MD = 0x0001,
    AD1IF = 0x2000,      /* in IFS0; the enable bit has the same place in IEC0 */
    SSRC_PWM = 3,
    SSRC_AUTO = 7
};

#define REFERENCE_V 3.3
#define TAD_MIN_S 75e-9
#define TAD_PER_CONVERSION 12.0
#define RC_TAD_S 250e-9

/* splitmix64: the board's own noise source, so that a run depends on rng.seed alone */
static uint64_t next_random(uint64_t *state)
{
    uint64_t z = (*state += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

void vb_adc_seed(vb_adc_t *adc)
{
    adc->rng = (uint64_t)adc->seed;
}

/* Near-Gaussian noise of standard deviation 1: the sum of four 16-bit uniform numbers, each of variance 1/12. */
static double noise(vb_adc_t *adc)
{
    uint64_t r = next_random(&adc->rng);
    uint64_t sum = (r & 0xFFFFu) + ((r >> 16) & 0xFFFFu) + ((r >> 32) & 0xFFFFu) + (r >> 48);
    return ((double)sum * (1.0 / 65536.0) - 2.0) * 1.7320508075688772;
}

/* Current that the shunt of leg 0 (A) or 1 (B) shows at this instant. It needs settle_s after a change of the leg's path; until then the
 * amplifier is on its way. `valid` tells whether the sample is the true current. */
static double shunt_current(const vb_t *vb, unsigned leg, bool *valid)
{
    const vb_inverter_t *inv = &vb->inverter;
    double age_s = vb->start_s + vb->now_s - inv->low_since_s[leg];
    double part = vb->adc.settle_s > 0.0 ? vb_min(1.0, age_s / vb->adc.settle_s) : 1.0;
    if (!inv->low_path[leg]) {
        part = 1.0 - part;
    }
    double i = inv->i[leg];
    *valid = part >= 1.0 || inv->cond[leg] == VB_COND_FLOAT;
    return part * i;
}

static double current_voltage(vb_t *vb, unsigned leg)
{
    bool valid = false;
    double i = shunt_current(vb, leg, &valid);
    if (!valid) {
        *(leg == 0 ? &vb->adc.ia_invalid : &vb->adc.ib_invalid) += 1.0;
    }
    return vb->adc.offset_v + vb->adc.shunt_offset_v[leg] - vb->adc.gain_v_per_a * i;
}

/* Voltage at the analogue input AN<input>. */
static double input_voltage(vb_t *vb, unsigned input)
{
    if (((*vb->reg.ad1pcfgl >> input) & 1u) != 0) {
        return 0.0; /* a digital pin: the multiplexer is connected to ground */
    }
    switch (input) {
    case 0:
    case 1:
        return current_voltage(vb, input);
    case 2:
        return vb->supply.bus_v / vb->adc.vbus_ratio;
    case 3:
    case 4:
    case 5:
        return vb->inverter.v[input - 3] / vb->adc.vbus_ratio;
    case 8:
        return vb->pins.pot * REFERENCE_V;
    default:
        return 0.0;
    }
}

static uint16_t format_result(unsigned form, unsigned code, unsigned bits)
{
    unsigned half = 1u << (bits - 1u);
    switch (form) {
    case 0:
        return (uint16_t)code;
    case 1:
        return (uint16_t)(code - half);
    case 2:
        return (uint16_t)(code << (16u - bits));
    default:
        return (uint16_t)((code << (16u - bits)) ^ 0x8000u);
    }
}

static uint16_t convert(vb_t *vb, unsigned input)
{
    vb_adc_t *adc = &vb->adc;
    unsigned bits = adc->twelve_bit ? 12u : 10u;
    double full = (double)(1u << bits);
    double lsb = input_voltage(vb, input) * (full / REFERENCE_V) * (1.0 + adc->gain_error) + adc->noise_lsb * noise(adc);
    double limited = vb_min(vb_max(floor(lsb + 0.5), 0.0), full - 1.0);
    if (input < 2) {
        adc->reading_a[input] = (adc->offset_v - limited * (REFERENCE_V / full)) / adc->gain_v_per_a;
    }
    return format_result(adc->form, (unsigned)limited, bits);
}

/* Input that sample-and-hold `channel` (0..3) is connected to. */
static unsigned selected_input(const vb_t *vb, unsigned channel)
{
    if (channel == 0) {
        return *vb->reg.ad1chs0 & 0x1Fu;
    }
    return channel - 1u + ((*vb->reg.ad1chs123 & 1u) != 0 ? 3u : 0u);
}

static void warn_inputs(vb_t *vb)
{
    static const unsigned expected[4] = {8, 0, 1, 2};
    static const char *const wired[4] = {"the potentiometer", "IA", "IB", "VBUS"};
    static const struct { unsigned port, bit; } pin[9] = {{0, 0}, {0, 1}, {1, 0}, {1, 1}, {1, 2}, {1, 3}, {2, 0}, {2, 1}, {2, 2}};
    const volatile uint16_t *tris[3] = {vb->reg.trisa, vb->reg.trisb, vb->reg.trisc};
    for (unsigned c = 0; c < vb->adc.channels; c++) {
        unsigned input = selected_input(vb, c);
        if (input != expected[c]) {
            vb_warn(vb, "%s: CH%u samples AN%u, %s is on AN%u", c == 0 ? "AD1CHS0" : "AD1CHS123", c, input, wired[c], expected[c]);
        }
        if (((*vb->reg.ad1pcfgl >> input) & 1u) != 0) {
            vb_warn(vb, "AD1PCFGL: AN%u is sampled but configured as a digital pin, it reads 0 V", input);
        }
        if (input < 9 && ((*tris[pin[input].port] >> pin[input].bit) & 1u) == 0) {
            vb_warn(vb, "TRIS%c: AN%u is sampled but its pin is an output", 'A' + (int)pin[input].port, input);
        }
    }
}

static void warn_settings(vb_t *vb, unsigned con1, unsigned con2)
{
    unsigned ssrc = (con1 >> 5) & 7u;
    if (ssrc != SSRC_PWM) {
        vb_warn(vb, "AD1CON1: SSRC is %u, conversions do not follow the PWM's trigger (3)%s", ssrc,
                ssrc == SSRC_AUTO ? "" : " and this source is not modelled");
    }
    if (vb->adc.form != 3) {
        vb_warn(vb, "AD1CON1: FORM is %u, the results are not signed fractional numbers (3)", vb->adc.form);
    }
    if (vb->adc.twelve_bit) {
        vb_warn(vb, "AD1CON1: AD12B selects 12 bits, which one channel only can do");
    } else if (vb->adc.channels < 4) {
        vb_warn(vb, "AD1CON2: CHPS converts %u of the four channels", vb->adc.channels);
    }
    if ((con1 & SIMSAM) == 0 && vb->adc.channels > 1) {
        vb_warn(vb, "AD1CON1: SIMSAM is 0, each trigger samples one channel only");
    }
    if (vb->adc.sequence_length != 1) {
        vb_warn(vb, "AD1CON2: SMPI interrupts after every %u sequences", vb->adc.sequence_length);
    }
    if ((con2 & 0xE403u) != 0) {
        vb_warn(vb, "AD1CON2: VCFG, CSCNA, BUFM or ALTS is set (0x%04X), which is not modelled", con2);
    }
}

static void warn_timing(vb_t *vb)
{
    vb_adc_t *adc = &vb->adc;
    if (adc->tad_s < TAD_MIN_S - 1e-12) {
        vb_warn(vb, "AD1CON3: the conversion clock is %.1f ns, the converter needs %.0f ns", adc->tad_s * 1e9, TAD_MIN_S * 1e9);
    }
    double all_s = (double)adc->channels * adc->conversion_s;
    if (vb->pwm.running && all_s >= vb->pwm.period_s) {
        vb_warn(vb, "AD1CON3: %u conversions take %.1f us, longer than the PWM period of %.1f us", adc->channels, all_s * 1e6,
                vb->pwm.period_s * 1e6);
    }
}

static void warn_off(vb_t *vb)
{
    vb_warn(vb, "AD1CON1: the PWM runs but the ADC is off (ADON is 0), there are no samples and no ADC interrupts");
}

/* Follow the configuration; cheap when nothing changed. */
void vb_adc_decode(vb_t *vb)
{
    vb_adc_t *adc = &vb->adc;
    const vb_regs_t *r = &vb->reg;
    uint16_t con1 = (uint16_t)(*r->ad1con1 & ~(unsigned)(SAMP | DONE));
    uint16_t now[7] = {con1, *r->ad1con2, *r->ad1con3, *r->ad1chs0, *r->ad1chs123, *r->ad1pcfgl, *r->pmd1};
    if (memcmp(now, adc->seen, sizeof now) == 0) {
        return;
    }
    memcpy(adc->seen, now, sizeof now);
    adc->on = (con1 & ADON) != 0 && (*r->pmd1 & AD1MD) == 0;
    adc->twelve_bit = (con1 & AD12B) != 0;
    adc->form = (con1 >> 8) & 3u;
    unsigned chps = (*r->ad1con2 >> 8) & 3u;
    adc->channels = adc->twelve_bit || chps == 0 ? 1u : chps == 1 ? 2u : 4u;
    adc->sequence_length = ((*r->ad1con2 >> 2) & 0xFu) + 1u;
    unsigned con3 = *r->ad1con3;
    adc->tad_s = (con3 & 0x8000u) != 0 ? RC_TAD_S : (double)((con3 & 0xFFu) + 1u) / vb->pwm.fcy_hz;
    adc->conversion_s = (adc->twelve_bit ? 14.0 : TAD_PER_CONVERSION) * adc->tad_s;
    if (adc->on) {
        warn_settings(vb, con1, *r->ad1con2);
        warn_inputs(vb);
        warn_timing(vb);
    } else if (vb->pwm.running && vb->live == NULL) {
        warn_off(vb);
    }
}

void vb_adc_reset(vb_t *vb)
{
    vb_adc_t *adc = &vb->adc;
    memset(adc->seen, 0xA5, sizeof adc->seen);
    adc->conversion_end_s = 0.0;
    adc->handler_s = VB_NEVER;
    adc->queued = false;
    adc->turn = 0;
    adc->sequence = 0;
    adc->fill = 0;
}

/* Hand a sequence's results to the buffers. True if it was the last of SMPI+1 sequences. */
static bool fill_buffers(vb_t *vb, const uint16_t *result, unsigned count)
{
    vb_adc_t *adc = &vb->adc;
    volatile uint16_t *const buffer[16] = {
        vb->reg.adc1buf0, vb->reg.adc1buf1, vb->reg.adc1buf2, vb->reg.adc1buf3, vb->reg.adc1buf4, vb->reg.adc1buf5,
        vb->reg.adc1buf6, vb->reg.adc1buf7, vb->reg.adc1buf8, vb->reg.adc1buf9, vb->reg.adc1bufa, vb->reg.adc1bufb,
        vb->reg.adc1bufc, vb->reg.adc1bufd, vb->reg.adc1bufe, vb->reg.adc1buff,
    };
    for (unsigned n = 0; n < count; n++) {
        *buffer[adc->fill & 15u] = result[n];
        adc->fill++;
    }
    if (++adc->sequence < adc->sequence_length) {
        return false;
    }
    adc->sequence = 0;
    adc->fill = 0;
    return true;
}

/* The results are there; the handler's end is due. */
static void deliver(vb_t *vb, const uint16_t *result, unsigned count)
{
    if (fill_buffers(vb, result, count)) {
        vb->adc.handler_s = vb_max(vb->adc.conversion_end_s, vb->now_s) + vb->isr_us * 1e-6;
    }
}

/* A CPU with a time of its own gets them when the conversion ends. Its handler takes what it takes; a cpu.isr_us above the usual one is
 * something that holds the interrupt up. */
static void deliver_later(vb_t *vb, const uint16_t *result, unsigned count)
{
    vb_adc_t *adc = &vb->adc;
    if (adc->handler_s < VB_NEVER) {
        adc->overruns += 1.0;
        vb_warn(vb, "IFS0: the next conversion ends while the interrupt is still held up (cpu.isr_us), samples are lost");
        return;
    }
    memcpy(adc->queued_result, result, count * sizeof *result);
    adc->queued_count = count;
    adc->handler_s = adc->conversion_end_s + 1e-6 * vb_max(0.0, vb->isr_us - VB_ISR_US);
    *vb->reg.ad1con1 = (uint16_t)(*vb->reg.ad1con1 & ~(unsigned)DONE);
}

/* True if the sample-and-holds are tracking their inputs, as ASAM = 1 or a set SAMP bit arranges. */
static bool is_sampling(vb_t *vb)
{
    if ((*vb->reg.ad1con1 & (ASAM | SAMP)) != 0) {
        return true;
    }
    vb_warn(vb, "AD1CON1: a trigger came while neither ASAM nor SAMP was set, nothing is converted");
    return false;
}

/* The trigger: hold the inputs, convert them. */
void vb_adc_trigger(vb_t *vb)
{
    vb_adc_t *adc = &vb->adc;
    if (!adc->on || !is_sampling(vb)) {
        return;
    }
    if (vb->now_s < adc->conversion_end_s) {
        vb_warn(vb, "AD1CON3: a trigger came during a conversion and is lost, the conversions are too slow for the PWM");
        return;
    }
    *vb->reg.ad1con1 = (uint16_t)(*vb->reg.ad1con1 & ~(unsigned)SAMP);
    vb_latch(vb);
    adc->samples += 1.0;
    uint16_t result[4];
    unsigned count = 0;
    if ((*vb->reg.ad1con1 & SIMSAM) != 0) {
        for (unsigned c = 0; c < adc->channels; c++) {
            result[count++] = convert(vb, selected_input(vb, c));
        }
    } else {
        result[count++] = convert(vb, selected_input(vb, adc->turn));
        adc->turn = (adc->turn + 1u) % adc->channels;
    }
    adc->conversion_end_s = vb->now_s + (double)count * adc->conversion_s;
    if (vb->live != NULL) {
        deliver_later(vb, result, count);
    } else if (adc->handler_s < VB_NEVER) {
        memcpy(adc->queued_result, result, sizeof result);
        adc->queued_count = count;
        adc->overruns += 1.0;
        adc->queued = true;
        vb_warn(vb, "IFS0: AD1IF is set again before the handler has finished (cpu.isr_us), samples are lost");
    } else {
        deliver(vb, result, count);
    }
}

/* The end of a conversion for a CPU with a time of its own. */
static void conversion_done(vb_t *vb)
{
    vb_adc_t *adc = &vb->adc;
    *vb->reg.ad1con1 = (uint16_t)(*vb->reg.ad1con1 | DONE);
    if (!fill_buffers(vb, adc->queued_result, adc->queued_count)) {
        return;
    }
    if ((*vb->reg.ifs0 & AD1IF) != 0) {
        adc->overruns += 1.0;
        vb_warn(vb, "IFS0: AD1IF is still set when the next conversion ends, the handler was late or never came");
    }
    if (vb->isr_dropped == 0.0) {
        (void)vb_raise(vb, VB_VECTOR_ADC1);
    }
    if (vb->trace.due && (vb->isr_dropped != 0.0 || (*vb->reg.iec0 & AD1IF) == 0)) {
        vb_trace_row(vb);
    }
}

/* The instant at which the handler's writes become visible: run it. */
void vb_adc_handler(vb_t *vb)
{
    vb_adc_t *adc = &vb->adc;
    adc->handler_s = VB_NEVER;
    if (vb->live != NULL) {
        conversion_done(vb);
        return;
    }
    *vb->reg.ad1con1 = (uint16_t)(*vb->reg.ad1con1 | DONE);
    if (vb->isr_dropped != 0.0) {
        *vb->reg.ifs0 = (uint16_t)(*vb->reg.ifs0 | 0x2000u);
    } else {
        (void)vb_raise(vb, VB_VECTOR_ADC1);
    }
    if (vb->trace.due) {
        vb_trace_row(vb);
    }
    if (adc->queued) {
        adc->queued = false;
        deliver(vb, adc->queued_result, adc->queued_count);
    }
}

/* Time of the next trigger in this period that lies after `after_s`. */
double vb_adc_next_trigger(const vb_t *vb, double after_s)
{
    const vb_adc_t *adc = &vb->adc;
    unsigned ssrc = (*vb->reg.ad1con1 >> 5) & 7u;
    if (!adc->on) {
        return VB_NEVER;
    }
    if (ssrc == SSRC_PWM) {
        return vb->pwm.trigger_s > after_s ? vb->pwm.trigger_s : VB_NEVER;
    }
    if (ssrc == SSRC_AUTO) {
        double sample_s = vb_max(1.0, (double)((*vb->reg.ad1con3 >> 8) & 0x1Fu)) * adc->tad_s;
        return vb_max(vb_max(adc->conversion_end_s, 0.0) + sample_s, after_s);
    }
    return VB_NEVER;
}

void vb_adc_end(vb_t *vb)
{
    vb_adc_t *adc = &vb->adc;
    double period_s = vb->now_s;
    adc->conversion_end_s = vb_max(adc->conversion_end_s - period_s, -1.0);
    if (adc->handler_s < VB_NEVER) {
        adc->handler_s -= period_s;
    }
}

/* The same warning for a CPU that needs some time to switch on one after the other. */
void vb_adc_check(vb_t *vb)
{
    enum { PATIENCE = 200 };
    vb_pwm_t *pwm = &vb->pwm;
    pwm->deaf_periods = pwm->running && !vb->adc.on ? pwm->deaf_periods + 1u : 0u;
    if (pwm->deaf_periods == PATIENCE) {
        warn_off(vb);
    }
}
