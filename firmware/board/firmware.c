/* Start-up order and the background loop: panel, supervision of the control interrupt, watch variables, status line. */
#include "board/firmware.h"

#include "board/application.h"
#include "board/kept.h"
#include "board/mclv.h"
#include "board/modes/mode_board.h"
#include "board/peripherals.h"
#include "board/status.h"
#include "board/reset.h"
#include "board/selftest_run.h"
#include "board/watch.h"
#include "drive/protection.h"
#include "drive/signals.h"

#define PERIODS_PER_MS PARAM_PERIODS(0.001F)
#define COUNT_MS 100u
#define LEAST_TICKS PARAM_PERIODS(0.097F) /* of a tenth of a second: 3 % less */

/** What the background's checks remember of the drive. */
typedef struct {
    signals_t signals;
    overload_t overload;
    uint16_t supervised_tick;          /* drive ticks at the last check */
    uint16_t was_silent;               /* a timer 1 millisecond without a control interrupt */
    uint16_t counted_tick, counted_ms; /* drive ticks at the beginning of the count, and timer 1 milliseconds since */
} judged_t;

drive_t board_drive BOARD_UNSET;
request_t board_request BOARD_UNSET;
retry_t board_retry BOARD_UNSET;
#if SCOPE
remote_t scope_command; /* cleared: remote_init() leaves what the client has not written */
#endif

#if HEAT_USED
uint16_t board_ch0 BOARD_UNSET;
static uint16_t ch0_since BOARD_UNSET;  /* drive ticks when it was chosen */
static uint16_t ch0_bridge BOARD_UNSET; /* 1: after the potentiometer it is the bridge's turn */
#endif

static uint16_t last_ms_tick BOARD_UNSET; /* drive ticks already counted as milliseconds */
static judged_t judged BOARD_UNSET;

void firmware_trip(drive_fault_t fault)
{
    pwm_outputs_off();
    if (board_drive.fault == (uint16_t)FAULT_NONE) { /* the first one stays, and need not be raised again: it would be by code that may be damaged */
        drive_raise(&board_drive, fault);
    }
}

/** @param found drive_fault_t, none too */
static void firmware_find(uint16_t found)
{
    if (found != (uint16_t)FAULT_NONE) {
        firmware_trip((drive_fault_t)found);
    }
}

void firmware_init(void)
{
    drive_fault_t kept;
    pwm_outputs_off();
    kept = reset_take();
    record_init(kept);
    last_ms_tick = 0;
    drive_zero(&judged, sizeof judged);
    CORCON = 0x0024u; /* fractional, unsaturated: the control law's products do not depend on it; PSV on: tables are read from flash */
    INTCON1bits.NSTDIS = 0;
    kept_init();
    application_init();
    request_init(&board_request);
    mode_panel_init();
    retry_init(&board_retry);
#if SCOPE
    remote_init(&scope_command);
#endif
    drive_init(&board_drive, &board_params); /* before anything can trap */
    board_clock_failed = 0;
    if (clock_init()) { /* the trap may have said so before */
        board_clock_failed = 1;
    }
    selftest_start(kept);
    status_init();
    pins_init();
    app_pulse_init();
    uart_init();
    timer_init();
    pwm_init();
    firmware_find(board_clock_failed ? (uint16_t)FAULT_CLOCK : (uint16_t)kept);
    adc_init();
#if HEAT_USED
    ch0_bridge = 0;
    firmware_choose_input(BOARD_AD1CHS0);
#endif
    do { /* broken code: the background would end in the next reset, and the fault untold */
        ClrWdt();
    } while (RESET_WAS(IOPUWR, board_reset_cause) && board_selftest_failed);
}

#if HEAT_USED
#define CH0_SETTLES_TICKS 3u /* the second sample after the change is the new input's for sure */

void firmware_choose_input(uint16_t input)
{
    board_ch0 = input;
    ch0_since = board_drive.ticks;
    AD1CHS0 = input;
}

/** Takes the sample of CH0's input once it is its own, and turns to the next: the potentiometer every second time, the sensors between. Every
 *  millisecond, after selftest_ms() has held AD1CHS0 against what was chosen; while that looks at the converter itself it has the input. */
static void firmware_turn_input(void)
{
    const int16_t sample_q15 = (int16_t)ADC1BUF0;
    uint16_t next = BOARD_AD1CHS0;
    if (board_ch0 == BOARD_AN_OFF || (uint16_t)(board_drive.ticks - ch0_since) < CH0_SETTLES_TICKS) {
        return;
    }
    if (board_ch0 == BOARD_AD1CHS0) {
        board_pot.now_q15 = sample_q15;
        ch0_bridge ^= 1u;
        next = ch0_bridge ? BOARD_CH0_BRIDGE : BOARD_CH0_MOTOR;
#if MOTOR_NTC_USED
    } else if (board_ch0 == BOARD_CH0_MOTOR) {
        ntc_sample(&board_drive.heat.motor, &board_params.motor_ntc, sample_q15);
#endif
#if BRIDGE_NTC_USED
    } else {
        ntc_sample(&board_drive.heat.bridge, &board_params.bridge_ntc, sample_q15);
#endif
    }
    firmware_choose_input(next);
}
#else
#define firmware_turn_input() ((void)0)
#endif

/** Control interrupts are as many as the timer says. A background pass that takes longer than a millisecond loses one of the timer's, never of
 *  the interrupts': only too few are a fault. Every millisecond. */
static void firmware_count_interrupts(uint16_t ticks)
{
    if (++judged.counted_ms < COUNT_MS) {
        return;
    }
    if ((uint16_t)(ticks - judged.counted_tick) < LEAST_TICKS) {
        firmware_trip(FAULT_INTERRUPT_RATE);
    }
    judged.counted_tick = ticks;
    judged.counted_ms = 0;
}

/** A control interrupt that stays away for 2 ms leaves the bridge without control. */
static void firmware_watch_interrupt(void)
{
    uint16_t ticks = board_drive.ticks;
    if (!timer_ms_passed()) {
        return;
    }
    firmware_count_interrupts(ticks);
    if (ticks != judged.supervised_tick) {
        judged.supervised_tick = ticks;
        judged.was_silent = 0;
    } else if (judged.was_silent) {
        firmware_trip(FAULT_ADC_LOST);
    } else {
        judged.was_silent = 1;
    }
}

/** What must be right for the bridge to be on, and what tells of it after a reset. */
QM_INLINE void firmware_supervise(void)
{
    firmware_watch_interrupt();
    if (board_clock_failed) {
        firmware_trip(FAULT_CLOCK);
    }
    if (BOARD_FLTA_LOW()) { /* its interrupt comes once: S2 must not clear a fault that is still there */
        firmware_trip(FAULT_OVERCURRENT_HW);
    }
    selftest_pass();
    reset_keep(board_drive.fault);
    reset_serve_watchdog(board_drive.ticks);
    record_tick();
    firmware_find(signals_phases(&judged.signals, &board_drive, &board_params));
}

/** What a millisecond's look at the drive finds wrong. */
QM_INLINE void firmware_judge(uint16_t elapsed_ms)
{
    firmware_find(signals_d_current(&judged.signals, &board_drive, &board_params));
    firmware_find(signals_offset(&judged.signals, &board_drive, &board_params));
#if HEAT_USED
    firmware_find(heat_follow(&board_drive, &board_params));
#endif
    if (overload_tick(&judged.overload, &board_drive, &board_params, elapsed_ms)) {
        firmware_trip(FAULT_OVERTEMPERATURE);
    }
}

void firmware_background(void)
{
    uint16_t elapsed_ms = (uint16_t)((uint16_t)(board_drive.ticks - last_ms_tick) / PERIODS_PER_MS);
    firmware_supervise();
    app_pulse_look(board_drive.ticks);
    if (elapsed_ms != 0u) {
        last_ms_tick = (uint16_t)(last_ms_tick + elapsed_ms * PERIODS_PER_MS);
        if (!mode_panel(elapsed_ms)) {
            application_tick(elapsed_ms);
        }
        retry_tick(&board_retry, &board_request, &board_drive, elapsed_ms);
        selftest_part(SELFTEST_PART_PANEL);
        watch_refresh();
        firmware_judge(elapsed_ms);
        selftest_part(SELFTEST_PART_WATCH);
        status_tick(elapsed_ms);
        kept_tick(elapsed_ms);
        selftest_part(SELFTEST_PART_STATUS);
        selftest_ms();
        firmware_turn_input();
    }
    status_send();
}
