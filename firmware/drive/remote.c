/* Remote control: who is in command, and what a client's command comes to. */
#include "drive/remote.h"

#include "drive/modes/modes.h"

#if SCOPE

void remote_give_up(remote_t *r)
{
    r->mode = REMOTE_PANEL;
    r->lease_ms = 0;
    r->is_taken = 0;
    r->has_started = 0;
}

void remote_init(remote_t *r)
{
    remote_give_up(r);
    r->run = 0;
    r->clear_fault = 0;
}

/** As S2 would in a fault. */
static void remote_clear(panel_t *panel, drive_t *d)
{
    if (d->fault != (uint16_t)FAULT_NONE) {
        d->command.clear_fault = 1;
        panel->interrupted = 0;
    }
}

/** A new wish. No run begins in a fault. */
static void remote_wish(remote_t *r, panel_t *panel, const drive_t *d, uint16_t run)
{
    r->seen_run = run;
    r->has_started = (uint16_t)(run && d->fault == (uint16_t)FAULT_NONE);
    panel->wish_run = (int16_t)r->has_started;
    panel->interrupted = 0;
}

void remote_tick(remote_t *r, panel_t *panel, drive_t *d, uint16_t elapsed_ms)
{
    uint16_t run = (uint16_t)(r->run != 0u);

    if (r->lease_ms > REMOTE_LEASE_MOST_MS) {
        r->lease_ms = REMOTE_LEASE_MOST_MS;
    }
    if (r->mode == (uint16_t)REMOTE_PANEL || r->mode >= (uint16_t)REMOTE_MODE_COUNT || r->lease_ms <= elapsed_ms) {
        if (r->has_started) {
            panel->wish_run = 0;
        }
        remote_give_up(r);
        return;
    }
    r->lease_ms = (uint16_t)(r->lease_ms - elapsed_ms);
    if (!r->is_taken) {
        r->is_taken = 1;
        r->seen_run = (uint16_t)panel->wish_run;
    }
    if (r->clear_fault) {
        r->clear_fault = 0;
        remote_clear(panel, d);
    }
    if (run != r->seen_run) {
        remote_wish(r, panel, d, run);
    }
}

int16_t remote_target(const remote_t *r, const drive_params_t *p, int16_t of_panel)
{
    int16_t low = mode_target_range(p, 0).low, high = mode_target_range(p, 1).high, size;
    if (r->mode != (uint16_t)REMOTE_TARGET) {
        return of_panel;
    }
    size = qm_clamp(qm_abs(r->target_erpm), low, high);
    return (int16_t)((r->target_erpm < 0) ? -size : size);
}

#endif
