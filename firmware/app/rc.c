/* Application: the speed is an RC servo pulse of 1..2 ms, 50 to 400 Hz; with -DPULSE_DUTY=1 a PWM duty of 5..95 %, 100 Hz to 10 kHz. Above PULSE_START the
 * motor turns, MINIMUM_SPEED_RPM to MAXIMUM_SPEED_RPM; below PULSE_STOP it stops. It starts only after PULSE_REST_MS below PULSE_STOP: at power-up, and
 * after a fault, which that clears. An odd pulse alone changes nothing. Without a signal for PULSE_LOST_MS, or with half of it odd for longer, the motor
 * stops in order; then the fault is POTENTIOMETER. */
#include "app/pulse.h"

#ifndef PULSE_DUTY
#define PULSE_DUTY 0
#endif
#define PULSE_STOP APP_SHARE(0.05)
#define PULSE_START APP_SHARE(0.08)
#define PULSE_STEP APP_SHARE(0.1) /* more from one pulse to the next is odd */
#define PULSE_REST_MS 500u        /* longer than PULSE_LOST_MS: before the first pulse the command is 0 */
#define PULSE_LOST_MS 300u
#define PULSE_PACE_MS 25u /* a good pulse speaks for so long at most, and takes twice that from the doubt */

static uint16_t command_q16, heard_q16, doubt_ms, since_ms, rest_ms, is_lost, is_on;

void app_init(void)
{
    command_q16 = heard_q16 = doubt_ms = since_ms = rest_ms = is_lost = is_on = 0;
}

/** Where a pulse lies in its range, to heard_q16. @return 1 if that is in the range or near it, and it comes at the pace of such a signal */
static uint16_t pulse_is_right(const app_told_t *told)
{
    const uint16_t period = told->period_200ns, value = PULSE_DUTY ? app_share(told->pulse_200ns, 0, period) : told->pulse_200ns;
    const uint16_t low = PULSE_DUTY ? APP_SHARE(0.05) : APP_PULSE_US(1000u), high = PULSE_DUTY ? APP_SHARE(0.95) : APP_PULSE_US(2000u);
    const uint16_t near = PULSE_DUTY ? APP_SHARE(0.02) : APP_PULSE_US(200u), quickest = PULSE_DUTY ? APP_PULSE_US(90u) : APP_PULSE_US(2400u);
    const uint16_t slowest = PULSE_DUTY ? APP_PULSE_US(11500u) : 65535u; /* a longer one is not measured */
    heard_q16 = app_share(value, low, high);
    return (uint16_t)(value >= low - near && value <= high + near && period >= quickest && period <= slowest);
}

/** What has come in this millisecond: a right pulse near the one before is a command. Lost is lost until the fault has its name. */
static void hear(const app_told_t *told)
{
    const uint16_t before_q16 = heard_q16, spoken_ms = (uint16_t)((since_ms < PULSE_PACE_MS) ? since_ms + told->elapsed_ms : since_ms);
    doubt_ms = (uint16_t)((doubt_ms < PULSE_LOST_MS) ? doubt_ms + told->elapsed_ms : doubt_ms);
    since_ms = (uint16_t)(told->pulse_200ns ? 0u : spoken_ms);
    if (told->pulse_200ns && pulse_is_right(told) && ((heard_q16 > before_q16) ? heard_q16 - before_q16 : before_q16 - heard_q16) <= PULSE_STEP) {
        command_q16 = heard_q16;
        doubt_ms = (uint16_t)((doubt_ms > 2u * spoken_ms) ? doubt_ms - 2u * spoken_ms : 0u);
    }
    is_lost = (uint16_t)(doubt_ms >= PULSE_LOST_MS || (is_lost && (doubt_ms || !told->fault)));
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    const app_range_t all = { told->slow.low, told->fast.high };
    hear(told);
    rest_ms = (uint16_t)((rest_ms < PULSE_REST_MS) ? ((command_q16 < PULSE_STOP) ? rest_ms + told->elapsed_ms : 0u) : rest_ms);
    rest_ms = (uint16_t)((is_lost || (is_on && told->fault)) ? 0u : rest_ms);
    is_on = (uint16_t)(rest_ms >= PULSE_REST_MS && !told->fault && command_q16 >= (is_on ? PULSE_STOP : PULSE_START));
    asks->clear_fault = (uint16_t)(told->fault && rest_ms >= PULSE_REST_MS);
    asks->fault = (uint16_t)((is_lost && !told->is_running && !told->is_remote) ? FAULT_POTENTIOMETER : FAULT_NONE);
    asks->run = (int16_t)(is_on && !told->is_remote);
    asks->target_erpm = app_between(all, app_share(command_q16, PULSE_START, 65535u));
    asks->outputs = app_lights(told);
}
