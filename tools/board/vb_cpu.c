/* Interrupts and the main loop: when a handler runs, and the CPU that is the firmware linked with this library. */
#include "vb_internal.h"

#include <xc.h>

void firmware_init(void);
void firmware_background(void);

/* A firmware need not have all of these. */
extern void _FLTA1Interrupt(void) __attribute__((weak));
extern void _MPWM1Interrupt(void) __attribute__((weak));
extern void _T1Interrupt(void) __attribute__((weak));
extern void _T2Interrupt(void) __attribute__((weak));
extern void _T3Interrupt(void) __attribute__((weak));
extern void _U1RXInterrupt(void) __attribute__((weak));
extern void _U1TXInterrupt(void) __attribute__((weak));

static volatile uint16_t *host_reg(void *context, const char *name)
{
    (void)context;
    return host_sfr_find(name);
}

static int host_reset(void *context)
{
    (void)context;
    host_registers_reset();
    firmware_init();
    return 0;
}

static int host_interrupt(void *context, vb_vector_t vector)
{
    static void (*const handler[VB_VECTOR_COUNT])(void) = {
        [VB_VECTOR_ADC1] = _ADC1Interrupt, [VB_VECTOR_FLTA1] = _FLTA1Interrupt, [VB_VECTOR_PWM1] = _MPWM1Interrupt,
        [VB_VECTOR_T1] = _T1Interrupt,     [VB_VECTOR_T2] = _T2Interrupt,       [VB_VECTOR_T3] = _T3Interrupt,
        [VB_VECTOR_U1RX] = _U1RXInterrupt, [VB_VECTOR_U1TX] = _U1TXInterrupt,
    };
    (void)context;
    if (handler[vector] == NULL) {
        return 0;
    }
    handler[vector]();
    return 1;
}

static void host_background(void *context)
{
    (void)context;
    firmware_background();
}

const vb_cpu_t vb_host_cpu = {NULL, host_reg, host_reset, host_interrupt, host_background};

typedef struct {
    const char *handler, *flag_register, *flag, *enable_register, *enable, *priority_register;
    unsigned bit, shift;
} vector_info_t;

static const vector_info_t info[VB_VECTOR_COUNT] = {
    [VB_VECTOR_ADC1] = {"_ADC1Interrupt", "IFS0", "AD1IF", "IEC0", "AD1IE", "IPC3", 13, 4},
    [VB_VECTOR_FLTA1] = {"_FLTA1Interrupt", "IFS3", "FLTA1IF", "IEC3", "FLTA1IE", "IPC15", 15, 12},
    [VB_VECTOR_PWM1] = {"_MPWM1Interrupt", "IFS3", "PWM1IF", "IEC3", "PWM1IE", "IPC14", 9, 4},
    [VB_VECTOR_T1] = {"_T1Interrupt", "IFS0", "T1IF", "IEC0", "T1IE", "IPC0", 3, 12},
    [VB_VECTOR_T2] = {"_T2Interrupt", "IFS0", "T2IF", "IEC0", "T2IE", "IPC1", 7, 12},
    [VB_VECTOR_T3] = {"_T3Interrupt", "IFS0", "T3IF", "IEC0", "T3IE", "IPC2", 8, 0},
    [VB_VECTOR_U1RX] = {"_U1RXInterrupt", "IFS0", "U1RXIF", "IEC0", "U1RXIE", "IPC2", 11, 12},
    [VB_VECTOR_U1TX] = {"_U1TXInterrupt", "IFS0", "U1TXIF", "IEC0", "U1TXIE", "IPC3", 12, 0},
};

static volatile uint16_t *flags_of(const vb_t *vb, vb_vector_t vector)
{
    return vector == VB_VECTOR_FLTA1 || vector == VB_VECTOR_PWM1 ? vb->reg.ifs3 : vb->reg.ifs0;
}

static uint16_t enables_of(const vb_t *vb, vb_vector_t vector)
{
    return vector == VB_VECTOR_FLTA1 || vector == VB_VECTOR_PWM1 ? *vb->reg.iec3 : *vb->reg.iec0;
}

static unsigned priority_of(const vb_t *vb, vb_vector_t vector)
{
    const volatile uint16_t *reg[VB_VECTOR_COUNT] = {
        [VB_VECTOR_ADC1] = vb->reg.ipc3, [VB_VECTOR_FLTA1] = vb->reg.ipc15, [VB_VECTOR_PWM1] = vb->reg.ipc14,
        [VB_VECTOR_T1] = vb->reg.ipc0,   [VB_VECTOR_T2] = vb->reg.ipc1,     [VB_VECTOR_T3] = vb->reg.ipc2,
        [VB_VECTOR_U1RX] = vb->reg.ipc2, [VB_VECTOR_U1TX] = vb->reg.ipc3,
    };
    return ((unsigned)*reg[vector] >> info[vector].shift) & 7u;
}

/* What the firmware's writes mean at once: characters to send, overrides, immediate duties. */
static void cpu_ran(vb_t *vb)
{
    vb_io_uart_take(vb);
    vb_pwm_registers_changed(vb);
}

/* Run a handler whose flag is set and that is allowed to run. */
void vb_handler(vb_t *vb, vb_vector_t vector)
{
    const vector_info_t *v = &info[vector];
    vb_pwm_show_counter(vb);
    if (vb->cpu.interrupt(vb->cpu.context, vector) == 0) {
        vb_warn(vb, "%s: %s is set but the firmware has no %s", v->enable_register, v->enable, v->handler);
        return;
    }
    if (((*flags_of(vb, vector) >> v->bit) & 1u) != 0) {
        vb_warn(vb, "%s: %s leaves %s set, the interrupt repeats for ever and the main loop stands still", v->flag_register, v->handler,
                v->flag);
        vb->stuck_in_isr = true;
    }
    cpu_ran(vb);
}

/* Set an interrupt flag and serve it if it is enabled and its priority is above the CPU's. True if the handler ran, or if the CPU
 * decides by itself when to run it. */
bool vb_raise(vb_t *vb, vb_vector_t vector)
{
    const vector_info_t *v = &info[vector];
    volatile uint16_t *flags = flags_of(vb, vector);
    *flags = (uint16_t)(*flags | (1u << v->bit));
    if (vb->live != NULL) {
        vb->live->raised(vb->cpu.context, vector);
        return true;
    }
    if (((enables_of(vb, vector) >> v->bit) & 1u) == 0) {
        if (vector == VB_VECTOR_ADC1) {
            vb_warn(vb, "%s: %s is 0, conversions end but %s never runs", v->enable_register, v->enable, v->handler);
        }
        return false;
    }
    unsigned priority = priority_of(vb, vector);
    unsigned cpu_level = ((unsigned)*vb->reg.sr >> 5) & 7u;
    if (priority <= cpu_level) {
        vb_warn(vb, "%s: priority %u of %s is not above the CPU's level %u (SR), the interrupt waits", v->priority_register, priority,
                v->handler, cpu_level);
        return false;
    }
    vb_handler(vb, vector);
    return true;
}

/* Serve flags that were set while their interrupt was disabled or masked, or that software set. */
void vb_serve_pending(vb_t *vb)
{
    if ((*vb->reg.ifs0 & *vb->reg.iec0) == 0 && (*vb->reg.ifs3 & *vb->reg.iec3) == 0) {
        return;
    }
    for (unsigned n = 0; n < VB_VECTOR_COUNT; n++) {
        vb_vector_t vector = (vb_vector_t)n;
        unsigned pending = *flags_of(vb, vector) & enables_of(vb, vector);
        bool dropped = vector == VB_VECTOR_ADC1 && vb->isr_dropped != 0.0;
        unsigned cpu_level = ((unsigned)*vb->reg.sr >> 5) & 7u;
        if (((pending >> info[n].bit) & 1u) != 0 && !dropped && priority_of(vb, vector) > cpu_level) {
            vb_handler(vb, vector);
        }
    }
}

void vb_background(vb_t *vb)
{
    if (vb->stuck_in_isr) {
        return;
    }
    vb_pwm_show_counter(vb);
    vb->cpu.background(vb->cpu.context);
    cpu_ran(vb);
}
