/* Processor 1: the firmware that is linked with this library, whose handlers take no time. */
#include "chip.h"
#include "probe.h"
#include "vb_cpu.h"

#include <stdlib.h>
#include <xc.h>

void firmware_init(void);
void firmware_background(void);

/* X(interrupt, its handler, its flag without IF). A firmware need not have all of the handlers. */
#define HANDLERS(X) \
    X(CHIP_IRQ_ADC1, _ADC1Interrupt, AD1) X(CHIP_IRQ_FLTA1, _FLTA1Interrupt, FLTA1) X(CHIP_IRQ_PWM1, _MPWM1Interrupt, PWM1) \
    X(CHIP_IRQ_T1, _T1Interrupt, T1) X(CHIP_IRQ_T2, _T2Interrupt, T2) X(CHIP_IRQ_T3, _T3Interrupt, T3) \
    X(CHIP_IRQ_U1RX, _U1RXInterrupt, U1RX) X(CHIP_IRQ_U1TX, _U1TXInterrupt, U1TX)
#define DECLARE_WEAK(irq, handler, flag) extern void handler(void) __attribute__((weak));
HANDLERS(DECLARE_WEAK)

/* Registers whose writes mean more than storing. Nothing tells of a write here: after each piece of firmware they are looked through. */
static const uint16_t watched[] = {
    SFR_TMR1, SFR_PR1, SFR_T1CON, SFR_TMR2, SFR_PR2, SFR_T2CON, SFR_TMR3, SFR_PR3, SFR_T3CON,
    SFR_IC1CON, SFR_IC2CON, SFR_IC7CON, SFR_IC8CON, SFR_U1MODE, SFR_U1STA, SFR_PORTA, SFR_PORTB, SFR_PORTC,
};
enum { WATCHED = (int)(sizeof watched / sizeof watched[0]) };

typedef struct {
    vb_t *vb;
    chip_t *chip;
    double start_s, background_countdown;
    volatile uint16_t *place[WATCHED];
    uint16_t before[WATCHED];
    bool offered; /* a received character stands in U1RXREG */
    unsigned offered_captures; /* by input: one stands in ICxBUF */
    bool stuck;   /* a handler leaves its flag set: the main loop stands still */
} host_t;

/* ---- accesses ---- */

/* What the firmware would read now. */
static void show_registers(host_t *h)
{
    chip_t *chip = h->chip;
    chip_pwm_show_counter(chip);
    for (unsigned n = 0; n < CHIP_TIMERS; n++) {
        if (chip->timer[n].counts) {
            (void)chip_read(chip, n == 0 ? SFR_TMR1 : n == 1 ? SFR_TMR2 : SFR_TMR3);
        }
    }
    h->offered = chip->uart.rx_count > 0;
    if (h->offered) {
        U1RXREG = chip->uart.rx[0];
    }
    h->offered_captures = chip_capture_show(chip);
    for (unsigned n = 0; n < WATCHED; n++) {
        h->before[n] = *h->place[n];
    }
}

/* What the firmware has written. A character that was offered counts as read where the handler or the main loop had the chance, and so does a capture. */
static void follow_writes(host_t *h, bool reads_receiver, bool reads_captures)
{
    chip_t *chip = h->chip;
    for (unsigned n = 0; n < WATCHED; n++) {
        uint16_t now = *h->place[n];
        if (now != h->before[n]) {
            *h->place[n] = h->before[n];
            if (chip_capture_is_control(watched[n])) {
                chip_write(chip, watched[n], 0, 0xFFFF); /* off and on again: nothing else clears ICBNE */
            }
            chip_write(chip, watched[n], now, 0xFFFF);
        }
    }
    if (h->offered && reads_receiver) {
        (void)chip_read(chip, SFR_U1RXREG);
        h->offered = false;
    }
    for (unsigned n = 0; reads_captures && n < CHIP_CAPTURES; n++) {
        if ((h->offered_captures >> n & 1u) != 0) {
            chip_capture_drop(chip, n);
        }
    }
    uint16_t sent = U1TXREG;
    if (sent != HOST_U1TXREG_EMPTY) {
        chip_write(chip, SFR_U1TXREG, sent, 0xFFFF);
        U1TXREG = HOST_U1TXREG_EMPTY;
    }
    chip_pwm_written(chip);
}

/* ---- interrupts ---- */

typedef struct {
    unsigned irq;
    void (*run)(void);
    const char *name, *flag, *enable;
} handler_t;

static const handler_t *handler_of(unsigned irq)
{
#define HANDLER_ROW(irq, handler, flag) {irq, handler, #handler, #flag "IF", #flag "IE"},
    static const handler_t handlers[] = {HANDLERS(HANDLER_ROW)};
    for (size_t n = 0; n < sizeof handlers / sizeof handlers[0]; n++) {
        if (handlers[n].irq == irq) {
            return &handlers[n];
        }
    }
    return NULL;
}

static unsigned word_of(unsigned first, unsigned irq)
{
    return first + 2u * (irq / 16u);
}

static void serve(host_t *h, unsigned irq)
{
    const handler_t *handler = handler_of(irq);
    if (handler == NULL || handler->run == NULL) {
        chip_warn(h->chip, "IEC%u: %s is set but the firmware has no %s", irq / 16u, handler != NULL ? handler->enable : "an enable bit",
                  handler != NULL ? handler->name : "handler for it");
        return;
    }
    show_registers(h);
    handler->run();
    if ((chip_get(h->chip, word_of(SFR_IFS0, irq)) >> irq % 16u & 1u) != 0) {
        chip_warn(h->chip, "IFS%u: %s leaves %s set, the interrupt repeats for ever and the main loop stands still", irq / 16u,
                  handler->name, handler->flag);
        h->stuck = true;
    }
    follow_writes(h, irq == CHIP_IRQ_U1RX, false);
}

static unsigned level(void)
{
    return ((unsigned)SR >> 5) & 7u;
}

/* Flags that were set by software, or while their interrupt was disabled or masked: each once. */
static void serve_pending(host_t *h)
{
    if ((IFS0 & IEC0) == 0 && (IFS3 & IEC3) == 0) {
        return;
    }
    uint16_t ifs[CHIP_IRQ_WORDS] = {IFS0, IFS1, 0, IFS3, IFS4}, ipc[4 * CHIP_IRQ_WORDS];
    const uint16_t iec[CHIP_IRQ_WORDS] = {IEC0, IEC1, 0, IEC3, IEC4};
    for (unsigned n = 0; n < 4 * CHIP_IRQ_WORDS; n++) {
        ipc[n] = chip_get(h->chip, SFR_IPC0 + 2u * n);
    }
    for (chip_irq_t next = chip_irq_pending(ifs, iec, ipc); next.priority > level(); next = chip_irq_pending(ifs, iec, ipc)) {
        ifs[next.number / 16u] = (uint16_t)(ifs[next.number / 16u] & ~(1u << next.number % 16u));
        serve(h, next.number);
    }
}

/* The handler runs at once, if it may, and after it what it has raised. */
static bool host_raised(void *context, unsigned irq)
{
    host_t *h = context;
    unsigned priority = (unsigned)chip_get(h->chip, SFR_IPC0 + 2u * (irq / 4u)) >> 4u * (irq % 4u) & 7u;
    bool enabled = (chip_get(h->chip, word_of(SFR_IEC0, irq)) >> irq % 16u & 1u) != 0;
    if (!enabled) {
        if (irq == CHIP_IRQ_ADC1) {
            chip_warn(h->chip, "IEC0: AD1IE is 0, conversions end but _ADC1Interrupt never runs");
        }
    } else if (priority <= level()) {
        const handler_t *handler = handler_of(irq);
        chip_warn(h->chip, "IPC%u: priority %u of %s is not above the CPU's level %u (SR), the interrupt waits", irq / 4u, priority,
                  handler != NULL ? handler->name : "an interrupt", level());
    } else {
        serve(h, irq);
        if (!h->stuck) {
            serve_pending(h);
        }
    }
    return false;
}

static void host_begin(void *context)
{
    serve_pending(context);
}

/* ---- the rest of what the chip asks of its processor ---- */

static volatile uint16_t *host_reg(void *context, const char *name)
{
    (void)context;
    return host_sfr_find(name);
}

/* The present instant in cycles of the present clock. */
static uint64_t host_cycles(void *context)
{
    const host_t *h = context;
    const chip_clock_t *c = &h->chip->clock;
    double cycles = (h->chip->plant->start_s + h->chip->plant->now_s - h->start_s - c->base_s) * c->fcy_hz;
    return c->base_cycle + (cycles > 0.0 ? (uint64_t)(cycles + 0.5) : 0u);
}

static int host_reset(void *context)
{
    host_t *h = context;
    h->start_s = h->chip->plant->start_s;
    h->chip->plant->now_s = 0.0;
    h->chip->clock.base_s = 0.0;
    h->background_countdown = 0.0;
    h->stuck = false;
    chip_reset(h->chip, CHIP_RESET_POR);
    host_registers_reset();
    probe_power_up();
    show_registers(h);
    firmware_init();
    follow_writes(h, false, false);
    return 0;
}

static void host_end(void *context, double length_s)
{
    host_t *h = context;
    (void)length_s;
    if (h->stuck) {
        return;
    }
    h->background_countdown -= 1.0;
    if (h->background_countdown <= 0.0 || h->chip->uart.rx_count > 0) { /* a character waits for one pass at most, as on the chip */
        h->background_countdown = vb_background_periods(h->vb);
        show_registers(h);
        firmware_background();
        follow_writes(h, true, true);
    }
}

static void host_destroy(void *context)
{
    free(context);
}

vb_t *vb_create(void)
{
    host_t *h = calloc(1, sizeof *h);
    if (h == NULL) {
        return NULL;
    }
    const chip_cpu_t cpu = {.context = h, .reg = host_reg, .reset = host_reset, .cycles = host_cycles, .raised = host_raised,
                            .begin = host_begin, .end = host_end, .destroy = host_destroy};
    h->vb = vb_create_with_cpu(&cpu);
    if (h->vb == NULL) {
        free(h);
        return NULL;
    }
    h->chip = vb_chip(h->vb);
    for (unsigned n = 0; n < WATCHED; n++) {
        h->place[n] = h->chip->place[watched[n] / 2u];
    }
    h->chip->adc.hold_us = probe_isr_us;
    h->chip->config[CHIP_FOSCSEL] = 3; /* the crystal with the PLL, as xc.h's OSCCON has it */
    h->chip->config[CHIP_FWDT] = 0;    /* no watchdog on a PC: time stands still while the firmware runs */
    return h->vb;
}
