/* The schedule of the slow work: what runs in which slot, in one table. The code, docs/law.md and the self-test's flow signature come from it.
 *
 * A slot comes every second period, and the sixteen of them every 32: at 20 kHz 0.1 ms apart and 1.6 ms in all. At 20 kHz a call runs both halves of
 * its slot; above 25 kHz, where the duties are deferred (DEFER_DUTIES), it runs one, and a slot takes four periods. */
#ifndef DRIVE_SCHEDULE_H
#define DRIVE_SCHEDULE_H

#include "control/qmath.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

/** Raw converter results, signed fractional Q15. */
typedef struct {
    int16_t i_a, i_b, v_bus;
} drive_samples_t;

/* clang-format off */
/** SLOT(number, first half, in states, second half, in states): functions of schedule.c; EVERY, RUNNING (ALIGN to STOPPING) or CLOSED (CLOSED and
 *  STOPPING, the states in closed loop). */
#define SCHEDULE_TABLE(SLOT) \
    SLOT( 0, observe_load,  EVERY,     control_speed,    CLOSED) \
    SLOT( 1, step_state,    EVERY,     follow_bus,       EVERY) \
    SLOT( 2, limit_voltage, EVERY,     limit_currents,   CLOSED) \
    SLOT( 3, follow_speed,  CLOSED,    watch_signals,    CLOSED) \
    SLOT( 4, observe_load,  EVERY,     control_speed,    CLOSED) \
    SLOT( 5, ask_rotor,     EVERY,     follow_bus,       EVERY) \
    SLOT( 6, probe_rotor,   CLOSED,    choose_state,     CLOSED) \
    SLOT( 7, trim_speed,    CLOSED,    follow_estimate,  EVERY) \
    SLOT( 8, observe_load,  EVERY,     control_speed,    CLOSED) \
    SLOT( 9, step_state,    EVERY,     follow_bus,       EVERY) \
    SLOT(10, limit_voltage, EVERY,     limit_and_learn,  CLOSED) \
    SLOT(11, follow_speed,  CLOSED,    watch_signals,    CLOSED) \
    SLOT(12, observe_load,  EVERY,     control_speed,    CLOSED) \
    SLOT(13, ask_rotor,     EVERY,     follow_bus,       EVERY) \
    SLOT(14, update_model,  EVERY,     check_model,      CLOSED) \
    SLOT(15, trim_speed,    CLOSED,    follow_estimate,  EVERY)
/* clang-format on */

/** 1 in the periods that a call of the slow work follows. With the bridge off something follows each period. */
uint16_t schedule_is_due(uint16_t ticks);

/** Runs the slot of these ticks, or its half, and marks its end in the self-test's flow signature. @param raw the converter's results of this period */
void schedule_run(drive_t *d, const drive_params_t *p, const drive_samples_t *raw);

#endif
