/* The interrupts: the control interrupt that is one PWM period, the slow work's behind it, the fault input, and the traps. */
#include "board/firmware.h"
#include "board/application.h"
#include "board/scope.h"
#include "board/mclv.h"
#include "board/peripherals.h"
#include "board/status.h"
#include "board/reset.h"
#include "board/watch.h"
#include "drive/limits.h"
#include "drive/param_init.h"
#include "drive/tick.h"

/* Defined here so that the compiler folds each constant into the interrupt's instructions; PARAMS_IN_RAM gives that up. */
MODE_PARAMS_PLACE drive_params_t board_params = DRIVE_PARAMS_INIT;

volatile uint16_t board_clock_failed BOARD_UNSET;

chopper_t board_chopper;

/* From the control interrupt to the slow work, which says so: there the fault takes no time from the next duties. */
static uint16_t board_is_late;

void BOARD_ISR_SHADOW _ADC1Interrupt(void);
void BOARD_ISR _T2Interrupt(void);
void BOARD_ISR _FLTA1Interrupt(void);
void BOARD_ISR _OscillatorFail(void);
void BOARD_ISR _DefaultInterrupt(void);
void BOARD_ISR _AddressError(void) __attribute__((alias("_DefaultInterrupt")));
void BOARD_ISR _StackError(void) __attribute__((alias("_DefaultInterrupt")));
void BOARD_ISR _MathError(void) __attribute__((alias("_DefaultInterrupt")));

/* ---- the duties' way to the PWM: at once, or, where they are deferred, at the begin of the next period ---- */

/** The duties load when the counter reaches zero. @return 1 once it counts up: too late */
QM_INLINE uint16_t duties_write(const duties_t *duty)
{
    P1DC1 = duty->a;
    P1DC2 = duty->b;
    P1DC3 = duty->c;
    return (uint16_t)((P1TMR & 0x8000u) == 0u);
}

/** Before the law: those that have waited. @return 1 too late */
QM_INLINE uint16_t duties_write_waiting(const duties_t *duty)
{
    return (uint16_t)(DEFER_DUTIES ? duties_write(duty) : 0u);
}

/** After the law: those that do not wait. @return 1 too late */
QM_INLINE uint16_t duties_write_now(const duties_t *duty)
{
    return (uint16_t)(DEFER_DUTIES ? 0u : duties_write(duty));
}

/** 1 where the duties are the law's. Deferred ones come a period after it has begun: until then they are 0, as with the bridge off. */
QM_INLINE uint16_t duties_are_the_laws(void)
{
    return (uint16_t)(!DEFER_DUTIES || (P1DC1 | P1DC2 | P1DC3) != 0u);
}

/** Where the bridge does not switch. */
QM_INLINE void board_set_idle_outputs(uint16_t outputs)
{
    uint16_t override = BOARD_OUTPUTS_OFF;
    if (outputs == (uint16_t)OUTPUTS_BOOTSTRAP) {
        override = BOARD_OUTPUTS_BOOTSTRAP;
    }
    P1OVDCON = override;
}

/** 1 in the periods with the bridge switching that slow work follows: scope and SNAPSHOT look at each. */
QM_INLINE uint16_t board_slow_is_due(void)
{
    return (uint16_t)(MODE_SEES_EVERY_PERIOD || drive_slow_follows(&board_drive));
}

#define BOARD_TRAP_FLAGS 0x001Cu /* ADDRERR, STKERR, MATHERR */

/* A sample that comes before the interrupt is through, and the slow work of the period before, if that is not done. */
#define BOARD_LATE_FLAGS 0x2080u /* AD1IF, T2IF */

static duties_t board_waiting; /* deferred, for the next period's begin */

/** The bridge is off at once; the slow work says why. */
QM_INLINE void board_overrun(void)
{
    board_is_late = 1;
    P1OVDCON = BOARD_OUTPUTS_OFF;
    IFS0bits.T2IF = 1;
}

/** The duties that do not wait, and whether they are in time. */
QM_INLINE void board_write(const duties_t *duty)
{
    if (duties_write_now(duty) || (IFS0 & BOARD_LATE_FLAGS) != 0u) {
        board_overrun();
    }
}

/** The end of a period whose bridge does not switch; deferred, the zeros wait. Called, for its way to write them is not that of the law's. */
static NOINLINE void board_idle(void)
{
    const duties_t off = { 0, 0, 0 };
    board_write(&off);
    if (board_drive.fault != (uint16_t)FAULT_NONE) {
        P1OVDCON = BOARD_OUTPUTS_OFF;
    }
    IFS0bits.T2IF = 1;
}

/** The control interrupt, triggered every period by PWM1 through the ADC: from the samples to the duties. */
void BOARD_ISR_SHADOW _ADC1Interrupt(void)
{
    drive_samples_t raw;
    duties_t now, *duty = DEFER_DUTIES ? &board_waiting : &now;
    IFS0bits.AD1IF = 0;
    if (duties_write_waiting(duty)) {
        board_overrun();
    }
    raw.i_a = (int16_t)ADC1BUF1;
    raw.i_b = (int16_t)ADC1BUF2;
    if (drive_tick(&board_drive, &board_params, &raw, duty)) {
        board_write(duty);
        if (board_slow_is_due()) {
            IFS0bits.T2IF = 1;
        }
    } else {
        board_idle();
    }
}

/** What a product has beside the LEDs: relays and the brake resistor. The one place that writes their pins after the start, also in a fault and where the
 *  background stands. @param v_bus_raw the converter's result */
QM_INLINE void board_signals(int16_t v_bus_raw)
{
    if (CHOPPER_USED) {
        BOARD_SIGNAL(CHOPPER, bus_chopper(&board_chopper, bus_sample(v_bus_raw), board_drive.ticks));
    }
    if (RUNNING_OUTPUT_USED) {
        BOARD_SIGNAL(RUNNING_OUTPUT, drive_outputs(&board_drive));
    }
    if (FAULT_OUTPUT_USED) {
        BOARD_SIGNAL(FAULT_OUTPUT, board_drive.fault);
    }
}

/** What has no deadline but the next period's begin, every second period, and with the bridge off each. The control interrupt raises it and may
 *  interrupt it; timer 2 stands still, only its vector is used. */
void BOARD_ISR _T2Interrupt(void)
{
    drive_samples_t raw;
    if (board_is_late) {
        board_is_late = 0;
        drive_raise_at_once(&board_drive, FAULT_ISR_OVERRUN);
    }
    raw.i_a = (int16_t)ADC1BUF1;
    raw.i_b = (int16_t)ADC1BUF2;
    raw.v_bus = (int16_t)ADC1BUF3;
    if (!HEAT_USED) { /* else CH0 has others, too: firmware_turn_input() */
        board_pot.now_q15 = (int16_t)ADC1BUF0;
    }
    if (drive_slow(&board_drive, &board_params, &raw)) {
        if (duties_are_the_laws()) {
            P1OVDCON = BOARD_OUTPUTS_PWM;
        }
    } else {
        uint16_t outputs = drive_outputs(&board_drive);
        if (outputs != (uint16_t)OUTPUTS_PWM) { /* the bridge begins to switch when its first duties are written */
            board_set_idle_outputs(outputs);
        }
    }
    if (drive_latch_fault(&board_drive)) { /* also where a trap came between the two lines before */
        pwm_outputs_off();
        recorder_in_fault(&board_recorder, &board_drive);
    }
    board_signals(raw.v_bus);
    if (recorder_is_due(&board_drive)) { /* the samples once more: kept, they would take registers from the slow work */
        recorder_write(&board_recorder, &board_drive, (int16_t)ADC1BUF1, (int16_t)ADC1BUF2, (int16_t)ADC1BUF3);
    }
    mode_record();
    application_watch();
#if SCOPE
    scope_tick(&board_lnet.scope, board_scope_array);
#endif
    IFS0bits.T2IF = 0;   /* last: as long as it is set the work is not done */
    if (board_is_late) { /* a control interrupt meanwhile: its flag is gone with the own one */
        IFS0bits.T2IF = 1;
    }
}

/** The board's comparator: the PWM module has already switched the outputs off. */
void BOARD_ISR _FLTA1Interrupt(void)
{
    firmware_trip(FAULT_OVERCURRENT_HW);
    IFS3bits.FLTA1IF = 0;
}

/** A trap: outputs off, the cause kept. The background goes on to say so; if it cannot, the watchdog's reset follows. */
static void board_trap(drive_fault_t fault)
{
    pwm_outputs_off();
    board_trap_intcon1 = INTCON1;
    drive_raise_at_once(&board_drive, fault);
    reset_keep((uint16_t)fault);
}

void BOARD_ISR _OscillatorFail(void)
{
    board_clock_failed = 1;
    board_trap(FAULT_CLOCK);
    INTCON1bits.OSCFAIL = 0;
}

/* The others are one handler: which of them it was is in board_trap_intcon1. */
void BOARD_ISR _DefaultInterrupt(void)
{
    board_trap(FAULT_TRAP);
    INTCON1 &= (uint16_t)~BOARD_TRAP_FLAGS;
}
