/* What a client on the serial line asks of the drive: nothing where SCOPE is 0. */
#include "drive/remote.h"

#include "drive/drive.h"
#include "drive/request.h"

#if SCOPE
void remote_give_up(remote_t *r)
{
    r->mode = REMOTE_PANEL;
    r->lease_ms = 0;
    r->is_taken = 0;
    r->has_started = 0;
}

uint16_t remote_is_in_command(const remote_t *r)
{
    return r->is_taken;
}

void remote_init(remote_t *r)
{
    remote_give_up(r);
    r->run = 0;
    r->clear_fault = 0;
}

/** As S2 would in a fault. */
static void remote_clear(request_t *request, drive_t *d)
{
    if (d->fault != (uint16_t)FAULT_NONE) {
        d->command.clear_fault = 1;
        request->interrupted = 0;
    }
}

/** 1 while the client is in command. */
static uint16_t remote_holds(const remote_t *r, uint16_t elapsed_ms)
{
    return (uint16_t)(r->mode != (uint16_t)REMOTE_PANEL && r->mode < (uint16_t)REMOTE_MODE_COUNT && r->lease_ms > elapsed_ms);
}

/** A start is a change from 0 to 1, so that neither a new lease nor the end of a fault is one; a stop is a 0. */
static void remote_wish(remote_t *r, request_t *request, const drive_t *d, uint16_t starts)
{
    if (r->run == 0u) {
        r->has_started = 0;
        request->wish_run = 0;
        request->interrupted = 0;
    } else if (starts && d->fault == (uint16_t)FAULT_NONE) {
        r->has_started = (uint16_t)(r->has_started || !request->wish_run);
        request->wish_run = 1;
    } else { /* as it is */
    }
}

void remote_tick(remote_t *r, request_t *request, drive_t *d, uint16_t elapsed_ms)
{
    uint16_t starts = (uint16_t)(r->run != 0u && !r->seen_run);
    r->seen_run = (uint16_t)(r->run != 0u);
    if (r->lease_ms > REMOTE_LEASE_MOST_MS) {
        r->lease_ms = REMOTE_LEASE_MOST_MS;
    }
    if (remote_holds(r, elapsed_ms)) {
        r->is_taken = 1;
        r->lease_ms = (uint16_t)(r->lease_ms - elapsed_ms);
        if (r->clear_fault) {
            remote_clear(request, d);
        }
        remote_wish(r, request, d, starts);
    } else if (r->is_taken) {
        if (r->has_started) {
            request->wish_run = 0;
        }
        remote_give_up(r);
    } else { /* the panel is in command */
    }
    r->clear_fault = 0;
}

int16_t remote_target(const remote_t *r, int16_t of_panel)
{
    return (r->is_taken && r->mode == (uint16_t)REMOTE_TARGET) ? r->target_erpm : of_panel;
}
#endif
