/* The retry: a run that a passing fault has ended starts again by itself, after a pause and a stated number of times. */
#include "drive/retry.h"

#include "drive/drive.h"
#include "drive/faults.h"
#include "drive/panel.h"
#include "drive/param_scaling.h"
#include "drive/states.h"

#define RETRY_MS(seconds) ((uint32_t)(PARAM_F(seconds) * 1000.0F + 0.5F))

void retry_init(retry_t *r)
{
    drive_zero(r, sizeof *r);
    r->left = RETRY_COUNT;
}

/** 1 for a fault that may pass by itself (drive/faults.h). */
static uint16_t retry_may_pass(uint16_t fault)
{
#define PASSING_BIT(code, name, passes, decided_by, cause, remedy) | ((uint32_t)(passes) << (code))
    const uint32_t passing = 0ul DRIVE_FAULT_TABLE(PASSING_BIT);
    return (uint16_t)((passing >> fault) & 1u);
}

/** Counts a time. @return 1 when it is over; it then begins anew */
static uint16_t time_is_over(retry_t *r, uint16_t elapsed_ms, uint32_t time_ms)
{
    r->waited_ms += elapsed_ms;
    if (r->waited_ms < time_ms) {
        return 0;
    }
    r->waited_ms = 0;
    return 1;
}

/** A fault stands that has ended a run. */
static void retry_pause(retry_t *r, drive_t *d, uint16_t elapsed_ms)
{
    if (r->first == (uint16_t)FAULT_NONE) {
        r->first = d->fault;
    }
    if (r->fault != d->fault) {
        r->fault = d->fault;
        r->waited_ms = 0;
    }
    r->asked = 0;
    if (r->left != 0u && retry_may_pass(d->fault) && time_is_over(r, elapsed_ms, RETRY_MS(RETRY_PAUSE_SEC))) {
        r->left--;
        r->asked = 1;
        d->command.clear_fault = 1;
    }
}

void retry_tick(retry_t *r, panel_t *panel, drive_t *d, uint16_t elapsed_ms)
{
    if (RETRY_COUNT == 0) {
        return;
    }
    if (!panel->interrupted) {
        uint16_t calm = (uint16_t)(drive_is_closed(d) && time_is_over(r, elapsed_ms, RETRY_MS(RETRY_FORGET_SEC)));
        if (calm || !panel->wish_run) { /* long enough without a fault, or a person has stopped it */
            retry_init(r);
        }
    } else if (d->fault != (uint16_t)FAULT_NONE) {
        retry_pause(r, d, elapsed_ms);
    } else if (!r->asked) {
        panel->interrupted = 0; /* somebody else has cleared it */
    } else if (d->state == (uint16_t)DRIVE_STOPPED) {
        uint16_t held = panel_holds(panel);
        panel->interrupted = 0;
        panel->wish_run = 1;
        panel_keep(panel, held);
        r->fault = (uint16_t)FAULT_NONE;
        r->asked = 0;
        r->waited_ms = 0;
    } else {
        /* it is about to stop */
    }
}
