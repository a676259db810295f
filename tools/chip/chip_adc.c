/* The 10-bit ADC with its four sample-and-holds. */
#include "chip.h"

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
    SSRC_AUTO = 7,
    INPUT_PATIENCE = 4, /* periods of a selection of inputs before it is judged: a test of the converter lasts two */
    DEAF_PATIENCE = 200 /* periods of a running PWM without the ADC before they are mentioned */
};

#define REFERENCE_V 3.3
#define TAD_MIN_S 76e-9 /* AD50, 10 bits */
#define TAD_PER_CONVERSION 12.0
#define RC_TAD_S 250e-9

/* splitmix64: a noise source of its own, so that a run depends on rng.seed alone */
static uint64_t next_random(uint64_t *state)
{
    uint64_t z = (*state += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

void chip_adc_seed(chip_adc_t *adc)
{
    adc->rng = (uint64_t)adc->seed;
}

/* Near-Gaussian noise of standard deviation 1: the sum of four 16-bit uniform numbers, each of variance 1/12. */
double chip_adc_noise(chip_adc_t *adc)
{
    uint64_t r = next_random(&adc->rng);
    uint64_t sum = (r & 0xFFFFu) + ((r >> 16) & 0xFFFFu) + ((r >> 32) & 0xFFFFu) + (r >> 48);
    return ((double)sum * (1.0 / 65536.0) - 2.0) * 1.7320508075688772;
}

/* Voltage at the analogue input AN<input>. */
static double input_voltage(chip_t *chip, unsigned input)
{
    if (((CHIP_REG(chip, AD1PCFGL) >> input) & 1u) != 0) {
        return 0.0; /* a digital pin: the multiplexer is connected to ground */
    }
    return chip->board.input_v != NULL ? chip->board.input_v(chip->board.context, input) : 0.0;
}

static uint16_t format_result(unsigned form, unsigned code, unsigned bits)
{
    unsigned half = 1u << (bits - 1u);
    switch (form) {
    case 0: return (uint16_t)code;
    case 1: return (uint16_t)(code - half);
    case 2: return (uint16_t)(code << (16u - bits));
    default: return (uint16_t)((code << (16u - bits)) ^ 0x8000u);
    }
}

static uint16_t convert(chip_t *chip, unsigned input)
{
    chip_adc_t *adc = &chip->adc;
    unsigned bits = adc->twelve_bit ? 12u : 10u;
    double full = (double)(1u << bits);
    double lsb = input_voltage(chip, input) * (full / REFERENCE_V) * (1.0 + adc->gain_error) + adc->noise_lsb * chip_adc_noise(adc);
    double limited = plant_min(plant_max(floor(lsb + 0.5), 0.0), full - 1.0);
    if (input < 2) {
        adc->volts[input] = limited * (REFERENCE_V / full);
    }
    return format_result(adc->form, (unsigned)limited, bits);
}

/* Input that sample-and-hold `channel` (0..3) is connected to. */
static unsigned selected_input(const chip_t *chip, unsigned channel)
{
    if (channel == 0) {
        return CHIP_REG(chip, AD1CHS0) & 0x1Fu;
    }
    return channel - 1u + ((CHIP_REG(chip, AD1CHS123) & 1u) != 0 ? 3u : 0u);
}

static void warn_inputs(chip_t *chip)
{
    static const struct { unsigned port, bit; } pin[9] = {{0, 0}, {0, 1}, {1, 0}, {1, 1}, {1, 2}, {1, 3}, {2, 0}, {2, 1}, {2, 2}};
    static const uint16_t tris[3] = {SFR_TRISA, SFR_TRISB, SFR_TRISC};
    for (unsigned c = 0; c < chip->adc.channels; c++) {
        unsigned input = selected_input(chip, c);
        bool in_turn = ((chip->board.channel[c].others & ~(unsigned)CHIP_REG(chip, AD1PCFGL)) >> input & 1u) != 0;
        if (chip->board.channel[c].name != NULL && input != chip->board.channel[c].input && !in_turn) {
            chip_warn(chip, "%s: CH%u samples AN%u, %s is on AN%u", c == 0 ? "AD1CHS0" : "AD1CHS123", c, input, chip->board.channel[c].name,
                      chip->board.channel[c].input);
        }
        if (((CHIP_REG(chip, AD1PCFGL) >> input) & 1u) != 0) {
            chip_warn(chip, "AD1PCFGL: AN%u is sampled but configured as a digital pin, it reads 0 V", input);
        }
        if (input < 9 && ((chip_get(chip, tris[pin[input].port]) >> pin[input].bit) & 1u) == 0) {
            chip_warn(chip, "TRIS%c: AN%u is sampled but its pin is an output", 'A' + (int)pin[input].port, input);
        }
    }
}

static void warn_settings(chip_t *chip, unsigned con1, unsigned con2)
{
    unsigned ssrc = (con1 >> 5) & 7u;
    if (ssrc != SSRC_PWM) {
        chip_warn(chip, "AD1CON1: SSRC is %u, conversions do not follow the PWM's trigger (3)%s", ssrc,
                ssrc == SSRC_AUTO ? "" : " and this source is not modelled");
    }
    if (chip->adc.form != 3) {
        chip_warn(chip, "AD1CON1: FORM is %u, the results are not signed fractional numbers (3)", chip->adc.form);
    }
    if (chip->adc.twelve_bit) {
        chip_warn(chip, "AD1CON1: AD12B selects 12 bits, which one channel only can do");
    } else if (chip->adc.channels < 4) {
        chip_warn(chip, "AD1CON2: CHPS converts %u of the four channels", chip->adc.channels);
    }
    if ((con1 & SIMSAM) == 0 && chip->adc.channels > 1) {
        chip_warn(chip, "AD1CON1: SIMSAM is 0, each trigger samples one channel only");
    }
    if (chip->adc.sequence_length != 1) {
        chip_warn(chip, "AD1CON2: SMPI interrupts after every %u sequences", chip->adc.sequence_length);
    }
    if ((con2 & 0xE403u) != 0) {
        chip_warn(chip, "AD1CON2: VCFG, CSCNA, BUFM or ALTS is set (0x%04X), which is not modelled", con2);
    }
}

static void warn_timing(chip_t *chip)
{
    chip_adc_t *adc = &chip->adc;
    if (adc->tad_s < TAD_MIN_S - 1e-12) {
        chip_warn(chip, "AD1CON3: the conversion clock is %.1f ns, the converter needs %.0f ns", adc->tad_s * 1e9, TAD_MIN_S * 1e9);
    }
    double all_s = (double)adc->channels * adc->conversion_s;
    if (chip->pwm.running && all_s >= chip->pwm.period_s) {
        chip_warn(chip, "AD1CON3: %u conversions take %.1f us, longer than the PWM period of %.1f us", adc->channels, all_s * 1e6,
                chip->pwm.period_s * 1e6);
    }
}

/* A start-up may switch the PWM on first. */
static void check_on(chip_t *chip)
{
    chip_adc_t *adc = &chip->adc;
    adc->deaf_periods = chip->pwm.running && !adc->on ? adc->deaf_periods + 1u : 0u;
    if (adc->deaf_periods == DEAF_PATIENCE) {
        chip_warn(chip, "AD1CON1: the PWM runs but the ADC is off (ADON is 0), there are no samples and no ADC interrupts");
    }
}

/* Start of a period: follow the configuration; cheap when nothing changed. */
void chip_adc_begin(chip_t *chip)
{
    chip_adc_t *adc = &chip->adc;
    if (adc->withheld && adc->dropped == 0.0) {
        adc->withheld = false;
        (void)chip_irq_raise(chip, CHIP_IRQ_ADC1);
    }
    uint16_t con1 = (uint16_t)(CHIP_REG(chip, AD1CON1) & ~(unsigned)(SAMP | DONE));
    uint16_t now[7] = {con1, CHIP_REG(chip, AD1CON2), CHIP_REG(chip, AD1CON3), CHIP_REG(chip, AD1CHS0),
                       CHIP_REG(chip, AD1CHS123), CHIP_REG(chip, AD1PCFGL), CHIP_REG(chip, PMD1)};
    if (memcmp(now, adc->seen, sizeof now) == 0) {
        if (adc->judge_in != 0 && --adc->judge_in == 0) {
            warn_inputs(chip);
        }
        return;
    }
    memcpy(adc->seen, now, sizeof now);
    adc->on = (con1 & ADON) != 0 && (CHIP_REG(chip, PMD1) & AD1MD) == 0;
    adc->twelve_bit = (con1 & AD12B) != 0;
    adc->form = (con1 >> 8) & 3u;
    unsigned chps = (CHIP_REG(chip, AD1CON2) >> 8) & 3u;
    adc->channels = adc->twelve_bit || chps == 0 ? 1u : chps == 1 ? 2u : 4u;
    adc->sequence_length = ((CHIP_REG(chip, AD1CON2) >> 2) & 0xFu) + 1u;
    unsigned con3 = CHIP_REG(chip, AD1CON3);
    adc->tad_s = (con3 & 0x8000u) != 0 ? RC_TAD_S : (double)((con3 & 0xFFu) + 1u) / chip->clock.fcy_hz;
    adc->conversion_s = (adc->twelve_bit ? 14.0 : TAD_PER_CONVERSION) * adc->tad_s;
    if (adc->on) {
        warn_settings(chip, con1, CHIP_REG(chip, AD1CON2));
        adc->judge_in = INPUT_PATIENCE;
        warn_timing(chip);
    }
}

void chip_adc_reset(chip_t *chip)
{
    chip_adc_t *adc = &chip->adc;
    memset(adc->seen, 0xA5, sizeof adc->seen);
    adc->judge_in = 0;
    adc->conversion_end_s = 0.0;
    adc->due_s = PLANT_NEVER;
    adc->queued = false;
    adc->withheld = false;
    adc->turn = 0;
    adc->sequence = 0;
    adc->fill = 0;
}

/* Hand a sequence's results to the buffers. True if it was the last of SMPI+1 sequences. */
static bool fill_buffers(chip_t *chip)
{
    chip_adc_t *adc = &chip->adc;
    for (unsigned n = 0; n < adc->result_count; n++) {
        chip_put(chip, SFR_ADC1BUF0 + 2u * (adc->fill & 15u), adc->result[n]);
        adc->fill++;
    }
    if (++adc->sequence < adc->sequence_length) {
        return false;
    }
    adc->sequence = 0;
    adc->fill = 0;
    return true;
}

/* Whether it is the next one's turn where a share of all has to be hit, evenly spread. */
static bool hit(double share, double *debt)
{
    *debt = share > 0.0 ? *debt + share : 0.0;
    if (*debt < 1.0 - 1e-9) {
        return false;
    }
    *debt -= 1.0;
    return true;
}

/* A conversion has begun whose results are due at its end, or later where something holds the interrupt up. */
static void deliver(chip_t *chip, const uint16_t *result, unsigned count)
{
    chip_adc_t *adc = &chip->adc;
    bool interrupts = adc->sequence + 1u >= adc->sequence_length;
    memcpy(adc->result, result, count * sizeof *result);
    adc->result_count = count;
    double hold_us = adc->hold_us + (interrupts && hit(adc->late_share, &adc->late_debt) ? adc->late_us : 0.0);
    double held_s = interrupts ? plant_max(0.0, hold_us - chip->cpu.own_isr_us) * 1e-6 : 0.0;
    adc->due_s = plant_max(adc->conversion_end_s, chip->plant->now_s) + held_s;
    CHIP_REG(chip, AD1CON1) = (uint16_t)(CHIP_REG(chip, AD1CON1) & ~(unsigned)DONE);
}

/* True if the sample-and-holds are tracking their inputs, as ASAM = 1 or a set SAMP bit arranges. */
static bool is_sampling(chip_t *chip)
{
    if ((CHIP_REG(chip, AD1CON1) & (ASAM | SAMP)) != 0) {
        return true;
    }
    chip_warn(chip, "AD1CON1: a trigger came while neither ASAM nor SAMP was set, nothing is converted");
    return false;
}

/* The trigger: hold the inputs, convert them. */
void chip_adc_trigger(chip_t *chip)
{
    chip_adc_t *adc = &chip->adc;
    if (!adc->on || !is_sampling(chip)) {
        return;
    }
    if (chip->plant->now_s < adc->conversion_end_s) {
        chip_warn(chip, "AD1CON3: a trigger came during a conversion and is lost, the conversions are too slow for the PWM");
        return;
    }
    CHIP_REG(chip, AD1CON1) = (uint16_t)(CHIP_REG(chip, AD1CON1) & ~(unsigned)SAMP);
    if (chip->board.sampled != NULL) {
        chip->board.sampled(chip->board.context);
    }
    adc->samples += 1.0;
    uint16_t result[4];
    unsigned count = 0;
    if ((CHIP_REG(chip, AD1CON1) & SIMSAM) != 0) {
        for (unsigned c = 0; c < adc->channels; c++) {
            result[count++] = convert(chip, selected_input(chip, c));
        }
    } else {
        result[count++] = convert(chip, selected_input(chip, adc->turn));
        adc->turn = (adc->turn + 1u) % adc->channels;
    }
    adc->conversion_end_s = chip->plant->now_s + (double)count * adc->conversion_s;
    if (adc->due_s < PLANT_NEVER) {
        memcpy(adc->queued_result, result, sizeof result);
        adc->queued_count = count;
        adc->overruns += 1.0;
        adc->queued = true;
        chip_warn(chip, "IFS0: AD1IF is set again before the handler has finished (cpu.isr_us), samples are lost");
    } else {
        deliver(chip, result, count);
    }
}

/* The end of a conversion that interrupts. */
static void interrupt(chip_t *chip)
{
    bool to_come = false;
    if ((CHIP_REG(chip, IFS0) & AD1IF) != 0 && chip->nvm.standing_s <= 0.0) {
        chip->adc.overruns += 1.0;
        chip_warn(chip, "IFS0: AD1IF is still set when the next conversion ends, the handler was late or never came");
    }
    if (hit(chip->adc.lost_share, &chip->adc.lost_debt)) {
        chip->adc.lost += 1.0;
    } else if (chip->adc.dropped == 0.0) {
        to_come = chip_irq_raise(chip, CHIP_IRQ_ADC1);
    } else {
        chip->adc.withheld = true;
    }
    if (!to_come && chip->board.served != NULL) {
        chip->board.served(chip->board.context);
    }
}

/* The instant at which results become visible. */
void chip_adc_done(chip_t *chip)
{
    chip_adc_t *adc = &chip->adc;
    adc->due_s = PLANT_NEVER;
    CHIP_REG(chip, AD1CON1) = (uint16_t)(CHIP_REG(chip, AD1CON1) | DONE);
    if (fill_buffers(chip)) {
        interrupt(chip);
    } else if (chip->board.served != NULL) {
        chip->board.served(chip->board.context);
    }
    if (adc->queued) {
        adc->queued = false;
        deliver(chip, adc->queued_result, adc->queued_count);
    }
}

/* Time of the next trigger in this period that lies after `after_s`. */
double chip_adc_next_trigger(const chip_t *chip, double after_s)
{
    const chip_adc_t *adc = &chip->adc;
    unsigned ssrc = (CHIP_REG(chip, AD1CON1) >> 5) & 7u;
    if (!adc->on) {
        return PLANT_NEVER;
    }
    if (ssrc == SSRC_PWM) {
        return chip->pwm.trigger_s > after_s ? chip->pwm.trigger_s : PLANT_NEVER;
    }
    if (ssrc == SSRC_AUTO) {
        double sample_s = plant_max(1.0, (double)((CHIP_REG(chip, AD1CON3) >> 8) & 0x1Fu)) * adc->tad_s;
        return plant_max(plant_max(adc->conversion_end_s, 0.0) + sample_s, after_s);
    }
    return PLANT_NEVER;
}

void chip_adc_end(chip_t *chip)
{
    chip_adc_t *adc = &chip->adc;
    double period_s = chip->plant->now_s;
    check_on(chip);
    adc->conversion_end_s = plant_max(adc->conversion_end_s - period_s, -1.0);
    if (adc->due_s < PLANT_NEVER) {
        adc->due_s -= period_s;
    }
}
