/* The seam between the application's room and the drive: what it is told, what it asks, and how long it may take. */
#include "board/application.h"

#include "board/firmware.h"
#include "board/mclv.h"
#include "board/reset.h"
#include "board/watch.h"
#include "drive/request.h"

#define LATE_TICKS PARAM_PERIODS(0.001F * PARAM_F(APP_LATE_MS))
#define APPLICATION_STOP_SEC 3.0F
#define STOP_TICKS ((uint16_t)PARAM_MIN(PARAM_F(PARAM_PERIODS(APPLICATION_STOP_SEC)), 65000.0F))

pot_t board_pot BOARD_UNSET;

static contact_t direction_input BOARD_UNSET;

static volatile uint16_t application_runs BOARD_UNSET;     /* 1 during the call */
static volatile uint16_t application_since BOARD_UNSET;    /* drive ticks when it began */
static volatile uint16_t application_was_late BOARD_UNSET; /* 1 until that has its name */

void application_init(void)
{
    application_runs = 0;
    application_was_late = 0;
    pot_init(&board_pot);
    if (DIRECTION_INPUT_USED) {
        contact_init(&direction_input);
    }
    app_init();
}

/** What is set at the board: buttons, potentiometer, and the direction input, which turns round what the potentiometer's side means. */
static void application_operated(app_told_t *told, uint16_t elapsed_ms)
{
    int16_t turn = 1;
    told->inputs = (uint16_t)((BOARD_S2_DOWN() ? (uint16_t)APP_S2 : 0u) | (BOARD_S3_DOWN() ? (uint16_t)APP_S3 : 0u));
    if ((DIRECTION_INPUT_USED) && contact_settled(&direction_input, (uint16_t)BOARD_DIRECTION_ON(), elapsed_ms)) {
        told->inputs |= (uint16_t)APP_DIRECTION;
        turn = -1;
    }
    told->pot_is_lost = pot_is_broken(&board_pot, &board_params, elapsed_ms);
    told->towards = (int16_t)(turn * board_drive.direction);
    told->pot_q16 = mode_pot_split(pot_travel(&board_params, pot_smooth(&board_pot)), &told->towards);
    told->towards = (int16_t)(turn * told->towards);
}

/** Temperatures, of the sensors that there are. */
static void application_tell_heat(app_told_t *told UNUSED)
{
#if MOTOR_NTC_USED
    told->motor_q4 = board_drive.heat.motor.celsius_q4;
#endif
#if BRIDGE_NTC_USED
    told->bridge_q4 = board_drive.heat.bridge.celsius_q4;
#endif
}

/** What the application is told of the drive, and what stands. */
static void application_tell(app_told_t *told, app_asks_t *asks, uint16_t elapsed_ms)
{
    const drive_t *d = &board_drive;
    told->elapsed_ms = elapsed_ms;
    told->state = d->state;
    told->fault = d->fault;
    told->limits = LimitParm.now;
    told->is_running = drive_is_running(d);
    told->is_remote = 0;
#if SCOPE
    told->is_remote = remote_is_in_command(&scope_command);
#endif
    told->speed_erpm = told->is_running ? observer_speed(&d->run.observer) : 0;
    told->reference_erpm = d->run.control.reference_erpm;
    told->iq_q13 = d->run.control.i_q13.q;
    told->bus_q15 = qm_hi(d->bus_q31);
    application_operated(told, elapsed_ms);
    application_tell_heat(told);
    told->slow = mode_target_range(&board_params, 0);
    told->fast = mode_target_range(&board_params, 1);
    asks->run = request_stands(&board_request);
    asks->target_erpm = d->command.target_erpm;
    asks->clear_fault = 0;
    asks->fault = (uint16_t)FAULT_NONE;
    asks->take_command = 0;
#if APP_SERIAL
    told->heard = app_line_heard();
    asks->say = 0;
#endif
    app_pulse_take(told);
}

/** Of an application that was late and has returned: what it asks is a stop, and once that is over the fault has its name. */
static void application_ends(app_asks_t *asks)
{
    if (!application_was_late) {
        return;
    }
    asks->run = 0;
    asks->take_command = 1;
    if (!drive_conducts(&board_drive)) {
        asks->fault = (uint16_t)FAULT_APPLICATION;
        application_was_late = 0;
    }
}

/** A fault of the application's own. */
static void application_fault(uint16_t fault)
{
    if (fault != (uint16_t)FAULT_NONE) {
        firmware_trip((fault == (uint16_t)FAULT_POTENTIOMETER) ? FAULT_POTENTIOMETER : FAULT_APPLICATION);
    }
}

void application_tick(uint16_t elapsed_ms)
{
    static app_asks_t asks;
    app_told_t told;
    asked_t asked;
    application_tell(&told, &asks, elapsed_ms);
    application_since = board_drive.ticks;
    application_runs = 1;
    app_ms(&told, &asks);
    application_runs = 0;
    application_ends(&asks);
#if APP_SERIAL
    app_line_say(asks.say);
#endif
    application_fault(asks.fault);
    asked.run = asks.run;
    asked.target_erpm = asks.target_erpm;
    asked.clear_fault = asks.clear_fault;
    asked.take_command = asks.take_command;
    asked.elapsed_ms = elapsed_ms;
#if SCOPE
    asked.remote = &scope_command;
#endif
    request_tick(&board_request, &board_drive, &board_params, &asked);
    BOARD_SWITCH(BOARD_LED_ALIVE, asks.outputs & APP_LED_ALIVE);
    BOARD_SWITCH(BOARD_LED_RUN, asks.outputs & APP_LED_RUN);
}

void application_watch(void)
{
    uint16_t took;
    if (!application_runs) {
        return;
    }
    took = (uint16_t)(board_drive.ticks - application_since);
    if (took <= LATE_TICKS) {
        ClrWdt();
    } else if (drive_conducts(&board_drive) && took < STOP_TICKS) {
        application_was_late = 1;
        board_drive.command.run = 0;
        ClrWdt();
    } else { /* it stands, or does not stop: the watchdog has the last word */
        firmware_trip(FAULT_APPLICATION);
        reset_keep(board_drive.fault);
    }
}
